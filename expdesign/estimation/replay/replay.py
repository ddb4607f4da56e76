"""Simulate a batch with a model: the same inputs, from the batch's first measured state, without disturbances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import Diverged, InputError, UnknownName
from expdesign.estimation.regression import drive_of, model_for, parts_of
from expdesign.estimation.replay.compiled import INTEGRATORS, Simulate
from expdesign.signals import Batch, Record, Trajectory
from expdesign.simulation.motion import begun
from expdesign.simulation.program import STATES
from expdesign.simulation.run import LARGEST_SPEED
from expdesign.values import Array
from expdesign.vessel import VesselModel


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
