"""An estimate together with what the vessel file knew before the data.

Values and covariances of both, independent of each other, are joined by their information; in gain form, for nuisance
parameters too:

    K = C_: (C + P)^-1          x + K (theta_0 - theta)          C_:: - K C_:'

with the estimate theta and covariance C of the parameters, all numbers x and their covariance C_::, columns C_: of the
parameters, and the prior theta_0 with P. Values outside the ranges that the file states move to the most probable ones
theta' within, and all others by x + C_: C^-1 (theta' - theta).

Combinations of parameters that the data do not show at all have no estimate. One parameter of each is then held at its
prior value, and the covariance grows along the combination beyond what the prior knows: with either value the data fit
alike, so that the prior alone decides.

What runs differ by does not act on the gain: a prior by regressions lacks the same terms, and is as sure of its form.
It adds to the covariance of what is joined, as far as that follows the data.

Source: A. Gelb (ed.), Applied Optimal Estimation (1974), 4.2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from expdesign.conventions import plus_minus
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.values import Estimate, into_range
from expdesign.own_units import pseudo_inverse_of
from expdesign.values import Array
from expdesign.vessel import VesselModel

NONE, PARAMETER_STD = "none", "parameter_std"
PRIORS = (NONE, PARAMETER_STD)
CONTRADICTED = 0.01
"""Probability of the distance between prior and estimate below which a warning says that they contradict each other."""
UNSEEN_STDS = 100.0
"""Standard deviations of the prior that stand for no knowledge; the posterior's variance is wrong by one in 10^4."""
APART = 4.0
"""Standard deviations of both from which an estimate is told to differ from what the vessel file states."""
TOLD = 0.05
"""Share in a combination, in standard deviations, from which a note names a parameter."""


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
    """An estimate joined with the normal prior of a model and the ranges of its parameters.

    Parameters without standard deviation count as known.
    """
    places, count = [model.names.index(name) for name in found.names], len(found.names)
    prior = model.parameter_covariance[np.ix_(places, places)]
    apart = model.parameters[places] - found.values
    noise = found.joint_covariance - found.between_runs
    both = noise[:count, :count] + prior
    size = np.sqrt(np.where(np.diag(both) > 0, np.diag(both), 1.0))
    gain = np.linalg.solve(both / np.outer(size, size), noise[:count] / size[:, None]).T / size
    kept = np.eye(len(noise))
    kept[:, :count] -= gain  # what of an error of the data stays
    joint = kept @ found.joint_covariance @ kept.T + gain @ prior @ gain.T  # a sum of squares, whatever is rounded
    distance = float(apart @ np.linalg.solve(found.covariance + prior, apart))
    chance = float(scipy.special.chdtrc(count, distance))
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
    ends = [model.parameter_range.get(name, (-np.inf, np.inf)) for name in found.names]
    inside = into_range(values[:count], joint[:count, :count], ends)
    beyond = [name for name, old, (low, high) in zip(found.names, values, ends, strict=False) if not low <= old <= high]
    if beyond:
        values = values + joint[:, :count] @ pseudo_inverse_of(joint[:count, :count]) @ (inside - values[:count])
        warnings = (*warnings, f"Held at the end of the range that the vessel file states: {', '.join(beyond)}.")
    return replace(
        found,
        values=values[:count],
        covariance=joint[:count, :count],
        nuisance_values=values[count:],
        joint_covariance=joint,
        warnings=warnings,
    )


def apart_from_stated(found: Estimate, model: VesselModel) -> tuple[str, ...]:
    """A sentence on the parameters of an estimate without prior that are not what the vessel file states; else none.

    A channel in another unit, or of a shaft beyond a gear, is absorbed by its parameters without any misfit.
    """
    places = [model.names.index(name) for name in found.names]
    stated, std = model.parameters[places], model.parameter_std[places]
    known = std > 0
    if not known.any():
        return ()
    scores = np.zeros(len(places))
    scores[known] = (np.abs(found.values - stated) / np.hypot(found.std, std))[known]
    worst = int(scores.argmax())
    if scores[worst] < APART:
        return ()
    others = [found.names[place] for place in np.argsort(-scores)[1:] if scores[place] >= APART]
    times = found.values[worst] / stated[worst] if stated[worst] else np.inf
    size = f"{times:.3g} times what the vessel file states" if np.isfinite(times) else "where the vessel file states 0"
    return (
        f"{found.names[worst]} is estimated as {plus_minus(found.values[worst], found.std[worst])}, {size} "
        f"({plus_minus(stated[worst], std[worst])}): {scores[worst]:.1f} standard deviations of both apart"
        + (f", and so are {', '.join(others)} by {APART:g} or more" if others else "")
        + ". A channel in another unit or of another shaft or sense, an effect that the model lacks, or a wrong "
        "statement?",
    )


def held_for(error: NotInformative, model: VesselModel) -> tuple[str, ...]:
    """One parameter of each combination that data do not show: with these held, data show all others.

    None where combinations are of the weather's parameters alone, or data show nothing for another reason.
    """
    unseen = _along(error, model, model.names)
    if not np.isfinite(unseen).all():
        return ()
    _, _, pivots = scipy.linalg.qr(unseen / _scales(model), pivoting=True)
    return tuple(model.names[place] for place in pivots[: len(unseen)])


def released(found: Estimate, error: NotInformative, model: VesselModel) -> Estimate:
    """An estimate with parameters held by `held_for`, as one that knows nothing of what data do not show."""
    held = held_for(error, model)
    names = tuple(name for name in model.names if name in held or name in found.names)
    whole, count = (*names, *found.nuisance_names), len(names)
    places = np.ix_(*[[whole.index(name) for name in (*found.names, *found.nuisance_names)]] * 2)
    joint, between = np.zeros((2, len(whole), len(whole)))
    joint[places], between[places] = found.joint_covariance, found.between_runs
    along = UNSEEN_STDS * _along(error, model, whole)
    joint += along.T @ along
    shares = np.abs(_along(error, model, model.names) / _scales(model)).max(axis=0)
    told = [name for name, share in zip(model.names, shares.tolist(), strict=True) if share > TOLD]
    note = f"The data show nothing of these, or not each by itself; the prior tells the rest: {', '.join(told)}."
    return replace(
        found,
        names=names,
        values=np.array([found.assignments[name] for name in names]),
        covariance=joint[:count, :count],
        held={name: value for name, value in found.held.items() if name not in held},
        joint_covariance=joint,
        between_runs=between,
        warnings=(*found.warnings, note),
    )


def _along(error: NotInformative, model: VesselModel, names: tuple[str, ...]) -> Array:
    """(k, n) combinations that data do not show, of these names; those of the model's have length one by `_scales`."""
    both = [
        np.array([[change.get(name, 0.0) for name in those] for change in error.unseen])
        for those in (model.names, names)
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(both[1] / np.linalg.norm(both[0] / _scales(model), axis=1, keepdims=True))


def _scales(model: VesselModel) -> Array:
    """(p,) how far parameters may be from their values: standard deviations, or sizes where none is known."""
    sizes = np.where(model.parameter_std > 0, model.parameter_std, np.abs(model.parameters))
    return np.where(sizes > 0, sizes, 1.0)
