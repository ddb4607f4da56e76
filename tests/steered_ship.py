"""A ship in surge alone, whose engine follows a plan, or the plan and the measured speed, in a current that wanders."""

from collections.abc import Sequence

import numpy as np

from expdesign.signals import Batch, Record
from expdesign.vessel import Actuator, Limit, Term, VesselModel

TRUTH = {"X_u": -0.1, "X_mu": 0.02}
NAMES = ("tau_x", "tau_y", "tau_psi")
NOISE_MPS = 0.01
GAIN = 20.0  # force for a metre per second too slow: the speed returns in two samples or three


def surge_model() -> VesselModel:
    """The true parameters."""
    terms = (Term("u", "X_u", "u"), Term("u", "X_mu", "tau_x"))
    return VesselModel(
        terms=terms,
        parameters=np.array(list(TRUTH.values())),
        parameter_std=np.zeros(2),
        form="discrete",
        sample_time_s=1.0,
        actuators=(Actuator(kind="force", number=1, limits=(Limit(), Limit(), Limit())),),
    )


def planned_forces(rng: np.random.Generator, samples: int) -> np.ndarray:
    """(k,) levels held for 10 to 60 samples."""
    return 10.0 + 6.0 * np.repeat(rng.uniform(-1, 1, samples), rng.integers(10, 60, samples))[:samples]


def next_speed(u: float, through_water: float, force: float) -> float:
    """A sample later."""
    return u + TRUTH["X_u"] * through_water + TRUTH["X_mu"] * force


def sailed(
    seed: int,
    samples: int,
    *,
    steered: Sequence[bool] | np.ndarray,
    current_std_mps: float = 0.3,
    correlation_s: float = 100.0,
    planned_known: bool = True,
) -> Record:
    """One batch, marked; where `steered` (k,) the force is the planned one plus an answer to the speed's deviation."""
    rng = np.random.default_rng(seed)
    planned, noise = planned_forces(rng, samples), NOISE_MPS * rng.standard_normal(samples)
    kept = np.exp(-1.0 / correlation_s) if correlation_s else 0.0
    current, u, wished = current_std_mps * rng.standard_normal(), 2.0, 2.0
    speed, force = np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        speed[k] = u + noise[k]
        force[k] = planned[k] + (GAIN * (wished - speed[k]) if steered[k] else 0.0)
        u, wished = next_speed(u, u - current, force[k]), next_speed(wished, wished, planned[k])
        current = kept * current + current_std_mps * np.sqrt(1 - kept**2) * rng.standard_normal()
    batch = Batch(
        name="trial.csv",
        sample_time_s=1.0,
        input_names=NAMES,
        inputs=np.stack([force, np.zeros(samples), np.zeros(samples)], axis=1),
        velocity=np.stack([speed, np.full(samples, np.nan), np.full(samples, np.nan)], axis=1),
        steered=np.array(steered, dtype=float),
        planned=np.stack([planned, np.zeros(samples), np.zeros(samples)], axis=1) if planned_known else None,
    )
    return Record(batches=(batch,))


def legs_and_runs(samples: int, *, each: int = 200) -> np.ndarray:
    """(k,) steered in two stretches of three."""
    return (np.arange(samples) // each) % 3 != 2
