"""The diagnosis from data and vessel to findings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from expdesign.diagnosis.causes import CAUSES, Cause, Values
from expdesign.diagnosis.data import Windows, cut_windows, spread
from expdesign.diagnosis.extension import as_extended, as_stated, extend, public_name
from expdesign.diagnosis.fit import Fit, HeldOut, gained, held_out
from expdesign.diagnosis.model import (
    Extended,
    accuracy,
    check_support,
    first_states,
    linearise,
    short_residuals,
    simulate_from_first,
    start_responses,
    still_inputs,
)
from expdesign.diagnosis.notes import note_on_weather, notes_on_data, notes_on_dropped
from expdesign.diagnosis.select import (
    LEAST_GAIN,
    Proposal,
    Search,
    Step,
    kept,
    most_telling,
    only_moves,
    search,
    standard_proposals,
)
from expdesign.diagnosis.values import Diagnosis, Estimated, Finding
from expdesign.diagnosis.verdict import error_falls, held_apart, verdict
from expdesign.errors import Diverged
from expdesign.signals import Record
from expdesign.vessel import Vessel

Progress = Callable[[str, float], None]
UNITS = 4
SHORTENINGS, SHORTEST, LARGEST_GROWTH = 4, 30, 6.0
"""Rounds and fewest samples of shortening windows of unstable models, and how much an error may grow in them."""


def diagnose(
    vessel: Vessel,
    record: Record,
    *,
    seed: int = 0,
    proposals: Sequence[Proposal] = (),
    progress: Progress = lambda what, share: None,
) -> Diagnosis:
    """Show what the simulation gets wrong, name the causes, extend the model, measure the gain.

    Args:
        vessel: the model in use; parameters with a standard deviation are re-estimated within it, others are known.
        record: measured data; velocities over ground, inputs, perhaps pose, wind and depth.
        seed: of the draws behind corrected p-values and gain intervals.
        proposals: manoeuvres to choose from for telling causes apart; standard ones when empty.
        progress: told what is being done and the share of it done.

    Raises:
        NotInformative: the data cannot support a diagnosis; the message says what is missing.
        Diverged: the model in use cannot be simulated over the data.
    """
    rng = np.random.default_rng(seed)
    progress("simulating the model in use", 0.0)
    ship = as_extended(vessel, record)
    windows = _windows(ship, record)
    check_support(ship, windows)
    before = accuracy(ship, record)
    motion = simulate_from_first(ship, windows)
    if motion.diverged:
        raise Diverged(f"vessel {vessel.name!r}: its simulation of the data diverges; the model is unstable")
    found = search(ship, windows, first_states(windows), rng, lambda what, share: progress(what, 0.05 + 0.6 * share))

    def measured(found: Search) -> list[HeldOut]:
        return _held_out(found, ship, windows, lambda share: progress("measuring the gain on held-out runs", share))

    searched = found
    found, held = kept(searched, windows, measured, seed)
    progress("looking for manoeuvres that tell causes apart", 0.92)
    proposed = proposals or standard_proposals(windows, ship.model.inputs, windows.sample_s)
    findings = tuple(
        _finding(step, found.last, held[index], held[index + 1], windows, proposed, seed)
        for index, step in enumerate(found.steps)
    )
    last = found.last if found.steps else found.first
    final = last.ship if found.steps else ship
    extended, missing = extend(vessel, final, _stds(last) if found.steps else {})
    after = accuracy(final, record)
    order = sorted(range(len(findings)), key=lambda index: -findings[index].gain)
    return Diagnosis(
        vessel=vessel,
        extended=extended,
        record=record,
        windows=windows,
        before=before,
        after=after,
        findings=tuple(findings[index] for index in order),
        verdict=verdict([findings[index] for index in order], before, held_apart(windows)),
        simulated_before=motion.shown,
        simulated_after=simulate_from_first(final, windows).shown,
        errors=tuple(found.steps[index].before.linear.motion.error for index in order),
        residuals=short_residuals(ship, windows),
        lacking=tuple(short_residuals(found.steps[index].before.ship, windows) for index in order),
        notes=(
            *notes_on_data(vessel, record, windows, still_inputs(ship, windows)),
            *notes_on_dropped(searched, found, held_apart(windows)),
            *_settled_note(found, ship, windows, held[0], seed),
            *_stuck_note(held),
            *note_on_weather(found.last.noise.wander_mps, found.last.noise.wander_time_s),
            *missing,
        ),
        screened=_screened(found),
    )


def _windows(ship: Extended, record: Record) -> Windows:
    """As long as may be, but at least four, and no longer than an error in a state stays of its own size."""
    total = sum(len(batch) * batch.sample_time_s for batch in record.batches)
    windows = cut_windows(ship.model, record)
    if len(windows.batch) < UNITS:
        windows = cut_windows(ship.model, record, longest_s=total / UNITS)
    for _ in range(SHORTENINGS):
        steady_s = _steady_time(ship, windows)
        if steady_s >= windows.steps * windows.step_s:
            break
        windows = cut_windows(ship.model, record, longest_s=steady_s)
    return windows


def _steady_time(ship: Extended, windows: Windows) -> float:
    """Time within which no error of a state, in units of the measured spread, grows beyond `LARGEST_GROWTH`."""
    motion = simulate_from_first(ship, windows)
    if motion.diverged:
        return windows.steps * windows.step_s / 2
    size = spread(windows.measured[..., :3])
    scale = np.where(size > 0, size, 1.0)
    answers = np.moveaxis(start_responses(linearise(motion))[..., :3], 0, -1) * scale / scale[:, None]
    size = np.linalg.norm(answers, axis=(2, 3)) / np.sqrt(3.0)
    grown = (size > LARGEST_GROWTH).any(axis=0)
    samples = int(np.argmax(grown)) if grown.any() else len(grown)
    return max(samples, SHORTEST) * windows.sample_s if grown.any() else windows.steps * windows.step_s


def _held_out(found: Search, ship: Extended, windows: Windows, tell: Callable[[float], None]) -> list[HeldOut]:
    """Of the model in use, uncertain parameters at their likeliest, then after every step.

    What uncertain parameters mend by themselves is no merit of a cause, but of parameters beyond their bounds it is.
    """
    settled = bool(found.first.keys) and not any(only_moves(step, found) for step in found.steps[:1])
    fits: list[Fit | None] = [found.first if settled else None, *(step.chosen.fit for step in found.steps)]
    results = []
    for number, item in enumerate(fits):
        low, part = 0.65 + 0.27 * number / len(fits), 0.27 / len(fits)
        results.append(held_out(item, ship if item is None else item.ship, windows, _onward(tell, low, part)))
    return results


def _onward(tell: Callable[[float], None], low: float, part: float) -> Callable[[float], None]:
    return lambda share: tell(low + part * share)


def cause_of(name: str) -> Cause:
    """The entry of the catalogue that a name belongs to."""
    return next(cause for cause in CAUSES if cause.name == name.split(":")[0])


def _finding(
    step: Step, last: Fit, before: HeldOut, after: HeldOut, windows: Windows, proposals: Sequence[Proposal],
    seed: int,
) -> Finding:  # fmt: skip
    """A step of the search in words; its numbers are estimated together with those of all other steps."""
    chosen = step.chosen
    gain, interval = gained(before, after, seed)
    values: dict[str, tuple[float, float]] = {
        key: (last.value(key), last.std(key)) if key in last.keys else (last.value(key), chosen.fit.std(key))
        for key in chosen.keys
    }
    if chosen.searched is not None:
        key, error = chosen.searched
        values[key] = (last.value(key), error)
    cause = cause_of(chosen.candidate.cause)
    telling = None
    if step.rivals:
        std = np.where(np.isfinite(chosen.fit.noise.std), chosen.fit.noise.std, np.inf)
        telling = most_telling(chosen.fit.ship, [rival.fit.ship for rival in step.rivals], proposals, std, windows)
    return Finding(
        cause=chosen.candidate.cause,
        estimates=_estimates(values, chosen.fit.ship),
        p_value=step.p_value,
        fit_before=before.fit,
        fit_after=after.fit,
        falls=error_falls(chosen.fit.ship.model.outputs, before, after, seed),
        gain=gain,
        gain_interval=interval,
        not_distinguishable_from=tuple(rival.candidate.cause for rival in step.rivals),
        would_tell_apart=telling,
        explanation=cause.explain(values, last.ship) + as_stated(values, last.ship),
        worth=chosen.gain,
        keys=tuple(values),
    )


def _estimates(values: Values, ship: Extended) -> tuple[Estimated, ...]:
    result = []
    for key, (value, std) in values.items():
        name, factor, offset, unit = public_name(key, ship)
        result.append(Estimated(name=name, value=offset + factor * value, std=abs(factor) * std, unit=unit))
    return tuple(result)


def _stds(found: Fit) -> dict[str, float]:
    return {key: found.std(key) for key in found.keys}


def _settled_note(found: Search, ship: Extended, windows: Windows, settled: HeldOut, seed: int) -> tuple[str, ...]:
    """What uncertain parameters gain by themselves: no cause is credited with it."""
    if not found.first.keys:
        return ()
    gain, _ = gained(held_out(None, ship, windows, lambda share: None), settled, seed)
    if not abs(gain) >= LEAST_GAIN:
        return ()
    return (
        f"Moving the parameters within their stated standard deviations changes the fit on held-out runs by "
        f"{gain:+.1f} points; the gains of causes come on top of that.",
    )


def _stuck_note(held: Sequence[HeldOut]) -> tuple[str, ...]:
    """Gains that are not wholly measured on runs that the sizes have not seen."""
    folds = sum(item.stuck for item in held)
    if not folds:
        return ()
    return (
        f"Of the fits without the runs held out, {folds} got nowhere from the fit to all runs and kept its sizes: "
        "gains there are of sizes that have seen the runs.",
    )


def _screened(found: Search) -> tuple[tuple[str, float], ...]:
    best: dict[str, float] = {}
    for item in found.final_screening:
        best[item.candidate.cause] = min(item.corrected, best.get(item.candidate.cause, 1.0))
    return tuple(sorted(best.items(), key=lambda pair: pair[1]))
