"""Route file formats: all in one visible tuple."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.errors import UnknownName
from expdesign.export.formats import geojson, gpx, kml, missions, route_csv, rtz
from expdesign.export.formats.format import Format, named_file
from expdesign.export.routes import Route

FORMATS: tuple[Format, ...] = (
    route_csv.FORMAT,
    geojson.FORMAT,
    gpx.FORMAT,
    kml.FORMAT,
    rtz.FORMAT,
    *rtz.OLDER,
    missions.PLAN,
    missions.WAYPOINTS,
)
STANDARD = ("rtz", "gpx", "kml", "geojson", "qgc", "ardupilot", "csv")  # formats that every plan is written in


def find_format(name: str) -> Format:
    """The format of a name.

    Raises:
        UnknownName: there is none; the message lists those there are.
    """
    for known in FORMATS:
        if known.name == name:
            return known
    raise UnknownName("route format", name, known=[known.name for known in FORMATS])


def route_files(route: Route, formats: Sequence[str]) -> dict[str, bytes]:
    """File name -> content of the route in the named formats, ready to be written.

    Raises:
        UnknownName: a format that does not exist; nothing is written then.
    """
    chosen = [find_format(name) for name in formats]
    return {named_file(known.file_name, route): known.write(route) for known in chosen}
