"""Sums of log-likelihood ratios of changes (CUSUM), the alarms they raise, and what changed since when.

The log-likelihood ratio of a change, in either direction, is d score - d^2 information / 2, with d a share of the size
that matters. Its sum begins anew whenever it falls below zero. Where there is no change, exp of the ratio has mean
one, so that a sum reaches h in exp(h) stretches on average, or later: the threshold follows from the time between false
alarms that is asked for.

Sources: E. S. Page, Biometrika 41 (1954), 100-115; G. Lorden, Annals of Mathematical Statistics 42 (1971), 1897-1908.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.monitoring.alarms import AS_LIKELY, REFINED, TOLD_APART, Again, beside_baseline, fits, raised, settling
from expdesign.monitoring.calibration import PUSHES, ROUGHER, Calibration
from expdesign.monitoring.evidence import Grams, stretches_of
from expdesign.monitoring.force import Judged, after_gap, after_stretch, judged, surprise
from expdesign.monitoring.state import Alarm, Call, Load, Rules, State, Step
from expdesign.values import Array

# share of the size that matters for which a sum grows fastest: of changes smaller than half of it, it does not grow
TUNED_TO = 0.6

WEATHER_STRETCHES = 30.0  # over which the surprise of the force is averaged
WEATHER_LIMIT = 1.7  # surprise of a stretch, in that of the reference, beyond which the weather is unlike it
WEATHER_ODDS = 5.0  # logarithm of how much more often the weather changes than the ship does, a hundred times or so
FALLEN = 3.0  # by which a sum below its peak is of something that is over, as a squall is
SIZED = 2.5  # standard errors of its size, those of the reference among them, that a change has to have
SURELY = 0.95  # of how much scores scatter by chance
ALIKE = 0.3  # share of a change's weights from which another sees the same weather
LOAD_SETTLED = (2, 6, 20, 60, 240)  # stretches after a port call from which its load is taken for the ship's, and again


# Port calls: the ship may carry another load afterwards, which is estimated anew and raises no alarm.
#
# A load is a change of inertia and hull that lasts until the next call. The filter of the unmeasured force estimates it
# too, so that it is in no score of a change; that of a change which looks like a load grows only as the load is known.

MOST_CALLS = 100  # kept for the page


def called(state: State, calibration: Calibration, until_s: float) -> State:
    """The state after a port call that ends then: the load may be another."""
    loads, first = calibration.loads, len(state.known.mean) - len(calibration.loads)
    taken = np.zeros(len(state.shift))
    taken[loads] = -state.known.mean[first:]
    load = Load(since_s=until_s, stay_s=until_s - state.until_s, judged=0, rounds=0, taken=taken)
    return replace(state.with_known(calibration.called(state.known)), load=load, calls=calls_of(state, calibration))


def with_load(state: State, calibration: Calibration) -> State:
    """Move a load that is known into the ship's model, as large effects are not linear."""
    load, loads = state.load, calibration.loads
    due = LOAD_SETTLED[load.rounds] if load.rounds < len(LOAD_SETTLED) else math.inf
    if not load.stay_s or load.judged < due:
        return state
    found, _ = load_of(state, calibration)
    more, load = found - load.taken, replace(load, rounds=load.rounds + 1)
    if np.abs(more).max() < REFINED:
        return replace(state, load=load)
    mean = state.known.mean.copy()
    mean[len(mean) - len(loads) :] = 0.0
    known = replace(state.known, mean=mean)
    sums = replace(state.sums, known_s=np.full(len(state.ratios), np.inf))
    return replace(state.with_known(known), shift=state.shift + more, sums=sums, load=replace(load, taken=found))


def load_of(state: State, calibration: Calibration) -> tuple[Array, Array]:
    """(m,) what the last port call changed of the load, in sizes, and (m,) its standard error."""
    loads, first = calibration.loads, len(state.known.mean) - len(calibration.loads)
    found, std = state.load.taken.copy(), np.zeros(len(state.shift))
    found[loads] += state.known.mean[first:]
    own = calibration.inflation[loads] * np.diag(state.known.covariance)[first:]
    std[loads] = np.sqrt(own + calibration.baseline_std[loads] ** 2)
    return found, std


def calls_of(state: State, calibration: Calibration) -> tuple[Call, ...]:
    """The port calls so far, with what they changed."""
    if not state.load.stay_s:
        return state.calls
    value, std = load_of(state, calibration)
    last = Call(time_s=state.load.since_s, stay_s=state.load.stay_s, value=value, std=std)
    return (*state.calls, last)[-MOST_CALLS:]


def estimates(state: State, calibration: Calibration) -> tuple[Array, Array]:
    """(m,) size of each change, had it alone happened when the watch began, and (m,) its standard error."""
    score, information = beside_baseline(state.whole, calibration)
    known, wider = np.diag(information), np.maximum(calibration.inflation / calibration.common, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return score / known, np.sqrt(wider / known)


def threshold(watched: int, stretches: float) -> float:
    """Alarm limit for sums of so many changes, both ways, with so many stretches between false alarms or more."""
    return math.log(max(2.0 * watched * stretches, 2.0))


def soonest(rate: Array, limit: float) -> Array:
    """Stretches from a change of the size that matters to its alarm, on average, for information of each (...).

    They are no fewer than a change of the ship is told from weather by.
    """
    grows = rate * TUNED_TO * (1.0 - TUNED_TO / 2.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(grows > 0, np.maximum(np.ceil(limit / grows), TOLD_APART[0]), np.inf))


def watch(
    calibration: Calibration, state: State, grams: Grams, *, rules: Rules, again: Again | None = None
) -> tuple[State, tuple[Alarm, ...], tuple[Step, ...], int]:
    """Go on watching for a while.

    Args:
        grams: of the stretches that follow, in order of time, linearised at the ship changed by `state.shift`.
        rules: threshold and port calls.
        again: the stretches so far, those of `grams` among them; None where they are not kept.

    Returns:
        The state after them, alarms as they were raised and again when settled or withdrawn, the sums after every
        stretch, and the number of stretches used: not all where `shift` changed, so that the rest has to be linearised
        anew.
    """
    alarms: list[Alarm] = []
    steps: list[Step] = []
    stretches = stretches_of(grams, calibration.std, calibration.ramp)
    ship = state.shift
    for index, products in enumerate(stretches.products):
        begin_s, count = float(stretches.time_s[index]), float(stretches.counts[index])
        duration_s = float(grams.duration_s[index])
        if begin_s - state.until_s >= rules.port_s:
            state = called(state, calibration, begin_s)
        state = _waited(state, calibration, begin_s, begin_s + duration_s, float(stretches.heading[index]))
        if (shoal := float(grams.shoal[index])) > calibration.shoal_limit:
            shoalest, shoal_s = max(state.shoalest, shoal), state.shoal_s + duration_s
            state = replace(state, left_out_s=state.left_out_s + duration_s, shoal_s=shoal_s, shoalest=shoalest)
            continue
        own, loads = _less(products, calibration.baseline), calibration.loads
        one = judged(own, stretches.changes, state.known, loads=loads)
        if calibration.by_wind(state.known, one) > calibration.wind_limit:
            state = _learnt(state, own, one, loads)
            windiest, wind_s = max(state.windiest_mps, float(grams.wind_mps[index])), state.wind_s + duration_s
            state = replace(state, left_out_s=state.left_out_s + duration_s, wind_s=wind_s, windiest_mps=windiest)
            continue
        if not fits(one, count, calibration, changed=state.alarm is not None):
            state = replace(state, left_out_s=state.left_out_s + duration_s)
            continue
        surprised = calibration.weights @ surprise(own, stretches.changes, state.known, loads)
        weather = state.weather + (surprised / calibration.surprise - state.weather) / WEATHER_STRETCHES
        before, state = state, _rougher(state, own, one, loads)
        state = _counted(state, one, weather, calibration, duration_s, int(grams.kind[index]), grams.budget[index])
        if state.alarm is not None:
            state, _ = _summed(state, one, before, begin_s, calibration)  # whether the change is over
            state = settling(state, one, calibration, again, rules)
            if state.alarm is not None and (state.alarm.settled or state.alarm.withdrawn):
                alarms.append(state.alarm)
                state = replace(state, alarm=None, pending=None, weather=np.ones(len(weather)))
        else:
            state, step = _summed(state, one, before, begin_s, calibration)
            state, alarm, step = _noticed(state, step, calibration, rules, duration_s, again)
            steps.append(step)
            alarms += [] if alarm is None else [alarm]
        if state.shift is not ship:
            return state, tuple(alarms), tuple(steps), index + 1
    return state, tuple(alarms), tuple(steps), len(grams)


def _learnt(state: State, products: Array, one: Judged, loads: NDArray[np.int64]) -> State:
    """The state after a stretch that force and load are learnt from, and that no change is judged by."""
    other = judged(products, len(state.shift), state.rough, loads)
    return replace(
        state,
        known=after_stretch(state.known, one),
        rough=after_stretch(state.rough, other),
        sums=state.sums.unjudged(one),
        whole=state.whole.unjudged(one),
        pending=None if state.pending is None else state.pending.unjudged(one),
    )


def _rougher(state: State, products: Array, one: Judged, loads: NDArray[np.int64]) -> State:
    """The state after a stretch, in the reference's weather and in the others, with how likely these have become."""
    other = judged(products, len(state.shift), state.rough, loads)
    rougher = state.rougher + (one.deviance - other.deviance) / 2.0
    return replace(
        state, known=after_stretch(state.known, one), rough=after_stretch(state.rough, other), rougher=rougher
    )


def _counted(
    state: State, one: Judged, weather: Array, calibration: Calibration, duration_s: float, kind: int, terms: Array
) -> State:
    """The state with a stretch added to the sums over the whole watch.

    It is not judged where the weather is beyond the reference for all changes, unless one that was noticed explains it.
    """
    unlike = weather > WEATHER_LIMIT
    beyond = bool(unlike[calibration.watched].all()) and state.alarm is None
    return replace(
        state,
        judged_s=state.judged_s + duration_s * (not beyond),
        left_out_s=state.left_out_s + duration_s * beyond,
        beyond_s=state.beyond_s + duration_s if beyond else 0.0,
        beyond_of_s=state.beyond_of_s + duration_s * (unlike & (not beyond and state.alarm is None)),
        weather=weather,
        whole=state.whole.added(one)[0],
        load=replace(state.load, judged=state.load.judged + 1),
        budget=state.budget.added(kind, duration_s, terms, np.diag(one.information)),
    )


def _noticed(
    state: State, step: Step, calibration: Calibration, rules: Rules, duration_s: float, again: Again | None
) -> tuple[State, Alarm | None, Step]:
    """Raise an alarm where a sum has passed the limit, unless weather explains it.

    The sums of changes that such weather looks like then begin anew, and the others go on: weather in yaw does not stop
    surge. So where a steady push explains the data better. A change whose size the errors of the reference leave open
    is waited for. Returns also the step with the largest sum that was compared with the limit.
    """
    m = len(state.shift)
    passed = [int(place) for place in np.argsort(-state.ratios) if state.ratios[place] > rules.limit]
    if not passed:
        brief = state.brief + (state.undecided_s > 0)
        return with_load(replace(state, brief=brief, undecided_s=0.0), calibration), None, step
    explained, doubtful = np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    for place in passed:
        one = place % m
        if explained[one] or doubtful[one]:
            continue
        alike = calibration.weights @ calibration.weights[one] > ALIKE * (calibration.weights[one] ** 2).sum()
        rougher, scattered = _rougher_by(state, place, calibration), _scattered(state, place, calibration)
        few, many = TOLD_APART
        if state.ratios[place] <= max(rules.limit * scattered, state.peaks[place] - FALLEN):
            doubtful |= alike
        elif rougher > 0.0 and state.sums.stretches[place] >= many:
            explained |= alike
        elif rougher > -WEATHER_ODDS or state.sums.stretches[place] < few:
            doubtful |= alike
        else:
            step = replace(step, statistic=float(state.ratios[place]), change=one)
            after, alarm = raised(replace(state, undecided_s=0.0), step, place, calibration, again, rules)
            if any(gain > AS_LIKELY for _, gain in alarm.pushes):
                explained |= alike
            elif abs(alarm.value) < SIZED * alarm.std:
                doubtful |= alike
            else:
                explained_s = min(after.beyond_s, after.until_s - alarm.since_s)
                judged_s, left_out_s = after.judged_s + explained_s, after.left_out_s - explained_s
                return replace(after, judged_s=judged_s, left_out_s=left_out_s, beyond_s=0.0), alarm, step
    undecided_s = state.undecided_s + duration_s if doubtful.any() else 0.0
    state = replace(state, undecided_s=undecided_s, by_weather=state.by_weather + bool(explained.any()))
    if explained.any():
        both = np.tile(explained, 2)
        sums = state.sums.again(both, state)
        state = replace(state, ratios=np.where(both, 0.0, state.ratios), sums=sums)
    else:
        state = with_load(state, calibration)
    return state, None, replace(step, compared=False)


def _rougher_by(state: State, place: int, calibration: Calibration) -> float:
    """Log-likelihood by which a rougher weather explains the data of a sum better than the change does.

    Of weathers count those in which a component varies more that the change resembles, currents and winds.
    """
    change, sums = place % len(state.shift), state.sums
    known = max(float(sums.information[place, change, change]), 1e-300)
    gain = float(sums.score[place, change]) ** 2 / known / 2.0
    pushes = calibration.weights[change][-PUSHES:]
    alike = np.append(pushes > ALIKE * pushes.max(), True)
    others = np.repeat(alike, len(ROUGHER))[: len(state.rougher)]
    winds = np.ones(len(state.rougher) - len(others), dtype=bool)
    return float((state.rougher - sums.rougher[place])[np.append(others, winds)].max()) - gain


def _scattered(state: State, place: int, calibration: Calibration) -> float:
    """How much more than they say the scores of a sum scatter about a steady change, surely; one at least.

    A change that lasts moves all scores alike; gusts beyond the reference move them up and down.
    """
    change, sums = place % len(state.shift), state.sums
    free = float(sums.stretches[place]) - 1.0
    if free < 1.0:
        return 1.0
    known = max(float(sums.information[place, change, change]), 1e-300)
    rest = float(sums.squares[place, change]) - float(sums.score[place, change]) ** 2 / known
    return max(1.0, rest / float(calibration.inflation[change]) / float(scipy.stats.chi2.ppf(SURELY, free)))


def _less(products: Array, change: Array) -> Array:
    """Products with the error of a ship that differs by a change."""
    after = np.eye(len(products))
    after[: len(change), -1] = -change
    return np.asarray(after.T @ products @ after)


def _waited(state: State, calibration: Calibration, begin_s: float, until_s: float, heading: float) -> State:
    """The state at the beginning of a stretch, with the force's memory faded over the gap before it.

    Sums that hold nothing yet begin after the gap, where there are data.
    """
    nuisance, gap = calibration.nuisance, (until_s - state.until_s, heading - state.heading)
    keep = nuisance.memory(*gap)
    return replace(
        state,
        until_s=until_s,
        heading=heading,
        known=after_gap(state.known, nuisance, *gap),
        rough=after_gap(state.rough, calibration.others, *gap),
        sums=state.sums.later(keep).begun_by(begin_s),
        whole=state.whole.later(keep),
        pending=None if state.pending is None else state.pending.later(keep),
    )


def _summed(state: State, one: Judged, before: State, begin_s: float, calibration: Calibration) -> tuple[State, Step]:
    """Add a stretch to all sums, or begin a sum with it where that is larger; sums below zero begin anew.

    The filter takes up a change in part, so that a sum which began too early hardly grows when the ship does change.
    `before` is the state before the stretch.
    """
    sums, score, information = state.sums.added(one)
    m = score.shape[1]
    own, number = np.arange(2 * m), np.arange(2 * m) % m
    sign, inflation = np.repeat([1.0, -1.0], m), np.tile(calibration.inflation, 2)
    size = TUNED_TO
    ratios = state.ratios + (sign * score[own, number] - size / 2 * information[own, number, number]) * size / inflation
    fresh = (sign * one.score[number] - size / 2 * one.information[number, number]) * size / inflation
    late = fresh > ratios
    ratios = np.maximum(ratios, fresh)
    peaks = np.where(late | (state.ratios == 0.0), ratios, np.maximum(state.peaks, ratios))
    ended = (ratios <= 0.0) | ~np.tile(calibration.watched, 2)
    ratios = np.where(ended, 0.0, ratios)
    place = int(np.argmax(ratios))
    step = Step(time_s=state.until_s, statistic=float(ratios[place]), change=place % m)
    if (late & ~ended).any():
        sums = sums.first(late & ~ended, one, begin_s, before)
    return replace(state, ratios=ratios, peaks=peaks, sums=sums.again(ended, state)), step
