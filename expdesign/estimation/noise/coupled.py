"""The noise behind errors of a simulation: of sensors, and of forces that the linearised ship carries on and couples.

An error r of simulated velocities obeys, with the derivatives A of the next state by the state,

    r(k + 1) = A(k) r(k) + eps(k),    eps(k) = d(k) + e(k + 1) - A(k) e(k)

with white sensor noise e, and forces d of white and slow parts as in `components`. Unlike there, the sensor noise of
one output stands in the eps of the others: the noise of a yaw rate is in the sway that is expected next. Forces may be
small beside that, so the variances of all outputs are estimated together, by Whittle's likelihood with matrices,

    sum over frequencies of log det S + tr(S^-1 I)

where I are the periodograms of all outputs and between them, and S their expectations. One correlation for each pair of
outputs, shared by all parts of their forces, is estimated with them.

Source: P. Whittle, Journal of the Royal Statistical Society B 15 (1953), 125-139, for several series.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.estimation.noise.components import (
    SENSOR,
    SPECTRUM_ITERATIONS,
    WHITE,
    Fitted,
    Slow,
    Stretch,
    alternatives,
    covariance_along,
    directions_of,
    in_bins,
    left_shapes,
    misfit_of,
    slow_parts,
)
from expdesign.estimation.noise.covariance import as_correlation, sums_of_parts
from expdesign.estimation.regression import Integers
from expdesign.values import Array


@dataclass(frozen=True, eq=False)
class Coupled:
    """The noise of n outputs."""

    variances: Array  # (n, 2 + m) white force, sensor, slow forces
    slow: tuple[Slow, ...]  # the m slow parts
    common: Array  # (n, n) correlation of forces
    misfit: Array  # (n,) Bartlett's statistics
    uncertainty: Array  # (n (2 + m), n (2 + m)) covariance of the variances; see `directions_of`


def fit_coupled(eps: Array, A: Array, parts: Sequence[Stretch], by: Sequence[Fitted]) -> Coupled:
    """The noise in one-step residuals.

    Args:
        eps: (k, n) residuals.
        A: (k, n, n) derivatives of the next state by the state.
        parts: `stretches`.
        by: what the estimate took from the forces of each output.
    """
    power = (eps**2).mean(axis=0)
    unit = np.sqrt(np.where(power > 0, power, 1.0))
    slow = slow_parts(parts)
    spectra = _spectra(eps / unit, A * unit / unit[:, None], parts, left_shapes(parts, slow, by))
    n, size = len(unit), 2 + len(slow)
    best, common, cost = np.outer(np.ones(n), np.eye(size)[WHITE]), np.eye(n), np.inf
    for places, penalty in alternatives(slow, len(spectra.frequency)) if spectra.fits else ():
        found, correlation, own_cost = spectra.most_likely(places)
        own_cost += penalty * int(found[:, SENSOR + 1 :].any(axis=1).sum())
        if own_cost < cost:
            best, common, cost = found, correlation, own_cost
    scale = np.repeat(power, size)
    return Coupled(
        variances=best * power[:, None],
        slow=slow,
        common=common,
        misfit=spectra.misfit(best),
        uncertainty=spectra.uncertainty(best, common, slow) * np.outer(scale, scale),
    )


def coupled_covariance(W: Array, sensed: Array, found: Coupled, parts: Sequence[Stretch]) -> tuple[Array, Array]:
    """The covariance (p, p) of an estimate, and (p,) the variance of each of its estimated variances.

    Args:
        W: (k, n, p) by which forces enter the estimate.
        sensed: (n, p, p) covariances that sensors with unit variance give.
        parts: `stretches`.
    """
    sensors, forces = found.variances[:, SENSOR], np.array(found.variances)
    forces[:, SENSOR] = 0.0
    doubted = np.diag(found.uncertainty).reshape(forces.shape) > 0
    blocks, units = sums_of_parts(list(W.swapaxes(0, 1)), forces, found.slow, found.common, parts, doubted)
    P = np.tensordot(sensors, sensed, 1) + sum((sum(row) for row in blocks), start=np.zeros(sensed.shape[1:]))
    for own, sensor in zip(units, sensed, strict=True):
        own[SENSOR] = np.diag(sensor)
    U = np.concatenate(units)
    return P, np.einsum("ip,ij,jp->p", U, found.uncertainty, U)


@dataclass(frozen=True, eq=False)
class _Spectra:
    """What is compared."""

    frequency: Array  # (f,) of all stretches in a row
    ordinates: Array  # (n, f) periodograms
    shapes: Array  # (n, 2 + m, f) expected ones for unit variances, of each output's own noise
    count: Array  # (b,) frequencies in each bin, half for zero
    binned: Array  # (b, n, n) mean periodograms of and between outputs
    designs: Array  # (n, 2 + m, b, n, n) expected ones for unit variances
    sensed: Array  # (n, n, n) those of each sensor's noise with unit variance

    @property
    def fits(self) -> bool:
        """Whether there is anything to fit."""
        return bool((self.frequency > 0).any() and self.ordinates.any())

    def expected(self, variances: Array, common: Array) -> Array:
        """(b, n, n) expected cross periodograms for variances (n, 2 + m), and forces of correlation (n, n)."""
        n = len(variances)
        own = np.einsum("oi,oibpq->bpq", variances, self.designs)
        S = own + self._shared(variances) * (common - np.eye(n))
        return np.asarray(S + 1e-9 * np.trace(S, axis1=1, axis2=2).real.max() * np.eye(n))  # regular without noise

    def _shared(self, variances: Array) -> Array:
        """(b, n, n) between forces of different outputs, were they fully correlated."""
        forces = np.array([own[:, None] * self.designs[o, :, :, o, o].real for o, own in enumerate(variances)])
        roots = np.sqrt(np.delete(forces, SENSOR, axis=1))
        return np.asarray(np.einsum("oib,qib->boq", roots, roots))

    def most_likely(self, places: Integers) -> tuple[Array, Array, float]:
        """Variances (n, 2 + m) of these parts, correlation (n, n), and minus the logarithm of their likelihood."""
        n, common = len(self.ordinates), np.eye(len(self.ordinates))
        variances = np.zeros(self.designs.shape[:2])
        variances[:, [WHITE, SENSOR]] = 1.0
        pairs = np.array([np.eye(n)[[o, q]].T @ np.eye(n)[[q, o]] for o in range(n) for q in range(o)])
        designs, root = self.designs[:, places].reshape(-1, *self.binned.shape), np.sqrt(self.count)[:, None, None]
        for _ in range(SPECTRUM_ITERATIONS):
            half = np.linalg.inv(np.linalg.cholesky(self.expected(variances, common)))
            shared = [sign * pair * self._shared(variances) for pair in pairs for sign in (1.0, -1.0)]
            turned = root * (half @ np.stack([*designs, *shared, self.binned]) @ half.conj().swapaxes(1, 2))
            rows = np.concatenate([turned.real, turned.imag], axis=1).reshape(len(turned), -1)
            found, _ = scipy.optimize.nnls(rows[:-1].T, rows[-1], maxiter=100 * len(rows))
            variances[:, places] = found[: len(designs)].reshape(n, -1)
            each = found[len(designs) :].reshape(-1, 2) @ [1.0, -1.0]
            common = as_correlation(np.eye(n) + np.tensordot(each, pairs, 1) if len(pairs) else np.eye(n))
        S = self.expected(variances, common)
        _, size = np.linalg.slogdet(S)
        cost = self.count @ (size + np.trace(np.linalg.solve(S, self.binned), axis1=1, axis2=2).real)
        return variances, common, float(cost)

    def uncertainty(self, variances: Array, common: Array, slow: Sequence[Slow]) -> Array:
        """Covariance of variances (n, 2 + m), by Fisher's information."""
        own = np.linalg.solve(self.expected(variances, common), self.designs.reshape(-1, *self.binned.shape))
        information = np.einsum("ibpq,jbqp,b->ij", own, own, self.count, optimize=True).real
        each = [directions_of(row, slow) for row in variances]
        T = np.asarray(scipy.linalg.block_diag(*(columns for columns, _ in each)))
        return covariance_along((T, np.concatenate([before for _, before in each])), information)

    def misfit(self, variances: Array) -> Array:
        """(n,) Bartlett's statistics."""
        if not self.fits:
            return np.zeros(len(variances))
        coupled = np.einsum("j,jnn->n", variances[:, SENSOR], self.sensed) - variances[:, SENSOR] * np.einsum(
            "nnn->n", self.sensed
        )
        level = np.einsum("oi,oif->of", variances, self.shapes) + coupled[:, None]
        return np.array([misfit_of(self.frequency, *pair) for pair in zip(self.ordinates, level, strict=True)])


def _spectra(eps: Array, A: Array, parts: Sequence[Stretch], left: Iterable[Sequence[Array]]) -> _Spectra:
    count, n = eps.shape
    frequency = np.concatenate([2 * np.pi * np.arange(part.padded // 2 + 1) / part.padded for part in parts])
    cross = np.concatenate([_cross_periodograms(eps, part) for part in parts], axis=2)
    shapes = np.array([np.concatenate(own, axis=1) for own in left])
    sensed = np.einsum("kaj,kbj->jab", A, A) / count + np.einsum("ja,jb->jab", np.eye(n), np.eye(n))
    pairs = sum(int((np.diff(part.places) == 1).sum()) for part in parts) / count
    later = -pairs * np.einsum("aj,jb->jab", A.mean(axis=0), np.eye(n))  # E eps(k + 1) eps(k)^T
    turn = np.exp(-1j * frequency)
    own = np.einsum("nnn->n", later)
    shapes[:, SENSOR] = np.einsum("nnn->n", sensed)[:, None] + 2 * own[:, None] * turn.real
    rows = np.concatenate([cross.real.reshape(n * n, -1), cross.imag.reshape(n * n, -1), shapes.reshape(-1, len(turn))])
    means, weight = in_bins(frequency, np.vstack([rows, turn.real, turn.imag]))
    turned = (means[-2] + 1j * means[-1])[:, None, None]
    binned = (means[: n * n] + 1j * means[n * n : 2 * n * n]).reshape(n, n, -1).transpose(2, 0, 1)
    quiet = means[2 * n * n : -2].reshape(*shapes.shape[:2], -1)
    designs = np.einsum("oib,op,oq->oibpq", quiet, np.eye(n), np.eye(n)).astype(complex)
    designs[:, SENSOR] = sensed[:, None] + later[:, None] * turned + later.swapaxes(1, 2)[:, None] * turned.conj()
    return _Spectra(
        frequency=frequency,
        ordinates=np.einsum("nnf->nf", cross.real),
        shapes=shapes,
        count=weight,
        binned=binned,
        designs=designs,
        sensed=sensed,
    )


def _cross_periodograms(eps: Array, part: Stretch) -> Array:
    """(n, n, f) cross periodograms of the outputs of a stretch."""
    lines = np.fft.rfft(part.spread(eps[part.rows]), part.padded, axis=0).T
    return np.asarray(lines[:, None] * lines[None].conj() / len(part.places))
