"""What a hull covers: outlines along a track, swept polygons, and the discs that stand for a hull in searches."""

from __future__ import annotations

import numpy as np
import shapely

from expdesign.values import Array


def hull_outlines(pose: Array, hull_b: Array) -> Array:
    """(k, c, 2) hull corners in the n-frame, as (east, north) for shapely.

    Args:
        pose: (k, 3) n-frame.
        hull_b: (c, 2) corners forward/starboard [m].
    """
    c, s = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
    north = pose[:, :1] + hull_b[:, 0] * c - hull_b[:, 1] * s
    east = pose[:, 1:2] + hull_b[:, 0] * s + hull_b[:, 1] * c
    return np.stack([east, north], axis=-1)


def hull_polygons(pose: Array, hull_b: Array) -> np.ndarray:
    """(k,) shapely polygons of the hull at each pose."""
    return np.asarray(shapely.polygons(hull_outlines(pose, hull_b)))


def swept_area(pose: Array, hull_b: Array) -> shapely.Geometry:
    """Everything the hull touches between consecutive poses: the union of the pairs' convex hulls."""
    return shapely.union_all(swept_hulls(pose, hull_b))


def swept_hulls(pose: Array, hull_b: Array) -> np.ndarray:
    """(k - 1,) convex hulls of the outlines at consecutive poses (k, 3); the outline itself where there is one pose."""
    corners = hull_outlines(pose, hull_b)
    if len(corners) == 1:
        return np.asarray(shapely.polygons(corners))
    return np.asarray(shapely.convex_hull(shapely.multipoints(np.concatenate([corners[:-1], corners[1:]], axis=1))))


def covering_discs(length_m: float, beam_m: float) -> tuple[Array, float]:
    """Forward positions (3,) and the radius of equal discs on the centre line that cover the hull [m]."""
    piece = length_m / 3
    return np.array([-piece, 0.0, piece]), float(np.hypot(piece / 2, beam_m / 2))


def thinned_poses(pose: Array, *, reach_m: float, spacing_m: float) -> np.ndarray:
    """Indices of poses (k, 3), the last one included: the first after each from which a point may have moved so far.

    Between two of them no point within `reach_m` of the origin moves farther than `spacing_m` and one step more.
    """
    kept = [0]
    for index in range(1, len(pose)):
        moved = np.hypot(*(pose[index, :2] - pose[kept[-1], :2]))
        swung = abs(pose[index, 2] - pose[kept[-1], 2]) * reach_m
        if moved + swung >= spacing_m:
            kept.append(index)
    return np.array([*kept, len(pose) - 1])


def disc_points(pose: Array, centres_m: Array) -> Array:
    """(k, c, 2) north/east of discs at forward positions (c,) on the centre lines of poses (k, 3)."""
    ahead = np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=-1)
    return np.asarray(pose[:, None, :2] + centres_m[:, None] * ahead[:, None, :])
