"""Is a tanker model still the same ship months later? A watch over free-running trials, as measured and with faults.

``python tests/benchmarks/published/operation_real.py --data FOLDER``: a model of the tanker (3 m) is estimated from its
runs of July and August; these are the reference. Its runs of September, October and November are then watched for
changes of 40 %: as they were measured, with the yaw rate times 0.8, and with 6 degrees added to recorded rudder angles.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from expdesign.cli import main
from expdesign.export.files import vessel_toml
from real_data_cases import POND, vessel_of

Row = dict[str, str]


def as_measured(row: Row) -> Row:
    """Nothing."""
    return row


def gyro(row: Row) -> Row:
    """A wrong scale of the yaw rate."""
    return {**row, "r_radps": f"{0.8 * float(row['r_radps']):.9g}"}


def rudder(row: Row) -> Row:
    """Rudder angles recorded with an offset."""
    return {**row, "rudder1_rad": f"{float(row['rudder1_rad']) + np.deg2rad(6.0):.9g}"}


FAULTS: dict[str, Callable[[Row], Row]] = {
    "none": as_measured, "yaw rate x 0.8": gyro, "rudder angles + 6 degrees": rudder,
}  # fmt: skip


def changed(files: Sequence[Path], fault: Callable[[Row], Row], folder: Path) -> list[str]:
    """The files with a fault in every row."""
    for path in files:
        with path.open(encoding="utf-8") as source, (folder / path.name).open("w", encoding="utf-8") as target:
            rows = csv.DictReader(source)
            writer = csv.DictWriter(target, rows.fieldnames or (), lineterminator="\n")
            writer.writeheader()
            writer.writerows(fault(row) for row in rows)
    return [str(folder / path.name) for path in files]


def study(data: Path) -> None:
    """A row for each month and fault."""
    runs = sorted((data / POND.folder).glob("*.csv"))
    known = [str(path) for path in runs if "Jul" in path.name or "Aug" in path.name]
    print("| runs | fault | judged | not judged | largest statistic | threshold | alarms |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "tanker.toml").write_text(vessel_toml(vessel_of(POND)))
        model = folder / "model" / "vessel-estimated.toml"
        words = ["--vessel", str(folder / "tanker.toml"), "--method", "iv-air", "--out", str(model.parent), "-q"]
        assert main(["estimate", *known, *words]) == 0
        for month in ("Sep", "Oct", "Nov"):
            group = [path for path in runs if month in path.name and "cut" not in path.name]
            for name, fault in FAULTS.items():
                files = changed(group, fault, folder)
                options = ["--vessel", str(model), "--size", "0.4", "--out", str(folder / "out"), "-q"]
                assert main(["monitor", *files, *options, "--reference", *known]) == 0
                told = json.loads((folder / "out" / "monitor.json").read_text())
                largest = max((moment["statistic"] for moment in told["history"]), default=0.0)
                alarms = "; ".join(item["in_words"] for item in told["alarms"]) or "none"
                print(
                    f"| {month} | {name} | {60 * told['judged_h']:.0f} min | {60 * told['not_judged_h']:.0f} min "
                    f"| {largest:.1f} | {told['threshold']:.1f} | {alarms} |",
                    flush=True,
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path, required=True)
    study(parser.parse_args().data)
