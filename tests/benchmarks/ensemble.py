"""Speed and memory of many simulated trials at once, against a plain loop over samples in Python.

``python tests/benchmarks/ensemble.py``: 500 runs of 5000 samples of the 18-parameter model, current, wind and sensors
noisy. The plain loop does the same arithmetic for one run, sample by sample, through the same regressors; its time is
scaled to as many samples.
"""

from __future__ import annotations

import resource
import time
from pathlib import Path

import numpy as np

from expdesign.scenario import load_vessel
from expdesign.simulation import Environment, Variation, euler_step, motion_rates, relative_velocity
from expdesign.simulation.ensemble import simulate_ensemble
from expdesign.vessel import SCALAR

VESSEL = Path(__file__).parents[2] / "scenarios" / "vessels" / "azimuth-30m-true.toml"
RUNS, SAMPLES, LOOP_SAMPLES = 500, 5000, 20_000
WEATHER = Environment(
    current_to=np.array([0.2, -0.2]),
    wind_to=np.array([1.0, 1.0]),
    current_variation=Variation(std_mps=0.03),
    wind_variation=Variation(std_mps=0.03),
)


def commands(samples: int) -> np.ndarray:
    """Both propellers at 10 rps, angles slowly swinging."""
    time_s = np.arange(samples)
    angle = 0.6 + 0.3 * np.sin(time_s / 40.0)
    return np.stack([0 * time_s + 10.0, angle, 0 * time_s + 10.0, -angle], axis=1)


def plain_loop_s(vessel, rng: np.random.Generator) -> float:
    """Seconds for `LOOP_SAMPLES` of one run, noise included, sample by sample."""
    rows = commands(LOOP_SAMPLES).tolist()
    noise = [vessel.sensors.velocity_mps] * 8
    state = (0.0,) * 6
    began = time.perf_counter()
    for held in rows:
        current = [rng.normal(mean, 0.03) for mean in (0.2, -0.2)]
        wind = [rng.normal(1.0, 0.03) for _ in range(2)]
        _, air = relative_velocity(state, current, wind, SCALAR)
        [value + rng.normal(0.0, std) for value, std in zip((*state, *air), noise, strict=True)]

        def rates(x, held=held, current=current, wind=wind):
            return motion_rates(vessel.model, x, held, current_to=current, wind_to=wind, ops=SCALAR)

        state = euler_step(rates, state, vessel.sample_time_s)
    return time.perf_counter() - began


if __name__ == "__main__":
    ship, chance = load_vessel(VESSEL), np.random.default_rng(0)
    loop = min(plain_loop_s(ship, chance) for _ in range(3)) / LOOP_SAMPLES
    began = time.perf_counter()
    result = simulate_ensemble(ship, commands(SAMPLES), runs=RUNS, environment=WEATHER, rng=chance)
    many = (time.perf_counter() - began) / (RUNS * SAMPLES)
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"plain loop {loop * 1e6:.1f} us a sample, {RUNS} runs at once {many * 1e9:.0f} ns a sample and run")
    print(f"ratio {loop / many:.0f}, peak memory {peak_mib:.0f} MiB, {len(result.pose)} samples x {result.runs} runs")
