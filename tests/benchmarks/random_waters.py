"""The main command on waters that nobody made for it: template ships and ships of cards among random coasts.

Every case draws a coast with islands, start and goal at least four lengths off the shore, headings, a current of up to
a quarter of the speed of legs, and the informative time. Every fourth asks for an accuracy in the shortest day. What
comes of `expdesign run` is a plan that is verified, one that is not, or a refusal; its processor time counts as well.

    python tests/benchmarks/random_waters.py 12
    python tests/benchmarks/random_waters.py 36 --first 24 --keep waters

The numbers of cases are the seeds. With --keep the folders of the cases stay, else they are deleted.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import shapely
from shapely.affinity import translate

from expdesign.scenario import load_scenario

CARDS = Path(__file__).parents[2] / "scenarios/cards"
SHIPS = (
    *(("--kind", kind) for kind in ("azimuth", "propeller-rudder", "twin-screw", "asv")),
    *(("--card", str(CARDS / f"{name}.toml")) for name in ("coaster-80m", "offshore-45m")),
)
PLACES = ((-54.0, -70.0), (1.0, 150.0), (35.0, 25.0), (60.0, 5.0), (69.5, -70.0))
SIZES, TIMES = (0.8, 1.2, 2.0), (0.5, 1.0, 1.7)  # in those of the template's bay, and of its informative time
ISLANDS, CURRENT, OFF_HULLS = 8, 0.25, 4.0
UNSTATED_MPS = 3.0  # speed of legs that gives the current's scale, where the scenario states none
METRES_PER_DEGREE = 111_200.0
LONGEST_S = 1500.0


def expdesign(*words: str) -> subprocess.CompletedProcess[str]:
    """The command line in another process."""
    command = [sys.executable, "-m", "expdesign", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)


def coast(rng: np.random.Generator, radius_m: float, corners: int, rough: float = 0.35) -> shapely.Polygon:
    """A random outline about the origin, east and north [m]."""
    turned = np.sort(rng.uniform(0.0, 2 * np.pi, corners))
    away = radius_m * (1.0 + rough * rng.uniform(-1.0, 1.0, corners))
    return shapely.Polygon(np.column_stack([away * np.cos(turned), away * np.sin(turned)])).buffer(0)


def sea(rng: np.random.Generator, radius_m: float) -> shapely.Polygon:
    """Water inside a coast, without its islands."""
    water = coast(rng, radius_m, 24)
    for _ in range(int(rng.integers(0, ISLANDS + 1))):
        island = coast(rng, rng.uniform(0.02, 0.12) * radius_m, 9)
        water = water.difference(translate(island, *rng.uniform(-radius_m, radius_m, 2)))
    return max(getattr(water, "geoms", [water]), key=lambda part: part.area)


def place_in(rng: np.random.Generator, room: shapely.Geometry) -> np.ndarray:
    """(2,) a random place, east and north [m]."""
    west, south, east, north = room.bounds
    while True:
        place = np.array([rng.uniform(west, east), rng.uniform(south, north)])
        if shapely.contains_xy(room, *place):
            return place


def drawn(case: int, folder: Path) -> bool:
    """Write the scenario of a case; whether its water has room for start and goal."""
    rng = np.random.default_rng(5000 + case)
    made = expdesign("new", str(folder), *SHIPS[case % len(SHIPS)], "--quiet")
    assert made.returncode == 0, made.stderr
    path = folder / "scenario.toml"
    template, (lat, lon) = load_scenario(path), PLACES[int(rng.integers(len(PLACES)))]
    length_m = template.vessel.length_m
    width_m = float(np.ptp(np.reshape(template.area.water.bounds, (2, 2)), axis=0).max())
    radius_m = 0.35 * width_m * float(rng.choice(SIZES))
    water = sea(rng, radius_m)
    room = water.buffer(-max(OFF_HULLS * length_m, 0.06 * radius_m))
    if room.is_empty:
        return False
    scale = np.array([METRES_PER_DEGREE * np.cos(np.radians(lat)), METRES_PER_DEGREE])
    land = shapely.box(*(1.6 * radius_m * np.array([-1, -1, 1, 1]))).difference(water)
    chart = json.loads((folder / "area.geojson").read_text("utf-8"))
    properties = chart["features"][0]["properties"]
    chart["features"] = [
        {
            "type": "Feature",
            "properties": properties,
            "geometry": json.loads(shapely.to_geojson(shapely.transform(part, lambda xy: xy / scale + (lon, lat)))),
        }
        for part in getattr(land, "geoms", [land])
    ]
    (folder / "area.geojson").write_text(json.dumps(chart), "utf-8")
    text = path.read_text("utf-8")
    for end in ("start", "goal"):
        east, north = place_in(rng, room) / scale + (lon, lat)
        table = f"[{end}]\nlat_deg = {north:.6f}\nlon_deg = {east:.6f}\nheading_deg = {int(rng.integers(360))}\n\n"
        text = re.sub(rf"\[{end}\][^\[]*", table, text)
    speed_mps = template.plan.transit_speed_mps or UNSTATED_MPS
    flow, towards = rng.uniform(0.0, CURRENT) * speed_mps, rng.uniform(0.0, 2 * np.pi)
    current = f"north_mps = {flow * np.cos(towards):.3f}, east_mps = {flow * np.sin(towards):.3f}"
    text = re.sub(r"current_to = \{[^}]*\}", f"current_to = {{ {current}, std_mps = {0.02 * speed_mps:.3f} }}", text)
    total_s = template.design.total_s * float(rng.choice(TIMES))
    text = re.sub(r"total_s = [\d.]+", f"total_s = {total_s:g}", text)
    if case % 4 == 3 and "[design.accuracy]" not in text:
        text = text.replace("[start]", '[design.accuracy]\nas = "durations"\n\n[start]', 1)
    path.write_text(text, "utf-8")
    return True


def outcome(case: int, folder: Path) -> tuple[str, str]:
    """What came of a case, in a word, and the rest of its line."""
    if not drawn(case, folder):
        return "no room", ""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    try:
        done = expdesign("run", str(folder / "scenario.toml"), "--out", str(folder / "out"), "--jobs", "1")
    except subprocess.TimeoutExpired:
        return "not ended", f"{LONGEST_S:g} s"
    spent_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    (folder / "log.txt").write_text(done.stdout + done.stderr, "utf-8")
    plan = folder / "out/plan.json"
    drawn_trials = json.loads(plan.read_text("utf-8"))["drawn_trials"] if plan.exists() else None
    aborted = f"{drawn_trials['aborted_share']:6.1%} aborted" if drawn_trials else ""
    word = {0: "verified", 3: "not verified" if plan.exists() else "refused"}.get(done.returncode, "failed")
    why = "" if done.returncode == 0 else done.stderr.strip().splitlines()[-1][:160]
    return word, f"{spent_s:5.0f} s  {aborted}  {why}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("last", type=int, help="number of the case after the last")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--keep", type=Path, help="folder in which the cases stay")
    asked = parser.parse_args()
    told = Counter[str]()
    with tempfile.TemporaryDirectory() as scratch:
        root = asked.keep or Path(scratch)
        root.mkdir(parents=True, exist_ok=True)
        for case in range(asked.first, asked.last):
            word, rest = outcome(case, root / f"water-{case}")
            told[word] += 1
            ship = Path(SHIPS[case % len(SHIPS)][1]).stem
            print(f"{case:3d}  {ship:17s} {word:13s} {rest}".rstrip(), flush=True)
    print(", ".join(f"{word} {count}" for word, count in told.most_common()))


if __name__ == "__main__":
    main()
