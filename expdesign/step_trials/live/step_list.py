"""A list of steps: what is to be sailed, what is left of it, and in which order the crew sets the commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError
from expdesign.step_trials.holds import CONSTANT_SHARE, Controls, commands_of
from expdesign.values import Array

Inputs = tuple[float, ...]
"""One value for each input signal of the vessel."""


@dataclass(frozen=True, kw_only=True)
class Listed:
    """One step: a change from steady commands to others."""

    number: int  # in the list, from 1
    # before, after: commands on both sides
    before: Inputs
    after: Inputs
    attempts: int = 0  # that failed
    why: str = ""  # what was wrong with the last of them

    def failed(self, why: str) -> Listed:
        """The step after an attempt that failed."""
        return replace(self, attempts=self.attempts + 1, why=why)


@dataclass(frozen=True, kw_only=True)
class StepList:
    """Steps to sail."""

    controls: Controls  # which inputs are throttle and rudder
    names: tuple[str, ...]  # input signals
    start: Inputs  # commands of the first hold, in which the noise is learnt
    steps: tuple[Listed, ...]  # in the order of the list
    width: Inputs  # of each input, within which commands count as equal
    first_s: float = math.inf  # time planned for the first hold [s]; infinite where none is

    def same(self, one: Sequence[float], other: Sequence[float]) -> bool:
        """Whether commands are equal within the width."""
        return all(abs(a - b) <= width for a, b, width in zip(one, other, self.width, strict=True))

    def commands(self, inputs: Inputs) -> tuple[float, float]:
        """Throttle and rudder."""
        throttle, rudder = commands_of(self.controls, self.names, np.array([inputs]))[0].tolist()
        return throttle, rudder

    def moved(self, one: Inputs, other: Inputs) -> tuple[bool, bool]:
        """Whether throttle and rudder differ."""
        apart = np.abs(np.subtract(self.commands(one), self.commands(other)))
        throttle, rudder = (apart > self._width()).tolist()
        return throttle, rudder

    def level(self, inputs: Inputs) -> Inputs | None:
        """The commands of the list that these are, or None."""
        levels = (self.start, *(step.after for step in self.steps))
        return next((level for level in levels if self.same(level, inputs)), None)

    def holds(self, before: Array, after: Array) -> bool:
        """Whether one of the steps changes throttle and rudder (2,) so, within the width."""
        width = self._width()
        return any(
            (np.abs(np.subtract(self.commands(step.before), before)) <= width).all()
            and (np.abs(np.subtract(self.commands(step.after), after)) <= width).all()
            for step in self.steps
        )

    def _width(self) -> Array:
        """(2,) widths of throttle and rudder."""
        levels = np.array([self.start, *(step.after for step in self.steps)])
        ranges = np.ptp(commands_of(self.controls, self.names, levels), axis=0)
        return np.asarray(CONSTANT_SHARE * ranges + 1e-9)

    def sailed(self, left: Sequence[Listed], before: Inputs | None, after: Inputs) -> Listed | None:
        """The first of the steps left that a change of commands is."""
        if before is None:
            return None
        return next((step for step in left if self.same(step.before, before) and self.same(step.after, after)), None)


def step_list(
    names: Sequence[str],
    levels: Array,
    controls: Controls,
    *,
    numbers: Sequence[int | None] | None = None,
    first_s: float = math.inf,
) -> StepList:
    """Steps between levels (k, m) of all inputs, one after the other; levels that repeat the one before are left out.

    Args:
        levels: of the commands.
        numbers: of the steps that lead to each level, None for levels that are only gone to; counted where not given.
        first_s: time planned for the first hold [s]; infinite where none is.

    Raises:
        InputError: less than two levels differ.
    """
    if len(levels) < 2:
        raise InputError(f"the list of steps holds {len(levels)} levels of the commands, expected two or more")
    width = np.maximum(CONSTANT_SHARE * np.ptp(levels, axis=0), 1e-9)
    kept = [0, *(k for k in range(1, len(levels)) if (np.abs(levels[k] - levels[k - 1]) > width).any())]
    if len(kept) < 2:
        raise InputError("the list of steps never changes a command, expected two or more different rows")
    rows = [tuple(map(float, levels[k])) for k in kept]
    counted = list(range(len(kept))) if numbers is None else [numbers[k] for k in kept]
    steps = [
        Listed(number=number, before=before, after=after)
        for number, before, after in zip(counted[1:], rows, rows[1:], strict=False)
        if number is not None
    ]
    return StepList(
        controls=controls, names=tuple(names), start=rows[0], steps=tuple(steps), width=tuple(map(float, width)),
        first_s=first_s,
    )  # fmt: skip


def in_sequence(left: Sequence[Listed], at: Inputs | None, steps: StepList) -> list[tuple[Inputs, Listed | None]]:
    """Commands to set one after the other, and the step that each is; None for those only gone to before a step."""
    found: list[tuple[Inputs, Listed | None]] = []
    for step in left:
        if at is None or not steps.same(at, step.before):
            found.append((step.before, None))
        found.append((step.after, step))
        at = step.after
    return found
