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

        Steps between positions at least a hull's radius from anything forbidden are skipped.

        Args:
            poses: (k, n, 3) sample by sample; ships that do not move are skipped.
        """
        far = shapely.contains_xy(self._deep, poses[..., 1], poses[..., 0])  # (k, n)
        moved = np.hypot(*np.moveaxis(np.diff(poses[..., :2], axis=0), -1, 0))
        turned = np.diff(poses[..., 2], axis=0) != 0
        close = ((moved > 0) | turned) & ~(far[:-1] & far[1:] & (moved < self._radius / 2))
        steps, ships = np.nonzero(close)
        place: Array = np.full((poses.shape[1], 2), np.nan)
        for first in range(0, len(steps), MONTE_CARLO.collision_chunk):
            step, ship = (
                steps[first : first + MONTE_CARLO.collision_chunk],
                ships[first : first + MONTE_CARLO.collision_chunk],
            )
            corners = [hull_outlines(poses[step + later, ship], self.vessel.hull_b) for later in (0, 1)]
            spans = shapely.convex_hull(shapely.multipoints(np.concatenate(corners, axis=1)))
            outside = ~shapely.contains_properly(self._water, spans)
            gone, earliest = np.unique(ship[outside], return_index=True)
            fresh = np.isnan(place[gone, 0])
            place[gone[fresh]] = poses[step[outside][earliest[fresh]], gone[fresh], :2]
        return place

    @cached_property
    def _water(self) -> shapely.MultiPolygon:
        shapely.prepare(self.area.water)
        return self.area.water

    @cached_property
    def _deep(self) -> shapely.Geometry:
        """Water in which the hull clears the shore at any heading, also in a step between two positions in it.

        From the middle of a step of half a radius a corner is sqrt(1.05**2 - 0.25**2) > 1 radii away.
        """
        inner = self.area.safe_water(1.05 * self._radius)
        shapely.prepare(inner)
        return inner

    @property
    def _radius(self) -> float:
        return float(np.hypot(*self.vessel.hull_b.T).max())
