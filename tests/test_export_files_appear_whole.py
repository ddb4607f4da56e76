"""Files appear whole or not at all, whatever happens while they are written."""

import os
import signal
from pathlib import Path

import pytest

from expdesign.errors import FileError
from expdesign.export.folder import write_files

FILES = {"a.txt": "alpha\n", "b.bin": b"\x00\xff", "c.txt": "\N{GREEK SMALL LETTER GAMMA}"}


def content(folder: Path) -> dict[str, bytes]:
    """Everything in a folder, hidden leftovers included."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_every_file_is_there_with_its_content_and_nothing_else(tmp_path: Path) -> None:
    paths = write_files(tmp_path / "new" / "runs", FILES)
    assert [path.name for path in paths] == list(FILES)
    assert content(tmp_path / "new" / "runs") == {
        "a.txt": b"alpha\n", "b.bin": b"\x00\xff", "c.txt": "\N{GREEK SMALL LETTER GAMMA}".encode()
    }  # fmt: skip


def test_older_files_are_replaced_and_others_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "other.txt").write_text("other")
    write_files(tmp_path, {"a.txt": "new"})
    assert content(tmp_path) == {"a.txt": b"new", "other.txt": b"other"}


@pytest.mark.parametrize("stop", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("step", ["fsync", "link", "replace"])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_failure_at_any_step_leaves_the_folder_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: BaseException, step: str, count: int
) -> None:
    older = {"a.txt": b"old a", "c.txt": b"old c", "b.bin": b"old b"}
    for name, text in older.items():
        (tmp_path / name).write_bytes(text)
    calls = 0
    real = getattr(Path if step == "replace" else os, step)

    def failing(*arguments: object) -> object:
        nonlocal calls
        calls += 1
        if calls == count:
            raise stop
        return real(*arguments)

    monkeypatch.setattr(Path if step == "replace" else os, step, failing)
    if step == "link" and isinstance(stop, OSError):
        write_files(tmp_path, FILES)  # a file system without hard links: older files are kept by copying
        assert content(tmp_path)["a.txt"] == b"alpha\n"
        return
    with pytest.raises(FileError if isinstance(stop, OSError) else KeyboardInterrupt):
        write_files(tmp_path, FILES)
    assert content(tmp_path) == older


@pytest.mark.parametrize("count", [1, 2, 3])
def test_folders_made_for_the_files_are_gone_again_after_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    calls = 0
    real = Path.replace

    def failing(path: Path, target: Path) -> Path:
        nonlocal calls
        calls += 1
        if calls == count:
            raise KeyboardInterrupt
        return real(path, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(KeyboardInterrupt):
        write_files(tmp_path / "runs" / "one", FILES)
    assert content(tmp_path) == {}


@pytest.mark.parametrize("step", ["fsync", "link", "replace", "unlink"])
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_ctrl_c_at_any_step_leaves_all_old_files_or_all_new_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, count: int
) -> None:
    """Pressed twice, too: it waits while files are put in place, and tidying up is not broken off."""
    older = dict.fromkeys(FILES, b"old")
    for name, text in older.items():
        (tmp_path / name).write_bytes(text)
    calls = 0
    owner = os if step in ("fsync", "link") else Path
    real = getattr(owner, step)

    def interrupted(*arguments: object, **options: object) -> object:
        nonlocal calls
        calls += 1
        if calls >= count:
            signal.raise_signal(signal.SIGINT)
        return real(*arguments, **options)

    monkeypatch.setattr(owner, step, interrupted)
    before = signal.getsignal(signal.SIGINT)
    new = {name: text.encode() if isinstance(text, str) else text for name, text in FILES.items()}
    happened = count <= len(FILES) or step == "unlink"
    if happened:
        with pytest.raises(KeyboardInterrupt):
            write_files(tmp_path, FILES)
    else:
        write_files(tmp_path, FILES)
    assert content(tmp_path) == (older if step == "fsync" and count < len(FILES) else new)
    assert signal.getsignal(signal.SIGINT) is before


def test_an_ignored_signal_stays_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a command that was started with nohup or in the background."""
    real = os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: (signal.raise_signal(signal.SIGINT), real(number)))
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        write_files(tmp_path, FILES)
    finally:
        signal.signal(signal.SIGINT, before)
    assert set(content(tmp_path)) == set(FILES)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(FileError, match="taken: is a file, expected a folder"):
        write_files(tmp_path / "taken", FILES)
    with pytest.raises(FileError, match="cannot be made"):
        write_files(tmp_path / "taken" / "deeper", FILES)


@pytest.mark.parametrize("name", ["", "..", "deep/a.txt", "/etc/a.txt"])
def test_only_plain_file_names_are_taken(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match="plain file name"):
        write_files(tmp_path / "runs", {name: "text"})
    assert content(tmp_path) == {}


def test_a_folder_in_the_way_of_a_file_is_an_error_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "c.txt").mkdir()
    with pytest.raises(FileError, match="is a folder, expected a file"):
        write_files(tmp_path, FILES)
    assert [path.name for path in tmp_path.iterdir()] == ["c.txt"]
