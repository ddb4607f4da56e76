"""The six estimators on the 3-DOF ship with current and wind: who converges to the truth, and who does not.

Two azimuth thrusters run at a common speed with angles about pi/5, moved by smoothed pulses of varying width; white
noise on every sensor, white variation of current and wind. One input serves all runs of a case, so the mean error shows
what the noise and the disturbances do to an estimator, not what the draw of the input does.

Errors of X_u, Y_v and N_r are divided by 1 + parameter, the discrete pole: the published spreads of these three fit
that scale (and not the parameter's own), as they do for least squares, where there is no freedom in the method.

The pulses of the source are not given. In the severe wind the beam wind's force (0.3) exceeds the sway thrust (0.24),
so with a full turn of headings sway changes its sign and the experiment condition (5.77b) fails for any pulses; the
sway equation then keeps a bias with every estimator. The case "severe wind, strong thrust" keeps the condition.

Source: F. Ljungberg, doctoral thesis, Linköping University, 6.1, tables 6.1-6.7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.errors import NoAnswer
from expdesign.estimation.methods import Settings, estimate
from expdesign.signals import Record
from expdesign.simulation import Ensemble, Environment, Variation, simulate_ensemble
from expdesign.values import Array
from expdesign.vessel import TERMS, Actuator, Limit, Sensors, Vessel, VesselModel, structure_terms

PARAMETERS: dict[str, tuple[float, float]] = {
    "X_u": (-0.05, -0.2),
    "X_vr": (1.0, 0.8),
    "X_abs_u_u": (-0.05, 0.0),
    "W_abs_u_u": (-0.0005, 0.0),
    "X_mu": (0.02, 0.01),
    "X_kappa": (-0.0025, 0.0),
    "Y_v": (-0.2, -0.3),
    "Y_ur": (-0.65, -0.8),
    "Y_abs_v_v": (-0.2, 0.0),
    "Y_abs_v_r": (-0.1, 0.0),
    "W_abs_v_v": (-0.0015, 0.0),
    "Y_mu": (0.02, 0.01),
    "N_r": (-0.1, -0.15),
    "N_uv": (-0.0015, 0.0),
    "N_abs_v_v": (-0.001, 0.0),
    "N_abs_v_r": (-0.04, 0.0),
    "W_uv": (-0.00003, 0.0),
    "N_mu": (0.0003, 0.00015),
}
"""Table 6.1: true and nominal values."""
POLES = ("X_u", "Y_v", "N_r")
AIR_SHARE = {"X_abs_u_u": "W_abs_u_u", "Y_abs_v_v": "W_abs_v_v", "N_uv": "W_uv"}
ESTIMATORS = {
    "LS1": "ls",
    "LS2": "ls-augmented",
    "LS3": "ls-wind",
    "IV1": "iv",
    "IV2": "iv-augmented",
    "IV3": "iv-wind",
}
CONSISTENT = 1.0
"""Mean error over standard deviation below which an estimator counts as consistent, as in the source."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One experiment.

    Attributes:
        name: for tables.
        wind_mps: mean wind to north and to east [m/s].
        speed_rps, angle_rad: what the pulses move about.
        samples: per run.
    """

    name: str
    wind_mps: float
    speed_rps: float = 10.0
    angle_rad: float = np.pi / 5
    samples: int = 5000


MILD = Case(name="mild wind", wind_mps=1.0)
SEVERE = Case(name="severe wind", wind_mps=10.0)
STRONG = Case(name="severe wind, strong thrust", wind_mps=10.0, speed_rps=30.0, angle_rad=1.0)
CASES = (MILD, SEVERE, STRONG)


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """One estimator in one case.

    Attributes:
        case, estimator: names.
        parameters: names.
        errors: (runs, p) normalised errors.
        std: (runs, p) predicted standard deviations, normalised alike.
        failed: runs without an estimate.
    """

    case: str
    estimator: str
    parameters: tuple[str, ...]
    errors: Array
    std: Array
    failed: int

    @property
    def mean(self) -> Array:
        """(p,) mean error."""
        return np.asarray(self.errors.mean(axis=0))

    @property
    def spread(self) -> Array:
        """(p,) standard deviation of the error."""
        return np.asarray(self.errors.std(axis=0, ddof=1))

    def consistent(self, equations: str = "XYN") -> bool:
        """Whether zero lies within mean plus/minus one standard deviation (and its chance error) for all parameters.

        Args:
            equations: first letters of the equations to look at; W terms go with the equation of their sign pattern.
        """
        letter = {"W_abs_u_u": "X", "W_abs_v_v": "Y", "W_uv": "N"}
        chosen = [letter.get(name, name[0]) in equations for name in self.parameters]
        allowed = CONSISTENT + 2.0 / np.sqrt(len(self.errors))
        return bool((np.abs(self.mean) <= allowed * self.spread)[chosen].all())


def ship() -> Vessel:
    """The true ship with the sensors of (6.2)."""
    azimuth = tuple(
        Actuator(kind="azimuth", number=i + 1, forward_m=x, limits=(Limit(), Limit()))
        for i, x in enumerate((9.0, -9.0))
    )
    model = VesselModel(
        terms=structure_terms("manoeuvring-18"),
        parameters=np.array([PARAMETERS[name][0] for name in TERMS]),
        parameter_std=np.zeros(len(TERMS)),
        form="discrete",
        sample_time_s=1.0,
        actuators=azimuth,
    )
    sensors = Sensors(heading_rad=1e-4**0.5, velocity_mps=2e-4**0.5, yaw_rate_radps=2e-4**0.5, wind_mps=1e-3**0.5)
    return Vessel(
        name="30 m ship", length_m=30.0, beam_m=9.0, draught_m=2.5, sample_time_s=1.0, model=model, sensors=sensors
    )


def nominal(model: VesselModel) -> VesselModel:
    """The crude model that the first instruments come from."""
    return model.with_parameters({name: values[1] for name, values in PARAMETERS.items()})


def draw_inputs(case: Case, rng: np.random.Generator) -> Array:
    """(k, 4) n1, a1, n2, a2: common speed, independent angles, smoothed pulses of 5 to 50 samples."""

    def pulses(size: float) -> Array:
        levels = np.repeat(rng.uniform(-1.0, 1.0, case.samples), rng.integers(5, 50, case.samples))[: case.samples]
        window = np.hanning(9)[1:-1]
        return np.asarray(size * np.convolve(levels, window / window.sum(), mode="same"))

    speed = case.speed_rps * (1.0 + pulses(0.7))
    return np.stack([speed, case.angle_rad + pulses(0.35), speed, case.angle_rad + pulses(0.35)], axis=1)


def simulate_case(case: Case, *, runs: int, rng: np.random.Generator) -> Ensemble:
    """Measured trials of one case, all with the same input."""
    weather = Environment(
        current_to=np.array([0.2, -0.2]),
        wind_to=np.full(2, case.wind_mps),
        current_variation=Variation(std_mps=1e-3**0.5),
        wind_variation=Variation(std_mps=1e-3**0.5),
    )
    inputs = draw_inputs(case, rng)
    return simulate_ensemble(ship(), inputs, runs=runs, environment=weather, rng=rng, velocity=(1.7, 0.7, 0.0))


def run_case(
    case: Case, *, runs: int, rng: np.random.Generator, estimators: Sequence[str] = tuple(ESTIMATORS)
) -> list[Outcome]:
    """Every estimator on every run of a case."""
    trials = simulate_case(case, runs=runs, rng=rng)
    return [estimate_all(case.name, trials, name) for name in estimators]


def estimate_all(case: str, trials: Ensemble, estimator: str, settings: Settings | None = None) -> Outcome:
    """One estimator on every run; runs that give no estimate are counted.

    The wind is white from sample to sample, so only the measured wind itself can be an instrument for it.
    """
    model, choices = nominal(ship().model), settings or Settings(wind="measured")
    found, failed = [], 0
    for run in range(trials.runs):
        try:
            record = Record(batches=(trials.batch(run),))
            found.append(estimate(record, model, method=ESTIMATORS[estimator], settings=choices))
        except NoAnswer:
            failed += 1
    names = found[0].names
    truth, scale = reference(names)
    return Outcome(
        case=case,
        estimator=estimator,
        parameters=names,
        errors=np.array([(item.values - truth) / scale for item in found]),
        std=np.array([item.std / scale for item in found]),
        failed=failed,
    )


def reference(names: Sequence[str]) -> tuple[Array, Array]:
    """True values (p,) of what an estimator with these parameters estimates, and what errors are divided by."""
    truth = []
    for name in names:
        air = AIR_SHARE.get(name)
        truth.append(PARAMETERS[name][0] + (PARAMETERS[air][0] if air and air not in names else 0.0))
    scale = [1.0 + value if name in POLES else abs(value) for name, value in zip(names, truth, strict=True)]
    return np.array(truth), np.array(scale)
