"""Whether both axes of the positions have one unit: a ship moves along her heading, whatever her course.

    east' cos(heading) = a north' sin(heading) + sway + stream + bias ahead'        a = scale of east / scale of north

With both axes alike a is one, as what remains is the sway alone, which follows the turn, and the way ahead times a bias
of the heading. An axis in feet, or degrees of longitude that were not shortened by the cosine of the latitude, make it
another, on tracks that bend enough to tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from expdesign.conventions import plus_minus
from expdesign.kinematics.instruments import Finding
from expdesign.kinematics.relation import relation, stretches
from expdesign.signals import Batch
from expdesign.values import Array

AXES_MATTER = 0.3  # difference of the scales of both axes that is told; slow sway may look like half of it
EXPLAINED = 0.5  # least share of the way along one axis that the other then explains


def axes_of_positions(batches: Sequence[Batch], *, length_m: float) -> Iterator[Finding]:
    """The scale of east over that of north, where it certainly is not one.

    Args:
        batches: of which those with positions and headings are compared.
    """
    own = [batch for batch in batches if batch.pose is not None]
    found = relation(stretches(own, [_ways(batch) for batch in own], length_m=length_m))
    if found is None or found.ratio.real <= 0.0 or found.share < EXPLAINED:
        return
    if found.differs(1.0, by=AXES_MATTER):
        ratio, std = found.size, found.size_std
        yield Finding(
            name="position_axes", value=ratio, std=std, rest=found.rest,
            text=f"positions move {plus_minus(ratio, std)} times as far to east as to north for the same way along the "
            "heading: has one axis another unit (feet are 0.3048 m), or are degrees of longitude not shortened by the "
            "cosine of the latitude? Nothing that follows from these positions is right.",
        )  # fmt: skip


def _ways(batch: Batch) -> Array:
    """(k, 6) running way to east by cosine and to north by sine of the heading, heading, way ahead, stream to both."""
    assert batch.pose is not None
    north, east, heading = batch.pose.T
    middle = (heading[1:] + heading[:-1]) / 2.0
    along = np.diff(east) * np.cos(middle), np.diff(north) * np.sin(middle)
    ahead = np.diff(north) * np.cos(middle) + np.diff(east) * np.sin(middle)
    stream = np.cos(middle) * batch.sample_time_s, np.sin(middle) * batch.sample_time_s
    own, other, *rest = (np.cumsum(np.append(0.0, part)) for part in (*along, ahead, *stream))
    return np.column_stack([own, other, heading, *rest])
