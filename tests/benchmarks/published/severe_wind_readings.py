"""Which reading of the study's pulses gives the published bias of surge in severe wind without measured wind.

`python tests/benchmarks/published/severe_wind_readings.py [--runs N] [--sets N]`: the source gives IV2 a mean error of
X_u of -0.156 with a spread of 0.030, and of X_|u|u + W_|u|u 1.04 with 0.21. It does not give the pulses. The bias comes
from the relative wind's changes of sign, so it hangs on the headings that an input leads to. Each reading has sets with
an input each; told are the least and the largest mean error of a set, and the mean spread within sets.

Source: F. Ljungberg, doctoral thesis, Linköping University, 6.1.2, (6.3), table 6.6.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.errors import NoAnswer
from manoeuvring import MARGIN_MPS, SEVERE, Outcome, run_case
from pulses import Pulses
from shared_work import add_sharing, shared_work

MARGINS = {"kept": MARGIN_MPS, "not looked at": -np.inf}
SPEED_SHARES, ANGLES_RAD = (0.3, 0.7), (0.2, 0.35, 0.6)
WIDTHS = ((5, 50), (20, 200))
TOLD = ("X_u", "X_abs_u_u")


def row(condition: str, pulses: Pulses, sets: list[Outcome], tried: int) -> str:
    """Of the table, from the sets that settled among those tried."""
    cells = []
    for name in TOLD:
        place = sets[0].parameters.index(name) if sets else 0
        means, spreads = [item.mean[place] for item in sets], [item.spread[place] for item in sets]
        cells.append(f"{min(means):+.3f} to {max(means):+.3f} ± {np.mean(spreads):.3f}" if sets else "-")
    widths = f"{pulses.shortest} to {pulses.longest}"
    reading = f"{condition} | {pulses.speed_share} | {pulses.angle_spread_rad} | {widths}"
    return f"| {reading} | {' | '.join(cells)} | {len(sets)} of {tried} |"


def main() -> None:
    """Print one row for each reading."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--sets", type=int, default=3)
    add_sharing(parser)
    chosen = parser.parse_args()
    print("| (5.77) | speed share | angles [rad] | widths | X_u | X_abs_u_u | inputs settled |")
    print("|---|---|---|---|---|---|---|")
    with shared_work(chosen):
        for condition, share, angle, (shortest, longest) in product(MARGINS, SPEED_SHARES, ANGLES_RAD, WIDTHS):
            pulses = replace(Pulses(), speed_share=share, angle_spread_rad=angle, shortest=shortest, longest=longest)
            found = []
            for number in range(chosen.sets):
                rng = np.random.default_rng([2, number])
                try:
                    found += run_case(
                        SEVERE,
                        runs=chosen.runs,
                        rng=rng,
                        estimators=("IV2",),
                        pulses=pulses,
                        margin_mps=MARGINS[condition],
                    )
                except NoAnswer:
                    continue  # no such input keeps the condition, or none gives an estimate
            print(row(condition, pulses, [item for item in found if item.settled > 1], chosen.sets), flush=True)


if __name__ == "__main__":
    main()
