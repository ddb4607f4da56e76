"""Independent work, shared among processes of this machine or the workers of a Dask scheduler.

Results are the same wherever tasks are done: a task takes all that it depends on, its random numbers too, as arguments.
"""

from __future__ import annotations

import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, TypeVar

import cloudpickle
from joblib import Parallel, cpu_count, delayed, effective_n_jobs, parallel_config
from joblib.externals.loky import ProcessPoolExecutor

from expdesign.processes.tasks import done

if TYPE_CHECKING:
    from expdesign.processes._dask import Cluster

Result = TypeVar("Result")
Item = TypeVar("Item")

SLOW_S = 1.0
"""From which a task was long in coming."""
ALONE_S = 5.0
"""Time from which tasks that come one by one are worth other processes."""

_CLUSTER: ContextVar[Cluster | None] = ContextVar("_CLUSTER", default=None)
"""Where `on_cluster` shares the work of a block."""
_START: ContextVar[Callable[[], None]] = ContextVar("_START", default=lambda: None)
"""Starts the processes of a block of `local_processes`."""


def in_order(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Result]:
    """Results of `function(*shared, *task)`, in the order of the tasks.

    One process works on a task when its result is asked for. Several begin at once, on copies made now: what changes
    here later does not reach them. Where results are not read to their end, the work under way is waited for; that of
    a cluster is called off.

    Args:
        function: of a module.
        shared: arguments that all tasks share; unpacked once in each process.
        tasks: the others.
    """
    return _results(function, shared, tasks, ordered=True)


def as_finished(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Result]:
    """The results of `in_order`, those first that are finished first."""
    return _results(function, shared, tasks, ordered=False)


@contextmanager
def local_processes(count: int, *, load: Callable[[], None] | None = None) -> Iterator[None]:
    """Work of this block is shared among so many processes of this machine.

    Args:
        count: of processes.
        load: what each does first, where `begin` is called before there is work to share.
    """
    started: list[Iterator[None]] = []

    def start() -> None:
        if load is not None and not started and effective_n_jobs(None) > 1:
            started.append(as_finished(load, (), [()] * count))

    with warnings.catch_warnings(), parallel_config(backend="loky", n_jobs=count):
        # joblib replaces a process whose memory has grown, and says so; no work is lost
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
        token = _START.set(start)
        try:
            yield
        except BaseException:
            with suppress(Exception):  # of processes interrupted while they start: what ended the work counts
                list(chain(*started))
            raise
        finally:
            _START.reset(token)
        list(chain(*started))


def processors() -> int:
    """Cores that this process may use: its affinity, its container's quota and LOKY_MAX_CPU_COUNT are kept to."""
    return int(cpu_count())


def shared_among() -> int:
    """How many processes or threads of this machine work of this block may be shared among."""
    return 1 if _CLUSTER.get() is not None else int(effective_n_jobs(None))


def begin() -> None:
    """Start the processes of this block, if they are not: there will be work to share."""
    _START.get()()


@contextmanager
def on_cluster(scheduler: str) -> Iterator[None]:
    """Work of this block is shared among the workers of a Dask scheduler.

    Raises:
        InputError: Dask is not installed, no scheduler answers, it has no workers or those of another version, or it
            or all of them are lost; the message says which.
    """
    from expdesign.processes._dask import connected

    with connected(scheduler) as cluster:
        before = _CLUSTER.set(cluster)
        try:
            yield
        finally:
            _CLUSTER.reset(before)


def _results(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]], *, ordered: bool
) -> Iterator[Result]:
    cluster = _CLUSTER.get()
    if cluster is None and effective_n_jobs(None) == 1:
        return (function(*shared, *task) for task in tasks)
    both = cloudpickle.dumps((function, shared))
    copies = [cloudpickle.dumps(task) for task in tasks]
    if cluster is not None:
        return cluster.results(both, copies, ordered=ordered)
    with leaving_interruptions():
        work = Parallel(return_as="generator" if ordered else "generator_unordered")
        results = _waited_for(work(delayed(done)(both, task) for task in copies))
    next(results)
    return results


def _waited_for(results: Iterator[Any]) -> Iterator[Any]:
    """None, from which on work is waited for, and the same results; joblib would end the processes with some left."""
    try:
        yield None
        for result in results:  # noqa: UP028 - `yield from` would close them
            yield result
    except GeneratorExit:
        list(results)
        raise


def ahead(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Item, tuple[Any, ...]]]
) -> Iterator[tuple[Item, Result]]:
    """Results of `function(*shared, *task)` for tasks that come one by one, without end perhaps, in their order.

    Where several processes share the work, a few more tasks are asked for before a result is given. Where tasks are
    long in coming, as from an instrument, every result is given before the next task is asked for.

    Args:
        function: of a module.
        shared: arguments that all tasks share.
        tasks: what each result goes with, and the other arguments.
    """
    jobs, source, began_s, asked_s = shared_among(), iter(tasks), time.monotonic(), time.monotonic()
    for item, task in source:
        slow = time.monotonic() - asked_s > SLOW_S
        yield item, function(*shared, *task)
        asked_s = time.monotonic()
        if jobs > 1 and not slow and asked_s - began_s > ALONE_S:
            break
    else:
        return
    executor = ProcessPoolExecutor(max_workers=jobs)
    try:
        yield from _results_ahead(executor, cloudpickle.dumps((function, shared)), source, 2 * jobs)
    finally:
        executor.shutdown(wait=True)


def _results_ahead(
    executor: ProcessPoolExecutor, both: bytes, source: Iterator[tuple[Item, tuple[Any, ...]]], most: int
) -> Iterator[tuple[Item, Any]]:
    work, last = deque[tuple[Item, Future[Any]]](), False
    while not last:
        asked_s, taken = time.monotonic(), list(islice(source, 1))
        last, slow = not taken, time.monotonic() - asked_s > SLOW_S
        with leaving_interruptions():
            work.extend((item, executor.submit(done, both, cloudpickle.dumps(task))) for item, task in taken)
        while work and (last or slow or len(work) > most):
            item, result = work.popleft()
            yield item, result.result()


@contextmanager
def leaving_interruptions() -> Iterator[None]:
    """Processes started in this block ignore Ctrl-C: the one they work for ends them."""
    if threading.current_thread() is not threading.main_thread():  # others may not change it
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
