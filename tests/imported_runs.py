"""Imports of logs as a user begins them, and what they write."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from expdesign.cli import main


def run_import(*logs: Path, options: tuple[str, ...] = ("--length-m", "50")) -> tuple[int, dict[str, object], Path]:
    """Exit status, import.json and the folder."""
    out = logs[0].parent / "out"
    status = main(["import", *map(str, logs), "--out", str(out), "--quiet", *options])
    said = out / "import.json"
    return status, json.loads(said.read_text()) if status == 0 else {}, out


def notes_of(said: dict[str, object]) -> str:
    return "\n".join(said["notes"])  # type: ignore[arg-type]


def columns_of(said: dict[str, object], out: Path, run: int = 0) -> dict[str, np.ndarray]:
    """Columns of a run, times counted as in the log."""
    file = out / said["runs"][run]["file"]  # type: ignore[index]
    names = file.read_text().partition("\n")[0].split(",")
    table = dict(zip(names, np.loadtxt(file, delimiter=",", skiprows=1).T, strict=True))
    return {**table, "time_s": table["time_s"] + said["begins_s"]}  # type: ignore[operator]


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi
