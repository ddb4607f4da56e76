"""Made-up trials of the example ships as CSV files, for the tests of `expdesign estimate`."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Trajectory
from expdesign.simulation import CALM, Environment, measure, positions, simulate
from expdesign.vessel import Sensors, Vessel
from record_files import write_trial
from scenario_files import SCENARIOS

VESSELS = SCENARIOS / "vessels"
MODEL_SHIP, TUG = VESSELS / "model-ship.toml", VESSELS / "azimuth-30m.toml"
MODEL_SHIP_TRUE = load_vessel(VESSELS / "model-ship-true.toml")
TUG_TRUE = load_vessel(VESSELS / "azimuth-30m-true.toml")
EULER = {"integrator": "euler", "substeps": 1}  # the map that the parameters of the example ships are defined by


def quiet(vessel: Vessel) -> Vessel:
    """The same with perfect sensors."""
    return replace(vessel, sensors=Sensors())


def model_ship_commands(samples: int = 4000, *, seed: int = 0, astern: bool = False) -> Commands:
    """Forces that hold the ship in motion ahead, with steps in all three directions."""
    rng = np.random.default_rng(seed)
    values = np.stack([held(rng, samples) for _ in range(3)], axis=1) * (2500, 5000, 1500) + (7000, 0, 0)
    values[:, 0] *= -1 if astern else 1
    return Commands(sample_time_s=0.125, names=MODEL_SHIP_TRUE.model.inputs, values=values)


def prompt(vessel: Vessel) -> Vessel:
    """The vessel with actuators that jump from command to command."""
    actuators = tuple(replace(one, responses=()) for one in vessel.model.actuators)
    return replace(vessel, model=replace(vessel.model, actuators=actuators))


def tug_commands(samples: int = 3000, *, seed: int = 0) -> Commands:
    """Both thrusters about 10 rps and 36 degrees, so that velocities and relative wind vary; they keep to the rates."""
    rng = np.random.default_rng(seed)
    speed, one, two = (held(rng, samples) for _ in range(3))
    orders = np.stack([10 + 3 * speed, 0.63 + 0.4 * one, 10 + 3 * speed, 0.63 + 0.4 * two], axis=1)
    values, _ = positions(TUG_TRUE.responses, orders, sample_time_s=1.0, standing=None)
    return Commands(sample_time_s=1.0, names=TUG_TRUE.model.inputs, values=values)


def held(rng: np.random.Generator, samples: int) -> np.ndarray:
    """(samples,) levels between -1 and 1, each held for 10 to 60 samples."""
    return np.repeat(rng.uniform(-1, 1, samples), rng.integers(10, 60, samples))[:samples]


def write_run(
    path: Path,
    vessel: Vessel,
    commands: Commands,
    *,
    velocity: tuple[float, float, float] = (1.0, 0.0, 0.0),
    environment: Environment = CALM,
    seed: int = 0,
    drop: tuple[str, ...] = (),
    **how: object,
) -> Path:
    """Simulate, measure and write; columns in `drop` are left out."""
    motion = simulate(vessel, commands, velocity=velocity, environment=environment, **how)
    rng = np.random.default_rng(seed)
    columns = measure(vessel, commands, motion, environment=environment, rng=rng)
    return write_trial(path, {name: values for name, values in columns.items() if name not in drop})


def as_batch(vessel: Vessel, commands: Commands, motion: Trajectory, *, turn_rad: float = 0.0) -> Batch:
    """What perfect instruments record, in a frame turned by an angle."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    pose = motion.pose[:-1] @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + (300.0, -80.0, turn_rad)
    return Batch(
        name="recorded",
        sample_time_s=motion.sample_time_s,
        input_names=vessel.model.inputs,
        inputs=commands.values,
        velocity=motion.velocity[:-1],
        pose=pose,
    )
