"""Whoever reads a file, a missing one is told in the same words, with the kind of file that was expected."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from expdesign.errors import FileError
from expdesign.export.formats.check import check_route_file
from expdesign.export.routes.read_plan import read_plan
from expdesign.importing.readers import read_log
from expdesign.records.file import read_cells
from expdesign.records.pieces import pieces
from expdesign.scenario import load_repeats, load_scenario
from expdesign.scenario.charts.geojson import _read_json
from expdesign.workflows.outcome import left_state

READERS: dict[str, Callable[[Path], object]] = {
    "scenario.toml": load_scenario,
    "area.geojson": _read_json,
    "durations.json": lambda path: load_repeats(path, names=("circle",)),
    "plan.json": read_plan,
    "route.rtz": check_route_file,
    "measured.csv": read_cells,
    "voyage.csv": lambda path: list(pieces(path, inputs=("n1",), stretch_s=60.0, most_rows=100)),
    "log.csv": read_log,
    "monitor-state.json": lambda path: left_state(path, dict),
}
"""A name that each reader takes, and the reader."""


@pytest.mark.parametrize("name", READERS)
def test_a_missing_file_is_told_with_what_was_expected(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match=r": does not exist, expected an? |: does not exist, expected the ") as told:
        READERS[name](tmp_path / name)
    assert (told.value.path, told.value.key) == (tmp_path / name, "")
