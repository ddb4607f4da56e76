"""Independent work, shared among processes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, TypeVar

import cloudpickle
from joblib import Parallel, delayed, effective_n_jobs

Result = TypeVar("Result")


def in_order(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Result]:
    """Results of `function(*shared, *task)`, in the order of the tasks, by the processes of `joblib.parallel_config`.

    One process works on a task when its result is asked for. Several begin at once, on copies made now: what changes
    here later does not reach them. Where results are not read to their end, the work under way is waited for.

    Args:
        function: of a module.
        shared: arguments that all tasks share; sent with each, unpacked once in each process.
        tasks: the others.
    """
    if effective_n_jobs(None) == 1:
        return (function(*shared, *task) for task in tasks)
    both = cloudpickle.dumps((function, shared))
    copies = [cloudpickle.dumps(task) for task in tasks]
    with leaving_interruptions():
        results = _waited_for(Parallel(return_as="generator")(delayed(_done)(both, task) for task in copies))
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


def _done(both: bytes, task: bytes) -> Any:
    function, shared = _unpacked(both)
    return function(*shared, *cloudpickle.loads(task))


@lru_cache(maxsize=2)
def _unpacked(both: bytes) -> Any:
    return cloudpickle.loads(both)
