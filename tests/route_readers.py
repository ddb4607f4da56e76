"""Independent readers of every route format, and a schema for the one that publishes none."""

import csv
import io
import json

import gpxpy
import pytest
from lxml import etree
from shapely.geometry import shape

from expdesign.export.formats.missions import NAV_WAYPOINT

PLAN_SCHEMA = {
    "type": "object",
    "required": ["fileType", "version", "groundStation", "mission", "geoFence", "rallyPoints"],
    "properties": {
        "fileType": {"const": "Plan"},
        "version": {"const": 1},
        "groundStation": {"type": "string"},
        "mission": {
            "type": "object",
            "required": ["version", "firmwareType", "vehicleType", "cruiseSpeed", "hoverSpeed",
                         "globalPlanAltitudeMode", "plannedHomePosition", "items"],
            "properties": {
                "version": {"const": 2},
                "plannedHomePosition": {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number"}},
                "items": {
                    "type": "array",
                    "minItems": 1,
                    "items": {
                        "type": "object",
                        "required": ["type", "autoContinue", "command", "doJumpId", "frame", "params"],
                        "properties": {
                            "type": {"const": "SimpleItem"},
                            "autoContinue": {"type": "boolean"},
                            "command": {"type": "integer"},
                            "doJumpId": {"type": "integer", "minimum": 1},
                            "frame": {"type": "integer"},
                            "params": {"type": "array", "minItems": 7, "maxItems": 7,
                                       "items": {"type": ["number", "null"]}},
                        },
                        "additionalProperties": False,
                    },
                },
            },
        },
        "geoFence": {
            "type": "object",
            "required": ["circles", "polygons", "version"],
            "properties": {
                "version": {"const": 2},
                "polygons": {
                    "type": "array",
                    "items": {
                        "type": "object",
                        "required": ["inclusion", "polygon", "version"],
                        "properties": {
                            "inclusion": {"type": "boolean"},
                            "version": {"const": 1},
                            "polygon": {"type": "array", "minItems": 3,
                                        "items": {"type": "array", "minItems": 2, "maxItems": 2}},
                        },
                    },
                },
            },
        },
        "rallyPoints": {"type": "object", "required": ["points", "version"], "properties": {"version": {"const": 2}}},
    },
    "additionalProperties": False,
}  # fmt: skip
"""Written from the text of QGroundControl's developer guide: no schema is published."""


def read_rtz(content: bytes) -> list[tuple[float, float]]:
    return [(float(e.get("lat")), float(e.get("lon"))) for e in etree.fromstring(content).iter("{*}position")]


def read_kml(content: bytes) -> list[tuple[float, float]]:
    fastkml = pytest.importorskip("fastkml")
    kml = fastkml.KML.from_string(content.decode().partition("?>")[2])  # it takes no encoding declaration
    document = next(iter(kml.features))
    folder = next(f for f in document.features if f.name == "waypoints")
    return [(place.geometry.y, place.geometry.x) for place in folder.features]


def read_waypoints(content: bytes) -> list[tuple[float, float]]:
    rows = [line.split("\t") for line in content.decode().splitlines()[2:]]
    return [(float(row[8]), float(row[9])) for row in rows if int(row[3]) == NAV_WAYPOINT]


def read_plan_file(content: bytes) -> list[tuple[float, float]]:
    items = json.loads(content)["mission"]["items"]
    return [tuple(item["params"][4:6]) for item in items if item["command"] == NAV_WAYPOINT]


READERS = {
    "rtz": read_rtz,
    "rtz-1.0": read_rtz,
    "rtz-1.1": read_rtz,
    "gpx": lambda content: [(p.latitude, p.longitude) for p in gpxpy.parse(content.decode()).routes[0].points],
    "kml": read_kml,
    "geojson": lambda content: [
        (shape(f["geometry"]).y, shape(f["geometry"]).x)
        for f in json.loads(content)["features"]
        if f["geometry"]["type"] == "Point"
    ],
    "qgc": read_plan_file,
    "ardupilot": read_waypoints,
    "csv": lambda content: [
        (float(row["lat_deg"]), float(row["lon_deg"])) for row in csv.DictReader(io.StringIO(content.decode()))
    ],
}
