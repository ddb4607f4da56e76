"""Files are written completely or not at all, and results before the pages that show them."""

from __future__ import annotations

import os
import re
import shutil
import traceback
import uuid
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from expdesign.errors import FileError, NotDrawn
from expdesign.export.formats.format import xml_text
from expdesign.interruptions import interruptions_wait

REMAINS = re.compile(r"\..+\.(\d+)-[0-9a-f]{12}\.(?:new|old)")
"""Names of temporary files, with the process that writes them."""
NOT_DRAWN = re.compile(r'<p class="not-drawn">(.*?)</p>', re.DOTALL)
Content = str | bytes | Path | Callable[[], str]
"""Of a file, or a file that is copied; a page is a function that draws it."""


@dataclass(frozen=True)
class _Slot:
    """One file during writing: the new content in `beside`, an older file in `before` until all are in place."""

    target: Path
    beside: Path
    before: Path

    def write(self, content: bytes | Path) -> None:
        with self.beside.open("xb") as file:
            if isinstance(content, Path):
                with content.open("rb") as source:
                    shutil.copyfileobj(source, file)
            else:
                file.write(content)
            file.flush()
            os.fsync(file.fileno())

    def keep_older(self) -> None:
        if not self.target.exists():
            return
        try:
            os.link(self.target, self.before)
        except OSError:  # a file system without hard links
            shutil.copy2(self.target, self.before)

    def undo(self) -> None:
        """Restore the previous state from the disk."""
        renamed = not self.beside.exists()
        if renamed and self.before.exists():
            self.before.replace(self.target)
        elif renamed:
            self.target.unlink(missing_ok=True)
        self.forget()

    def forget(self) -> None:
        """Remove the temporary files."""
        for path in (self.beside, self.before):
            with suppress(OSError):
                path.unlink(missing_ok=True)


def write_files(folder: Path, files: Mapping[str, Content]) -> tuple[Path, ...]:
    """Write all results, or none; then draw the pages and write all of them, or none.

    Files are written beside their final names, synchronised to disk, then all renamed. After an error or an
    interruption the folder is as it was, and a folder made for the files is gone again; but for results whose pages
    were being drawn, which stay without earlier pages, as these are of other results. A page that cannot be drawn is
    replaced by one that says so.

    Args:
        folder: where to; made when missing.
        files: plain file name -> content; text is written as UTF-8 with the line ends it has.

    Returns:
        The paths written, in the order given.

    Raises:
        FileError: the folder or a file cannot be written, or another command wrote the same results meanwhile, whose
            page this is not.
    """
    results = {name: content for name, content in files.items() if not callable(content)}
    pages = {name: content for name, content in files.items() if callable(content)}
    for name in files:
        _slot(folder, name, "")
    if results or not pages:
        _write(folder, results)
    if pages:
        _write_pages(folder, pages, results)
    return tuple(folder / name for name in files)


def _write_pages(folder: Path, pages: Mapping[str, Callable[[], str]], results: Collection[str]) -> None:
    """Draw and write the pages of results that are written, or no page."""
    written = _marks(folder, results)
    try:
        drawn = {name: _page(name, draw) for name, draw in pages.items()}
        alone = _marks(folder, results) == written
        if alone:
            _write(folder, drawn)
    except BaseException as error:
        for name in pages if results else ():
            with suppress(OSError):
                (folder / name).unlink(missing_ok=True)
        if results and isinstance(error, FileError):
            problem = f"{', '.join(pages)} {error.problem}; {', '.join(results)} are written"
            raise FileError(folder, "", problem) from None
        if results and isinstance(error, KeyboardInterrupt):
            names = ", ".join(results)
            raise KeyboardInterrupt(f"{folder}: {names} are written, {', '.join(pages)} not") from None
        raise
    if not alone:
        raise FileError(folder, "", "another command wrote its results there meanwhile, expected a folder (--out) each")


def _marks(folder: Path, names: Collection[str]) -> list[tuple[int, int]]:
    """What changes where a file is written again."""
    found = [(folder / name).stat() for name in names if (folder / name).exists()]
    return [(one.st_ino, one.st_mtime_ns) for one in found]


def _page(name: str, draw: Callable[[], str]) -> str:
    try:
        return draw()
    except Exception as error:
        return f'<!DOCTYPE html>\n<meta charset="utf-8">\n<title>{name}</title>\n{not_drawn("this page", error)}\n'


def not_drawn(what: str, error: Exception) -> str:
    """A paragraph in place of what could not be drawn, with a warning `NotDrawn`."""
    said = xml_text(f"{type(error).__name__}: {error}".replace("<", "").replace("&", ""))
    if os.environ.get("EXPDESIGN_DEBUG"):
        traceback.print_exception(error)
    sentence = f"{what} could not be drawn ({said}): a defect in expdesign"
    warnings.warn(NotDrawn(sentence), stacklevel=2)
    return f'<p class="not-drawn">{sentence[0].upper()}{sentence[1:]}. All other results are written.</p>'


def gaps(paths: Sequence[Path]) -> tuple[str, ...]:
    """What could not be drawn in pages among these files, a sentence each."""
    pages = [path for path in paths if path.suffix == ".html" and path.exists()]
    return tuple(f"{path}: {found}" for path in pages for found in NOT_DRAWN.findall(path.read_text(encoding="utf-8")))


def _write(folder: Path, files: Mapping[str, str | bytes | Path]) -> None:
    """Write all files, or none."""
    mark = f"{os.getpid()}-{uuid.uuid4().hex[:12]}"
    slots = [_slot(folder, name, mark) for name in files]
    contents = [content.encode() if isinstance(content, str) else content for content in files.values()]
    with interruptions_wait() as stop_here, _made(folder):
        _clear_remains(folder)
        try:
            _write_beside(slots, contents, stop_here)
            _put_in_place(slots)
        except OSError as error:
            raise FileError(folder, "", f"cannot be written: {error.strerror or error}") from None


def _clear_remains(folder: Path) -> None:
    """Remove the temporary files of processes that were killed while they wrote here."""
    for path in folder.glob(".*.[no][el][wd]"):
        found = REMAINS.fullmatch(path.name)
        if found and not _runs(int(found[1])):
            with suppress(OSError):
                path.unlink()


def _runs(process: int) -> bool:
    """Whether there is a process of this number; where that cannot be asked without harm, there may be."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _slot(folder: Path, name: str, mark: str) -> _Slot:
    if name in ("", "..") or Path(name).name != name:
        raise FileError(folder / name, "", "is not a plain file name")
    if (folder / name).is_dir():
        raise FileError(folder / name, "", "is a folder, expected a file or nothing")
    return _Slot(folder / name, folder / f".{name}.{mark}.new", folder / f".{name}.{mark}.old")


def _write_beside(slots: list[_Slot], contents: list[bytes | Path], stop_here: Callable[[], None]) -> None:
    try:
        for slot, content in zip(slots, contents, strict=True):
            stop_here()
            slot.write(content)
    except BaseException:
        for slot in slots:
            slot.forget()
        raise


def _put_in_place(slots: list[_Slot]) -> None:
    try:
        for slot in slots:
            slot.keep_older()
        for slot in slots:
            slot.beside.replace(slot.target)
    except BaseException:
        for slot in slots:
            slot.undo()
        raise
    for slot in slots:
        slot.forget()


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Make the folder and its parents; remove those that were made when the block fails."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            what = "is a link to nothing" if folder.is_symlink() and not folder.exists() else "is a file"
            raise FileError(folder, "", f"{what}, expected a folder") from None
        except OSError as error:
            raise FileError(folder, "", f"cannot be made: {error.strerror or error}") from None
        yield
    except BaseException:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
        raise
