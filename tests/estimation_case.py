"""The 30 m ship, its crude nominal model, and measured trials of it, for the estimation tests."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.simulation import Environment, simulate_ensemble
from expdesign.vessel import Sensors, Vessel

ROOT = Path(__file__).parent.parent
TRUE = load_vessel(ROOT / "scenarios/vessels/azimuth-30m-true.toml")
NOMINAL = load_vessel(ROOT / "scenarios/vessels/azimuth-30m.toml").model
QUIET = replace(TRUE, sensors=Sensors())
CURRENT = np.array([0.2, -0.2])


def commands(samples: int, rng: np.random.Generator, *, angle: float = np.pi / 5, spread: float = 0.3) -> np.ndarray:
    """(k, 4) both thrusters about 10 rps at an angle, moved by smoothed pulses of varying width."""

    def pulses(size: float) -> np.ndarray:
        widths = rng.integers(10, 60, samples)
        levels = np.repeat(rng.uniform(-1, 1, samples), widths)[:samples]
        return size * np.convolve(levels, np.hanning(11)[1:-1] / np.hanning(11).sum(), mode="same")

    speed = 10 + pulses(3)
    return np.stack([speed, angle + pulses(spread), speed, angle + pulses(spread)], axis=1)


def measured(
    vessel: Vessel,
    inputs: np.ndarray,
    *,
    weather: Environment | None = None,
    seed: int = 0,
    velocity=(1.7, 0.7, 0.0),
    **kwargs,
) -> Batch:
    """One trial, by Euler's map unless told otherwise."""
    rng = np.random.default_rng(seed)
    ensemble = simulate_ensemble(
        vessel, inputs, runs=1, environment=weather or Environment(), rng=rng, velocity=velocity, **kwargs
    )
    return ensemble.batch(0)


def record(*batches: Batch) -> Record:
    return Record(batches=batches)
