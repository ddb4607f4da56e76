"""Distances to forbidden water ahead, to port and to starboard during a planned run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.conventions import to_n_frame
from expdesign.export.tuning import TUNING
from expdesign.values import Array
from expdesign.vessel.hull import swept_area

DIRECTIONS = {"ahead": 0.0, "starboard": np.pi / 2, "port": -np.pi / 2}


@dataclass(frozen=True, kw_only=True)
class Danger:
    """Least distances over a run.

    Attributes:
        ahead_m, port_m, starboard_m: from the hull along straight lines to forbidden water, at most
            `Tuning.farthest_danger_m` [m].
        nearest_m: from the hull in any direction [m].
        nearest_sample: when.
        room_m: (length, width) of the smallest rectangle around the swept area of the hull [m].
    """

    ahead_m: float
    port_m: float
    starboard_m: float
    nearest_m: float
    nearest_sample: int
    room_m: tuple[float, float]


def look_out(pose: Array, *, hull_b: Array, water: shapely.MultiPolygon) -> Danger:
    """Look from every pose (k, 3) of a run."""
    forbidden = water.boundary
    half_length, half_beam = hull_b.max(axis=0)
    starts = {"ahead": (half_length, 0.0), "starboard": (0.0, half_beam), "port": (0.0, -half_beam)}
    seen = {name: _ray(pose, np.array(starts[name]), turn, forbidden) for name, turn in DIRECTIONS.items()}
    hulls = shapely.polygons([to_n_frame(hull_b, one)[:, ::-1] for one in pose])
    near = shapely.distance(forbidden, hulls)
    box = shapely.minimum_rotated_rectangle(swept_area(pose, hull_b))
    sides = np.hypot(*np.diff(np.array(box.exterior.coords)[:3], axis=0).T)
    return Danger(
        ahead_m=seen["ahead"],
        port_m=seen["port"],
        starboard_m=seen["starboard"],
        nearest_m=float(near.min()),
        nearest_sample=int(near.argmin()),
        room_m=(float(sides.max()), float(sides.min())),
    )


def _ray(pose: Array, start_b: Array, turn_rad: float, forbidden: shapely.Geometry) -> float:
    """Least distance along the lines of sight [m]."""
    begin = np.array([to_n_frame(start_b, one) for one in pose])
    bearing = pose[:, 2] + turn_rad
    end = begin + TUNING.farthest_danger_m * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    rays = shapely.linestrings(np.stack([begin[:, ::-1], end[:, ::-1]], axis=1))
    hits = shapely.intersection(rays, forbidden)
    away = shapely.distance(hits, shapely.points(begin[:, ::-1]))
    return float(np.min(np.where(np.isnan(away), TUNING.farthest_danger_m, away)))
