"""Estimates as estimate.json, as tables for a terminal, and as a vessel file."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.assessment import Assessed, Assessment, Limits, RunCheck, sentence
from expdesign.assessment.ahead import LARGEST_ERROR
from expdesign.assessment.held_out import ranked
from expdesign.assessment.misfit import AHEAD_S, ESTIMATION, TEST
from expdesign.conventions import plus_minus
from expdesign.estimation.excitation import Breach
from expdesign.estimation.solve import Direction
from expdesign.export import words
from expdesign.export.document import Table
from expdesign.export.files.disturbances import disturbance_entries, unstated_sentences
from expdesign.export.files.text import entry, finite, named_finite, strict_json, valued
from expdesign.export.files.vessel_file import vessel_toml
from expdesign.vessel import Vessel


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
        f"a simulation grows up to {worst:.2g}-fold. Judge these runs by the {AHEAD_S:g} s "
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


def parameter_table(found: Assessment) -> Table:
    """Parameters down, methods across, value and standard deviation in each cell, for a terminal."""
    names = [name for name in found.best.model.names if any(name in item.estimate.names for item in found.methods)]
    rows = [(name, *(_cell(item, name) for item in found.best_first)) for name in names]
    header = ("parameter", *(item.method.name for item in found.best_first))
    return Table(title="Estimates, with standard deviations", header=header, rows=rows, on="terminal")


def fit_table(found: Assessment) -> Table:
    """Runs down, methods across, fit of every output in per cent in each cell."""
    outputs = " ".join(found.best.model.outputs)
    rows = [
        (run.batch.name, run.use, *(_fits(item.runs[index]) for item in found.best_first))
        for index, run in enumerate(found.best.runs)
    ]
    header = ("run", "use", *(f"{item.method.name}: {outputs}" for item in found.best_first))
    title = "Fit of the simulated output to the measured one, in per cent"
    return Table(title=title, header=header, rows=rows, texts=2)


def prediction_table(found: Assessment) -> Table:
    """Errors of predictions by method, in per cent of the standard deviation, the best first."""
    of = "runs left out of the estimate" if all(item.unseen for item in found.compared) else "the runs used"
    title = f"Errors of predictions {AHEAD_S:g} s ahead of {of}, in per cent of the standard deviation"
    rows = [
        (
            item.label + ("" if item.sound else ", runs away" if not item.bounded else ", fails the runs it is from"),
            *(_error(share) for share in item.shares.tolist()),
            _error(item.share),
        )
        for item in (found.compared[place] for place in ranked(found.compared))
    ]
    return Table(title=title, header=("method", *found.best.model.outputs, "together"), rows=rows)


def failure_rows(found: Assessment) -> list[tuple[str, ...]]:
    """Methods that gave no estimate, or were not tried, and why."""
    return [*((label, str(error)) for label, error in found.failures), *(("oe", note) for note in found.notes)]


def _error(share: float) -> str:
    if math.isnan(share):
        return "-"
    if share >= LARGEST_ERROR:
        return f"over {100 * LARGEST_ERROR:g}"
    return f"{100 * share:.1f}"


def limit_table(found: Assessment) -> Table:
    """One sentence for each run, for a terminal."""
    pairs = zip(found.limits, found.best.runs, strict=True)
    rows = [(run.batch.name, sentence(limits, run)) for limits, run in pairs]
    return Table(header=("run", "cause of misfit"), rows=rows, texts=2, on="terminal")


def motion_words(found: Assessment) -> str:
    """The discretisation that the parameters belong to, and the prior that they are joined with."""
    if found.motion == "euler":
        return "The parameters belong to the Euler discretisation at the sample time of the data."
    text = "The parameters belong to the continuous-time motion, with inputs held constant between samples."
    return text if found.prior == "none" else f"{text} They are joined with what the vessel file knew before the data."


def _cell(item: Assessed, name: str) -> str:
    if name not in item.estimate.names:
        return f"{words.significant(item.estimate.held[name])} fixed"
    index = item.estimate.names.index(name)
    return plus_minus(float(item.estimate.values[index]), float(item.estimate.std[index]))


def _fits(run: RunCheck) -> str:
    if run.problem:
        return "diverges"
    return " ".join("-" if math.isnan(value) else f"{value:.1f}" for value in run.fit_percent.tolist())


COMMENT_WIDTH = 110  # characters of a line of comments


def estimate_json(found: Assessment, vessel: Vessel) -> str:
    """One entry per method, as estimate.json; numbers that are not finite are null."""
    return strict_json({item.method.name: _method_entry(found, item, vessel) for item in found.methods})


def estimate_values(found: Assessment) -> dict[str, Any]:
    """Numbers of all methods in short."""
    return {
        **({"why": found.why} if found.why else {}),
        "parameters_of": found.motion,
        "unstated": list(unstated_sentences(found)),
        "what_limits_the_fit": limit_entries(found),
        "methods_left_out": list(found.left_out),
        "methods": {
            item.method.name: {
                "parameters": shared["parameters"],
                "horizon_s": shared["horizon_s"],
                "predictions": shared["predictions"],
                "fit": shared["fit"],
                "samples_used": item.estimate.residuals.rows,
                "samples_used_by_equation": rows_by_equation(item),
                "steered": shared["steered"],
                "warnings": len(estimate_warnings(found, item)),
            }
            for item in found.methods
            for shared in (_shared_entry(found, item),)
        },
    }


def _shared_entry(found: Assessment, item: Assessed) -> dict[str, Any]:
    """What both say of a method."""
    steered = item.estimate.steered
    return {
        "parameters": valued(item.estimate.names, item.estimate.values, item.estimate.std),
        "horizon_s": item.horizon_s,
        # label of method and horizon -> errors of predictions of what was left out, over standard deviations
        "predictions": {
            own.label: {**named_finite(own.outputs, own.shares), "together": finite(own.share), "unseen": own.unseen}
            for own in found.compared
            if own.method is item.method
        },
        "fit": _per_run(item.runs, "fit_percent"),
        "steered": {
            "samples": steered.samples, "of": steered.of,
            "treatment": steered.treatment if steered.samples else None,
        },
    }  # fmt: skip


def _method_entry(found: Assessment, item: Assessed, vessel: Vessel) -> dict[str, Any]:
    estimate, model, shared = item.estimate, vessel.model, _shared_entry(found, item)
    q = len(estimate.nuisance_values)
    return {
        "title": item.method.title,
        "parameters": shared["parameters"],
        "held": dict(estimate.held),
        "nuisance": valued(
            estimate.nuisance_names,
            estimate.nuisance_values,
            estimate.joint_covariance.diagonal()[-q:] ** 0.5 if q else estimate.nuisance_values,
        ),
        "current_to": _current(item),
        "disturbances": disturbance_entries(item),
        "horizon_s": shared["horizon_s"],
        "predictions": shared["predictions"],
        "form": model.form,
        "parameters_of": found.motion,
        "prior": found.prior,
        "sample_time_s": found.record.batches[0].sample_time_s,
        "fit": shared["fit"],
        "rmse": _per_run(item.runs, "rmse"),
        "not_simulated": {run.batch.name: run.problem for run in item.runs if run.problem},
        "one_step_r2": named_finite(item.one_step.outputs, item.one_step.explained),
        "residuals": _residual_entry(item),
        "steered": shared["steered"],
        "feedback_test": _feedback(item),
        "null_space": {
            "singular_values": [finite(value) for value in estimate.null_space.singular_values.tolist()],
            "faint": [_direction(direction) for direction in estimate.null_space.faint],
        },
        "experiment_condition": [_breach(breach) for breach in item.breaches],
        "instruments": _instruments(found, item),
        "warnings": list(estimate_warnings(found, item)),
        "in_vessel_file": item is found.best,
        "unstated": list(unstated_sentences(found)) if item is found.best else [],
        "what_limits_the_fit": limit_entries(found) if item is found.best else None,
        "data": _data(found),
    }


def estimated_vessel(found: Assessment, vessel: Vessel, *, command: str) -> str:
    """The vessel file with the estimate, and comments on its origin."""
    best = found.best
    files = ", ".join(batch.name for batch in found.record.batches[:3])
    more = f" and {len(found.record.batches) - 3} more" if len(found.record.batches) > 3 else ""
    held = ", ".join(name for name in vessel.model.names if name in best.estimate.held)
    comments = [
        f"Parameters estimated by {best.method.title} ({best.method.name}) from",
        f"{files}{more}.",
        *(line for text in (found.why, *unstated_sentences(found)) for line in textwrap.wrap(text, COMMENT_WIDTH)),
        "The other estimates are in estimate.json. parameter_std holds the standard deviations of the estimates.",
        motion_words(found),
        *([f"Fixed parameters, without standard deviation: {held}."] if held else []),
        *(["Dead times and lags in [std] are those that output error found."] if best.std != vessel.std else []),
        f"Made by: {command}",
    ]
    surge = np.concatenate([batch.velocity[:, 0] for batch in found.record.batches])
    speeds = (float(np.nanmin(surge)), float(np.nanmax(surge)))
    model = replace(best.model, speeds_mps=speeds if np.isfinite(speeds).all() else None, missed=found.missed)
    return vessel_toml(replace(vessel, model=model, std=best.std), comments=comments)


def limit_entries(found: Assessment) -> dict[str, Any]:
    """Run -> causes of misfit of its simulation with the chosen estimate: numbers and a sentence."""
    shares, ahead = ("constant", "slow", "quick", "parameters", "ceiling_percent"), ("ahead_rms", "ahead_share")

    def by_output(limits: Limits, name: str) -> dict[str, float | None]:
        return named_finite(limits.outputs, getattr(limits, name))

    return {
        run.batch.name: {
            "sentence": sentence(limits, run),
            # an error that has grown many times over has no shares that add up
            **{name: None if limits.unstable else by_output(limits, name) for name in shares},
            **{name: by_output(limits, name) for name in ahead},
            "growth_of_an_error": finite(limits.growth),
            "doubling_s": finite(limits.doubling_s),
        }
        for limits, run in zip(found.limits, found.best.runs, strict=True)
    }


def _per_run(runs: Sequence[RunCheck], what: str) -> dict[str, Any]:
    return {
        use: {run.batch.name: named_finite(run.outputs, getattr(run, what)) for run in runs if run.use == use}
        for use in (ESTIMATION, TEST)
    }


def _residual_entry(item: Assessed) -> dict[str, Any]:
    found = item.estimate.residuals
    return {
        "std": named_finite(found.outputs, found.std),
        "correlation_with_sample_before": named_finite(found.outputs, found.correlation),
        "rows": found.rows,
        "rows_by_equation": rows_by_equation(item),
        "left_out": found.left_out,
        "lags_in_covariance": found.lags,
    }


def rows_by_equation(item: Assessed) -> dict[str, int]:
    """Samples that each equation used."""
    found = item.estimate.residuals
    return dict(zip(found.outputs, found.rows_of.tolist(), strict=True))


def _feedback(item: Assessed) -> dict[str, Any] | None:
    found = item.estimate.feedback
    if found is None:
        return None
    return {
        "statistic": finite(found.statistic),
        "degrees_of_freedom": found.freedom,
        "p_value": finite(found.chance),
        "samples": found.samples,
    }


def _instruments(found: Assessment, item: Assessed) -> dict[str, Any] | None:
    if not item.uses_instruments:
        return None
    return {"mean_subtraction": found.mean, "start": item.start, "refinements": item.estimate.refinements}


def _current(item: Assessed) -> dict[str, Any] | None:
    current = item.disturbances.current
    if current is None:
        return None
    return valued(("north_mps", "east_mps"), current.mean, current.covariance.diagonal()[:2] ** 0.5)


def _data(found: Assessment) -> dict[str, Any]:
    return {
        "runs": [
            {"name": batch.name, "use": use, "samples": len(batch), "first_row": batch.first_row}
            for use, record in ((ESTIMATION, found.record), (TEST, found.tests))
            for batch in record.batches
        ],
        "doubts": list(dict.fromkeys([*found.record.doubts, *found.tests.doubts])),
        "notes": [*found.record.notes, *found.tests.notes],
        "methods_left_out": list(found.left_out),
    }


def _direction(direction: Direction) -> dict[str, Any]:
    weights = dict(zip(direction.parameters, direction.weights.tolist(), strict=True))
    return {"weights": weights, "strength": finite(direction.strength)}


def _breach(breach: Breach) -> dict[str, Any]:
    return {
        "run": breach.batch,
        **entry(breach, "inside", "parameters", "margin"),
        "samples": len(breach.samples),
        "of": breach.count,
        "sentence": str(breach),
    }
