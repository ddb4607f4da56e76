"""Changes of roll, named or not: `python tests/benchmarks/roll_changes.py STUDY [--runs N] [--seed N]`.

record: a minute against the vessel file, as `expdesign diagnose` judges it, at a chance of 1 % of a false change.
watch: two minutes against three pieces of reference, as `expdesign monitor` judges them; the same ship at one false
alarm in a hundred pieces, changed ones at one in 60 days.

The ship is scenarios/vessels/roll-model.toml, her file certain, in still water and in waves with a period of 1.2 s.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from expdesign.errors import NotInformative
from expdesign.monitoring import RollWatch, roll_learnt, roll_watched
from expdesign.roll import Run
from expdesign.roll.record import judge_roll
from expdesign.vessel import RollPendulum
from expdesign.waves import Waves
from rolling_ship import HIGH, measured, roll_model

SHIP = roll_model()
assert SHIP.pendulum is not None
FILE = replace(SHIP.pendulum, parameter_std={})
K, D = (FILE.parameters[name] for name in ("k", "d"))
CHANGES = {
    "none": FILE,
    "k, stability -20 %": replace(FILE, parameters={**FILE.parameters, "k": K - 0.2 * FILE.righting_nm}),
    "d +50 %": replace(FILE, parameters={**FILE.parameters, "d": 1.5 * D}),
    "load 0.4 kg": replace(FILE, load=HIGH),
}
HEIGHTS_M = (0.0, 0.005, 0.01)
RECORD, PIECE, DAY = 3000, 6000, 86_400.0
UNTOLD = "not judged"


def run_of(truth: RollPendulum, height_m: float, seed: int, samples: int) -> Run:
    """Of the ship with a roll, in waves."""
    waves = Waves(height_m=height_m, period_s=1.2, from_rad=0.5) if height_m else None
    return measured(replace(SHIP, pendulum=replace(truth, waves=waves)), truth.load, seed, samples)


def record(runs: int, seed: int) -> None:
    """What is named, with what explains it about as well."""

    def told(truth: RollPendulum, height_m: float, number: int) -> str:
        try:
            found = judge_roll(FILE, [run_of(truth, height_m, number, RECORD)], beam_m=SHIP.beam_m)
        except NotInformative:
            return UNTOLD
        return " or ".join("+".join(one.causes) for one in found.changes) if found.changed else "none"

    for height_m in HEIGHTS_M:
        for name, truth in CHANGES.items():
            count = runs if name == "none" else runs // 3
            _row(height_m, name, Counter(told(truth, height_m, seed + number) for number in range(count)))


def watch(runs: int, seed: int) -> None:
    """Alarms of one piece after another, all against the same reference."""
    for height_m in (HEIGHTS_M[0], HEIGHTS_M[-1]):
        reference = RollWatch()
        for number in range(3):
            reference = roll_learnt(reference, SHIP, [run_of(FILE, height_m, seed + number, PIECE)])
        for name, truth in CHANGES.items():
            same = name == "none"
            told = (
                _alarm(reference, run_of(truth, height_m, seed + 10 + number, PIECE), 100 if same else 0)
                for number in range(runs if same else runs // 3)
            )
            _row(height_m, name, Counter(told))


def _alarm(reference: RollWatch, run: Run, pieces: int) -> str:
    """Of one piece, at one false alarm in so many pieces; in 60 days for none."""
    piece_s = PIECE * SHIP.sample_time_s
    mean_time_s = pieces * piece_s or 60 * DAY
    now = roll_watched(reference, SHIP, [run], begin_s=0, end_s=piece_s, mean_time_s=mean_time_s, called=False)
    if now.judged_s == reference.judged_s:
        return UNTOLD
    return (
        " or ".join("+".join(one) for one in (now.events[-1].causes, *now.events[-1].others)) if now.events else "none"
    )


def _row(height_m: float, name: str, told: Counter[str]) -> None:
    cells = ", ".join(f"{count} {what}" for what, count in told.most_common())
    print(f"| {1000 * height_m:g} mm | {name} | {cells} |", flush=True)


STUDIES = {"record": record, "watch": watch}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", choices=STUDIES)
    parser.add_argument("--runs", type=int, default=90)
    parser.add_argument("--seed", type=int, default=7000)
    asked = parser.parse_args()
    STUDIES[asked.study](asked.runs, asked.seed)
