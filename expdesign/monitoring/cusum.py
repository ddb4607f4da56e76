"""Sums of log-likelihood ratios of changes (CUSUM), the alarms they raise, and what changed since when.

The log-likelihood ratio of a change by its size, in either direction, is d score - d^2 information / 2 with d = +-1 in
units of the size. Its sum begins anew whenever it falls below zero. Where there is no change, exp of the ratio has mean
one, so that a sum reaches h in exp(h) stretches on average, or later: the threshold follows from the time between false
alarms that is asked for.

Sources: E. S. Page, Biometrika 41 (1954), 100-115; G. Lorden, Annals of Mathematical Statistics 42 (1971), 1897-1908.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from expdesign.monitoring.calibration import Calibration, misfit_of
from expdesign.monitoring.evidence import Grams, stretches_of
from expdesign.monitoring.force import Judged, Known, after_gap, after_stretch, judged
from expdesign.monitoring.tuning import TUNING
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """A change that was noticed.

    Attributes:
        time_s: when the sum passed its threshold [s].
        since_s: when that sum began, the estimate of when the change happened [s].
        statistic: the sum, a log-likelihood ratio, when the alarm was raised.
        change: number of the change that explains the data since then best.
        value, std: its estimate in sizes, and the standard error.
        as_likely: numbers of other changes that explain them as well, best first.
        unexplained: log-likelihood that all changes together gain beyond the best one.
        named: the change was named, and its size is being refined.
        settled: its size, too, is as sure as it is going to be, and the watch goes on from the changed ship.
        judged_s: end of the data that the estimate is from [s].
    """

    time_s: float
    since_s: float
    statistic: float
    change: int
    value: float = 0.0
    std: float = 0.0
    as_likely: tuple[int, ...] = ()
    unexplained: float = 0.0
    named: bool = False
    settled: bool = False
    judged_s: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Sums:
    """What was added up since n beginnings.

    Attributes:
        since_s: (n,) the beginnings [s].
        taken: (n, 2 q, m) what the filter has taken of each change for the unmeasured force.
        score, information: (n, m) and (n, m, m).
        stretches: (n,) that were added.
    """

    since_s: Array
    taken: Array
    score: Array
    information: Array
    stretches: Array

    @property
    def count(self) -> int:
        """Stretches since the first beginning."""
        return int(self.stretches[0])

    @classmethod
    def begun(cls, count: int, changes: int, forces: int, time_s: float) -> Sums:
        """Nothing yet."""
        return cls(
            since_s=np.full(count, time_s),
            taken=np.zeros((count, forces, changes)),
            score=np.zeros((count, changes)),
            information=np.zeros((count, changes, changes)),
            stretches=np.zeros(count),
        )

    def one(self, place: int) -> Sums:
        """Those of one beginning."""
        return Sums(**{name: values[place : place + 1] for name, values in vars(self).items()})

    def again(self, places: np.ndarray, time_s: float) -> Sums:
        """The same with some (n,) begun anew."""
        fresh = Sums.begun(len(self.since_s), self.score.shape[1], self.taken.shape[1], time_s)
        return Sums(
            **{
                name: np.where(places.reshape(-1, *[1] * (values.ndim - 1)), getattr(fresh, name), values)
                for name, values in vars(self).items()
            }
        )

    def later(self, keep: Array) -> Sums:
        """After a gap over which the force's autocorrelation is (2 q,)."""
        return replace(self, taken=keep[:, None] * self.taken)

    def added(self, one: Judged) -> tuple[Sums, Array, Array]:
        """With one more stretch; and its scores (n, m) and information (n, m, m)."""
        score = one.score - np.einsum("nfm,f->nm", self.taken, one.force_score)
        cross = one.by_force @ self.taken
        information = (
            one.information - cross - np.swapaxes(cross, 1, 2)
            + np.swapaxes(self.taken, 1, 2) @ one.force_information @ self.taken
        )  # fmt: skip
        after = Sums(
            since_s=self.since_s,
            taken=self.taken + one.gain @ (one.seen[0] - one.seen[1] @ self.taken),
            score=self.score + score,
            information=self.information + information,
            stretches=self.stretches + 1.0,
        )
        return after, score, information


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """Of a watch, between two stretches.

    Attributes:
        judged_s: end of the last stretch that was looked at [s].
        known: of the unmeasured force, then.
        ratios: (2 m,) sums of log-likelihood ratios, of increases and then of decreases.
        sums: since they began, 2 m of them.
        shift: (m,) changes of the ship that were found, in sizes; before: the same before the last alarm.
        whole: sums since the watch began, or since the last change was settled.
        alarm: the alarm that is not yet settled, or None; pending: sums since its change.
        judged, left_out: stretches that were judged, and those whose error was beyond anything in the reference.
    """

    judged_s: float
    known: Known
    ratios: Array
    sums: Sums
    shift: Array
    before: Array
    whole: Sums
    alarm: Alarm | None = None
    pending: Sums | None = None
    judged: int = 0
    left_out: int = 0

    @classmethod
    def begun(cls, calibration: Calibration, *, time_s: float) -> State:
        """At the beginning of a watch."""
        m, forces = len(calibration.baseline), calibration.force.variance.shape[-1]
        return cls(
            judged_s=time_s,
            known=Known.nothing(calibration.force),
            ratios=np.zeros(2 * m),
            sums=Sums.begun(2 * m, m, forces, time_s),
            shift=np.zeros(m),
            before=np.zeros(m),
            whole=Sums.begun(1, m, forces, time_s),
        )


@dataclass(frozen=True, kw_only=True)
class Step:
    """After a stretch.

    Attributes:
        time_s: its end [s].
        statistic: the largest of all sums.
        change: whose.
    """

    time_s: float
    statistic: float
    change: int


def estimates(state: State, calibration: Calibration) -> tuple[Array, Array]:
    """(m,) size of each change, had it alone happened when the watch began, and (m,) its standard error."""
    known = np.diag(state.whole.information[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        return state.whole.score[0] / known, np.sqrt(calibration.inflation / known)


def threshold(watched: int, stretches: float) -> float:
    """Of sums in both directions of so many changes: false alarms are at least so many stretches apart on average."""
    return math.log(max(2.0 * watched * stretches, 2.0))


def watch(
    calibration: Calibration, state: State, grams: Grams, *, limit: float
) -> tuple[State, tuple[Alarm, ...], tuple[Step, ...], int]:
    """Go on watching for a while.

    Args:
        calibration: of the reference.
        state: before.
        grams: of the stretches that follow, in order of time, linearised at the ship changed by `state.shift`.
        limit: the threshold.

    Returns:
        The state after them, alarms as they were raised and again when settled, the sums after every stretch, and the
        number of stretches used: not all where `shift` changed, so that the rest has to be linearised anew.
    """
    alarms: list[Alarm] = []
    steps: list[Step] = []
    stretches = stretches_of(grams, calibration.std)
    for index, products in enumerate(stretches.products):
        begin_s, count = float(stretches.time_s[index]), float(stretches.counts[index])
        state = _waited(state, calibration, begin_s + calibration.stretch_s)
        one = judged(_less(products, calibration.baseline), stretches.changes, state.known)
        if misfit_of(float(one.quadratic), one.score, one.information, count) > calibration.misfit_limit:
            state = replace(state, left_out=state.left_out + 1)
            continue
        state = replace(state, judged=state.judged + 1, whole=state.whole.added(one)[0])
        if state.alarm is not None:
            state = _settling(state, state.alarm, one, calibration)
            if state.alarm is not None and state.alarm.settled:
                alarms.append(state.alarm)
                state = replace(state, alarm=None, pending=None)
            if state.pending is None or not state.pending.count:
                return state, tuple(alarms), tuple(steps), index + 1
            continue
        state, step = _summed(state, one, calibration)
        steps.append(step)
        if step.statistic > limit:
            pending = state.sums.one(int(np.argmax(state.ratios)))
            raised = Alarm(
                time_s=state.judged_s, since_s=float(pending.since_s[0]), statistic=step.statistic, change=step.change
            )
            raised = _attributed(raised, pending, calibration, state.judged_s)
            alarms.append(raised)
            state = replace(state, alarm=raised, pending=pending, before=state.shift)
    return state, tuple(alarms), tuple(steps), len(grams)


def _less(products: Array, change: Array) -> Array:
    """Products with the error of a ship that differs by a change."""
    after = np.eye(len(products))
    after[: len(change), -1] = -change
    return np.asarray(after.T @ products @ after)


def _waited(state: State, calibration: Calibration, until_s: float) -> State:
    """At the beginning of the stretch that ends then; at first nothing is known of the force anyway."""
    gap_s = until_s - state.judged_s
    keep = calibration.force.memory(gap_s)
    return replace(
        state,
        judged_s=until_s,
        known=after_gap(state.known, calibration.force, gap_s),
        sums=state.sums.later(keep),
        whole=state.whole.later(keep),
        pending=None if state.pending is None else state.pending.later(keep),
    )


def _summed(state: State, one: Judged, calibration: Calibration) -> tuple[State, Step]:
    """With a stretch added to all sums; those below zero begin anew."""
    sums, score, information = state.sums.added(one)
    m = score.shape[1]
    own = np.arange(2 * m)
    inflation = np.tile(calibration.inflation, 2)
    signed = np.repeat([1.0, -1.0], m) * score[own, own % m]
    ratios = state.ratios + (signed - 0.5 * information[own, own % m, own % m]) / inflation
    ended = (ratios <= 0.0) | ~np.tile(calibration.watched, 2)
    ratios = np.where(ended, 0.0, ratios)
    place = int(np.argmax(ratios))
    step = Step(time_s=state.judged_s, statistic=float(ratios[place]), change=place % m)
    known = after_stretch(state.known, one)
    return replace(state, known=known, ratios=ratios, sums=sums.again(ended, state.judged_s)), step


def _settling(state: State, alarm: Alarm, one: Judged, calibration: Calibration) -> State:
    """With a stretch added to what is known of a change that raised an alarm.

    Once it is known well, the ship is changed by it. That is repeated with the data that follow, as the error is not
    linear in large changes, until there is nothing left to change; then it is settled.
    """
    assert state.pending is not None
    pending = state.pending.added(one)[0]
    known = after_stretch(state.known, one)
    named = alarm.change if alarm.named else None
    alarm = _attributed(alarm, pending, calibration, state.judged_s, named=named, so_far=state.shift - state.before)
    state = replace(state, alarm=alarm, pending=pending, known=known)
    enough = pending.information[0][alarm.change, alarm.change] / calibration.common >= TUNING.settled * (
        TUNING.patience if alarm.as_likely else 1.0
    )
    if not enough or pending.count < TUNING.settling_stretches:
        return state
    together = np.array([alarm.change, *alarm.as_likely])
    inner = pending.information[0][np.ix_(together, together)] + np.eye(len(together))
    found = np.linalg.solve(inner, pending.score[0][together])
    shift = state.shift.copy()
    shift[together] += found
    m = len(shift)
    every = np.ones(2 * m, dtype=bool)
    return replace(
        state,
        known=replace(known, mean=known.mean - pending.taken[0][:, together] @ found),
        ratios=np.zeros(2 * m),
        sums=state.sums.again(every, state.judged_s),
        whole=state.whole.again(every[:1], state.judged_s),
        shift=shift,
        alarm=replace(alarm, named=True, settled=bool(np.abs(found).max() < TUNING.refined)),
        pending=pending.again(every[:1], state.judged_s),
    )


def _attributed(
    alarm: Alarm,
    pending: Sums,
    calibration: Calibration,
    now_s: float,
    *,
    named: int | None = None,
    so_far: Array | float = 0.0,
) -> Alarm:
    """The change that explains the data since an alarm's beginning best, among those that are watched.

    Args:
        alarm: before.
        pending: sums since then.
        calibration: of the reference.
        now_s: end of the data [s].
        named: the change, where it was named by earlier data.
        so_far: (m,) by which the ship was changed since the alarm.
    """
    score, information = pending.score[0], pending.information[0]
    watched = np.flatnonzero(calibration.watched)
    known = np.maximum(np.diag(information)[watched], 1e-300)
    gain = score[watched] ** 2 / known / (2.0 * calibration.common)
    order = np.argsort(-gain)
    best = int(order[0]) if named is None else int(np.flatnonzero(watched == named)[0])
    rest = tuple(int(watched[k]) for k in order if k != best and gain[k] > gain[best] - TUNING.as_likely)
    inner = information[np.ix_(watched, watched)] + np.eye(len(watched))
    together = float(score[watched] @ np.linalg.solve(inner, score[watched])) / (2.0 * calibration.common)
    change = int(watched[best])
    return replace(
        alarm,
        change=change,
        value=float(score[change] / known[best] + (so_far if isinstance(so_far, float) else so_far[change])),
        std=float(math.sqrt(calibration.common / known[best])),
        as_likely=alarm.as_likely if alarm.named else rest,
        unexplained=max(0.0, together - float(gain[best])),
        judged_s=now_s,
    )
