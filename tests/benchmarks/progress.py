"""How well the told share of the work follows the time: every long command, on every example that it fits.

``python tests/benchmarks/progress.py [WORD ...]``: each case runs once, in a process of its own, as the command line
runs it; words choose among them. The correlation is that of the share last told with the share of the time gone, over a
thousand moments of the run; the largest lead and lag say how far apart the two are, the last column during what.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from expdesign import workflows
from expdesign.progress import Progress

SCENARIOS = Path(__file__).parents[2] / "scenarios"
EXAMPLES = ("story", "coaster", "harbour", "helsinki", "helsinki-hour", "model-ship", "narrows")
VARIANTS = tuple(SCENARIOS / "variants" / name for name in ("half-an-hour.toml", "no-telegraph.toml"))
TENDER, TRUE_TENDER = (SCENARIOS / "vessels" / f"tender-20m{kind}.toml" for kind in ("", "-true"))
AZIMUTH, TRUE_AZIMUTH = (SCENARIOS / "vessels" / f"azimuth-30m{kind}.toml" for kind in ("", "-true"))
MOMENTS = (np.arange(1000) + 0.5) / 1000
LEAST, SHORTEST_S = 0.98, 1.0

Case = Callable[[Path, Progress], object]


def run(example: str, folder: Path, told: Progress) -> None:
    workflows.run(SCENARIOS / f"{example}.toml", folder / f"run {example}", seed=1, jobs=0, cache=False, progress=told)


def whatif(folder: Path, told: Progress) -> None:
    base = SCENARIOS / "helsinki.toml"
    workflows.whatif(base, VARIANTS, folder / "whatif", with_plan=True, jobs=0, cache=False, progress=told)


def simulate(folder: Path, told: Progress) -> None:
    plan = folder / "run story" / "plan.json"
    workflows.simulate(plan, None, truth=TRUE_TENDER, until_s=600.0, seed=2, progress=told)


def diagnose(folder: Path, told: Progress) -> None:
    workflows.diagnose((_measured(folder),), folder / "diagnose", vessel=TENDER, progress=told)


def diagnose_recorded(name: str, vessel: Path, folder: Path, told: Progress) -> None:
    data = folder / name
    workflows.diagnose((data / "measured.csv",), data, vessel=vessel, progress=told)


def estimate(name: str, vessel: Path, folder: Path, told: Progress) -> None:
    data = folder / name
    workflows.estimate((data / "measured.csv",), data, vessel=vessel, methods=("oe",), progress=told)


def shortest_day(folder: Path, told: Progress) -> None:
    workflows.run(folder / "scenarios" / "story.toml", folder / "day", seed=1, jobs=0, cache=False, progress=told)


def replan(folder: Path, told: Progress) -> None:
    data, found = (_measured(folder),), folder / "diagnose" / "vessel-extended.toml"
    out = folder / "replan"
    workflows.replan(SCENARIOS / "story.toml", out, data=data, vessel=found, jobs=0, seed=3, cache=False, progress=told)


def validate_design(example: str, folder: Path, told: Progress) -> None:
    out = folder / f"validate {example}"
    workflows.validate_design(SCENARIOS / f"{example}.toml", out, trials=200, jobs=0, progress=told)


def _measured(folder: Path) -> Path:
    return folder / "run story" / "measured.csv"


def recorded(plan: str, name: str, truth: Path, folder: Path) -> None:
    """Data of at most an hour of a plan."""
    workflows.simulate(folder / plan / "plan.json", folder / name, truth=truth, until_s=3600.0, seed=2)


def asks_for_the_shortest_day(folder: Path) -> None:
    """The story with a table that asks for the shortest day."""
    copy = Path(shutil.copytree(SCENARIOS, folder / "scenarios")) / "story.toml"
    asked = (SCENARIOS / "variants" / "shortest-day.toml").read_text("utf-8")
    copy.write_text(copy.read_text("utf-8") + "\n" + asked, "utf-8")


CASES: dict[str, tuple[Callable[..., None], tuple[object, ...]]] = {
    **{f"run {example}": (run, (example,)) for example in EXAMPLES},
    "run story, shortest day": (shortest_day, ()),
    "whatif --plan helsinki": (whatif, ()),
    "simulate story": (simulate, ()),
    "diagnose story": (diagnose, ()),
    "diagnose where nothing is hidden": (diagnose_recorded, ("clean", TENDER)),
    "diagnose an hour": (diagnose_recorded, ("hour", AZIMUTH)),
    "estimate an hour by output error": (estimate, ("hour", AZIMUTH)),
    "replan story": (replan, ()),
    **{f"validate {example}": (validate_design, (example,)) for example in ("story", "model-ship")},
}
BEFORE: dict[str, tuple[str, ...]] = {
    "simulate story": ("run story",),
    "diagnose story": ("run story", "simulate story"),
    "diagnose where nothing is hidden": ("run story",),
    "diagnose an hour": ("run helsinki-hour",),
    "estimate an hour by output error": ("run helsinki-hour",),
    "replan story": ("run story", "simulate story", "diagnose story"),
}
"""Cases that others take files from."""
READY: dict[str, Callable[[Path], object]] = {
    "run story, shortest day": asks_for_the_shortest_day,
    "diagnose where nothing is hidden": partial(recorded, "run story", "clean", TENDER),
    "diagnose an hour": partial(recorded, "run helsinki-hour", "hour", TRUE_AZIMUTH),
    "estimate an hour by output error": partial(recorded, "run helsinki-hour", "hour", TRUE_AZIMUTH),
}
"""What is done before the clock starts."""


def told_by(name: str, folder: Path) -> tuple[float, list[tuple[float, float, str]]]:
    """How long a case takes [s], and when it told which share and activity."""
    work, options = CASES[name]
    READY.get(name, lambda folder: None)(folder)
    for command in ("run", "whatif", "simulate", "diagnose", "estimate", "replan", "validate_design"):
        getattr(workflows, command)  # is loaded before anything is told
    moments = [(0.0, 0.0, "starting")]
    began_s = time.perf_counter()
    work(*options, folder, lambda activity, share: moments.append((time.perf_counter() - began_s, share, activity)))
    return time.perf_counter() - began_s, moments


def row(name: str, total_s: float, moments: list[tuple[float, float, str]]) -> str:
    """One row of the table."""
    if total_s < SHORTEST_S:
        return f"| {name} | {total_s:.1f} s | | | | too short to be watched |"
    times, shares, activities = zip(*moments, strict=True)
    last = np.searchsorted(np.array(times) / total_s, MOMENTS, side="right") - 1
    shown = np.fmax.accumulate(shares)[last]
    apart = shown - MOMENTS
    correlation = np.corrcoef(shown, MOMENTS)[0, 1]
    return (
        f"| {name} | {total_s:.1f} s | {correlation:.3f}{'' if correlation > LEAST else ' (low)'} "
        f"| {max(apart.max(), 0.0):.2f} | {max(-apart.min(), 0.0):.2f} | {activities[last[np.argmax(np.abs(apart))]]} |"
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(row(sys.argv[2], *told_by(sys.argv[2], Path(sys.argv[3]))))
        sys.exit()
    chosen = [name for name in CASES if not sys.argv[1:] or any(word in name for word in sys.argv[1:])]
    needed = [name for case in chosen for name in BEFORE.get(case, ())]
    print("| command | wall | correlation | largest lead | largest lag | during |")
    print("|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in dict.fromkeys((*needed, *chosen)):
            subprocess.run([sys.executable, __file__, "--one", name, folder], check=True)
