"""Efficiency of every design under every criterion, and how far limits are used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.certificate import DurationDesign
from expdesign.durations.concave import Collected, T, with_idle
from expdesign.durations.criteria import CRITERIA, SINGULAR, stacked_values
from expdesign.durations.problem import DurationProblem
from expdesign.durations.solve import floors_of, optimal_shares
from expdesign.errors import InputError, NoAnswer
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class Efficiencies:
    """Efficiency of designs by one criterion, against the optimum under the same limits.

    An efficiency of 0.8 means that the optimum reaches the same with 80 % of the time, without prior information.
    """

    criterion: str  # its name
    title: str  # the quantity that it minimises
    of: Mapping[str, float]  # design -> efficiency; empty when the criterion cannot be evaluated
    missing: str = ""  # the reason, or ""


def efficiencies(design: DurationDesign) -> tuple[Efficiencies, ...]:
    """The design, its whole runs, equal shares and every other criterion's optimum under every criterion.

    A criterion that needs more than the aim states is listed with the reason, as is D_s when it equals D.
    """
    problem = design.problem
    named = {"continuous": design.fractions}
    if any(design.repeats):
        named["repeats"] = np.array(design.repeats) * problem.run_s / problem.total_s
    named["uniform"] = np.full(len(problem.names), 1.0 / len(problem.names))
    compared = [item for item in CRITERIA if problem.floors or item.name != T]
    found: dict[str, Array] = {}
    missing: dict[str, str] = {}
    for item in compared:
        try:
            found[item.name] = _optimum(design, problem, item.name)
        except (InputError, NoAnswer) as error:
            missing[item.name] = str(error)
    named |= {f"optimal by {name}": fractions for name, fractions in found.items() if name != problem.aim.criterion}
    return tuple(
        Efficiencies(
            criterion=item.name,
            title=item.title,
            of=_of(problem, item.name, named, found[item.name]) if item.name in found else {},
            missing=missing.get(item.name, ""),
        )
        for item in compared
    )


@dataclass(frozen=True, kw_only=True)
class Kept:
    """How far a budget is used, or a balance or a least information is reached."""

    name: str  # of the limit
    limit: float  # of the budget; for a balance the least share; the least information
    continuous: float  # used or reached by the optimal fractions
    repeats: float  # used or reached by the whole runs, which may fall short of a balance
    price: float  # Lagrange multiplier in the certificate; zero when the limit is not active


def limits_kept(design: DurationDesign) -> tuple[Kept, ...]:
    """Every budget, balance and least information, by the optimal fractions and by the whole runs."""
    problem = design.problem
    runs = np.array(design.repeats) * problem.run_s / problem.total_s
    found = []
    for budget in problem.constraints.budgets:
        cost = np.array([budget.cost_per_s.get(name, 0.0) for name in problem.names]) * problem.total_s
        found.append((budget.name, budget.limit, float(cost @ design.fractions), float(cost @ runs)))
    idle = bool(problem.constraints.budgets)
    asked = {item.name: item.least for item in problem.floors}
    for name, floor in floors_of(with_idle(problem) if idle else problem).items():
        piece, least = floor.pieces[0], asked.get(name, problem.constraints.balance)
        value, at_runs = (
            least
            * float(
                np.exp(
                    (stacked_values(piece.measure, piece.matrix(w)[None])[0] - floor.levels[0]) / piece.measure.degree
                )
            )
            for w in (np.r_[design.fractions, [0.0] * idle], np.r_[runs, [0.0] * idle])
        )
        found.append((name, least, value, at_runs))
    prices = design.certificate.multipliers
    return tuple(
        Kept(name=name, limit=limit, continuous=continuous, repeats=repeats, price=prices.get(name, 0.0))
        for name, limit, continuous, repeats in found
    )


def _optimum(design: DurationDesign, problem: DurationProblem, name: str) -> Array:
    if name == problem.aim.criterion:
        return design.fractions
    if not problem.symmetric:
        raise InputError(f"criterion {name} needs primitives that are simulated, not recorded ones")
    if name == "D_s" and not problem.aim.interest:
        raise InputError("criterion D_s needs parameters of interest; without, it is D")
    floors = () if problem.aim.criterion == T else problem.floors  # which T maximises and does not demand
    return optimal_shares(replace(problem, aim=replace(problem.aim, criterion=name), floors=floors)).fractions


def _of(problem: DurationProblem, name: str, designs: Mapping[str, Array], best: Array) -> dict[str, float]:
    collected = Collected.of(problem, name)
    return {design: collected.efficiency(shares, best) for design, shares in designs.items()}


def pool_gains(matrices: Array) -> Array:
    """(q,) gain in log det by each primitive beside the pool of all, per unit of time taken from equal shares.

    With B = mean of the B_q this is trace(B^-1 B_q) - d, the slope of log |det B| towards primitive q. It ranks
    primitives also where none informs about every parameter alone, and adds up to zero over all.

    Args:
        matrices: (q, d, d) B_q, see `DurationProblem`.

    Returns:
        The gains; nan where all together do not inform about every parameter.

    Source: J. Kiefer and J. Wolfowitz, The equivalence of two extremum problems, Canad. J. Math. 12 (1960), 363-366.
    """
    size = np.sqrt(np.abs(np.diagonal(matrices, axis1=1, axis2=2)).mean(axis=0))
    size = np.where(size > 0, size, 1.0)
    scaled = matrices / np.outer(size, size)
    pool = scaled.mean(axis=0)
    values = np.linalg.svd(pool, compute_uv=False)
    if not values[-1] > SINGULAR * values[0]:
        return np.full(len(matrices), np.nan)
    return np.asarray(np.einsum("ij,qji->q", np.linalg.inv(pool), scaled) - len(pool))
