"""The covariance of an estimate, from its instruments and the noise in the residuals.

    P = sum over k, l of W(k) cov(eps(k), eps(l)) W(l)^T,    W = G^-1 Z

Residuals of one-step predictors from noisy data are coloured: noise enters at k and, through Phi, at k - 1, where it
nearly cancels; disturbances may last. By choice,

- "components", the default: noise is a sum of white, sensor and slow parts, whose variances are estimated, and P is
  exact for them, for one long batch as for many short ones, see `components`. Standard deviations are multiplied by
  what Student's t has more than the normal distribution where variances are known from few data: a disturbance that
  lasts 100 s is seen 20 times in 2000 s. Both assumptions are tested. Where the variance changes with the instruments
  (White's test, 1 % for all parameters of an equation together), standard deviations are multiplied by what White's
  factor says of the whitened residuals. Where the parts do not fit the periodogram (Bartlett's test, 1 %), they are
  those of "hac" where these are larger, and a warning tells.
- "hac": robust to changing variance and to any correlation in time that a kernel with few lags sees after the residuals
  are made white, see `whitening`. Disturbances that last for tens of samples are seen in part.
- "kernel": robust to both too, by the kernel alone; "hc0" and "hc1" are robust to changing variance only. These three
  are as in econometric software.

Source: L. P. Hansen, Econometrica 50 (1982), 1029-1054; H. White, Econometrica 48 (1980), 817-838.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.estimation.noise import (
    SPECTRUM_MISFIT,
    WHITENING_PASSES,
    Components,
    Fitted,
    Stretch,
    Timeline,
    automatic_lags,
    fit_components,
    long_run_covariance,
    lost_share,
    score_covariance,
    stretches,
    timeline,
    white_parts,
)
from expdesign.estimation.regression import Integers, Regression
from expdesign.estimation.solve.null_space import UNSEEN
from expdesign.estimation.solve.systems import Part, Weighting
from expdesign.values import Array

LEAST_FREEDOM = 2.0  # degrees of freedom that a variance is taken to have at least
WHITE_TEST_LEVEL = 0.01  # of White's test


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How uncertain an estimate is."""

    covariance: Array  # (p, p)
    lags: int  # last lag that a kernel counts
    warnings: tuple[str, ...] = ()  # one sentence each
    between_runs: Array | float = 0.0  # (p, p) what of the covariance is by how runs differ; 0 where they do not


def covariance_of(regression: Regression, weighting: Weighting, parts: Sequence[Part], residuals: Array) -> Uncertainty:
    """The covariance that a weighting asks for, of the estimate from parts with residuals (k, n)."""
    if regression.chosen is not None:
        return _by_part(regression, weighting, parts, residuals)
    p, kind = len(regression.parameters), weighting.covariance
    factor = 1.0 if kind == "hc0" else residuals.size / max(1, residuals.size - p)
    if kind == "components":
        return _by_components(regression, weighting, parts, residuals, factor)
    P, lags = _summed(regression, weighting, parts, residuals, passes=WHITENING_PASSES if kind == "hac" else 0)
    return Uncertainty(factor * P, lags)


def _by_part(regression: Regression, weighting: Weighting, parts: Sequence[Part], residuals: Array) -> Uncertainty:
    """Each part by its own rows; parts are as correlated as their long-run scores on the common timeline are.

    With C the covariance of all scores, and C_o, P_o that of a part by scores and by its own rows, it is D C D^T with
    the blocks D_o = P_o^(1/2) C_o^(-1/2), which has the blocks P_o and is positive semidefinite.
    """
    scores, D = np.zeros((len(regression), len(regression.parameters))), np.zeros((len(regression.parameters),) * 2)
    found = []
    for part in parts:
        rows, columns, outputs = part.system.rows, part.system.columns, part.system.outputs
        own = regression.at(rows)
        alone = Regression(
            parameters=part.system.names,
            Phi=part.system.varying,
            y=part.system.y,
            batch=own.batch,
            step=own.step,
            outputs=tuple(regression.outputs[index] for index in outputs),
            heading=own.heading,
        )
        left = residuals[rows][:, outputs]
        system = replace(part.system, columns=np.arange(len(columns)), outputs=np.arange(len(outputs)))
        found.append(covariance_of(alone, weighting, [replace(part, system=system)], left))
        scores[np.ix_(np.arange(len(scores))[rows], columns)] = np.einsum("knp,kn->kp", part.W, left)
    batch, step = regression.batch_of, regression.step_of
    lags = automatic_lags(scores, batch, step, kernel=weighting.kernel)
    C = long_run_covariance(scores, batch, step, lags=lags, kernel=weighting.kernel)
    for part, own_found in zip(parts, found, strict=True):
        place = np.ix_(part.system.columns, part.system.columns)
        D[place] = _root(own_found.covariance) @ _root(C[place], inverse=True)
    P = D @ C @ D.T
    for part, own_found in zip(parts, found, strict=True):
        P[np.ix_(part.system.columns, part.system.columns)] = own_found.covariance
    warnings = tuple(dict.fromkeys(note for item in found for note in item.warnings))
    return Uncertainty(P, max((item.lags for item in found), default=0), warnings)


def _root(P: Array, *, inverse: bool = False) -> Array:
    """(p, p) symmetric square root, or its inverse, of a covariance matrix of quantities of any size."""
    size = np.sqrt(np.diag(P))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    kept = values > UNSEEN * values[-1]
    roots = np.where(kept, values, 1.0) ** (-0.5 if inverse else 0.5) * kept
    root = (vectors * roots) @ vectors.T
    return np.asarray(root / size if inverse else size[:, None] * root)


@dataclass(frozen=True, eq=False)
class _Terms:
    """Terms whose sum is the error of a part's estimate."""

    when: Timeline  # where the rows stand
    # zeta, n: (t, n, p) and (t, n) weights and residuals, perhaps whitened
    zeta: Array
    n: Array

    def influences(self) -> Array:
        """(t, p) contribution of each term."""
        return np.asarray(np.einsum("knp,kn->kp", self.zeta, self.n))

    def white_factor(self) -> Array:
        """(p,) factors by which heteroscedastic noise clearly enlarges the variance of parameters; 1 elsewhere."""
        even, changing, chance = np.zeros((3, self.zeta.shape[2]))
        for output in range(self.n.shape[1]):
            squares = self.n[self.when.place, output] ** 2
            level = float(squares.mean())
            shares = self.zeta[self.when.place, output] ** 2
            even += level * shares.sum(axis=0)
            changing += squares @ shares
            chance += ((squares - level) ** 2).mean() * ((shares - shares.mean(axis=0)) ** 2).sum(axis=0)
        clear = changing - even > -scipy.special.ndtri(WHITE_TEST_LEVEL / len(even)) * np.sqrt(chance)
        return np.where(clear, np.divide(changing, even, out=np.ones_like(even), where=even > 0), 1.0)


def _terms(part: Part, when: Timeline, residuals: Array, *, passes: int) -> _Terms:
    return _Terms(when, *white_parts(part.W, residuals[:, part.system.outputs], when, passes=passes))


def changing_variance(W: Array, residuals: Array, batch: Integers, step: Integers) -> Array:
    """Factors (p,) of the standard deviations of sum W eps for variances that change with W; 1 unless clear.

    Args:
        W: (k, n, p).
        residuals: (k, n) eps.
        batch, step: (k,) batch number and sample number within the batch.
    """
    when = timeline(batch, step)
    return np.sqrt(_Terms(when, *white_parts(W, residuals, when, passes=1)).white_factor())


def _summed(
    regression: Regression, weighting: Weighting, parts: Sequence[Part], residuals: Array, *, passes: int
) -> tuple[Array, int]:
    """(p, p) long-run covariance of the terms of all parts, and the last lag counted."""
    when, kind = timeline(regression.batch_of, regression.step_of), weighting.covariance
    scores = np.zeros((len(when.batch), len(regression.parameters)))
    lags = 0 if weighting.lags is None or kind in ("hc0", "hc1") else weighting.lags
    for part in parts:
        own = _terms(part, when, residuals, passes=passes).influences()
        scores[:, part.system.columns] = own
        if weighting.lags is None and kind not in ("hc0", "hc1"):
            lags = max(lags, automatic_lags(own, when.batch, when.step, kernel=weighting.kernel))
    P = long_run_covariance(scores, when.batch, when.step, lags=lags, kernel=weighting.kernel)
    if kind in ("hac", "components"):
        P = P / (1.0 - lost_share(len(regression), lags=lags, kernel=weighting.kernel))
    return P, lags


def _by_components(
    regression: Regression, weighting: Weighting, parts: Sequence[Part], residuals: Array, factor: float
) -> Uncertainty:
    places = stretches(regression.batch_of, regression.step_of, regression.heading)
    by, columns = _taken(regression, parts)
    fitted = fit_components(residuals, places, by)
    P, widened = _exact(by, columns, residuals, fitted, places, len(regression.parameters))
    scale, odd = np.ones((2, len(P)))
    when = timeline(regression.batch_of, regression.step_of)
    for part in parts:
        system = part.system
        scale[system.columns] = np.sqrt(_terms(part, when, residuals, passes=1).white_factor())
        odd[system.columns] = max(fitted[output].misfit for output in system.outputs)
    scale *= widened
    P *= np.outer(scale, scale)
    doubtful = odd > SPECTRUM_MISFIT
    if not doubtful.any():
        return Uncertainty(P, 0)
    robust, lags = _summed(regression, weighting, parts, residuals, passes=WHITENING_PASSES)
    own, other = np.diag(P), factor * np.diag(robust)
    larger = doubtful & (other > own) & (own > 0)
    scale = np.sqrt(np.divide(other, own, out=np.ones_like(own), where=larger))
    misfit = np.array([item.misfit for item in fitted])
    notes = (misfit_note(regression.outputs, misfit),) if (misfit > SPECTRUM_MISFIT).any() else ()
    return Uncertainty(P * np.outer(scale, scale), lags, notes)


def misfit_note(outputs: Sequence[str], misfit: Array) -> str:
    """A warning that names the outputs with a large misfit (n,)."""
    names = [name for name, own in zip(outputs, misfit, strict=True) if own > SPECTRUM_MISFIT]
    return (
        f"Sensor noise and slow disturbances do not explain the colour of the residuals of {', '.join(names)}. The "
        "standard deviations are the larger of two estimates, and less reliable than usual."
    )


def _taken(regression: Regression, parts: Sequence[Part]) -> tuple[list[Fitted], list[Integers]]:
    """What the parameters of each output take from its noise, and their columns."""
    by, columns = [], []
    for output in range(len(regression.outputs)):
        own = next((part for part in parts if output in part.system.outputs), None)
        if own is None:
            by.append(Fitted(*np.zeros((2, len(regression), 0))))
            columns.append(np.zeros(0, dtype=np.int64))
            continue
        place = int(np.flatnonzero(own.system.outputs == output)[0])
        by.append(Fitted(own.system.varying[:, place], own.W[:, place]))
        columns.append(own.system.columns)
    return by, columns


def _exact(
    by: Sequence[Fitted],
    columns: Sequence[Integers],
    residuals: Array,
    fitted: Sequence[Components],
    places: Sequence[Stretch],
    p: int,
) -> tuple[Array, Array]:
    """(p, p) covariance of an estimate under noise of these parts, and (p,) factors of its standard deviations."""
    P, doubt = np.zeros((p, p)), np.zeros(p)
    blocks, doubts = score_covariance([item.W for item in by], residuals, fitted, places)
    for row, line, own in zip(columns, blocks, doubts, strict=True):
        doubt[row] += own
        for column, block in zip(columns, line, strict=True):
            P[np.ix_(row, column)] += block
    return P, widening(np.diag(P), doubt)


def widening(variance: Array, doubt: Array) -> Array:
    """Factors (p,) by which standard deviations grow, so that 1.96 of them still hold 95 %: Student's t over normal.

    A variance that is a sum of estimated ones has 2 v^2 / var(v) degrees of freedom, whatever spreads it.

    Args:
        variance: (p,) v.
        doubt: (p,) var(v).

    Source: F. E. Satterthwaite, Biometrics Bulletin 2 (1946), 110-114.
    """
    freedom = np.divide(2.0 * variance**2, doubt, out=np.full(len(doubt), np.inf), where=doubt > 0)
    return np.asarray(scipy.special.stdtrit(np.maximum(freedom, LEAST_FREEDOM), 0.975) / scipy.special.ndtri(0.975))
