"""Results are written before pages are drawn, and what cannot be drawn costs no more than itself."""

import ast
import errno
import os
from pathlib import Path

import pytest

import expdesign
from expdesign import cli
from expdesign.errors import FileError, NotDrawn
from expdesign.export.folder import gaps, write_files
from expdesign.export.pages.figures import page_figure
from synthetic_ship import sail, trial, vessel_file, write


def broken(*_: object, **__: object) -> str:
    raise KeyError("Y_<v>")


def test_results_are_on_the_disk_while_the_page_is_drawn(tmp_path: Path):
    seen = []

    def page() -> str:
        seen.append((tmp_path / "out.json").read_text("utf-8"))
        return "<p>drawn</p>"

    paths = write_files(tmp_path, {"out.html": page, "out.json": "{}"})
    assert seen == ["{}"]
    assert [path.name for path in paths] == ["out.html", "out.json"]
    assert not gaps(paths)


def test_a_page_that_fails_is_replaced_by_one_that_says_so(tmp_path: Path):
    (tmp_path / "out.html").write_text("of an earlier run", encoding="utf-8")
    with pytest.warns(NotDrawn, match="this page could not be drawn"):
        paths = write_files(tmp_path, {"out.html": broken, "out.json": "{}"})
    (said,) = gaps(paths)
    assert "out.html: This page could not be drawn (KeyError: 'Y_v>')" in said
    assert "of an earlier run" not in (tmp_path / "out.html").read_text("utf-8")
    assert (tmp_path / "out.json").read_text("utf-8") == "{}"


def test_an_interruption_of_the_page_leaves_results_and_no_half_page(tmp_path: Path):
    (tmp_path / "out.html").write_text("of earlier results", encoding="utf-8")

    def page() -> str:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"out\.json are written, out\.html not"):
        write_files(tmp_path, {"out.html": page, "out.json": "{}"})
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]


def test_a_disk_that_is_full_when_the_page_comes_keeps_the_results_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """An earlier page, of other results, is none of these."""
    (tmp_path / "out.html").write_text("of earlier results", encoding="utf-8")

    def page() -> str:
        monkeypatch.setattr(os, "fsync", full)
        return "<p>drawn</p>"

    def full(file: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(FileError, match=r"out\.html cannot be written: No space left on device; out\.json are written"):
        write_files(tmp_path, {"out.html": page, "out.json": "{}"})
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]


def test_a_page_is_never_beside_results_of_another_command(tmp_path: Path):
    """Of two commands in one folder, the one whose results are overwritten while it draws ends as wrong."""

    def meanwhile() -> str:
        write_files(tmp_path, {"out.html": lambda: "<p>another's</p>", "out.json": '{"a": 1}'})
        return "<p>drawn</p>"

    with pytest.raises(FileError, match=r"another command wrote its results there meanwhile"):
        write_files(tmp_path, {"out.html": meanwhile, "out.json": "{}"})
    there = {path.name: path.read_text("utf-8") for path in tmp_path.iterdir()}
    assert there == {"out.html": "<p>another's</p>", "out.json": '{"a": 1}'}


def test_a_figure_that_fails_leaves_a_sentence_in_its_place():
    with pytest.warns(NotDrawn, match="the figure broken could not be drawn"):
        assert "The figure broken could not be drawn" in page_figure(broken)()


def test_every_function_that_makes_a_figure_of_a_page_is_one_of_these():
    plain, marked = [], 0
    for path in (Path(expdesign.__file__).parent / "export").rglob("*.py"):
        for function in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(function, ast.FunctionDef) or function.name == "svg":
                continue
            calls = {
                node.func.id for node in ast.walk(function) if isinstance(node, ast.Call) and hasattr(node.func, "id")
            }
            marks = {mark.id for mark in function.decorator_list if isinstance(mark, ast.Name)}
            marked += "page_figure" in marks
            plain += [f"{path.name}: {function.name}"] if "svg" in calls and "page_figure" not in marks else []
    assert not plain
    assert marked > 25


@pytest.mark.parametrize("place", ["figure", "page"])
def test_the_command_tells_what_is_missing_and_ends_as_a_defect(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], place: str
):
    data, ship = write(tmp_path / "run.csv", sail(trial()[:200])), vessel_file(tmp_path / "ship.toml")
    if place == "page":
        monkeypatch.setattr("expdesign.export.pages.document_html", broken)
    else:
        from expdesign.export import estimate_page

        monkeypatch.setattr(estimate_page, "interval_figure", page_figure(broken))
    asked = ["estimate", str(data), "--vessel", str(ship), "--method", "ls", "--out", str(tmp_path / "out")]
    assert cli.main(asked) == 1
    assert "could not be drawn (KeyError" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "estimate.json", "estimate.html", "vessel-estimated.toml",
    }  # fmt: skip
