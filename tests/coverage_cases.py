"""Trials of the 30 m ship by every method of estimation, to count how often intervals hold the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from estimation_case import CURRENT, NOMINAL, QUIET, TRUE, commands, truth
from expdesign.errors import NoAnswer
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.replay import Integration
from expdesign.estimation.values import Estimate
from expdesign.processes import in_order
from expdesign.records import central_difference
from expdesign.reduction import reduced
from expdesign.signals import Batch, Record
from expdesign.simulation import Environment, Variation, simulate_ensemble
from expdesign.simulation.run import SUBSTEPS
from expdesign.vessel import Sensors, Vessel

METHODS = (
    *("ls", "iv", "iv-augmented", "iv-air", "iv-wind", "oe", "oe-air"),
    *("iv-current", "iv-air-current", "oe-air-current"),
)
FROM_POSE = Sensors(position_m=0.02, heading_rad=0.005, wind_mps=0.0316)
AT_ONCE = 20


@dataclass(frozen=True, kw_only=True)
class Case:
    """How trials are made.

    Attributes:
        method: one of `METHODS`; "ls" from exact sensors, where it is right.
        wandering: whether the current wanders for 100 s, or is new at every sample.
        samples: in all.
        batches: of equal length.
        derived: velocities from the pose, of continuous motion; else measured, by Euler's map.
    """

    method: str
    wandering: bool = False
    samples: int = 4000
    batches: int = 1
    derived: bool = False

    @property
    def vessel(self) -> Vessel:
        """With its sensors."""
        sensors = FROM_POSE if self.derived else QUIET.sensors if self.method == "ls" else TRUE.sensors
        return replace(TRUE, sensors=sensors)

    @property
    def weather(self) -> Environment:
        """A mean current only for methods that estimate it, wind only for those that read it."""
        memory_s = 100.0 if self.wandering else 0.0
        calm = Environment(
            current_to=CURRENT if self.method.endswith(("augmented", "wind", "current")) else np.zeros(2),
            current_variation=Variation(std_mps=0.03, correlation_s=memory_s),
        )
        if not {"air", "wind"} & {*self.method.split("-")}:
            return calm
        return replace(calm, wind_to=np.array([4.0, -3.0]), wind_variation=Variation(std_mps=0.5, correlation_s=30.0))


@dataclass(frozen=True, eq=False)
class Tried:
    """Errors (t, p) and stated standard deviations (t, p) of the trials that gave an estimate."""

    names: tuple[str, ...]
    errors: np.ndarray
    std: np.ndarray
    failed: int

    @property
    def held(self) -> np.ndarray:
        """(p,) share of intervals of 95 % that hold the truth."""
        return (np.abs(self.errors) < 1.96 * self.std).mean(axis=0)


def tried(case: Case, trials: int, *, seed: int) -> Tried:
    """Trials, each with its own input, sensor noise and current."""
    found = [item for item in _estimates(case, trials, np.random.default_rng(seed)) if item is not None]
    names = found[0].names
    errors, std = np.array([item.values for item in found]) - truth(names), np.array([item.std for item in found])
    return Tried(names, errors, std, trials - len(found))


def _estimates(case: Case, trials: int, rng: np.random.Generator) -> Iterator[Estimate | None]:
    how = {"integrator": "rk4", "substeps": SUBSTEPS} if case.derived else {}
    for first in range(0, trials, AT_ONCE):
        count = min(AT_ONCE, trials - first)
        inputs = [commands(case.samples // case.batches, rng) for _ in range(count * case.batches)]
        many = simulate_ensemble(
            case.vessel, np.stack(inputs, axis=1), runs=len(inputs), environment=case.weather, rng=rng,
            velocity=(1.7, 0.7, 0.0), **how,
        )  # fmt: skip
        yield from in_order(_estimated, (case, many), ((trial,) for trial in range(count)))


def _estimated(case: Case, many, trial: int) -> Estimate | None:
    batches = [many.batch(trial * case.batches + number) for number in range(case.batches)]
    if case.derived:
        batches = [_from_pose(batch) for batch in batches]
    continuous = Settings(integration=Integration("rk4", SUBSTEPS), quadrature="trapezoid")
    try:
        return estimate(
            reduced(Record(batches=tuple(batches)), case.vessel), NOMINAL, method=case.method,
            settings=continuous if case.derived else Settings(),
        )  # fmt: skip
    except NoAnswer:
        return None


def _from_pose(batch: Batch) -> Batch:
    """The same with velocities that are central differences of the pose."""
    velocity = central_difference(batch.pose, batch.sample_time_s, heading_std_rad=FROM_POSE.heading_rad)
    return replace(batch.cut(slice(1, -1)), velocity=velocity, derived=("u", "v", "r"))
