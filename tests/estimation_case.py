"""The 30 m ship, its crude nominal model, and measured trials of it, for the estimation tests."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.dictionary import build_dictionary
from expdesign.errors import NoAnswer
from expdesign.estimation.methods import estimate
from expdesign.estimation.values import Estimate
from expdesign.processes import in_order
from expdesign.rehearsal.validation import Rehearsal, Validated, validate
from expdesign.scenario import load_vessel
from expdesign.scenario.dictionaries import load_dictionary
from expdesign.signals import Batch, Record
from expdesign.simulation import Ensemble, Environment, Variation, simulate_ensemble
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


CALM_CURRENT = Environment(current_variation=Variation(std_mps=0.03))
STEADY_CURRENT = Environment(current_to=CURRENT, current_variation=Variation(std_mps=0.03))
WANDERING_CURRENT = Environment(current_to=CURRENT, current_variation=Variation(std_mps=0.03, correlation_s=100.0))
MERGED = {"X_abs_u_u": "W_abs_u_u", "Y_abs_v_v": "W_abs_v_v", "N_uv": "W_uv"}


def truth(names: tuple[str, ...]) -> np.ndarray:
    """(p,) what an estimator with these parameters estimates; without wind, air and water terms fall together."""
    values = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
    return np.array(
        [values[name] + (values[MERGED[name]] if MERGED.get(name, name) not in names else 0.0) for name in names]
    )


def errors_and_std(
    trials: int, samples: int, method: str, weather: Environment, *, seed: int
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, int]:
    """Names, errors (t, p) and predicted standard deviations (t, p) of trials, each with its own input and noise.

    The last number counts trials whose refinement stopped or that gave no estimate; they are left out.
    """
    rng = np.random.default_rng(seed)
    errors, std, failed = [], [], 0
    for found in estimated_trials(trials, samples, method, weather, rng):
        if found is None:
            failed += 1
            continue
        names = found.names
        failed += (stopped := any("Refinement stopped" in warning for warning in found.warnings))
        if not stopped:
            errors.append(found.values - truth(found.names))
            std.append(found.std)
    return names, np.array(errors), np.array(std), failed


def estimated_trials(
    trials: int, samples: int, method: str, weather: Environment, rng: np.random.Generator
) -> Iterator[Estimate | None]:
    """Estimates of measured trials, simulated fifty at a time, and None for trials that give none."""
    for first in range(0, trials, 50):
        runs = min(50, trials - first)
        inputs = np.stack([commands(samples, rng) for _ in range(runs)], axis=1)
        many = simulate_ensemble(TRUE, inputs, runs=runs, environment=weather, rng=rng, velocity=(1.7, 0.7, 0.0))
        yield from in_order(_estimated, (method, many), ((run,) for run in range(runs)))


def _estimated(method: str, trials: Ensemble, run: int) -> Estimate | None:
    try:
        return estimate(Record(batches=(trials.batch(run),)), NOMINAL, method=method)
    except NoAnswer:
        return None


SHORT_RUNS = (2, 1, 0, 0, 0, 4, 0, 2, 0, 0, 3)
"""Optimal whole runs of the model ship's dictionary in 450 s: twelve batches of 300 samples."""


def many_short_batches(trials: int, *, seed: int = 0) -> Validated:
    """Trials of the model ship, `iv`, by Euler's map with quiet sensors and a white current."""
    model_ship = load_vessel(ROOT / "scenarios/vessels/model-ship.toml")
    true = load_vessel(ROOT / "scenarios/vessels/model-ship-true.toml")
    rehearsal = Rehearsal(
        truth=replace(true, sensors=Sensors(velocity_mps=0.03, yaw_rate_radps=0.03)),
        nominal=model_ship,
        primitives=build_dictionary(model_ship, load_dictionary(ROOT / "scenarios/dictionaries/model-ship.toml")),
        designs={"optimised": SHORT_RUNS},
        total_s=450.0,
        environment=Environment(current_variation=Variation(std_mps=0.02)),
        parameters=true.model.names,
        integrator="euler",
        trials=trials,
        seed=seed,
    )
    (result,) = validate(rehearsal)
    return result
