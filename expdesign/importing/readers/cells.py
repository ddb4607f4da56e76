"""Cells of tables: numbers with a unit or a side, latitudes and longitudes as people write them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from expdesign.importing.times import read_stamps
from expdesign.importing.units import KNOWN, unit_word, words
from expdesign.records.file import MISSING
from expdesign.values import Array

NUMBER = re.compile(r"\s*[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?\s*")
WITH_UNIT = re.compile(r"\s*([+-]?(?:\d+[.,]?\d*|[.,]\d+))\s*([A-Za-z%°º/]+(?:/[A-Za-z0-9]+)?)\s*")
SIDED = re.compile(r"\s*(?P<a>[A-Za-z]*)\.?\s*(?P<number>\d+(?:[.,]\d*)?)\s*°?\s*(?P<b>[A-Za-z]*)\s*")
PLACE = re.compile(
    r"\s*(?P<sign>[+-])?\s*(?P<a>[NSEWO])?\s*(?P<deg>\d{1,3}(?:[.,]\d+)?)"
    r"(?:\s*[°ºd:\s-]\s*(?P<min>\d{1,2}(?:[.,]\d+)?))?\s*(?:['\u2032\u2019m:\s]\s*(?P<sec>\d{1,2}(?:[.,]\d+)?))?"
    r"\s*[°º'\u2032\u2019\"\u2033\u201dsm]*\s*(?P<b>[NSEWO])?\s*"
)
"""A latitude or longitude, as `54°30.12'N`, `S 33 51 31.2` or `-33°51'31.2"`."""
PACKED = re.compile(r"\s*(?P<a>[NSEWO])?\s*(?P<deg>\d{2,3})(?P<min>\d{2}(?:[.,]\d+)?)\s*(?P<b>[NSEWO])?\s*")
"""The same with degrees and minutes run together, as `5430.12N`."""
PORT_WORDS = {"p", "port", "prt", "ps", "bb", "l", "left"}
STARBOARD_WORDS = {"s", "stbd", "stb", "sb", "starboard", "r", "right"}
SHARE = 0.5  # of cells of a row of data that are numbers or times


def filled(cells: Sequence[str]) -> list[str]:
    """Those that hold something."""
    return [cell for cell in cells if cell.strip().lower() not in MISSING]


def kind_of(name: str, cells: Sequence[str]) -> str:
    """What a column holds.

    Returns:
        "number", "unit ..." for numbers with that unit, "place", "sided", "side", "text", or a kind of `Stamps`.
    """
    own = filled(cells)

    def mostly(count: int) -> bool:
        return count > SHARE * len(own)

    if not own or mostly(sum(bool(NUMBER.fullmatch(cell)) for cell in own)):
        return "number"
    if kind := read_stamps(own).kind:
        return kind
    place = bool(re.search(r"\b(lat\w*|lon\w*|lng|position)\b", words(name)))
    sides = [side_of(cell) for cell in own]
    if mostly(sum(side is not None for side in sides)) and not place:
        return "sided"
    if mostly(sum(is_place(cell) for cell in own)) and (place or not mostly(sum(side is not None for side in sides))):
        return "place"
    if set(map(str.upper, map(str.strip, own))) <= {*"NSEWO"} or {cell.strip().lower() for cell in own} <= (
        PORT_WORDS | STARBOARD_WORDS
    ):
        return "side"
    suffixes = Counter(found[2] for cell in own if (found := WITH_UNIT.fullmatch(cell)))
    unit, count = suffixes.most_common(1)[0] if suffixes else ("", 0)
    return f"unit {unit}" if mostly(count) and unit_word(unit) in KNOWN else "text"


def is_place(text: str) -> bool:
    """Whether a text is a latitude or longitude with its side, or with degrees and minutes."""
    found = PACKED.fullmatch(text) or PLACE.fullmatch(text)
    if found is None:
        return False
    return bool(found["a"] or found["b"]) or bool(found["min"] and re.search("[°º]", text))


def degrees(text: str) -> float:
    """Of a latitude or longitude, nan where it is none."""
    found = PACKED.fullmatch(text)
    found = found if found and (found["a"] or found["b"]) else PLACE.fullmatch(text)
    if found is None:
        return float("nan")
    parts = {**found.groupdict()}
    numbers = [float((parts.get(key) or "0").replace(",", ".")) for key in ("deg", "min", "sec")]
    if numbers[1] >= 60.0 or numbers[2] >= 60.0:
        return float("nan")
    south = (found["a"] or found["b"] or "") in ("S", "W") or parts.get("sign") == "-"
    return (numbers[0] + numbers[1] / 60.0 + numbers[2] / 3600.0) * (-1.0 if south else 1.0)


def side_of(text: str) -> float | None:
    """-1 for port, 1 for starboard, 0 for a plain zero, of a number with its side; None for any other text."""
    found = SIDED.fullmatch(text)
    if found is None or (found["a"] and found["b"]):
        return None
    side = (found["a"] or found["b"]).lower()
    if side in PORT_WORDS:
        return -1.0
    return 1.0 if side in STARBOARD_WORDS else None


def sided(text: str) -> float:
    """A number that is negative to port, nan where it has no side and is not zero."""
    found, side = SIDED.fullmatch(text), side_of(text)
    if found is None or side is None:
        return 0.0 if NUMBER.fullmatch(text) and not float(text.replace(",", ".")) else float("nan")
    return side * float(found["number"].replace(",", "."))


def signs(cells: Sequence[str]) -> Array:
    """(k,) -1 for S, W and port, 1 for other sides, nan for none."""
    table = {"s": -1.0, "w": -1.0, "n": 1.0, "e": 1.0, "o": 1.0}
    return np.array([table.get(cell.strip().lower(), np.nan) for cell in cells])


def port_signs(cells: Sequence[str]) -> Array:
    """(k,) -1 for port, 1 for starboard, nan for neither."""
    own = [cell.strip().lower() for cell in cells]
    return np.array([-1.0 if c in PORT_WORDS else 1.0 if c in STARBOARD_WORDS else np.nan for c in own])
