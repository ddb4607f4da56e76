"""The joint linear model: candidate causes, uncertain parameters, wandering current and initial states together.

Rows are whitened errors, columns what each number would do to them. Initial states of the windows are projected out
(flat prior), uncertain parameters have their Gaussian prior, the wandering current is a random effect. What remains are
Gram matrices per window, small enough for anything that is asked of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.data import Noise, hats, wander_covariance, whitened
from expdesign.diagnosis.model import Extended, Linear, Push, push_of, responses, start_responses
from expdesign.values import Array

WANDER_MPS = (0.0, 0.005, 0.01, 0.02, 0.035, 0.06, 0.1, 0.2)
WANDER_TIMES_S = (60.0, 150.0, 400.0, 1000.0)
SPACING_S = 20.0
MOST_HATS = 24
LARGEST_ANSWER = 1e30


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
