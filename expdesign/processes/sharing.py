"""Independent work, shared among processes of this machine or the workers of a Dask scheduler.

Results are the same wherever tasks are done: a task takes all that it depends on, its random numbers too, as arguments.

Every call has its own tasks, futures and queue; all that calls share is the place that runs what they begin. So work
may begin inside other work, end early or fail in any order: no call waits for another, or ends what is not its own.
Each task writes into a file how far it is, and the process that waits reads it.

A function and its arguments travel pickled, and so does what comes of them: nothing that a task returns or raises is
unpickled before someone reads it.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import islice
from multiprocessing import resource_tracker
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any, TypeVar

import cloudpickle
from joblib import cpu_count
from joblib.externals.loky import ProcessPoolExecutor, process_executor
from joblib.externals.loky.backend.resource_tracker import ensure_running
from joblib.externals.loky.backend.utils import kill_process_tree

from expdesign.errors import InputError
from expdesign.progress import Progress

if TYPE_CHECKING:
    from expdesign.processes._dask import Cluster


ONE_AT_A_TIME = threading.Lock()
"""Held by the task of this process: solvers and their random numbers are not made for threads."""
IDLE_S = 300.0  # after which processes without work end, so that none outlives a program that was killed
GROWN_BYTES = 2_000_000_000
"""By which a process may grow before another takes its place: programs that are built once are kept, which is no leak.
"""


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
        if self._executor is None:
            _track_quietly()
        with _without_interruptions():
            if self._executor is not None:
                # what a process died of is told to who waits for it; other work goes on with others
                with suppress(BrokenProcessPool):
                    return self._executor.submit(outcome_of, both, task)
            self._executor = ProcessPoolExecutor(max_workers=self.count, timeout=IDLE_S, initializer=_may_grow)
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


def _may_grow() -> None:
    """Let this process grow; loky, where it knows how large it is, would end it from 300 MB on."""
    process_executor._MAX_MEMORY_LEAK_SIZE = GROWN_BYTES


def _track_quietly() -> None:
    """Start the processes that remove semaphores which killed processes leave; they do so without warning of it.

    Before any other: to start them lets Ctrl-C through to what this thread starts afterwards, whatever it blocks.
    """
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (before, "ignore:resource_tracker")))
    try:
        ensure_running()
        resource_tracker.ensure_running()
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


Result = TypeVar("Result")
Item = TypeVar("Item")

SLOW_S = 1.0  # from which a task was long in coming
ALONE_S = 5.0  # time from which tasks that come one by one are worth other processes
_PLACE: ContextVar[Processes | Cluster | None] = ContextVar("_PLACE", default=None)
"""Where the work of a block is shared; None for this process alone."""


@contextmanager
def local_processes(count: int, *, load: Callable[[], None] | None = None) -> Iterator[None]:
    """Work of this block is shared among so many processes of this machine, which end with it.

    Args:
        load: what each does first, where `begin` is called before there is work to share.
    """
    place = Processes(count, load)
    with _sharing(place if count > 1 else None), warnings.catch_warnings():
        # loky replaces a process whose memory has grown, and says so; no work is lost
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
        try:
            yield
            place.end(kill=False)
        except BaseException:
            place.end(kill=True)
            raise


@contextmanager
def on_cluster(scheduler: str) -> Iterator[None]:
    """Work of this block is shared among the workers of a Dask scheduler.

    Raises:
        InputError: Dask is not installed, no scheduler answers, it has no workers or those of another version, or it
            or all of them are lost; the message says which.
    """
    from expdesign.processes._dask import connected

    with connected(scheduler) as cluster, _sharing(cluster):
        yield


@contextmanager
def _sharing(place: Processes | Cluster | None) -> Iterator[None]:
    before = _PLACE.set(place)
    try:
        yield
    finally:
        _PLACE.reset(before)


def processors() -> int:
    """Cores that this process may use: its affinity, its container's quota and LOKY_MAX_CPU_COUNT are kept to."""
    return int(cpu_count())


def shared_among() -> int:
    """How many processes or threads of this machine work of this block may be shared among."""
    place = _PLACE.get()
    return place.count if isinstance(place, Processes) else 1


def begin() -> None:
    """Start the processes of this block, if they are not: there will be work to share."""
    place = _PLACE.get()
    if isinstance(place, Processes):
        place.begin()


def in_order(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Result]:
    """Results of `function(*shared, *task)`, in the order of the tasks.

    One process works on a task when its result is asked for. Several begin at once, on copies made now: what changes
    here later does not reach them. Where results are not read to their end, tasks that are not under way are left.

    Args:
        function: of a module.
        shared: arguments that all tasks share; unpacked once in each process.
        tasks: the others.

    Raises:
        InputError: a process died, or the cluster is lost; whatever a task raises, when its result is asked for.
    """
    return _results(function, shared, tasks, ordered=True)


def as_finished(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Result]:
    """The results of `in_order`, those first that are finished first."""
    return _results(function, shared, tasks, ordered=False)


def _results(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]], *, ordered: bool
) -> Iterator[Result]:
    place = _PLACE.get()
    if place is None:
        return (function(*shared, *task) for task in tasks)
    both, copies = cloudpickle.dumps((function, shared)), [cloudpickle.dumps(task) for task in tasks]
    results = _shared(place, both, copies, ordered=ordered)
    next(results)
    return results


def _shared(place: Processes | Cluster, both: bytes, tasks: list[bytes], *, ordered: bool) -> Iterator[Any]:
    """None once the first tasks have begun, then the results; each that ends lets the reader begin another."""
    begin_task, waiting = place.beginner(both), iter(enumerate(tasks))
    begun, ended, outcomes = dict[int, Any](), SimpleQueue[int](), dict[int, bytes]()

    def begin_more() -> None:
        for number, task in islice(waiting, place.at_once - len(begun)):
            begun[number] = begin_task(task)
            begun[number].add_done_callback(lambda _, number=number: ended.put(number))

    try:
        begin_more()
        yield None
        for following in range(len(tasks)):
            while not outcomes or (ordered and following not in outcomes):
                number = place.wait(ended)
                outcomes[number] = place.outcome(begun.pop(number))
                begin_more()
            yield result_of(outcomes.pop(following if ordered else next(iter(outcomes))))
    finally:
        for future in begun.values():
            place.call_off(future)


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
    place, source, began_s, asked_s = _PLACE.get(), iter(tasks), time.monotonic(), time.monotonic()
    for item, task in source:
        slow = time.monotonic() - asked_s > SLOW_S
        yield item, function(*shared, *task)
        asked_s = time.monotonic()
        if isinstance(place, Processes) and not slow and asked_s - began_s > ALONE_S:
            break
    else:
        return
    begin_task, work, last = place.beginner(cloudpickle.dumps((function, shared))), deque[tuple[Item, Any]](), False
    while not last:
        asked_s, taken = time.monotonic(), list(islice(source, 1))
        last, slow = not taken, time.monotonic() - asked_s > SLOW_S
        work.extend((item, begin_task(cloudpickle.dumps(task))) for item, task in taken)
        while work and (last or slow or len(work) > place.at_once):
            item, future = work.popleft()
            yield item, result_of(place.outcome(future))


LOOK_S = 0.2  # between two looks at the reports


@dataclass(frozen=True)
class Reporter:
    """Progress of one task; where its file is not there, as on another machine, nothing is reported."""

    path: Path

    def __call__(self, activity: str, share: float) -> None:
        """Write a line."""
        with suppress(OSError), self.path.open("r+", encoding="utf-8") as file:
            file.seek(0, 2)
            file.write(f"{float(share)!r} {activity}\n")

    def last(self) -> str:
        """The last line; nothing done at first."""
        *_, line = "0.0 ", *self.path.read_text("utf-8").splitlines()
        return line


class Together:
    """Progress of tasks begun in this order, of about the same length: `reporters` has one for each."""

    def __init__(self, progress: Progress, reporters: tuple[Reporter, ...], at_once: int) -> None:
        """Nothing is reported yet; so many tasks are worked on at once."""
        self.reporters, self._progress, self._at_once = reporters, progress, at_once
        self._known, self._looking = [reporter.last() for reporter in reporters], Lock()

    def look(self) -> None:
        """Report what is new."""
        with self._looking:
            for number, reporter in enumerate(self.reporters):
                if (new := reporter.last()) != self._known[number]:
                    self._known[number] = new
                    done = sum(float(line.partition(" ")[0]) for line in self._known)
                    self._progress(new.partition(" ")[2], _elapsed(done, len(self._known), self._at_once))

    def finished(self, number: int, activity: str) -> None:
        """Report at once that a task is finished."""
        self.reporters[number](activity, 1.0)
        self.look()


@contextmanager
def reported_together(progress: Progress, count: int) -> Iterator[Together]:
    """Progress of so many tasks, begun in this order, of about the same length: reported while this block lasts."""
    with TemporaryDirectory(prefix="expdesign-") as folder:
        reporters = tuple(Reporter(Path(folder) / str(number)) for number in range(count))
        for reporter in reporters:
            reporter.path.touch()
        together, ended = Together(progress, reporters, shared_among()), Event()
        listener = Thread(target=_listen, args=(together, ended), daemon=True)
        listener.start()
        try:
            yield together
        finally:
            ended.set()
            listener.join()
            together.look()


def _listen(together: Together, ended: Event) -> None:
    while not ended.wait(LOOK_S):
        together.look()


def _elapsed(done: float, count: int, at_once: int) -> float:
    """Share of the time gone when so much of equal tasks is done, so many at once: the last may be fewer."""
    rounds, rest = divmod(count, at_once)
    before = min(done / at_once, rounds)
    after = max(done - rounds * at_once, 0.0) / rest if rest else 0.0
    return (before + after) / (rounds + bool(rest))
