"""Simulated trials of a design on the true model ship, and the instrumental-variable estimates they give.

Noise as in the source: white current and white errors of the velocities, of one variance; instruments are the nominal
model's noise-free regressors less their mean over the complete data. A trial has a fixed number of samples, cut into
segments of one primitive each. It is either sailed as separate runs, each from its primitive's entry velocity, or as
one voyage, where every segment begins with the first command of its primitive in the state that the last one left.
Of a separate run that is longer than its segment, consecutive rows are taken, beginning at a random one and going
round, so that on average every part of the run counts alike.

Source: F. Ljungberg, doctoral thesis, Linköping University, 9.1.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.dictionary import Primitive
from expdesign.errors import InputError
from expdesign.simulation import CALM, Environment, Variation, simulate_ensemble
from expdesign.values import Array, seal
from expdesign.vessel import Sensors, Vessel

VARIANCE = 0.025  # of u_c, v_c and of the error of every output
KEPT, TRIMMINGS = 0.95, 10  # share of the runs that count as not wild, and how often those are chosen anew


@dataclass(frozen=True, kw_only=True, eq=False)
class Trials:
    """Estimates of many simulated trials.

    Attributes:
        estimates: (runs, p); nan for the parameters of an equation that the trial tells nothing of.
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
    def errors(self) -> Array:
        """(runs,) root mean square over the parameters of (estimate - truth) / |truth|, inf where one is missing."""
        errors = np.sqrt(((self._relative - np.sign(self.truth)) ** 2).mean(axis=1))
        return np.asarray(np.where(np.isfinite(errors), errors, np.inf))

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Segment:
    """Consecutive samples of one primitive, which may be another one in every trial.

    Attributes:
        chosen: (runs,) index of the primitive.
        samples: length.
    """

    chosen: NDArray[np.intp]
    samples: int


def sample_counts(fractions: Array, samples: int) -> NDArray[np.intp]:
    """(q,) samples of each primitive, summing to `samples`: largest remainders."""
    exact = np.asarray(fractions) * samples
    counts = np.floor(exact).astype(int)
    short = samples - int(counts.sum())
    counts[np.argsort(-(exact - counts))[:short]] += 1
    return counts


def shared_out(
    primitives: Sequence[Primitive], fractions: Array, *, runs: int, samples: int = 1000
) -> tuple[Segment, ...]:
    """The same for all trials: whole runs of each primitive and part of one more, in the dictionary's order."""
    segments = []
    for index, count in enumerate(sample_counts(fractions, samples)):
        length = len(primitives[index].commands)
        parts = [min(length, int(count) - done) for done in range(0, int(count), length)]
        segments += [Segment(chosen=np.full(runs, index), samples=part) for part in parts]
    return tuple(segments)


def drawn(
    primitives: Sequence[Primitive], *, segments: int, runs: int, rng: np.random.Generator, samples: int = 1000
) -> tuple[Segment, ...]:
    """Equally long segments, the primitive of each drawn at random for every trial."""
    length, rest = divmod(samples, segments)
    if rest:
        raise InputError(f"{samples} samples cannot be cut into {segments} equal segments")
    chosen = rng.integers(len(primitives), size=(segments, runs))
    return tuple(Segment(chosen=row, samples=length) for row in chosen)


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
    """Estimates of `runs` trials of a design, sailed as separate runs."""
    segments = shared_out(primitives, fractions, runs=runs, samples=samples)
    return separate_runs(truth, nominal, primitives, segments, rng=rng)


def separate_runs(
    truth: Vessel,
    nominal: Vessel,
    primitives: Sequence[Primitive],
    segments: Sequence[Segment],
    *,
    rng: np.random.Generator,
) -> Trials:
    """Estimates of trials whose segments each begin at the primitive's entry velocity."""
    return _estimated(truth, [_cut_run(truth, nominal, primitives, segment, rng) for segment in segments])


def voyages(
    truth: Vessel,
    nominal: Vessel,
    primitives: Sequence[Primitive],
    segments: Sequence[Segment],
    *,
    rng: np.random.Generator,
    mean: str = "complete",
) -> Trials:
    """Estimates of trials sailed in one go from the first primitive's entry velocity; so are the instruments.

    The mean is taken off instruments over the complete data, over each "segment", or not ("none").
    """
    parts = [_commands(primitives, segment.chosen)[: segment.samples] for segment in segments]
    if any(len(part) < segment.samples for part, segment in zip(parts, segments, strict=True)):
        raise InputError("a segment of a voyage is longer than its primitive, expected several segments")
    commands = np.concatenate(parts)
    start = np.array([primitives[index].entry_velocity for index in segments[0].chosen])
    expected = simulate_ensemble(
        replace(nominal, sensors=Sensors()),
        _with_last_twice(commands),
        runs=len(start),
        environment=CALM,
        rng=rng,
        velocity=start,
    )
    seen = _measured(truth, commands, start, rng)
    rows = (
        _regressors(truth, seen[:-1], commands),
        _regressors(nominal, expected.velocity[:-1], commands),
        np.diff(seen, axis=0),
    )
    whole = [tuple(table.swapaxes(0, 1) for table in rows)]
    if mean == "segment":
        ends = np.cumsum([segment.samples for segment in segments])[:-1]
        whole = list(zip(*(np.split(table, ends, axis=1) for table in whole[0]), strict=True))
    return _estimated(truth, whole, mean=mean)


def _cut_run(
    truth: Vessel, nominal: Vessel, primitives: Sequence[Primitive], segment: Segment, rng: np.random.Generator
) -> tuple[Array, ...]:
    """Regressors (runs, count, p), instruments alike, and changes of the outputs (runs, count, 3)."""
    commands = _commands(primitives, segment.chosen)
    motion = np.stack([primitives[index].trajectory.velocity[:-1] for index in segment.chosen], axis=1)
    start = np.array([primitives[index].entry_velocity for index in segment.chosen])
    seen = _measured(truth, commands, start, rng)
    first = rng.integers(0, len(commands), size=len(start))
    place = (first[:, None] + np.arange(segment.samples)) % len(commands)  # (runs, count)
    rows = (_regressors(truth, seen[:-1], commands), _regressors(nominal, motion, commands), np.diff(seen, axis=0))
    return tuple(table[place, np.arange(len(start))[:, None]] for table in rows)


def _commands(primitives: Sequence[Primitive], chosen: NDArray[np.intp]) -> Array:
    """(k, runs, m) of the primitives chosen for one segment."""
    lengths = sorted({len(primitives[index].commands) for index in set(chosen.tolist())})
    if len(lengths) > 1:
        raise InputError(f"primitives drawn for one segment have {lengths} samples, expected equal lengths")
    return np.stack([primitives[index].commands.values for index in chosen], axis=1)


def _with_last_twice(commands: Array) -> Array:
    return np.concatenate([commands, commands[-1:]])


def _measured(truth: Vessel, commands: Array, start: Array, rng: np.random.Generator) -> Array:
    """(k + 1, runs, 3) velocities that the true ship's sensors tell."""
    weather = Environment(current_variation=Variation(std_mps=VARIANCE**0.5))
    sailed = simulate_ensemble(
        truth, _with_last_twice(commands), runs=len(start), environment=weather, rng=rng, velocity=start
    )
    return sailed.measured_velocity


def _estimated(truth: Vessel, parts: Sequence[tuple[Array, ...]], *, mean: str = "complete") -> Trials:
    """Instrumental variables with the instruments' mean over the complete data taken off, or over each part."""
    if mean == "segment":
        parts = [(own, seen - seen.mean(axis=1, keepdims=True), change) for own, seen, change in parts]
    regressors, instruments, changes = (np.concatenate(tables, axis=1) for tables in zip(*parts, strict=True))
    if mean == "complete":
        instruments = instruments - instruments.mean(axis=1, keepdims=True)
    estimates = np.full((len(regressors), len(truth.model.names)), np.nan)
    for output, name in enumerate(truth.model.outputs):
        own = [index for index, term in enumerate(truth.model.terms) if term.equation == name]
        Z = instruments[:, :, own].transpose(0, 2, 1)
        told = np.flatnonzero((np.abs(Z).max(axis=2) > 0).all(axis=1))
        left, right = Z @ regressors[:, :, own], Z @ changes[:, :, output][..., None]
        estimates[told[:, None], own] = np.linalg.solve(left[told], right[told])[..., 0]
    return Trials(estimates=estimates, truth=truth.model.parameters)


def _regressors(vessel: Vessel, velocity: Array, commands: Array) -> Array:
    """(k, n, p) from velocities (k, n, 3) and commands (k, n, m)."""
    motion = tuple(np.moveaxis(velocity, -1, 0))
    values = vessel.model.regressors(motion, motion[:2], tuple(np.moveaxis(commands, -1, 0)))
    return np.stack([np.broadcast_to(value, velocity.shape[:2]) for value in values], axis=-1)
