"""Where independent work is done, on this machine or on a Dask scheduler, and where its results are remembered."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from expdesign.errors import InputError
from expdesign.memory import remembering, user_memory
from expdesign.processes import local_processes, on_cluster, processors
from expdesign.requests import Request

FEW_CYCLES = 20_000
"""New objects after which cycles of garbage are looked for: work with arrays leaves few, and a look takes 0.1 s."""


def load_plans() -> None:
    """Import what plans need."""
    import expdesign.plan.solve  # noqa: F401

    gc.set_threshold(FEW_CYCLES)


def load_planner() -> None:
    """Import what plans and reports need."""
    load_plans()
    import expdesign.export.report  # noqa: F401
    from expdesign.export.pages.figures import new_figure

    new_figure(1.0, 1.0)  # loads what figures are drawn with


def shared(request: Request, *, load: Callable[[], None] | None = load_planner) -> AbstractContextManager[None]:
    """Independent work in this block is shared, and remembered, as a request asks."""
    asked = vars(type(request)) | vars(request)
    cache = None if "no_cache" not in asked else not asked["no_cache"]
    return workers(asked["jobs"], scheduler=asked.get("scheduler"), load=load, cache=cache)


@contextmanager
def workers(
    jobs: int,
    *,
    scheduler: str | None = None,
    load: Callable[[], None] | None = load_planner,
    cache: bool | None = None,
) -> Iterator[None]:
    """Independent work in this block is shared among processes; its results do not depend on them.

    Args:
        jobs: processes; 0 for one per core that this process may use, 1 for this one alone.
        scheduler: address of a Dask scheduler whose workers do the work instead.
        load: what processes of this machine do first, once something is missing in the cache.
        cache: whether results are remembered for later commands; None leaves that as it is.

    Raises:
        InputError: the number of processes is negative; as `on_cluster`.
    """
    if jobs < 0:
        raise InputError(f"--jobs is {jobs}, expected a whole number of 0 or more")
    memory = nullcontext() if cache is None else remembering(user_memory() if cache else None)
    place = on_cluster(scheduler) if scheduler is not None else local_processes(jobs or processors(), load=load)
    with memory, place, rarely_collected():
        yield


@contextmanager
def rarely_collected() -> Iterator[None]:
    """In this block cycles of garbage are looked for more rarely."""
    before = gc.get_threshold()
    gc.set_threshold(FEW_CYCLES)
    try:
        yield
    finally:
        gc.set_threshold(*before)
