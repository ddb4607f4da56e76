"""Speed and memory of many simulated trials at once, against loops over samples, plain and compiled.

``python tests/benchmarks/ensemble.py``: 500 runs of 5000 samples of the 18-parameter model, current, wind and sensors
noisy. The plain loop does the same arithmetic for one run, sample by sample, through the same regressors; its time is
scaled to as many samples. The compiled loop is written out by hand for this model and does all runs; it needs numba
(``pip install numba``) and is left out without it.
"""

from __future__ import annotations

import resource
import time
from pathlib import Path

import numpy as np

from expdesign.scenario import load_vessel
from expdesign.simulation import Environment, Variation, euler_step, motion_rates, relative_velocity, simulate_ensemble
from expdesign.simulation.sensors import noise_std
from expdesign.vessel import NUMPY, SCALAR, generalised_force

try:
    from numba import njit
except ImportError:
    njit = None

VESSEL = Path(__file__).parents[2] / "scenarios" / "vessels" / "azimuth-30m-true.toml"
RUNS, SAMPLES, LOOP_SAMPLES, ROUNDS = 500, 5000, 20_000, 5
GUST = Variation(std_mps=0.03)
ENVIRONMENT = Environment(
    current_to=np.array([0.2, -0.2]), wind_to=np.array([1.0, 1.0]), current_variation=GUST, wind_variation=GUST
)


def commands(samples: int) -> np.ndarray:
    """Both propellers at 10 rps, angles slowly swinging."""
    time_s = np.arange(samples)
    angle = 0.6 + 0.3 * np.sin(time_s / 40.0)
    return np.stack([0 * time_s + 10.0, angle, 0 * time_s + 10.0, -angle], axis=1)


def plain_loop_s(vessel, rng: np.random.Generator) -> float:
    """Seconds for `LOOP_SAMPLES` of one run, noise included, sample by sample."""
    rows = commands(LOOP_SAMPLES).tolist()
    noise = noise_std(vessel.sensors).tolist()
    state = (0.0,) * 6
    began = time.perf_counter()
    for held in rows:
        current = [rng.normal(mean, GUST.std_mps) for mean in (0.2, -0.2)]
        wind = [rng.normal(1.0, GUST.std_mps) for _ in range(2)]
        _, air = relative_velocity(state, current, wind, SCALAR)
        [value + rng.normal(0.0, std) for value, std in zip((*state, *air), noise, strict=True)]

        def rates(x, held=held, current=current, wind=wind):
            return motion_rates(vessel.model, x, held, current_to=current, wind_to=wind, ops=SCALAR)

        state = euler_step(rates, state, vessel.sample_time_s)
    return time.perf_counter() - began


def scalar_loop(force, theta, noise, sea, gust, rng, states, seen):
    """The same by hand: one run after the other, one number at a time. Fills (runs, samples, 6) and (..., 8)."""
    for run in range(states.shape[0]):
        x = y = psi = u = v = r = 0.0
        for k in range(states.shape[1]):
            n_c, e_c = sea[0] + gust * rng.standard_normal(), sea[1] + gust * rng.standard_normal()
            n_w, e_w = sea[2] + gust * rng.standard_normal(), sea[3] + gust * rng.standard_normal()
            c, s = np.cos(psi), np.sin(psi)
            u_r, v_r = u - (n_c * c + e_c * s), v - (e_c * c - n_c * s)
            u_q, v_q = u - (n_w * c + e_w * s), v - (e_w * c - n_w * s)
            now = (x, y, psi, u, v, r, u_q, v_q)
            for i in range(6):
                states[run, k, i] = now[i]
            for i in range(8):
                seen[run, k, i] = now[i] + noise[i] * rng.standard_normal()
            tx, ty, tp = force[k, 0], force[k, 1], force[k, 2]
            m_v = abs(v_r)
            du = theta[0] * u_r + theta[1] * v_r * r + theta[2] * abs(u_r) * u_r + theta[3] * abs(u_q) * u_q
            du += theta[4] * tx + theta[5] * u_r * tx
            dv = theta[6] * v_r + theta[7] * u_r * r + theta[8] * m_v * v_r + theta[9] * m_v * r
            dv += theta[10] * abs(v_q) * v_q + theta[11] * ty
            dr = theta[12] * r + theta[13] * u_r * v_r + theta[14] * m_v * v_r + theta[15] * m_v * r
            dr += theta[16] * u_q * v_q + theta[17] * tp
            x, y, psi = x + u * c - v * s, y + u * s + v * c, psi + r
            u, v, r = u + du, v + dv, r + dr


def compiled_loop_s(vessel, rng: np.random.Generator) -> float:
    """Seconds for all runs, compilation not counted."""
    signals = dict(zip(vessel.model.inputs, commands(SAMPLES).T, strict=True))
    force = np.stack(np.broadcast_arrays(*generalised_force(vessel.actuators, signals, NUMPY)), axis=1)
    loop = njit(scalar_loop)
    sea = np.concatenate([ENVIRONMENT.current_to, ENVIRONMENT.wind_to])
    rest = (vessel.model.parameters.copy(), noise_std(vessel.sensors), sea, GUST.std_mps, rng)
    loop(force, *rest, np.empty((1, 2, 6)), np.empty((1, 2, 8)))
    return best_s(lambda: loop(force, *rest, np.empty((RUNS, SAMPLES, 6)), np.empty((RUNS, SAMPLES, 8))))


def best_s(work) -> float:
    """Shortest of a few rounds."""
    times = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


if __name__ == "__main__":
    ship, chance = load_vessel(VESSEL), np.random.default_rng(0)
    inputs, work = commands(SAMPLES), RUNS * SAMPLES
    how = {"runs": RUNS, "environment": ENVIRONMENT, "rng": chance}
    many_s = best_s(lambda: simulate_ensemble(ship, inputs, **how))
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    plain = min(plain_loop_s(ship, chance) for _ in range(ROUNDS)) / LOOP_SAMPLES * work
    seconds = {"plain loop": plain}
    if njit is None:
        print("numba is not installed: nothing is compared with compiled code")
    else:
        seconds["compiled loop"] = compiled_loop_s(ship, chance)
    for name, time_s in (seconds | {"all at once": many_s}).items():
        print(f"{name:14} {time_s / work * 1e9:8.0f} ns a sample and run")
    ratios = ", ".join(f"{other / many_s:.2f} times as fast as the {name}" for name, other in seconds.items())
    print(f"{RUNS} runs at once: {ratios}")
    print(f"peak memory {peak_mib:.0f} MiB")
