"""What an estimate of roll seeks, from what, and its weighted residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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
    return np.concatenate([one.residuals for one in moments_of(problem, weighted, theta)])


def slopes_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(q, 9) derivatives of the residuals, less the part that goes with them by chance.

    With the residuals they give the gradient of the sum of squares, in which the covariance of the moments follows the
    parameters. Regressors have the noise of the equation in them, and fixed weights favour parameters that hide it.

    Source: L. P. Hansen, J. Heaton and A. Yaron, J. Business and Economic Statistics 14 (1996), 262-280.
    """
    return np.concatenate([one.slopes for one in moments_of(problem, weighted, theta)])


@dataclass(frozen=True, eq=False)
class Moments:
    """Products of the instruments with the residuals of one case, in their standard deviations at the parameters."""

    residuals: Array  # (q,)
    slopes: Array  # (q, 9) as of `slopes_of`
    root: Array  # (q, q) lower, by which the products were divided
    slopes_noise: Array  # (9, 9) expected sum of products of the slopes where instruments tell nothing


def moments_of(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> list[Moments]:
    """Those of each case."""
    found = []
    for part, case in zip(weighted, problem.cases, strict=True):
        one = discrete(theta, problem.body, case.load, problem.step_s)
        left, slopes = part.top - part.slope @ one.values, -part.slope @ one.jacobian
        if part.spread is None:
            found.append(Moments(left, slopes, np.eye(len(left)), np.zeros((len(theta),) * 2)))
            continue
        by = np.concatenate([[1.0], -one.values])
        across = np.einsum("ijkl,j->ikl", part.spread, by)  # covariance of each column's products with the residuals
        root = np.linalg.cholesky(np.einsum("ikl,i->kl", across, by)) if part.follows else np.eye(len(left))
        left, slopes = (scipy.linalg.solve_triangular(root, both, lower=True) for both in (left, slopes))
        inverse = np.linalg.inv(root)
        with_left = inverse @ across[1:] @ inverse.T  # (5, q, q)
        if part.follows:
            slopes = slopes + np.einsum("ikl,l->ki", with_left, left) @ one.jacobian
        alone = np.einsum("kl,ijlm,km->ij", inverse, part.spread[1:, 1:], inverse, optimize=True)
        alone -= np.einsum("ikl,jkl->ij", with_left, with_left)
        found.append(Moments(left, slopes, root, one.jacobian.T @ alone @ one.jacobian))
    return found


def solved(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, held: Sequence[str], *, within: float = 1e-12
) -> tuple[Array, Array, Array]:
    """Parameters (9,), derivatives (q, p) of the weighted residuals by the free ones, and these residuals (q,).

    The search ends within a share of the sum of squares.
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

    low, high = problem.bounds
    found = scipy.optimize.least_squares(
        lambda values: residuals_of(problem, weighted, full(values)), np.clip(theta, low, high)[places],
        lambda values: slopes_of(problem, weighted, full(values))[:, places], bounds=(low[places], high[places]),
        x_scale=problem.scale[places], xtol=within, ftol=within, gtol=within,
    )  # fmt: skip
    return full(found.x), slopes_of(problem, weighted, full(found.x))[:, problem.places], np.asarray(found.fun)


def surprise_of(left: Array, fitted: int) -> float:
    """Sum of squares of residuals (q,) over its expected value; nan where nothing is left over."""
    return float(left @ left) / (len(left) - fitted) if len(left) > fitted else float("nan")
