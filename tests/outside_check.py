"""An outside program's view of a plan: it reads the chart, the vessel file and the result files, and imports nothing
of the package. Its projection, integrator, model and hull geometry are its own.
"""

from __future__ import annotations

import csv
import json
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import shape


def columns(path: Path) -> dict[str, np.ndarray]:
    """A CSV file of numbers by column."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    table = np.array(rows[1:], dtype=float)
    return dict(zip(rows[0], table.T, strict=True))


def hull_to_land_m(track: dict[str, np.ndarray], chart: Path, length_m: float, beam_m: float) -> np.ndarray:
    """Distance of the hull's rectangle from land at every sample, by a plate carree frame of its own."""
    land = shapely.union_all([shape(item["geometry"]) for item in json.loads(chart.read_text())["features"]])
    lat, lon = track["lat_deg"], track["lon_deg"]
    middle = np.radians(lat.mean())
    # metres per degree on WGS84, series of the US National Geospatial-Intelligence Agency
    north_m = 111132.92 - 559.82 * np.cos(2 * middle) + 1.175 * np.cos(4 * middle)
    east_m = 111412.84 * np.cos(middle) - 93.5 * np.cos(3 * middle)
    scale = np.array([east_m, north_m])
    land = shapely.transform(land, lambda xy: (xy - [lon.mean(), lat.mean()]) * scale)
    place = (np.stack([lon, lat], axis=1) - [lon.mean(), lat.mean()]) * scale
    c, s = np.cos(track["heading_rad"])[:, None], np.sin(track["heading_rad"])[:, None]
    ahead = np.array([1, -1, -1, 1]) * length_m / 2
    side = np.array([1, 1, -1, -1]) * beam_m / 2
    east = place[:, :1] + ahead * s + side * c
    north = place[:, 1:] + ahead * c - side * s
    return shapely.distance(shapely.polygons(np.stack([east, north], axis=-1)), land)


def replayed(commands: dict[str, np.ndarray], track: dict[str, np.ndarray], vessel: Path) -> np.ndarray:
    """(k + 1, 2) north/east by running the commands from the track's first row, by Heun steps an eighth of a sample."""
    ship = tomllib.loads(vessel.read_text())
    theta, sample_s = ship["model"]["parameters"], ship["vessel"]["sample_time_s"]
    places = [(item.get("forward_m", 0.0), item.get("starboard_m", 0.0)) for item in ship["actuators"]]
    inputs = np.stack([values for name, values in commands.items() if name not in ("time_s", "leg")], axis=1)

    def force(row: np.ndarray) -> np.ndarray:
        if len(row) == 3:
            return row
        n, a = row[::2], row[1::2]
        levers = np.array(places)
        moment = n * (levers[:, 0] * np.sin(a) - levers[:, 1] * np.cos(a))
        return np.array([(n * np.cos(a)).sum(), (n * np.sin(a)).sum(), moment.sum()])

    def slope(x: np.ndarray, tau: np.ndarray) -> np.ndarray:
        u, v, r = x[3:]
        t = lambda name: theta.get(name, 0.0)  # noqa: E731
        surge = t("X_u") * u + t("X_vr") * v * r + t("X_abs_u_u") * abs(u) * u + (t("X_mu") + t("X_kappa") * u) * tau[0]
        sway = (
            t("Y_v") * v + t("Y_ur") * u * r + (t("Y_abs_v_v") * v + t("Y_abs_v_r") * r) * abs(v) + t("Y_mu") * tau[1]
        )
        yaw = t("N_r") * r + t("N_uv") * u * v + (t("N_abs_v_v") * v + t("N_abs_v_r") * r) * abs(v) + t("N_mu") * tau[2]
        c, s = np.cos(x[2]), np.sin(x[2])
        return np.array([u * c - v * s, u * s + v * c, r, surge / sample_s, sway / sample_s, yaw / sample_s])

    x = np.array([track[name][0] for name in ("north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps")])
    places_sailed = [x[:2]]
    step = sample_s / 8
    for row in inputs:
        tau = force(row)
        for _ in range(8):
            first = slope(x, tau)
            x = x + step / 2 * (first + slope(x + step * first, tau))
        places_sailed.append(x[:2])
    return np.array(places_sailed)


def recomputed_gap(folder: Path) -> float:
    """max_q trace(B(w)^-1 B_q) / dimension - 1 from dictionary.json and the fractions of durations.json.

    Manoeuvres added for a short day have no part in the durations that state its accuracy.
    """
    dictionary = json.loads((folder / "dictionary.json").read_text())
    day = folder / "day.json"
    added = json.loads(day.read_text())["added"] if day.exists() else {}
    durations = json.loads((folder / "durations.json").read_text())["primitives"]
    fractions = [item["fraction"] for item in durations if item["name"] not in added]
    n = len(dictionary["outputs"])
    parts = np.array(
        [
            np.block([[np.array(q["X"]), np.array(q["Y"])], [np.array(q["Z"]).T, np.eye(n)]])
            for q in dictionary["primitives"]
            if q["name"] not in added
        ]
    )
    root = np.sqrt(np.einsum("qii->i", parts))
    parts = parts / np.outer(root, root)
    inverse = np.linalg.inv(np.tensordot(fractions, parts, axes=1))
    return float(np.einsum("ij,qji->q", inverse, parts).max() / len(root) - 1)


def runs_of_plan(folder: Path) -> tuple[Counter[str], Counter[str]]:
    """Runs that the plan has, and runs that the durations ask for."""
    plan = json.loads((folder / "plan.json").read_text())
    asked = {
        item["name"]: item["repeats"] for item in json.loads((folder / "durations.json").read_text())["primitives"]
    }
    done = Counter(leg["name"] for leg in plan["legs"] if leg["kind"] == "primitive")
    return done, Counter({name: count for name, count in asked.items() if count})
