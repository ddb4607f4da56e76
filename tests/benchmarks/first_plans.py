"""From `expdesign new` to the first plan: processor time of every template, as it is and with wide priors.

Each template is made in an empty folder without remembered results and planned by one process. Processor seconds are
of both commands together. With wide priors every parameter's standard deviation is 40 % of its value.

    python tests/benchmarks/record.py first_plans
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from repeated import busy_s

KINDS = ("azimuth", "propeller-rudder", "twin-screw", "asv", "model-ship")
WIDE = 0.4
NUMBERS = re.compile(r"^(\w+) = (\S+)$", flags=re.MULTILINE)


def widened(text: str) -> str:
    """A vessel file with standard deviations of `WIDE` of the parameters' values."""
    before, values, rest = re.split(r"(\[model\.parameters\]\n[^\[#]*)", text, maxsplit=1)
    stated, deviations, after = re.split(r"(\[model\.parameter_std\]\n[^\[#]*)", rest, maxsplit=1)
    sizes = {name: abs(float(value)) for name, value in NUMBERS.findall(values)}
    wide = NUMBERS.sub(lambda line: f"{line[1]} = {WIDE * sizes[line[1]]:.6g}", deviations)
    return before + values + stated + wide + after


def row(folder: Path, kind: str, *, wide: bool) -> str:
    """The table's row of a template."""
    name = f"{kind}-wide" if wide else kind
    spent_s, _ = busy_s(folder, name + "-cache", "new", name, "--kind", kind)
    if wide:
        vessel = folder / name / "vessel.toml"
        vessel.write_text(widened(vessel.read_text("utf-8")), "utf-8")
    run = ("run", f"{name}/scenario.toml", "--jobs", "1", "--seed", "1", "--out", f"{name}/out")
    try:
        spent_s += busy_s(folder, name + "-cache", *run)[0]
        verified = "yes"
    except SystemExit as refused:
        spent_s, verified = float("nan"), f"no: {refused}"
    return f"| {kind} | {'40 %' if wide else 'as the template'} | {spent_s:.0f} s | {verified} |"


def main() -> None:
    print("| template | priors | processor | verified |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        for wide in (False, True):
            for kind in KINDS:
                print(row(Path(place), kind, wide=wide), flush=True)


if __name__ == "__main__":
    main()
