"""Findings of a diagnosis with their estimates and alternatives, and notes on what was not measured or not tested."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.diagnosis.accuracy import Accuracy
from expdesign.diagnosis.causes import CAUSES, UNLISTED_TERM, Cause, Values, rounded, wind_can_be_told
from expdesign.diagnosis.conclusions.verdict import effect_in_words, has_diverged, sign_of
from expdesign.diagnosis.data import Noise, Windows, missing_wind_share
from expdesign.diagnosis.fit import (
    AHEAD_S,
    FEWEST_RUNS,
    Fit,
    HeldOut,
    certain_reductions,
    held_out_gain,
    prediction_gain,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.select import SELECTION_TUNING, Selection, Step, p_value_between_runs, same_effects_as_any
from expdesign.diagnosis.values import ErrorReduction, Estimate, Finding
from expdesign.diagnosis.vessel_file import public_name, stated_values
from expdesign.signals import Record
from expdesign.vessel import Vessel

CHANGED = "change:time"


def finding_of(
    step: Step, last: Fit, held: tuple[HeldOut, HeldOut], seed: int, windows: Windows, *, would_tell_apart: str | None
) -> Finding:
    """A step of the selection as a finding.

    Args:
        last: the joint fit of all steps, which the estimates come from.
        held: errors on held-out units without and with the cause.
        would_tell_apart: the manoeuvre that distinguishes the cause from its alternatives best.
    """
    chosen, (before, after) = step.chosen, held
    gain, interval = held_out_gain(before, after, seed)
    values = _values(step, last)
    explanation = cause_of(chosen.candidate.cause).explain(values, last.ship) + stated_values(values, last.ship)
    if CHANGED in values:
        time, std = values[CHANGED]
        run, begin, _ = windows.place(time)
        values[CHANGED] = (time - begin, std)
        explanation = cause_of(chosen.candidate.cause).explain(values, last.ship) + f" Times are of {run}."
    reductions = error_reductions_of(chosen.fit.ship.model.outputs, before, after, seed)
    return Finding(
        cause=chosen.candidate.cause,
        estimates=_estimates(values, chosen.fit.ship),
        p_value=step.p_value,
        fit_before=before.fit,
        fit_after=after.fit,
        error_reductions=reductions,
        predicted=None
        if any(item.is_certain for item in reductions)
        else _predicted(before, after, windows, chosen.fit.noise),
        gain=gain,
        gain_interval=interval,
        not_distinguishable_from=tuple(dict.fromkeys(other.candidate.cause for other in step.alternatives)),
        alternatives=tuple(
            effect_in_words(other.candidate.cause, tuple(other.candidate.free)) for other in step.alternatives
        ),
        would_tell_apart=would_tell_apart,
        explanation=explanation,
        likelihood_gain=chosen.likelihood_gain,
        keys=tuple(values),
    )


def _predicted(before: HeldOut, after: HeldOut, windows: Windows, noise: Noise) -> ErrorReduction | None:
    """Reduction of the squared error of predictions from one sample to the next; None where that is not certain."""
    share, (low, high) = prediction_gain(before, after, windows, noise)
    return ErrorReduction(output="all", share=share, low=low, high=high) if low > 0.0 else None


def cause_of(name: str) -> Cause:
    """The entry of the catalogue that a name belongs to."""
    return next(cause for cause in (*CAUSES, UNLISTED_TERM) if cause.name == name.split(":")[0])


def _values(step: Step, last: Fit) -> dict[str, tuple[float, float]]:
    """Effects of a step with estimate and standard error; a profiled effect comes last."""
    chosen = step.chosen
    values = {key: (last.value(key), (last if key in last.keys else chosen.fit).std(key)) for key in chosen.keys}
    if chosen.candidate.cause == "parameters":  # the surest change first
        values = dict(sorted(values.items(), key=lambda item: -abs(item[1][0]) / max(item[1][1], 1e-300)))
    if chosen.profiled is not None:
        key, error = chosen.profiled
        values[key] = (last.value(key), error)
    return values


def _estimates(values: Values, ship: ExtendedModel) -> tuple[Estimate, ...]:
    result = []
    for key, (value, std) in values.items():
        name, factor, offset, unit = public_name(key, ship)
        stated = offset if key.startswith("theta:") else None
        if key in ship.stated:
            stated = offset + factor * ship.stated[key]
        result.append(
            Estimate(name=name, value=offset + factor * value, std=abs(factor) * std, unit=unit, stated=stated)
        )
    return tuple(result)


def error_reductions_of(
    outputs: Sequence[str], before: HeldOut, after: HeldOut, seed: int
) -> tuple[ErrorReduction, ...]:
    """Reductions of the simulated error of held-out units, with 95 % intervals."""
    rows = zip(outputs, *(item.tolist() for item in certain_reductions(before, after, seed)), strict=True)
    return tuple(ErrorReduction(output=name, share=share, low=low, high=high) for name, share, low, high in rows)


FEW = 0.002  # share of missing samples that needs no note


def notes_on_data(vessel: Vessel, record: Record, windows: Windows, constant: Sequence[str]) -> tuple[str, ...]:
    """Effects that the data cannot show.

    Args:
        constant: inputs that never change.
    """
    notes = []
    if not windows.has_heading:
        notes.append("No heading is measured. Current and wind cannot be distinguished from the ship's own motion.")
        weather = vessel.environment
        if weather.current_to.any() or (weather.wind_to.any() and not windows.has_wind):
            notes.append("The current and wind of the vessel file were left out, because they need a heading.")
    elif not (windows.has_wind or vessel.environment.wind_to.any() or wind_can_be_told(windows)):
        notes.append(
            "All headings are within 45 degrees of their mean. A wind that nobody measured was not tested: on such "
            "courses it is a constant force and moment, as several causes with fewer numbers are."
        )
    if len(np.unique(windows.batch)) < FEWEST_RUNS:
        notes.append(
            "Fewer than three runs: intervals of gains are of these runs sailed on. They tell nothing of how other "
            "runs differ."
        )
    missing = missing_wind_share(record)
    if windows.has_wind and missing > FEW:
        notes.append(f"The wind is missing in {100 * missing:.0f} % of the samples. Its last value was used there.")
    if not windows.has_wind and any(batch.wind is not None for batch in record.batches):
        notes.append("The wind is not measured in every run. The measured wind of the other runs was not used.")
    if not windows.has_depth:
        notes.append("No depth is measured. Shallow water was not tested.")
    if "r" in windows.derived:
        notes.append("The yaw rate is derived from the heading. The scale of a rate gyro was not tested.")
    if constant:
        verb, them = ("changes", "it") if len(constant) == 1 else ("change", "them")
        notes.append(f"{', '.join(constant)} never {verb}. Faults that act only through {them} cannot be seen.")
    if not (vessel.model.parameter_std > 0).any():
        notes.append("The vessel file has no parameter_std. Its parameters count as known.")
    return tuple(notes)


def note_on_divergence(before: Accuracy, windows: Windows, *, re_estimated: bool, uncertain: bool) -> tuple[str, ...]:
    """What is done about a model that cannot be simulated over whole runs.

    Args:
        before: accuracy of the model in use.
        re_estimated: the search began with the model re-estimated, instead of as it is.
        uncertain: something in the vessel file has a standard deviation.
    """
    if not has_diverged(before):
        return ()
    begin = "as it is"
    if re_estimated:
        begin = "re-estimated within its standard deviations in windows that grow"
    elif windows.steps * windows.step_s < AHEAD_S:
        begin += (
            ", because its parameters re-estimated within their standard deviations diverge too"
            if uncertain
            else ", because nothing in the vessel file has a standard deviation to re-estimate it within"
        )
    return (
        "Simulated over whole runs, the model in use diverges from the ship. So data and simulation are compared in "
        f"windows of {windows.steps * windows.step_s:.0f} s, each simulated from its first measured state, and the "
        f"search for causes begins with the model {begin}.",
    )


def note_on_random_current(noise: Noise) -> tuple[str, ...]:
    """A varying current that the tests allow for; the catalogue has no such cause."""
    if noise.current_std_mps < SELECTION_TUNING.large_current_mps:
        return ()
    return (
        f"Part of the error looks like a current that varies by {noise.current_std_mps:.2g} m/s with a correlation "
        f"time of {noise.current_time_s:.0f} s. The tests allow for it. It is not in the catalogue of causes, and it "
        "is not written to the vessel file.",
    )


def notes_on_rejected(found: Selection, kept: Selection, unit: str) -> tuple[str, ...]:
    """Causes that were significant in a test and are no findings.

    Args:
        found: by forward selection.
        kept: what backward elimination left of it.
        unit: what gains are measured on.
    """
    named = [step.chosen.candidate for step in kept.steps]
    rejected = [step for step in found.steps if not same_effects_as_any(step.chosen.candidate, named)]
    return tuple(
        f"The data show a sign of {_as_sign(step)} (p = "
        f"{p_value:.1g}). It is not a finding: on {unit} held out of the fit it takes less than 1 % off every error, "
        "or its gain or its size may be zero."
        for step in rejected
        if (p_value := _p_value_left(step, kept)) <= SELECTION_TUNING.level
    )


def _as_sign(step: Step) -> str:
    """The effect that a cause is a sign of."""
    return sign_of(step.chosen.candidate.cause, step.chosen.parameters)


def _p_value_left(step: Step, kept: Selection) -> float:
    """p-value of a rejected cause beside the findings, if it is tested beside them."""
    left = [item.adjusted for item in kept.last_tests if same_effects_as_any(item.candidate, [step.chosen.candidate])]
    return min(left) if left else p_value_between_runs(step.chosen, None, kept.dispersion)


def note_on_work(found: Selection) -> tuple[str, ...]:
    """What the search left untried at its limit of work."""
    if not found.untried:
        return ()
    return (
        f"The search ended at its limit of {SELECTION_TUNING.most_simulations} simulations of all data in fits of "
        f"candidates. Left untried: {', '.join(found.untried)}.",
    )


def notes_on_found_again(kept: Selection) -> tuple[str, ...]:
    """What the vessel file states with a standard deviation, beside what both it and the data say."""
    last = kept.last
    named = {key for step in kept.steps for key in step.chosen.keys}
    notes = []
    for key, std in last.ship.stated_std.items():
        if key in last.keys and key not in named:
            name, factor, offset, unit = public_name(key, last.ship)
            values = ((last.ship.stated[key], std), (last.value(key), last.std(key)))
            before, after = (rounded(offset + factor * value, abs(factor) * error) for value, error in values)
            notes.append(f"Found again and refined: {name}, {before} {unit} in the vessel file, is {after} {unit}.")
    return tuple(notes)


def note_on_nuisance(unfitted: HeldOut, fitted: HeldOut, seed: int) -> tuple[str, ...]:
    """Gain from uncertain parameters alone, which belongs to no cause.

    Args:
        unfitted: errors of the model in use.
        fitted: with its uncertain parameters fitted.
    """
    gain, _ = held_out_gain(unfitted, fitted, seed)
    if not abs(gain) >= SELECTION_TUNING.least_gain_points:
        return ()
    return (
        f"Fitting the parameters within their stated standard deviations changes the fit on held-out runs by "
        f"{gain:+.1f} points. The gains of causes come on top of that.",
    )


def note_on_parameters_alone(as_stated: HeldOut, alone: HeldOut, found: HeldOut, cause: str, seed: int) -> str:
    """What of the gain of the first cause is that of parameters re-estimated beside it.

    Args:
        as_stated, alone, found: errors of the model in use, with parameters re-estimated, and with the cause too.
        cause: its missing effect, in words.
    """
    gain, (own, (low, high)) = held_out_gain(as_stated, alone, seed)[0], held_out_gain(alone, found, seed)
    return (
        f"The gain of {cause} counts that of the parameters, which are re-estimated beyond their standard deviations "
        f"with it. Re-estimated without it, they change the fit by {gain:+.1f} points, and it adds {own:+.1f} "
        f"({low:.1f} to {high:.1f})."
    )


def note_on_stretches(held: Sequence[HeldOut], *, beside_stated: bool = False) -> tuple[str, ...]:
    """Gains that are not those of whole runs."""
    if not held[0].in_stretches:
        return ()
    if beside_stated:
        return (
            "Parameters re-estimated within their stated standard deviations simulate runs worse than those of "
            "the vessel file. So causes are fitted beside the parameters of the file, and gains are measured, in "
            f"stretches of {AHEAD_S:g} s, each simulated from its first measured state.",
        )
    return (
        "Fitted to the other runs, a model leads away from the ship in a whole run. So models are fitted, and gains "
        f"are measured, in stretches of {AHEAD_S:g} s, each simulated from its first measured state, a fifth of every "
        "run held out at a time. In a stretch an error counts as no larger than that of the run's mean. Stretches and "
        "outputs count by the geometric mean of their errors.",
    )


def note_on_predictions(
    as_stated: HeldOut, found: HeldOut, kept: Selection, replaced: Sequence[Step], seed: int
) -> tuple[str, ...]:
    """How a cause was found that a search by likelihood did not find, and its gain on the model in use as it is.

    Args:
        as_stated: errors of the model in use as its file states it, in stretches.
        found: those with the cause, held out.
        replaced: what the search had found.
    """
    gain, (low, high) = held_out_gain(as_stated, found, seed)
    names = " and ".join(map(_as_sign, replaced))
    left = (
        f"found {names}, which leaves much unexplained or may imitate other causes"
        if names
        else "found no certain cause"
    )
    stretches = f"in stretches of {AHEAD_S:g} s, a fifth of every run held out at a time"
    if kept.beside_stated:
        return (
            f"The search by likelihoods {left}. So causes were compared by predictions {stretches}. The gain stated is "
            "beside the parameters of the vessel file as they are: re-estimated, these predict no better for certain.",
        )
    return (
        f"The search by likelihoods {left}. So causes were compared by predictions {stretches}, "
        "each with the same model re-estimated without it: the parameters of "
        "the vessel file may have been fitted to these data too. "
        f"{f'The model with {names} predicts worse for certain. ' if names else ''}"
        f"On the model as its file states it, the gain of {_as_sign(kept.steps[0])} with "
        f"all parameters re-estimated is {gain:+.1f} points ({low:.1f} to {high:.1f}).",
    )


def note_beside_the_same_fit(kept: Selection) -> tuple[str, ...]:
    """What the gain of the first cause is relative to, where it is not the model in use."""
    return (
        "The parameters of the vessel file may have been fitted to these data too. So the gain of "
        f"{_as_sign(kept.steps[0])} is that on the model re-estimated without it as it is "
        "with it.",
    )


def note_on_unconverged(held: Sequence[HeldOut]) -> tuple[str, ...]:
    """Gains that are measured only partly on held-out data."""
    folds = sum(item.unconverged for item in held)
    if not folds:
        return ()
    return (
        f"{folds} fits of the cross-validation did not improve on the fit to all runs. They used its estimates, so "
        "part of the gains is measured on runs that were used in the fit.",
    )
