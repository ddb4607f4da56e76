"""How long a diagnosis of an hour of trials takes: 8 runs of 450 s at 1 Hz, every cause of the catalogue looked for.

``python tests/benchmarks/diagnosis_speed.py [--ship tug] [--seed 1] [--std 0.1]``

For each ship of `hidden_effects`: with nothing hidden, with one effect, with two. Beside the time stands how many
simulations of the whole data that is, which does not depend on the machine.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
import hidden_effects as sea
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.simulation import simulate_from_measured
from expdesign.diagnosis.vessel_file.reading import extended_model

RUNS, SAMPLES, TIMES = 8, 450, 5
HIDDEN = {
    "nothing": {},
    "thrust_gain": {"effects": {"gain": -0.15}},
    "load_change and heading_bias": {"effects": {"load_r": 0.3}, "faults": {"heading_bias": 0.05}},
}


def simulation_s(ship: str, record) -> float:
    """Of all data, once."""
    extended = extended_model(vessel_of(ship), record)
    windows = cut_windows(extended.model, record)
    begin = time.perf_counter()
    for _ in range(TIMES):
        simulate_from_measured(extended, windows)
    return (time.perf_counter() - begin) / TIMES


def main() -> None:
    """Print a line per trial."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--ship", choices=tuple(sea.SHIPS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--std", type=float, default=0.0, help="relative, of all parameters")
    chosen = parser.parse_args()
    for ship in (chosen.ship,) if chosen.ship else tuple(sea.SHIPS):
        for what, options in HIDDEN.items():
            record = hidden_record(ship, seed=chosen.seed, batches=RUNS, samples=SAMPLES, relative_std=chosen.std,
                                   **options)  # fmt: skip
            begin = time.perf_counter()
            found = diagnose(vessel_of(ship, relative_std=chosen.std), record)
            taken = time.perf_counter() - begin
            names = " and ".join(item.cause for item in found.findings) or "nothing"
            times = taken / simulation_s(ship, record)
            print(f"{ship:8} {what:30} {taken:6.1f} s = {times:6.0f} simulations, found: {names}", flush=True)


if __name__ == "__main__":
    main()
