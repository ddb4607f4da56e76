"""How well the told share of the work follows the time: every long command, on every example that it fits.

``python tests/benchmarks/progress.py [WORD ...]``: each case runs once, in a process of its own, as the command line
runs it; words choose among them. The correlation is that of the share last told with the share of the time gone, over a
thousand moments of the run; the largest lead and lag say how far apart the two are, the last column during what.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from expdesign import workflows
from expdesign.progress import Progress

SCENARIOS = Path(__file__).parents[2] / "scenarios"
EXAMPLES = ("story", "coaster", "harbour", "helsinki", "model-ship", "narrows")
VARIANTS = tuple(SCENARIOS / "variants" / name for name in ("half-an-hour.toml", "no-telegraph.toml"))
TENDER, TRUE_TENDER = (SCENARIOS / "vessels" / f"tender-20m{kind}.toml" for kind in ("", "-true"))
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


def replan(folder: Path, told: Progress) -> None:
    data, found = (_measured(folder),), folder / "diagnose" / "vessel-extended.toml"
    out = folder / "replan"
    workflows.replan(SCENARIOS / "story.toml", out, data=data, vessel=found, jobs=0, seed=3, cache=False, progress=told)


def validate_design(example: str, folder: Path, told: Progress) -> None:
    out = folder / f"validate {example}"
    workflows.validate_design(SCENARIOS / f"{example}.toml", out, trials=200, jobs=0, progress=told)


def _measured(folder: Path) -> Path:
    return folder / "run story" / "measured.csv"


CASES: dict[str, tuple[Callable[..., None], tuple[str, ...]]] = {
    **{f"run {example}": (run, (example,)) for example in EXAMPLES},
    "whatif --plan helsinki": (whatif, ()),
    "simulate story": (simulate, ()),
    "diagnose story": (diagnose, ()),
    "replan story": (replan, ()),
    **{f"validate {example}": (validate_design, (example,)) for example in ("story", "model-ship")},
}
NEEDED = ("run story", "simulate story", "diagnose story")
"""Cases that later ones take files from, in order."""


def told_by(name: str, folder: Path) -> tuple[float, list[tuple[float, float, str]]]:
    """How long a case takes [s], and when it told which share and activity."""
    work, options = CASES[name]
    getattr(workflows, work.__name__)  # is loaded before anything is told
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
    shown = np.array(shares)[last]
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
    last_needed = max((NEEDED.index(name) for name in NEEDED if name in chosen), default=-1)
    needed = NEEDED if "replan story" in chosen else NEEDED[: last_needed + 1]
    print("| command | wall | correlation | largest lead | largest lag | during |")
    print("|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in dict.fromkeys((*needed, *chosen)):
            subprocess.run([sys.executable, __file__, "--one", name, folder], check=True)
