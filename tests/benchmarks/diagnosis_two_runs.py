"""How often two runs with one cause are said to have another, and what the rule for two runs has to do with it.

``python tests/benchmarks/diagnosis_two_runs.py [--trials 24] [--first 0] [--seed 1] [--ship barge] [--kind differ]``

With ``--clean`` nothing is hidden, and whatever is named is something else.

Of two runs a cause beside others stays whatever its p-value where simulations of held-out data need it for certain.
Data are those of `diagnosis_trials`: one cause of a drawn size in two runs of 300 s at 1 Hz. Kinds, in turn:

- known: both runs of the ship of the file;
- uncertain: parameters drawn around the file's by 10 % each, and the file says so;
- differ: the file says that they are known, and each run has its own, drawn by 5 %: as runs of a real ship differ.

A line per trial: the findings, and without the rule where it kept a cause. Then per kind how many trials name the cause
and how many something else, with the rule and without. Parameters where parameters differ are no false cause.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
import expdesign.diagnosis.select.backward_elimination as elimination
from diagnosis import share
from diagnosis_trials import NAMES, Case, Hidden, drawn_effect, drawn_ship
from expdesign.diagnosis import diagnose
from expdesign.signals import Record

KINDS = {"known": (0.0, 0.0), "uncertain": (0.1, 0.1), "differ": (0.0, 0.05)}
"""Standard deviation of parameters, as the file says and as they are drawn."""
RUNS, SAMPLES, LARGER = 2, 300, 1.5
ALSO_TRUE = ("parameters", "load_change", "missing_term")
"""What parameters that differ from the file's may rightly be called: a term that is 10 % larger lacks the rest."""


def trial(number: int, chosen: argparse.Namespace, kind: str) -> tuple[Case, Hidden, Record]:
    """The ship, what is hidden in her, and two runs."""
    rng = np.random.default_rng([chosen.seed, number, list(KINDS).index(kind)])
    names = [name for name in NAMES if name != "change_point"]
    name = names[number % len(names)]
    ship, drawn = drawn_ship(name, rng, chosen.ship), KINDS[kind][1]
    hidden = drawn_effect(name, ship, rng, float(RUNS * SAMPLES)).scaled(LARGER)
    hidden = Hidden(cause="none") if chosen.clean else hidden
    case = Case(ship=ship, seed=int(rng.integers(1 << 30)), manoeuvre="helmsman", batches=RUNS, samples=SAMPLES)
    if kind != "differ":
        ((record,),) = case.records([hidden], drawn)
        return case, hidden, record
    alone = [replace(case, seed=case.seed + place, batches=1).records([hidden], drawn)[0][0] for place in range(RUNS)]
    runs = [replace(one.batches[0], name=f"trial, batch {place}") for place, one in enumerate(alone)]
    return case, hidden, Record(batches=tuple(runs))


@dataclass(frozen=True, kw_only=True)
class Found:
    """Causes that are named, and how often the rule was asked and kept one."""

    causes: tuple[str, ...]
    asked: int
    kept: int

    def is_right(self, hidden: Hidden) -> bool:
        """Whether the true cause is among them."""
        return hidden.cause in self.causes

    def others(self, hidden: Hidden, kind: str) -> list[str]:
        """Causes that are named and not there."""
        also = () if kind == "known" else ALSO_TRUE
        return [one for one in self.causes if one != hidden.cause and one.split(":")[0] not in also]


def diagnosed(case: Case, hidden: Hidden, record: Record, kind: str, *, rule: bool) -> Found:
    """What the diagnosis names with the rule or without it."""
    asked, answers, own = [], [], (elimination._may_be_needed, elimination._is_needed)

    def may_be(*given: object) -> bool:
        asked.append(rule and own[0](*given))
        return asked[-1]

    def is_needed(*given: object) -> bool:
        answers.append(own[1](*given))
        return answers[-1]

    elimination._may_be_needed, elimination._is_needed = may_be, is_needed
    try:
        found = diagnose(case.vessel(hidden, KINDS[kind][0]), record, seed=case.seed % 1000)
    finally:
        elimination._may_be_needed, elimination._is_needed = own
    return Found(causes=tuple(item.cause for item in found.findings), asked=sum(asked), kept=sum(answers))


def main() -> None:
    """Run the trials."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=24)
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ship", choices=("barge", "coaster", "tug"))
    parser.add_argument("--kind", choices=tuple(KINDS))
    parser.add_argument("--clean", action="store_true", help="nothing is hidden")
    chosen = parser.parse_args()
    for kind in KINDS if chosen.kind is None else (chosen.kind,):
        rows = []
        for number in range(chosen.first, chosen.trials):
            began = process_time()
            case, hidden, record = trial(number, chosen, kind)
            found = diagnosed(case, hidden, record, kind, rule=True)
            without = diagnosed(case, hidden, record, kind, rule=False) if found.kept else found
            rows.append((hidden, found, without))
            print(f"{kind:10}{number:3} {case.ship:8}{hidden.cause:28}asked {found.asked} kept {found.kept}  "
                  f"{', '.join(found.causes) or 'nothing'}"
                  f"{' | without: ' + (', '.join(without.causes) or 'nothing') if found.kept else ''}"
                  f"  ({process_time() - began:.0f} s)", flush=True)  # fmt: skip
        for name, place in (("with the rule", 1), ("without it", 2)):
            right = sum(row[place].is_right(row[0]) for row in rows)
            others = sum(bool(row[place].others(row[0], kind)) for row in rows)
            print(
                f"{kind}, {name}: the cause named in {share(right, len(rows))}, another in {share(others, len(rows))}"
            )


if __name__ == "__main__":
    main()
