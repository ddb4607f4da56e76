"""Selected causes as findings: estimates, held-out gains, alternatives, explanations."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.diagnosis.causes import CAUSES, UNLISTED_TERM, Cause, Values
from expdesign.diagnosis.conclusions.verdict import effect_in_words
from expdesign.diagnosis.data import Noise, Windows
from expdesign.diagnosis.fit import Fit, HeldOut, held_out_gain, prediction_gain
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.select import Step, certain_reductions
from expdesign.diagnosis.values import ErrorReduction, Estimate, Finding
from expdesign.diagnosis.vessel_file import public_name, stated_values

CHANGED = "change:time"


def finding_of(
    step: Step, last: Fit, held: tuple[HeldOut, HeldOut], seed: int, windows: Windows, *, would_tell_apart: str | None
) -> Finding:
    """A step of the selection as a finding.

    Args:
        step: of the selection.
        last: the joint fit of all steps, which the estimates come from.
        held: errors on held-out units without and with the cause.
        seed: of the intervals.
        windows: all data.
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
        result.append(Estimate(name=name, value=offset + factor * value, std=abs(factor) * std, unit=unit))
    return tuple(result)


def error_reductions_of(
    outputs: Sequence[str], before: HeldOut, after: HeldOut, seed: int
) -> tuple[ErrorReduction, ...]:
    """Reductions of the simulated error of held-out units, with 95 % intervals by the bootstrap."""
    rows = zip(outputs, *(item.tolist() for item in certain_reductions(before, after, seed)), strict=True)
    return tuple(ErrorReduction(output=name, share=share, low=low, high=high) for name, share, low, high in rows)
