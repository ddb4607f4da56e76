"""A sparse sum of regressors that explains what remains: greedy regression, held-out likelihood, stability selection.

All of it works on inner products per unit of the data, so that hundreds of regressors and draws cost little.

Sources: N. Meinshausen and P. Buehlmann, Journal of the Royal Statistical Society B 72 (2010), 417-473, for stability
selection; S. L. Brunton, J. L. Proctor and J. N. Kutz, Proceedings of the National Academy of Sciences 113 (2016),
3932-3937, for sparse regression of equations of motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.model import is_thrust
from expdesign.own_units import pseudo_inverse_of, solution_of
from expdesign.values import Array
from expdesign.vessel import NUMPY, Term, VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS, parse_expression

MOST_TERMS = 3  # of the sum
LEAST_STATISTIC = 25.0  # of a regressor; one of 300 reaches it by chance in one of 1000 trials
LEAST_OWN_SHARE = 1e-4  # of a regressor that nothing else imitates
ROUNDING = 1e-11  # share of a regressor's information that is rounding, where the rest is imitated by what is estimated
HALF_SAMPLES = 50  # of the units, for stability selection
STABLE = 0.5  # share of them that must choose a regressor, or one that looks like it
ALIKE = 0.8  # correlation from which on regressors look alike
FOLDS = 4  # of the held-out likelihood
LEAST_HELD_OUT = 15.0  # gain of held-out likelihood, as a statistic
MOST_LOST = 0.25  # share of it that single units may lose


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitInformation:
    """Information of every unit of the data about nuisance effects and, after them, regressors."""

    A: Array  # (w, c, c); s: (w, c) scores
    s: Array
    precision: Array  # (n, n) of the priors of the nuisance effects; offset: (n,) their deviations from these
    offset: Array

    def beside_nuisance(self, keep: NDArray[np.bool_]) -> tuple[Array, Array]:
        """(c - n, c - n) and (c - n,) of some units, (w,) by mask, with the nuisance effects projected out.

        Zero for regressors that these imitate up to rounding.
        """
        n = len(self.precision)
        weights = keep.astype(float)  # sums, without a copy of what is summed
        A, s = np.tensordot(weights, self.A, 1), weights @ self.s
        if not n:
            return A, s
        own = A[:n, :n] + self.precision
        solved = pseudo_inverse_of(own) @ np.column_stack([A[:n, n:], s[:n] - self.precision @ self.offset])
        left, scores = A[n:, n:] - A[n:, :n] @ solved[:, :-1], s[n:] - A[n:, :n] @ solved[:, -1]
        imitated = np.diag(left) <= ROUNDING * np.diag(A)[n:]
        left[imitated], left[:, imitated], scores[imitated] = 0.0, 0.0, 0.0
        return left, scores


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """One regressor of the sum."""

    index: int  # of it
    statistic: float  # by which it raises twice the log likelihood, beside those before it
    held_out: float  # the same on units that its size was not fitted to; lost: what it lowers in single ones, summed
    lost: float
    frequency: float  # share of half samples of the units in which it, or one that looks like it, is chosen


def stable_selection(given: UnitInformation, rng: np.random.Generator) -> tuple[Chosen, ...]:
    """Regressors that are chosen from most half samples and raise the likelihood of held-out units, best first."""
    units = len(given.A)
    whole = given.beside_nuisance(np.ones(units, dtype=bool))
    alike = _correlation(whole[0]) > ALIKE
    path = greedy(*whole)
    halves = [_half(units, rng) for _ in range(HALF_SAMPLES)]
    drawn = [[index for index, _ in greedy(*given.beside_nuisance(half))] for half in halves]
    found: list[Chosen] = []
    for number, (index, statistic) in enumerate(path):
        before, after = [item.index for item in found], [*(item.index for item in found), index]
        gains = _held_out(given, after) - _held_out(given, before)
        item = Chosen(
            index=index,
            statistic=statistic,
            held_out=float(gains.sum()),
            lost=float(-np.minimum(gains, 0.0).sum()),
            frequency=float(np.mean([alike[index, some].any() for some in drawn])),
        )
        if item.frequency < STABLE or not _holds(item) or number != len(found):
            break
        found.append(item)
    return tuple(found)


def _holds(item: Chosen) -> bool:
    """Whether held-out units agree: what begins late or acts in few runs gains nothing in others, but loses little."""
    return item.held_out > LEAST_HELD_OUT and item.lost < MOST_LOST * item.held_out


def greedy(A: Array, s: Array) -> list[tuple[int, float]]:
    """Indices and statistics of the regressors that explain most, each beside those before it (matching pursuit)."""
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    A, s, path = A / np.outer(size, size), s / size, list[tuple[int, float]]()
    for _ in range(MOST_TERMS):
        own = np.diag(A)
        statistic = np.where(own > LEAST_OWN_SHARE, s**2 / np.maximum(own, LEAST_OWN_SHARE), 0.0)
        index = int(np.argmax(statistic))
        if statistic[index] < LEAST_STATISTIC:
            break
        path.append((index, float(statistic[index])))
        s = s - A[:, index] * (s[index] / own[index])
        A = A - np.outer(A[:, index], A[index]) / own[index]
    return path


def _held_out(given: UnitInformation, chosen: list[int]) -> Array:
    """(w,) twice the log likelihood gained in each unit by sizes fitted to the others; nuisance effects as well."""
    units, n = len(given.A), len(given.precision)
    keep = [*range(n), *(n + index for index in chosen)]
    A, s = given.A[:, keep][:, :, keep], given.s[:, keep]
    gains, own = np.zeros(units), np.eye(len(keep)) * 0.0
    own[:n, :n] = given.precision
    prior = np.concatenate([given.precision @ given.offset, np.zeros(len(chosen))])
    for fold in range(min(FOLDS, units)):
        test = np.arange(units) % FOLDS == fold
        step = solution_of(A[~test].sum(axis=0) + own, s[~test].sum(axis=0) - prior)
        gains[test] = 2.0 * s[test] @ step - np.einsum("i,wij,j->w", step, A[test], step)
    return gains


def _half(units: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    drawn = np.zeros(units, dtype=bool)
    drawn[rng.permutation(units)[: max(units // 2, 1)]] = True
    return drawn


def _correlation(A: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    return np.asarray(np.abs(A / np.outer(size, size)))


LETTERS = {"u": "X", "v": "Y", "r": "N"}
AHEAD = ("u*u", "u*u*u", "v*v", "r*r", "v*r", "u*v*v", "u*r*r", "u*v*r", "v*v*abs(v)", "r*r*abs(r)")
ASIDE = (
    "v", "r", "u*v", "u*r", "v*abs(v)", "r*abs(r)", "abs(v)*r", "v*abs(r)", "v*v*v", "r*r*r", "v*v*r", "v*r*r",
    "u*u*v", "u*u*r", "u*v*abs(v)", "u*r*abs(r)",
)  # fmt: skip
"""Products of motion that keep their sign when port and starboard are exchanged, and those that change it."""
FACTORS = ("u", "abs(v)", "abs(r)", "u*u", "v*v", "r*r")  # what may change the effect of an input
SAME = 1e-9


def term_dictionary(model: VesselModel, known: Mapping[str, Term]) -> dict[str, Term]:
    """Terms that the model does not have and `known` ones do not name, by name."""
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    rng = np.random.default_rng(0)
    table = {name: rng.standard_normal(24) for name in names}

    def values(text: str) -> Array:
        column = np.asarray(parse_expression(text, signals=names).evaluate(table, NUMPY))
        return np.asarray(column / np.linalg.norm(column))

    taken = [(term.equation, values(term.expression)) for term in (*model.terms, *known.values())]
    found: dict[str, Term] = {}
    for equation in model.outputs:
        for text in (*(AHEAD if equation == "u" else ASIDE), *_of_inputs(model, equation)):
            column = values(text)
            if any(equation == other and abs(abs(column @ old) - 1.0) < SAME for other, old in taken):
                continue
            taken.append((equation, column))
            name = f"{LETTERS[equation]}_more_{len(found) + 1}"
            found[name] = Term(equation, name, text)
    return found


def _of_inputs(model: VesselModel, equation: str) -> list[str]:
    """The model's own terms of inputs with more factors."""
    own = [
        term.expression
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if term.equation == equation and is_thrust(expression, model)
    ]
    return [f"({text})*{factor}" for text in own for factor in (*FACTORS, f"abs({text})")]
