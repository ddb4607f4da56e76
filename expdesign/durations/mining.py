"""Selection of the k most informative recorded batches for re-estimation (thesis 7.3).

Choosing k of N batches is the design problem with fractions of 0 or the batch's share. The relaxation to fractions
between 0 and that share gives an upper bound with a certificate.

Source: F. Ljungberg, doctoral thesis, Linköping University, 7.3; relaxation: S. Joshi and S. Boyd, Sensor selection via
convex optimization, IEEE Trans. Signal Process. 57 (2009), 451-462.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np

from expdesign.durations.concave import Collected, symmetric_part
from expdesign.durations.limits import NO_CONSTRAINTS, Constraints
from expdesign.durations.problem import DurationProblem
from expdesign.durations.rounding import ADDED_SHARE
from expdesign.durations.solve import optimal_shares
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.solve import null_space, require_informative
from expdesign.information.recorded import BatchInformation
from expdesign.values import Array, sealed

ALL_SUBSETS = 20_000  # up to this number, every subset of batches is evaluated


@sealed(first="N")
class Subset:
    """The chosen batches."""

    names: tuple[str, ...]  # of all batches, in the order of greedy selection
    chosen: tuple[str, ...]  # names of the selected batches
    efficiency: float  # against all batches together, by the criterion
    # upper bound on the efficiency of any subset of that size; equal to `efficiency` when exact, nan when unknown
    bound: float
    exact: bool  # whether all subsets were evaluated
    # whether the symmetric part of the information counted; else the magnitude of its determinant, which is not a
    # guaranteed value
    symmetric: bool
    # (N,) efficiency of the first 1, 2, ... N of `names`; 0 while they do not inform about every parameter.
    first: Array


def best_subset(
    batches: Sequence[BatchInformation],
    parameters: Sequence[str],
    *,
    size: int,
    mean_subtraction: str = "complete",
) -> Subset:
    """Rank recorded batches and choose `size` of them for re-estimation.

    The symmetric part of each batch's matrix counts, which is a guaranteed part of its information. Where the sum of
    all symmetric parts is not positive definite, the magnitude of the determinant counts instead.

    Args:
        batches: measured or simulated, see `information.recorded_information`.
        parameters: names in the order of their matrices.
        size: number of batches to choose.
        mean_subtraction: "none", "batch" or "complete".

    Raises:
        InputError: the size is not from 1 to the number of batches.
        NotInformative: the batches together, or every evaluated subset, lack information about a parameter.
    """
    if not 1 <= size <= len(batches):
        raise InputError(f"{size} of {len(batches)} batches cannot be chosen, expected 1 to {len(batches)}")
    problem, collected = _pool(batches, parameters, mean_subtraction)
    shares = problem.run_s / problem.total_s
    order = _greedy(collected, shares)
    exact = comb(len(batches), size) <= ALL_SUBSETS
    if exact:
        chosen = max(combinations(range(len(batches)), size), key=lambda picked: _value(collected, shares, picked))
    else:
        chosen = _exchanged(collected, shares, tuple(order[:size]))
    if not np.isfinite(_value(collected, shares, chosen)):
        raise NotInformative(
            f"no subset of {size} batches that was evaluated informs about every parameter",
            parameters=tuple(parameters),
        )
    efficiency = collected.efficiency(_indicator(shares, chosen), shares)
    return Subset(
        names=tuple(problem.names[index] for index in order),
        chosen=tuple(problem.names[index] for index in sorted(chosen)),
        efficiency=efficiency,
        bound=efficiency if exact else _bound(problem, collected, size, efficiency),
        exact=exact,
        symmetric=collected.symmetric,
        first=np.array([collected.efficiency(_indicator(shares, order[: k + 1]), shares) for k in range(len(order))]),
    )


def build_recorded(
    batches: Sequence[BatchInformation],
    parameters: Sequence[str],
    *,
    run_s: Array,
    total_s: float,
    mean_subtraction: str = "complete",
    constraints: Constraints = NO_CONSTRAINTS,
) -> DurationProblem:
    """The duration problem of recorded primitives, from the moments of their data.

    Args:
        batches: moments of each primitive, see `information.recorded`.
        parameters: names in the order of their matrices.
        run_s: (q,) duration of one whole run of each [s].
        total_s: total time of all primitives [s].
        mean_subtraction: "none", "batch" or "complete".
    """
    return DurationProblem(
        names=tuple(batch.name for batch in batches),
        parameters=tuple(parameters),
        mean_subtraction=mean_subtraction,
        matrices=np.array([batch.bordered(mean_subtraction) for batch in batches]),
        run_s=run_s,
        total_s=total_s,
        constraints=constraints,
    )


def _pool(
    batches: Sequence[BatchInformation], parameters: Sequence[str], mean_subtraction: str
) -> tuple[DurationProblem, Collected]:
    """All batches as primitives of one run each, in their total time, and the criterion."""
    samples = np.array([float(batch.samples) for batch in batches])
    problem = build_recorded(
        batches,
        parameters,
        run_s=samples,
        total_s=float(samples.sum()),
        mean_subtraction=mean_subtraction,
    )
    require_told_apart(problem, samples)
    definite = replace(problem, matrices=symmetric_part(problem.matrices))
    try:
        return definite, Collected.of(definite)
    except NotInformative:
        if problem.symmetric:
            raise
    collected = Collected.of(problem)
    if not np.isfinite(collected.value(samples / samples.sum())):
        raise NotInformative("all batches together do not inform about every parameter", parameters=tuple(parameters))
    return problem, collected


def require_told_apart(problem: DurationProblem, samples: Array) -> None:
    """Refuse parameters that all batches together do not tell apart: their determinant is of rounding alone.

    Args:
        problem: of recorded batches or labels.
        samples: (q,) of each, or anything in proportion.

    Raises:
        NotInformative: naming every combination.
    """
    p = len(problem.parameters)
    total = np.tensordot(samples, problem.matrices, axes=1)
    moment = total[:p, :p] - total[:p, p:] @ np.linalg.solve(total[p:, p:], total[p:, :p])
    size = np.sqrt(np.abs(np.diag(total)[:p]))
    size[size == 0] = 1.0
    found = null_space(
        moment / np.outer(size, size), problem.parameters, size, samples=int(samples.sum()), exogenous=problem.symmetric
    )
    require_informative(found)


def _indicator(shares: Array, chosen: Sequence[int]) -> Array:
    taken = np.zeros_like(shares)
    taken[list(chosen)] = shares[list(chosen)]
    return taken


def _value(collected: Collected, shares: Array, chosen: Sequence[int]) -> float:
    return collected.value(_indicator(shares, chosen))


def _with_each(collected: Collected, shares: Array, taken: Array, candidates: Sequence[int]) -> Array:
    """(c,) values of shares (q,) with each candidate added to them."""
    added = np.array(candidates)
    return collected.values(
        tuple(
            total + shares[added, None, None] * piece.matrices[added]
            for total, piece in zip(collected.totals(taken), collected.pieces, strict=True)
        )
    )


def _greedy(collected: Collected, shares: Array) -> list[int]:
    """All batches in greedy order; a small share of all is added, so that small subsets are not singular."""
    small = ADDED_SHARE * shares
    order: list[int] = []
    left = list(range(len(shares)))
    while left:
        values = _with_each(collected, shares, _indicator(shares, order) + small, left)
        order.append(left.pop(int(np.argmax(values))))
    return order


def _exchanged(collected: Collected, shares: Array, chosen: tuple[int, ...]) -> tuple[int, ...]:
    """Swaps of one batch for another while one raises the value."""
    best = _value(collected, shares, chosen)
    while True:
        others = [index for index in range(len(shares)) if index not in chosen]
        kept = [tuple(index for index in chosen if index != out) for out in chosen]
        values = np.array([_with_each(collected, shares, _indicator(shares, rest), others) for rest in kept])
        if not others or values.max() <= best + 1e-12:
            return chosen
        out, into = np.unravel_index(int(np.argmax(values)), values.shape)
        best, chosen = float(values.max()), (*kept[out], others[into])


def _bound(problem: DurationProblem, collected: Collected, size: int, efficiency: float) -> float:
    return max(_relaxed(problem, collected, size), efficiency) if collected.symmetric else float("nan")


def _relaxed(problem: DurationProblem, collected: Collected, size: int) -> float:
    """Upper bound on the efficiency of any subset of that size by relaxation: z_q from 0 to 1 of every batch.

    With v = z / size the information is sum v_q (size x share_q x B_q), the v sum to one, and each is at most 1 / size.
    Means are eliminated, not counted, because the time taken is not fixed: for D that is D_s of all parameters.
    """
    shares = problem.run_s / problem.total_s
    aim = replace(problem.aim, criterion="D_s") if problem.aim.criterion == "D" else problem.aim
    relaxed = replace(
        problem,
        matrices=size * shares[:, None, None] * problem.matrices,
        run_s=np.ones(len(shares)),
        total_s=1.0,
        aim=aim,
        constraints=Constraints(most_s=dict.fromkeys(problem.names, 1.0 / size)),
    )
    certificate = optimal_shares(relaxed).certificate
    return min(1.0, float(np.exp((certificate.bound - collected.value(shares)) / collected.degree)))
