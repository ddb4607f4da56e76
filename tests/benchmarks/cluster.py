"""Work shared among the workers of a Dask scheduler: what it gains, what it sends, and what a hundred would gain.

``python tests/benchmarks/cluster.py [WORD ...]``: `whatif`, designs alone and with plans, `validate`, a published study
and many drawn trials of a plan are done by this process, then by one and by two workers of one thread. Words
choose among them. Results are compared. Alone, this process is given a scheduler too, as that decides what are tasks.

Processor seconds are those of this process alone, or the sum of what this process still does and what the busiest
worker does, its imports included; the speed-up is their ratio, whatever else the machine does. Wall seconds stand in
brackets. `outside tasks` is what no worker can take; speed-up by any number of workers is at most its inverse (Amdahl).
For a hundred workers the time is calculated: that, and the longest task or a hundredth of all. Bytes are those of
arguments and results, pickled: shared ones pass the scheduler once, tasks and results once each. Waiting for messages
is not counted.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np

from main_job import ROOT, SCENARIOS, processor_s

sys.path.insert(0, str(ROOT / "tests"))
sys.path.insert(0, str(ROOT / "tests" / "benchmarks" / "published"))
import manoeuvring
from dask_cluster import LocalCluster, local_cluster
from expdesign import workflows
from expdesign.plan.assembly import leg_water, ship_on_legs
from expdesign.plan.monte_carlo import estimate_risk
from expdesign.processes import on_cluster, sharing
from expdesign.scenario import load_scenario

PUBLISHED = ROOT / "tests" / "benchmarks" / "published"  # folder whose modules workers import too
MANY = 100  # workers that are calculated with
TRIALS, DRAWS, RUNS = 20, 10_000, 40  # of each design, of a plan, and of the study
TOTALS_S = tuple(range(240, 720, 30))  # informative times of the variants
PLANNED = 2  # variants that are planned too
MIB = 2**20


@dataclass
class Tasks:
    """Processor seconds and bytes of tasks done by this process."""

    seconds: list[float] = field(default_factory=list)
    shared_bytes: int = 0
    sent_bytes: list[int] = field(default_factory=list)
    returned_bytes: list[int] = field(default_factory=list)


@contextmanager
def observed() -> Iterator[Tasks]:
    """What would be shared in this block is done here, one task after the other, and measured."""
    found, inside = Tasks(), False

    def results(function: Callable, shared: tuple, tasks: Iterable[tuple], *, ordered: bool) -> Iterator[Any]:
        nonlocal inside
        if inside:
            yield from (function(*shared, *task) for task in tasks)
            return
        found.shared_bytes += len(cloudpickle.dumps((function, shared)))
        for task in tasks:
            found.sent_bytes.append(len(cloudpickle.dumps(task)))
            began, inside = time.process_time(), True
            try:
                result = function(*shared, *task)
            finally:
                inside = False
            found.seconds.append(time.process_time() - began)
            found.returned_bytes.append(len(cloudpickle.dumps(result)))
            yield result

    usual, sharing._results = sharing._results, results
    try:
        yield found
    finally:
        sharing._results = usual


def on_workers(work: Callable[[str], Any], count: int) -> tuple[Any, float, float]:
    """The result, processor seconds of this process and of the busiest worker together, and wall seconds."""
    with local_cluster(count, first=PUBLISHED) as cluster:
        before = _worker_s(cluster)
        began, wall = time.process_time(), time.perf_counter()
        result = work(cluster.address)
        own, passed = time.process_time() - began, time.perf_counter() - wall
        busiest = max(after - first for after, first in zip(_worker_s(cluster), before, strict=True))
    return result, own + busiest, passed


def _worker_s(cluster: LocalCluster) -> list[float]:
    return [processor_s(worker.pid) for worker in cluster.workers]


def row(name: str, work: Callable[[str], Any]) -> tuple[str, str]:
    """Lines of both tables."""
    with local_cluster(1, first=PUBLISHED) as idle, on_cluster(idle.address), observed() as tasks:
        began, wall = time.process_time(), time.perf_counter()
        expected = work(idle.address)
        alone, wall = time.process_time() - began, time.perf_counter() - wall
    runs = [on_workers(work, count) for count in (1, 2)]
    assert all(result == expected for result, *_ in runs)
    spent = " | ".join(f"{own:.1f} s ({passed:.1f} s)" for own, passed in [(alone, wall), *(run[1:] for run in runs)])
    gains = " | ".join(f"{alone / own:.2f}" for _, own, _ in runs)
    shared, serial = sum(tasks.seconds), alone - sum(tasks.seconds)
    many = alone / (serial + max(shared / MANY, max(tasks.seconds, default=0.0)))
    sent, returned = (np.mean(some or [0]) / MIB for some in (tasks.sent_bytes, tasks.returned_bytes))
    through = (tasks.shared_bytes + sum(tasks.sent_bytes) + sum(tasks.returned_bytes)) / MIB
    return (
        f"| {name} | {len(tasks.seconds)} | {serial / alone:.1%} | {spent} | {gains} |",
        f"| {name} | {alone / max(serial, 1e-9):.0f} | {max(tasks.seconds, default=0):.1f} s "
        f"| {many:.1f} | {tasks.shared_bytes / MIB:.2f} | {sent:.3f} | {returned:.3f} | {through:.1f} |",
    )


def cases(folder: Path) -> list[Path]:
    """Variants with other informative times."""
    found = []
    for total_s in TOTALS_S:
        found.append(folder / f"{total_s}.toml")
        found[-1].write_text(f"[design]\ntotal_s = {total_s}.0\n", "utf-8")
    return found


def works(folder: Path) -> dict[str, Callable[[], Callable[[str], Any]]]:
    """Names of what is measured, and functions that make ready what does it."""
    variants, model_ship = cases(folder), SCENARIOS / "model-ship.toml"

    def written(command: Callable, file: str, scheduler: str) -> Any:
        command(folder / "out", scheduler=scheduler)
        return json.loads((folder / "out" / file).read_text("utf-8"))

    def whatif(scenario: str, some: list[Path], **options: Any) -> Callable[[str], Any]:
        command = partial(workflows.whatif, SCENARIOS / scenario, some, cache=False, **options)
        return partial(written, command, "whatif.json")

    validate = partial(workflows.validate_design, model_ship, trials=TRIALS)
    return {
        f"`whatif`, {1 + len(variants)} designs": partial(whatif, "helsinki.toml", variants),
        f"`whatif --plan`, {1 + PLANNED} cases": partial(whatif, "story.toml", variants[:PLANNED], with_plan=True),
        f"`validate`, {TRIALS} trials of each design": lambda: partial(written, validate, "validation.json"),
        f"study of a published table, {RUNS} runs": lambda: study,
        f"{DRAWS} drawn trials": drawn_trials,
    }


def study(scheduler: str) -> Any:
    """Errors of six estimators."""
    with on_cluster(scheduler):
        outcomes = manoeuvring.run_case(manoeuvring.MILD, runs=RUNS, rng=np.random.default_rng(1))
        return [(item.errors.tolist(), item.std.tolist()) for item in outcomes]


def drawn_trials() -> Callable[[str], Any]:
    """What sails drawn trials of the plan of the story."""
    case = load_scenario(SCENARIOS / "story.toml")
    information = workflows.scored(case)
    design = workflows.designed(case, information)
    problem = workflows.plan_problem(case, information, design)
    water, sailed = leg_water(problem, ship_on_legs(problem)), workflows.planned(case, information, design).sailed

    def work(scheduler: str) -> Any:
        with on_cluster(scheduler):
            return estimate_risk(water, sailed, draws=DRAWS, rng=np.random.default_rng(1))[0]

    return work


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        chosen = {name: made for name, made in works(Path(place)).items() if any(map(name.count, sys.argv[1:] or [""]))}
        lines = [row(name, made()) for name, made in chosen.items()]
    print("Processor seconds (wall seconds):\n")
    print(
        "| work | tasks | outside tasks | alone | 1 worker | 2 workers | speed-up by 1 | by 2 |",
        "|---" * 8 + "|",
        sep="\n",
    )
    print(*(first for first, _ in lines), f"\nCalculated for {MANY} workers; bytes in MiB:\n", sep="\n")
    print(
        f"| work | speed-up at most | longest task | speed-up by {MANY} workers | shared | a task | its result "
        "| through the scheduler |"
    )
    print("|---" * 8 + "|", *(second for _, second in lines), sep="\n")
