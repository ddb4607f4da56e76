"""A small, correct set of scenario files in a folder, to be spoilt one entry at a time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

SCENARIOS = Path(__file__).parents[1] / "scenarios"  # the examples
SCENARIO = """
[scenario]
name = "square"
vessel = "vessel.toml"
dictionary = "dictionary.toml"
area = "area.toml"
[design]
total_s = 600
criterion = "D"
fixed_parameters = []
[start]
north_m = 200
east_m = -400.0
heading_deg = 90
[goal]
lat_deg = 0.0
lon_deg = 0.0045
heading_deg = 0.0
[environment]
current_to = {north_mps = 0.1, east_mps = 0.0, std_mps = 0.05}
wind_to = {north_mps = 3.0, east_mps = -2}
[plan]
clearance_m = 20.0
confidence = 0.9
"""

VESSEL = """
[vessel]
name = "a ship"
length_m = 30
beam_m = 9.0
draught_m = 2.5
sample_time_s = 1.0
[[actuators]]
kind = "azimuth"
forward_m = 9.0
speed_min_rps = -15.0
speed_max_rps = 15.0
speed_rate_rps2 = 1.5
angle_rate_radps = 0.25
[[actuators]]
kind = "tunnel"
forward_m = -9.0
speed_min_rps = -10.0
speed_max_rps = 10.0
[model]
structure = "surge"
form = "discrete"
[model.parameters]
X_u = -0.2
X_abs_u_u = -0.05
W_abs_u_u = 0.0
X_mu = 0.01
[model.parameter_std]
X_u = 0.06
[sensors]
velocity_mps = 0.01
"""

DICTIONARY = """
[dictionary]
name = "small"
[[primitives]]
family = "acceleration"
duration_s = 60
speed_mps = 1.2
[[primitives]]
name = "zz"
family = "zigzag"
duration_s = 240.0
period_s = 80.0
speed_mps = [0.5, 1.1]
yaw_rate_radps = 0.02
"""

AREA = """
[area]
name = "a square"
[chart]
geojson = "chart.geojson"
land_layers = ["land"]
depth_layers = {seabed5m = 5.0, seabed20m = 20}
notice = "invented"
[bounds]
south_deg = -0.01
west_deg = -0.01
north_deg = 0.01
east_deg = 0.01
[depth]
under_keel_m = 1.0
[[no_go]]
name = "wreck"
polygon = [[0.006, 0.006], [0.006, 0.008], [0.008, 0.008], [0.008, 0.006]]
"""


def square(half_deg: float, *, lon_deg: float = 0.0, lat_deg: float = 0.0) -> list[list[float]]:
    """A closed GeoJSON ring around a position."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    return [[lon_deg + x * half_deg, lat_deg + y * half_deg] for x, y in corners]


def feature(layer: object, *rings: object, kind: str = "Polygon") -> dict[str, Any]:
    """A GeoJSON feature."""
    coordinates: object = rings if kind == "Polygon" else rings[0]
    return {"type": "Feature", "properties": {"layer": layer}, "geometry": {"type": kind, "coordinates": coordinates}}


def collection(*features: object) -> dict[str, Any]:
    """A GeoJSON feature collection."""
    return {"type": "FeatureCollection", "features": list(features)}


def square_chart() -> dict[str, Any]:
    """A frame of land around a square of water (half side 0.008 degrees, about 890 m) with depth layers."""
    return collection(
        feature("land", square(0.02), square(0.008)[::-1]),
        feature("seabed5m", square(0.0075)),
        feature("seabed20m", square(0.002)),
        feature("buoy", [0.0, 0.0], kind="Point"),
    )


def write_scenario(folder: Path) -> Path:
    """Write all files; the scenario's path."""
    (folder / "vessel.toml").write_text(VESSEL, encoding="utf-8")
    (folder / "dictionary.toml").write_text(DICTIONARY, encoding="utf-8")
    (folder / "area.toml").write_text(AREA, encoding="utf-8")
    (folder / "chart.geojson").write_text(json.dumps(square_chart()), encoding="utf-8")
    (folder / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    return folder / "scenario.toml"


def spoil(path: Path, old: str, new: str) -> None:
    """Replace the first occurrence of a piece of a file, which must be there."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
