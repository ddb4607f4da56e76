"""Stretches compiled: simulated side by side, with derivatives by parameters and first states."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from expdesign.estimation.regression import Integers
from expdesign.processes import shared_among
from expdesign.simulation import euler_step, rk4_step
from expdesign.values import Array, frozen_set
from expdesign.vessel import VesselModel

BLOCK_SAMPLES = 256  # of a stretch, simulated at once
SIMULATED_POINTS, BLOCK_POINTS = 1024, 4096  # samples of all stretches, simulated or differentiated at once


# Stretches of data that are to be simulated side by side.

INTEGRATORS = {"euler": euler_step, "rk4": rk4_step}
Called = Callable[..., tuple[Array, ...]]
"""A compiled function of arrays."""
Simulate = Callable[[Array, Array, Array], Array]
"""(parameters (p,), start state (6 or 8,), inputs (k, m)) -> states (k, 6 or 8); calm water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretches:
    """W stretches of data of L samples each, simulated side by side; shorter ones are filled up and not compared."""

    model: VesselModel  # structure; gives the values of parameters not sought
    sought: tuple[int, ...]  # (p,) places of the parameters to find, among the model's
    states: tuple[int, ...]  # (n,) places of the velocities that have an equation, among u, v, r
    # (L, W, c) inputs as of `drive_of` with these times; two columns more, the wind's velocity in the b-frame, where
    # `windy`; two more, cosine and sine of the heading, where `flowing`
    drive: Array
    windy: bool  # whether air velocities are those of that wind
    sample_time_s: float  # of all stretches
    # integrator, substeps: how the model is integrated
    integrator: str
    substeps: int
    parts: int = 1  # of a sample, with inputs of their own
    flowing: bool = False  # whether a steady current to north and east [m/s] is sought too, after the parameters
    times: tuple[str, ...] = ()  # (u,) names of uncertain times of actuators, whose changes [s] are sought too, last
    # (W,) samples of each stretch; L for all when left out
    counts: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        length, count = self.drive.shape[:2]
        if len(self.counts) != count:
            frozen_set(self, "counts", np.full(count, length))

    @property
    def values(self) -> int:
        """Number of values sought: parameters, a current's two, and changes of times."""
        return len(self.sought) + 2 * self.flowing + len(self.times)


@dataclass(frozen=True, kw_only=True, eq=False)
class Slopes:
    """Derivatives of simulated states in consecutive samples of the stretches that last so long."""

    samples: slice  # of the stretches
    active: Integers  # (w,) places of those stretches
    # by_values, by_start: (l, w, n, q) by the values, (l, w, n, n) by the start
    by_values: Array
    by_start: Array
    steps: Array  # (l, w, n, n) of these states by the ones a sample before; none of the first sample


@dataclass(frozen=True, eq=False)
class Compiled:
    """Stretches made ready to be simulated with any values."""

    stretches: Stretches  # the simulated stretches
    block: tuple[int, int, int]  # samples and stretches of one call of `run`, points of one call of `slopes`
    # run, slopes: see `stretch_functions`
    run: Called
    slopes: Called

    def states(self, values: Array, start: Array) -> Array:
        """(L, W, n) velocities from start velocities (W, n) and values (W, p + n): parameters, then accelerations.

        A constant acceleration [unit of the output per second] stands for steady forces outside the model. Where a
        stretch has ended the rows mean nothing.
        """
        drive, counts, (steps, many, _) = self.stretches.drive, self.stretches.counts, self.block
        length, n = len(drive), start.shape[1]
        result = np.repeat(start[None], length, axis=0)
        for first in range(0, length - 1, steps):
            rows = np.minimum(np.arange(first, first + steps), length - 2)
            end = min(first + steps, length - 1)
            active = np.flatnonzero(counts - 1 > first)
            for begin in range(0, len(active), many):
                part = active[begin : begin + many]
                whole = np.resize(part, many)
                held = drive[rows[:, None], whole].transpose(1, 0, 2).reshape(steps * many, -1)
                (rows_after,) = self.run(result[first, whole], held, np.repeat(values[whole], steps, axis=0))
                after = rows_after.reshape(many, steps, n)[: len(part), : end - first]
                result[first + 1 : end + 1, part] = after.transpose(1, 0, 2)
        return result

    def sensitivities(self, values: Array, states: Array) -> tuple[Array, Array]:
        """Derivatives of simulated states (L, W, n): by the values (L, W, n, p + n), by the start (L, W, n, n)."""
        (length, count, n), q = states.shape, values.shape[1]
        by_values, by_start = np.zeros((length, count, n, q)), np.zeros((length, count, n, n))
        for part in self.slope_blocks(values, states):
            by_values[part.samples, part.active] = part.by_values
            by_start[part.samples, part.active] = part.by_start
        return by_values, by_start

    def slope_blocks(self, values: Array, states: Array) -> Iterator[Slopes]:
        """The derivatives block by block of samples, without what lies behind the ends of stretches."""
        (length, count, n), counts = states.shape, self.stretches.counts
        carried = np.zeros((count, n, values.shape[1])), np.tile(np.eye(n), (count, 1, 1))
        yield Slopes(
            samples=slice(0, 1),
            active=np.arange(count),
            by_values=carried[0][None],
            by_start=carried[1][None],
            steps=np.zeros((1, count, n, n)),
        )
        first = 1
        while first < length:
            active = np.flatnonzero(counts > first)
            samples = slice(first, min(first + max(1, self.block[2] // len(active)), length))
            before = slice(first - 1, samples.stop - 1)
            A, B = self._steps(values[active], states[before, active], self.stretches.drive[before, active])
            by_values, by_start = B, A.copy()  # both become sums in place
            was = carried[0][active], carried[1][active]
            for index in range(len(A)):
                by_values[index] += A[index] @ was[0]
                by_start[index] = A[index] @ was[1]
                was = by_values[index], by_start[index]
            carried[0][active], carried[1][active] = was
            yield Slopes(samples=samples, active=active, by_values=by_values, by_start=by_start, steps=A)
            first = samples.stop

    def _steps(self, values: Array, states: Array, drive: Array) -> tuple[Array, Array]:
        """Derivatives of each next state: (l, w, n, n) by the state, (l, w, n, q) by the values."""
        (length, count, n), points = states.shape, self.block[2]
        held = np.broadcast_to(values, (length, *values.shape)).reshape(length * count, -1)
        flat = states.reshape(-1, n), drive.reshape(length * count, -1), held
        found = []
        for begin in range(0, length * count, points):
            part = [np.resize(rows[begin : begin + points], (points, rows.shape[1])) for rows in flat]
            found.append([each.transpose(0, 2, 1) for each in self.slopes(*part)])
        A, B = (
            np.concatenate(parts)[: length * count].reshape(length, count, n, -1) for parts in zip(*found, strict=True)
        )
        return A, B


def compiled(stretches: Stretches) -> Compiled:
    """Everything that does not depend on the values, done once."""
    from expdesign.estimation.replay._casadi import stretch_functions  # CasADi takes a second to load

    length, count = stretches.drive.shape[:2]
    steps = min(max(1, length - 1), BLOCK_SAMPLES)
    side_by_side = min(count, -(-SIMULATED_POINTS // steps))
    block = (steps, side_by_side, min(max(1, length - 1) * count, BLOCK_POINTS))
    return Compiled(stretches, block, *stretch_functions(stretches, *block, threads=shared_among()))
