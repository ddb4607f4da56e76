"""Time series: commands to the actuators, motion, and measured data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import InputError, UnknownName
from expdesign.values import Array, seal, sealed


@dataclass(frozen=True, kw_only=True, eq=False)
class Commands:
    """Actuator commands, each held from its sample to the next (zero-order hold)."""

    sample_time_s: float  # time between samples [s]
    names: tuple[str, ...]  # actuator signals, e.g. ("n1", "a1", "n2", "a2") or ("tau_x", "tau_y", "tau_psi").
    values: Array  # (k, m) in SI units: rps, rad, or the model's own force unit

    def __post_init__(self) -> None:
        seal(self, values="k m")
        if self.values.shape[1] != len(self.names):
            raise InputError(f"Commands has {self.values.shape[1]} columns for the names {self.names}")

    def __len__(self) -> int:
        return len(self.values)

    @property
    def duration_s(self) -> float:
        """Time for which the commands last [s]."""
        return len(self) * self.sample_time_s

    def column(self, name: str) -> Array:
        """One signal (k,)."""
        if name not in self.names:
            raise UnknownName("actuator signal", name, known=self.names)
        return self.values[:, self.names.index(name)]


AUXILIARY = (
    "roll_rad", "roll_rate_radps", "sway_acceleration_mps2", "lateral_acceleration_mps2", "actuator_x_n",
    "actuator_y_n", "actuator_psi_nm", "imu_lateral_mps2",
)  # fmt: skip
"""Measured beside what every model needs: roll, positive to starboard, its rate, dv/dt, the acceleration to starboard
of the origin without gravity, dv/dt + u r, the force and moment of all actuators on the hull, and the reading of an
accelerometer along the starboard axis, with gravity in it."""


@sealed(pose="k 3", velocity="k 3", auxiliary="k 8")
class Trajectory:
    """Motion sampled at the ends of every command: one sample more than there are commands."""

    sample_time_s: float  # time between samples [s]
    pose: Array  # (k, 3) n-frame [north m, east m, heading rad]; heading is continuous, not wrapped
    velocity: Array  # (k, 3) b-frame [u m/s, v m/s, r rad/s], over ground
    # (k, 8) of `AUXILIARY`, nan in columns that the simulation does not give; None where it gives none
    auxiliary: Array | None = None

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def time_s(self) -> Array:
        """(k,) from zero [s]."""
        return np.asarray(np.arange(len(self)) * self.sample_time_s, dtype=float)

    @property
    def distance_m(self) -> float:
        """Distance sailed over ground [m]."""
        return float(np.sum(np.hypot(*np.diff(self.pose[:, :2], axis=0).T)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Delivered:
    """What actuators deliver within samples."""

    values: Array  # (k, s, m) means of the inputs over each part of a sample
    shares: Array  # (s,) of the sample that the parts take
    # names of dead times and lags of the actuators that are not known exactly, as in `vessel.std_keys`
    times: tuple[str, ...] = ()
    # (k, s, m, u) derivatives of the values by them [1/s]
    values_by_time: Array = field(default_factory=lambda: np.zeros((0, 0, 0, 0)))
    shares_by_time: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (s, u) those of the shares [1/s]

    def __post_init__(self) -> None:
        if not self.times:
            seal(self, values="k s m", shares="s", values_by_time="a b c d", shares_by_time="e f")
            return
        seal(self, values="k s m", shares="s", values_by_time="k s m u", shares_by_time="s u")

    @property
    def mean(self) -> Array:
        """(k, m) over each sample."""
        return np.asarray(np.einsum("ksm,s->km", self.values, self.shares))

    def cut(self, part: slice) -> Delivered:
        """Consecutive samples."""
        slopes = self.values_by_time[part] if self.times else self.values_by_time
        return replace(self, values=self.values[part], values_by_time=slopes)

    def moved(self, name: str, change_s: float) -> Delivered:
        """The delivered inputs at another value of an uncertain time, to first order."""
        place = self.times.index(name)
        return replace(
            self,
            values=self.values + change_s * self.values_by_time[..., place],
            shares=self.shares + change_s * self.shares_by_time[:, place],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """One uninterrupted stretch of measured data; a difference or a lag never reaches into another batch."""

    name: str  # for reports, e.g. "trial.csv, batch 2".
    sample_time_s: float  # time between samples [s]
    input_names: tuple[str, ...]  # actuator signals, e.g. ("n1", "a1"), or ("tau_x", "tau_y", "tau_psi").
    inputs: Array  # (k, m) commands, held from their sample to the next
    # (k, 3) b-frame u, v, r over ground, measured or derived from pose; a column that is neither is nan, where the
    # reader was asked to allow that
    velocity: Array
    # (k, 3) n-frame, heading continuous, or None when not measured; nan where a part is not measured
    pose: Array | None = None
    # (k, 2) relative wind in the b-frame, the air's velocity past the ship as (u_q, v_q) = velocity - wind, or None
    # when not measured
    wind: Array | None = None
    depth_m: Array | None = None  # (k,) water depth, or None
    derived: tuple[str, ...] = ()  # those of u, v, r that are known to be derived from pose, not measured
    smoothed: bool = False  # whether those are smoothed, so that they hold motion of many samples before and after
    first_row: int = 0  # row of the first sample in its file (the header is row 1), 0 when not from a file
    # (k, 3) 1 where a velocity lies between the readings of its sensor, 0 where it is one; None where all are readings
    interpolated: Array | None = None
    # standard deviation of the noise on the angle of the vane that gave the wind, where the wind is divided by the
    # shrinkage that it causes; else 0
    vane_std_rad: float = 0.0
    # within samples, where actuators deliver other than held inputs; then `inputs` are the means over the sample. None
    # where inputs are held.
    delivered: Delivered | None = None
    # (k,) 1 where the inputs follow the ship's motion, 0 where they were set beforehand; None where the data do not say
    steered: Array | None = None
    # (k, p) what the first p inputs were planned to be, whatever the ship did; None where unknown
    planned: Array | None = None
    # names of inputs that are positions which actuators reached, as measured, not commands: means over each sample of
    # the readings at its ends
    reached: tuple[str, ...] = ()
    auxiliary: Array | None = None  # (k, 8) of `AUXILIARY`, as measured, nan where a column is not; None where none is

    def __post_init__(self) -> None:
        seal(
            self, inputs="k m", velocity="k 3", pose="k 3", wind="k 2", depth_m="k", interpolated="k 3", steered="k",
            planned="k p", auxiliary="k 8",
        )  # fmt: skip
        if self.inputs.shape[1] != len(self.input_names):
            raise InputError(f"Batch has {self.inputs.shape[1]} input columns for the names {self.input_names}")

    def __len__(self) -> int:
        return len(self.velocity)

    @property
    def time_s(self) -> Array:
        """(k,) from zero [s]."""
        return np.asarray(np.arange(len(self)) * self.sample_time_s, dtype=float)

    def measures(self, name: str) -> bool:
        """Whether one of `AUXILIARY` is measured."""
        return self.auxiliary is not None and bool(np.isfinite(self.auxiliary[:, AUXILIARY.index(name)]).any())

    def cut(self, part: slice) -> Batch:
        """Consecutive samples of the batch."""
        series = (
            "inputs", "velocity", "pose", "wind", "depth_m", "interpolated", "steered", "planned", "auxiliary",
        )  # fmt: skip
        rows: dict[str, Any] = {name: values[part] for name in series if (values := getattr(self, name)) is not None}
        if self.delivered is not None:
            rows["delivered"] = self.delivered.cut(part)
        return replace(self, first_row=self.first_row and self.first_row + part.start, **rows)


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Measured data, ready for estimation."""

    batches: tuple[Batch, ...]  # with the same inputs and the same sample time
    notes: tuple[str, ...] = ()  # on flaws of the files and their treatment, one sentence each
    doubts: tuple[str, ...] = ()  # those of the notes that put results into question, whatever is done with the data
    idle: tuple[str, ...] = ()  # those of the notes that concern estimates alone: inputs that never move
    faults: tuple[str, ...] = ()  # those of the doubts that stand in the data as they are used
    # effect of `vessel.quantities` -> least and greatest value of it that instruments show of each other
    shown: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def last_seen(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(k,) place of the last sample seen, up to each one; before the first, that of the first."""
    return np.asarray(np.maximum.accumulate(np.where(seen, np.arange(len(seen)), seen.argmax())))


def fit_percent(measured: Array, simulated: Array) -> Array:
    """100 (1 - ||y - yhat|| / ||y - mean y||) per column of (k, n); nan for a constant y, negative for bad models.

    Samples that are not measured (nan) do not count.
    """
    seen = np.isfinite(measured)
    error = np.where(seen, measured - simulated, 0.0)
    count = np.maximum(seen.sum(axis=0), 1)
    spread = np.where(seen, measured - np.where(seen, measured, 0.0).sum(axis=0) / count, 0.0)
    size, reference = np.sqrt((error**2).sum(axis=0)), np.sqrt((spread**2).sum(axis=0))
    constant = reference <= 1e-12 * np.sqrt(np.where(seen, measured**2, 0.0).sum(axis=0))
    return np.asarray(np.where(constant, np.nan, 100.0 * (1.0 - size / np.where(constant, 1.0, reference))))
