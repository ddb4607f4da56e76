"""Prior knowledge: as models sampled for robust designs, and as information to which the trial adds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import InputError, NoAnswer
from expdesign.information.moments import PrimitiveInformation, estimated_parameters
from expdesign.information.scoring import score_models
from expdesign.simulation import CALM, Environment
from expdesign.values import Array
from expdesign.vessel import Vessel, VesselModel

REDRAWS = 5  # ratio of drawn to desired models above which the prior is refused as unstable


def equation_noise(vessel: Vessel, parameters: Sequence[str]) -> Array:
    """(p,) standard deviation of the one-step residual of each parameter's equation, zero where a sensor is ideal.

    The residual is the difference of two samples, each with the sensor's noise; it is counted in the units in which
    regressors stand in X, so that X over its square is information per sample about the parameters.

    Successive residuals share a sample, so their noise is coloured, and noise also enters the regressors. Both are
    neglected on purpose: the covariance with them, `expected.expected_covariance`, is not a function of a sum of
    matrices over primitives, so it has no certificate. Criteria A, E and V use this number only to weigh equations
    against each other; a common factor cancels. With a stated prior its absolute size matters, and data with slowly
    varying regressors, in which the shared samples partly cancel, are then underrated.
    """
    sensors, model = vessel.sensors, vessel.model
    spread = {"u": sensors.velocity_mps, "v": sensors.velocity_mps, "r": sensors.yaw_rate_radps}
    ratio = vessel.sample_time_s / model.time_scale_s
    equation = {term.name: term.equation for term in model.terms}
    return np.array([np.sqrt(2.0) * spread[equation[name]] / ratio for name in parameters])


def stated_information(covariance: Array, noise: Array, *, dimension: int, samples: float) -> Array:
    """(d, d) information of a prior covariance (p, p), per sample of the total time.

    Parameters with a standard deviation of zero or infinity get none; known parameters should be fixed instead.

    Args:
        covariance: (p, p) of the parameters.
        noise: (p,) as from `equation_noise`.
        dimension: d, p or p plus the number of means, which have no prior.
        samples: in the total time.

    Raises:
        InputError: a parameter with a prior whose equation's noise is not stated.
    """
    std = np.sqrt(np.diag(covariance))
    stated = (std > 0) & np.isfinite(std)
    if not (noise[stated] > 0).all():
        raise InputError("a prior from standard deviations needs the sensors' noise of every equation")
    prior = np.zeros((dimension, dimension))
    index = np.flatnonzero(stated)
    correlation = covariance[np.ix_(index, index)] / np.outer(std[index], std[index])
    size = noise[index] / std[index]
    prior[np.ix_(index, index)] = np.outer(size, size) * np.linalg.pinv(correlation, hermitian=True) / samples
    return prior


def drawn_parameters(model: VesselModel, parameters: Sequence[str], count: int, rng: np.random.Generator) -> Array:
    """(count, all) parameter vectors, normal around the nominal ones where a standard deviation is stated.

    Raises:
        InputError: no parameter has a standard deviation.
    """
    std = np.array([s if n in parameters else 0.0 for n, s in zip(model.names, model.parameter_std, strict=True)])
    if not std.any():
        raise InputError("robust durations need model.parameter_std of the parameters, found none")
    return replace(model, parameter_std=std).drawn_parameters(count, rng)


def score_prior(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    *,
    samples: int,
    rng: np.random.Generator,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
) -> tuple[tuple[tuple[PrimitiveInformation, ...], ...], int]:
    """The dictionary scored with models drawn from the prior, under the commands of the nominal model.

    Returns:
        Information by model, and the number of unstable models drawn.

    Raises:
        InputError: no standard deviations are stated.
        NoAnswer: too many models are unstable.
    """
    names = estimated_parameters(vessel.model, fixed_parameters)
    stable: list[tuple[PrimitiveInformation, ...]] = []
    unstable = 0
    while len(stable) < samples:
        missing = samples - len(stable)
        scored = score_models(
            vessel,
            primitives,
            drawn_parameters(vessel.model, names, missing, rng),
            environment=environment,
            fixed_parameters=fixed_parameters,
            mean_subtraction=mean_subtraction,
            unstable="mark",
        )
        stable += [items for items, is_stable in scored if is_stable]
        unstable += sum(not is_stable for _, is_stable in scored)
        if unstable > REDRAWS * samples:
            raise NoAnswer(
                f"design.robust: {unstable} of {unstable + len(stable)} models drawn from the prior are unstable; "
                "state smaller model.parameter_std"
            )
    return tuple(stable), unstable
