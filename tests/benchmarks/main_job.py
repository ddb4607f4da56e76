"""Processor seconds of the main job by phase, release by release, beside a fixed baseline measured in the same run.

``python tests/benchmarks/main_job.py [SCENARIO.toml ...]``, by default all examples; each is run by a process of its
own, without remembered results. The phases are those of `counted_work`, after the start of Python. Seconds count all
processes of the job, whatever else the machine does meanwhile; work that other processes have begun ahead counts where
it is done. The last column but two is the sum in multiples of the baseline (`baseline.py`), by which machines compare;
memory is that of the largest process, and of all together, what they share counted once (Linux).

With ``--calls``, how often the job makes a planner, a simplifier or a space of OMPL, asks a solver of cvxpy, and solves
a program of CasADi, in one process.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace

from baseline import Baseline, measured_baseline

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "scenarios"
SAMPLED_S = 0.2
PHASES = ("start", "design", "water", "transitions", "placing and legs", "checks", "files")


@dataclass(frozen=True)
class MainJob:
    """What a run took and gave.

    Attributes:
        phase_s: processor seconds of each phase.
        peak_mib: memory of the largest process.
        summary: key numbers of the plan.
        paths: legs by what found their path.
        together_mib: memory of all processes when it was largest.
        wall_s: seconds that it took.
    """

    phase_s: dict[str, float]
    peak_mib: float
    summary: dict[str, float]
    paths: dict[str, int]
    together_mib: float = 0.0
    wall_s: float = 0.0


def main_job(scenario: Path, *, seed: int = 0, version: Path = ROOT) -> MainJob:
    """A scenario run by a fresh process, with the version in a checkout."""
    command = [sys.executable, __file__, "--measure", str(scenario), "--seed", str(seed)]
    environment = {**os.environ, "PYTHONPATH": str(version)}
    together_mib, begun_s = 0.0, time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
        while True:
            try:
                output, _ = process.communicate(timeout=SAMPLED_S)
                break
            except subprocess.TimeoutExpired:
                together_mib = max(together_mib, memory_mib(process.pid))
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return replace(MainJob(**json.loads(output)), together_mib=together_mib, wall_s=time.monotonic() - begun_s)


def measured(scenario: Path, seed: int) -> MainJob:
    """A scenario run by this process, which has done nothing else, with the version that it finds."""
    import expdesign

    sys.path.insert(0, str(Path(expdesign.__file__).parents[1] / "tests"))
    import counted_work
    from expdesign import workflows

    spent: dict[str, float] = defaultdict(float)
    seen = {"s": 0.0, "phase": "start"}

    def reach(phase: str) -> None:
        now = processor_s(os.getpid())
        spent[seen["phase"]] += now - seen["s"]
        seen.update(s=now, phase=phase)

    def progress(activity: str, share: float) -> None:
        reach(counted_work.PHASES.get(activity.rpartition(": ")[2], seen["phase"]))

    with tempfile.TemporaryDirectory() as folder:
        run = workflows.run
        reach("design")
        outcome = run(scenario, Path(folder), seed=seed, jobs=0, cache=False, progress=progress)
        reach("files")
        legs = json.loads((Path(folder) / "plan.json").read_text("utf-8"))["legs"]
    paths = Counter(leg["path"] for leg in legs if "path" in leg)
    usage = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return MainJob(phase_s=dict(spent), peak_mib=max(usage) / 1024, summary=dict(outcome.summary), paths=paths)


def calls(scenario: Path) -> Counter[str]:
    """How often a scenario, run by this process alone, asks each library."""
    sys.path.insert(0, str(ROOT / "tests"))
    import cvxpy

    from expdesign import workflows
    from expdesign.plan.legs import _ompl
    from expdesign.plan.legs._casadi import Program

    counts: Counter[str] = Counter()

    def counted(name: str, call: Callable[..., object]) -> Callable[..., object]:
        def count(*arguments: object, **options: object) -> object:
            counts[name] += 1
            return call(*arguments, **options)

        return count

    for kind, names in (("og", ("PRMstar", "BITstar", "PathSimplifier")), ("ob", ("DubinsStateSpace",))):
        module = getattr(_ompl, kind)
        made = {name: counted(f"OMPL {name}", getattr(module, name)) for name in names}
        setattr(_ompl, kind, SimpleNamespace(**{**vars(module), **made}))
    cvxpy.Problem.solve = counted("cvxpy solves", cvxpy.Problem.solve)
    Program.solve = counted("CasADi solves", Program.solve)
    with tempfile.TemporaryDirectory() as folder:
        workflows.run(scenario, Path(folder), jobs=1, cache=False)
    return counts


def processor_s(process: int) -> float:
    """Processor seconds so far of a process and all that it has started, those that ended included (Linux)."""
    ticks = sum(sum(map(int, values[11:15])) for values in family(process).values())
    return ticks / os.sysconf("SC_CLK_TCK")


def memory_mib(process: int) -> float:
    """Memory now of a process and all that it has started, what they share counted once (Linux)."""
    shares_kib = []
    for member in family(process):
        with suppress(FileNotFoundError, ProcessLookupError, PermissionError):  # it has ended
            lines = Path(f"/proc/{member}/smaps_rollup").read_text("utf-8").splitlines()
            shares_kib += [int(line.split()[1]) for line in lines if line.startswith("Pss:")]
    return sum(shares_kib) / 1024


def family(process: int) -> dict[int, list[str]]:
    """What the system states of a process and of all that it has started, from the state on (proc_pid_stat(5))."""
    stated, children = {}, defaultdict(list)
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has ended
            number, values = int(path.parent.name), path.read_text("utf-8").rpartition(")")[2].split()
            stated[number] = values
            children[int(values[1])].append(number)
    members = [process]
    for member in members:  # grows meanwhile
        members += children[member]
    return {member: stated[member] for member in members if member in stated}


def row(scenario: Path, baseline: Baseline) -> str:
    """One line of the table."""
    from expdesign import __version__

    job = main_job(scenario)
    total_s = sum(job.phase_s.values())
    phases = " | ".join(f"{job.phase_s.get(phase, 0.0):.1f}" for phase in PHASES)
    return (
        f"| {__version__} ({date.today()}) | {scenario.stem} | {phases} | {total_s:.1f} | {baseline.numpy_s:.2f} + "
        f"{baseline.ipopt_s:.2f} | {total_s / baseline.total_s:.0f} | {job.peak_mib:.0f} MiB | "
        f"{job.together_mib:.0f} MiB |"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", type=Path, default=sorted(SCENARIOS.glob("*.toml")))
    parser.add_argument("--measure", type=Path, help="print the numbers of one scenario, run in this process, as JSON")
    parser.add_argument("--seed", type=int, default=0, help="of --measure")
    parser.add_argument("--calls", action="store_true", help="count calls of libraries instead")
    chosen = parser.parse_args()
    if chosen.calls:
        print("| scenario | calls |\n|---|---|")
        for scenario in chosen.scenarios:
            told = ", ".join(f"{name} {count}" for name, count in sorted(calls(scenario).items()))
            print(f"| {scenario.stem} | {told} |", flush=True)
    elif chosen.measure:
        print(json.dumps(vars(measured(chosen.measure, chosen.seed))))
    else:
        names = (*PHASES, "all [s]", "NumPy + IPOPT [s]", "x baseline", "memory", "together")
        print("| version | scenario |", " | ".join(names), "|")
        print("|---" * (2 + len(names)) + "|")
        for scenario in chosen.scenarios:
            print(row(scenario, measured_baseline()), flush=True)
