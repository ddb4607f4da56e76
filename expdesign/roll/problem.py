"""What an estimate of roll seeks, from what, and its weighted residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from expdesign.errors import InputError, NotInformative
from expdesign.roll.instruments import Weighted
from expdesign.roll.model import PARAMETERS, discrete, parameters
from expdesign.roll.runs import Case
from expdesign.values import Array, seal
from expdesign.vessel.roll import G_MPS2, NOMINAL, Body, first_moment

FARTHEST = 10.0  # typical sizes from zero, beyond which no parameter is sought


@dataclass(frozen=True, kw_only=True, eq=False)
class RollProblem:
    """What is sought, from what."""

    body: Body  # what is known of the ship
    cases: tuple[Case, ...]  # prepared, of one sample time
    free: tuple[str, ...]  # names of the parameters that are estimated; others keep their start values
    start: Array  # (9,) where the search begins
    scale: Array  # (9,) a typical size of each parameter, positive

    def __post_init__(self) -> None:
        seal(self, start="9", scale="9")
        if not self.cases:
            raise InputError("no load case is given, expected one or more")
        if len({run.step_s for case in self.cases for run in case.runs}) > 1:
            raise InputError("the load cases differ in sample time, expected one for all")
        if not self.free or not set(self.free) <= set(PARAMETERS):
            raise InputError(f"free is {self.free}, expected some of {', '.join(PARAMETERS)}")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest parameters (9,): many times their typical size; an inertia is positive."""
        low, high = -FARTHEST * self.scale, FARTHEST * self.scale
        place = PARAMETERS.index("A_x")
        low[place] = self.scale[place] / FARTHEST**2
        low[PARAMETERS.index("m")] = 0.0
        return np.minimum(low, self.start), np.maximum(high, self.start)

    @property
    def step_s(self) -> float:
        """Time between samples [s]."""
        return self.cases[0].runs[0].step_s

    @property
    def places(self) -> list[int]:
        """Places of the free parameters among all."""
        return [PARAMETERS.index(name) for name in self.free]


def build_problem(
    body: Body,
    cases: tuple[Case, ...],
    *,
    beam_m: float,
    roll_hz: float,
    known: Mapping[str, float],
    start: Mapping[str, float],
) -> RollProblem:
    """A problem that begins with what a ship of this beam and roll frequency usually has.

    Args:
        body, cases: what is known.
        beam_m: of the ship, whose radius of gyration is taken as 0.35 of it.
        roll_hz: frequency of roll, roughly.
        known: parameters that are not estimated.
        start: of some that are.

    Raises:
        InputError: known leaves nothing to estimate.
    """
    inertia = body.mass_kg * (0.35 * beam_m) ** 2
    turn, moment = 2.0 * np.pi * roll_hz, first_moment(body, NOMINAL)
    righting = (inertia + body.mass_kg * body.z_g**2) * turn**2
    stated = [case.load for case in cases if case.load is not None and case.load.mass_kg > 0]
    mass = max((load.mass_kg for load in stated), default=0.02 * body.mass_kg)
    place = min((load.z_m for load in stated), default=body.z_g - 0.5 * beam_m)
    k, size = righting - G_MPS2 * moment, 0.3 * beam_m
    scale = parameters(
        k=max(righting, abs(k)), A_x=inertia, d=0.2 * righting / turn, K_r=2.0 * righting / turn,
        K_vd=0.15 * body.mass_kg * beam_m, K_delta=0.1 * righting, z_f=0.1 * beam_m, m=mass, z_m=max(size, abs(place)),
    )  # fmt: skip
    begin = parameters(k=k, A_x=inertia, d=0.2 * righting / turn, m=mass, z_m=place)
    for name, value in {**start, **known}.items():
        begin[PARAMETERS.index(name)] = value
    sought = PARAMETERS if any(case.load is None for case in cases) else PARAMETERS[:-2]
    free = tuple(name for name in sought if name not in known)
    return RollProblem(body=body, cases=cases, free=free, start=begin, scale=np.maximum(scale, 0.1 * np.abs(begin)))


def sampled(problem: RollProblem, theta: Array) -> list[Array]:
    """Sampled coefficients (5,) of each case."""
    return [discrete(theta, problem.body, case.load, problem.step_s).values for case in problem.cases]


def noise_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> list[list[Array]]:
    """Residuals (n,) of each run of each case."""
    by = zip(weighted, sampled(problem, theta), strict=True)
    return [[rows.residuals(values) for rows in part.rows] for part, values in by]


def residuals_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(q,) weighted residuals."""
    return _joined(problem, weighted, theta)[0]


def slopes_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(q, 9) derivatives of the residuals, less the part that goes with them by chance.

    With the residuals they give the gradient of the sum of squares, in which the covariance of the moments follows the
    parameters. Regressors have the noise of the equation in them, and fixed weights favour parameters that hide it.

    Source: L. P. Hansen, J. Heaton and A. Yaron, J. Business and Economic Statistics 14 (1996), 262-280.
    """
    return _joined(problem, weighted, theta)[1]


def _joined(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> tuple[Array, Array]:
    found = moments_of(problem, weighted, theta)
    return np.concatenate([one.residuals for one in found]), np.concatenate([one.slopes for one in found])


@dataclass(frozen=True, eq=False)
class Moments:
    """Products of the instruments with the residuals of one case, in their standard deviations at the parameters."""

    residuals: Array  # (q,)
    slopes: Array  # (q, 9) as of `slopes_of`
    inverse: Array  # (q, q) lower, by which the products were multiplied


def moments_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> list[Moments]:
    """Those of each case."""
    found = []
    for part, case in zip(weighted, problem.cases, strict=True):
        one = discrete(theta, problem.body, case.load, problem.step_s)
        left, slopes, inverse = part.top - part.slope @ one.values, -part.slope @ one.jacobian, np.eye(len(part.top))
        if part.spread is not None:
            across = _across(part.spread, one.values)
            whole = across[0] - np.tensordot(one.values, across[1:], 1)
            inverse = scipy.linalg.lapack.dtrtri(np.linalg.cholesky(whole), lower=1)[0]
            left = inverse @ left
            slopes = inverse @ (slopes + (across[1:] @ (inverse.T @ left)).T @ one.jacobian)
        found.append(Moments(left, slopes, inverse))
    return found


def _across(spread: Array, values: Array) -> Array:
    """(6, q, q) covariances of the products with y and X with those with the residuals at coefficients (5,)."""
    by = np.concatenate([[1.0], -values])
    return np.asarray((by @ spread.reshape(6, -1)).reshape(spread.shape[1:]).swapaxes(1, 2))


def noise_of_slopes(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(9, 9) expected sum of products of the slopes where instruments tell nothing."""
    found = np.zeros((len(theta),) * 2)
    for part, case, own in zip(weighted, problem.cases, moments_of(problem, weighted, theta), strict=True):
        if part.spread is None:
            continue
        one = discrete(theta, problem.body, case.load, problem.step_s)
        with_left = own.inverse @ _across(part.spread, one.values)[1:] @ own.inverse.T  # (5, q, q)
        alone = np.einsum("kl,ijlm,km->ij", own.inverse, part.spread[1:, 1:], own.inverse, optimize=True)
        found += one.jacobian.T @ (alone - np.einsum("ikl,jkl->ij", with_left, with_left)) @ one.jacobian
    return found


def solved(
    problem: RollProblem,
    weighted: Sequence[Weighted],
    theta: Array,
    held: Sequence[str],
    *,
    beside: Array | None = None,
    within: float = 1e-12,
) -> tuple[Array, Array, Array]:
    """Parameters (9,), derivatives (q, p) of the weighted residuals by the free ones, and these residuals (q,).

    Args:
        problem, weighted: as the estimate has them.
        theta: (9,) where the search begins.
        held: names of free parameters that stay there.
        beside: (q, e) orthonormal directions of the residuals that do not count; None for none.
        within: share of the sum of squares within which the search ends.

    Raises:
        NotInformative: there are fewer equations than parameters.
    """
    places = [PARAMETERS.index(name) for name in problem.free if name not in held]
    equations = sum(len(part.top) for part in weighted)
    if equations < len(places):
        raise NotInformative(
            f"the data give {equations} equations for {len(places)} roll parameters, expected a rudder that moves the "
            "ship, and more load cases or fewer parameters"
        )

    def full(values: Array) -> Array:
        result = np.array(theta)
        result[places] = values
        return result

    @lru_cache(maxsize=1)  # the search asks for residuals and then, there, for derivatives
    def at(values: bytes) -> tuple[Array, Array]:
        left, slopes = _joined(problem, weighted, full(np.frombuffer(values)))
        if beside is not None:
            left, slopes = (rows - beside @ (beside.T @ rows) for rows in (left, slopes))
        return left, slopes

    low, high = problem.bounds
    found = scipy.optimize.least_squares(
        lambda values: at(values.tobytes())[0], np.clip(theta, low, high)[places],
        lambda values: at(values.tobytes())[1][:, places], bounds=(low[places], high[places]),
        x_scale=problem.scale[places], xtol=within, ftol=within, gtol=within,
    )  # fmt: skip
    return full(found.x), at(found.x.tobytes())[1][:, problem.places], np.asarray(found.fun)


def surprise_of(left: Array, fitted: int) -> float:
    """Sum of squares of residuals (q,) over its expected value; nan where nothing is left over."""
    return float(left @ left) / (len(left) - fitted) if len(left) > fitted else float("nan")
