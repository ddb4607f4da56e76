"""A Dask scheduler and workers, each a process of its own, so that one can be killed or have other packages."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class LocalCluster:
    """Where the scheduler listens, and the processes."""

    address: str
    scheduler: subprocess.Popen
    workers: tuple[subprocess.Popen, ...]


@contextmanager
def local_cluster(workers: int, *, first: Path = ROOT, allowed_failures: int = 3) -> Iterator[LocalCluster]:
    """A scheduler and so many workers of one thread.

    Args:
        workers: their number.
        first: folder that they import from before all others.
        allowed_failures: workers beyond the first that may die of one task.
    """
    environment = os.environ | {
        "PYTHONPATH": str(ROOT),
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(allowed_failures),
        "OMP_NUM_THREADS": "1",
    }

    def started(kind: str, *arguments: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments, "--no-dashboard"],
            env=environment, stderr=subprocess.PIPE, text=True, cwd=first,
        )  # fmt: skip

    processes = [started("scheduler", "--host", "127.0.0.1", "--port", "0")]
    try:
        told = (line.rpartition("tcp://")[2].strip() for line in processes[0].stderr if "Scheduler at:" in line)
        address = f"tcp://{next(told)}"
        for _ in range(workers):
            processes.append(started("worker", address, "--nthreads", "1", "--no-nanny"))
            next(line for line in processes[-1].stderr if "Starting established connection" in line)
        yield LocalCluster(address=address, scheduler=processes[0], workers=tuple(processes[1:]))
    finally:
        for process in processes:
            process.kill()
            process.wait()
            process.stderr.close()
