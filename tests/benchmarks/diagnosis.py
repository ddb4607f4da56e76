"""How often the diagnosis is right: a campaign over ships, manoeuvres, effects, sizes and seeds, all drawn.

``nice python tests/benchmarks/diagnosis.py [--trials 60] [--part known] [--seed 1] [--ship barge]``, shared
among two processes (`--jobs`), or `--scheduler ADDRESS`.

Data come from `hidden_effects`, which shares no code with the package. An effect is drawn, then enlarged until it costs
the model with the generator's own parameters 5 points of simulated fit or more (mean over u, v, r). Parts:

- known: one effect, parameters known;
- uncertain: parameters drawn around the model's by 10 % each, and the model says so;
- clean: nothing hidden, known and uncertain by turns;
- pairs: two effects at once, parameters known;
- varied: one effect, parameters known, recorded otherwise: velocities derived from the pose or measured, wind not
  measured, one run or many, 1 to 10 Hz, all drawn;
- power: effects of 3, 10, 30 and 100 % of the size that just costs 5 points, found against an oracle, the score test of
  the one true cause at 5 %, without any correction;
- beyond: effects that no cause of the catalogue is, parameters known; is the verdict's name right?

Columns: trials; the true cause first among the findings; the same or listed as not distinguishable from the first;
among the findings at all; nothing found; estimate within three standard errors, of those named; other findings beside
it; p < 0.01 in the oracle's test, that is, trials in which the data hold enough to know. Errors are binomial.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
import hidden_effects as sea
from diagnosis_trials import NAMES, PARTS, tried
from expdesign.processes import as_finished
from shared_work import add_sharing, shared_work


def share(count: int, total: int) -> str:
    """A count as per cent with its binomial standard error (Agresti and Coull, 1998)."""
    if not total:
        return "-"
    p = (count + 2) / (total + 4)
    return f"{count}/{total} ({100 * count / total:.0f} ± {100 * np.sqrt(p * (1 - p) / (total + 4)):.0f} %)"


def judged(row: dict) -> dict[str, bool | int | None]:
    """What is right about a trial with one effect.

    Its estimates are those of the finding of the true cause; all that have a truth must be within three standard
    errors of it, and there must be one.
    """
    names = [item["cause"] for item in row["findings"]]
    listed = set(names[:1]) | set(row["findings"][0]["same"] if names else ())
    mine = [item for item in row["findings"] if item["cause"] == row["cause"]]
    estimates = mine[0]["estimates"] if mine else []
    off = [abs(value - row["truth"][key]) / max(std, 1e-12) for key, value, std in estimates if key in row["truth"]]
    return {
        "first": names[:1] == [row["cause"]], "listed": row["cause"] in listed, "among": row["cause"] in names,
        "none": not names, "within": max(off, default=np.inf) < 3 if mine else None,
        "extra": len([n for n in names if n != row["cause"]]), "knowable": row["oracle"] < 0.01,
    }  # fmt: skip


def table(rows: list[dict]) -> None:
    """Per cause and in total."""
    print(f"{'cause':30}{'n':>4}{'first':>7}{'listed':>7}{'among':>7}{'none':>6}{'3 std':>8}{'extra':>7}{'oracle':>8}")
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(row["cause"].split(":")[0], []).append(judged(row))
    groups["all"] = [item for items in groups.values() for item in items]
    for name, items in groups.items():
        within = [item["within"] for item in items if item["within"] is not None]
        sums = {key: sum(bool(item[key]) for item in items) for key in ("first", "listed", "among", "none", "knowable")}
        print(
            f"{name:30}{len(items):4}{sums['first']:7}{sums['listed']:7}{sums['among']:7}{sums['none']:6}"
            f"{f'{sum(within)}/{len(within)}':>8}{sum(item['extra'] for item in items):7}{sums['knowable']:8}"
        )
    knowable = [item for item in groups["all"] if item["knowable"]]
    within = [item["within"] for item in groups["all"] if item["within"] is not None]
    print(f"named first or listed with it: {share(sum(i['listed'] for i in groups['all']), len(groups['all']))}")
    print(f"the same where the oracle knows: {share(sum(i['listed'] for i in knowable), len(knowable))}")
    print(f"trials with other findings: {share(sum(i['extra'] > 0 for i in groups['all']), len(groups['all']))}")
    print(f"estimates within 3 std: {share(sum(within), len(within))}")


def curves(rows: list[dict]) -> None:
    """Per cause and size: named first or listed with it / seen by the oracle / trials, and how much oftener the latter.

    The oracle tests at 5 %; the last column but one is of one that corrects for 18 causes as the diagnosis has to.
    """
    levels = sorted({row["scale"] for row in rows})
    print(
        f"{'cause':22}"
        + "".join(f"{100 * level:10.0f} %" for level in levels)
        + f"{'oracle - named':>18}{'- at 1/18':>16}"
    )
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(row["cause"].split(":")[0], []).append(row)
    groups["all"] = rows
    for name, some in groups.items():
        cells = []
        for level in levels:
            here = [row for row in some if row["scale"] == level]
            named, seen = sum(judged(row)["listed"] for row in here), sum(row["oracle"] < 0.05 for row in here)
            cells.append(f"{named}/{seen}/{len(here)}")
        print(
            f"{name:22}"
            + "".join(f"{cell:>12}" for cell in cells)
            + _missed(some, 0.05, 18)
            + _missed(some, 0.05 / 18, 16)
        )


def _missed(rows: list[dict], level: float, width: int) -> str:
    """Points by which the oracle sees more, with the standard error of the difference in the same trials."""
    less = np.array([(row["oracle"] < level) - float(judged(row)["listed"]) for row in rows])
    error = np.sqrt((np.mean(less**2) * len(less) + 1) / (len(less) + 2) / len(less))  # no trial differs: not sure yet
    return f"{f'{100 * less.mean():.0f} ± {100 * error:.0f}':>{width}}"


def report(part: str, rows: list[dict]) -> None:
    """What a part of the campaign says."""
    print(f"\n{part}: {len(rows)} trials, {sum('crash' in row for row in rows)} failed")
    if part == "clean":
        for std in (0.0, 0.1):
            some = [row for row in rows if row["std"] == std]
            print(f"alarms, parameters {'uncertain' if std else 'known'}: "
                  f"{share(sum(bool(row['findings']) for row in some), len(some))}")  # fmt: skip
        return
    if part == "beyond":
        for row in sorted(rows, key=lambda row: row["number"]):
            fits = " ".join(f"{value:.0f}" for value in row["fit"])
            print(f"{row['cause']:24}{'right' if row['right'] else 'wrong':7}fit {fits}: {row['verdict']}")
        print(f"right: {share(sum(row['right'] for row in rows), len(rows))}")
        return
    if part == "pairs":
        names = [([f["cause"] for f in row["findings"]], row["cause"].split("+")) for row in rows]
        print(f"both found: {share(sum(set(true) <= set(found) for found, true in names), len(rows))}")
        print(f"one at least: {share(sum(bool(set(true) & set(found)) for found, true in names), len(rows))}")
        print(f"trials with others: {share(sum(bool(set(found) - set(true)) for found, true in names), len(rows))}")
        return
    if part == "power":
        weak = [row for row in rows if row["oracle"] < 0.05]
        print(f"oracle finds: {share(len(weak), len(rows))}")
        print(f"found, of these, by the diagnosis: {share(sum(judged(row)['listed'] for row in weak), len(weak))}")
        curves(rows)
        return
    table(rows)
    if part == "varied":
        for place, what in enumerate(("velocities", "wind measured", "runs", "sample time")):
            for value in sorted({row["recorded"][place] for row in rows}, key=str):
                some = [judged(row)["listed"] for row in rows if row["recorded"][place] == value]
                print(f"{what} {value}: {share(sum(some), len(some))}")


def main() -> None:
    """Run the campaign."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=2 * len(NAMES))
    parser.add_argument("--part", choices=(*PARTS, "all"), default="all")
    add_sharing(parser, jobs=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ship", choices=tuple(sea.SHIPS))
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--log", type=Path)
    parser.add_argument("--read", type=Path, nargs="+", help="report on logs instead of running anything")
    chosen = parser.parse_args()
    if chosen.read:
        rows = [json.loads(line) for path in chosen.read for line in path.read_text().splitlines()]
        for part in PARTS:
            if some := [row for row in rows if row["part"] == part]:
                report(part, some)
        return
    with shared_work(chosen):
        for part in PARTS if chosen.part == "all" else (chosen.part,):
            tasks = ((part, number, chosen.seed, chosen.ship) for number in range(chosen.first, chosen.trials))
            rows = []
            for row in as_finished(tried, (), tasks):
                rows.append(row)
                if chosen.log:
                    with chosen.log.open("a") as file:
                        file.write(json.dumps(row) + "\n")
            report(part, rows)


if __name__ == "__main__":
    main()
