"""Options of studies whose work is shared among processes or the workers of a Dask scheduler.

Workers import the modules of studies: `tests`, `tests/benchmarks` and `tests/benchmarks/published` are on their path.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from expdesign.errors import InputError
from expdesign.workflows.outcome import workers


def add_sharing(parser: argparse.ArgumentParser, *, jobs: int = 1) -> None:
    """The options --jobs and --scheduler."""
    parser.add_argument("--jobs", type=int, default=jobs, help="processes; 0 for one per core")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler to compute on instead")


@contextmanager
def shared_work(chosen: argparse.Namespace) -> Iterator[None]:
    """Work of this block is shared as the options say."""
    try:
        with workers(chosen.jobs, scheduler=chosen.scheduler, load=None):
            yield
    except InputError as error:
        raise SystemExit(str(error)) from None
