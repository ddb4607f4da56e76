"""The least time of a way from rest to rest: no ship gains or loses speed faster than its model and limits allow.

The speed S through water changes by dS/dt = cos(b) du/dt + sin(b) dv/dt at the drift angle b, u = S cos(b) and
v = S sin(b). The most and the least of it that the nominal model allows are bounded over boxes of speed, drift angle,
yaw rate, heading and inputs by affine arithmetic; boxes where a bound is far above the best sample are halved. A speed
that gains and loses at these rates is never below that of a motion (comparison principle), so it covers the way first.

Source: F. Clarke, Functional Analysis, Calculus of Variations and Optimal Control (2013), for the comparison; combined
here with `affine`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from expdesign.shortest_day.bounds.affine import AFFINE, Affine, over_boxes
from expdesign.shortest_day.bounds.motions import Motions
from expdesign.shortest_day.bounds.tuning import TUNING
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedChanges:
    """How fast speed through water can change.

    Attributes:
        edges: (k + 1,) of ranges of speed, from 0 [m/s].
        gain, loss: (k,) most in each range [m/s2]; not positive where the speed cannot be passed.
    """

    edges: Array
    gain: Array
    loss: Array

    def __post_init__(self) -> None:
        seal(self, edges="n", gain="k", loss="k")

    def least_s(self, way_m: float, begin_mps: float) -> float:
        """Least time of a way that begins with a speed and ends at rest [s]; 0 where it is too short to stop on."""
        time_s = covered_m = 0.0
        for low, high, gain, loss in zip(self.edges[:-1], self.edges[1:], self.gain, self.loss, strict=True):
            above = max(low, min(high, begin_mps))  # speeds above it are gained first
            if gain <= 0 or loss <= 0:
                return float(time_s + (way_m - covered_m) / low) if low > 0 and covered_m < way_m else 0.0
            passed_m = (high**2 - above**2) / (2 * gain) + (high**2 - low**2) / (2 * loss)
            if covered_m + passed_m >= way_m:
                if above > low:
                    return 0.0
                top = np.sqrt(low**2 + 2 * (way_m - covered_m) / (1 / gain + 1 / loss))
                return float(time_s + (top - low) * (1 / gain + 1 / loss))
            time_s += (high - above) / gain + (high - low) / loss
            covered_m += passed_m
        return float(time_s + (way_m - covered_m) / self.edges[-1])


def speed_changes(motions: Motions, most_mps: float, *, rounds: int = TUNING.speed_rounds) -> SpeedChanges | None:
    """Bounds for speeds up to `most_mps`.

    Args:
        motions: of all parameters of the model.
        most_mps: of the class.
        rounds: of halving boxes; the bounds hold with any number.

    Returns:
        None where the model couples accelerations, of which nothing is known here.
    """
    if motions.model.inertia is not None:
        return None
    edges = np.linspace(0.0, most_mps, TUNING.speeds + 1)
    ranges = np.array([_most(motions, low, high, rounds) for low, high in pairwise(edges.tolist())])
    return SpeedChanges(edges=edges, gain=ranges[:, 0], loss=ranges[:, 1])


def _most(motions: Motions, low: float, high: float, rounds: int) -> tuple[float, float]:
    """Most gain and most loss of speeds in a range [m/s2]."""
    sides = np.array([[low, high], [-np.pi, np.pi], *np.column_stack([motions.low, motions.high])[2:]])
    centres, halves = _parted(sides)
    bounds = _bounds(motions, centres, halves)
    for _ in range(rounds):
        found = _bounds(motions, centres, np.zeros_like(halves)).max(axis=1, keepdims=True)  # samples
        most = np.where(np.isfinite(found), found + TUNING.box_gap * np.nan_to_num(np.abs(found), posinf=0.0), -np.inf)
        open_ = (bounds > most).any(axis=0)
        order = np.flatnonzero(open_)[np.argsort(-bounds[:, open_].max(axis=0))][: TUNING.speed_boxes]
        if not len(order):
            break
        across = np.argmax(halves[order, 1:] / (np.ptp(sides, axis=1)[1:] + 1e-12), axis=1) + 1
        step = np.zeros_like(halves[order])
        step[np.arange(len(order)), across] = halves[order, across] / 2
        halved = np.where(step > 0, step, halves[order])
        new = np.concatenate([centres[order] - step, centres[order] + step]), np.tile(halved, (2, 1))
        more = np.minimum(_bounds(motions, *new), np.tile(bounds[:, order], 2))
        centres, halves = (
            np.concatenate([np.delete(a, order, axis=0), b]) for a, b in zip((centres, halves), new, strict=True)
        )
        bounds = np.concatenate([np.delete(bounds, order, axis=1), more], axis=1)
    gain, loss = bounds.max(axis=1).tolist()
    return float(gain), float(loss)


def _parted(sides: Array) -> tuple[Array, Array]:
    """Centres and half sides (b, d) of the first boxes: drift angles in eight parts, which moduli bend between."""
    parts = [1, 8, *(2 if low < 0 < high else 1 for low, high in sides[2:].tolist())]
    edges = [np.linspace(low, high, count + 1) for (low, high), count in zip(sides.tolist(), parts, strict=True)]
    lows, highs = (
        np.stack([axis.ravel() for axis in np.meshgrid(*ends, indexing="ij")], axis=1)
        for ends in ([e[:-1] for e in edges], [e[1:] for e in edges])
    )
    return (lows + highs) / 2, (highs - lows) / 2


def _bounds(motions: Motions, centres: Array, halves: Array) -> Array:
    """(2, b) upper bounds on gain and loss of speed over boxes of (speed, drift angle, yaw rate, ...).

    -inf for boxes without a velocity of the class.
    """
    model = motions.model
    speed, drift, *others = over_boxes(centres, halves)
    ahead, aside = AFFINE.cos(drift), AFFINE.sin(drift)
    base, gains = motions.regressors((speed * ahead, speed * aside, *others), AFFINE)

    def along(values: list[Affine | float]) -> Affine:
        total: Affine = 0.0 * speed
        for term, theta, value in zip(model.terms, model.parameters.tolist(), values, strict=True):
            if term.equation in ("u", "v"):
                direction = ahead if term.equation == "u" else aside
                total = total + direction * (value * (theta / model.time_scale_s))
        return total

    fixed, by_force, forces = along(base), [along(gain) for gain in gains], motions.forces
    centre = fixed.centre + forces @ np.array([by.centre for by in by_force])
    slopes = fixed.slopes + np.tensordot(forces, np.array([by.slopes for by in by_force]), axes=1)
    radius = np.abs(slopes).sum(axis=1) + fixed.error + np.abs(forces) @ np.array([by.error for by in by_force])
    found = np.stack([(centre + radius).max(axis=0), (radius - centre).max(axis=0)])
    inside = [
        (value.centre - value.radius <= motions.high[side]) & (value.centre + value.radius >= motions.low[side])
        for side, value in enumerate((speed * ahead, speed * aside))
    ]
    return np.where(np.all(inside, axis=0), found, -np.inf)
