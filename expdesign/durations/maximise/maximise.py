"""The optimum of a concave problem, with its certificate.

D without limits is solved by the working-set method of `large_scale`. Other smooth criteria are solved by Newton's
method under the limits, and E, or an optimum with singular information, as a conic problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.certificate import Certificate, certify
from expdesign.durations.concave import ConcaveProblem
from expdesign.durations.criteria.models import Indices, Objective
from expdesign.durations.maximise.large_scale import d_optimal, rows_of
from expdesign.durations.tuning import TUNING
from expdesign.errors import FloorOutOfReach, NoAnswer
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """Fractions (q,), their certificate, and the criterion's sensitivities (q,) there."""

    fractions: Array
    certificate: Certificate
    sensitivities: Array

    @property
    def gap(self) -> float:
        """Per degree."""
        return self.certificate.gap / self.certificate.degree


def maximised(task: ConcaveProblem, kind: str = "") -> Optimum:
    """The optimum with its certificate.

    Raises:
        NoAnswer: the floors cannot all be kept.
        numpy.linalg.LinAlgError: every feasible design is singular.
    """
    least = task.polytope.least
    if not 1.0 - least.sum() > TUNING.loosening:  # least times take everything
        return _proven(task, least / least.sum(), kind)
    if task.plain_d and (w := _plain_d(task)) is not None:
        return _proven(task, w, kind)
    if task.smooth and (found := _by_newton(task, kind)) is not None:
        return found
    from expdesign.durations.maximise._cvxpy import conic_optimum

    answer = conic_optimum(task)
    if task.floors:
        _check_floors(task, None if answer is None else answer[0])
    if answer is None:
        raise np.linalg.LinAlgError
    w, multipliers = answer
    return _sharpened(task, _proven(task, task.polytope.tidied(w), kind, multipliers))


def _proven(task: ConcaveProblem, w: Array, kind: str, multipliers: Sequence[Array] = ()) -> Optimum:
    certificate, slope = certify(task, w, kind=kind, multipliers=multipliers)
    return Optimum(fractions=w, certificate=certificate, sensitivities=slope)


def _plain_d(task: ConcaveProblem) -> Array | None:
    """The D-optimal fractions, with the least times as prior; None where a B_q is indefinite."""
    (piece,), polytope = task.objective.pieces, task.polytope
    free = np.flatnonzero(polytope.most > polytope.least)
    left = 1.0 - float(polytope.least.sum())
    rows = rows_of(piece.matrices[free])
    if rows is None:
        return None
    w = np.array(polytope.least)
    w[free] += left * d_optimal(rows, prior=piece.matrix(polytope.least) / left, tolerance=TUNING.target_gap).fractions
    return w


def _by_newton(task: ConcaveProblem, kind: str) -> Optimum | None:
    """The optimum of smooth measures by Newton's method from the middle, or None where that does not lead there."""
    try:
        found = _sharpened(task, _proven(task, task.polytope.middle(), kind))
    except np.linalg.LinAlgError:
        return None
    return found if found.gap < TUNING.largest_gap and _floors_kept(task, found.fractions) else None


def _sharpened(task: ConcaveProblem, best: Optimum) -> Optimum:
    """An optimum with a gap no wider, by Newton's method under all limits, where every measure is smooth."""
    if not task.smooth:
        return best
    from expdesign.durations.maximise._cvxpy import newton_step

    here = best
    for _ in range(TUNING.newton_steps):
        if best.gap < TUNING.target_gap:
            break
        proof, w = here.certificate, here.fractions
        prices = [proof.multipliers[name] for name in task.floor_names]
        try:
            step = newton_step(task, w, chosen=_working_set(task, here), mixture=proof.mixture, floor_prices=prices)
            moved = None if step is None else _ascended(task, w, step, prices)
            if moved is None:
                break
            here = _proven(task, moved, proof.kind)
        except np.linalg.LinAlgError:
            break
        before, best = best.gap, min(best, here, key=lambda item: item.gap)
        if before / 2 < best.gap < TUNING.rounding_gap:
            break
    return best


def _working_set(task: ConcaveProblem, here: Optimum) -> Indices:
    """(c,) fractions above their least value, and those whose net sensitivity lets them rise."""
    proof = here.certificate
    rising = here.sensitivities - proof.prices > proof.level - TUNING.margin * proof.degree
    return np.flatnonzero(rising | (here.fractions > task.polytope.least))


def _ascended(task: ConcaveProblem, w: Array, step: Array, prices: Sequence[float]) -> Array | None:
    """Fractions (q,) along a step that raise the merit, by backtracking; None where none do."""

    def merit(v: Array) -> float:
        missed = [min(floor.value(v), 0.0) for floor in task.floors]
        return task.objective.value(v) + sum((2 * p + 1) * short for p, short in zip(prices, missed, strict=True))

    before = merit(w)
    for length in 0.5 ** np.arange(20):
        moved = task.polytope.tidied(w + length * step)
        if merit(moved) > before - 1e-13 * abs(before):
            return moved
    return None


def _floors_kept(task: ConcaveProblem, w: Array) -> bool:
    return all(floor.value(w) > -TUNING.floor_rounding for floor in task.floors)


def _check_floors(task: ConcaveProblem, w: Array | None) -> None:
    """Raises NoAnswer where fractions (q,) violate a floor because the floors contradict each other."""
    if w is not None and _floors_kept(task, w):
        return
    together = Objective(
        tuple(floor.pieces[0] for floor in task.floors),
        np.concatenate([floor.levels for floor in task.floors]),
        worst=True,
    )
    best = maximised(ConcaveProblem(objective=together, polytope=task.polytope)).fractions
    kept = min(float(np.exp(floor.value(best) / floor.degree)) for floor in task.floors)
    balances = tuple(name for name in task.floor_names if name.startswith("balance"))
    if kept < 1.0 and len(balances) < len(task.floors):
        _check_each(task)
        raise NoAnswer(
            f"no durations within the other limits keep {', '.join(task.floor_names)} together, though each alone; at "
            f"most {kept:.3g} times what is asked of each is possible"
        )
    if kept < 1.0:
        raise NoAnswer(
            "design.balance cannot be met: no durations within the other limits are this informative about every "
            f"equation; at most {kept:.3g} times the required share is possible"
        )


def _check_each(task: ConcaveProblem) -> None:
    """Raises FloorOutOfReach for the first floor that cannot be kept even alone."""
    for name, floor in zip(task.floor_names, task.floors, strict=True):
        alone = replace(floor, levels=np.zeros(1))
        most = maximised(ConcaveProblem(objective=alone, polytope=task.polytope)).certificate.value
        if most < floor.levels[0]:
            raise FloorOutOfReach(name, share=float(np.exp((most - floor.levels[0]) / floor.degree)))
