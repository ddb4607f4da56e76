"""The track of a run over ground, as branch and bound places it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.plan.bounds.tuning import BOUNDS
from expdesign.values import Array
from expdesign.vessel import Vessel

SIDES = np.stack([np.cos(angle := np.arange(BOUNDS.sides) * 2 * np.pi / BOUNDS.sides), np.sin(angle)], axis=1)
"""Normals of the sides of a polygon that contains a track."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """A run over ground from a reference: points that turn with the heading, and their drift, which does not.

    Attributes:
        water: (3 Tuning.track_samples, 2) ahead and to starboard: amidships, both ends included, then points ahead and
            astern of it that are also half the beam from the hull's sides.
        drift: (3 Tuning.track_samples, 2) north and east.
        hull_m: (24,) distances from the reference of the sides of a polygon that contains the track through water.
    """

    water: Array
    drift: Array
    hull_m: Array

    @property
    def reach_m(self) -> float:
        """How far from the reference anything is that turns with the heading."""
        return max(float(np.hypot(*self.water.T).max()), BOUNDS.sides_margin * float(self.hull_m.max()))

    @property
    def ends_m(self) -> float:
        """The same of the track's ends."""
        return float(np.hypot(*self.water[[0, BOUNDS.track_samples - 1]].T).max())

    @property
    def drift_m(self) -> float:
        """Largest drift."""
        return float(np.hypot(*self.drift.T).max())

    def at(self, cells: Array, k: int) -> Array:
        """(n, 2) where point k is at poses (n, 3)."""
        c, s = np.cos(cells[:, 2]), np.sin(cells[:, 2])
        (x, y), (north, east) = self.water[k], self.drift[k]
        return np.stack([cells[:, 0] + c * x - s * y + north, cells[:, 1] + s * x + c * y + east], axis=1)

    def ends(self, cells: Array) -> tuple[Array, Array]:
        """(n, 2) where runs begin, and where they end."""
        return self.at(cells, 0), self.at(cells, BOUNDS.track_samples - 1)


def track_of(run: Primitive, vessel: Vessel, current_to: Array) -> Track:
    """The track of a run that is the same through water at every place."""
    pose, time_s = run.trajectory.pose, run.trajectory.time_s
    kept = np.rint(np.linspace(0, len(pose) - 1, BOUNDS.track_samples)).astype(int)
    middle = (pose[:, :2].min(axis=0) + pose[:, :2].max(axis=0)) / 2
    drift = (time_s[kept] - (time_s[0] + time_s[-1]) / 2)[:, None] * current_to
    along = np.stack([np.cos(pose[kept, 2]), np.sin(pose[kept, 2])], axis=1)
    ahead, places = max(0.0, vessel.length_m - vessel.beam_m) / 2 * along, pose[kept, :2] - middle
    return Track(
        water=np.concatenate([places, places + ahead, places - ahead]),
        drift=np.tile(drift, (3, 1)),
        hull_m=(SIDES @ (pose[:, :2] - middle).T).max(axis=1),
    )
