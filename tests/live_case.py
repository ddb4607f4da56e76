"""A crew that obeys a watched step trial on a craft of first order, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from expdesign.step_trials import controls_of
from expdesign.step_trials.live import Event, Inputs, Row, Setup, State, after_row, beginning, step_list
from plain_craft import CONSTANTS_S as PLAIN_CONSTANTS_S
from plain_craft import RATE_PER_RAD, Craft, sailed, steady_speed
from step_case import INPUTS

SHORT = ((4.0, 0.1), (8.0, 0.1), (12.0, 0.1), (8.0, 0.1), (8.0, 0.3), (8.0, 0.1))
CONSTANTS_S = (6.0, 3.0)
SAMPLE_S = 0.5
Errs = Callable[[float], str]
"""Time -> "gap" for a row that gets lost, "early" for a crew that goes on too soon, or ""."""


def no_error(time_s: float) -> str:
    """Nothing goes wrong."""
    return ""


def plateau_of(inputs: Sequence[float]) -> np.ndarray:
    """U and r of the craft."""
    return np.array([0.5 * inputs[0], 0.05 * inputs[0] * inputs[1]])


def watch_setup(steps: Sequence[tuple[float, float]] = SHORT, *, learn_s: float = 60.0) -> Setup:
    """Of a watch over the craft."""
    wanted = step_list(INPUTS, np.array(steps), controls_of(INPUTS))
    return Setup(steps=wanted, constants_s=CONSTANTS_S, learn_s=learn_s)


class Crew:
    """Sets the commands that the watch asks for, three seconds later.

    Args:
        setup: of the watch.
        seed: of the noise.
        errs: what goes wrong.
    """

    def __init__(self, setup: Setup, seed: int, errs: Errs = no_error) -> None:
        self.setup, self.rng, self.errs = setup, np.random.default_rng(seed), errs
        self.commands: Inputs = setup.steps.start
        self.craft = plateau_of(self.commands)
        self.due: list[tuple[float, Inputs]] = []
        self.rows: list[Row] = []
        self.events: list[Event] = []

    def sail(self, longest_s: float) -> State:
        """Until all is done, or the time is up."""
        state, time_s = beginning(self.setup), 0.0
        while state.left and time_s < longest_s:
            time_s += SAMPLE_S
            row = self._row(time_s)
            if self.errs(time_s) == "gap":
                continue
            self.rows.append(row)
            state, events = after_row(state, row, self.setup)
            self.events += events
            self.due += [(time_s + 3.0, event.following[0]) for event in events if event.following]
        return state

    def _row(self, time_s: float) -> Row:
        if self.errs(time_s) == "early":
            self.commands = self.setup.steps.steps[-1].after
        while self.due and self.due[0][0] <= time_s:
            self.commands = self.due.pop(0)[1]
        keep = np.exp(-SAMPLE_S / np.array(CONSTANTS_S))
        self.craft = plateau_of(self.commands) + keep * (self.craft - plateau_of(self.commands))
        speed, rate = self.craft + np.array([0.03, 0.003]) * self.rng.standard_normal(2)
        return Row(time_s=time_s, motion=(float(speed), math.nan, float(rate)), inputs=self.commands)


def rows_csv(rows: Sequence[Row]) -> str:
    """As a file of measured data."""
    lines = [f"{row.time_s!r},{row.motion[0]!r},{row.motion[2]!r},{row.inputs[0]!r},{row.inputs[1]!r}" for row in rows]
    return "\n".join(["time_s,u_mps,r_radps,n1_rps,rudder1_rad", *lines]) + "\n"


def list_csv(steps: Sequence[tuple[float, float]] = SHORT) -> str:
    """As a list of steps."""
    return "\n".join(["n1_rps,rudder1_rad", *(f"{n!r},{d!r}" for n, d in steps)]) + "\n"


def errors_of_watched(seed: int, craft: Craft) -> np.ndarray:
    """(k, 2) errors of U and r of the steps that count, in their standard errors; the crew keeps to a timetable."""
    wanted = step_list(INPUTS, np.array(craft.steps), controls_of(INPUTS))
    setup = Setup(steps=wanted, constants_s=PLAIN_CONSTANTS_S, learn_s=0.8 * craft.hold_s)
    told, state = sailed(seed, craft), beginning(setup)
    columns = ("time_s", "u_mps", "v_mps", "r_radps", "n1_rps", "rudder1_rad")
    for time_s, u, v, r, *commands in np.column_stack([told[name] for name in columns]).tolist():
        state, _ = after_row(state, Row(time_s=time_s, motion=(u, v, r), inputs=tuple(commands)), setup)
    after = {step.number: step.after for step in wanted.steps}
    n, rudder = np.array([after[one.number] for one in state.finished]).T
    truth = np.column_stack([steady_speed(n, rudder, craft), RATE_PER_RAD * rudder])
    return (np.array([one.state for one in state.finished]) - truth) / [one.state_std for one in state.finished]
