"""Variants of a scenario: files with only the entries that differ, or whole scenarios."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from expdesign.scenario.scenario_file import FILE_KEYS, POSITION_KEYS, build_scenario, needed_parts
from expdesign.scenario.tables import Entry, read_toml, shown
from expdesign.scenario.values import Scenario


def load_variant(base: Path | str, variant: Path | str) -> tuple[Scenario, tuple[str, ...]]:
    """A scenario file with entries replaced by those of another file.

    Args:
        base: a scenario file.
        variant: a TOML file with any of a scenario's tables and keys, or a whole scenario file, which takes nothing
            from the base. It is named by its own `scenario.name`, or by its file name.

    Returns:
        The scenario, and one line for each entry that differs, e.g. "design.total_s = 1800 instead of 3600".

    Raises:
        FileError, NoPlan: as for `load_scenario`; wrong entries are reported with the variant's path.
    """
    below, entry = Path(base), Entry(Path(variant))
    first, over = read_toml(below), read_toml(entry.path)
    merged = _absolute(over, entry.path.parent)
    if not all(needed_parts(over)):
        merged = _merged(_absolute(first, below.parent), merged)
    named = (
        over.get("scenario", {}).get("name", entry.path.stem) if isinstance(over.get("scenario", {}), dict) else None
    )
    if isinstance(merged.get("scenario"), dict):
        merged["scenario"] = {**merged["scenario"], "name": named}
    return build_scenario(merged, entry), changed_entries(first, over)


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


def changed_entries(first: Mapping[str, Any], over: Mapping[str, Any]) -> tuple[str, ...]:
    """What a variant changes, a line for each entry, in its order.

    Args:
        first: tables of a scenario file.
        over: tables of its variant; a whole scenario takes away what it does not state.
    """
    before, after = _entries(first), _entries(over)
    stated = [
        f"{name} = {_spelled(value)}" + (f" instead of {_spelled(before[name])}" if name in before else "")
        for name, value in after.items()
        if before.get(name) != value and name != "scenario.name"
    ]
    left = [f"{name} not given instead of {_spelled(before[name])}" for name in before if name not in after]
    return (*stated, *(left if all(needed_parts(over)) else ()))


def _entries(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Entries of nested tables by dotted names."""
    found: dict[str, Any] = {}
    for key, value in tables.items():
        found |= _entries(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


def _spelled(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_spelled, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_spelled(item)}" for key, item in value.items()) + "}"
    return shown(value)
