"""Text of result files: strict JSON and CSV in SI units, with units in the names."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence

from expdesign.values import Array

TIME_DECIMALS = 9


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


def finite(value: float) -> float | None:
    """The value, or None (null) where it is not a number."""
    return float(value) if math.isfinite(value) else None
