"""A watch out of its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from expdesign.export.monitor_page import Moment
from expdesign.monitoring import (
    restored_alarm,
    restored_calibration,
    restored_changes,
    restored_roll,
    restored_state,
)
from expdesign.records import Taken
from expdesign.workflows.data.watching import Learning, Reading, Ready, Watch, Watching


def restored_watch(table: Mapping[str, Any]) -> Watch:
    """A watch, read from what `saved` made of it.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: it is none.
    """
    return Watch(
        changes=restored_changes(table["changes"]),
        reading=_reading(table["reading"]),
        phase=_phase(table["phase"]),
        roll=restored_roll(table["roll"]),
    )


def _phase(table: Mapping[str, Any]) -> Learning | Ready | Watching:
    if "state" in table:
        return _watching(table)
    if "calibration" in table:
        return Ready(calibration=restored_calibration(table["calibration"]), reference_s=table["reference_s"])
    return Learning()


def _reading(table: Mapping[str, Any]) -> Reading:
    return Reading(
        **{
            **table,
            "now_s": float(table["now_s"]),
            "notes": tuple(table["notes"]),
            "pending": tuple(table["pending"]),
            "taken": tuple(Taken(**{**taken, "last_s": float(taken["last_s"])}) for taken in table["taken"]),
        }
    )


def _watching(table: Mapping[str, Any]) -> Watching:
    return Watching(
        calibration=restored_calibration(table["calibration"]),
        reference_s=table["reference_s"],
        state=restored_state(table["state"]),
        alarms=tuple(map(restored_alarm, table["alarms"])),
        moments=tuple(
            Moment(**{**m, "value": np.array(m["value"], float), "std": np.array(m["std"], float)})
            for m in table["moments"]
        ),
        changed=tuple(table["changed"]),
    )
