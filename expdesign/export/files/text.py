"""Text of result files: strict JSON, TOML and CSV in SI units, with units in the names; and results read back."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from expdesign.conventions import wrap_angle
from expdesign.errors import FileError
from expdesign.input_files import read_text
from expdesign.signals import AUXILIARY, Batch
from expdesign.values import Array
from expdesign.vessel import column_name

TIME_DECIMALS = 9
RESULT = "a file as expdesign run writes it"


def csv_text(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """CSV of plain cells: names, numbers, no quoting needed."""
    return "\n".join(",".join(row) for row in (header, *rows)) + "\n"


def strict_json(value: object) -> str:
    """Readable JSON without NaN or infinity; rows of numbers stay on one line."""
    text = json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False)
    # a raw line break never occurs inside a JSON string, so only lists of numbers are joined
    return re.sub(r"\[\n\s+([^\[\]{}\"]*?)\n\s*\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


def sample_seconds(sample: int, sample_time_s: float) -> float:
    """Time of a sample [s], free of the last bits that multiplication adds."""
    return round(sample * sample_time_s, TIME_DECIMALS)


def named(names: Sequence[str], values: Array) -> dict[str, float]:
    """{name: value}; all numbers are expected to be finite."""
    return dict(zip(names, values.tolist(), strict=True))


def named_finite(names: Sequence[str], values: Array) -> dict[str, float | None]:
    """{name: value}, null where it is not a number."""
    return {name: finite(value) for name, value in zip(names, values.tolist(), strict=True)}


def valued(names: Sequence[str], values: Array, stds: Array) -> dict[str, dict[str, float | None]]:
    """Name -> value and standard deviation, null where they are not finite."""
    pairs = zip(names, values.tolist(), stds.tolist(), strict=True)
    return {name: {"value": finite(value), "std": finite(std)} for name, value, std in pairs}


def finite(value: float) -> float | None:
    """The value, or None (null) where it is not a number."""
    return float(value) if math.isfinite(value) else None


def entry(value: object, *names: str) -> dict[str, Any]:
    """Attributes of a value by their names, ready for JSON: null where a number is not finite."""
    return {name: ready(getattr(value, name)) for name in names}


def ready(value: Any) -> Any:
    """Numbers, texts, lists and tables as JSON has them, with null for numbers that are not finite."""
    if isinstance(value, np.ndarray):
        return ready(value.tolist())
    if isinstance(value, Mapping):
        return {key: ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [ready(item) for item in value]
    return finite(value) if isinstance(value, float) else value


BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
NO_COMMENT = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")  # characters that no comment of TOML may hold


def toml_comments(texts: Iterable[str]) -> list[str]:
    """Lines of comments, with a replacement sign for each character that none may hold."""
    return [
        NO_COMMENT.sub("\N{REPLACEMENT CHARACTER}", f"# {line}".rstrip())
        for text in texts
        for line in text.splitlines()
    ]


def toml_table(head: str, entries: Mapping[str, str | float | None]) -> list[str]:
    """Lines of a table under its head, "" for none; without what is None."""
    rows = (f"{toml_key(name)} = {toml_value(value)}" for name, value in entries.items() if value is not None)
    return [*[head] * bool(head), *rows]


def toml_key(name: str) -> str:
    """A key, in quotes where it must be."""
    return name if BARE_KEY.fullmatch(name) else toml_value(name)


def toml_value(value: str | float) -> str:
    """JSON's strings and floats are TOML's, but for the control character it does not escape."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))


GAP_SAMPLES = 10  # gap between the times of two batches, in samples


def record_csv(batches: Sequence[Batch]) -> str:
    """Batches as one file of measured data, numbered in the column `batch`, without signals that are not measured."""
    tables = [_columns(batch) for batch in batches]
    kept = [name for name in tables[0] if all(name in table and np.isfinite(table[name]).all() for table in tables)]
    lines, begin = [",".join(["time_s", "batch", *kept])], 0
    for number, (batch, table) in enumerate(zip(batches, tables, strict=True), start=1):
        time_s = (begin + np.arange(len(batch))) * batch.sample_time_s
        begin += len(batch) + GAP_SAMPLES
        rows = zip(time_s.tolist(), *(table[name].tolist() for name in kept), strict=True)
        lines += [f"{row[0]:.10g},{number}," + ",".join(f"{value:.10g}" for value in row[1:]) for row in rows]
    return "\n".join(lines) + "\n"


def _columns(batch: Batch) -> dict[str, Array]:
    parts = [
        (("u_mps", "v_mps", "r_radps"), batch.velocity),
        (("north_m", "east_m", "heading_rad"), batch.pose),
        (tuple(map(column_name, batch.input_names)), batch.inputs),
        (("wind_u_mps", "wind_v_mps"), batch.wind),
        (("steered",), None if batch.steered is None else batch.steered[:, None]),
        (tuple(f"planned_{column_name(name)}" for name in batch.input_names), batch.planned),
        (AUXILIARY, batch.auxiliary),
        (("depth_m",), None if batch.depth_m is None else batch.depth_m[:, None]),
    ]
    columns = {
        name: column
        for names, values in parts
        if values is not None
        for name, column in zip(names, values.T, strict=False)
    }
    if "heading_rad" in columns:
        columns["heading_rad"] = wrap_angle(columns["heading_rad"])
    return columns


class Entry(BaseModel):
    """Entries that are read; what else a file holds is left aside."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False, extra="ignore")


Kind = TypeVar("Kind", bound=BaseModel)


def read_json(path: Path, kind: type[Kind], expected: str) -> Kind:
    """A file as a value.

    Args:
        expected: the kind of file in words, e.g. "a plan.json as expdesign run writes it".

    Raises:
        FileError: the file is missing or garbled, or an entry is.
    """
    try:
        return kind.model_validate_json(read_text(path, RESULT))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if first["type"] == "json_invalid" or not first["loc"]:
            why = first["msg"].removeprefix("Invalid JSON: ")
            found_kind = "a TOML file" if path.suffix == ".toml" else f"no readable JSON ({why})"
            raise FileError(path, "", f"is {found_kind}, expected {expected}") from None
        problem = first["msg"][:1].lower() + first["msg"][1:]
        found = first.get("input")
        if isinstance(found, str | int | float | bool):
            problem = f"is {found!r}: {problem}"
        if first["type"] == "missing":
            problem = f"is missing, expected {expected}"
        raise FileError(path, ".".join(str(part) for part in first["loc"]), problem) from None
