"""What a step trial that is being sailed consists of, from row to row."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.step_trials.live.step_list import Inputs, Listed
from expdesign.step_trials.samples import Plateau
from expdesign.step_trials.steady_state import RatioTest, Watched
from expdesign.values import Array

LEARNT, BEGUN, STEADY, OVER, BAD, LEFT_OUT, GAP, UNLISTED, DONE = (
    "learnt", "begun", "steady", "over", "bad", "left out", "gap", "unlisted", "done",
)  # fmt: skip
"""Kinds of events."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One sample."""

    time_s: float  # of the source [s]
    motion: tuple[float, float, float]  # u, v, r over ground [m/s, m/s, rad/s]; v is nan where it is not measured
    inputs: Inputs  # commands


@dataclass(frozen=True, kw_only=True)
class Held:
    """Commands that stand, or move towards where they will stand."""

    rows: tuple[Row, ...]  # since the commands began to change
    stands: int = 0  # first row from which on they have not moved
    inputs: Inputs | None = None  # commands, None while it is not clear where they will stand
    changed: tuple[bool, bool] = (False, False)  # which of throttle and rudder moved
    step: Listed | None = None  # of the list that this is, None for commands only gone to
    steady: int | None = None  # row from which on the vessel is steady, None before
    hold_s: float = 0.0  # time that it should stay so [s]
    over: bool = False  # whether it has been judged
    gap_s: float = 0.0  # longest gap in its rows [s]

    @property
    def elapsed_s(self) -> float:
        """Time since the commands began to change [s]."""
        return self.rows[-1].time_s - self.rows[0].time_s


@dataclass(frozen=True, kw_only=True)
class Finished:
    """A step that counts."""

    number: int  # in the list
    begins_s: float  # time at which the commands changed [s]
    steady_s: float  # time until steady [s]
    # state, state_std: U [m/s] and r [rad/s] of the plateau, and their standard errors
    state: tuple[float, float]
    state_std: tuple[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """Everything that goes on from row to row."""

    left: tuple[Listed, ...]  # steps to sail, in order; those to repeat are at the end
    finished: tuple[Finished, ...] = ()  # steps that count
    left_out: tuple[Listed, ...] = ()  # steps that failed too often
    sample_time_s: float = 0.0  # 0 before it is known [s]
    tests: tuple[RatioTest, RatioTest] | None = None  # of steady state for U and r, None before the noise is learnt
    watched: tuple[Watched, ...] = ()  # states of both
    held: Held | None = None  # the present commands, None before the first row
    # steady state under the commands before, and these; None where there was none
    before: tuple[Inputs, Plateau] | None = None
    steady: tuple[Array, ...] = ()  # (k, 2) U and r of the steady parts of the latest holds, which show the noise
    skipped: int = 0  # rows whose time did not increase


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something to tell the crew."""

    time_s: float  # of the row [s]
    kind: str  # one of the above
    step: Listed | None = None  # that it is about
    inputs: Inputs = ()  # commands that it is about
    why: str = ""  # what is wrong
    seconds: float = 0.0  # time until steady, to hold, or of a gap [s]
    whole_turn: bool = False  # whether that is the time of a whole turn
    state: tuple[float, float] | None = None  # U and r, where it is steady
    # commands to set now, and the step that they are, None for commands only gone to before a step; None where nothing
    # is to be set
    following: tuple[Inputs, Listed | None] | None = None
