"""Alarms: which change explains the data best, and how large it is once that is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from expdesign.monitoring.calibration import Calibration
from expdesign.monitoring.force import Judged, after_stretch
from expdesign.monitoring.state import Alarm, State, Step, Sums
from expdesign.monitoring.tuning import TUNING
from expdesign.values import Array


def raised(state: State, step: Step, calibration: Calibration) -> tuple[State, Alarm]:
    """Raise an alarm of the largest sum."""
    pending = state.largest
    alarm = Alarm(time_s=state.until_s, since_s=float(pending.since_s[0]), statistic=step.statistic, change=step.change)
    alarm = _attributed(alarm, pending, calibration, state.until_s)
    return replace(state, alarm=alarm, pending=pending, before=state.shift), alarm


def settling(state: State, alarm: Alarm, one: Judged, calibration: Calibration) -> State:
    """The state with a stretch added to the estimate of the change that raised the alarm.

    Once it is known well, the ship is changed by it. That is repeated with the data that follow, as the error is not
    linear in large changes, until there is nothing left to change; then it is settled.
    """
    assert state.pending is not None
    pending = state.pending.added(one)[0]
    known, before = after_stretch(state.known, one), alarm
    named = alarm.change if alarm.named else None
    alarm = _attributed(alarm, pending, calibration, state.until_s, named=named, so_far=state.shift - state.before)
    state = replace(state, alarm=alarm, pending=pending, known=known)
    enough = pending.information[0][alarm.change, alarm.change] / calibration.common >= TUNING.settled * (
        TUNING.patience if alarm.as_likely else 1.0
    )
    if not enough or pending.count < TUNING.settling_stretches:
        if before.named and abs(alarm.value - before.value) < TUNING.clear * alarm.std:  # few data since the last size
            alarm = replace(alarm, value=before.value, std=before.std)
        return replace(state, alarm=alarm)
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
        sums=state.sums.again(every, state.until_s),
        whole=state.whole.again(every[:1], state.until_s),
        shift=shift,
        alarm=replace(alarm, named=True, settled=bool(np.abs(found).max() < TUNING.refined)),
        pending=pending.again(every[:1], state.until_s),
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
