"""An estimate together with what the vessel file knew before the data.

Values and covariances of both, independent of each other, are joined by their information; in gain form, for nuisance
parameters too:

    K = C_: (C + P)^-1          x + K (theta_0 - theta)          C_:: - K C_:'

with the estimate theta and covariance C of the parameters, all numbers x and their covariance C_::, columns C_: of the
parameters, and the prior theta_0 with P.

Source: A. Gelb (ed.), Applied Optimal Estimation (1974), 4.2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from expdesign.errors import InputError
from expdesign.estimation.values import Estimate
from expdesign.vessel import VesselModel

NONE, PARAMETER_STD = "none", "parameter_std"
PRIORS = (NONE, PARAMETER_STD)
CONTRADICTED = 0.01
"""Probability of the distance between prior and estimate below which a warning says that they contradict each other."""


def check_prior(model: VesselModel, name: str) -> None:
    """Raise where a vessel file knows nothing before.

    Raises:
        InputError: it states no standard deviations.
    """
    if not model.parameter_std.any():
        raise InputError(
            f"vessel {name!r} states no [model.parameter_std], so it has no prior to join with: leave --prior out, or "
            "state how well each parameter is known"
        )


def with_prior(found: Estimate, model: VesselModel) -> Estimate:
    """An estimate joined with the normal prior of a model; parameters without standard deviation count as known."""
    places, count = [model.names.index(name) for name in found.names], len(found.names)
    prior = model.parameter_covariance[np.ix_(places, places)]
    apart = model.parameters[places] - found.values
    gain = np.linalg.solve(found.covariance + prior, found.joint_covariance[:count]).T
    joint = found.joint_covariance - gain @ found.joint_covariance[:count]
    joint = (joint + joint.T) / 2
    distance = float(apart @ np.linalg.solve(found.covariance + prior, apart))
    chance = float(scipy.stats.chi2.sf(distance, count))
    warnings = found.warnings
    if chance < CONTRADICTED:
        scores = np.abs(apart) / np.sqrt(np.diag(found.covariance + prior))
        worst = int(scores.argmax())
        warnings = (
            *warnings,
            f"The data contradict the prior of the vessel file (chance {chance:.1g}), most in {found.names[worst]}: "
            f"{scores[worst]:.1f} standard deviations. Estimates without --prior do not depend on it.",
        )
    values = np.concatenate([found.values, found.nuisance_values]) + gain @ apart
    return replace(
        found,
        values=values[:count],
        covariance=joint[:count, :count],
        nuisance_values=values[count:],
        joint_covariance=joint,
        warnings=warnings,
    )
