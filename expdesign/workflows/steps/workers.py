"""Where independent work is done: processes on this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from joblib import parallel_config

from expdesign.errors import InputError


@contextmanager
def workers(jobs: int, *, scheduler: str | None = None) -> Iterator[None]:
    """Work of `joblib.Parallel` in this block is shared among processes.

    Args:
        jobs: processes; 0 for one per core, 1 for this one alone.
        scheduler: address of a Dask scheduler whose workers do the work instead.

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    if scheduler is None:
        with parallel_config(backend="loky", n_jobs=jobs or os.cpu_count() or 1):
            yield
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask, expected the extra: pip install 'expdesign[cluster]'") from None
    try:
        client = Client(scheduler, timeout="4s")
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: no scheduler answers there ({error})") from None
    with client, parallel_config(backend="dask", n_jobs=-1):
        yield
