"""Probabilities that a test of the diagnosis finds an effect, and that it comes before other causes.

A score test and a likelihood ratio test of k numbers are, with an effect of size delta, noncentral chi-squared with
noncentrality delta' (I_cc - I_cp I_pp^-1 I_pc) delta, where p are the nuisance parameters with their prior.

Source: A. Wald, Transactions of the American Mathematical Society 54 (1943), 426-482.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.fit import FOLDS, HeldOut, held_out_gain
from expdesign.diagnosis.select import SELECTION_TUNING, ScoreTest, shows_for_certain, simulates_better
from expdesign.foresight.information import SimulatedUnits, beside_nuisance
from expdesign.own_units import pseudo_inverse_of, solution_of
from expdesign.values import Array

DRAWS = 2000  # of score vectors, for the probability that one cause comes before another
HELD_OUT_DRAWS = 60  # of trials, for the share in which held-out runs show what the test accepts
SHAPES = ("roll:period", "roll:damping")  # fixed effects of a candidate that its fit estimates too
TINY = 1e-300  # least squared error that has a logarithm


def level_of(multiplicity: float) -> float:
    """Largest p-value of one candidate's test that a diagnosis accepts, its many tests counted."""
    return -math.expm1(math.log1p(-SELECTION_TUNING.accepted_p_value) / max(multiplicity, 1.0))


def power(noncentrality: Array | float, freedom: int, level: float) -> Array:
    """Probability that a chi-squared test rejects; the level where nothing is hidden.

    Args:
        freedom: numbers tested at once.
    """
    limit = float(scipy.special.chdtri(freedom, level))
    hidden = np.maximum(np.asarray(noncentrality, dtype=float), 0.0)
    found = scipy.stats.ncx2.sf(limit, freedom, np.maximum(hidden, 1e-12))
    return np.where(hidden > 0.0, np.clip(np.nan_to_num(found, nan=1.0), level, 1.0), level)


def needed_noncentrality(wanted: float, freedom: int, level: float) -> float:
    """The least noncentrality of a test with a power."""
    if wanted <= level:
        return 0.0
    limit = float(scipy.special.chdtri(freedom, level))
    high = 4.0 * limit + 50.0
    return float(scipy.optimize.brentq(lambda value: float(power(value, freedom, level)) - wanted, 0.0, high))


def freedom_of(candidate: Candidate) -> int:
    """Numbers of the likelihood ratio test that a cause is accepted by."""
    return max(1, len(_estimated(candidate)))


def price_of(candidate: Candidate) -> float:
    """What the numbers of a candidate cost where causes are ranked."""
    return SELECTION_TUNING.price * (len(_estimated(candidate)) + (candidate.grid is not None))


def _estimated(candidate: Candidate) -> list[str]:
    searched = None if candidate.grid is None else candidate.grid[0]
    keys = [*candidate.free, *(key for key in SHAPES if key in candidate.fixed)]
    return [key for key in keys if key != searched]


@dataclass(frozen=True, kw_only=True, eq=False)
class Rivals:
    """All candidates of a catalogue, and how their scores scatter where nothing is hidden."""

    tests: tuple[ScoreTest, ...]  # tested candidates
    # (m, w) of scores to independent numbers, those of each candidate side by side; parts: (t,) their beginnings
    whitening: Array
    parts: NDArray[np.int64]
    noise: Array  # (n, m) drawn scores; white: (n, w) the same whitened
    white: Array

    @property
    def causes(self) -> tuple[str, ...]:
        """Cause of each candidate."""
        return tuple(test.candidate.cause for test in self.tests)


def rivals_of(
    tests: Sequence[ScoreTest], rows: Sequence[NDArray[np.int64]], A: Array, rng: np.random.Generator
) -> Rivals:
    """Draw scores of all candidates, and of other effects with them.

    Args:
        tests: of t candidates.
        rows: their rows in `A`.
        A: (m, m) information beside nuisance, of effects that are no candidates too.
    """
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    blocks, parts, columns = [], [], 0
    for index in rows:
        values, vectors = np.linalg.eigh(A[np.ix_(index, index)] / np.outer(size[index], size[index]))
        root = vectors / np.sqrt(np.maximum(values, 1e-12)) / size[index][:, None]
        blocks.append((index, root))
        parts.append(columns)
        columns += len(index)
    whitening = np.zeros((len(A), columns))
    for (index, root), start in zip(blocks, parts, strict=True):
        whitening[index, start : start + root.shape[1]] = root
    values, vectors = np.linalg.eigh((A + A.T) / 2.0 / np.outer(size, size))
    spread = (vectors * np.sqrt(np.maximum(values, 0.0))).T * size
    drawn = rng.standard_normal((DRAWS, len(A))) @ spread
    return Rivals(
        tests=tuple(tests),
        whitening=whitening,
        parts=np.array(parts),
        noise=drawn,
        white=drawn @ whitening,
    )


def gains(rivals: Rivals, shift: Array) -> Array:
    """(n, t) likelihood gain of every candidate in every draw, with an effect hidden.

    Args:
        shift: (m,) expected scores by the hidden effect: its column of the information.
    """
    squares = (rivals.white + shift @ rivals.whitening) ** 2
    return np.asarray(np.add.reduceat(squares, rivals.parts, axis=1))


def share_shown(
    units: SimulatedUnits, rows: NDArray[np.int64], mixture: Array, limit: float, rng: np.random.Generator
) -> float:
    """Share of trials with an accepted test in which held-out units show the effect too, as a diagnosis asks for.

    Nuisance and scores are drawn. Effects are estimated without each fold of the units, and the errors of simulating
    these follow from the sensitivities. Where the test accepts nothing, trials with the largest statistics count.

    Args:
        units: of the trial.
        rows: of the effect's d numbers among the m.
        mixture: (d,) of them that is hidden.
        limit: of the statistic, from which on the test accepts.
    """
    c = len(units.precision)
    kept = np.concatenate([np.arange(c), c + rows])
    A = units.information[:, kept[:, None], kept]
    count, prior, every = len(A), np.zeros((len(kept), len(kept))), A.sum(axis=0)
    prior[:c, :c] = units.precision
    root, whole = _root(A), beside_nuisance(every, units.precision)
    of_blocks = _root(units.predicted[:, kept[:, None], kept] / units.blocks)
    spread = np.linalg.pinv(_root(units.precision).T)
    drawn: list[tuple[float, tuple[Array, Array, Array, int]]] = []
    for number in range(HELD_OUT_DRAWS):
        truth = np.concatenate([spread @ rng.standard_normal(c), mixture])
        score = A @ truth + np.einsum("kij,kj->ki", root, rng.standard_normal((count, len(kept))))
        total = score.sum(axis=0)
        left = total[c:] - every[c:, :c] @ solution_of((every + prior)[:c, :c], total[:c])
        statistic = float(left @ solution_of(whole, left))
        blocks = np.einsum("kij,kbj->kbi", of_blocks, rng.standard_normal((count, units.blocks, len(kept))))
        drawn.append((statistic, (truth, score, blocks, number % len(units.squared_error))))
    drawn.sort(key=lambda item: -item[0])
    accepted = [item for item in drawn if item[0] > limit] or drawn[: max(1, len(drawn) // 4)]
    trials = _Trials(*(np.stack(parts) for parts in zip(*(trial for _, trial in accepted), strict=True)))
    return float(np.mean(_are_shown(units, kept, trials, prior, A)))


class _Trials(NamedTuple):
    """Drawn trials."""

    truth: Array  # (n, r) numbers
    score: Array  # (n, k, r) of each unit
    noise: Array  # (n, k, b, r) of the scores of blocks of each unit, when its samples are predicted
    record: NDArray[np.int64]  # (n,) whose errors are those of its units


def _are_shown(units: SimulatedUnits, kept: NDArray[np.int64], trials: _Trials, prior: Array, A: Array) -> list[bool]:
    """Whether held-out units show the effect, for each trial; without it the stated or the fitted model counts."""
    c, deviation = len(units.precision), units.squared_deviation[trials.record]
    off = [_errors_of_folds(trials, slice(free), prior, A) for free in (0, c, len(kept))]
    squared = [_simulated(units, kept, trials, item) for item in off]
    whitened = [_predicted(units, kept, trials, item) for item in off]
    found = []
    for n in range(len(trials.truth)):
        stated, fitted, whole = (HeldOut(squared_error=item[n], squared_deviation=deviation[n]) for item in squared)
        as_stated = stated.mean_fit > fitted.mean_fit
        ratios = np.log(whitened[2][n] / whitened[0 if as_stated else 1][n])
        found.append(_is_shown(stated if as_stated else fitted, whole, fitted, ratios.ravel()))
    return found


def _errors_of_folds(trials: _Trials, free: slice, prior: Array, A: Array) -> Array:
    """(n, k, r) errors of the numbers, of which the free ones are estimated without the fold of each unit."""
    count = len(A)
    off = np.repeat(trials.truth[:, None], count, axis=1)
    for fold in range(min(FOLDS, count)):
        test = np.arange(count) % FOLDS == fold
        own = (A[~test].sum(axis=0) + prior)[free, free]
        found = pseudo_inverse_of(own) @ trials.score[:, ~test, free].sum(axis=1).T
        off[:, test, free] -= found.T[:, None]
    return off


def _simulated(units: SimulatedUnits, kept: NDArray[np.int64], trials: _Trials, off: Array) -> Array:
    """(n, k, o) squared errors of simulating each unit and output with errors (n, k, r) of the numbers."""
    products = units.products[:, :, kept[:, None], kept]
    squared = (
        units.squared_error[trials.record]
        + 2.0 * np.einsum("nkoc,nkc->nko", units.with_error[trials.record][..., kept], off)
        + np.einsum("nkc,kocd,nkd->nko", off, products, off, optimize=True)
    )
    return np.asarray(np.maximum(squared, 0.0))


def _predicted(units: SimulatedUnits, kept: NDArray[np.int64], trials: _Trials, off: Array) -> Array:
    """(n, k, b) whitened squared errors of predicting the blocks of each unit, likewise."""
    each = units.predicted[:, kept[:, None], kept] / units.blocks
    whitened = (
        (units.samples / units.blocks)[:, None]
        + 2.0 * np.einsum("nkbc,nkc->nkb", trials.noise, off)
        + np.einsum("nkc,kcd,nkd->nk", off, each, off, optimize=True)[..., None]
    )
    return np.asarray(np.maximum(whitened, TINY))


def _is_shown(before: HeldOut, after: HeldOut, re_estimated: HeldOut, ratios: Array) -> bool:
    """Whether held-out units show a first cause, as a diagnosis asks for.

    Args:
        before: errors of simulating them without it; after: with it; re_estimated: without it, parameters fitted.
        ratios: (k b,) logarithms of the squared errors of predicting the blocks of each, with it over without.
    """
    gained = held_out_gain(before, after, 0)
    better = simulates_better(before, after, gained)
    if shows_for_certain(before, after, 0):
        return better
    scatter = float(ratios.std(ddof=1)) if len(ratios) > 1 else np.inf
    middle, error = float(ratios.mean()), 1.96 * scatter / np.sqrt(len(ratios))
    predicts, share = middle + error < 0.0, 1.0 - np.exp(middle)
    if predicts and share >= SELECTION_TUNING.least_predicted and gained[0] >= 0.0:
        return True
    shows = (predicts and share >= SELECTION_TUNING.least_reduction) or shows_for_certain(re_estimated, after, 0)
    return bool(better and shows)


def _root(A: Array) -> Array:
    """(..., n, n) whose product with its transpose is A."""
    values, vectors = np.linalg.eigh(A)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def imitation(rivals: Rivals, shift: Array, own: float) -> Array:
    """(t,) cosine between the hidden effect and the best of each candidate, beside nuisance.

    Args:
        shift: (m,) as in `gains`.
        own: noncentrality of the hidden effect.
    """
    explained = np.add.reduceat((shift @ rivals.whitening) ** 2, rivals.parts)
    return np.asarray(np.sqrt(np.clip(explained / max(own, 1e-300), 0.0, 1.0)))
