"""Do two versions of the package write the same results? For changes of structure that must not change any.

    python tests/benchmarks/digests.py --other CHECKOUT [--only WORD]

Every command below is run by this version and by the one in CHECKOUT, on the examples and on what the commands before
it wrote. JSON is compared to ten digits, without seconds of work and versions; other text files letter by letter.
Prints each file that differs, and where; the exit status is 1 if any does.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PROGRAM = "import sys; from expdesign.cli import main; sys.exit(main())"
ROOT = Path(__file__).parents[2]
TENDER = "--vessel scenarios/vessels/tender-20m.toml"
FAST = "--vessel scenarios/vessels/fast-8m.toml"
LINES = (
    "run scenarios/story.toml --seed 1 --jobs 1",
    "simulate runs/story/plan.json --truth scenarios/vessels/tender-20m-true.toml --until 600 --seed 2",
    f"diagnose runs/story/measured.csv {TENDER} --out runs/found",
    f"estimate runs/story/measured.csv {TENDER} --method ls iv oe --out runs/estimate",
    f"mine runs/story/measured.csv {TENDER} --piece 60 --keep 3 --out runs/mine",
    f"indices runs/story/measured.csv {TENDER} --out runs/indices",
    "replan scenarios/story.toml --data runs/story/measured.csv --vessel runs/found/vessel-extended.toml --seed 3"
    " --out runs/replan",
    "foresee scenarios/story.toml --plan runs/story/plan.json --out runs/foresee",
    "run scenarios/helsinki-hour.toml --seed 1 --jobs 1",
    "whatif scenarios/helsinki-hour.toml scenarios/variants/calm.toml --out runs/whatif",
    "durations scenarios/model-ship.toml --grow --out runs/grown",
    "run scenarios/narrows.toml --seed 1 --jobs 1",
    "run scenarios/harbour.toml --seed 1 --jobs 1",
    "run scenarios/fast-boat.toml --seed 1 --jobs 1",
    "simulate runs/fast-boat/plan.json --truth scenarios/vessels/fast-8m-true.toml --seed 2",
    f"identify-steps runs/fast-boat/measured.csv {FAST} --out runs/steps",
    "trial-result runs/story/plan.json --estimate runs/estimate/estimate.json --indices runs/indices/indices.json"
    " --out runs/result",
    "export runs/story/plan.json --format rtz rtz-1.0 rtz-1.1 gpx kml geojson qgc ardupilot csv --fine"
    " --out runs/routes",
    "validate scenarios/story.toml --trials 10 --out runs/validate",
    "roll-plan scenarios/roll-trial.toml --loads scenarios/loads/roll-trial.toml --out runs/roll-plan",
    "incline --vessel scenarios/vessels/roll-model.toml --mass-kg 0.2 0.4 --shift-m 0.05 0.1 --out runs/incline",
    "nominal scenarios/cards/coaster-80m.toml --out runs/nominal",
    "import scenarios/logs/bridge.csv --out runs/imported",
    "explain causes",
    "explain scenario",
    "explain vessel",
)
WORK = re.compile(r"(^|_)(seconds|version|versions|work|created|command)(_|$)|_(cpu|wall)_s$|^wall_s$|processor")


def carried_out(checkout: Path, folder: Path, lines: Sequence[str]) -> dict[str, str]:
    """What every command prints, and all files that it writes, by name."""
    (folder / "scenarios").symlink_to(ROOT / "scenarios")
    variables = os.environ | {"PYTHONPATH": str(checkout), "XDG_CACHE_HOME": str(folder / "cache"), "COLUMNS": "200"}
    found = {}
    for line in lines:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, *line.split(), "--quiet"] if not line.startswith("explain") else
            [sys.executable, "-c", PROGRAM, *line.split()],
            cwd=folder, env=variables, capture_output=True, text=True, check=False,
        )  # fmt: skip
        print(f"{checkout}: {line}: {done.returncode}", file=sys.stderr, flush=True)
        found[line] = f"{done.returncode}\n{done.stdout}\n{done.stderr if done.returncode else ''}"
    for path in sorted((folder / "runs").rglob("*")):
        if path.is_file():
            text = path.read_bytes().decode(errors="replace")
            found[path.relative_to(folder).as_posix()] = text.replace(str(folder), "FOLDER")
    return found


def differences(name: str, one: str, other: str) -> Iterator[str]:
    """Places where two versions of a file differ."""
    if name.endswith(".json"):
        yield from differing_values("", json.loads(one), json.loads(other))
    elif one != other:
        lines = zip(one.splitlines(), other.splitlines(), strict=False)
        row = next((row for row, (mine, its) in enumerate(lines, start=1) if mine != its), 0)
        yield f"line {row} of {len(one.splitlines())} and {len(other.splitlines())}"


def differing_values(place: str, one: object, other: object) -> Iterator[str]:
    """Places in two JSON values that differ by more than the last digits."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in one.keys() | other.keys():
            if WORK.search(key) is None:
                yield from differing_values(f"{place}.{key}", one.get(key), other.get(key))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, (mine, its) in enumerate(zip(one, other, strict=True)):
            yield from differing_values(f"{place}[{number}]", mine, its)
    elif isinstance(one, float) and isinstance(other, float):
        if f"{one:.10g}" != f"{other:.10g}":
            yield f"{place}: {one:.12g} and {other:.12g}"
    elif one != other:
        yield f"{place}: {str(one)[:60]} and {str(other)[:60]}"


def main() -> int:
    """Both versions, side by side."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--other", type=Path, required=True)
    parser.add_argument("--only", default="", help="commands with this word only")
    given = parser.parse_args()
    lines = [line for line in LINES if given.only in line]
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other, ThreadPoolExecutor() as threads:
        places = ((ROOT, Path(one)), (given.other.resolve(), Path(other)))
        mine, its = threads.map(lambda place: carried_out(*place, lines), places)
    status = 0
    for name in sorted(mine.keys() | its.keys()):
        found = list(differences(name, mine[name], its[name])) if name in mine and name in its else ["only in one"]
        if found:
            status = 1
            print(f"{name}: {len(found)} differ, first {found[0]}")
    print(f"{len(mine)} outputs and files compared")
    return status


if __name__ == "__main__":
    sys.exit(main())
