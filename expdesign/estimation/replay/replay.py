"""Simulate batches with a model: the same inputs, from the first measured state; with derivatives where compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import Diverged, InputError, UnknownName
from expdesign.estimation.regression import Integers, drive_of, model_for, parts_of
from expdesign.processes import shared_among
from expdesign.signals import Batch, Record, Trajectory
from expdesign.simulation import euler_step, rk4_step
from expdesign.simulation.motion import begun
from expdesign.simulation.program import STATES
from expdesign.simulation.run import LARGEST_SPEED
from expdesign.values import Array, frozen_set
from expdesign.vessel import VesselModel

BLOCK_SAMPLES = 256  # of a stretch, simulated at once
SIMULATED_POINTS, BLOCK_POINTS = 1024, 4096  # samples of all stretches, simulated or differentiated at once
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


@dataclass(frozen=True)
class Integration:
    """How a model is simulated between samples."""

    integrator: str = "euler"  # "euler", the map of the discrete parameters, or "rk4"
    substeps: int = 1  # integrator steps per sample

    def __post_init__(self) -> None:
        if self.integrator not in INTEGRATORS:
            raise UnknownName("integrator", self.integrator, known=INTEGRATORS)
        if self.substeps < 1:
            raise InputError(f"substeps is {self.substeps}, expected 1 or more")


@dataclass(frozen=True, eq=False)
class Replay:
    """A model made ready to simulate the batches of a record, with any parameters."""

    model: VesselModel  # driven by the recorded inputs
    # (samples, sample time, parts of a sample) of a batch -> compiled simulation
    simulators: Mapping[tuple[int, float, int], Simulate]
    substeps: int  # integrator steps per sample
    # windy, flowing: whether simulations are given wind, and a current
    windy: bool = False
    flowing: bool = False

    def states(
        self, batch: Batch, parameters: Array, wind_to: Array | None = None, current_to: Array | None = None
    ) -> Array:
        """(k, 6) pose and velocity from the batch's first state; outputs without an equation stay zero.

        Args:
            batch: gives inputs and start.
            parameters: all (all,) of the model.
            wind_to: (k, 2) wind to north and east [m/s], where the replay is windy.
            current_to: (2,) current to north and east [m/s], where it is flowing.

        Raises:
            Diverged: a speed passed what ships reach, or stopped being a number.
            InputError: the first velocity, or an input, is not measured.
        """
        start = np.array(begun(self.model, tuple(start_state(self.model, batch))))
        inputs = drive_of(self.model, batch, substeps=self.substeps)
        parts = parts_of(batch, substeps=self.substeps)
        simulator = self.simulators[len(batch), batch.sample_time_s, parts]
        if self.windy:
            inputs = np.concatenate([inputs, np.zeros((len(batch), 2)) if wind_to is None else wind_to], axis=1)
        if self.flowing:
            steady = np.zeros(2) if current_to is None else current_to
            inputs = np.concatenate([inputs, np.tile(steady, (len(batch), 1))], axis=1)
        if not np.isfinite(inputs).all():
            raise InputError(f"{batch.name} has inputs that are not numbers, which cannot be simulated")
        states = simulator(parameters, start, inputs)
        wild = ~(np.abs(states[:, 3:]).max(axis=1) < LARGEST_SPEED)
        if wild.any():
            time_s = int(np.argmax(wild)) * batch.sample_time_s
            raise Diverged(f"{batch.name}: the model's simulation diverges after {time_s:.1f} s")
        return np.asarray(states[:, :STATES])


def build_replay(
    model: VesselModel,
    record: Record,
    integration: Integration | None = None,
    *,
    windy: bool = False,
    flowing: bool = False,
) -> Replay:
    """Compile the simulation of every length of batch in a record, for a model from `tables.model_for`."""
    from expdesign.estimation.replay._casadi import batch_simulator  # CasADi takes a second to load

    how = integration or Integration()
    kinds = {(len(batch), batch.sample_time_s, parts_of(batch, substeps=how.substeps)) for batch in record.batches}
    return Replay(
        model,
        {
            (samples, time_s, parts): batch_simulator(
                model,
                samples=samples,
                sample_time_s=time_s,
                integrator=how.integrator,
                substeps=how.substeps,
                parts=parts,
                windy=windy,
                flowing=flowing,
            )
            for samples, time_s, parts in kinds
        },
        how.substeps,
        windy,
        flowing,
    )


def simulate_batch(
    model: VesselModel, batch: Batch, *, integration: Integration | None = None, wind_to: Array | None = None
) -> Trajectory:
    """Motion of a model under a batch's inputs, from the batch's first measured state.

    Args:
        model: with its parameters, e.g. `Estimate.model`.
        batch: gives inputs and start; its pose may be missing, then the run starts at the origin heading north.
        integration: Euler's map when left out.
        wind_to: (k, 2) wind to north and east [m/s], still air when left out.

    Raises:
        Diverged: the model is unstable.
        InputError: the batch lacks inputs or its first velocity.
    """
    record = Record(batches=(batch,))
    driven = model_for(model, record)
    replay = build_replay(driven, record, integration, windy=wind_to is not None)
    states = replay.states(batch, driven.parameters, wind_to)
    return Trajectory(sample_time_s=batch.sample_time_s, pose=states[:, :3], velocity=states[:, 3:])


def start_state(model: VesselModel, batch: Batch) -> Array:
    """(6,) first measured pose (zero where missing) and velocity (zero where the model has no equation)."""
    pose = np.zeros(3) if batch.pose is None else np.nan_to_num(batch.pose[0], nan=0.0)
    velocity = np.where([name in model.outputs for name in OUTPUTS], batch.velocity[0], 0.0)
    if not np.isfinite(velocity).all():
        raise InputError(f"{batch.name}: the first velocity is not measured, so no simulation can start there")
    return np.concatenate([pose, velocity])
