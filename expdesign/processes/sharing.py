"""Independent work, shared among processes of this machine or the workers of a Dask scheduler.

Results are the same wherever tasks are done: a task takes all that it depends on, its random numbers too, as arguments.

Every call has its own tasks, futures and queue; all that calls share is the place that runs what they begin. So work
may begin inside other work, end early or fail in any order: no call waits for another, or ends what is not its own.
Each task writes into a file how far it is, and the process that waits reads it.
"""

from __future__ import annotations

import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any, TypeVar

import cloudpickle
from joblib import cpu_count

from expdesign.processes.local import Processes, result_of
from expdesign.progress import Progress

if TYPE_CHECKING:
    from expdesign.processes._dask import Cluster


Result = TypeVar("Result")
Item = TypeVar("Item")

SLOW_S = 1.0
"""From which a task was long in coming."""
ALONE_S = 5.0
"""Time from which tasks that come one by one are worth other processes."""
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


LOOK_S = 0.2
"""Between two looks at the reports."""


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
