"""Collision check of many hulls with the chart at every step, without the planner's grids and margins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expdesign.plan.monte_carlo.tuning import MONTE_CARLO
from expdesign.sea_area import SeaArea
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.vessel.hull import hull_outlines


@dataclass(frozen=True, kw_only=True)
class CollisionCheck:
    """Whether hulls stay in allowed water.

    Attributes:
        area: the chart.
        vessel: its outline.
    """

    area: SeaArea
    vessel: Vessel

    def exits(self, poses: Array) -> Array:
        """(n, 2) where the hull, or what it sweeps between samples, first leaves the water; nan where never.

        Steps between positions at least a hull's radius from anything forbidden are skipped. Stretches of samples are
        checked in turn, which bounds the memory.

        Args:
            poses: (k, n, 3) sample by sample; ships that do not move are skipped.
        """
        place: Array = np.full((poses.shape[1], 2), np.nan)
        stretch = max(1, MONTE_CARLO.collision_samples // max(1, poses.shape[1]))
        for begin in range(0, len(poses) - 1, stretch):
            some = poses[begin : begin + stretch + 1]
            steps, ships = self._close(some)
            for first in range(0, len(steps), MONTE_CARLO.collision_chunk):
                chunk = slice(first, first + MONTE_CARLO.collision_chunk)
                self._first_outside(some, steps[chunk], ships[chunk], place)
        return place

    def _close(self, poses: Array) -> tuple[np.ndarray, np.ndarray]:
        """Steps and ships (j,) that move, and perhaps not far from the shore."""
        moved, turned = np.diff(poses[..., :2], axis=0), np.diff(poses[..., 2], axis=0) != 0
        moved = np.sqrt(moved[..., 0] ** 2 + moved[..., 1] ** 2)
        sails = (moved > 0) | turned
        concerned = np.zeros(poses.shape[:2], dtype=bool)
        concerned[:-1] |= sails
        concerned[1:] |= sails
        far = np.ones(poses.shape[:2], dtype=bool)
        far[concerned] = self._far(poses[concerned, :2])
        steps, ships = np.nonzero(sails & ~(far[:-1] & far[1:] & (moved < self._radius / 2)))
        return steps, ships

    def _first_outside(self, poses: Array, steps: np.ndarray, ships: np.ndarray, place: Array) -> None:
        """Note in `place` where ships first are outside in some steps (j,), in order of time, if not noted before."""
        corners = [hull_outlines(poses[steps + later, ships], self.vessel.hull_b) for later in (0, 1)]
        spans = shapely.convex_hull(shapely.multipoints(np.concatenate(corners, axis=1)))
        outside = ~shapely.contains_properly(self._water, spans)
        gone, earliest = np.unique(ships[outside], return_index=True)
        fresh = np.isnan(place[gone, 0])
        place[gone[fresh]] = poses[steps[outside][earliest[fresh]], gone[fresh], :2]

    @cached_property
    def _water(self) -> shapely.MultiPolygon:
        shapely.prepare(self.area.water)
        return self.area.water

    def _far(self, places: Array) -> np.ndarray:
        """(k,) whether places (k, 2) are far from the shore: where a coarse table does not say so, one by one."""
        far = np.zeros(len(places), dtype=bool)
        cell_m, bounds = self._radius, np.reshape(self.area.water.bounds, (2, 2))[:, ::-1]
        inside = ((places >= bounds[0]) & (places <= bounds[1])).all(axis=1)
        if inside.any():
            first = places[inside].min(axis=0)
            cells = ((places[inside] - first) / cell_m).astype(int)
            shape = cells.max(axis=0) + 1
            if shape.prod() < len(cells):
                middles = first + cell_m * (np.moveaxis(np.indices(shape), 0, -1) + 0.5)
                deep = shapely.contains_xy(self._deeper, middles[..., 1], middles[..., 0])
                far[inside] = deep[cells[:, 0], cells[:, 1]]
        far[~far] = shapely.contains_xy(self._deep, places[~far, 1], places[~far, 0])
        return far

    @cached_property
    def _deeper(self) -> shapely.Geometry:
        """Water round whose places a square cell as wide as the hull's radius is deep."""
        inner = self.area.water_to_plan_in((1.05 + 0.75) * self._radius)
        shapely.prepare(inner)
        return inner

    @cached_property
    def _deep(self) -> shapely.Geometry:
        """Water in which the hull clears the shore at any heading, also in a step between two positions in it.

        From the middle of a step of half a radius a corner is sqrt(1.05**2 - 0.25**2) > 1 radii away.
        """
        inner = self.area.water_to_plan_in(1.05 * self._radius)
        shapely.prepare(inner)
        return inner

    @property
    def _radius(self) -> float:
        return float(np.hypot(*self.vessel.hull_b.T).max())
