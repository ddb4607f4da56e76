"""A watch over a ship in operation, as its page and its file show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.monitoring import EQUATIONS, Alarm, Calibration, Call, Change, RollWatch, State, calls_of, soonest
from expdesign.values import Array

ALIKE = 0.95  # correlation of scores from which two changes count as not distinguishable
CLEAR, LARGE = 4.0, 0.5
"""Standard errors and sizes by which the ship of the reference differs from its file, from which a sentence says so."""
CLEAR_LOAD = 2.0  # standard errors from which a change of the load is reported


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """State of the watch after a piece of the data."""

    time_s: float  # end of the piece [s]
    statistic: float  # the largest sum in the piece
    # value, std: (m,) size of each change, had it alone happened when the watch began, and its standard error
    value: Array
    std: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitorContent:
    """The values that page and file show."""

    vessel: str  # its name
    changes: tuple[Change, ...]  # watched for
    calibration: Calibration  # of the reference, which ended at `reference_s` [s]
    reference_s: float
    state: State  # at the end
    limit: float  # threshold of the statistic
    false_alarm_days: float  # average time between false alarms that it is for [d]
    alarms: tuple[Alarm, ...]  # as raised, in order; each again when settled or withdrawn
    moments: tuple[Moment, ...]  # of the watch
    left_out_rows: int  # of the data, which lacked a number; unread_rows: in pieces that could not be read
    unread_rows: int
    notes: tuple[str, ...]  # on the data
    command: str  # to reproduce it
    roll: RollWatch | None = None  # of a vessel file with [roll]

    @property
    def found(self) -> tuple[Alarm, ...]:
        """One for each change that was noticed, as it is known at the end; without those withdrawn."""
        latest = {alarm.time_s: alarm for alarm in self.alarms}
        if self.state.alarm is not None:
            latest[self.state.alarm.time_s] = self.state.alarm
        return tuple(alarm for alarm in latest.values() if not alarm.withdrawn)

    @property
    def withdrawn(self) -> tuple[tuple[Alarm, Alarm], ...]:
        """Alarms that were withdrawn, each as it was raised and at its end."""
        raised = {alarm.time_s: alarm for alarm in reversed(self.alarms)}
        return tuple((raised[alarm.time_s], alarm) for alarm in self.alarms if alarm.withdrawn)

    @property
    def wind(self) -> bool:
        """Whether it is measured, so that what it does is no change of the ship."""
        return any(change.air for change in self.changes)

    @property
    def calls(self) -> tuple[Call, ...]:
        """Port calls, with what they changed."""
        return calls_of(self.state, self.calibration)


def size_in_words(content: MonitorContent, alarm: Alarm) -> str:
    """The size of a change in words."""
    change = content.changes[alarm.change]
    return change.in_words(alarm.value * change.size, alarm.std * change.size)


def carries_another(call: Call) -> NDArray[np.bool_]:
    """(m,) what a port call changed of the load, clearly enough to be said."""
    return np.asarray(np.abs(call.value) > np.maximum(CLEAR_LOAD * call.std, LARGE))


def pushed(content: MonitorContent, alarm: Alarm, *, beyond: float = -np.inf) -> list[str]:
    """Equations in which a steady push would do what the change does, the likeliest first; by more than `beyond`."""
    named = {change.effect: change for change in content.changes}
    axes = [EQUATIONS[name] for name in EQUATIONS if f"inertia:{name}" in named]
    return [axes[axis] for axis, gain in sorted(alarm.pushes, key=lambda one: -one[1]) if gain > beyond]


def said_of_reference(calibration: Calibration) -> NDArray[np.bool_]:
    """(m,) differences of the ship from its file in the reference that are clear enough to be said."""
    size = np.abs(calibration.baseline)
    return np.asarray((size > CLEAR * calibration.baseline_std) & (size > LARGE) & (calibration.wanted > 0))


def alike(content: MonitorContent, number: int) -> list[str]:
    """Changes that this one cannot be distinguished from."""
    row = np.abs(content.calibration.alike[number])
    watched = content.calibration.watched
    return [
        change.words
        for other, change in enumerate(content.changes)
        if other != number and watched[other] and row[other] > ALIKE
    ]


def delay_s(content: MonitorContent, number: int) -> float:
    """Expected time to the alarm after a change of its size [s], in data like the reference."""
    return float(soonest(content.calibration.rate[number], content.limit)) * content.calibration.stretch_s
