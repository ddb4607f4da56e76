"""Where the files of others are that tests read: small ones in `tests/data`, the rest beside the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from expdesign.records import load_records
from expdesign.signals import Record

SAMPLES = Path(__file__).parent / "data"
OUTSIDE = Path(os.environ.get("EXPDESIGN_TEST_DATA", Path(__file__).parents[2] / "shared" / "data"))
"""Measured trials whose licences keep them out of this repository, and charts too large for it."""


def outside(name: str) -> Path:
    """A file or folder among those; skips where it is not there. Its tests are marked `outside`."""
    if not (OUTSIDE / name).exists():
        pytest.skip(f"{name} is not in {OUTSIDE}; EXPDESIGN_TEST_DATA names another folder")
    return OUTSIDE / name


def outside_record(folder: str, beginnings: tuple[str, ...] = ("",), *, velocity: str = "measured") -> Record:
    """The runs in a folder of measured trials whose names begin so."""
    files = [path for path in sorted(outside(folder).glob("*.csv")) if path.stem.startswith(beginnings)]
    assert files, f"{folder} has no runs {beginnings}"
    return load_records(files, vessel_inputs=("n1", "rudder1"), velocity=velocity)
