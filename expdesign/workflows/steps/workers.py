"""Where independent work is done: processes on this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

from joblib import Parallel, delayed, effective_n_jobs, parallel_config

from expdesign.errors import InputError
from expdesign.processes import leaving_interruptions


@contextmanager
def workers(jobs: int, *, scheduler: str | None = None) -> Iterator[None]:
    """Work of `joblib.Parallel` in this block is shared among processes, which load the planner meanwhile.

    Args:
        jobs: processes; 0 for one per core, 1 for this one alone.
        scheduler: address of a Dask scheduler whose workers do the work instead.

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    if scheduler is None:
        with parallel_config(backend="loky", n_jobs=jobs or os.cpu_count() or 1):
            starting = _starting()
            try:
                yield
            except BaseException:
                with suppress(Exception):  # of processes interrupted while they start: what ended the work counts
                    list(starting)
                raise
            list(starting)
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


def _starting() -> Iterable[None]:
    """Lets processes, where there are several, load what they will need; to be read to its end."""
    count = effective_n_jobs(None)
    if count == 1:
        return ()
    with leaving_interruptions():
        loading: Iterable[None] = Parallel(return_as="generator")(delayed(_load)() for _ in range(count))
        return loading


def _load() -> None:
    import expdesign.export.report
    import expdesign.plan.solve  # noqa: F401
