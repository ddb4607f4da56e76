"""A task done elsewhere, and the processes of this machine that do such tasks.

A function and its arguments travel pickled, and so does what comes of them: nothing that a task returns or raises is
unpickled before someone reads it.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache, partial
from queue import SimpleQueue
from typing import Any

import cloudpickle
from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.backend.resource_tracker import ensure_running
from joblib.externals.loky.backend.utils import kill_process_tree

from expdesign.errors import InputError

ONE_AT_A_TIME = threading.Lock()
"""Held by the task of this process: solvers and their random numbers are not made for threads."""
IDLE_S = 300.0
"""After which processes without work end, so that none outlives a program that was killed."""


def outcome_of(both: bytes, task: bytes) -> bytes:
    """Result and error of a task, from a function with its shared arguments and from the task's own, all pickled."""
    with ONE_AT_A_TIME:
        try:
            function, shared = _unpacked(both)
            return bytes(cloudpickle.dumps((function(*shared, *cloudpickle.loads(task)), None)))
        except Exception as error:
            error.add_note("".join(traceback.format_exception(error)))
            return bytes(cloudpickle.dumps((None, error)))


def result_of(outcome: bytes) -> Any:
    """The result of a task; its error is raised, with a note of where it came from."""
    result, error = cloudpickle.loads(outcome)
    if error is not None:
        raise error
    return result


@lru_cache(maxsize=2)
def _unpacked(both: bytes) -> Any:
    return cloudpickle.loads(both)


class Processes:
    """Processes of this machine; they start with the first task.

    Attributes:
        count: their number.
        at_once: tasks of one piece of work that may be begun and not read.
    """

    def __init__(self, count: int, load: Callable[[], None] | None) -> None:
        self.count, self.at_once, self._load = count, 2 * count, load
        self._executor: ProcessPoolExecutor | None = None

    def begin(self) -> None:
        """Start the processes with what each loads, if they are not started."""
        if self._load is not None and self._executor is None:
            for _ in range(self.count):
                self._begun(cloudpickle.dumps((self._load, ())), cloudpickle.dumps(()))

    def beginner(self, both: bytes) -> Callable[[bytes], Future[bytes]]:
        """What begins a task with what all of its kind share."""
        return partial(self._begun, both)

    def _begun(self, both: bytes, task: bytes) -> Any:
        with _without_interruptions():
            if self._executor is not None:
                # what a process died of is told to who waits for it; other work goes on with others
                with suppress(BrokenProcessPool):
                    return self._executor.submit(outcome_of, both, task)
            _track_quietly()
            self._executor = ProcessPoolExecutor(max_workers=self.count, timeout=IDLE_S)
            return self._executor.submit(outcome_of, both, task)

    def wait(self, ended: SimpleQueue[int]) -> int:
        """The next task that has ended; those of a process that dies end, too."""
        return ended.get()

    def outcome(self, future: Future[bytes]) -> bytes:
        """The outcome of a task; InputError where its process died, or another that it shared its work with."""
        try:
            return future.result()
        except BrokenProcessPool as error:
            raise InputError(
                "a process ended before its work was done; it may lack memory, expected fewer processes (--jobs 1)"
            ) from error

    def call_off(self, future: Future[bytes]) -> None:
        """Leave a task that is not under way."""
        future.cancel()

    def end(self, *, kill: bool) -> None:
        """End the processes, at once or when the tasks that have begun are done."""
        if self._executor is not None:
            if kill:  # asked to, loky fails at the first task that was called off, and kills none
                for process in list((self._executor._processes or {}).values()):
                    with suppress(ProcessLookupError):
                        kill_process_tree(process)
            self._executor.shutdown()


def _track_quietly() -> None:
    """Start the process that removes semaphores which killed processes leave; it does so without warning of it."""
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (before, "ignore:resource_tracker")))
    try:
        ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


@contextmanager
def _without_interruptions() -> Iterator[None]:
    """Processes and threads started in this block do not receive Ctrl-C: the one that started them ends them."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
