"""Limits on the durations, and the polytope of feasible time fractions.

    least <= w <= most,   rows w <= limits,   sum w = 1

Linear functions over it are bounded from weak duality: for any prices l >= 0 and any feasible v,
g v <= l limits + max over the box of (g - rows^T l) v, and that maximum is found by sorting. The bound is valid
for any prices; dual optimal ones make it tight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.errors import InputError, NoAnswer, UnknownName
from expdesign.values import Array, sealed

LOOSENING = 1e-9  # share by which limits are loosened where they leave no interior

LEAST_FRACTION = 1e-9  # fractions less than this above their bound are set to it


@dataclass(frozen=True, kw_only=True)
class Budget:
    """A limited resource, e.g. energy or wear."""

    name: str  # for reports
    cost_per_s: Mapping[str, float]  # use per second of each primitive, by name; 0 for primitives without an entry
    limit: float  # amount available, in the same unit


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """Limits on the durations, by names of primitives."""

    # least_s, most_s: least and most total time of a primitive [s]
    least_s: Mapping[str, float] = field(default_factory=dict)
    most_s: Mapping[str, float] = field(default_factory=dict)
    required: tuple[str, ...] = ()  # primitives that get at least one whole run
    excluded: tuple[str, ...] = ()  # primitives that get no time
    budgets: tuple[Budget, ...] = ()  # limited resources
    # from 0 to 1: least D-efficiency of the information about the parameters of each equation (surge, sway, yaw),
    # relative to the optimum for that equation alone
    balance: float = 0.0

    def __post_init__(self) -> None:
        for what, times in (("least", self.least_s), ("most", self.most_s)):
            for name, value in times.items():
                if not 0 <= value < np.inf:
                    raise InputError(f"design.{what}_s.{name} is {value:g}, expected 0 or more")
        if not 0 <= self.balance < 1:
            raise InputError(f"design.balance is {self.balance:g}, expected at least 0 and below 1")


NO_CONSTRAINTS = Constraints()


@sealed(least="q", most="q", rows="i q", limits="i")
class Polytope:
    """Feasible time fractions."""

    # least, most: (q,) bounds, 0 to 1
    least: Array
    most: Array
    rows: Array  # (i, q) use per unit of fraction, each as a share of its limit
    limits: Array  # (i,) all 1, or 0 for budgets of 0
    labels: tuple[str, ...]  # (i) names of the rows

    @property
    def plain(self) -> bool:
        """Whether fractions only have to sum to one."""
        return not (self.least.any() or (self.most < 1.0).any() or len(self.rows))

    def bound(self, slope: Array, prices: Array) -> float:
        """Upper bound on slope v over the polytope, from prices (i,) of 0 or more of the rows."""
        reduced = slope - self.rows.T @ prices
        order = np.argsort(-reduced)
        room = (self.most - self.least)[order]
        left = 1.0 - float(self.least.sum())
        taken = np.clip(left - np.r_[0.0, np.cumsum(room)[:-1]], 0.0, room)
        return float(prices @ self.limits + reduced @ self.least + reduced[order] @ taken)

    def inside(self) -> Array | None:
        """(q,) fractions as far from every bound as possible, or None when there is no interior."""
        free = self.most > self.least
        margin = np.where(free, 1.0 / len(free), 0.0)
        upper = np.where(self.most < 1.0, margin, 0.0)
        weight = np.maximum(np.abs(self.rows).max(axis=1, initial=0.0), 1e-12)
        eye = scipy.sparse.eye_array(len(free))
        A = scipy.sparse.block_array(
            [[-eye, margin[:, None]], [eye, upper[:, None]], [self.rows, weight[:, None]]], format="csr"
        )
        b = np.r_[-self.least, np.maximum(self.most, self.least), self.limits]
        sum_row = np.r_[np.ones(len(free)), 0.0][None]
        bounds = [(None, None)] * len(free) + [(None, 1.0)]
        goal = np.r_[np.zeros(len(free)), -1.0]
        answer = scipy.optimize.linprog(goal, A, b, sum_row, [1.0], bounds, method="highs")
        if answer.status != 0 or answer.x[-1] <= LOOSENING:
            return None
        return np.asarray(answer.x[:-1])

    def middle(self) -> Array:
        """(q,) fractions well inside the limits where there is an interior, else feasible up to rounding."""
        if self.plain:
            return np.full(len(self.least), 1.0 / len(self.least))
        found = self.inside()
        if found is None:  # a checked polytope is not empty
            found = self.loosened().inside()
        return self.tidied(np.array(self.least)) if found is None else found

    def tidied(self, w: Array) -> Array:
        """(q,) projected to the box, with tiny fractions set to their bound, and those between scaled to sum one."""
        room, left = np.maximum(self.most, self.least) - self.least, 1.0 - float(self.least.sum())
        above = np.clip(w - self.least, 0.0, room)
        above = np.where(above > LEAST_FRACTION, above, 0.0)
        between = above < room - LEAST_FRACTION
        if not 0.0 < float(above[~between].sum()) < left or not above[between].any():
            between[:] = True
        scale = (left - above[~between].sum()) / max(float(above[between].sum()), 1e-300)
        return np.asarray(self.least + np.where(between, above * scale, above))

    def among(self, chosen: NDArray[np.intp]) -> Polytope:
        """Of some of the fractions (c,), the others zero."""
        return replace(self, least=self.least[chosen], most=self.most[chosen], rows=self.rows[:, chosen])

    def feasible(self) -> bool:
        """Whether the polytope is not empty."""
        return self.corner(np.zeros(len(self.least))) is not None

    def corner(self, slope: Array) -> Array | None:
        """(q,) fractions that maximise slope w, few of them between their bounds; None where the polytope is empty."""
        bounds = np.stack([self.least, np.maximum(self.most, self.least)], axis=1)
        total = np.clip(1.0, self.least.sum(), self.most.sum())
        ones = np.ones((1, len(self.least)))
        answer = scipy.optimize.linprog(-slope, self.rows, self.limits, ones, [total], bounds, method="highs-ds")
        return np.asarray(answer.x) if answer.status == 0 else None

    def loosened(self) -> Polytope:
        """The polytope with limits of rows moved by `LOOSENING`."""
        return replace(self, limits=self.limits + LOOSENING)


def feasible_set(constraints: Constraints, names: Sequence[str], *, run_s: Array, total_s: float) -> Polytope:
    """The polytope of time fractions.

    Args:
        names: of the q primitives.
        run_s: (q,) duration of one run [s].
        total_s: total time of all primitives [s].

    Raises:
        UnknownName: a primitive that is not in the dictionary.
        InputError: limits that contradict each other.
        NoAnswer: no fractions satisfy all limits; the message names one that cannot be satisfied.
    """
    least, most = np.zeros(len(names)), np.ones(len(names))
    for name, value in constraints.least_s.items():
        least[_index(names, name, "design.least_s")] = value / total_s
    for name in constraints.required:
        index = _index(names, name, "design.required")
        least[index] = max(least[index], run_s[index] / total_s)
    for name, value in constraints.most_s.items():
        most[_index(names, name, "design.most_s")] = min(value / total_s, 1.0)
    for name in constraints.excluded:
        most[_index(names, name, "design.excluded")] = 0.0
    rows, limits = _rows(constraints.budgets, names, total_s)
    too_costly = rows * LOOSENING > limits[:, None]
    most = np.where(too_costly.any(axis=0) & (least == 0), 0.0, most)
    rows[:, most == 0] = 0.0
    limits = np.where(rows.any(axis=1), limits, 1.0)
    polytope = Polytope(
        least=least, most=most, rows=rows, limits=limits, labels=tuple(item.name for item in constraints.budgets)
    )
    _check_box(polytope, names, total_s)
    _check_budgets(polytope, constraints.budgets)
    return polytope


def _index(names: Sequence[str], name: str, key: str) -> int:
    if name not in names:
        raise UnknownName(f"primitive in {key}", name, known=names)
    return list(names).index(name)


def _rows(budgets: Sequence[Budget], names: Sequence[str], total_s: float) -> tuple[Array, Array]:
    rows, limits = np.zeros((len(budgets), len(names))), np.ones(len(budgets))
    for row, budget in zip(range(len(budgets)), budgets, strict=True):
        if not 0 <= budget.limit < np.inf:
            raise InputError(f"budget {budget.name!r} has the limit {budget.limit:g}, expected 0 or more")
        for name, cost in budget.cost_per_s.items():
            if not 0 <= cost < np.inf:
                raise InputError(f"budget {budget.name!r}: the cost of {name!r} is {cost:g}, expected 0 or more")
            rows[row, _index(names, name, f"budget {budget.name!r}")] = cost * total_s
        scale = budget.limit or float(rows[row].max(initial=0.0)) or 1.0
        rows[row] /= scale
        limits[row] = budget.limit / scale
    return rows, limits


def _check_box(polytope: Polytope, names: Sequence[str], total_s: float) -> None:
    wrong = np.flatnonzero(polytope.least > polytope.most * (1 + 1e-12))
    if len(wrong):
        index = int(wrong[0])
        raise InputError(
            f"primitive {names[index]!r} must get at least {polytope.least[index] * total_s:g} s and may get at most "
            f"{polytope.most[index] * total_s:g} s"
        )
    needed_s = float(polytope.least.sum()) * total_s
    if polytope.least.sum() > 1 + 1e-12:
        raise NoAnswer(
            f"design.total_s is {total_s:g}, but the least times and required runs take "
            f"{needed_s:g} s; with design.total_s = {_up(needed_s):g} they fit"
        )
    if polytope.most.sum() < 1 - 1e-12:
        raise NoAnswer(
            f"design.total_s is {total_s:g}, but most times and budgets allow only {polytope.most.sum() * total_s:g} s"
            + _fitting(polytope.most * total_s)
        )


def _fitting(most_s: Array) -> str:
    """The total that most times (q,) [s] allow, if any."""
    total_s = float(f"{most_s.sum():.4g}")
    total_s = total_s if total_s <= most_s.sum() else np.floor(most_s.sum() * 1e3) / 1e3
    return f"; with design.total_s = {total_s:g} they are enough" if total_s > 0 else ""


def _up(value: float) -> float:
    """A value rounded up to six digits."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 5)
    return float(np.ceil(value / unit) * unit)


def _check_budgets(polytope: Polytope, budgets: Sequence[Budget]) -> None:
    """Each budget alone against the least feasible use, then all together."""
    for row, limit, budget in zip(polytope.rows, polytope.limits, budgets, strict=True):
        alone = Polytope(
            least=polytope.least, most=polytope.most, rows=np.zeros((0, len(row))), limits=np.zeros(0), labels=()
        )
        needed = -alone.bound(-row, np.zeros(0))
        if needed > limit * (1 + LOOSENING) + LOOSENING:
            scale = budget.limit / limit if limit else 1.0
            raise NoAnswer(
                f"budget {budget.name!r} has the limit {budget.limit:g}, but any feasible durations use at least "
                f"{needed * scale:g}; with the limit {_up(needed * scale):g} there are some, as far as this budget goes"
            )
    if len(budgets) and not polytope.loosened().feasible():
        raise NoAnswer(
            f"no durations satisfy the budgets {', '.join(item.name for item in budgets)} together with the least and "
            "most times"
        )
