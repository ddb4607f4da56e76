"""What each command says of inputs that once gave a wrong answer without a word, beside what another version said.

    python tests/benchmarks/field_inputs.py FIELD [--other CHECKOUT]

FIELD holds the inputs by folder: rudder-rate, no-approach, heading, limits, rudder-sign, outline, bay, crash. CHECKOUT
is a folder with another version of the package, run by the same interpreter on the same inputs. Each row has the exit
status and the line that answers the case; a dash where nothing of the kind is said.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

TRUTH, START = "--vessel rudder-rate/ship-truth.toml", "--vessel rudder-rate/ship8.toml"
VERDICT, PLANNED = "expdesign: error.*|verdict .*", "expdesign: error.*|verified .*"
MEASURED = "measured .*csv .*|.*csv: .*helm.*"
WIDTH = 260
PROGRAM = "import sys; from expdesign.cli import main; sys.exit(main())"


@dataclass(frozen=True)
class Case:
    """A command line on field inputs, and a pattern of the lines of its output that answer the case."""

    name: str
    line: str
    said: str


ONE = "--method oe --mean none"
CASES = (
    Case(
        "orders of a slewing rudder", f"estimate rudder-rate/zz20.csv rudder-rate/tc35.csv {START} {ONE}", "N_u[dr] .*"
    ),
    Case("angles reached", f"estimate rudder-rate/zz20-act.csv rudder-rate/tc35-act.csv {START} {ONE}", "N_u[dr] .*"),
    Case("the true ship on orders", f"diagnose rudder-rate/zz20.csv rudder-rate/tc35.csv {TRUTH}", VERDICT),
    Case("course as heading", f"diagnose heading/cog.csv {TRUTH}", VERDICT + "|.*course over ground.*"),
    Case("compass 8 degrees off", f"diagnose heading/mag8.csv {TRUTH}", ".*heading_bias_rad.*"),
    Case("heading held for 5 s", f"estimate heading/held.csv {START} {ONE}", "N_u[dr] .*|.*held.*|.*new reading.*"),
    Case("rudder to port, diagnose", f"diagnose rudder-sign/zz20-act-port.csv {TRUTH}", VERDICT + "|.*sign.*"),
    Case("rudder to port, indices", f"indices rudder-sign/zz20-act-port.csv {TRUTH}", ".*sign.*"),
    Case("rpm as rps", "estimate limits/rpmb1.csv --vessel limits/ship8-norate.toml --method ls", ".*limit.*|X_.*"),
    Case("zig-zag without approach", f"indices no-approach/zz20-noapproach.csv {TRUTH}", MEASURED),
    Case("circle from late on", f"indices no-approach/tc35-late.csv {TRUTH}", MEASURED),
    Case("outline without properties", "run bay/pond.toml --jobs 1", PLANNED),
    Case("no-go corners as [lon, lat]", "run bay/t1b.toml --jobs 1", PLANNED),
    Case("wind that no term reads", "run bay/windy.toml --seed 1 --jobs 2", PLANNED + "|.*reads the wind.*"),
    Case(
        "a found term in no list",
        "diagnose crash/zz_20_10_s.csv crash/zz_20_10_p.csv --vessel crash/vessel.toml",
        VERDICT,
    ),
)
POND = """[scenario]
name = "pond"
vessel = "osv-nostd.toml"
dictionary = "dict.toml"
area = "../outline/area.toml"
[design]
total_s = 600.0
[start]
lat_deg = 57.7
lon_deg = 14.1
heading_deg = 90
[goal]
lat_deg = 57.7
lon_deg = 14.099
heading_deg = 270
"""
"""A trial on the pond whose outline says nothing of its inside."""


def answer(case: Case, field: Path, package: Path, folder: Path) -> str:
    """Exit status and what is said, in one line."""
    for name in ("bay", "outline"):
        shutil.copytree(field / name, folder / name)
    (folder / "bay" / "pond.toml").write_text(POND, encoding="utf-8")
    places = {"run": folder}
    words = case.line.split()
    words = [str(places.get(words[0], field) / word) if "/" in word else word for word in words]
    environment = os.environ | {"PYTHONPATH": str(package), "COLUMNS": "10000", "EXPDESIGN_CACHE": "off"}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words, "--out", str(folder / "out")],
        capture_output=True, text=True, env=environment, check=False, cwd=folder,
    )  # fmt: skip
    said = (run.stdout + run.stderr).replace(f"{folder}/", "").replace(f"{field}/", "")
    lines = [" ".join(line.split()) for line in said.splitlines()]
    found = [line for line in dict.fromkeys(lines) if re.fullmatch(case.said, line) and not line.startswith("[")]
    return f"{run.returncode}: " + (" / ".join(line[:WIDTH] for line in found[:3]) or "-")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("field", type=Path)
    parser.add_argument("--other", type=Path)
    parser.add_argument("--only", default="", help="words that a case's name must contain")
    asked = parser.parse_args()
    versions = {"now": Path(__file__).parents[2]} | ({"other": asked.other} if asked.other else {})
    print("| case | " + " | ".join(versions) + " |\n|---|" + "---|" * len(versions))
    for case in CASES:
        if asked.only not in case.name:
            continue
        cells = []
        for package in versions.values():
            with tempfile.TemporaryDirectory() as folder:
                cells.append(answer(case, asked.field.resolve(), package.resolve(), Path(folder)))
        print(f"| {case.name} | " + " | ".join(cell.replace("|", "/") for cell in cells) + " |", flush=True)


if __name__ == "__main__":
    main()
