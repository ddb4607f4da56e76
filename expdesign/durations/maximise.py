"""The optimum of a concave problem, with its certificate.

A problem of moderate size is solved as it is stated, by cvxpy. Newton's method under the limits, from the solver's
answer, gives the digits that an interior point lacks. Whatever found it, the certificate is computed from the problem.

Other problems, and those solved only to compare, are solved by the quickest method. For D without limits that is the
working-set method of `large_scale`. Other smooth criteria of few candidates are solved by Newton's method from the
middle of the limits. Of more candidates than `CONIC_CANDIDATES` only a working set is solved at a time, by any
criterion and under any limits. E, and an optimum with singular information, have no method but cvxpy, which then
solves the working sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.durations.certificate import Certificate, certify
from expdesign.durations.concave import ConcaveProblem
from expdesign.durations.criteria import Indices, Objective
from expdesign.durations.large_scale import FIRST_GAP, MOST_SETS, d_optimal, rows_of, set_size
from expdesign.durations.limits import LOOSENING
from expdesign.errors import FloorOutOfReach, NoAnswer, NotInformative
from expdesign.values import Array

# most candidates of a problem that cvxpy solves as stated, and without a working set. With 18 parameters and 3 means it
# takes 0.3 s of 14 candidates, 0.9 s of 300, 12 s of 10,000.
CONIC_CANDIDATES = 300
# most parameters and means, with which its work grows by about the sixth power: of 8 candidates 24 take 0.2 s, and 44,
# of a twin-screw ship from a card, 14 s, where other methods take 0.1 s
CONIC_PARAMETERS = 30
FLOOR_ROUNDING = 1e-6  # shortfall of a floor, as a logarithm, that counts as rounding
LARGEST_GAP = 1e-6  # designs with a wider gap are not returned

WIDE_GAP = 1e-7  # gap from which a design that no Newton step can sharpen is sought by other means, too
TARGET_GAP = 1e-10  # gap at which Newton's method ends
ROUNDING_GAP = 1e-9  # below this gap, a Newton step that does not halve it is the last: the rest is rounding
LEAST_GAP_OF_STEP = 1e-6  # gap to which the objective of a Newton step is scaled at least
NEWTON_STEPS = 30  # most Newton steps; six to ten are usual, two or three from a conic optimum
# a fraction at its least value may change in a Newton step where its net sensitivity falls short of the others' by
# less, per degree
MARGIN = 0.01
CONIC_INEQUALITIES = 5  # most models and floors of such a problem; each costs as much again
CVXPY, WORKING_SET, NEWTON = "cvxpy with CLARABEL", "working-set method", "Newton's method"
NO_CHOICE = "none: least times take all of the time"  # names of the methods


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """An optimum."""

    fractions: Array  # (q,)
    certificate: Certificate  # of these
    sensitivities: Array  # (q,) of the criterion there
    gap: float  # per degree, with what fractions beyond a budget owe to that
    method: str  # that found it
    # (d, d) for each model, which the certificate may be from; () for the criterion's own gradients
    multipliers: Sequence[Array] = ()


def maximised(task: ConcaveProblem, kind: str = "", *, as_stated: bool = False) -> Optimum:
    """The optimum with its certificate.

    Args:
        kind: the theorem, in words.
        as_stated: solve the problem as it is stated where its size allows that, not by the quickest method. The answers
            agree to the gaps.

    Raises:
        NoAnswer: the floors cannot all be kept.
        numpy.linalg.LinAlgError: every feasible design is singular.
    """
    least = task.polytope.least
    if not 1.0 - least.sum() > LOOSENING:  # least times take everything
        return _proven(task, least / least.sum(), kind, method=NO_CHOICE)
    best = _by_cvxpy(task, kind) if as_stated and _moderate(task) else None
    if best is None or not best.gap < (TARGET_GAP if task.smooth else WIDE_GAP):
        few = best is not None and not task.smooth  # fewer at a time give an interior point more digits
        own = _plain_d(task, kind) or _by_working_sets(task, kind, few=few) or _by_newton(task, kind)
        best = min(filter(None, (best, own)), key=lambda found: found.gap, default=None)
    if best is not None and best.gap < LARGEST_GAP and _floors_kept(task, best.fractions):
        return best
    best = best or _by_cvxpy(task, kind)
    if task.floors:
        _check_floors(task, None if best is None else best.fractions)
    if best is None:
        raise np.linalg.LinAlgError
    return best


def _proven(task: ConcaveProblem, w: Array, kind: str, multipliers: Sequence[Array] = (), *, method: str) -> Optimum:
    proof, slope = certify(task, w, kind=kind, multipliers=multipliers)
    beyond = np.maximum(task.polytope.rows @ w - task.polytope.limits, 0.0)
    owed = float(_prices(proof, task.polytope.labels) @ beyond)
    return Optimum(
        fractions=w,
        certificate=proof,
        sensitivities=slope,
        gap=(proof.gap + owed) / proof.degree,
        multipliers=multipliers,
        method=method,
    )


def _prices(proof: Certificate, names: Sequence[str]) -> Array:
    return np.array([proof.multipliers[name] for name in names])


def _moderate(task: ConcaveProblem) -> bool:
    """Whether cvxpy takes seconds at most."""
    few = len(task.objective.pieces) + len(task.floors) <= CONIC_INEQUALITIES
    small = len(task.polytope.least) <= CONIC_CANDIDATES and task.objective.dimension <= CONIC_PARAMETERS
    return few and small


def _by_cvxpy(task: ConcaveProblem, kind: str) -> Optimum | None:
    """The optimum of the problem as stated, sharpened; None where the solver gives no numbers, or useless ones."""
    from expdesign.durations._cvxpy import conic_optimum

    answer = conic_optimum(task)
    if answer is None:
        return None
    try:
        found = _proven(task, task.polytope.tidied(answer[0]), kind, answer[1], method=CVXPY)
    except np.linalg.LinAlgError:
        return None
    return _sharpened(task, found, least_steps=1)


def _plain_d(task: ConcaveProblem, kind: str) -> Optimum | None:
    """The D-optimal fractions, with the least times as prior; None for other problems, or where a B_q is indefinite."""
    if not task.plain_d:
        return None
    (piece,), polytope = task.objective.pieces, task.polytope
    free = np.flatnonzero(polytope.most > polytope.least)
    left = 1.0 - float(polytope.least.sum())
    rows = rows_of(piece.matrices[free])
    if rows is None:
        return None
    w = np.array(polytope.least)
    w[free] += left * d_optimal(rows, prior=piece.matrix(polytope.least) / left, tolerance=TARGET_GAP).fractions
    return _proven(task, w, kind, method=WORKING_SET)


def _by_working_sets(task: ConcaveProblem, kind: str, *, few: bool = False) -> Optimum | None:
    """The optimum of many candidates: of some of them, which those join that would raise it, until none does.

    Returns:
        None for few candidates, unless these are asked for, or where the working sets do not lead there.
    """
    count, size = len(task.polytope.least), set_size(task.objective.dimension)
    best: Optimum | None = None
    if count <= CONIC_CANDIDATES and not few:
        return None
    try:
        chosen = _first_set(task)
        for _ in range(MOST_SETS):
            part = task.among(chosen)
            found = _by_newton(part, kind) or _by_cvxpy(part, kind)
            if found is None:
                break
            w = np.zeros(count)
            w[chosen] = found.fractions
            here = _proven(task, w, kind, found.multipliers, method=WORKING_SET)
            best = min(filter(None, (best, here)), key=lambda item: item.gap)
            rising = np.setdiff1d(np.flatnonzero(_excess(here) > TARGET_GAP), chosen)
            if best.gap < TARGET_GAP or not len(rising):
                break
            chosen = np.union1d(chosen, rising[np.argsort(-_excess(here)[rising], kind="stable")[:size]])
    except (np.linalg.LinAlgError, NotInformative):
        return None
    return best if best is not None and best.gap < LARGEST_GAP else None


def _excess(here: Optimum) -> Array:
    """(q,) by how much each net sensitivity is above the level, per degree."""
    proof = here.certificate
    return np.asarray((here.sensitivities - proof.prices - proof.level) / proof.degree)


def _first_set(task: ConcaveProblem) -> Indices:
    """(c,) candidates that keep the limits and the floors and inform about everything.

    Raises:
        NoAnswer: the floors cannot all be kept.
        numpy.linalg.LinAlgError, NotInformative: there are none, or they are not found.
    """
    polytope, pieces = task.polytope, (task.objective.pieces[0], *(floor.pieces[0] for floor in task.floors))
    allowed, needed = np.flatnonzero(polytope.most > 0), polytope.least > 0
    for piece in pieces:
        rows = rows_of(piece.matrices[allowed])
        if rows is None:
            raise np.linalg.LinAlgError
        needed[allowed] |= d_optimal(rows, prior=piece.prior, tolerance=FIRST_GAP).fractions > 0
    if not polytope.plain:
        slope = pieces[0].tangent(polytope.middle()).slope
        roomy = replace(polytope, most=np.maximum(polytope.least, polytope.most / 2))
        for corner in (polytope.corner(slope), roomy.corner(slope)):  # of the first alone all would be at their most
            needed |= np.zeros_like(needed) if corner is None else corner > 0
    if task.floors:
        together = ConcaveProblem(objective=_together(task), polytope=polytope)
        needed |= maximised(together).fractions > 0
    return np.flatnonzero(needed)


def _by_newton(task: ConcaveProblem, kind: str) -> Optimum | None:
    """The optimum of smooth measures by Newton's method from the middle, or None where that does not lead there."""
    if not task.smooth:
        return None
    try:
        found = _sharpened(task, _proven(task, task.polytope.middle(), kind, method=NEWTON))
    except np.linalg.LinAlgError:
        return None
    return found if found.gap < LARGEST_GAP and _floors_kept(task, found.fractions) else None


def _sharpened(task: ConcaveProblem, best: Optimum, *, least_steps: int = 0) -> Optimum:
    """An optimum with a gap no wider, by Newton's method under all limits, where every measure is smooth."""
    if not task.smooth:
        return best
    from expdesign.durations._cvxpy import newton_step

    here = best
    for number in range(NEWTON_STEPS):
        if best.gap < TARGET_GAP and number >= least_steps:
            break
        proof, w = here.certificate, here.fractions
        prices = _prices(proof, task.floor_names)
        try:
            gain = float(np.clip(here.gap, LEAST_GAP_OF_STEP, 1.0))
            chosen = _working_set(task, here)
            step = newton_step(task, w, chosen=chosen, mixture=proof.mixture, floor_prices=prices, gain=gain)
            moved = None if step is None else _ascended(task, here, step)
            if moved is None:
                break
            here = _proven(task, moved, proof.kind, method=best.method)
        except np.linalg.LinAlgError:
            break
        before, best = best.gap, min(best, here, key=lambda item: item.gap)
        if before / 2 < best.gap < ROUNDING_GAP:
            break
    return best


def _working_set(task: ConcaveProblem, here: Optimum) -> Indices:
    """(c,) fractions above their least value, and those whose net sensitivity lets them rise."""
    proof = here.certificate
    rising = here.sensitivities - proof.prices > proof.level - MARGIN * proof.degree
    return np.flatnonzero(rising | (here.fractions > task.polytope.least))


def _ascended(task: ConcaveProblem, here: Optimum, step: Array) -> Array | None:
    """Fractions (q,) along a step that raise the merit, by backtracking; None where none do."""
    w, polytope = here.fractions, task.polytope
    penalties = 2 * _prices(here.certificate, (*task.floor_names, *polytope.labels)) + 1

    def merit(v: Array) -> float:
        kept = np.r_[[floor.value(v) for floor in task.floors], polytope.limits - polytope.rows @ v]
        return task.objective.value(v) + float(penalties @ np.minimum(kept, 0.0))

    before = merit(w)
    for length in 0.5 ** np.arange(20):
        moved = task.polytope.tidied(w + length * step)
        if merit(moved) > before - 1e-13 * abs(before):
            return moved
    return None


def _floors_kept(task: ConcaveProblem, w: Array) -> bool:
    return all(floor.value(w) > -FLOOR_ROUNDING for floor in task.floors)


def _check_floors(task: ConcaveProblem, w: Array | None) -> None:
    """Raises NoAnswer where fractions (q,) violate a floor because the floors contradict each other."""
    if w is not None and _floors_kept(task, w):
        return
    best = maximised(ConcaveProblem(objective=_together(task), polytope=task.polytope)).fractions
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


def _together(task: ConcaveProblem) -> Objective:
    """The least of the floors."""
    pieces = tuple(floor.pieces[0] for floor in task.floors)
    return Objective(pieces, np.concatenate([floor.levels for floor in task.floors]), worst=True)


def _check_each(task: ConcaveProblem) -> None:
    """Raises FloorOutOfReach for the first floor that cannot be kept even alone."""
    for name, floor in zip(task.floor_names, task.floors, strict=True):
        alone = replace(floor, levels=np.zeros(1))
        most = maximised(ConcaveProblem(objective=alone, polytope=task.polytope)).certificate.value
        if most < floor.levels[0]:
            raise FloorOutOfReach(name, share=float(np.exp((most - floor.levels[0]) / floor.degree)))
