"""Results remembered on disk: what was computed from the same values by the same programs is read instead.

A result stands under a digest of all it depends on: the function, its arguments by their content, the source files of
this package, the packages that compute, and the processor's instructions. So nothing has to be thrown away by hand,
and no result of an earlier version comes back. Entries are written beside their place and moved there, so several
processes may share a folder. What is damaged, or may have been written by another user, counts as absent.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import pickle
import platform
import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import lru_cache, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, TypeVar, cast

import numpy as np

from expdesign import processes

Result = TypeVar("Result")

VARIABLE = "EXPDESIGN_CACHE"  # environment variable: the folder of remembered results, or `off`
MOST_BYTES = 256 * 2**20  # size of the folder; the results not used for longest are dropped
MARK = b"expdesign result 1\n"
COMPUTING = ("casadi", "clarabel", "cvxpy", "matplotlib", "numpy", "ompl", "scipy", "shapely")
"""Packages whose version a result depends on."""
OURS = re.compile(r"[0-9a-f]{40}|\.new-.*")  # names of entries, and of those not yet in their place
ABSENT = object()  # stands for a result that is not remembered


@dataclasses.dataclass(frozen=True)
class Memory:
    """A folder of results."""

    folder: Path  # of this user alone
    most_bytes: int = MOST_BYTES  # size to which `trim` cuts it

    def read(self, key: str) -> Any:
        """The result of a key, or `ABSENT`."""
        path = self.folder / key
        try:
            if not _own(self.folder) or not _own(path):
                return ABSENT
            content = path.read_bytes()
            head, body = content[: len(MARK) + 32], content[len(MARK) + 32 :]
            if head != MARK + hashlib.sha256(key.encode() + body).digest():
                return ABSENT
            os.utime(path)
            return pickle.loads(body)
        except Exception:  # whatever is wrong with an entry, the result can be computed
            return ABSENT

    def write(self, key: str, result: Any) -> None:
        """Remember a result, whole or not at all; a folder that cannot be written to stays as it is."""
        body = pickle.dumps(result, protocol=pickle.HIGHEST_PROTOCOL)
        with suppress(OSError):
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _own(self.folder):
                return
            handle, name = tempfile.mkstemp(dir=self.folder, prefix=".new-")
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(MARK + hashlib.sha256(key.encode() + body).digest() + body)
                Path(name).replace(self.folder / key)
            except BaseException:
                Path(name).unlink(missing_ok=True)
                raise

    def trim(self) -> None:
        """Drop the results not used for longest until the rest is small enough."""
        found = []
        with suppress(OSError):
            for entry in os.scandir(self.folder):
                if not OURS.fullmatch(entry.name):  # a folder that someone chose may hold other files
                    continue
                with suppress(OSError):
                    status = entry.stat(follow_symlinks=False)
                    found.append((status.st_mtime_ns, status.st_size, entry.path))
        size = sum(bytes_ for _, bytes_, _ in found)
        for _, bytes_, path in sorted(found):
            if size <= self.most_bytes:
                break
            with suppress(OSError):
                Path(path).unlink()
            size -= bytes_


_memory: ContextVar[Memory | None] = ContextVar("memory", default=None)


@contextmanager
def remembering(memory: Memory | None) -> Iterator[Memory | None]:
    """Results that are worked out in this block are remembered there, or nowhere."""
    token = _memory.set(memory)
    try:
        yield memory
    finally:
        _memory.reset(token)
        if memory is not None:
            memory.trim()


def memory_in_use() -> Memory | None:
    """Where results are remembered now."""
    return _memory.get()


def user_memory() -> Memory | None:
    """The user's own folder, by the environment and the customs of the system; None where it is switched off."""
    chosen = os.environ.get(VARIABLE, "")
    if chosen.lower() in ("off", "0", "no", "false"):
        return None
    return Memory(Path(chosen).expanduser().absolute() if chosen else _user_caches() / "expdesign")


def _user_caches() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return chosen if chosen.is_absolute() else Path.home() / ".cache"


def recalled(function: Callable[..., Result], *arguments: Any, **aside: Any) -> Result:
    """`function(*arguments, **aside)`, read where it is remembered.

    Args:
        function: of a module, and pure.
        arguments: all that the result depends on.
        aside: what the result does not depend on, such as progress.
    """
    memory = memory_in_use()
    keys = None if memory is None else _keys(function, (), [arguments])
    if memory is None or keys is None:
        processes.begin()
        return function(*arguments, **aside)
    result = memory.read(keys[0])
    if result is ABSENT:
        processes.begin()
        result = function(*arguments, **aside)
        memory.write(keys[0], result)
    return cast(Result, result)


def in_order(
    function: Callable[..., Result], shared: tuple[Any, ...], tasks: Iterable[tuple[Any, ...]]
) -> Iterator[Result]:
    """As `expdesign.processes.in_order`, of a pure function: what is remembered is read, the rest is worked on."""
    memory = memory_in_use()
    if memory is None:
        return processes.in_order(function, shared, tasks)
    listed = list(tasks)
    keys = _keys(function, shared, listed)
    if keys is None:
        return processes.in_order(function, shared, listed)
    found = [memory.read(key) for key in keys]
    missing = [task for task, result in zip(listed, found, strict=True) if result is ABSENT]
    return _merged(memory, keys, found, processes.in_order(_within, (memory, function, *shared), missing))


def _within(memory: Memory, function: Callable[..., Result], *arguments: Any) -> Result:
    """`function(*arguments)`, what it calls remembered too, in whatever process."""
    token = _memory.set(memory)
    try:
        return function(*arguments)
    finally:
        _memory.reset(token)


def _keys(function: Callable[..., Any], shared: tuple[Any, ...], tasks: list[tuple[Any, ...]]) -> list[str] | None:
    """The key of each task; None where an argument has no digest, so that nothing is remembered."""
    try:
        base = digest(programs(), function, shared)
        return [digest(base, task) for task in tasks]
    except TypeError:
        return None


def _merged(memory: Memory, keys: list[str], found: list[Any], computed: Iterator[Any]) -> Iterator[Any]:
    for key, result in zip(keys, found, strict=True):
        if result is ABSENT:
            result = next(computed)
            memory.write(key, result)
        yield result


@lru_cache(maxsize=1)
def programs() -> str:
    """Digest of everything that computes: this package's source files, Python, other packages, the processor."""
    root = Path(__file__).parent
    sources = [(path.relative_to(root).as_posix(), path.read_bytes()) for path in sorted(root.rglob("*.py"))]
    versions = [(name, _version(name)) for name in COMPUTING]
    instructions = np.show_config(mode="dicts").get("SIMD Extensions", {})
    return digest(sources, versions, sys.version, platform.machine(), instructions)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def digest(*values: Any) -> str:
    """Hexadecimal digest of values by their content: equal for equal content, in every process.

    Values are numbers, text, bytes, paths, arrays, shapes, generators of random numbers, containers, functions of
    modules, partial functions, classes, frozen values, and other objects of this package by their attributes.

    Raises:
        TypeError: something else.
    """
    hashed = hashlib.sha256()
    for value in values:
        _feed(hashed.update, value)
    return hashed.hexdigest()[:40]


def _feed(update: Callable[[bytes], None], value: Any) -> None:
    """Feed a value as its type, the length of its content, and its content, so that no two look alike."""
    kind = type(value)
    if value is None or isinstance(value, (bool, int, float, complex, str)):
        parts: Iterable[Any] = (repr(value).encode(),)
    elif isinstance(value, bytes):
        parts = (value,)
    elif isinstance(value, (np.ndarray, np.generic)):
        array = np.asarray(value)
        parts = (array.dtype.str, array.shape, array.tolist() if array.dtype.hasobject else array.tobytes())
    elif isinstance(value, (tuple, list)):
        parts = value
    elif isinstance(value, Mapping):
        parts = [part for item in value.items() for part in item]
    elif isinstance(value, Set):
        parts = sorted(map(digest, value))
    elif isinstance(value, os.PathLike):
        parts = (os.fspath(value),)
    elif kind.__module__.startswith("shapely."):
        parts = (value.wkb,)
    elif isinstance(value, np.random.Generator):
        parts = (value.bit_generator.state,)
    elif isinstance(value, partial):
        parts = (value.func, value.args, value.keywords)
    elif isinstance(value, MethodType):
        parts = (value.__self__, value.__name__)
    elif isinstance(value, (type, FunctionType, BuiltinFunctionType)):
        parts = (_place(value),)
    elif dataclasses.is_dataclass(value):
        fields = [item for item in dataclasses.fields(value) if item.init]  # the rest follows from these
        made_from = [item.name for item in fields if not item.metadata.get("aside")]
        parts = [part for name in made_from for part in (name, getattr(value, name))]
    elif kind.__module__.startswith("expdesign."):
        parts = (vars(value),)
    else:
        raise TypeError(f"{kind.__module__}.{kind.__qualname__} has no digest")
    parts = tuple(parts)
    update(f"{kind.__module__}.{kind.__qualname__}:{len(parts)}:".encode())
    for part in parts:
        if isinstance(part, bytes):
            update(f"{len(part)}:".encode() + part)
        else:
            _feed(update, part)


def _place(value: Any) -> str:
    """Where a function or a class is found again; TypeError for those made inside others."""
    place = f"{value.__module__}.{value.__qualname__}"
    if "<" in place:
        raise TypeError(f"{place} has no digest")
    return place


def _own(path: Path) -> bool:
    """Whether only this user can have written there."""
    status = path.stat(follow_symlinks=False)
    return not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)
