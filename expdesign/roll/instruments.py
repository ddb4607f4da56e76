"""Instruments: the motion that the rudder alone would have caused, without noise and waves.

Black boxes from the rudder to each signal model how it moves sway, yaw and roll. Where a helm answers the ship, the
rudder that was planned takes its place, and the rudder is one of the signals. A box that is fitted to the noise among
which it is used makes instruments that follow this noise, and intervals that are too short; so the record is split into
parts, and each has the boxes that the others were fitted to. Errors of the boxes then cost accuracy, not consistency.

Source: doctoral thesis on grey-box identification of roll with few sensors, algorithm 5.1, step A; J. D. Angrist, G. W.
Imbens and A. B. Krueger, J. Applied Econometrics 14 (1999), 57-67, for instruments fitted elsewhere. The simulation of
the grey-box model that the thesis goes on with is left out: instruments so made were no better (`tests/benchmarks`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.roll.regression import (
    WHITE,
    NoiseModel,
    Rows,
    Spectrum,
    bent,
    build_rows,
    cross_spectra,
    delayed,
    difference,
    flat_spectrum,
    inside,
    length_for,
    noise_model,
    real_products,
    shares_of,
    spectrum,
    transforms,
    without_start,
)
from expdesign.roll.runs import LEFT_OUT_SAMPLES, Case, Run
from expdesign.values import Array

BLACK_BOX = (24, 25)  # orders (past outputs, inputs) of the models from rudder to each signal
FOLDS = 3  # parts of the record, each of which has black boxes that were fitted to the others
LAGS = 4  # of each simulated signal among the instruments
RUDDER_LAGS = 2  # of the rudder's difference
NOISE_ORDER = 12  # of the autoregression in the noise model of a case
REPEATED = 1e-10  # share of variance below which a combination of instruments repeats others
BACK = 2  # periods of roll, over which earlier rudders foresee later ones
LEADS = 8  # to which the rudder is looked at, up to a period of roll later, to see whether it answers


BlackBox = tuple[Array, Array]
"""Numerator and denominator in powers of the delay."""


Fold = tuple[slice, Array]
"""Samples of a part of a run, and (k, q) instruments of the whole run by black boxes not fitted to that part."""


def folds(runs: Sequence[Run]) -> list[list[Fold]]:
    """Folds of each run: whole runs where there are enough of them, else parts of equal length."""
    parts = _parts([len(run.signals) for run in runs])
    sources = [run.source for run in runs]
    sought = 3 if all(run.planned is None for run in runs) else 4
    boxes = [_boxes(sources, [run.signals[:, place] for run in runs], parts) for place in range(sought)]
    return [
        [(part, instrument_columns(_simulated(source, [box[number] for box in boxes]))) for number, part in own]
        for source, own in zip(sources, parts, strict=True)
    ]


def _parts(lengths: Sequence[int]) -> list[list[tuple[int, slice]]]:
    """For each run the numbers of its folds, with their samples."""
    count = FOLDS
    if len(lengths) >= count:
        return [[(place % count, slice(0, length))] for place, length in enumerate(lengths)]
    edges = [np.linspace(0, length, count + 1).astype(int).tolist() for length in lengths]
    return [[(number, slice(own[number], own[number + 1])) for number in range(count)] for own in edges]


def _boxes(
    inputs: Sequence[Array], outputs: Sequence[Array], parts: Sequence[Sequence[tuple[int, slice]]]
) -> list[BlackBox]:
    """For each fold the black box that is fitted to the other folds."""
    triangles: list[list[Array]] = [[] for _ in range(FOLDS)]
    for u, y, own in zip(inputs, outputs, parts, strict=True):
        table = _arx_table(u, y)
        for number, part in own:
            inner = table[part][max(BLACK_BOX) :]  # whose past does not reach into another part
            triangles[number].append(np.asarray(np.linalg.qr(inner, mode="r")))
    return [
        _solved(np.concatenate([R for other, own in enumerate(triangles) if other != number for R in own]))
        for number in range(FOLDS)
    ]


def _arx_table(u: Array, y: Array) -> Array:
    """(k, o + w + 1) past outputs, inputs and the output."""
    past, width = BLACK_BOX
    return np.column_stack([-delayed(y, range(1, past + 1)), delayed(u, range(width)), y])


def _solved(table: Array) -> BlackBox:
    past = BLACK_BOX[0]
    found = np.asarray(np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0], dtype=float)
    return found[past:], inside(np.concatenate([[1.0], found[:past]]))


def _simulated(source: Array, boxes: Sequence[BlackBox]) -> Array:
    """(k, 4) signals as in a run; the source is the rudder where there is no box for it."""
    return np.column_stack([*(scipy.signal.lfilter(*box, source) for box in boxes), source])[:, :4]


def instrument_columns(simulated: Array) -> Array:
    """(k, q) lags of simulated signals (k, 4): the regressors without noise, and some more."""
    roll_rate, *others = np.column_stack([simulated[:, :1], difference(simulated[:, 1:])]).T
    lags = [LAGS, LAGS, RUDDER_LAGS]
    parts = [delayed(signal, range(count)) for signal, count in zip(others, lags, strict=True)]
    return np.column_stack([delayed(roll_rate, range(1, 1 + LAGS)), *parts, bent(roll_rate)])


def stitched(own: Sequence[Fold], columns: Sequence[Array], noise: NoiseModel) -> Array:
    """(n, q) rows of each fold's part of a run from its own columns (n, q)."""
    first = LEFT_OUT_SAMPLES
    parts = [rows[max(part.start - first, 0) : part.stop - first] for (part, _), rows in zip(own, columns, strict=True)]
    return without_start(np.concatenate(parts), noise)


@dataclass(frozen=True, eq=False)
class Weighted:
    """A case's equations after projection on the instruments: residual = top - slope c, in standard deviations."""

    rows: tuple[Rows, ...]  # of each run
    basis: tuple[Array, ...]  # (n, q) of each run, whose sum of products with the noise has unit covariance
    # top, slope: sums of its products with y and X, (q,) and (q, 5)
    top: Array
    slope: Array
    effects: Array  # (q, 3, 6) the same with what effects change of y and X
    noise: NoiseModel  # that whitened the rows
    # (n, 24) what instruments do not explain of y, X and `effects` of each run, and (6, 6, q, q) covariances of the
    # sums of its products in y and X, where the covariance of the residuals follows the coefficients; none where it is
    # as at those of the weights
    hidden: tuple[Array, ...]
    spread: Array | None


def weighted_equations(
    case: Case, instruments: Sequence[Sequence[Fold]] | None, values: Array | None, *, follows: bool = False
) -> Weighted:
    """Equations for sampled coefficients (5,), weighted by the noise at given ones, or as if it were white.

    Source: E. J. Hannan, in Time Series Analysis (M. Rosenblatt, ed., 1963), 17-37, for the weights.
    """
    plain = tuple(build_rows(run, WHITE) for run in case.runs)
    if values is None:
        model, rows, left = WHITE, plain, flat_spectrum([one.y for one in plain])
    elif instruments is None:
        model, rows, left = WHITE, plain, flat_spectrum([one.residuals(values) for one in plain])
    else:
        model = noise_model([one.residuals(values) for one in plain], values[:2], NOISE_ORDER)
        rows = tuple(build_rows(run, model) for run in case.runs)
        left = spectrum([one.residuals(values) for one in rows])
    hidden: tuple[Array, ...] = ()
    if instruments is None:
        basis = _basis([one.X for one in rows], left)
    else:
        # through 1 / spectrum are the weights of least variance; the equation is whitened too, as instruments that end
        # suddenly would pick up the noise of high frequencies, which is many times stronger
        white = [[model.whitened(columns)[LEFT_OUT_SAMPLES:] for _, columns in own] for own in instruments]
        pairs = list(zip(instruments, white, strict=True))
        basis = _basis([stitched(own, [left.divided(part) for part in one], model) for own, one in pairs], left)
        hidden = _hidden(rows, [stitched(own, one, model) for own, one in pairs]) if follows else ()
    parts = list(zip(basis, rows, strict=True))
    return Weighted(
        rows,
        basis,
        np.sum([B.T @ one.y for B, one in parts], axis=0),
        np.sum([B.T @ one.X for B, one in parts], axis=0),
        np.sum([np.einsum("nq,nij->qij", B, one.effects) for B, one in parts], axis=0),
        model,
        hidden,
        spread_of(basis, [one[:, :6] for one in hidden]) if follows else None,
    )


def _hidden(rows: Sequence[Rows], instruments: Sequence[Array]) -> tuple[Array, ...]:
    """(n, 24) parts of y, the regressors and effects of each run that instruments (n, q) do not explain."""
    tables = [np.column_stack([one.y, one.X, one.effects.reshape(len(one.y), -1)]) for one in rows]
    columns = _combinations(instruments, np.sum([Z.T @ Z for Z in instruments], axis=0))
    gains = np.sum([Z.T @ table for Z, table in zip(columns, tables, strict=True)], axis=0)
    return tuple(table - Z @ gains for table, Z in zip(tables, columns, strict=True))


def spread_of(basis: Sequence[Array], hidden: Sequence[Array], rows: int | None = None) -> Array:
    """(r, c, q, q) covariances of the sums of products of the basis with noise (n, c) of each run, of its first r."""
    length = length_for(hidden)
    power = cross_spectra(hidden, length)
    power *= shares_of(power.shape[2], length)
    count, q = len(power), basis[0].shape[1]
    rows = count if rows is None else rows
    seen = [transforms(B, length) for B in basis]
    found = np.empty((rows, count, q, q))
    for i in range(rows):
        for j in range(i, count):
            found[i, j] = sum(real_products(F, power[i, j] * F) for F in seen)
            if j < rows:
                found[j, i] = found[i, j].T
    return found


def _basis(columns: Sequence[Array], noise: Spectrum) -> tuple[Array, ...]:
    """(n, q) combinations of the columns of each run whose sums of products with the noise have unit covariance."""
    return _combinations(columns, noise.covariance(columns))


def _combinations(columns: Sequence[Array], power: Array) -> tuple[Array, ...]:
    """(n, q) combinations of the columns (n, c) of each run that a covariance (c, c) makes one, without repetitions."""
    there = np.diag(power) > 0
    size = np.sqrt(np.diag(power)[there])
    powers, axes = np.linalg.eigh(power[np.ix_(there, there)] / np.outer(size, size))
    kept = powers > REPEATED * powers[-1:]
    by = (axes[:, kept] / np.sqrt(powers[kept])) / size[:, None]
    return tuple(Z[:, there] @ by for Z in columns)


# Whether the rudder answers the moment that rolls the ship, as then no instrument comes from the rudder.
#
# Noise of the equation is independent of a rudder that was set beforehand, at earlier and at later times. A rudder that
# answers roll correlates with the noise of somewhat earlier times:
#
#     h = sum over cases of W' (y - X c(theta)),        W: changes of the rudder some time later, weighed as instruments
#
# With the covariance of h, in which that of theta has its part, h' cov(h)^-1 h is distributed as chi-square if nothing
# answers. Changes of the rudder are used, as in the equation: the rudder itself would weigh frequency zero most, where
# the noise is zero and its spectrum cannot be estimated. What the model misses of the ship follows the rudder of
# earlier times, with which later rudders correlate too: only that part of them is used that earlier rudders and the
# instruments do not predict, and moments count in the size that those of the instruments are left with.
#
# Source: L. Ljung, System Identification (1999), 16.6, for residuals that go with later inputs; L. P. Hansen,
# Econometrica 50 (1982), 1029-1054, for the covariance of moments at an estimate.


def chance_of_answers(
    cases: Sequence[Case],
    weighted: Sequence[Weighted],
    residuals: Sequence[Sequence[Array]],
    jacobians: Sequence[Array],
    sensed: Array,
    periods: Sequence[float],
    surprise: float,
) -> float:
    """Chance that a rudder without feedback correlates with the noise as much as this one, 0 to 1.

    Args:
        cases, weighted: as the estimate has them.
        residuals: (n,) of each run of each case, whitened.
        jacobians: (5, p) of the sampled coefficients of each case.
        sensed: (q, p) derivatives of the weighted residuals.
        periods: of roll in each case [samples].
        surprise: least sum of squares of the instruments' moments over its expected value.
    """
    spectra = [spectrum(own) for own in residuals]
    columns = [_later(*one) for one in zip(cases, weighted, spectra, periods, strict=True)]
    moments, moved = np.zeros(LEADS), np.zeros((LEADS, sensed.shape[1]))
    for part, own, by, jacobian in zip(weighted, columns, residuals, jacobians, strict=True):
        for W, rows, noise in zip(own, part.rows, by, strict=True):
            moments += W.T @ noise
            moved += W.T @ rows.X @ jacobian
    power = _covariance(weighted, columns, spectra, moved @ np.linalg.pinv(sensed, rcond=1e-12))
    size = np.sqrt(np.diag(power))
    if not (size > 0).all():
        return 1.0
    powers, axes = np.linalg.eigh(power / np.outer(size, size))
    kept = powers > REPEATED * powers[-1]
    seen = axes[:, kept].T @ (moments / size) / np.sqrt(powers[kept])
    # spectra of the residuals that are weighed by them come out too small, as in the covariance of the estimate
    short = (1.0 - 2.0 / min(one.freedom for one in spectra)) ** 2
    return float(scipy.special.chdtrc(np.count_nonzero(kept), short * seen @ seen / max(1.0, surprise)))


def _later(case: Case, part: Weighted, left: Spectrum, period: float) -> list[Array]:
    """(n, l) rudder changes of each run up to a period of roll later, without what is foreseen of them.

    The last one repeats past a run's end.
    """
    first = LEFT_OUT_SAMPLES
    ahead = np.rint(period / LEADS * np.arange(1, LEADS + 1)).astype(int)
    back = np.unique(np.rint(period / LEADS * np.arange(BACK * LEADS + 1)).astype(int))
    later, before = [], []
    for run, basis in zip(case.runs, part.basis, strict=True):
        rudder = difference(run.source)
        places = np.minimum(np.arange(len(rudder))[:, None] + ahead, len(rudder) - 1)
        both = np.column_stack([rudder[places], delayed(rudder, back.tolist())])
        weighed = without_start(left.divided(part.noise.whitened(both)[first:]), part.noise)
        later.append(weighed[:, :LEADS])
        before.append(np.column_stack([basis, weighed[:, LEADS:]]))
    size = np.maximum(np.linalg.norm(np.concatenate(before), axis=0), 1e-300)
    gains = np.linalg.lstsq(np.concatenate(before) / size, np.concatenate(later), rcond=1e-10)[0]
    return [W - known / size @ gains for W, known in zip(later, before, strict=True)]


def _covariance(
    weighted: Sequence[Weighted], columns: Sequence[Sequence[Array]], spectra: Sequence[Spectrum], inverse: Array
) -> Array:
    """(l, l) covariance of the moments at the estimate, whose errors move them by `inverse` (l, q) of the residuals."""
    result, first = np.zeros((len(inverse),) * 2), 0
    for part, own, left in zip(weighted, columns, spectra, strict=True):
        by = inverse[:, first : first + len(part.top)].T
        result += left.covariance([W + basis @ by for W, basis in zip(own, part.basis, strict=True)])
        first += len(part.top)
    return result
