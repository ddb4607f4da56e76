"""Processor time of a diagnosis of an hour of trials: 8 runs of 420 s, every cause of the catalogue looked for.

``python tests/benchmarks/diagnosis_speed.py [--trials 12] [--seed 1] [--rate 1] [--only 3]``

Trials are drawn like those of `diagnosis.py`: ship, manoeuvre, none to three effects, parameters known or uncertain.
Beside the time of all processes stand the greatest memory of one and the work counted by the diagnosis itself, which
does not depend on the machine.
"""

from __future__ import annotations

import argparse
import resource
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
import hidden_effects as sea
from diagnosis_trials import NAMES, Case, Hidden, drawn_effect, drawn_ship
from expdesign.diagnosis import diagnose

RUNS, RUN_S, UNCERTAIN = 8, 420, 0.1
ALONE = ("wind", "change_point", "shallow_water")
"""Causes whose trials differ from those of others: never hidden beside another."""


def drawn(number: int, seed: int, rate: float) -> tuple[Case, Hidden, float]:
    """A trial, what is hidden in it, and the relative standard deviation of its parameters."""
    rng = np.random.default_rng([seed, number])
    how_many = number % 4
    names = rng.permutation([name for name in NAMES if how_many == 1 or name not in ALONE])[:how_many]
    ship = drawn_ship(str(names[0]) if how_many else "none", rng, None)
    case = Case(
        ship=ship, seed=int(rng.integers(2**31)), manoeuvre=str(rng.choice(list(sea.MANOEUVRES))), batches=RUNS,
        samples=int(RUN_S * rate), step_s=1 / rate,
    )  # fmt: skip
    hidden = Hidden(cause="nothing")
    for name in names:
        other = drawn_effect(str(name), ship, rng, float(RUNS * RUN_S))
        hidden = other if hidden.cause == "nothing" else hidden.with_another(other)
    return case, hidden, UNCERTAIN * float(number // 4 % 2)


def processor_s() -> float:
    """Of this process and those it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def main() -> None:
    """Print a line per trial, then the largest."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rate", type=float, default=1.0, help="samples per second")
    parser.add_argument("--only", type=int, help="number of a single trial")
    chosen = parser.parse_args()
    times = []
    for number in range(chosen.trials) if chosen.only is None else [chosen.only]:
        case, hidden, std = drawn(number, chosen.seed, chosen.rate)
        ((record,),) = case.records([hidden], std)
        begin = processor_s()
        found = diagnose(case.vessel(hidden, std), record)
        times.append(processor_s() - begin)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        names = " and ".join(item.cause for item in found.findings) or "nothing"
        print(f"{number:3} {case.ship:8} {case.manoeuvre:10} std {std:3} {times[-1]:6.1f} s {memory:5.0f} MiB  "
              f"hidden: {hidden.cause}; found: {names}", flush=True)  # fmt: skip
    print(f"largest {max(times):.1f} s, median {np.median(times):.1f} s")


if __name__ == "__main__":
    main()
