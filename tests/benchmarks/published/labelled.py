"""Designs from labelled data, optimised beside random subsets by simulation error: `published/labelled.py [--data F]`.

Repeats figures 9.9 to 9.12 of the source, whose data are not public, on other data: runs tau1 to tau11 of the simulated
model ship (five whole runs of each, three pieces in a design); runs tau12 to tau20 of the simulated full-scale ship
(four of each, six pieces; tau16 to tau18 in 10 m/s of wind, as in the source, unknown to the model); and, with --data,
trials of a 3 m tanker on a pond (four random, turning, zig-zag runs each; pieces of 60 s at 10 Hz, six in a design).
500 draws of each design, a fifth of them for the tanker. Source: on its model ship random designs are degenerate in
about 20 %, and optimised ones are not.

Source: F. Ljungberg, doctoral thesis, Linköping University, 9.2 and 9.3.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from expdesign.dictionary import build_dictionary
from expdesign.export.files import vessel_toml
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.simulation import Environment
from expdesign.vessel import Sensors, Variation, Vessel, VesselModel, structure_terms
from expdesign.workflows import mine
from labelled_trials import Weather, calm, sailed, write_labelled
from real_data_cases import POND, vessel_of

SCENARIOS = Path(__file__).parents[3] / "scenarios"
TABLE = "| data | design | its pieces | median error | 95 % below | degenerate |\n|---|---|---|---|---|---|\n"
KINDS = ("random", "turn", "zigzag")


def windy(label: str, number: int) -> Environment:
    """10 m/s for tau16 to tau18 and every other run, else 3 m/s, from various sides, varying by a tenth."""
    speed = 10.0 if label in ("tau16", "tau17", "tau18") or number % 2 else 3.0
    angle = 0.7 * number
    return Environment(
        wind_to=speed * np.array([np.cos(angle), np.sin(angle)]),
        wind_variation=Variation(std_mps=0.1 * speed, correlation_s=20.0),
    )


def simulated(folder: Path, truth: Vessel, dictionary: str, *, ranges: Vessel, count: int, weather: Weather) -> Path:
    """A folder of labelled runs."""
    primitives = build_dictionary(ranges, load_dictionary(SCENARIOS / "dictionaries" / f"{dictionary}.toml"))
    return write_labelled(folder, sailed(truth, primitives, count=count, weather=weather, integrator="euler"))


def unknown(ship: Vessel) -> Vessel:
    """The ship with the simple structure (9.1) and nothing known: instruments come from least squares."""
    terms = structure_terms("manoeuvring-10")
    zeros = np.zeros(len(terms))
    model = VesselModel(
        terms=terms,
        parameters=zeros,
        parameter_std=zeros,
        form="discrete",
        sample_time_s=ship.sample_time_s,
        actuators=ship.model.actuators,
    )
    return replace(ship, name="unknown", model=model)


def rows(
    name: str, data: Sequence[Path], ship: Vessel, folder: Path, *, piece_s: float, keep: int, draws: int
) -> Iterator[str]:
    """Rows of the table."""
    vessel = folder / "ship.toml"
    vessel.write_text(vessel_toml(ship), encoding="utf-8")
    outcome = mine(data, folder / "out", vessel=vessel, keep=keep, piece_s=piece_s, labels="file", draws=draws)
    design = ", ".join(f"{count} {label}" for label, count in outcome.summary["pieces_of_design"].items())
    told = json.loads((folder / "out" / "subsets.json").read_text("utf-8"))["designs"]
    for kind, item in told.items():
        error = (item["degenerate"] * (1 - item["degenerate"]) / draws) ** 0.5
        cells = (_shown(item["median_norm"]), _shown(item["norm_95_percent"]))
        share = f"{100 * item['degenerate']:.1f} ± {100 * error:.1f} %"
        yield f"| {name} | {kind} | {design if kind == 'optimised' else ''} | {' | '.join(cells)} | {share} |\n"


def _shown(value: float | None) -> str:
    return "diverges" if value is None else f"{value:.3g}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--data", type=Path, help="folder with the folder of the tanker")
    chosen = parser.parse_args(arguments)
    n = chosen.draws
    sys.stdout.write(
        "| data | design | its pieces | median error | 95 % below | degenerate |\n|---|---|---|---|---|---|\n"
    )
    small, true, fast = (
        load_vessel(SCENARIOS / "vessels" / f"{name}.toml")
        for name in ("model-ship", "model-ship-true", "azimuth-30m-fast-true")
    )
    noisy = replace(true, sensors=Sensors(velocity_mps=0.05, yaw_rate_radps=0.05))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        runs = simulated(folder / "small", noisy, "model-ship", ranges=small, count=5, weather=calm)
        sys.stdout.writelines(rows("model ship", [runs], unknown(true), folder, piece_s=37.0, keep=3, draws=n))
        runs = simulated(folder / "fast", fast, "full-scale", ranges=fast, count=4, weather=windy)
        sys.stdout.writelines(rows("full scale", [runs], unknown(fast), folder, piece_s=99.0, keep=6, draws=n))
        if chosen.data:
            files = [path for kind in KINDS for path in sorted((chosen.data / POND.folder).glob(f"{kind}_*.csv"))[:4]]
            ship = vessel_of(POND)
            sys.stdout.writelines(rows("tanker", files, ship, folder, piece_s=60.0, keep=6, draws=n // 5))
    return 0


if __name__ == "__main__":
    sys.exit(main())
