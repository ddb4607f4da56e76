"""Simulated trials of a design on the true model ship, and the instrumental-variable estimates they give.

Noise as in the source: white current and white errors of the velocities, of one variance; instruments are the nominal
model's noise-free regressors less their mean over the complete data. A trial has a fixed number of samples, shared out
by the design's fractions. Where a share is not a whole number of runs, consecutive rows of one more run are taken,
beginning at a random one and going round, so that on average every part of the run counts alike.

Source: F. Ljungberg, doctoral thesis, Linköping University, 9.1.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.dictionary import Primitive
from expdesign.simulation import Environment, Variation, simulate_ensemble
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

VARIANCE = 0.025
"""Of u_c, v_c and of the error of every output."""
KEPT, TRIMMINGS = 0.95, 10
"""Share of the runs that count as not wild, and how often those are chosen anew."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trials:
    """Estimates of many simulated trials.

    Attributes:
        estimates: (runs, p).
        truth: (p,) the values the data were made with.
    """

    estimates: Array
    truth: Array

    def __post_init__(self) -> None:
        seal(self, estimates="n p", truth="p")

    @property
    def std(self) -> Array:
        """(p,) standard deviation of each estimate."""
        return np.asarray(self.estimates.std(axis=0, ddof=1))

    @property
    def rms(self) -> Array:
        """(p,) root mean square error of each estimate, bias included."""
        return np.asarray(np.sqrt(((self.estimates - self.truth) ** 2).mean(axis=0)))

    @property
    def half_width(self) -> Array:
        """(p,) half the width of the middle 68 % of each estimate, which a few wild ones do not move."""
        return np.asarray(np.ptp(np.quantile(self.estimates, (0.16, 0.84), axis=0), axis=0) / 2)

    @property
    def log_det(self) -> float:
        """log det of the covariance of the estimates over |truth|, wild ones included."""
        return float(np.linalg.slogdet(np.cov(self._relative.T))[1])

    @property
    def central_log_det(self) -> float:
        """The same without the 5 % of the runs that lie farthest from the others, by Mahalanobis distance.

        Instrumental-variable estimates have heavy tails, and a poor design's are the heaviest: with all runs a few
        decide the determinant.
        """
        errors = self._relative - np.median(self._relative, axis=0)
        covariance = np.cov(errors.T)
        for _ in range(TRIMMINGS):
            distance = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors)
            covariance = np.cov(errors[distance <= np.quantile(distance, KEPT)].T)
        return float(np.linalg.slogdet(covariance)[1])

    @property
    def _relative(self) -> Array:
        return np.asarray(self.estimates / np.abs(self.truth))


def sample_counts(fractions: Array, samples: int) -> NDArray[np.intp]:
    """(q,) samples of each primitive, summing to `samples`: largest remainders."""
    exact = np.asarray(fractions) * samples
    counts = np.floor(exact).astype(int)
    short = samples - int(counts.sum())
    counts[np.argsort(-(exact - counts))[:short]] += 1
    return counts


def simulate_trials(
    truth: Vessel,
    nominal: Vessel,
    primitives: Sequence[Primitive],
    fractions: Array,
    *,
    runs: int,
    rng: np.random.Generator,
    samples: int = 1000,
) -> Trials:
    """Estimates of `runs` trials of a design."""
    pieces = [
        _rows(truth, nominal, primitive, int(count), runs, rng)
        for primitive, count in zip(primitives, sample_counts(fractions, samples), strict=True)
        if count
    ]
    regressors, instruments, changes = (np.concatenate(parts, axis=1) for parts in zip(*pieces, strict=True))
    instruments = instruments - instruments.mean(axis=1, keepdims=True)
    estimates = np.empty((runs, len(truth.model.names)))
    for output, name in enumerate(truth.model.outputs):
        own = [index for index, term in enumerate(truth.model.terms) if term.equation == name]
        Z = instruments[:, :, own].transpose(0, 2, 1)
        right = Z @ changes[:, :, output][..., None]
        estimates[:, own] = np.linalg.solve(Z @ regressors[:, :, own], right)[..., 0]
    return Trials(estimates=estimates, truth=truth.model.parameters)


def _rows(
    truth: Vessel, nominal: Vessel, primitive: Primitive, count: int, runs: int, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Regressors (runs, count, p), instruments alike, and changes of the outputs (runs, count, n)."""
    commands = primitive.commands.values
    length = len(commands)
    motion = primitive.trajectory.velocity[:-1]
    clean = _regressors(nominal, motion[:, None], commands[:, None])[:, 0]  # (k, p)
    parts = []
    for part in range(0, count, length):
        weather = Environment(current_variation=Variation(std_mps=VARIANCE**0.5))
        sailed = simulate_ensemble(
            truth,
            np.concatenate([commands, commands[-1:]]),
            runs=runs,
            environment=weather,
            rng=rng,
            velocity=primitive.entry_velocity,
        )
        seen = sailed.measured_velocity  # (k + 1, runs, 3)
        table = _regressors(truth, seen[:-1], commands[:, None])
        wanted = min(length, count - part)
        first = rng.integers(0, length, size=runs)
        place = (first[:, None] + np.arange(wanted)) % length  # (runs, wanted)
        which = np.arange(runs)[:, None]
        change = np.diff(seen, axis=0)[..., : len(truth.model.outputs)]
        parts.append((table[place, which], clean[place], change[place, which]))
    return tuple(np.concatenate(list(rows), axis=1) for rows in zip(*parts, strict=True))  # type: ignore[return-value]


def _regressors(vessel: Vessel, velocity: Array, commands: Array) -> Array:
    """(k, n, p) from velocities (k, n, 3) and commands (k, 1, m)."""
    motion = tuple(np.moveaxis(velocity, -1, 0))
    values = vessel.model.regressors(motion, motion[:2], tuple(np.moveaxis(commands, -1, 0)))
    return np.stack([np.broadcast_to(value, velocity.shape[:2]) for value in values], axis=-1)
