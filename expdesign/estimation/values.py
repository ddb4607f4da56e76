"""The result of an estimation, and a test of its data for feedback: whether inputs follow disturbances.

A test of data for feedback: whether inputs follow disturbances.

Inputs that were set beforehand say nothing about disturbances that come before them. So, given past residuals and past
inputs, the residual e(k) of an estimated model does not depend on inputs after it. The test compares two regressions of
the residuals of all outputs, one on

    1, e(k-1) ... e(k-L), u(k) ... u(k-L)

and one on these and the inputs u(k+g) ... u(k+g+L-1) that follow. Past residuals whiten the noise, past inputs take up
what the model has wrong. Where the inputs are external, Wilks' ratio of the residuals' determinants has Bartlett's
distribution, -(N - c) log ratio ~ chi-square with one degree of freedom for every output and direction of later inputs.

What else makes inputs seem to follow: a clock of the inputs that lags behind that of the motion, and velocities that a
logger has smoothed. The gap g is one sample; it is three where velocities are central differences of the pose, which
hold motion of the sample after. Velocities smoothed from the pose, or between the readings of a slow sensor, hold
motion of many samples after, and are not tested.

As e(k) given the past is white, any samples will do: of long data every second, third ... is compared.

Where inputs do follow the motion, at the true parameters,

- instruments Z(k), simulated from inputs before k, are uncorrelated with e(k) only if those inputs are: planned ones;
- least squares needs E Phi(k-1) e(k) = 0. Inputs at k-1 answer motion up to k-1, so that this holds for exact
  velocities and disturbances that are white, and then without feedback too;
- output error needs E psi(k) v(k) = 0, psi(k) the gradient of the simulated output, made of inputs before k, and v(k)
  its error. For white sensor noise v(k) is independent of inputs before k: consistent. A disturbance of the motion
  stays in v for as long as the ship remembers it, and inputs before k answer v before k: biased.

Source: L. Ljung, System Identification (1999), section 13.4, for the last two; C. A. Sims, American Economic Review 62
(1972), 540-552, with lagged residuals after J. Geweke, R. Meese and W. Dent, Journal of Econometrics 21 (1983),
161-194; M. S. Bartlett, J. R. Statist. Soc. B 9 (1947), 176-197; the form of cross-correlations is L. D. Haugh's,
J. Amer. Statist. Assoc. 71 (1976), 378-385.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.errors import UnknownName
from expdesign.estimation.regression import Integers, Regression, Share, batch_slices
from expdesign.estimation.replay import Steered
from expdesign.estimation.solve import NullSpace
from expdesign.signals import Batch, Record
from expdesign.values import Array, frozen_set, seal, sealed
from expdesign.vessel import VesselModel

FEEDBACK_LAGS = 8  # past samples known to the test for feedback, and later ones tested
FEEDBACK_GAP_OF_DIFFERENCES = 3  # first later sample tested where velocities are differences of the pose
FEEDBACK_SAMPLES = 50_000  # compared by that test at most, which bounds its time and memory
FEEDBACK_LEVEL = 0.01  # chance below which inputs are said to follow disturbances
FEEDBACK_ROUNDING = 1e-6  # size of a direction of inputs, relative to theirs, below which it is rounding errors
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Feedback:
    """Outcome of the test."""

    statistic: float  # Bartlett's, chi-square where inputs are external
    freedom: int  # its degrees of freedom
    chance: float  # of a statistic as large where inputs are external
    samples: int  # residuals compared

    @property
    def found(self) -> bool:
        """Whether chance is below the level of the test."""
        return self.chance < FEEDBACK_LEVEL


def feedback_in(
    record: Record, regression: Regression, residuals: Array, *, known_steered: bool = False
) -> Feedback | None:
    """Test whether inputs are external.

    Args:
        record: whose inputs made the regression.
        regression: says which samples are used.
        residuals: (k, n) of these.
        known_steered: inputs marked as steered are not tested.

    Returns:
        None where inputs hardly change or samples in a row are too few.
    """
    pieces, every = [], -(-len(regression) // FEEDBACK_SAMPLES)
    for rows in batch_slices(regression.batch_of):
        batch = record.batches[int(regression.batch_of[rows.start])]
        if batch.interpolated is None and not batch.smoothed:
            tested = (
                batch.steered == 0 if known_steered and batch.steered is not None else np.ones(len(batch), dtype=bool)
            )
            pieces += _windows(batch, tested, regression.step_of[rows], residuals[rows], every=every)
    if not pieces:
        return None
    e, known, later = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    return _compared(e, known, later)


def _windows(batch: Batch, tested: Mask, step: Integers, eps: Array, *, every: int) -> list[tuple[Array, Array, Array]]:
    """Per stretch, of every so many samples: e (t, n), what is known then (t, a), and later inputs (t, b)."""
    lags = FEEDBACK_LAGS
    gap = FEEDBACK_GAP_OF_DIFFERENCES if batch.derived else 1
    after = gap + lags - 1
    found = []
    edges = np.flatnonzero(np.diff(step) > 1) + 1
    for rows in np.split(np.arange(len(step)), edges):
        begin, e = int(step[rows[0]]), eps[rows]
        inputs = batch.inputs[begin : begin + len(e)]
        at = np.arange(lags, len(e) - after)
        places = begin + at[:, None] + np.arange(gap, after + 1)
        at = at[tested[places].all(axis=1)][::every]
        if not len(at):
            continue
        past = [e[at - lag] for lag in range(1, lags + 1)] + [inputs[at - lag] for lag in range(lags + 1)]
        later = [inputs[at + lag] for lag in range(gap, after + 1)]
        found.append((e[at], np.hstack(past), np.hstack(later)))
    return found


def _compared(e: Array, known: Array, later: Array) -> Feedback | None:
    base = _basis(np.column_stack([np.ones(len(e)), known]))
    e, new = (part - base @ (base.T @ part) for part in (e, later))
    more = _basis(new, scale=np.linalg.norm(later - later.mean(axis=0), axis=0))
    (count, n), p, q = e.shape, base.shape[1], more.shape[1]
    factor = count - p - (q + n + 1) / 2
    if not q or factor < q + n:
        return None
    left = e - more @ (more.T @ e)
    ratio = np.linalg.slogdet(e.T @ e)[1] - np.linalg.slogdet(left.T @ left)[1]
    statistic = float(factor * ratio)
    if not np.isfinite(statistic):
        return None
    chance = float(scipy.special.chdtrc(n * q, statistic))
    return Feedback(statistic=statistic, freedom=n * q, chance=chance, samples=count)


def _basis(columns: Array, scale: Array | None = None) -> Array:
    """Orthonormal (t, r) of columns (t, p), without directions that are rounding errors of their scale (p,)."""
    size = np.linalg.norm(columns, axis=0) if scale is None else scale
    U, s, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(U[:, s > FEEDBACK_ROUNDING])


def feedback_notes(found: Feedback | None) -> Sequence[str]:
    """One sentence where inputs follow disturbances."""
    if found is None or not found.found:
        return []
    return [
        f"Inputs follow earlier disturbances (chance {found.chance:.1g}): the data look steered, and instruments "
        "simulated from these inputs are biased. Mark steered samples in a column steered, and give planned inputs "
        "(planned_...) where they are known. A late clock of inputs, or smoothed velocities, look the same."
    ]


ROUNDING = 1e-12  # least variance of a combination of correlated numbers, of which some are nearly one


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Statistics of the one-step residuals (for "oe": of the simulated output)."""

    outputs: tuple[str, ...]  # names
    std: Array  # (n,) standard deviation, in the unit of a sample-to-sample difference (for "oe": of the output)
    correlation: Array  # (n,) with the sample before; -0.5 is measurement noise, +1 is a missing slow effect
    rows: int  # samples used by any equation
    rows_of: Integers  # (n,) samples that each equation uses
    left_out: int  # samples left out because numbers are missing
    lags: int  # last lag that the covariance of the estimate counts

    def __post_init__(self) -> None:
        seal(self, std="n", correlation="n")
        counts = np.array(self.rows_of, dtype=np.int64)
        counts.setflags(write=False)
        frozen_set(self, "rows_of", counts)


@sealed(values="p", covariance="p p", nuisance_values="q", joint_covariance="r r")
class Estimate:
    """Parameters of a vessel model from data."""

    method: str  # name of the method
    names: tuple[str, ...]  # estimated parameters, in model order
    values: Array  # (p,) in the model's own form
    covariance: Array  # (p, p)
    held: Mapping[str, float]  # parameters not estimated, and the values they were given
    nuisance_names: tuple[str, ...]  # nuisance parameters
    nuisance_values: Array  # (q,)
    # what each nuisance parameter is the sum of: parameters times moments of disturbances
    nuisance_shares: tuple[tuple[Share, ...], ...]
    # parameters of the air that are in others' values because no wind was used, and the names of those
    partners: Mapping[str, str]
    joint_covariance: Array  # (p + q, p + q) of parameters, then nuisance parameters
    residuals: Residuals  # statistics
    null_space: NullSpace  # what the data cannot see, or see faintly
    refinements: int  # number of repeated simulations of the instruments
    warnings: tuple[str, ...]  # one sentence each
    steered: Steered  # samples marked as steered, and what became of them
    # the test whether inputs that instruments are simulated from follow disturbances; None without one
    feedback: Feedback | None
    between_runs: Array | float = 0.0  # (p + q, p + q) what of `joint_covariance` is by how runs differ; 0 for nothing

    @property
    def std(self) -> Array:
        """(p,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def assignments(self) -> dict[str, float]:
        """Every parameter of the model by name."""
        return {**dict(zip(self.names, self.values.tolist(), strict=True)), **self.held}

    def value(self, name: str) -> float:
        """One parameter.

        Raises:
            UnknownName: not a parameter of the model.
        """
        if name not in self.assignments:
            raise UnknownName("parameter", name, known=self.assignments)
        return self.assignments[name]

    def model(self, model: VesselModel) -> VesselModel:
        """A model with these values and this covariance as its prior; held parameters count as known.

        Ranges of parameters that the estimate contradicts fall away.
        """
        found = model.with_parameters(self.assignments).with_covariance(self.names, self.covariance)
        return found.with_kept_ranges()


# Fit of a simulated output to a measured one.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (6.4).


def into_range(values: Array, covariance: Array, ends: Sequence[tuple[float, float]]) -> Array:
    """(p,) most probable numbers within their ranges, where normal ones (p,) with a covariance (p, p) are outside.

    They minimise (x - values)' C^-1 (x - values): those that are not at an end follow the others by their correlation.
    """
    low, high = np.array(ends).T
    if ((low <= values) & (values <= high)).all():
        return values
    std = np.sqrt(np.diag(covariance))
    free = std > 0
    size = std[free]
    correlation = covariance[np.ix_(free, free)] / np.outer(size, size)
    shares, axes = np.linalg.eigh(correlation)
    white = (axes / np.sqrt(np.maximum(shares, ROUNDING))).T
    bounds = (low[free] / size, high[free] / size)
    found = values.copy()
    found[free] = size * scipy.optimize.lsq_linear(white, white @ (values[free] / size), bounds=bounds, method="bvls").x
    return np.where(free, np.clip(found, low, high), values)
