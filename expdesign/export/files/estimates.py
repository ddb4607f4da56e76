"""Estimates as estimate.json, as tables for a terminal, and as a vessel file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from expdesign.assessment import Assessed, Assessment, RunCheck, sentence
from expdesign.assessment.limits import AHEAD_S
from expdesign.assessment.runs import ESTIMATION, TEST
from expdesign.estimation.excitation import Breach
from expdesign.estimation.solve import Direction
from expdesign.export import words
from expdesign.export.files.results import strict_json
from expdesign.export.files.vessel_file import vessel_toml
from expdesign.values import Array
from expdesign.vessel import Vessel

PLUS_MINUS = "\N{PLUS-MINUS SIGN}"


def estimate_json(found: Assessment, vessel: Vessel) -> str:
    """One entry per method, as estimate.json; what is not a number is null."""
    return strict_json({item.method.name: _method_entry(found, item, vessel) for item in found.methods})


def _method_entry(found: Assessment, item: Assessed, vessel: Vessel) -> dict[str, Any]:
    estimate, model = item.estimate, vessel.model
    q = len(estimate.nuisance_values)
    return {
        "title": item.method.title,
        "parameters": parameter_entries(item),
        "held": dict(estimate.held),
        "nuisance": _valued(
            estimate.nuisance_names,
            estimate.nuisance_values,
            estimate.joint_covariance.diagonal()[-q:] ** 0.5 if q else estimate.nuisance_values,
        ),
        "current_to": _current(item),
        "form": model.form,
        "parameters_of": found.motion,
        "sample_time_s": found.record.batches[0].sample_time_s,
        "fit": fit_entries(item),
        "rmse": _per_run(item.runs, "rmse"),
        "not_simulated": {run.batch.name: run.problem for run in item.runs if run.problem},
        "one_step_r2": _named(item.one_step.outputs, item.one_step.explained),
        "residuals": _residual_entry(item),
        "null_space": {
            "singular_values": [_finite(value) for value in estimate.null_space.singular_values.tolist()],
            "faint": [_direction(direction) for direction in estimate.null_space.faint],
        },
        "experiment_condition": [_breach(breach) for breach in item.breaches],
        "instruments": _instruments(found, item),
        "warnings": list(estimate_warnings(found, item)),
        "in_vessel_file": item is found.best,
        "what_limits_the_fit": limit_entries(found) if item is found.best else None,
        "data": _data(found),
    }


def parameter_entries(item: Assessed) -> dict[str, Any]:
    """{name: {value, std}} of the estimated parameters."""
    return _valued(item.estimate.names, item.estimate.values, item.estimate.std)


def fit_entries(item: Assessed) -> dict[str, Any]:
    """Fit of the simulated output [per cent] by use, run and output."""
    return _per_run(item.runs, "fit_percent")


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
        f"a simulation grows up to {worst:.2g}-fold. Judge these runs by the {AHEAD_S:g} s prediction. Output error "
        "needs a horizon (--horizon) with them.",
    )


def breach_sentences(breaches: Sequence[Breach], runs: int) -> list[str]:
    """One sentence for each absolute value that breaks the excitation condition, over all runs."""
    sentences = []
    for inside in dict.fromkeys(breach.inside for breach in breaches):
        same = [breach for breach in breaches if breach.inside == inside]
        share = sum(len(breach.samples) for breach in same) / sum(breach.count for breach in same)
        worst = max(breach.margin for breach in same)
        nearer = f"changes sign or comes closer to zero than {worst:.3g}" if worst > 0 else "changes sign"
        sentences.append(
            f"The excitation condition does not hold for {inside}, inside an absolute value in the term of "
            f"{', '.join(same[0].parameters)}. It {nearer} in {len(same)} of {words.counted(runs, 'run')} and "
            f"{words.percent(share)} of their samples. Noise and disturbances then bias these parameters."
        )
    return sentences


def estimated_vessel(found: Assessment, vessel: Vessel, *, command: str) -> str:
    """The vessel file with the estimate, and comments on its origin."""
    best = found.best
    files = ", ".join(batch.name for batch in found.record.batches[:3])
    more = f" and {len(found.record.batches) - 3} more" if len(found.record.batches) > 3 else ""
    held = ", ".join(name for name in vessel.model.names if name in best.estimate.held)
    comments = [
        f"Parameters estimated by {best.method.title} ({best.method.name}) from",
        f"{files}{more}.",
        "This is the first of the requested methods with instruments whose model can simulate every run; without",
        "instruments, the first that can. Reason: noisy regressors bias least squares. The other estimates are in",
        "estimate.json. parameter_std holds the standard deviations of the estimates.",
        motion_words(found),
        *([f"Fixed parameters, without standard deviation: {held}."] if held else []),
        f"Made by: {command}",
    ]
    return vessel_toml(replace(vessel, model=best.model), comments=comments)


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


def limit_entries(found: Assessment) -> dict[str, Any]:
    """Run -> causes of misfit of its simulation with the chosen estimate: numbers and a sentence."""
    shares = ("constant", "slow", "quick", "parameters", "ceiling_percent", "ahead_rms", "ahead_share")
    return {
        run.batch.name: {
            "sentence": sentence(limits, run),
            **{name: _named(limits.outputs, getattr(limits, name)) for name in shares},
            "growth_of_an_error": _finite(limits.growth),
            "doubling_s": _finite(limits.doubling_s),
        }
        for limits, run in zip(found.limits, found.best.runs, strict=True)
    }


def limit_table(found: Assessment) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: one sentence for each run."""
    pairs = zip(found.limits, found.best.runs, strict=True)
    return ("run", "cause of misfit"), [(run.batch.name, sentence(limits, run)) for limits, run in pairs]


def motion_words(found: Assessment) -> str:
    """The discretisation that the parameters belong to."""
    if found.motion == "euler":
        return "The parameters belong to the Euler discretisation at the sample time of the data."
    return "The parameters belong to the continuous-time motion, with inputs held constant between samples."


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


def _per_run(runs: Sequence[RunCheck], what: str) -> dict[str, Any]:
    return {
        use: {run.batch.name: _named(run.outputs, getattr(run, what)) for run in runs if run.use == use}
        for use in (ESTIMATION, TEST)
    }


def _residual_entry(item: Assessed) -> dict[str, Any]:
    found = item.estimate.residuals
    return {
        "std": _named(found.outputs, found.std),
        "correlation_with_sample_before": _named(found.outputs, found.correlation),
        "rows": found.rows,
        "left_out": found.left_out,
        "lags_in_covariance": found.lags,
    }


def _instruments(found: Assessment, item: Assessed) -> dict[str, Any] | None:
    if not item.uses_instruments:
        return None
    return {"mean_subtraction": found.mean, "start": item.start, "refinements": item.estimate.refinements}


def _current(item: Assessed) -> dict[str, Any] | None:
    if item.current is None:
        return None
    return _valued(("north_mps", "east_mps"), item.current.to_mps, item.current.std_mps)


def _data(found: Assessment) -> dict[str, Any]:
    return {
        "runs": [
            {"name": batch.name, "use": use, "samples": len(batch), "first_row": batch.first_row}
            for use, record in ((ESTIMATION, found.record), (TEST, found.tests))
            for batch in record.batches
        ],
        "notes": [*found.record.notes, *found.tests.notes],
        "methods_left_out": list(found.left_out),
    }


def _direction(direction: Direction) -> dict[str, Any]:
    weights = dict(zip(direction.parameters, direction.weights.tolist(), strict=True))
    return {"weights": weights, "strength": _finite(direction.strength)}


def _breach(breach: Breach) -> dict[str, Any]:
    return {
        "run": breach.batch,
        "inside": breach.inside,
        "parameters": list(breach.parameters),
        "margin": _finite(breach.margin),
        "samples": len(breach.samples),
        "of": breach.count,
        "sentence": str(breach),
    }


def _valued(names: Sequence[str], values: Array, stds: Array) -> dict[str, Any]:
    pairs = zip(names, values.tolist(), stds.tolist(), strict=True)
    return {name: {"value": _finite(value), "std": _finite(std)} for name, value, std in pairs}


def _named(outputs: Sequence[str], values: Array) -> dict[str, float | None]:
    return {name: _finite(value) for name, value in zip(outputs, values.tolist(), strict=True)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
