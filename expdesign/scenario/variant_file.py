"""Variants of a scenario: files with only the changed entries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from expdesign.scenario.scenario_file import POSITION_KEYS, build_scenario
from expdesign.scenario.tables import Entry, read_toml, shown
from expdesign.scenario.values import Scenario

FILE_KEYS = {"scenario": ("vessel", "dictionary", "area"), "design": ("prior_data",)}
"""Keys that name files, relative to the file that contains them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Variant:
    """A changed scenario and its changes."""

    scenario: Scenario  # complete
    changes: tuple[str, ...]  # one line for each entry that differs, e.g. "design.total_s = 1800 instead of 3600".


def load_variant(base: Path | str, variant: Path | str) -> Variant:
    """A scenario file with entries replaced by those of another file.

    Args:
        base: a scenario file.
        variant: a TOML file with any of a scenario's tables and keys; a complete scenario file is one, too. It is named
            by its own `scenario.name`, or by its file name.

    Raises:
        FileError, NoPlan: as for `load_scenario`; wrong entries are reported with the variant's path.
    """
    below, entry = Path(base), Entry(Path(variant))
    first, over = read_toml(below), read_toml(entry.path)
    merged = _merged(_absolute(first, below.parent), _absolute(over, entry.path.parent))
    named = (
        over.get("scenario", {}).get("name", entry.path.stem) if isinstance(over.get("scenario", {}), dict) else None
    )
    if isinstance(merged.get("scenario"), dict):
        merged["scenario"] = {**merged["scenario"], "name": named}
    return Variant(scenario=build_scenario(merged, entry), changes=tuple(_changes(first, over)))


def _absolute(content: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables with absolute paths of the files they name."""

    def resolved(value: Any) -> Any:
        if isinstance(value, list):
            return [resolved(item) for item in value]
        return str((folder / value).absolute()) if isinstance(value, str) else value

    return {
        table: {key: resolved(value) if key in FILE_KEYS.get(table, ()) else value for key, value in entries.items()}
        if isinstance(entries, dict)
        else entries
        for table, entries in content.items()
    }


def _merged(first: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merged key by key; anything else is replaced. A new position replaces one given in other keys, too."""
    moved = bool(set(POSITION_KEYS) & set(over))
    result = {key: value for key, value in first.items() if not (moved and key in POSITION_KEYS)}
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merged(result[key], value) if both else value
    return result


def _changes(first: Mapping[str, Any], over: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Entries of the second that differ from the first, in the second's order."""
    lines: list[str] = []
    for key, value in over.items():
        name, before = f"{prefix}{key}", first.get(key)
        if isinstance(value, dict):
            lines += _changes(before if isinstance(before, dict) else {}, value, f"{name}.")
        elif value != before and name != "scenario.name":
            instead = "" if before is None else f" instead of {_spelled(before)}"
            lines.append(f"{name} = {_spelled(value)}{instead}")
    return lines


def _spelled(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_spelled, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_spelled(item)}" for key, item in value.items()) + "}"
    return shown(value)
