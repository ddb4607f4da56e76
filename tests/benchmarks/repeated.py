"""What is repeated: processor time of commands that follow a first run of an example, against that run.

Run from anywhere with the package installed: ``python tests/benchmarks/repeated.py``. The story of the README is run
without remembered results, then again, then with one line changed, then compared with four variants of itself from an
empty cache, and replanned after ten minutes. Processor seconds count all processes of a command; ratios are to the
first run, measured in the same minutes.
"""

from __future__ import annotations

import compileall
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import expdesign

SCENARIOS = Path(__file__).parents[2] / "scenarios"
VARIANTS = {
    "half-the-time": "[design]\ntotal_s = 360.0\n",
    "criterion-a": '[design]\ncriterion = "A"\n',
    "no-deceleration": '[design]\nexcluded = ["deceleration"]\n',
    "more-clearance": "[plan]\nclearance_m = 25.0\n",
}
CHANGES = {
    "confidence": ("clearance_m = 20.0", "clearance_m = 20.0\nconfidence = 0.96"),
    "total_s": ("total_s = 720.0", "total_s = 600.0"),
}


def busy_s(folder: Path, cache: str, *arguments: str) -> tuple[float, float]:
    """Processor and wall seconds of a command in a folder, with a cache of that name."""
    command = [sys.executable, "-m", "expdesign", *arguments, "--quiet"]
    environment = os.environ | {"EXPDESIGN_CACHE": str(folder / cache), "PYTHONDONTWRITEBYTECODE": ""}
    began = time.perf_counter()
    with subprocess.Popen(command, cwd=folder, env=environment) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(arguments)}: exit status {process.returncode}")
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - began


def measured(folder: Path) -> None:
    """Run all commands in a copy of the examples, and print a row for each."""
    shutil.copytree(SCENARIOS, folder / "scenarios")
    compileall.compile_dir(Path(expdesign.__file__).parent, quiet=1)  # as an installation does
    story = folder / "scenarios" / "story.toml"
    text = story.read_text("utf-8")
    for name, content in VARIANTS.items():
        (folder / f"{name}.toml").write_text(content, "utf-8")
    run = ("run", "scenarios/story.toml", "--seed", "1", "--out", "story")
    first: list[tuple[float, float]] = []

    def row(name: str, cache: str, *arguments: str) -> None:
        spent_s, wall_s = busy_s(folder, cache, *arguments)
        first.append((spent_s, wall_s))
        ratios = f"{spent_s / first[0][0]:.2f} | {wall_s / first[0][1]:.2f}"
        print(f"| {name} | {spent_s:.1f} s | {wall_s:.1f} s | {ratios} |", flush=True)

    print(
        "| command | processor | wall | processor to the first run's | wall to the first run's |\n|---|---|---|---|---|"
    )
    row("run", "first", *run)
    row("run again", "first", *run)
    row("export another format", "first", "export", "story/plan.json", "--format", "gpx", "--out", "exported")
    for name, (old, new) in CHANGES.items():
        story.write_text(text.replace(old, new), "utf-8")
        row(f"run, `{name}` changed", "first", "run", "scenarios/story.toml", "--seed", "1", "--out", name)
    story.write_text(text, "utf-8")
    variants = [f"{name}.toml" for name in VARIANTS]
    asked = ("whatif", "scenarios/story.toml", *variants, "--plan", "--seed", "1", "--out", "compared")
    row("whatif --plan, four variants, nothing remembered", "compared-first", *asked)
    row("whatif --plan again", "compared-first", *asked)
    truth = ("--truth", "scenarios/vessels/tender-20m-true.toml", "--until", "600", "--seed", "2")
    row("simulate", "first", "simulate", "story/plan.json", *truth)
    vessel = ("--vessel", "scenarios/vessels/tender-20m.toml")
    row("diagnose", "first", "diagnose", "story/measured.csv", *vessel, "--out", "found")
    rest = ("--data", "story/measured.csv", "--vessel", "found/vessel-extended.toml", "--remaining", "360")
    row("replan", "first", "replan", "scenarios/story.toml", *rest, "--out", "rest", "--seed", "1")
    row("replan again", "first", "replan", "scenarios/story.toml", *rest, "--out", "rest", "--seed", "1")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        measured(Path(place))
