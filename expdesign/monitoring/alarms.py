"""Alarms: which change explains the data best, and how large it is once that is known.

The stretches since a change began are simulated anew with the changed ship, by every cause that may explain them: the
error of a simulation is not linear in large changes, and a cause that is linearised at the ship before them is found
too small. Sizes carry the errors of the reference, from which changes are counted.

Source: A. S. Willsky and H. L. Jones, IEEE Transactions on Automatic Control 21 (1976), 108-112, for the estimate of a
jump from the innovations since; B. M. Bell and F. W. Cathey, IEEE Transactions on Automatic Control 38 (1993), 294-297,
for its iteration.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from expdesign.monitoring.calibration import Calibration, misfit_of
from expdesign.monitoring.evidence import Grams, stretches_of
from expdesign.monitoring.force import Judged, Known, after_gap, after_stretch, judged
from expdesign.monitoring.state import Alarm, Rules, State, Step, Sums
from expdesign.values import Array

# difference of log-likelihood up to which another change explains the data as well: more than chance alone asks for,
# as the variance of the unmeasured force is known from a few hours
AS_LIKELY = 6.0
APART = 0.02  # common weight below which a change cannot have raised the alarm of another
# causes that are simulated: how many, and up to which difference of log-likelihood where they are linearised
CAUSES, MAY_BE = 3, 20.0
ROUNDS = 2  # simulations of each, at most
CLOSE = 0.3  # standard errors of a step from which a size is not simulated again
UNEXPLAINED_SHARE = 0.1  # of the surprise, that the effects of large changes leave as they are not linear
# fewest stretches from which the size of a change is told, and share of those since then after which it is told anew
SETTLING_STRETCHES, MORE = 20, 1 / 3
# stretches of a sum from which a change of the ship is told from weather beyond the reference, and from which weather
# is believed; in between, weather that begins and a change that lasts look alike
TOLD_APART = (7, 20)
# where a change that is not yet settled was none: standard errors of its size, of which an alarm asks for more
# (`cusum.SIZED`) and a change of the ship gets ever more
VANISHED = 1.5
MOST = 0.6  # share of its size that has to go again where a change is over, and was not found too large
REFINED = 0.2  # change of the size, in sizes that matter, below which it is refined no further
# information, in inverse squared sizes, from which a change is settled; patience: factor of it where other changes
# explain the data as well
SETTLED = 60.0
PATIENCE = 10.0

Again = Callable[[Array, float], Grams]
"""Stretches since a time [s], or those of them that are kept, linearised at the ship with changes (m,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Told:
    """What the data since a change tell, once the ship is simulated with it."""

    shift: Array  # (m,) changes of the ship in the simulation
    sums: Sums  # of one beginning
    known: Known  # the force and the load at the end
    cost: float  # squared errors, in standard deviations of the noise


def raised(
    state: State, step: Step, place: int, calibration: Calibration, again: Again | None, rules: Rules
) -> tuple[State, Alarm]:
    """Raise an alarm of the sum with a number: the state and the alarm."""
    pending = state.sums.one(place)
    alarm = Alarm(time_s=state.until_s, since_s=float(pending.since_s[0]), statistic=step.statistic, change=step.change)
    state = replace(state, alarm=alarm, pending=pending, before=state.shift)
    alarm = _attributed(state, alarm, pending, calibration)
    state = _begun_anew(_simulated(replace(state, alarm=alarm), calibration, again, rules))
    assert state.alarm is not None
    return state, state.alarm


def settling(state: State, one: Judged, calibration: Calibration, again: Again | None, rules: Rules) -> State:
    """The state with a stretch added to the estimate of the change that raised the alarm.

    Once it is known well, the ship is changed by it. That is repeated with the data that follow, as the error is not
    linear in large changes, until there is nothing left to change; then it is settled. Where its size vanishes instead,
    or the ship is as before again as surely as she had changed, the alarm is withdrawn, and the watch goes on from the
    ship before it.
    """
    assert state.pending is not None
    assert state.alarm is not None
    pending = state.pending.added(one)[0]
    alarm = _attributed(state, state.alarm, pending, calibration)
    state = replace(state, pending=pending, alarm=alarm)
    if abs(alarm.value) < VANISHED * alarm.std:
        return _withdrawn(state)
    if _over(state, alarm, calibration, rules):
        # a wrong cause goes, too, where a turn contradicts it
        other = _begun_anew(_simulated(state, calibration, again, rules))
        return other if other.alarm is not None and other.alarm.change != alarm.change else _withdrawn(state)
    since = (state.until_s - alarm.since_s) / calibration.stretch_s
    if pending.count < max(SETTLING_STRETCHES, MORE * since):
        return state
    before = alarm.value
    ship, state = state.shift, _simulated(state, calibration, again, rules)
    state = state if state.shift is ship else _begun_anew(state)
    assert state.pending is not None
    assert state.alarm is not None
    alarm, pending = state.alarm, state.pending
    enough = pending.information[0][alarm.change, alarm.change] / calibration.common >= SETTLED * (
        PATIENCE if alarm.as_likely else 1.0
    )
    if not enough:
        return state
    score, information = beside_baseline(pending, calibration)
    found = np.zeros(len(state.shift))
    found[alarm.change] = score[alarm.change] / information[alarm.change, alarm.change]
    settled = bool(max(abs(found[alarm.change]), abs(alarm.value - before)) < REFINED)
    state = _moved(state, pending, found)
    return replace(state, alarm=replace(alarm, named=True, settled=settled), pending=pending.less(found))


def _over(state: State, alarm: Alarm, calibration: Calibration, rules: Rules) -> bool:
    """Whether most of an alarm's change has gone again, as surely as it came: by the sum of changes the other way."""
    change, sums = alarm.change, state.sums
    back = change + len(state.shift) * (alarm.value > 0.0)
    score, known = float(sums.score[back, change]), max(float(sums.information[back, change, change]), 1e-300)
    gain = score**2 / known / 2.0 / float(calibration.inflation[change])
    size = max(abs(alarm.value), abs(float((state.shift - state.before)[change])))
    lasting = state.ratios[back] > 0.0 and sums.stretches[back] >= TOLD_APART[0]
    return bool(lasting) and gain > rules.limit and abs(score) / known > MOST * size


def _moved(state: State, pending: Sums, change: Array) -> State:
    """The state with the ship changed by (m,), and all sums begun anew."""
    state = state.with_known(replace(state.known, mean=state.known.mean - pending.taken[0] @ change))
    whole = state.whole.again(np.ones(1, dtype=bool), state)
    return _begun_anew(replace(state, whole=whole, shift=state.shift + change))


def _begun_anew(state: State) -> State:
    """The state with the sums of all changes at zero."""
    every = np.ones(len(state.ratios), dtype=bool)
    return replace(state, ratios=np.zeros(len(every)), sums=state.sums.again(every, state))


def _withdrawn(state: State) -> State:
    """The state with the ship as before the alarm, which is withdrawn."""
    assert state.pending is not None
    assert state.alarm is not None
    alarm = replace(state.alarm, withdrawn=True)
    return replace(_moved(state, state.pending, state.before - state.shift), alarm=alarm)


def _simulated(state: State, calibration: Calibration, again: Again | None, rules: Rules) -> State:
    """The state with the ship changed by the cause that explains the data since the alarm's change best.

    Causes that may be it are simulated, each with its own size. Where the data since then are not at hand any more, the
    cause stays what it is for the ship so far.
    """
    alarm, pending = state.alarm, state.pending
    assert pending is not None
    assert alarm is not None
    if again is None or not np.isfinite(pending.known_s[0]):
        return state
    score, information = beside_baseline(pending, calibration)
    so_far = state.shift - state.before
    gain = _gains(score + information @ so_far, information, calibration, alarm)  # of each in place of the one so far
    causes = [k for k in np.argsort(-gain).tolist() if gain[k] > gain.max() - MAY_BE][:CAUSES]
    causes = [alarm.change] if alarm.named else list(dict.fromkeys([*causes, alarm.change]))
    told, units = dict[int, Told](), np.eye(len(so_far))
    since = score + information @ so_far, information
    for cause in causes:
        one = _sized(state, calibration, again, rules, units[cause], since)
        if one is None:
            return state
        told[cause] = one
    likely = {cause: -_cost(one, units[cause], calibration) / 2.0 for cause, one in told.items()}
    best, *rest = sorted(likely, key=lambda cause: -likely[cause])
    state = replace(
        state.with_known(told[best].known),
        shift=told[best].shift,
        pending=replace(told[best].sums, stretches=np.zeros(1)),
    )
    assert state.pending is not None
    alarm = _attributed(state, replace(alarm, change=best), told[best].sums, calibration, named=best)
    if alarm.named:
        return replace(state, alarm=alarm)
    others = tuple(cause for cause in rest if likely[cause] > likely[best] - AS_LIKELY)
    pushes = _pushes(gone_over(state, calibration, again, rules, None), calibration, likely[best])
    loaded = _loaded(
        _sized(state, calibration, again, rules, calibration.heavier, since), state, calibration, likely[best]
    )
    return replace(state, alarm=replace(alarm, as_likely=others, pushes=pushes, loaded=loaded))


def _sized(
    state: State, calibration: Calibration, again: Again, rules: Rules, along: Array, since: tuple[Array, Array]
) -> Told | None:
    """The data since the alarm's change, with the ship changed along (m,) by the size that they tell.

    None where they are not at hand, or the direction is none. `since` are score (m,) and information (m, m) that the
    size begins with.
    """
    score, information, size, told = *since, 0.0, None
    for _ in range(ROUNDS * bool(along.any())):
        size += float(along @ score / (along @ information @ along))
        told = gone_over(state, calibration, again, rules, size * along)
        if told is None:
            return None
        score, information = beside_baseline(told.sums, calibration)
        if abs(along @ score) < CLOSE * math.sqrt(along @ information @ along):
            break
    return told


def _loaded(
    told: Told | None, state: State, calibration: Calibration, likely: float
) -> tuple[float, float, float] | None:
    """Another load since the change, where it explains the data as well as the best cause, see `Alarm.loaded`."""
    along = calibration.heavier
    if told is None or (gain := -_cost(told, along, calibration) / 2.0 - likely) < -AS_LIKELY:
        return None
    score, information = beside_baseline(told.sums, calibration)
    known = float(along @ information @ along)
    value = float(along @ (told.shift - state.before) / (along @ along) + along @ score / known)
    std = 1.0 / math.sqrt(known)
    return (gain, value, std) if abs(value) > VANISHED * std else None


def _pushes(told: Told | None, calibration: Calibration, likely: float) -> tuple[tuple[int, float], ...]:
    """Steady accelerations since the change that explain the data as well as the best cause, see `Alarm.pushes`."""
    if told is None:
        return ()
    units = np.eye(told.sums.score.shape[1])[len(told.shift) :]
    gains = [-_cost(told, unit, calibration) / 2.0 - likely for unit in units]
    return tuple((axis, gain) for axis, gain in enumerate(gains) if gain > -AS_LIKELY)


def gone_over(state: State, calibration: Calibration, again: Again, rules: Rules, change: Array | None) -> Told | None:
    """The data since the alarm's change, with the ship changed by (m,) alone; None where they are not at hand.

    Without a change the ship is as before, and steady accelerations stand as further changes behind those of the ship.
    """
    assert state.pending is not None
    sums, m = state.pending, len(state.shift)
    shift = state.before if change is None else state.before + change
    grams = again(shift, float(sums.since_s[0]))
    first, last = np.searchsorted(grams.time_s, [sums.since_s[0] - 1e-6, state.until_s - 1e-6]).tolist()
    if not first < last or grams.time_s[0] > sums.since_s[0] + 1e-6:
        return None
    grams = grams.part(slice(first, last))
    stretches = stretches_of(grams, calibration.std, calibration.ramp).less(calibration.baseline)
    nuisance, until_s, cost = calibration.nuisance, float(sums.known_s[0]), 0.0
    heading = float(sums.known_heading[0])
    known = Known(mean=sums.mean[0], covariance=sums.covariance[0])
    columns = np.arange(stretches.products.shape[-1])
    pushes = columns[:0] if change is not None else columns[-1 - grams.pushes : -1]
    columns, among = np.r_[:m, pushes, m : len(columns)], m + len(pushes)
    begun = Sums.begun(1, among, known, float(sums.since_s[0]), sums.rougher[0])
    sums = replace(begun, known_s=sums.known_s, known_heading=sums.known_heading)
    for index, whole in enumerate(stretches.products):
        products = whole[np.ix_(columns, columns)]
        if grams.shoal[index] > calibration.shoal_limit:
            continue
        begin_s, end_s = float(grams.time_s[index]), float(grams.time_s[index] + grams.duration_s[index])
        if begin_s - until_s >= rules.port_s:
            known = calibration.called(known)
        gap = (end_s - until_s, float(grams.heading[index]) - heading)
        faded, keep = after_gap(known, nuisance, *gap), nuisance.memory(*gap)
        one = judged(products, among, faded, loads=calibration.loads)
        if calibration.by_wind(faded, one) > calibration.wind_limit:
            sums, known = sums.later(keep).unjudged(one), after_stretch(faded, one)
            until_s, heading = end_s, float(grams.heading[index])
            continue
        count = float(stretches.counts[index])
        if not fits(one, count, calibration, changed=True):
            cost += calibration.misfit_limit * count  # whatever the cause
            continue
        sums, known = sums.later(keep).added(one)[0], after_stretch(faded, one)
        until_s, heading = end_s, float(grams.heading[index])
        cost += float(one.quadratic)
    gap = (state.until_s - until_s, state.heading - heading)
    keep = nuisance.memory(*gap)
    return Told(shift=shift, sums=sums.later(keep), known=after_gap(known, nuisance, *gap), cost=cost)


def fits(one: Judged, count: float, calibration: Calibration, *, changed: bool) -> bool:
    """Whether the misfit of a stretch is one that the reference shows, or a large change leaves."""
    unlinear = UNEXPLAINED_SHARE * float(one.quadratic) / max(count, 1.0) if changed else 0.0
    own = slice(len(calibration.baseline))
    misfit = misfit_of(float(one.quadratic), one.score[own], one.information[own, own], count)
    return misfit <= calibration.misfit_limit + unlinear


def _cost(told: Told, along: Array, calibration: Calibration) -> float:
    """Squared errors at the size of a change along (m,) that leaves the least, and at the best baseline for it."""
    score, information = beside_baseline(told.sums, calibration)
    by_baseline = told.sums.score[0] / calibration.common @ _baseline(calibration, len(score)) @ score
    by_change = (along @ score) ** 2 / (along @ information @ along)
    return told.cost / calibration.common - float(by_baseline) - float(by_change)


def beside_baseline(pending: Sums, calibration: Calibration) -> tuple[Array, Array]:
    """(m,) score and (m, m) information of changes since the first beginning, in the reference's uncertainty.

    Data tell how the ship differs from the file. Her baseline is known from the reference with an error, by which
    every score moves: the score J (d + b) of a change d has the covariance J + J B J, where b has the covariance B.
    """
    information = pending.information[0] / calibration.common
    spread = np.eye(len(information)) + information @ _baseline(calibration, len(information))
    score = np.linalg.solve(spread, pending.score[0] / calibration.common)
    return score, np.asarray(np.linalg.solve(spread, information), dtype=float)


def _baseline(calibration: Calibration, count: int) -> Array:
    """(count, count) covariance of the baseline, zero for what no reference shows."""
    own = calibration.baseline_covariance
    return np.pad(own, (0, count - len(own)))


def _gains(score: Array, information: Array, calibration: Calibration, alarm: Alarm) -> Array:
    """(m,) log-likelihood that each change alone gains; none of those that cannot have raised the alarm."""
    seen = calibration.weights @ calibration.weights[alarm.change] > APART
    gain = score**2 / np.maximum(np.diag(information), 1e-300) / 2.0
    return np.where(calibration.watched & seen, gain, -np.inf)


def _attributed(
    state: State, alarm: Alarm, pending: Sums, calibration: Calibration, *, named: int | None = None
) -> Alarm:
    """The change that explains the data since an alarm's beginning best, among those that are watched.

    Args:
        pending: sums since then, for the ship of the state.
        named: the change, where it is known.
    """
    score, information = beside_baseline(pending, calibration)
    so_far = state.shift - state.before
    if alarm.named or (named is None and so_far.any()):
        named = alarm.change
    gain = _gains(score, information, calibration, alarm)
    change = int(np.argmax(gain)) if named is None else named
    rest = tuple(k for k in np.argsort(-gain).tolist() if k != change and gain[k] > gain[change] - AS_LIKELY)
    watched = np.flatnonzero(np.isfinite(gain))
    inner = information[np.ix_(watched, watched)] + np.eye(len(watched))
    together = float(score[watched] @ np.linalg.solve(inner, score[watched])) / 2.0
    known = max(float(information[change, change]), 1e-300)
    return replace(
        alarm,
        change=change,
        value=float(score[change] / known + so_far[change]),
        std=1.0 / math.sqrt(known),
        as_likely=rest if named is None else alarm.as_likely,
        unexplained=max(0.0, together - float(score[change] ** 2 / known / 2.0)),
        judged_s=state.until_s,
    )
