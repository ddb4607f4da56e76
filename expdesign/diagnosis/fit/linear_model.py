"""The joint linear model of a fit, and the Gram matrices of its whitened sensitivities."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Noise, before_windows, linear_basis, random_current_precision, whitened
from expdesign.diagnosis.model import FOLLOWING, ExtendedModel
from expdesign.diagnosis.motion import (
    Disturbance,
    LinearisedMotion,
    channels_apart,
    disturbance_of,
    responses,
    start_responses,
    term_disturbances,
)
from expdesign.values import Array

# numbers in sensitivities and their inner products of windows that are taken together, so that memory does not grow
# with the data
SENSITIVITIES_AT_ONCE = 20_000_000

KNOT_SPACING_S = 20.0  # of the random current, at least [s]
MOST_KNOTS = 24  # of the random current in a window
TILE = 64  # edge of blocks of matrix products; for up to 64 x 64 x 64 multiplications OpenBLAS uses one thread
LARGEST_SENSITIVITY = 1e30  # beyond it the model counts as unstable


# The joint linear model of a fit: how effects, a random current and initial states change the simulated channels.
#
# Rows are errors, columns are sensitivities. Initial states have a flat prior, uncertain parameters their Gaussian
# prior, and the random current is a random effect with piecewise linear basis functions of time.


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivities:
    """Derivatives of the simulated channels, before whitening."""

    values: Array  # (c, w, s, 4) by the estimated effects, then by the random current at its knots, north before east
    starts: Array  # (3, w, s, 4) by the initial velocities of every window
    error: Array  # (w, s, 4) measured less simulated
    numbers: int  # how many of `values` are by estimated effects
    spacing_s: float  # time between knots of the random current [s]

    @property
    def knot_count(self) -> int:
        """Knots of the random current in a window; 0 without one."""
        return (len(self.values) - self.numbers) // 2

    def selected(self, keep: NDArray[np.bool_]) -> Sensitivities:
        """Only some of the windows, by a mask (w,)."""
        return replace(self, values=self.values[:, keep], starts=self.starts[:, keep], error=self.error[keep])

    @property
    def unbounded(self) -> bool:
        """The linearised motion has diverged."""
        sizes = (float(np.abs(item).max(initial=0.0)) for item in (self.values, self.starts))
        return not all(size < LARGEST_SENSITIVITY for size in sizes)


def build_sensitivities(
    linear: LinearisedMotion, disturbances: list[Disturbance], *, random_current: bool
) -> Sensitivities:
    """Sensitivities to disturbances, to the initial states and perhaps to a random current."""
    motion = linear.motion
    spacing = max(KNOT_SPACING_S, motion.windows.steps * motion.windows.step_s / MOST_KNOTS)
    extra: list[Disturbance] = []
    if random_current:
        basis = linear_basis(motion.windows.steps - 1, motion.windows.step_s, spacing)
        for key in ("current:north", "current:east"):
            force = disturbance_of(linear, motion.ship.with_effects({key: motion.ship.get(key) + 1e-3}), 1e-3).force
            extra += [Disturbance(force=None if force is None else force * row[:, None], sensor=None) for row in basis]
    return Sensitivities(
        values=responses(linear, [*disturbances, *extra]),
        starts=start_responses(linear.motion, linear.transition),
        error=motion.error,
        numbers=len(disturbances),
        spacing_s=spacing,
    )


def in_groups(linear: LinearisedMotion, count: int) -> Iterator[tuple[NDArray[np.bool_], LinearisedMotion]]:
    """The same motion a few windows at a time, so that sensitivities to `count` disturbances take little memory.

    Beside each group its windows, as a mask (w,).
    """
    windows, samples = linear.motion.predicted.shape[:2]
    columns = count + 2 * MOST_KNOTS
    each = columns * (4 * samples + columns)  # sensitivities and their inner products
    groups = min(windows, -(-windows * each // SENSITIVITIES_AT_ONCE))
    if groups < 2:
        yield np.ones(windows, dtype=bool), linear
        return
    group = np.arange(windows) * groups // windows
    for number in range(groups):
        yield group == number, linear.selected(group == number)


def effect_disturbances(linear: LinearisedMotion, keys: Sequence[str]) -> list[Disturbance]:
    """Disturbances per unit of each effect: regressors of those that act linearly, finite differences by others."""
    exact = term_disturbances(linear, keys)
    return [exact[key] if key in exact else _by_difference(linear, key) for key in keys]


def _by_difference(linear: LinearisedMotion, key: str) -> Disturbance:
    ship = linear.motion.ship
    step = difference_step(ship, key)
    return disturbance_of(linear, ship.with_effects({key: ship.get(key) + step}), step)


def sensitivities_to(linear: LinearisedMotion, keys: Sequence[str]) -> Sensitivities:
    """Sensitivities to effects, with a random current where a heading is measured and noise is not white."""
    disturbances, windows = effect_disturbances(linear, keys), linear.motion.windows
    return build_sensitivities(linear, disturbances, random_current=windows.has_heading and not windows.white_noise)


def sensitivities_beside(
    linear: LinearisedMotion, keys: Sequence[str], known: Mapping[str, Array], same: Sensitivities
) -> Sensitivities:
    """The same, of which some are known along this motion.

    Args:
        known: effect -> (w, s, 4) response.
        same: sensitivities along the same motion: of the random current and of initial states.
    """
    new = [key for key in keys if key not in known]
    more = build_sensitivities(linear, effect_disturbances(linear, new), random_current=False)
    of_effects = {**known, **dict(zip(new, more.values, strict=True))}
    rows = [of_effects[key] for key in keys]
    values = channels_apart(len(rows) + 2 * same.knot_count, more.error.shape[:2])
    for place, row in enumerate((*rows, *same.values[same.numbers :])):
        values[place] = row
    return replace(same, values=values, error=more.error, numbers=len(keys))


def difference_step(ship: ExtendedModel, key: str) -> float:
    """A step for finite differences: small, but large enough that thresholds and times change something."""
    value = abs(ship.get(key))
    kind = key.split(":")[0]
    if kind in ("theta", "term"):
        return 1e-4 * max(1e-4, _parameter_scale(ship, key))
    if kind in (*FOLLOWING, "deadband"):
        return max(0.05 * value, 1e-6)
    if kind == "roll":
        return max(1e-3 * value, 1e-6)
    return 1e-6 if kind == "asymmetry" else 1e-4


def _parameter_scale(ship: ExtendedModel, key: str) -> float:
    name = key.split(":")[1]
    if name in ship.model.names:
        return abs(float(ship.model.parameters[ship.model.names.index(name)])) + 1e-6
    return 1e-2


# Gram matrices of whitened sensitivities, with initial states projected out and the random current integrated out.
#
# These small matrices suffice for steps, covariances, score tests and likelihoods.


@dataclass(frozen=True, kw_only=True, eq=False)
class GramMatrices:
    """Inner products of whitened sensitivities, per window, initial states projected out."""

    XX: Array  # (w, c, c); Xe: (w, c); ee: (w,)
    Xe: Array
    ee: Array
    effect_starts: Array  # (w, n, c) what windows begin with that imitates each sensitivity best
    error_starts: Array  # (w, n) what imitates the error best
    log_det: Array  # (w,) of the covariance of the noise before the windows, beside that of white noise in them

    def selected(self, keep: NDArray[np.bool_]) -> GramMatrices:
        """Only some of the windows, by a mask (w,)."""
        return GramMatrices(**{item.name: getattr(self, item.name)[keep] for item in fields(self)})

    def initial_state_steps(self, effects: Array) -> Array:
        """(w, 3) change of the initial velocities that explains most of the error left by steps (w, z) of effects."""
        return self.start_steps(effects)[:, : len(OUTPUTS)]

    def start_steps(self, effects: Array) -> Array:
        """(w, n) the same of all that windows begin with, as in `start_columns`."""
        imitated = self.effect_starts[..., : effects.shape[1]]
        return np.asarray(self.error_starts - np.einsum("wnz,wz->wn", imitated, effects))


def gram_matrices(found: Sensitivities, noise: Noise) -> GramMatrices:
    """Whiten, leave out samples that are not measured, project the initial states out."""
    e, seen = whitened_error(found.error, noise)
    starts = start_columns(found, noise)
    n, c, states = len(starts), len(found.values), len(found.starts)
    rows = np.empty((4, n + c + 1, *e.shape[:2]))
    whitened(starts, noise, out=rows[:, :n])
    whitened(found.values, noise, out=rows[:, n:-1])
    rows[:, -1] = np.moveaxis(e, -1, 0)
    if not seen.all():
        rows *= np.moveaxis(seen, -1, 0)[:, None]
    G = _gram(rows)
    own = np.diagonal(G[:, :states, :states], axis1=1, axis2=2)
    ridge = np.ones((len(G), n))
    ridge[:, :states] = 1e-9 * own.mean(axis=1, keepdims=True) + 1e-12
    SS = G[:, :n, :n] + ridge[:, :, None] * np.eye(n)
    half = np.asarray(np.linalg.solve(SS, G[:, :n, n:]), dtype=float)
    rest = G[:, n:, n:] - np.swapaxes(G[:, :n, n:], 1, 2) @ half
    return GramMatrices(
        XX=rest[:, :-1, :-1],
        Xe=rest[:, :-1, -1],
        ee=rest[:, -1, -1],
        effect_starts=half[..., :-1],
        error_starts=half[..., -1],
        log_det=np.linalg.slogdet(SS[:, states:, states:])[1],
    )


def start_columns(found: Sensitivities, noise: Noise) -> Array:
    """(n, w, s, 4) sensitivities to what windows begin with: velocities, and earlier noise where it goes on in them."""
    return np.concatenate([found.starts, before_windows(found.error, noise)])


def whitened_error(error: Array, noise: Noise) -> tuple[Array, NDArray[np.bool_]]:
    """(w, s, 4) whitened error, zero where nothing is measured, and whether it is measured."""
    rows = whitened(error, noise)
    seen = np.isfinite(rows)
    return np.where(seen, rows, 0.0), seen


def _gram(rows: Array) -> Array:
    """(w, m, m) inner products of (4, m, w, s), in blocks small enough for one thread: on busy cores threads only wait.

    A matrix times its own transpose would take threads at any size, so one of the two is a copy.
    """
    m, w, s = rows.shape[1:]
    result = np.zeros((w, m, m))
    tiles = [slice(low, low + TILE) for low in range(0, m, TILE)]
    for channel, low in itertools.product(range(len(rows)), range(0, s, TILE)):
        block = np.swapaxes(rows[channel, :, :, low : low + TILE], 0, 1)
        other = np.swapaxes(block, 1, 2).copy()
        for number, tile in enumerate(tiles):
            for earlier in tiles[: number + 1]:
                result[:, tile, earlier] += block[:, tile] @ other[..., earlier]
    for tile, earlier in itertools.combinations(reversed(tiles), 2):
        result[:, earlier, tile] = np.swapaxes(result[:, tile, earlier], 1, 2)
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class MarginalInformation:
    """Information about the estimated effects once the random current is integrated out."""

    A: Array  # (c, c) information matrix
    s: Array  # (c,) scores
    each: Array  # (w, c) scores per window
    quadratic: float  # e' V^-1 e
    log_det: float  # of V beyond the white part


def window_information(grams: GramMatrices, found: Sensitivities, noise: Noise) -> tuple[Array, Array]:
    """(w, c, c) and (w, c) information and scores of every window once the random current is integrated out."""
    c = found.numbers
    A, s = grams.XX[:, :c, :c], grams.Xe[:, :c]
    if noise.current_std_mps == 0.0 or found.knot_count == 0:
        return A, s
    ZZ = grams.XX[:, c:, c:] + current_precision(found, noise)[0]
    solved = np.linalg.solve(ZZ, np.concatenate([grams.XX[:, c:, :c], grams.Xe[:, c:, None]], axis=2))
    ZX = np.swapaxes(grams.XX[:, c:, :c], 1, 2)
    return A - ZX @ solved[..., :-1], s - (ZX @ solved[..., -1:])[..., 0]


def marginalised(grams: GramMatrices, found: Sensitivities, noise: Noise) -> MarginalInformation:
    """Integrate the random current out."""
    if noise.current_std_mps == 0.0 or found.knot_count == 0:
        c = found.numbers
        A, s = grams.XX[:, :c, :c], grams.Xe[:, :c]
        return MarginalInformation(
            A=A.sum(axis=0),
            s=s.sum(axis=0),
            each=s,
            quadratic=float(grams.ee.sum()),
            log_det=float(grams.log_det.sum()),
        )
    return marginalised_under(grams, found, [noise])[0]


def marginalised_under(grams: GramMatrices, found: Sensitivities, noises: Sequence[Noise]) -> list[MarginalInformation]:
    """The same under several random currents, none of them zero, with the same whitening."""
    c = found.numbers
    A, s = grams.XX[:, :c, :c], grams.Xe[:, :c]
    precisions, sizes = zip(*(current_precision(found, noise) for noise in noises), strict=True)
    ZX, Ze = grams.XX[:, c:, :c], grams.Xe[:, c:]
    ZZ = grams.XX[:, c:, c:] + np.stack(precisions)[:, None]
    solved = np.linalg.solve(ZZ, np.concatenate([ZX, Ze[..., None]], axis=2))
    log_dets = np.linalg.slogdet(ZZ)[1].sum(axis=1) + len(A) * np.array(sizes)
    each = s - np.einsum("wzc,twz->twc", ZX, solved[..., -1])
    known = np.swapaxes(ZX, 1, 2) @ solved[..., :-1]
    return [
        MarginalInformation(
            A=(A - known[place]).sum(axis=0),
            s=each[place].sum(axis=0),
            each=each[place],
            quadratic=float(grams.ee.sum() - np.einsum("wz,wz->", Ze, solved[place, ..., -1])),
            log_det=float(log_det + grams.log_det.sum()),
        )
        for place, log_det in enumerate(log_dets)
    ]


def current_precision(found: Sensitivities, noise: Noise) -> tuple[Array, float]:
    """(z, z) inverse covariance of the random current at its knots, north before east [s^2/m^2].

    Beside it the log determinant of the covariance.
    """
    unit, size = random_current_precision(found.knot_count, found.spacing_s, noise.current_time_s)
    return unit / noise.current_std_mps**2, size + 2.0 * len(unit) * float(np.log(noise.current_std_mps))


def information(found: Sensitivities, noise: Noise) -> MarginalInformation:
    """Marginal information of sensitivities under some noise."""
    return marginalised(gram_matrices(found, noise), found, noise)
