"""The six estimators on the 3-DOF ship with current and wind: who converges to the truth, and who does not.

Two azimuth thrusters run at a common speed with angles about pi/5, moved by smoothed pulses of varying width; white
noise on every sensor, white variation of current and wind.

The pulses of the source are not given, only that they excite well and that the experiment condition (5.77) is fulfilled
all the time: u and v above the worst current and noise. Its bounds are for noise of finite support; here, for normal
noise, they are the mean current's speed plus three standard deviations. Inputs are drawn so that the ship without noise
keeps it, see `pulses`; nothing else decides about an input. That matters in the severe wind, where a beam wind's force
(0.3) exceeds the mean sway thrust (0.24) and pulses drawn regardless of it let sway change its sign. The relative wind
may change sign, as (5.77) asks only that it be told right, which it is but for the moments of crossing zero.

One input serves all runs of a set, so the mean error shows what noise and disturbances do to an estimator; sets with
inputs of their own show whether a verdict hangs on the input.

Errors of X_u, Y_v and N_r are divided by 1 + parameter, the discrete pole: the published spreads of these three fit
that scale (and not the parameter's own), as they do for least squares, where there is no freedom in the method.

Source: F. Ljungberg, doctoral thesis, Linköping University, 6.1, (5.77), tables 6.1-6.7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.errors import NoAnswer
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.values import Estimate
from expdesign.processes import in_order
from expdesign.progress import Progress, silent
from expdesign.signals import Record
from expdesign.simulation import Ensemble, Environment, Variation, simulate_ensemble
from expdesign.values import Array
from expdesign.vessel import TERMS, Actuator, Limit, Sensors, Vessel, VesselModel, structure_terms
from pulses import Pulses, draw_inputs

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
EQUATIONS = {"X": "surge", "Y": "sway", "N": "yaw"}
CONSISTENT = 1.0  # mean error over standard deviation below which an estimator counts as consistent, as in the source


DISTURBANCE_STD_MPS = 1e-3**0.5  # of current and wind, each component, from sample to sample
CURRENT_TO = (0.2, -0.2)
MARGIN_MPS = float(np.hypot(*CURRENT_TO)) + 3.0 * DISTURBANCE_STD_MPS
"""The bound on u and v in (5.77); that of the noise, three of its standard deviations, is lower."""
START_MPS = (1.7, 0.7, 0.0)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One experiment.

    Attributes:
        name: for tables.
        wind_mps: mean wind to north and to east [m/s].
        samples: per run.
    """

    name: str
    wind_mps: float
    samples: int = 5000

    @property
    def environment(self) -> Environment:
        """Current and wind."""
        return Environment(
            current_to=np.array(CURRENT_TO),
            wind_to=np.full(2, self.wind_mps),
            current_variation=Variation(std_mps=DISTURBANCE_STD_MPS),
            wind_variation=Variation(std_mps=DISTURBANCE_STD_MPS),
        )


MILD = Case(name="mild wind", wind_mps=1.0)
SEVERE = Case(name="severe wind", wind_mps=10.0)
CASES = (MILD, SEVERE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """One estimator in one case.

    Attributes:
        case, estimator: names.
        parameters: names.
        errors: (runs, p) normalised errors.
        std: (runs, p) predicted standard deviations, normalised alike.
        unsettled: runs without an estimate, or whose refinement met an unstable model and so never settled; they are
            left out of the numbers.
    """

    case: str
    estimator: str
    parameters: tuple[str, ...]
    errors: Array
    std: Array
    unsettled: int

    @property
    def settled(self) -> int:
        """Runs with an estimate."""
        return len(self.errors)

    @property
    def mean(self) -> Array:
        """(p,) mean error."""
        return self.errors.mean(axis=0) if self.settled > 1 else np.full(len(self.parameters), np.nan)

    @property
    def spread(self) -> Array:
        """(p,) standard deviation of the error."""
        return self.errors.std(axis=0, ddof=1) if self.settled > 1 else np.full(len(self.parameters), np.nan)

    def consistent(self, equations: str = "XYN") -> bool:
        """Whether zero lies within mean plus/minus one standard deviation (and its chance error) for all parameters.

        An estimator that settles in no more than half of the runs is not consistent.

        Args:
            equations: first letters of the equations to look at; W terms go with the equation of their sign pattern.
        """
        if self.settled <= self.unsettled:
            return False
        chosen = [equation_of(name) in equations for name in self.parameters]
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


def simulate_case(
    case: Case, *, runs: int, rng: np.random.Generator, pulses: Pulses | None = None, margin_mps: float = MARGIN_MPS
) -> Ensemble:
    """One set of measured trials of a case, all with the same input of `draw_inputs`."""
    vessel, environment = ship(), case.environment
    inputs = draw_inputs(
        vessel,
        pulses or Pulses(),
        samples=case.samples,
        environment=environment,
        margin_mps=margin_mps,
        velocity=START_MPS,
        rng=rng,
    )
    return simulate_ensemble(vessel, inputs, runs=runs, environment=environment, rng=rng, velocity=START_MPS)


def run_case(
    case: Case,
    *,
    runs: int,
    rng: np.random.Generator,
    estimators: Sequence[str] = tuple(ESTIMATORS),
    progress: Progress = silent,
    pulses: Pulses | None = None,
    margin_mps: float = MARGIN_MPS,
) -> list[Outcome]:
    """Every estimator on every run of one set, whose input has these pulses and keeps u and v above this margin.

    The wind is white from sample to sample, so only the measured wind itself can be an instrument for it.
    """
    trials = simulate_case(case, runs=runs, rng=rng, pulses=pulses, margin_mps=margin_mps)
    tasks = [(name, run) for name in estimators for run in range(runs)]
    found: dict[str, list[Estimate | None]] = {name: [] for name in estimators}
    for number, ((name, _), item) in enumerate(zip(tasks, in_order(_estimated, (trials,), tasks), strict=True), 1):
        found[name].append(item)
        progress(f"{case.name}, {name}", number / len(tasks))
    return [_outcome(case.name, name, items) for name, items in found.items()]


def _outcome(case: str, estimator: str, items: Sequence[Estimate | None]) -> Outcome:
    """One estimator on every run."""
    found = [item for item in items if item is not None]
    if not found:
        raise NoAnswer(f"{estimator} gives no estimate in any run of {case}")
    names = found[0].names
    truth, scale = reference(names)
    settled = [item for item in found if not any("Refinement stopped" in warning for warning in item.warnings)]
    return Outcome(
        case=case,
        estimator=estimator,
        parameters=names,
        errors=np.array([(item.values - truth) / scale for item in settled]).reshape(-1, len(names)),
        std=np.array([item.std / scale for item in settled]).reshape(-1, len(names)),
        unsettled=len(items) - len(settled),
    )


def _estimated(trials: Ensemble, estimator: str, run: int) -> Estimate | None:
    """The estimate of one run; None where there is none."""
    model, settings = nominal(ship().model), Settings(wind="measured")
    try:
        return estimate(Record(batches=(trials.batch(run),)), model, method=ESTIMATORS[estimator], settings=settings)
    except NoAnswer:
        return None


def reference(names: Sequence[str]) -> tuple[Array, Array]:
    """True values (p,) of what an estimator with these parameters estimates, and what errors are divided by."""
    truth = []
    for name in names:
        air = AIR_SHARE.get(name)
        truth.append(PARAMETERS[name][0] + (PARAMETERS[air][0] if air and air not in names else 0.0))
    scale = [1.0 + value if name in POLES else abs(value) for name, value in zip(names, truth, strict=True)]
    return np.array(truth), np.array(scale)


def equation_of(name: str) -> str:
    """First letter of the parameters of the equation that a parameter belongs to: X, Y or N."""
    return {"W_abs_u_u": "X", "W_abs_v_v": "Y", "W_uv": "N"}.get(name, name[0])


def joined(outcomes: Sequence[Outcome]) -> Outcome:
    """One estimator over several sets: errors of all of them together."""
    first = outcomes[0]
    return Outcome(
        case=first.case,
        estimator=first.estimator,
        parameters=first.parameters,
        errors=np.concatenate([item.errors for item in outcomes]),
        std=np.concatenate([item.std for item in outcomes]),
        unsettled=sum(item.unsettled for item in outcomes),
    )


def consistent_sets(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Equation -> number of sets in which one estimator is consistent in it."""
    return {letter: sum(item.consistent(letter) for item in outcomes) for letter in EQUATIONS}
