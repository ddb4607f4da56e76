"""Results of commands, a request carried out, and where its independent work is done."""

from __future__ import annotations

import gc
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial, wraps
from inspect import cleandoc
from pathlib import Path
from typing import Any, TypeVar

from expdesign import __version__
from expdesign.errors import FileError, InputError
from expdesign.export.document import Document
from expdesign.export.folder import Content, write_files
from expdesign.input_files import read_text
from expdesign.interruptions import interruptions_wait
from expdesign.memory import remembering, user_memory
from expdesign.processes import local_processes, on_cluster, processors
from expdesign.progress import Progress, silent
from expdesign.requests import COMMANDS, Request, command_of, repeating
from expdesign.requests.options import Argument

RUNS = Path("runs")  # where results go unless another folder is asked for
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


Told = Callable[[str], None]
"""Takes lines while a command works."""


def silently(line: str) -> None:
    """Say nothing."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Results of a command."""

    files: tuple[Path, ...]  # written, in the order of their contents
    document: Document  # what they hold, for people

    @property
    def summary(self) -> Mapping[str, object]:
        """Key numbers, ready for JSON; units in the names."""
        return self.document.summary


def results_folder(request: Request, usual: Path | str) -> Path:
    """The folder asked for, or the usual one, checked before any work is spent on something that cannot be written.

    Args:
        request: what was asked.
        usual: folder where none is asked for; a name is one in `runs`.

    Raises:
        InputError: it is a file, lies below a file, or may not be written to.
    """
    folder = getattr(request, "out", None) or (usual if isinstance(usual, Path) else RUNS / usual)
    if problem := folder_problem(folder):
        raise InputError(f"{problem}; --out names the folder of results")
    return folder


def finished(
    request: Request,
    folder: Path,
    files: Mapping[str, Content],
    document: Document,
    progress: Progress,
    *,
    page: str = "",
    drawing: Progress = silent,
) -> Outcome:
    """Write all files into the folder of results, and end.

    Args:
        request: what was asked; the document states the command that repeats it.
        folder: as `results_folder` gives it, asked for before the work.
        page: name of the document as a page, where it has one.
    """
    document = document if document.command else replace(document, command=repeating(request))
    if page:
        from expdesign.export.pages import document_html  # commands without a page do not wait for it

        files = {**files, page: partial(document_html, document, progress=drawing)}
    paths = write_files(folder, files)
    progress("done", 1.0)
    return Outcome(files=paths, document=document)


Kept = TypeVar("Kept")


def left_state(path: Path, restored: Callable[[dict[str, Any]], Kept]) -> Kept:
    """The state that an earlier watch left, as `restored` makes it of its table.

    Raises:
        FileError: there is none, or it is of another kind or version.
    """
    text = read_text(path, "the state that an earlier watch left")
    try:
        table: dict[str, Any] = json.loads(text)
        if table["version"] == __version__:
            return restored(table)
    except (KeyError, TypeError, ValueError, AttributeError):
        pass
    raise FileError(path, "", f"is no state of a watch by version {__version__}, expected one")


def workflow(work: Callable[..., Outcome]) -> Callable[..., Outcome]:
    """The function of a request, which also takes the values of the request themselves.

    `work(requests.Nominal(card=card, seed=1))` and `work(card, seed=1)` are the same. Arguments of the command line, or
    the first value of a command without, and `out` may stand without their names. `cache=False` says `no_cache=True`.
    Called by values, all work is done in one process unless `jobs` says otherwise.
    """
    command = next(one for one in COMMANDS if one.workflow == work.__name__)
    names = [one.name for one in command.request.asked()]
    first = [one.name for one in command.request.asked() if isinstance(one.typed, Argument)] or names[:1]
    in_order = [*first, *({"out"} & {*names})]

    @wraps(work)
    def called(*given: object, progress: Progress = silent, tell: Told | None = None, **values: object) -> Outcome:
        lines = {} if tell is None else {"tell": tell}
        if len(given) == 1 and isinstance(given[0], command.request) and not values:
            return work(given[0], progress=progress, **lines)
        if len(given) > len(in_order) or {*in_order[: len(given)]} & {*values}:
            raise TypeError(f"{work.__name__} takes {', '.join(in_order)} in this order, each once, all others by name")
        if "no_cache" in names and "cache" in values:
            values["no_cache"] = not values.pop("cache")
        alone = {"jobs": 1} if "jobs" in names else {}
        asked = alone | dict(zip(in_order, given, strict=False)) | values
        return work(command.request(**asked), progress=progress, **lines)

    values_in_words = f"Takes `requests.{command.request.__name__}`, or its values: {', '.join(names)}."
    called.__doc__ = f"{cleandoc(work.__doc__ or '')}\n\n{values_in_words}"
    return called


def carry_out(request: Request, *, progress: Progress = silent, tell: Told = silently) -> Outcome:
    """Do what a request asks, e.g. `carry_out(requests.Nominal(card=Path("card.toml")))`.

    Args:
        request: one of those in `expdesign.requests`.
        tell: takes lines while the command works, of a command that has such.

    Raises:
        InputError: what is asked, or a file, is wrong.
        NoAnswer: there is none.
    """
    command = command_of(request)
    with interruptions_wait():  # some solvers do not stand being interrupted while they load
        from expdesign import workflows

        work: Callable[..., Outcome] = getattr(workflows, command.workflow)
    return work(request, progress=progress, **({"tell": tell} if command.tells else {}))


def folder_problem(folder: Path) -> str:
    """Why nothing can be written into a folder, there or to be made: "" where it can."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists() or path.is_symlink())
    if there.is_symlink() and not there.exists():
        return f"{folder}: {there} is a link to {there.readlink()}, which does not exist"
    if not there.is_dir():
        return f"{folder}: {there} is a file, expected a folder"
    return "" if os.access(there, os.W_OK | os.X_OK) else f"{folder}: no permission to write in {there}"
