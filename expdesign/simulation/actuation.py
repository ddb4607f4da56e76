"""Actuator responses: slew rate, dead band, dead time, first-order lag and misalignment, in this order.

An actuator moves towards its command at its slew rate. Commands that change no faster, as planned ones do, are followed
as they are held; towards a faster one it moves evenly, and its mean position over each sample goes on (`moved`).

From there commands are held between samples, so the lag has a closed form: `sample_map` states it once, linear in the
delivered value and in the commands, for arrays and for symbols. `deliver` applies it to commands that are known
beforehand, `ActuatorState` sample by sample to commands that follow the motion. The mean delivered value over each
integrator step acts in the equations of motion. A signal with the ideal response passes through unchanged, to the last
bit, and so does one that only has a rate, where its commands keep to it.

Before the first sample, the `standing` commands are held for long; the first ones by default.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from expdesign.signals import Batch, Commands
from expdesign.values import Array, sealed
from expdesign.vessel import Response, Vessel

FOLLOWED = 1.01  # share of a rate up to which commands count as keeping to it: files round them
FASTER, COARSEST = 1.5, 0.03
"""Share of a stated rate that a recorded position may move at, and share of its range that its readings may step by."""


@sealed(means="s 3", end="3")
class SampleMap:
    """One signal over one sample, linear in its initial value and in the commands that arrive.

    With x the value delivered at the sample, less the misalignment, and with the command given `lateness` + 1 samples
    ago, c_early, and the one given `lateness` samples ago, c_late, both after the dead band:

        mean over step i  = means[i] @ (x, c_early, c_late) + offset
        x one sample on   = end @ (x, c_early, c_late)
    """

    means: Array  # (substeps, 3)
    end: Array  # (3,)
    lateness: int  # whole samples of the dead time
    # deadband, offset: as in `Response`
    deadband: float
    offset: float


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


def moved(position: Any, goal: Any, reach: Any) -> tuple[Array, Array]:
    """Mean and last position over a time in which something moves evenly towards a goal and stays there.

    Args:
        position: at the beginning.
        goal: held.
        reach: farthest that it moves in this time, more than 0.
    """
    way = goal - position
    last = np.where(np.abs(way) <= reach, goal, position + np.clip(way, -reach, reach))
    return np.asarray(last - (last - position) * np.minimum(np.abs(way) / reach, 1.0) / 2), last


def positions(
    responses: Sequence[Response], commands: Array, *, sample_time_s: float, standing: Array | None
) -> tuple[Array, Array]:
    """Where actuators stand that move towards their commands (k, m, ...) at their slew rates; see `deliver`.

    Returns:
        (k, m, ...) means over each sample, and positions at its end; both the commands where these keep to the rates.
    """
    before = commands[0] if standing is None else standing
    means, ends = commands, commands
    for column, response in enumerate(responses):
        reach = response.rate * sample_time_s
        first = np.broadcast_to(np.asarray(before[column], dtype=float), commands.shape[2:])
        previous = np.concatenate([first[None], commands[:-1, column]])
        faster = np.abs(commands[:, column] - previous) > FOLLOWED * reach
        if not faster.any():
            continue
        if means is commands:
            means, ends = np.array(commands, dtype=float), np.array(commands, dtype=float)
        rows = np.flatnonzero(faster.reshape(len(commands), -1).any(axis=1)).tolist()
        means[:, column], ends[:, column] = _slewed(commands[:, column], previous, rows, reach)
    return means, ends


def _slewed(command: Array, previous: Array, faster: Sequence[int], reach: float) -> tuple[Array, Array]:
    """Means and ends (k, ...) of one signal, followed from each command that is too fast until it is reached."""
    means, ends, row = np.array(command, dtype=float), np.array(command, dtype=float), 0
    for start in faster:
        if start < row:
            continue
        row, position = start, previous[start]
        while row < len(command):
            means[row], position = _sample_moved(previous[row], position, command[row], reach)
            ends[row] = position
            row += 1
            if (position == command[row - 1]).all():
                break
    return means, ends


def _sample_moved(previous: Any, position: Any, command: Any, reach: Any) -> tuple[Array, Array]:
    """Mean and last position over a sample; one that stood at its last command follows a slow change at once."""
    followed = (position == previous) & (np.abs(command - previous) <= FOLLOWED * reach)
    mean, last = moved(position, command, reach)
    return np.where(followed, command, mean), np.where(followed, command, last)


def acting_response(batch: Batch, name: str, response: Response) -> Response:
    """What of a signal's response acts on its recorded values: all on commands, a misalignment on reached positions.

    Values that keep to the slew rate are where the actuator stands, whether they were commanded or measured.
    """
    if name in batch.reached:
        return Response(offset=response.offset)
    recorded = batch.inputs[:, batch.input_names.index(name)]
    kept = math.isfinite(response.rate) and keeps_to(response.rate, recorded, sample_time_s=batch.sample_time_s)
    return replace(response, rate=math.inf) if kept else response


def keeps_to(rate: float, signal: Array, *, sample_time_s: float) -> bool:
    """Whether a recorded signal (k,) moves no faster than an actuator can, but for noise and rounding of its readings.

    A recorded position does, and so does a smooth command. A command jumps by itself; an actuator that is a little
    faster than stated goes on for more than a sample. The noise follows from the second differences.
    """
    steps = np.abs(np.diff(signal, prepend=signal[:1], append=signal[-1:]))
    if not steps.any():
        return True
    noise = float(np.median(np.abs(np.diff(signal, 2)))) / 0.6745 / math.sqrt(6.0) if len(signal) > 2 else 0.0
    reach, slack = rate * sample_time_s, _rounding(steps[steps > 0], float(np.ptp(signal))) + 6.0 * noise
    alone = np.maximum(steps[:-2], steps[2:]) < steps[1:-1] / 2
    most = np.where(alone, FOLLOWED, FASTER) * reach + slack
    return bool((steps[1:-1] <= most).all())


def _rounding(steps: Array, extent: float) -> float:
    """The step of readings of which all changes (n,) are multiples; zero where they are not."""
    step = float(steps.min())
    multiples = steps / step
    return min(step, COARSEST * extent) if np.allclose(multiples, np.round(multiples), atol=0.05) else 0.0


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
        (k, substeps, m, ...); where no response has more than a rate (k, 1, m, ...), the commands themselves if they
        keep to it.
    """
    acting, _ = positions(responses, commands, sample_time_s=sample_time_s, standing=standing)
    if all(response.follows for response in responses):
        return acting[:, None]
    count = substeps if isinstance(substeps, int) else len(substeps)
    return deliver_through(_maps(responses, sample_time_s, substeps), acting, count, standing=standing)


def _maps(responses: Sequence[Response], sample_time_s: float, substeps: int | Array) -> tuple[SampleMap | None, ...]:
    return tuple(
        None if response.follows else sample_map(response, sample_time_s=sample_time_s, substeps=substeps)
        for response in responses
    )


def deliver_through(
    maps: Sequence[SampleMap | None], commands: Array, substeps: int, *, standing: Array | None = None
) -> Array:
    """(k, substeps, m, ...) inputs delivered by each signal's map over a sample, None where it follows at once.

    Commands are those that actuators with slew rates can follow, as of `positions`.
    """
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
    means, ends = positions(responses, commands, sample_time_s=sample_time_s, standing=standing)
    result = np.concatenate([first[None], ends])
    for column, response in enumerate(responses):
        if not response.follows:
            through = sample_map(response, sample_time_s=sample_time_s)
            result[:, column] = _signals(through, means[:, column], first[column])[0] + through.offset
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
    """Actuators of n ships at the start of a sample: `deliver` for commands that are not known beforehand."""

    maps: tuple[SampleMap | None, ...]  # (m) map of each signal over a sample; None where it follows at once
    substeps: int  # integrator steps per sample
    values: Array  # (m, n) delivered values, less the misalignment
    # for each signal (lateness + 1, n) positions outside the dead band that do not act yet, oldest first
    past: tuple[Array, ...]
    reach: Array  # (m, 1) farthest that each signal moves in a sample
    # commands, positions: (m, n) last command of each signal, and how far it came
    commands: Array
    positions: Array

    @classmethod
    def standing(
        cls, responses: Sequence[Response], commands: Array, *, sample_time_s: float, substeps: int | Array
    ) -> ActuatorState:
        """The state after commands (m, n) held for long."""
        maps = _maps(responses, sample_time_s, substeps)
        values = np.array([_effective(through, row) for through, row in zip(maps, commands, strict=True)])
        counts = [through.lateness + 1 if through else 0 for through in maps]
        past = tuple(np.tile(row, (count, 1)) for row, count in zip(values, counts, strict=True))
        count = substeps if isinstance(substeps, int) else len(substeps)
        reach = sample_time_s * np.array([[response.rate] for response in responses])
        now = np.array(commands, dtype=float)
        return cls(maps=maps, substeps=count, values=values, past=past, reach=reach, commands=now, positions=now)

    def mean(self, commands: Array) -> Array:
        """(substeps, m, n) mean over each integrator step of a sample with these commands (m, n).

        Where no response has more than a rate (1, m, n), the commands themselves if they keep to it.
        """
        acting = self._moved(commands)[0]
        if not any(self.maps):
            return acting[None]
        result = np.repeat(acting[None], self.substeps, axis=0)
        for row, through in enumerate(self.maps):
            if through is not None:
                result[:, row] = through.means @ self._driving(row, acting[row]) + through.offset
        return result

    def after(self, commands: Array) -> ActuatorState:
        """One sample later."""
        acting, last = self._moved(commands)
        values, pasts = np.array(last, dtype=float), list(self.past)
        for row, through in enumerate(self.maps):
            if through is not None:
                driving = self._driving(row, acting[row])
                values[row] = through.end @ driving
                pasts[row] = np.concatenate([self.past[row][1:], _effective(through, acting[row])[None]])
        return replace(self, values=values, past=tuple(pasts), commands=np.array(commands, dtype=float), positions=last)

    def part(self, ships: Array) -> ActuatorState:
        """Those of some of the ships, by index (k,)."""
        return self._changed(lambda rows: rows[:, ships])

    def joined(self, part: ActuatorState, ships: Array) -> ActuatorState:
        """With the state of a part, whose ships have these indices (k,)."""
        return self._changed(lambda rows, some: _replaced(rows, some, ships), part)

    def _changed(self, change: Callable[..., Array], *others: ActuatorState) -> ActuatorState:
        """The state with every array (k, n) of the ships changed, together with those of other states."""
        states = (self, *others)
        return replace(
            self,
            values=change(*(state.values for state in states)),
            past=tuple(change(*rows) for rows in zip(*(state.past for state in states), strict=True)),
            commands=change(*(state.commands for state in states)),
            positions=change(*(state.positions for state in states)),
        )

    def _moved(self, commands: Array) -> tuple[Array, Array]:
        """Mean and last position (m, n) over a sample with these commands."""
        if not np.isfinite(self.reach).any():
            return commands, commands
        return _sample_moved(self.commands, self.positions, commands, self.reach)

    def _driving(self, row: int, command: Array) -> Array:
        """(3, n) initial value of a signal, and the commands that act early and late in the sample."""
        on_their_way = np.concatenate([self.past[row], _effective(self.maps[row], command)[None]])
        return np.concatenate([self.values[row][None], on_their_way[:2]])


def _replaced(rows: Array, some: Array, ships: Array) -> Array:
    """Rows (k, n) with those of some ships."""
    result = rows.copy()
    result[:, ships] = some
    return result


def _effective(through: SampleMap | None, command: Array) -> Array:
    """Commands past the dead band, as floats."""
    return np.asarray(command if through is None else past_deadband(command, through.deadband), dtype=float)
