"""The area that the hull covers during a run with random ship, current and wind."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.export.report.content import ReportContent
from expdesign.export.tuning import TUNING
from expdesign.plan.runs import dispersion_m
from expdesign.values import Array
from expdesign.vessel.hull import covering_discs, hull_polygons


def footprints(content: ReportContent) -> list[shapely.Geometry]:
    """The area (east, north) that the hull covers in each run with the plan's confidence; none where not computable."""
    plan, vessel = content.plan, content.vessel
    centres, _ = covering_discs(vessel.length_m, vessel.beam_m)
    primitives = {item.primitive.name: item.primitive for item in content.information}
    radii: dict[str, Array | None] = {}
    found = []
    for leg in plan.legs:
        if leg.kind != "primitive" or leg.name not in primitives:
            continue
        if leg.name not in radii:
            try:
                radii[leg.name] = dispersion_m(
                    vessel,
                    primitives[leg.name],
                    content.environment,
                    centres_m=centres,
                    confidence=content.confidence,
                    rng=np.random.default_rng(TUNING.footprint_seed),
                )
            except NoPlan:
                radii[leg.name] = None
        radius = radii[leg.name]
        if radius is not None:
            found.append(_covered(plan.trajectory.pose[leg.first : leg.last + 1], radius, vessel.hull_b))
    return found


def _covered(pose: Array, radius: Array, hull_b: Array) -> shapely.Geometry:
    count = min(len(pose), len(radius))
    chosen = np.unique(np.linspace(0, count - 1, TUNING.footprint_pieces).round().astype(int))
    grown = shapely.buffer(hull_polygons(pose[chosen], hull_b), radius[chosen], quad_segs=4)
    spans = [shapely.union_all(pair).convex_hull for pair in pairwise(grown)]
    return shapely.union_all(spans)
