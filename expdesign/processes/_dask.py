"""Work on the workers of a Dask scheduler; the only importer of `distributed`.

What tasks share is the result of a task itself: where the worker that holds it dies, the scheduler makes it again from
what it was given. Data scattered among workers would be lost, and with them the work.
"""

from __future__ import annotations

import logging
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from expdesign.errors import InputError

try:
    from distributed import Client, Future, KilledWorker
except ImportError:
    raise InputError("--scheduler needs Dask, expected the extra: pip install 'expdesign[cluster]'") from None

COMPARED = ("casadi", "clarabel", "cvxpy", "numpy", "ompl", "scipy", "shapely")
"""Packages that results may depend on, besides our own: workers have the versions that are here."""
LOGGERS = ("distributed", "distributed.client", "distributed.batched", "distributed.core", "distributed.comm")
"""They tell of lost connections, each in its own words."""
CONNECT_S = 4.0  # in which a scheduler must answer at first, and again after the connection broke
LOOK_S = 5.0  # without a finished task, after which the scheduler is asked whether it and its workers are there
ANSWER_S = 20.0  # in which it must answer then
IDLE_S = 60.0  # after which work without any worker is given up; workers that died are mostly started again sooner


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """The workers of a scheduler, which are checked; work that is left after the block is called off.

    Raises:
        InputError: no scheduler answers, or its workers cannot do the work.
    """
    with _quiet_loggers():
        try:
            client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"--scheduler {address}: no scheduler answers there ({error})") from None
        try:
            yield Cluster(client, address)
        finally:
            client.close(timeout=CONNECT_S)


class Cluster:
    """A scheduler, at the address that was given, and its workers.

    Raises:
        InputError: there are no workers, or they have other versions than this process.
    """

    at_once = sys.maxsize  # the scheduler shares tasks out as workers come and go

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._call, versions = _sent_by_value()
        self._expected = versions(COMPARED)
        self._idle_since: float | None = None
        self._check_workers(versions)

    def beginner(self, both: bytes) -> Callable[[bytes], Future[Any]]:
        """What submits a task with what all of its kind share. One whose worker dies is done by another."""
        shared = self._submitted(bytes, both)
        return partial(self._submitted, self._call, self._expected["expdesign"], shared)

    def _submitted(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message="Sending large graph")  # it is sent once
                return self._client.submit(function, *arguments, pure=False)
        except (OSError, RuntimeError):
            raise self._lost() from None

    def wait(self, ended: SimpleQueue[int]) -> int:
        """The next task that has ended, while the scheduler is there."""
        while True:
            try:
                return ended.get(timeout=LOOK_S)
            except Empty:
                self._look()

    def outcome(self, future: Future[Any]) -> bytes:
        """What the worker sent; where that is lost with the worker, the work is done again."""
        while True:
            try:
                worker, version, outcome = future.result(timeout=ANSWER_S)
            except TimeoutError:
                self._look()
            except KilledWorker:
                raise self._error("several workers died of the same task; they may lack memory") from None
            except Exception:
                raise self._lost() from None
            else:
                self._check(worker, {"expdesign": version})
                return bytes(outcome)

    def call_off(self, future: Future[Any]) -> None:
        """The scheduler forgets what nobody holds."""
        future.release()

    def _look(self) -> None:
        """Raise InputError where the scheduler does not answer, or has been without workers for long."""
        try:
            scheduler = self._client.scheduler
            assert scheduler is not None
            found = self._client.sync(scheduler.identity, callback_timeout=ANSWER_S)
        except Exception:
            raise self._lost() from None
        now = time.monotonic()
        self._idle_since = None if found["workers"] else self._idle_since or now
        if self._idle_since is not None and now - self._idle_since > IDLE_S:
            raise self._error(f"there have been no workers for {IDLE_S:g} s, and work is left")

    def _check_workers(self, versions: Callable[[Sequence[str]], dict[str, str]]) -> None:
        try:
            self._client.wait_for_workers(1, timeout=ANSWER_S)
            found = self._client.run(versions, COMPARED)
        except TimeoutError:
            raise self._error("there are no workers, expected some (dask worker ADDRESS)") from None
        except Exception as error:
            raise self._error(f"the workers do not answer ({type(error).__name__})") from None
        for worker in sorted(found):
            self._check(worker, found[worker])

    def _check(self, worker: str, versions: dict[str, str]) -> None:
        for package, version in versions.items():
            if version != self._expected[package]:
                raise self._error(
                    f"worker {worker} has {package} {version}, expected {self._expected[package]}, as it is here"
                )

    def _lost(self) -> InputError:
        return self._error("the connection was lost before the work was done")

    def _error(self, problem: str) -> InputError:
        return InputError(f"--scheduler {self._address}: {problem}")


def _sent_by_value() -> tuple[Callable[..., tuple[str, str, bytes]], Callable[[Sequence[str]], dict[str, str]]]:
    """What workers call for a task, and for the versions of packages.

    Functions inside a function are sent by value: a worker may have another version of this package, or none.
    """

    def versions(packages: Sequence[str]) -> dict[str, str]:
        import platform
        from importlib.metadata import PackageNotFoundError, version

        found = {"python": ".".join(platform.python_version_tuple()[:2]), "expdesign": own_version()}
        for package in packages:
            try:
                found[package] = version(package)
            except PackageNotFoundError:
                found[package] = "none"
        return found

    def own_version() -> str:
        try:
            from expdesign import __version__
        except ImportError:
            return "none"
        return __version__

    def call(expected: str, both: bytes, task: bytes) -> tuple[str, str, bytes]:
        from distributed import get_worker

        found = own_version()
        if found != expected:
            return get_worker().address, found, b""
        from expdesign.processes.sharing import outcome_of

        return get_worker().address, found, outcome_of(both, task)

    return call, versions


@contextmanager
def _quiet_loggers() -> Iterator[None]:
    """What happens to a connection is told once, as an error of ours."""
    levels = {logger: logger.level for logger in map(logging.getLogger, LOGGERS)}
    for logger in levels:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)
