"""What actuators deliver of their commands: dead time, dead band, first-order lag and misalignment.

Commands are held between samples, so the lag answers in closed form. Equations of motion see the mean of what is
delivered over each integrator step. A signal whose response is ideal passes through untouched, to the last bit.

Before the first sample `standing` commands have stood for long; without them the first ones have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from expdesign.signals import Commands
from expdesign.values import Array, seal
from expdesign.vessel import IDEAL, Response, Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleMap:
    """One signal over one sample, linear in what it starts from and in the commands that arrive.

    With x the value delivered at the sample, less the misalignment, and with the command given `lateness` + 1 samples
    ago, c_early, and the one given `lateness` samples ago, c_late, both after the dead band:

        mean over step i  = means[i] @ (x, c_early, c_late) + offset
        x one sample on   = end @ (x, c_early, c_late)

    Attributes:
        means: (substeps, 3).
        end: (3,).
        lateness: whole samples of the dead time.
        deadband, offset: as in `Response`.
    """

    means: Array
    end: Array
    lateness: int
    deadband: float
    offset: float

    def __post_init__(self) -> None:
        seal(self, means="s 3", end="3")


def sample_map(response: Response, *, sample_time_s: float, substeps: int = 1) -> SampleMap:
    """How a signal with this response goes through one sample, for arrays and for symbols alike.

    Args:
        response: of the signal.
        sample_time_s: time for which commands are held [s].
        substeps: integrator steps per sample.
    """
    lateness = math.floor(response.delay_s / sample_time_s + 1e-9)
    change_s = max(0.0, response.delay_s - lateness * sample_time_s)
    step_s = sample_time_s / substeps
    value, means = np.array([1.0, 0.0, 0.0]), []
    for step in range(substeps):
        early_s = min(max(change_s - step * step_s, 0.0), step_s)
        total = np.zeros(3)
        for command, time_s in ((1, early_s), (2, step_s - early_s)):
            area, value = _towards(value, np.eye(3)[command], response.lag_s, time_s)
            total += area
        means.append(total / step_s)
    return SampleMap(
        means=np.array(means), end=value, lateness=lateness, deadband=response.deadband, offset=response.offset
    )


def _towards(value: Array, target: Array, lag_s: float, time_s: float) -> tuple[Array, Array]:
    """Time integral and last value of an approach to a held target."""
    if time_s <= 0:
        return np.zeros(3), value
    if lag_s <= 0:
        return time_s * target, target
    gone = -math.expm1(-time_s / lag_s)
    return time_s * target + lag_s * gone * (value - target), value + gone * (target - value)


def past_deadband(commands: Any, deadband: float) -> Any:
    """Commands that have an effect; zero for the others."""
    return np.where(np.abs(commands) < deadband, 0.0, commands) if deadband > 0 else commands


def deliver(
    responses: Sequence[Response],
    commands: Array,
    *,
    sample_time_s: float,
    substeps: int = 1,
    standing: Array | None = None,
) -> Array:
    """What equations of motion see: the mean over each integrator step of what is delivered.

    Args:
        responses: one for each signal.
        commands: (k, m, ...) held.
        sample_time_s: time between samples [s].
        substeps: integrator steps per sample.
        standing: (m, ...) commands that stood before the first sample; None for those of the first sample.

    Returns:
        (k, substeps, m, ...); where every response is ideal (k, 1, m, ...), the commands themselves.
    """
    if all(response == IDEAL for response in responses):
        return commands[:, None]
    result = np.repeat(commands[:, None], substeps, axis=1)
    for column, response in enumerate(responses):
        if response == IDEAL:
            continue
        through = sample_map(response, sample_time_s=sample_time_s, substeps=substeps)
        before = commands[0, column] if standing is None else standing[column]
        start, early, late = _signals(through, commands[:, column], before)
        for step, (of_start, of_early, of_late) in enumerate(through.means.tolist()):
            result[:, step, column] = of_start * start[:-1] + of_early * early + of_late * late + through.offset
    return result


def delivered_at_samples(
    responses: Sequence[Response], commands: Array, *, sample_time_s: float, standing: Array | None = None
) -> Array:
    """(k + 1, m) what is delivered as each sample begins, before its command acts, and at the end of the last one."""
    first = commands[0] if standing is None else standing
    result = np.concatenate([first[None], commands])
    for column, response in enumerate(responses):
        if response != IDEAL:
            through = sample_map(response, sample_time_s=sample_time_s)
            result[:, column] = _signals(through, commands[:, column], first[column])[0] + through.offset
    return result


def delivered(vessel: Vessel, commands: Commands, *, standing: Array | None = None) -> Commands:
    """The mean over each sample of what a vessel's actuators deliver, for regressors and reports."""
    values = deliver(vessel.responses, commands.values, sample_time_s=commands.sample_time_s, standing=standing)
    return Commands(sample_time_s=commands.sample_time_s, names=commands.names, values=values[:, 0])


def _signals(through: SampleMap, command: Array, before: Any) -> tuple[Array, Array, Array]:
    """Delivered value at each sample (k + 1, ...), and the earlier and later command (k, ...) that act in between."""
    effective = past_deadband(command, through.deadband)
    first = np.broadcast_to(past_deadband(np.asarray(before, dtype=float), through.deadband), command.shape[1:])
    count = len(command)
    history = np.concatenate([np.repeat(first[None], min(through.lateness, count) + 1, axis=0), effective])
    early, late = history[:count], history[1 : count + 1]
    keep, of_early, of_late = through.end.tolist()
    values = [first]
    for driven in of_early * early + of_late * late:
        values.append(keep * values[-1] + driven)
    return np.array(values), early, late
