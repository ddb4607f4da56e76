"""Legs found before the runs between them are sailed: each from where the run before it ends if it begins as planned.

So the legs of a placement do not wait for each other, and processes share them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import whole_turns
from expdesign.memory import in_order, recalled
from expdesign.plan.legs import LegTask, LegWater, acceptable, nearest_turns
from expdesign.plan.local_planner import LocalPlanner
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class LegAhead:
    """A leg found ahead."""

    task: LegTask  # as it was expected
    commands: Array | None  # (k, m), or None where there is no leg
    source: str  # what found its path
    spent_s: float  # work that it took

    def fitted(self, task: LegTask, water: LegWater) -> Array | None:
        """The commands for the task as it has become, azimuths shifted by whole turns; None where they miss its end."""
        if self.commands is None or np.array_equal(task.start, self.task.start):
            return self.commands
        expected = self.task.start_inputs
        values = self.commands + nearest_turns(water.vessel, expected, task.start_inputs) - expected
        heading = water.states(task.start, values, task.past)[-1, 2]
        end = np.r_[task.end[:2], task.end[2] + whole_turns(heading - task.end[2]), task.end[3:]]
        return values if acceptable(task.start, end, water, values, task.past) else None


KnownLegs = dict[tuple[bytes, ...], LegAhead]
"""Legs found before, by all that decides them but chance."""


def legs_ahead(
    planner: LocalPlanner, water: LegWater, tasks: Iterable[LegTask], known: KnownLegs | None = None
) -> Iterator[LegAhead]:
    """The legs of tasks, in order; those known are not sought again, and those found become known."""
    if known is None:
        return in_order(_found, (planner, water), ((task,) for task in tasks))
    places, sought = [], dict[tuple[bytes, ...], LegTask]()
    for task in tasks:  # the same place may come twice
        places.append(place := _place(task))
        if place not in known:
            sought[place] = task
    if len(sought) == 1:  # found here before another process has the water
        remember(known, leg_found(planner, water, *sought.values()))
    else:
        known |= zip(sought, in_order(_found, (planner, water), ((task,) for task in sought.values())), strict=True)
    return (known[place] for place in places)


def remember(known: KnownLegs, ahead: LegAhead) -> None:
    """Make a leg known."""
    known[_place(ahead.task)] = ahead


def _place(task: LegTask) -> tuple[bytes, ...]:
    ends = task.start, task.end, task.start_inputs, task.end_inputs, task.past
    return tuple(np.asarray(part, dtype=float).tobytes() for part in ends)


def leg_found(planner: LocalPlanner, water: LegWater, task: LegTask) -> LegAhead:
    """The leg of a task."""
    return recalled(_found, planner, water, task)


def _found(planner: LocalPlanner, water: LegWater, task: LegTask) -> LegAhead:
    leg = planner.leg(task, water)
    return LegAhead(
        task=task,
        commands=None if leg is None else leg.commands,
        source="" if leg is None else leg.source,
        spent_s=task.budget.spent_s,
    )
