"""Every key of a scenario, at values that nobody means: it is taken as it stands, or one line says what is wrong."""

from __future__ import annotations

import copy
import math
import re
import tomllib
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import pytest

from expdesign.cli import main
from expdesign.errors import FileError
from expdesign.export.files import toml_value
from expdesign.scenario.scenario_file import ScenarioFile, build_scenario
from expdesign.scenario.tables import Entry, Table
from scenario_files import write_scenario

Place = tuple[str, ...]
ODD: dict[str, Any] = {
    "not a number": math.nan, "infinite": math.inf, "minus infinite": -math.inf, "negative": -1.0,
    "zero": 0, "zero_f": 0.0,
    "huge": 1e13, "far too large": 1e9, "tiny": 1e-300, "whole and huge": 10**30, "text": "5", "empty text": "",
    "line": "a\nb", "true": True, "list": [1.0], "list of nan": [math.nan], "empty list": [], "list of lists": [[]],
    "empty table": {}, "table": {"x": 1.0}, "table of nan": {"X_u": math.nan},
}  # fmt: skip
MOTION = re.compile(r"_(mps|radps|rad|deg)$")  # keys of speeds, rates and angles, of which nobody means a million


def tables_in(annotation: Any) -> Iterator[type[Table]]:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from tables_in(part)


def keys_of(model: type[Table], place: Place = ()) -> Iterator[Place]:
    """Every key of a table and of those in it; [[tables]] by their key and "[]"."""
    for name, field in model.fields().items():
        yield (*place, name)
        for inner in tables_in(field.annotation):
            many = ("[]",) if "list" in str(field.annotation) else ()
            yield from keys_of(inner, (*place, name, *many))


KEYS = [place for place in keys_of(ScenarioFile) if len(place) > 1]


def with_value(content: dict[str, Any], place: Place, value: Any) -> dict[str, Any]:
    """The content with one entry changed, and tables around it where there were none."""
    found = copy.deepcopy(content)
    table: Any = found
    for step, after in pairwise(place):
        empty: Any = [{}] if after == "[]" else {}
        table = table[0] if step == "[]" else table.setdefault(step, empty)
    if isinstance(table, dict):
        table[place[-1]] = value
    return found


@pytest.fixture(scope="module")
def square(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scenario(tmp_path_factory.mktemp("square"))


def dotted(place: Place) -> str:
    return ".".join(place).replace(".[]", "[1]")


def refused(path: Path, content: dict[str, Any]) -> str:
    """The one line of a refusal; "" where the scenario is taken."""
    try:
        build_scenario(content, Entry(path))
    except FileError as error:
        return str(error)
    return ""


def inline(value: Any) -> str:
    """A value of TOML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline(own)}" for key, own in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(inline, value))}]"
    return toml_value(value)


@pytest.mark.thorough
@pytest.mark.parametrize("place", KEYS, ids=dotted)
def test_a_key_is_taken_or_refused_in_one_line(square: Path, place: Place) -> None:
    content = tomllib.loads(square.read_text())
    for what, value in ODD.items():
        line = refused(square, with_value(content, place, value))
        assert "\n" not in line, what
        assert len(line) < 700, what
        assert not line or line.startswith(f"{square}: "), what
        never = what in ("not a number", "infinite", "minus infinite", "huge", "list of nan", "table of nan", "line")
        assert not never or line, what
        too_much = MOTION.search(place[-1]) and what in ("far too large", "whole and huge")
        assert not too_much or line, what


def test_every_key_refuses_what_is_no_number_and_no_name_before_anything_is_written(
    square: Path, tmp_path: Path
) -> None:
    """Through the command, for one wrong value of each table: status 2, one line, and no folder."""
    seen = set()
    for place in KEYS:
        if place[:-1] in seen or "[]" in place:
            continue
        seen.add(place[:-1])
        content = with_value(tomllib.loads(square.read_text()), place, math.nan)
        path = square.parent / "odd.toml"
        path.write_text("".join(f"{name} = {inline(table)}\n" for name, table in content.items()))
        out = tmp_path / "out"
        assert main(["score", str(path), "--out", str(out), "--quiet"]) == 2, place
        assert not out.exists(), place
