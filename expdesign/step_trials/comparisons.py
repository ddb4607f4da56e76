"""Whether port differs from starboard, and steps up from steps down: nested regressions and their F test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.step_trials.holds import CHANNELS
from expdesign.step_trials.samples import Plateau, StepSample
from expdesign.step_trials.surfaces import EVEN, ODD
from expdesign.values import Array

LOW_ORDER = 3
"""Highest degree of the surface that is compared with."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A difference in damping that a symmetric surface without memory cannot have.

    Attributes:
        kind: "asymmetry" or "hysteresis".
        command: "throttle" or "rudder".
        difference: half of that between the two sides or branches, in the unit of the command.
        std: its standard error.
        p_value: of no difference.
        samples: plateaus compared.
    """

    kind: str
    command: str
    difference: float
    std: float
    p_value: float
    samples: int


def comparisons(samples: Sequence[StepSample]) -> tuple[Comparison, ...]:
    """Asymmetry where both sides were sailed, hysteresis where both directions were, for both commands."""
    steady = [(one, one.plateau) for one in samples if one.plateau is not None]
    found = []
    for channel, command in enumerate(CHANNELS):
        sides = np.array([np.sign(part.state[1]) * (abs(one.hold.commands[1]) > 0) for one, part in steady])
        directions = np.array([_direction(one, channel) for one, _ in steady])
        for kind, signs in (("asymmetry", sides), ("hysteresis", directions)):
            found += [_compared(kind, command, channel, steady, signs)]
    return tuple(one for one in found if one is not None)


def _direction(one: StepSample, channel: int) -> float:
    """+1 after a step up of this command, -1 after a step down, 0 after others."""
    return 0.0 if one.hold.channel != channel else (1.0 if one.upward else -1.0)


def _compared(
    kind: str, command: str, channel: int, steady: Sequence[tuple[StepSample, Plateau]], signs: Array
) -> Comparison | None:
    states = np.array([part.state for _, part in steady])
    values = np.array([one.hold.commands[channel] for one, _ in steady])
    if kind == "hysteresis" and channel == 1:
        signs = signs * np.sign(states[:, 1])
    powers = [power for power in ((0, 0), *ODD) if channel and sum(power) <= LOW_ORDER] or [
        power for power in EVEN if sum(power) <= LOW_ORDER
    ]
    if kind == "asymmetry" and channel:
        powers = [power for power in powers if power != (0, 0)]
        extra = np.ones(len(signs))
    else:
        extra = signs
    if min(np.sum(signs > 0), np.sum(signs < 0)) < 3 or len(values) < len(powers) + 4:
        return None
    columns = np.stack([states[:, 0] ** i * states[:, 1] ** j for i, j in powers], axis=1)
    return _tested(kind, command, columns, extra, values)


def _tested(kind: str, command: str, columns: Array, extra: Array, values: Array) -> Comparison:
    """The comparison that one more column makes; its F test is the square of its t test."""
    columns = columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-12)
    rest, target = (part - columns @ np.linalg.lstsq(columns, part, rcond=1e-10)[0] for part in (extra, values))
    power = max(float(rest @ rest), 1e-12)
    difference = float(rest @ target) / power
    freedom = len(values) - np.linalg.matrix_rank(columns) - 1
    error = target - difference * rest
    std = float(np.sqrt(max(float(error @ error), 1e-300) / freedom / power))
    p_value = 2 * float(scipy.stats.t.sf(abs(difference) / std, freedom))
    return Comparison(kind=kind, command=command, difference=difference, std=std, p_value=p_value, samples=len(values))
