"""Tables of injected faults: how versions name and size what oracles see, on the same draws."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis_real_faults import FAULTS, SEEN, STD
from diagnosis_real_hulls import HULLS

RIGHT = ("record", "first", "equivalent")


def told_faults(*logs: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A row per hull and fault, with the answers of every log, then counts."""
    columns = " | ".join(f"named {at + 1} | off {at + 1} | said {at + 1}" for at in range(len(logs)))
    yield f"| hull | fault | instruments, oracle's p | {columns} |"
    yield "|" + "---|" * (3 + 3 * len(logs))
    tables = [{(row["hull"], row["fault"], row["number"]): row for row in rows} for rows in logs]
    seen_keys = [key for key, row in tables[0].items() if row["named"] is not None]
    for key in seen_keys:
        rows = [table.get(key) for table in tables]
        cells = [cell for row in rows for cell in cells_of(row)]
        yield f"| {key[0]} | {key[1]} | {seen_words(rows[0])} | {' | '.join(cells)} |"
    for at, table in enumerate(tables):
        rows = [table[key] for key in seen_keys if key in table]
        visible = [row for row in rows if row["fault"] != "untouched" and visible_to_oracle(tables[0][key_of(row)])]
        right = [row for row in visible if row["named"] in RIGHT]
        sized = [row for row in visible if row["named"] in RIGHT and row.get("off") is not None]
        close = [row for row in sized if row["off"] <= STD]
        clean = [row for row in rows if row["fault"] == "untouched"]
        kept = [keeps_promise(row) for row in clean if row["findings"] and row.get("promised")]
        silent = sum(not row["findings"] and not row.get("doubts") for row in clean)
        yield (
            f"{at + 1}: of {len(visible)} faults that an oracle sees {len(right)} are named first or as equivalent; "
            f"{len(close)} of {len(sized)} sizes are within {STD:g} standard errors; of {len(clean)} untouched sets "
            f"{silent} are silent, and the findings of {sum(kept)} of {len(kept)} others improve unseen runs by what "
            f"they state; {seconds_words([row for row in rows if row.get('seconds')])}."
        )


def key_of(row: dict[str, Any]) -> tuple[str, str, int]:
    """Of a trial."""
    return row["hull"], row["fault"], row["number"]


def cells_of(row: dict[str, Any] | None) -> tuple[str, str, str]:
    """How a fault was named, how far off its size is, and all that was found."""
    if row is None:
        return "?", "", ""
    off = "" if row.get("off") is None else f"{row['off']:.1f}"
    doubts = [text.partition(": ")[2][:60] for text in row.get("doubts", ())]
    unseen = ""
    if row["fault"] == "untouched" and row["findings"] and row.get("promised"):
        ((output, least),) = row["promised"]
        share = row["unseen"]["uvr".index(output)]
        unseen = f" (unseen runs {100 * share:+.0f} %, stated {100 * least:+.0f} % of {output})"
    if not row["findings"] and "no answer" in row["verdict"]:
        return "no answer", "", row["verdict"][:100]
    return row["named"] or "-", off, "; ".join([*doubts, found_words(row)]) + unseen


def seen_words(row: dict[str, Any]) -> str:
    """What the oracles say."""
    if not row.get("seen"):
        return ""
    instruments, p_value = row["seen"]
    return ("yes" if instruments else "no") + ("" if p_value is None else f", {p_value:.1e}")


def visible_to_oracle(row: dict[str, Any]) -> bool:
    """Whether any oracle sees the fault."""
    instruments, p_value = row.get("seen") or (False, None)
    return bool(instruments or (p_value is not None and p_value < SEEN))


def keeps_promise(row: dict[str, Any]) -> bool:
    """Whether unseen runs improve by what the findings state at least."""
    ((output, least),) = row["promised"]
    return bool(row["unseen"]["uvr".index(output)] >= min(least, 1.0))


def found_words(row: dict[str, Any]) -> str:
    """Causes with their gains in points."""
    return ", ".join(f"{cause} {gain:+.1f}" for cause, gain, _ in row["findings"]) or "nothing"


def seconds_words(rows: Sequence[dict[str, Any]]) -> str:
    """Median and largest processor time."""
    times = [row["seconds"] for row in rows]
    return f"median {np.median(times):.1f} s, largest {max(times):.1f} s"


def sorted_rows(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """By hull, fault and trial."""
    hulls, faults = list(HULLS), [item.name for item in FAULTS]
    return sorted(rows, key=lambda row: (hulls.index(row["hull"]), faults.index(row["fault"]), row["number"]))


def read_log(path: Path) -> list[dict[str, Any]]:
    """Rows of a log."""
    return sorted_rows([json.loads(line) for line in path.read_text().splitlines()])
