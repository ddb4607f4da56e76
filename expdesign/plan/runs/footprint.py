"""Runs as placed shapes: the discs that cover the swept hull, the clearance they need, and the displacement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.values import Array
from expdesign.vessel.hull import covering_discs, disc_points, thinned_poses


@dataclass(frozen=True, kw_only=True, eq=False)
class Footprint:
    """A primitive as the search places it.

    Attributes:
        name: of the primitive.
        discs: (n, 2) forward/starboard centres of the discs that cover its swept hull [m].
        times_s: (n,) when the hull is there [s].
        room_m: (n,) clearance that each disc centre needs [m].
        displacement: (3,) forward m, starboard m, turn rad through water.
        duration_s: of one run [s].
        entry_mps, exit_mps: surge speed at its ends.
    """

    name: str
    discs: Array
    times_s: Array
    room_m: Array
    displacement: Array
    duration_s: float
    entry_mps: float
    exit_mps: float

    @property
    def needs(self) -> str:
        """The water that it needs, in words."""
        return (
            f"it goes up to {np.hypot(*self.discs.T).max():.4g} m from its start and needs up to "
            f"{self.room_m.max():.4g} m round its centre line (hull, plan.clearance_m, and what the vessel's "
            "parameter_std and the forecast add at plan.confidence)"
        )

    @property
    def displacement_m(self) -> float:
        """Distance made good through water."""
        return float(np.hypot(*self.displacement[:2]))

    @property
    def course_rad(self) -> float:
        """Course made good, from the heading at the beginning."""
        return float(np.arctan2(self.displacement[1], self.displacement[0]))

    @property
    def course_from_end_rad(self) -> float:
        """Course made good, from the heading at the end."""
        return self.course_rad - float(self.displacement[2])


def footprint(primitive: Primitive, room_m: Array, *, length_m: float, beam_m: float) -> Footprint:
    """Reduce a primitive to what the search needs; `room_m` (k + 1,) is the clearance for discs at each sample."""
    centres, _ = covering_discs(length_m, beam_m)
    pose = primitive.trajectory.pose
    kept = thinned_poses(pose, reach_m=length_m / 2, spacing_m=length_m / 4)
    return Footprint(
        name=primitive.name,
        discs=disc_points(pose[kept], centres).reshape(-1, 2),
        times_s=np.repeat(kept * primitive.trajectory.sample_time_s, len(centres)),
        room_m=np.repeat(room_m[kept], len(centres)),
        displacement=primitive.displacement,
        duration_s=primitive.duration_s,
        entry_mps=float(primitive.entry_velocity[0]),
        exit_mps=float(primitive.exit_velocity[0]),
    )
