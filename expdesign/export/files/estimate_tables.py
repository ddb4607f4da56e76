"""Estimates in words: tables for a terminal, and warnings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from expdesign.assessment import Assessed, Assessment, RunCheck, sentence
from expdesign.assessment.held_out import ranked
from expdesign.assessment.tuning import TUNING as ASSESSMENT_TUNING
from expdesign.estimation.excitation import Breach
from expdesign.export import words

PLUS_MINUS = "\N{PLUS-MINUS SIGN}"


def estimate_warnings(found: Assessment, item: Assessed) -> tuple[str, ...]:
    """Warnings for the user of an estimate, one sentence each."""
    diverged = [f"The simulation diverges: {run.problem}." for run in item.runs if run.problem]
    unstable = unstable_warning(found) if item is found.best else ()
    breaches = breach_sentences(item.breaches, len(found.record.batches))
    return (*item.estimate.warnings, *diverged, *unstable, *breaches)


def unstable_warning(found: Assessment) -> tuple[str, ...]:
    """A warning where the ship is unstable under recorded inputs; the simulated fit is then not meaningful."""
    runs = [run.batch.name for limits, run in zip(found.limits, found.best.runs, strict=True) if limits.unstable]
    if not runs:
        return ()
    worst = max(limits.growth for limits in found.limits if limits.unstable)
    return (
        f"The ship is unstable under the recorded inputs in {', '.join(runs)}: with this estimate an initial error of "
        f"a simulation grows up to {worst:.2g}-fold. Judge these runs by the {ASSESSMENT_TUNING.ahead_s:g} s "
        "prediction.",
    )


def breach_sentences(breaches: Sequence[Breach], runs: int) -> list[str]:
    """One sentence for each absolute value that breaks the excitation condition, over all runs."""
    sentences = []
    for inside in dict.fromkeys(breach.inside for breach in breaches):
        same = [breach for breach in breaches if breach.inside == inside]
        share = sum(len(breach.samples) for breach in same) / sum(breach.count for breach in same)
        worst = max(breach.margin for breach in same)
        broken, parameters = {b.batch for b in same}, dict.fromkeys(name for b in same for name in b.parameters)
        nearer = f"changes sign or comes closer to zero than {worst:.3g}" if worst > 0 else "changes sign"
        sentences.append(
            f"The excitation condition does not hold for {inside}, inside an absolute value in the term of "
            f"{', '.join(parameters)}. It {nearer} in {len(broken)} of {words.counted(runs, 'run')} and "
            f"{words.percent(share)} of their samples. Noise and disturbances then bias these parameters."
        )
    return sentences


def parameter_table(found: Assessment) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: parameters down, methods across, value and standard deviation in each cell."""
    names = [name for name in found.best.model.names if any(name in item.estimate.names for item in found.methods)]
    rows = [(name, *(_cell(item, name) for item in found.methods)) for name in names]
    return ("parameter", *(item.method.name for item in found.methods)), rows


def fit_table(found: Assessment) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: runs down, methods across, fit of every output in per cent in each cell."""
    outputs = " ".join(found.best.model.outputs)
    rows = [
        (run.batch.name, run.use, *(_fits(item.runs[index]) for item in found.methods))
        for index, run in enumerate(found.best.runs)
    ]
    return ("run", "use", *(f"{item.method.name}: {outputs}" for item in found.methods)), rows


def prediction_table(found: Assessment) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: errors of predictions by method, in per cent of the standard deviation, the best first."""
    rows = [
        (item.label, *(_error(share) for share in item.shares.tolist()), _error(item.share))
        for item in (found.compared[place] for place in ranked(found.compared))
    ]
    return ("method", *found.best.model.outputs, "together"), rows


def failure_rows(found: Assessment) -> list[tuple[str, ...]]:
    """Methods that gave no estimate, or were not tried, and why."""
    return [*((label, str(error)) for label, error in found.failures), *(("oe", note) for note in found.notes)]


def prediction_title(found: Assessment) -> str:
    """What that table shows."""
    of = "runs left out of the estimate" if all(item.unseen for item in found.compared) else "the runs used"
    return f"Errors of predictions {ASSESSMENT_TUNING.ahead_s:g} s ahead of {of}, in per cent of the standard deviation"


def _error(share: float) -> str:
    if math.isnan(share):
        return "-"
    if share >= ASSESSMENT_TUNING.largest_error:
        return f"over {100 * ASSESSMENT_TUNING.largest_error:g}"
    return f"{100 * share:.1f}"


def limit_table(found: Assessment) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: one sentence for each run."""
    pairs = zip(found.limits, found.best.runs, strict=True)
    return ("run", "cause of misfit"), [(run.batch.name, sentence(limits, run)) for limits, run in pairs]


def motion_words(found: Assessment) -> str:
    """The discretisation that the parameters belong to, and the prior that they are joined with."""
    if found.motion == "euler":
        return "The parameters belong to the Euler discretisation at the sample time of the data."
    text = "The parameters belong to the continuous-time motion, with inputs held constant between samples."
    return text if found.prior == "none" else f"{text} They are joined with what the vessel file knew before the data."


def plus_minus(value: float, std: float) -> str:
    """A value to the second digit of its standard deviation: -0.0548 ± 0.0036."""
    if not (std > 0 and math.isfinite(std)):
        return words.significant(value, 4)
    decimals = 1 - math.floor(math.log10(std))
    if abs(value) < 1e-4 or decimals > 9 or abs(value) >= 1e6:
        exponent = math.floor(math.log10(max(abs(value), std)))
        decimals = max(0, decimals + exponent)
        return f"({value / 10**exponent:.{decimals}f} {PLUS_MINUS} {std / 10**exponent:.{decimals}f})e{exponent}"
    return f"{value:.{max(0, decimals)}f} {PLUS_MINUS} {std:.{max(0, decimals)}f}"


def _cell(item: Assessed, name: str) -> str:
    if name not in item.estimate.names:
        return f"{words.significant(item.estimate.held[name])} fixed"
    index = item.estimate.names.index(name)
    return plus_minus(float(item.estimate.values[index]), float(item.estimate.std[index]))


def _fits(run: RunCheck) -> str:
    if run.problem:
        return "diverges"
    return " ".join("-" if math.isnan(value) else f"{value:.1f}" for value in run.fit_percent.tolist())
