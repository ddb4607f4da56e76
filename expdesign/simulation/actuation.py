"""Actuator responses: dead band, dead time, first-order lag and misalignment, in this order.

Commands are held between samples, so the lag has a closed form: `sample_map` states it once, linear in the delivered
value and in the commands, for arrays and for symbols. `deliver` applies it to commands that are known beforehand,
`ActuatorState` sample by sample to commands that follow the motion. The mean delivered value over each integrator step
acts in the equations of motion. A signal with the ideal response passes through unchanged, to the last bit.

Before the first sample, the `standing` commands are held for long; the first ones by default.
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
    """One signal over one sample, linear in its initial value and in the commands that arrive.

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


def step_shares(responses: Sequence[Response], *, sample_time_s: float, substeps: int) -> Array:
    """(s,) shares of a sample that integrator steps take: equal ones, divided where late commands arrive.

    No command changes within a step then. The equations of motion are not linear in the inputs, so a step that acts
    with the mean of two commands is only first-order accurate, and the errors of a whole trial add up.

    Args:
        responses: one for each signal.
        sample_time_s: time for which commands are held [s].
        substeps: equal steps that are divided.
    """
    late = np.array([response.delay_s for response in responses]) / sample_time_s
    arrivals, edges = late - np.floor(late + 1e-9), np.arange(substeps + 1) / substeps
    new = [share for share in np.unique(arrivals).tolist() if np.abs(edges - share).min() > 1e-6]
    return np.diff(np.sort(np.r_[edges, new])) if new else np.full(substeps, 1.0 / substeps)


def sample_map(response: Response, *, sample_time_s: float, substeps: int | Array = 1) -> SampleMap:
    """The map of a signal with this response over one sample, for arrays and for symbols.

    Args:
        response: of the signal.
        sample_time_s: time for which commands are held [s].
        substeps: integrator steps per sample, or the shares of it that they take.
    """
    lateness = math.floor(response.delay_s / sample_time_s + 1e-9)
    change_s = max(0.0, response.delay_s - lateness * sample_time_s)
    steps_s = step_times(substeps, sample_time_s)
    begins_s = np.cumsum(steps_s) - steps_s
    early_s = np.clip(change_s - begins_s, 0.0, steps_s)
    pieces = [
        [(1, early), (2, rest)] for early, rest in zip(early_s.tolist(), (steps_s - early_s).tolist(), strict=True)
    ]
    return mapped(response, lateness, pieces)


def mapped(response: Response, lateness: int, pieces: Sequence[Sequence[tuple[int, float]]]) -> SampleMap:
    """The map where steps consist of pieces: 1 for the earlier command or 2 for the later one, and a time [s].

    The mean over a step of no length is its limit.
    """
    value, means = np.array([1.0, 0.0, 0.0]), []
    for step in pieces:
        total, step_s = np.zeros(3), sum(time_s for _, time_s in step)
        for command, time_s in step:
            area, value = _towards(value, np.eye(3)[command], response.lag_s, time_s)
            total += area
        acting = value if response.lag_s > 0 else np.eye(3)[step[-1][0]]
        means.append(total / step_s if step_s else acting)
    return SampleMap(
        means=np.array(means), end=value, lateness=lateness, deadband=response.deadband, offset=response.offset
    )


def step_times(substeps: int | Array, sample_time_s: float) -> Array:
    """(s,) times that integrator steps take, so many equal ones or of these shares of a sample [s]."""
    return np.asarray(
        np.full(substeps, sample_time_s / substeps) if isinstance(substeps, int) else substeps * sample_time_s
    )


def _towards(value: Array, target: Array, lag_s: float, time_s: float) -> tuple[Array, Array]:
    """Time integral and last value of an approach to a held target."""
    if time_s == 0:
        return np.zeros(3), value
    if lag_s <= 0:
        return time_s * target, target
    gone = -math.expm1(-time_s / lag_s)
    return time_s * target + lag_s * gone * (value - target), value + gone * (target - value)


def past_deadband(commands: Any, deadband: float) -> Any:
    """Commands outside the dead band; zero for the others."""
    return np.where(np.abs(commands) < deadband, 0.0, commands) if deadband > 0 else commands


def deliver(
    responses: Sequence[Response],
    commands: Array,
    *,
    sample_time_s: float,
    substeps: int | Array = 1,
    standing: Array | None = None,
) -> Array:
    """The mean delivered value over each integrator step, which acts in the equations of motion.

    Args:
        responses: one for each signal.
        commands: (k, m, ...) held.
        sample_time_s: time between samples [s].
        substeps: integrator steps per sample, or the shares of it that they take.
        standing: (m, ...) commands that stood before the first sample; None for those of the first sample.

    Returns:
        (k, substeps, m, ...); where every response is ideal (k, 1, m, ...), the commands themselves.
    """
    if all(response == IDEAL for response in responses):
        return commands[:, None]
    count = substeps if isinstance(substeps, int) else len(substeps)
    maps = [
        None if response == IDEAL else sample_map(response, sample_time_s=sample_time_s, substeps=substeps)
        for response in responses
    ]
    return deliver_through(maps, commands, count, standing=standing)


def deliver_through(
    maps: Sequence[SampleMap | None], commands: Array, substeps: int, *, standing: Array | None = None
) -> Array:
    """(k, substeps, m, ...) inputs delivered by each signal's map over a sample, None where its response is ideal."""
    result = np.repeat(commands[:, None], substeps, axis=1)
    for column, through in enumerate(maps):
        if through is None:
            continue
        before = commands[0, column] if standing is None else standing[column]
        start, early, late = _signals(through, commands[:, column], before)
        for step, (of_start, of_early, of_late) in enumerate(through.means.tolist()):
            result[:, step, column] = of_start * start[:-1] + of_early * early + of_late * late + through.offset
    return result


def delivered_at_samples(
    responses: Sequence[Response], commands: Array, *, sample_time_s: float, standing: Array | None = None
) -> Array:
    """(k + 1, m) delivered values at the start of each sample, before its command acts, and at the end."""
    first = commands[0] if standing is None else standing
    result = np.concatenate([first[None], commands])
    for column, response in enumerate(responses):
        if response != IDEAL:
            through = sample_map(response, sample_time_s=sample_time_s)
            result[:, column] = _signals(through, commands[:, column], first[column])[0] + through.offset
    return result


def delivered(vessel: Vessel, commands: Commands, *, standing: Array | None = None) -> Commands:
    """Delivered values of a vessel's actuators, as means over each sample, for regressors and reports."""
    values = deliver(vessel.responses, commands.values, sample_time_s=commands.sample_time_s, standing=standing)
    return Commands(sample_time_s=commands.sample_time_s, names=commands.names, values=values[:, 0])


def _signals(through: SampleMap, command: Array, before: Any) -> tuple[Array, Array, Array]:
    """Delivered value at each sample (k + 1, ...), and the earlier and later command (k, ...) that act in between."""
    effective = past_deadband(command, through.deadband)
    first = np.broadcast_to(past_deadband(np.asarray(before, dtype=float), through.deadband), command.shape[1:])
    from scipy.signal import lfilter  # slow to import, and most ships have no lagging actuators

    count = len(command)
    history = np.concatenate([np.repeat(first[None], min(through.lateness, count) + 1, axis=0), effective])
    early, late = history[:count], history[1 : count + 1]
    keep, of_early, of_late = through.end.tolist()
    driven = of_early * early + of_late * late
    ends = lfilter([1.0], [1.0, -keep], driven, axis=0, zi=keep * first[None])[0]
    return np.concatenate([first[None], ends]), early, late


@dataclass(frozen=True, kw_only=True, eq=False)
class ActuatorState:
    """Actuators of n ships at the start of a sample: `deliver` for commands that are not known beforehand.

    Attributes:
        maps: (m) map of each signal over a sample; None where its response is ideal.
        substeps: integrator steps per sample.
        values: (m, n) delivered values, less the misalignment.
        past: for each signal (lateness + 1, n) commands outside the dead band that do not act yet, oldest first.
    """

    maps: tuple[SampleMap | None, ...]
    substeps: int
    values: Array
    past: tuple[Array, ...]

    @classmethod
    def standing(
        cls, responses: Sequence[Response], commands: Array, *, sample_time_s: float, substeps: int | Array
    ) -> ActuatorState:
        """The state after commands (m, n) held for long."""
        maps = tuple(
            None if response == IDEAL else sample_map(response, sample_time_s=sample_time_s, substeps=substeps)
            for response in responses
        )
        values = np.array([_effective(through, row) for through, row in zip(maps, commands, strict=True)])
        counts = [through.lateness + 1 if through else 0 for through in maps]
        past = tuple(np.tile(row, (count, 1)) for row, count in zip(values, counts, strict=True))
        count = substeps if isinstance(substeps, int) else len(substeps)
        return cls(maps=maps, substeps=count, values=values, past=past)

    def mean(self, commands: Array) -> Array:
        """(substeps, m, n) mean over each integrator step of a sample with these commands (m, n).

        Where every response is ideal (1, m, n), the commands themselves.
        """
        if not any(self.maps):
            return commands[None]
        result = np.repeat(commands[None], self.substeps, axis=0)
        for row, through in enumerate(self.maps):
            if through is not None:
                result[:, row] = through.means @ self._driving(row, commands[row]) + through.offset
        return result

    def after(self, commands: Array) -> ActuatorState:
        """One sample later."""
        values, pasts = np.array(commands, dtype=float), list(self.past)
        for row, through in enumerate(self.maps):
            if through is not None:
                driving = self._driving(row, commands[row])
                values[row] = through.end @ driving
                pasts[row] = np.concatenate([self.past[row][1:], _effective(through, commands[row])[None]])
        return ActuatorState(maps=self.maps, substeps=self.substeps, values=values, past=tuple(pasts))

    def _driving(self, row: int, command: Array) -> Array:
        """(3, n) initial value of a signal, and the commands that act early and late in the sample."""
        on_their_way = np.concatenate([self.past[row], _effective(self.maps[row], command)[None]])
        return np.concatenate([self.values[row][None], on_their_way[:2]])


def _effective(through: SampleMap | None, command: Array) -> Array:
    """Commands past the dead band, as floats."""
    return np.asarray(command if through is None else past_deadband(command, through.deadband), dtype=float)
