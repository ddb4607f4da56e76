"""GeoJSON for maps and geographic information systems.

Source: RFC 7946 (2016): WGS84, longitude first, lines cut at the antimeridian (section 3.1.9).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any

from expdesign.export.files import entry, strict_json
from expdesign.export.formats.format import Format, route_file
from expdesign.export.routes import Route, Waypoint

Position = tuple[float, float]


def write(route: Route) -> bytes:
    """A feature collection: a line for each leg that moves the ship, a point for each waypoint, and the fence."""
    collection = {
        "type": "FeatureCollection",
        "features": [*_lines(route), *(_point(route, waypoint) for waypoint in route.waypoints), *_water(route)],
    }
    return strict_json(collection).encode()


def _lines(route: Route) -> list[dict[str, Any]]:
    chords = groupby(pairwise(route.waypoints), key=lambda chord: chord[1].leg)
    return [_line(leg, list(of_leg)) for leg, of_leg in chords]


def _line(leg: int, chords: list[tuple[Waypoint, Waypoint]]) -> dict[str, Any]:
    end = chords[-1][1]
    positions = [_position(waypoint) for waypoint in (chords[0][0], *(chord[1] for chord in chords))]
    properties = {
        "leg": leg,
        "kind": end.leg_kind,
        "name": end.leg_name,
        "start_time_s": chords[0][0].time_s + chords[0][0].stay_s,
        "end_time_s": end.time_s,
        "xtd_port_m": max(chord[1].xtd_port_m for chord in chords),
        "xtd_starboard_m": max(chord[1].xtd_starboard_m for chord in chords),
    }
    return {"type": "Feature", "geometry": _geometry(positions), "properties": properties}


def _point(route: Route, waypoint: Waypoint) -> dict[str, Any]:
    properties = {
        "waypoint": waypoint.name,
        **entry(waypoint, "time_s", "stay_s", "speed_mps", "xtd_port_m", "xtd_starboard_m", "leg"),
        "xtd_m": route.xtd_m,
        "runs_here": waypoint.held,
    }
    geometry = {"type": "Point", "coordinates": list(_position(waypoint))}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _water(route: Route) -> list[dict[str, Any]]:
    """The fence as a polygon: outer ring counter-clockwise, holes clockwise (RFC 7946, 3.1.6)."""
    if route.fence is None or crosses_antimeridian(route.fence.inside):
        return []
    rings = [[[lon, lat] for lat, lon in (*ring, ring[0])] for ring in (route.fence.inside, *route.fence.outside)]
    properties = {"name": "allowed water around the track, conservatively simplified"}
    return [{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": rings}, "properties": properties}]


def crosses_antimeridian(ring: Sequence[Position]) -> bool:
    """Whether a ring of (latitude, longitude) [deg] jumps from 180 to -180."""
    return any(abs(two[1] - one[1]) > 180.0 for one, two in pairwise((*ring, ring[0])))


def _position(waypoint: Waypoint) -> Position:
    return waypoint.lon_deg, waypoint.lat_deg


def _geometry(positions: list[Position]) -> dict[str, Any]:
    parts = cut_at_antimeridian(positions)
    lines = [[list(position) for position in part] for part in parts]
    if len(lines) == 1:
        return {"type": "LineString", "coordinates": lines[0]}
    return {"type": "MultiLineString", "coordinates": lines}


def cut_at_antimeridian(positions: list[Position]) -> list[list[Position]]:
    """Lines of (longitude, latitude) [deg], none of which crosses from 180 to -180."""
    parts = [[positions[0]]]
    for (lon_a, lat_a), (lon_b, lat_b) in pairwise(positions):
        if abs(lon_b - lon_a) > 180.0:
            side = 180.0 if lon_a > 0 else -180.0
            share = (side - lon_a) / (lon_b + 2 * side - lon_a)
            latitude = lat_a + share * (lat_b - lat_a)
            if lon_a != side:
                parts[-1].append((side, latitude))
            parts.append([(-side, latitude)] if lon_b != -side else [])
        parts[-1].append((lon_b, lat_b))
    return [part for part in parts if len(part) > 1]


FORMAT = Format(
    name="geojson", file_name=route_file("geojson"), summary="lines and points for maps (RFC 7946)", write=write
)
