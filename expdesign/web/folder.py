"""The folder of a page: its files are the truth, nothing outside is read or written, every version is kept.

A version is the whole text of a file before a change, in `.expdesign/NAME/NUMBER`. Undo takes the newest one back.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import tomllib
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit

from expdesign.errors import FileError, InputError

VERSIONS = ".expdesign"  # folder of earlier versions
MOST_VERSIONS = 100  # kept of each file
MOST_UPLOAD_BYTES = 200 * 2**20  # size of a file that is taken in
MOST_FILES = 5000  # looked through for files of a kind
NAME = re.compile(r"[^-. /\\\0-\x1f\x7f][^/\\\0-\x1f\x7f]{0,120}")  # names of files that are taken in
KINDS = {
    "scenario": ("scenario", "design"),
    "vessel": ("vessel", "model"),
    "area": ("area", "chart"),
    "card": ("ship", "thrusters"),
}
"""Kind of a TOML file -> tables that it has."""


@dataclass(frozen=True)
class Folder:
    """A folder that is worked on, and all that may be read or written."""

    root: Path  # resolved

    def path(self, name: str | Path) -> Path:
        """A path inside the folder.

        Raises:
            InputError: it leads out of the folder, or into the earlier versions.
        """
        found = (self.root / name).resolve()
        if not found.is_relative_to(self.root) or VERSIONS in found.relative_to(self.root).parts:
            raise InputError(f"{name} is not in the folder {self.root}, expected a file in it")
        return found

    def name(self, path: Path) -> str:
        """A path as it is called in the folder."""
        return path.resolve().relative_to(self.root).as_posix()

    def named_in(self, file: Path, named: str) -> Path:
        """The file of the folder that another file names, relative to itself; raises as `path` does."""
        return self.path(os.path.relpath(file.parent / named, self.root))

    def files(self) -> Iterator[Path]:
        """Files of the folder and its folders, by name; hidden ones, links to nothing and pipes are left out."""
        count = 0
        for base, folders, names in os.walk(self.root):
            folders[:] = sorted(name for name in folders if not name.startswith("."))
            for path in (Path(base) / name for name in sorted(names) if not name.startswith(".")):
                if count == MOST_FILES:
                    return
                if path.is_file() and path.resolve().is_relative_to(self.root):
                    count += 1
                    yield path

    @property
    def too_many(self) -> str:
        """A warning where files are left out because there are so many, or ""."""
        count = sum(1 for _ in self.files())
        return f"This folder has so many files that only the first {count} are listed." if count >= MOST_FILES else ""

    def of_kind(self, kind: str) -> tuple[str, ...]:
        """Names of the TOML files of a kind of `KINDS`."""
        found = []
        for path in self.files():
            if path.suffix == ".toml" and path.stat().st_size < 2**20:
                try:
                    tables = tomllib.loads(path.read_text(encoding="utf-8"))
                except (OSError, ValueError):
                    continue
                if all(table in tables for table in KINDS[kind]):
                    found.append(self.name(path))
        return tuple(found)

    def named(self, pattern: str) -> tuple[str, ...]:
        """Names of the files that match a pattern such as `plan.json`."""
        return tuple(self.name(path) for path in self.files() if path.match(pattern))

    def digest(self, name: str) -> str:
        """What tells two contents of a file apart; "" where there is none."""
        try:
            return hashlib.sha256(self.path(name).read_bytes()).hexdigest()
        except OSError:
            return ""

    def write(self, name: str, text: str) -> None:
        """Write a file as a whole and keep what stood there as a version.

        Raises:
            FileError: the folder or its disk takes nothing.
        """
        path = self.path(name)
        with _writing(path):
            if not path.exists():
                _replace(path, text.encode())
            elif (before := path.read_bytes()) != text.encode():
                kept = self._versions(path)
                version = self._of_versions(path) / f"{int(kept[-1].name) + 1 if kept else 1:06d}"
                _replace(version, before)
                try:
                    _replace(path, text.encode())
                except OSError:
                    version.unlink()
                    raise
                for old in kept[: max(0, len(kept) + 1 - MOST_VERSIONS)]:
                    old.unlink()

    def versions(self, name: str) -> int:
        """How often a file can be undone."""
        return len(self._versions(self.path(name)))

    def last_changed(self, *names: str) -> str:
        """The file of these that was changed last and can be undone; "" where none can."""
        kept = {name: found[-1].stat().st_mtime_ns for name in names if (found := self._versions(self.path(name)))}
        return max(kept, key=kept.__getitem__, default="")

    def last_change(self, name: str) -> str:
        """The lines that the last change took from a file ("- ") and gave it ("+ ")."""
        path = self.path(name)
        kept = self._versions(path)
        if not kept:
            return ""
        before, after = (one.read_text(encoding="utf-8", errors="replace").splitlines() for one in (kept[-1], path))
        return "\n".join(line for line in difflib.ndiff(before, after) if line[:2] in ("- ", "+ "))

    def undo(self, name: str) -> None:
        """Take the newest version of a file back.

        Raises:
            InputError: there is none, or it cannot be written.
        """
        path = self.path(name)
        kept = self._versions(path)
        if not kept:
            raise InputError(f"{name} has no earlier version")
        with _writing(path):
            _replace(path, kept[-1].read_bytes())
            kept[-1].unlink()

    def change(self, name: str, edit: Callable[[MutableMapping[str, Any]], None]) -> None:
        """Change a TOML file; its comments and order stay.

        Args:
            edit: changes the tables in place.

        Raises:
            FileError: it is not TOML, or cannot be written.
        """
        path = self.path(name)
        try:
            content = tomlkit.parse(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise FileError(path, "", f"cannot be changed: {error}") from None
        edit(content)
        self.write(name, tomlkit.dumps(content))

    def take_in(self, name: str, content: bytes, *, beside: Path = Path()) -> str:
        """Write a file that was handed over into a folder; its name, with a number where the name is taken.

        Raises:
            InputError: its name is no plain file name, it is too large, or it cannot be written.
        """
        if not NAME.fullmatch(name):
            raise InputError(f"the file name {name[:80]!r} is not taken, expected at most 120 letters, no '.' first")
        if len(content) > MOST_UPLOAD_BYTES:
            raise InputError(
                f"{name} has {len(content) / 2**20:.0f} MiB, expected at most {MOST_UPLOAD_BYTES // 2**20}"
            )
        path, number = self.path(beside / name), 1
        with _writing(path):
            while path.exists() and path.read_bytes() != content:
                number += 1
                path = self.path(beside / f"{Path(name).stem}-{number}{Path(name).suffix}")
            _replace(path, content)
        return self.name(path)

    def _of_versions(self, path: Path) -> Path:
        return self.root / VERSIONS / path.relative_to(self.root)

    def _versions(self, path: Path) -> list[Path]:
        folder = self._of_versions(path)
        return sorted(item for item in folder.iterdir() if item.name.isdigit()) if folder.is_dir() else []


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Say of which file and why, where nothing can be written."""
    try:
        yield
    except OSError as error:
        raise FileError(path, "", f"cannot be written: {error.strerror or error}") from None


def _replace(path: Path, content: bytes) -> None:
    """Write a whole file or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.new")
    try:
        beside.write_bytes(content)
        beside.replace(path)
    except OSError:
        beside.unlink(missing_ok=True)  # of a full disk
        raise
