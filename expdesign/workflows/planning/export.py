"""`expdesign export`: route files of a plan made before."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from expdesign.errors import InputError
from expdesign.export import (
    FORMATS,
    build_route,
    find_format,
    route_files,
    write_files,
)
from expdesign.export.routes import read_plan
from expdesign.progress import Progress, silent
from expdesign.workflows.outcome import Outcome


def export(
    plan: Path,
    out: Path | None,
    *,
    formats: Sequence[str],
    departure: str | None = None,
    tolerance_m: float | None = None,
    progress: Progress = silent,
) -> Outcome:
    """Route files of a plan made before, into `out` or beside it; with times where a departure is given."""
    if not formats:
        raise InputError(f"no route format is named; there are {', '.join(item.name for item in FORMATS)}")
    for name in formats:
        find_format(name)
    progress("reading the plan", 0.1)
    route = build_route(read_plan(plan), departure=_departure(departure), tolerance_m=tolerance_m)
    files = write_files(out or plan.parent, route_files(route, tuple(dict.fromkeys(formats))))
    summary = {
        "waypoints": len(route.waypoints),
        "length_m": route.length_m,
        "cross_track_distance_m": route.xtd_m,
        "track_within_m": route.fit.largest_m,
        "legs_in_allowed_water": route.fit.in_water,
    }
    return Outcome(files=files, summary=summary)


def _departure(text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"--departure is {text!r}, expected a time such as 2026-05-01T08:00:00Z") from None
