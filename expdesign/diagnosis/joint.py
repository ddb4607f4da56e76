"""The joint linear model: candidate causes, uncertain parameters, wandering current and initial states together.

Rows are whitened errors, columns what each number would do to them. Initial states of the windows are projected out
(flat prior), uncertain parameters have their Gaussian prior, the wandering current is a random effect. What remains are
Gram matrices per window, small enough for anything that is asked of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.extended import Extended
from expdesign.diagnosis.motion import Linear, Push, linearise, push_of, responses, simulate_windows, start_responses
from expdesign.diagnosis.moves import moved
from expdesign.diagnosis.noise import Noise, fit_colour, hats, wander_covariance, white_noise, whitened
from expdesign.diagnosis.spread import spread
from expdesign.diagnosis.windows import Windows
from expdesign.values import Array

WANDER_MPS = (0.0, 0.005, 0.01, 0.02, 0.035, 0.06, 0.1, 0.2)
WANDER_TIMES_S = (60.0, 150.0, 400.0, 1000.0)
SPACING_S = 20.0
MOST_HATS = 24
LARGEST_ANSWER = 1e30
CLOSE = 0.05
"""A fit has converged when the next step would lower twice the negative log likelihood by less than this."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Grams:
    """Inner products of whitened columns, per window, initial states projected out.

    Attributes:
        XX: (w, c, c); Xe: (w, c); ee: (w,).
    """

    XX: Array
    Xe: Array
    ee: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Columns:
    """Answers (c, w, s, 4) before whitening: c0 numbers, then the wandering current's hats; and the starts' (n, ...).

    Attributes:
        numbers: columns before the hats.
        spacing_s: between hats.
    """

    values: Array
    starts: Array
    error: Array
    numbers: int
    spacing_s: float

    @property
    def lost(self) -> bool:
        """Answers grow beyond all bounds: the model is unstable on the way."""
        sizes = (float(np.abs(item).max(initial=0.0)) for item in (self.values, self.starts))
        return not all(size < LARGEST_ANSWER for size in sizes)


def build_columns(linear: Linear, pushes: list[Push], *, wander: bool) -> Columns:
    """All answers along one simulation."""
    motion = linear.motion
    spacing = max(SPACING_S, motion.windows.steps * motion.windows.step_s / MOST_HATS)
    extra: list[Push] = []
    if wander:
        shapes = hats(motion.windows.steps - 1, motion.windows.step_s, spacing)
        for key in ("current:north", "current:east"):
            push = push_of(linear, motion.ship.having({key: motion.ship.get(key) + 1e-3}), 1e-3)
            force = push.force
            extra += [Push(force=None if force is None else force * hat[:, None], sensor=None) for hat in shapes]
    values = responses(linear, [*pushes, *extra])
    return Columns(
        values=values, starts=start_responses(linear), error=motion.error, numbers=len(pushes), spacing_s=spacing
    )


def answers(linear: Linear, keys: Sequence[str]) -> Columns:
    """Columns of the numbers of a fit."""
    ship = linear.motion.ship
    pushes = [push_of(linear, ship.having({k: ship.get(k) + d}), d) for k in keys for d in [step_of(ship, k)]]
    return build_columns(linear, pushes, wander=linear.motion.windows.has_heading)


def grams(columns: Columns, noise: Noise) -> Grams:
    """Whiten, leave out what is not measured, project the starts out."""
    error = whitened(columns.error, noise)
    w = error.shape[0]
    seen = np.isfinite(error)
    e = np.where(seen, error, 0.0).reshape(w, -1)
    X = (whitened(columns.values, noise) * seen).reshape(len(columns.values), w, e.shape[1])
    S = np.moveaxis((whitened(columns.starts, noise) * seen).reshape(len(columns.starts), w, -1), 0, -1)
    SS = np.swapaxes(S, 1, 2) @ S
    scale = np.trace(SS, axis1=1, axis2=2)[:, None, None] / SS.shape[1]
    SS = SS + (1e-9 * scale + 1e-12) * np.eye(SS.shape[1])
    XX, Xe, ee = [], [], []
    for index in range(w):
        A, b, B = X[:, index], e[index], S[index]
        AB = A @ B
        half = np.linalg.solve(SS[index], np.column_stack([AB.T, B.T @ b]))
        XX.append(A @ A.T - AB @ half[:, :-1])
        Xe.append(A @ b - AB @ half[:, -1])
        ee.append(b @ b - (B.T @ b) @ half[:, -1])
    return Grams(XX=np.array(XX), Xe=np.array(Xe), ee=np.array(ee))


@dataclass(frozen=True, kw_only=True, eq=False)
class Marginal:
    """Information about the numbers once the wandering current is integrated out.

    Attributes:
        A: (c, c) information; s: (c,) scores; per window (w, c) scores in `each`.
        quadratic: e' V^-1 e; log_det: of V beyond the white part.
    """

    A: Array
    s: Array
    each: Array
    quadratic: float
    log_det: float


def marginal(found: Grams, columns: Columns, noise: Noise) -> Marginal:
    """Integrate the wandering current out."""
    c = columns.numbers
    A, s = found.XX[:, :c, :c], found.Xe[:, :c]
    hats_count = (found.XX.shape[1] - c) // 2
    if noise.wander_mps == 0.0 or hats_count == 0:
        return Marginal(A=A.sum(axis=0), s=s.sum(axis=0), each=s, quadratic=float(found.ee.sum()), log_det=0.0)
    prior = noise.wander_mps**2 * wander_covariance(hats_count, columns.spacing_s, noise.wander_time_s)
    precision = np.linalg.inv(prior)
    ZZ, ZX, Ze = found.XX[:, c:, c:] + precision, found.XX[:, c:, :c], found.Xe[:, c:]
    solved = np.linalg.solve(ZZ, np.concatenate([ZX, Ze[..., None]], axis=2))
    each = s - np.einsum("wzc,wz->wc", ZX, solved[..., -1])
    log_det = np.linalg.slogdet(ZZ)[1].sum() + len(ZZ) * np.linalg.slogdet(prior)[1]
    return Marginal(
        A=(A - np.swapaxes(ZX, 1, 2) @ solved[..., :-1]).sum(axis=0),
        s=each.sum(axis=0),
        each=each,
        quadratic=float(found.ee.sum() - np.einsum("wz,wz->", Ze, solved[..., -1])),
        log_det=float(log_det),
    )


def likeliest_wander(found: Grams, columns: Columns, noise: Noise, precision: Array) -> Noise:
    """The wandering current that makes the data most likely, the numbers free within their prior precision (c,)."""
    if found.XX.shape[1] == columns.numbers:
        return noise
    best: tuple[float, Noise] = (np.inf, noise)
    for size in WANDER_MPS:
        for time_s in WANDER_TIMES_S if size else WANDER_TIMES_S[:1]:
            trial = replace(noise, wander_mps=size, wander_time_s=time_s)
            m = marginal(found, columns, trial)
            A = m.A + np.diag(precision)
            cost = m.log_det + m.quadratic - float(m.s @ np.linalg.lstsq(A, m.s, rcond=None)[0])
            cost += float(np.linalg.slogdet(A + 1e-12 * np.diag(np.diag(A) + 1e-30))[1])
            if cost < best[0] - 1e-9:
                best = (cost, trial)
    return best[1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A model with effects fitted to all windows.

    Attributes:
        ship: with the fitted effects.
        keys: the free numbers, in order; uncertain parameters last.
        free: how many of them have no prior.
        covariance: (c, c).
        starts: (w, n) initial states.
        noise: colour of the remainder.
        cost: weighted squared error at the end, while fitting.
        linear, columns: at the end.
        precision: (c,) prior precision of the numbers.
        converged: a further step would hardly lower the cost.
    """

    ship: Extended
    keys: tuple[str, ...]
    free: int
    covariance: Array
    starts: Array
    noise: Noise
    cost: float
    linear: Linear
    columns: Columns
    precision: Array
    converged: bool

    def value(self, key: str) -> float:
        """Estimate."""
        return self.ship.get(key)

    def std(self, key: str) -> float:
        """Standard error."""
        index = self.keys.index(key)
        return float(np.sqrt(max(self.covariance[index, index], 0.0)))


def uncertain_keys(ship: Extended) -> tuple[str, ...]:
    """Parameters that are not known exactly."""
    model = ship.model
    return tuple(f"theta:{n}" for n, std in zip(model.names, model.parameter_std, strict=True) if std > 0)


def prior_precision(ship: Extended, keys: tuple[str, ...]) -> Array:
    """(c,) of the numbers: 1 / std^2 of uncertain parameters, else zero."""
    model = ship.model
    std = {f"theta:{n}": s for n, s in zip(model.names, model.parameter_std.tolist(), strict=True)}
    return np.array([1.0 / std[key] ** 2 if std.get(key, 0.0) > 0 else 0.0 for key in keys])


def fit(
    ship: Extended,
    windows: Windows,
    free: tuple[str, ...],
    *,
    starts: Array,
    noise: Noise | None = None,
    steps: int = 8,
    colour_order: int | None = None,
    near: Linear | None = None,
) -> Fit:
    """Gauss-Newton with the colour found anew in every step.

    Args:
        ship: where to start; its effects not in `free` stay.
        windows: data.
        free: effects to estimate without a prior.
        starts: (w, n) first guess of the initial states.
        noise: first guess of the colour.
        steps: Gauss-Newton steps.
        colour_order: of the autoregressions, or None to choose.
        near: linearised motion of a ship alike over the same windows, for speed.
    """
    uncertain = tuple(key for key in uncertain_keys(ship) if key not in free)
    keys = (*free, *uncertain)
    precision = prior_precision(ship, keys)
    precision[: len(free)] = 0.0
    starts = _fitting_starts(starts, ship.states)
    best: Fit | None = None
    move, turn, share = np.zeros(len(keys)), np.zeros_like(starts), 1.0
    for step in range(steps + 1):
        if best is not None:
            ship, starts = best.ship.having(moved(best.ship, keys, share * move)), best.starts + share * turn
        motion = simulate_windows(ship, windows, starts, near=near)
        linear = None if motion.diverged else linearise(motion)
        columns = None if linear is None else answers(linear, keys)
        if linear is None or columns is None or columns.lost:
            if best is None:
                raise FloatingPointError
            share /= 2
            continue
        near = linear
        if noise is None or step == 0:
            noise = _colours(columns, noise, precision, ship, keys, colour_order)
        now = np.array([ship.get(key) for key in keys])
        found = marginal(grams(columns, noise), columns, noise)
        cost = found.quadratic + float(precision @ now**2)
        if best is not None and cost > best.cost + 1.0:
            share /= 2
            continue
        pull = found.s - precision * now
        close = (
            float(pull @ np.linalg.lstsq(found.A + np.diag(precision), pull, rcond=None)[0]) < CLOSE if keys else True
        )
        last = step == steps or (close and step > 0)
        if step == 1 or last:
            noise = _colours(columns, noise, precision, ship, keys, colour_order)
            found = marginal(grams(columns, noise), columns, noise)
            cost = found.quadratic + float(precision @ now**2)
            pull = found.s - precision * now
        A = found.A + np.diag(precision)
        covariance = (
            np.asarray(np.linalg.pinv(A, rcond=1e-14, hermitian=True), dtype=float) if keys else np.zeros((0, 0))
        )
        move = covariance @ pull
        best = Fit(
            ship=ship, keys=keys, free=len(free), covariance=covariance, starts=starts, noise=noise,
            cost=cost, linear=linear, columns=columns, precision=precision, converged=close,
        )  # fmt: skip
        if last:
            break
        turn, share = _fitting_starts(_start_moves(columns, noise, move), ship.states), 1.0
    assert best is not None
    return best


def profile_cost(found: Fit, noise: Noise) -> float:
    """Quadratic cost of a fit under some noise, every number moved to its best in the linear model."""
    m = marginal(grams(found.columns, noise), found.columns, noise)
    now = np.array([found.ship.get(key) for key in found.keys])
    pull = m.s - found.precision * now
    best = pull @ np.linalg.lstsq(m.A + np.diag(found.precision), pull, rcond=None)[0] if len(now) else 0.0
    return float(m.quadratic + found.precision @ now**2 - best)


def _fitting_starts(starts: Array, n: int) -> Array:
    if starts.shape[1] < n:
        return np.column_stack([starts, np.zeros((len(starts), n - starts.shape[1]))])
    return starts[:, :n]


def step_of(ship: Extended, key: str) -> float:
    """A step for differences: small, and for thresholds and times large enough to be felt."""
    value = abs(ship.get(key))
    kind = key.split(":")[0]
    if kind in ("theta", "term"):
        return 1e-4 * max(1e-4, _parameter_scale(ship, key))
    if kind in ("lag", "delay", "deadband"):
        return max(0.05 * value, 1e-6)
    if kind == "roll":
        return max(1e-3 * value, 1e-6)
    return 1e-6 if kind == "asymmetry" else 1e-4


def _parameter_scale(ship: Extended, key: str) -> float:
    name = key.split(":")[1]
    if name in ship.model.names:
        return abs(float(ship.model.parameters[ship.model.names.index(name)])) + 1e-6
    return 1e-2


def _start_moves(columns: Columns, noise: Noise, move: Array) -> Array:
    """(w, 3) change of the initial velocities that goes with a change of the numbers."""
    rest = columns.error - np.tensordot(move, columns.values[: columns.numbers], axes=(0, 0))
    error = whitened(rest, noise)
    seen = np.isfinite(error)
    w = len(error)
    e = np.where(seen, error, 0.0).reshape(w, -1)
    S = np.moveaxis((whitened(columns.starts, noise) * seen).reshape(len(columns.starts), w, -1), 0, -1)
    return np.stack([np.linalg.lstsq(B, b, rcond=None)[0] for B, b in zip(S, e, strict=True)])


def _colours(
    columns: Columns, noise: Noise | None, precision: Array, ship: Extended, keys: tuple[str, ...], order: int | None
) -> Noise:
    """Colour of what is left after the best linear answer, twice."""
    if noise is None:
        size = spread(columns.error)
        noise = white_noise(np.where(size > 0, size, np.inf))
        passes = 3
    else:
        passes = 1
    now = np.array([ship.get(key) for key in keys])
    for _ in range(passes):
        g = grams(columns, noise)
        noise = likeliest_wander(g, columns, noise, precision)
        rest = remainder(columns, g, noise, precision, now)
        colour = fit_colour(rest, order=order)
        noise = replace(colour, wander_mps=noise.wander_mps, wander_time_s=noise.wander_time_s)
    return noise


def remainder(columns: Columns, g: Grams, noise: Noise, precision: Array, now: Array) -> Array:
    """(w, s, 4) error less the best linear answer of numbers and initial states, and a likely wandering current.

    The likeliest current would take noise along with it and leave too little; one drawn from its posterior does not
    (stochastic EM: G. Celeux and J. Diebolt, Computational Statistics Quarterly 2 (1985), 73-82). What is drawn with is
    always the same, so that fits of candidates differ by what they explain and not by chance.
    """
    m = marginal(g, columns, noise)
    c = columns.numbers
    move = np.linalg.lstsq(m.A + np.diag(precision), m.s - precision * now, rcond=None)[0] if c else np.zeros(0)
    rest = columns.error - np.tensordot(move, columns.values[:c], axes=(0, 0))
    hats_count = (len(columns.values) - c) // 2
    if noise.wander_mps > 0 and hats_count:
        prior = noise.wander_mps**2 * wander_covariance(hats_count, columns.spacing_s, noise.wander_time_s)
        ZZ = g.XX[:, c:, c:] + np.linalg.inv(prior)
        b = np.linalg.solve(ZZ, (g.Xe[:, c:] - g.XX[:, c:, :c] @ move)[..., None])[..., 0]
        chance = np.random.default_rng(0).standard_normal((*b.shape, 1))
        b = b + np.linalg.solve(np.swapaxes(np.linalg.cholesky(ZZ), 1, 2), chance)[..., 0]
        rest = rest - np.einsum("wz,zwsn->wsn", b, columns.values[c:])
    trimmed = replace(columns, error=rest)
    starts = _start_moves(trimmed, noise, np.zeros(c))
    return np.asarray(rest - np.einsum("wn,nwsk->wsk", starts, columns.starts))
