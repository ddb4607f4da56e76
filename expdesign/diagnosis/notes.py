"""What a reader must know of a diagnosis: what was not measured, not tested, or put in its place."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.diagnosis.windows import Windows, unseen_wind
from expdesign.signals import Record
from expdesign.vessel import Vessel

FEW = 0.002
"""Share of missing samples not worth a word."""


def notes_on_data(vessel: Vessel, record: Record, windows: Windows, still: Sequence[str]) -> tuple[str, ...]:
    """One sentence each.

    Args:
        vessel: the model in use.
        record: the data; windows: as compared.
        still: inputs that never change.
    """
    notes = []
    if not windows.has_heading:
        notes.append("No heading is measured: current and wind cannot be told from what the ship does by itself.")
        weather = vessel.environment
        if weather.current_to.any() or (weather.wind_to.any() and not windows.has_wind):
            notes.append("The current and wind that the vessel file states were left out: they need a heading.")
    unseen = unseen_wind(record)
    if windows.has_wind and unseen > FEW:
        notes.append(f"No wind is measured in {100 * unseen:.0f} % of the samples: there the last one seen was used.")
    if not windows.has_depth:
        notes.append("No depth is measured: shallow water was not tested.")
    if "r" in windows.derived:
        notes.append("The yaw rate is derived from the heading: the scale of a rate gyro was not tested.")
    if still:
        verb = "changes" if len(still) == 1 else "change"
        notes.append(f"{', '.join(still)} never {verb}: what acts through them alone is not seen.")
    if not (vessel.model.parameter_std > 0).any():
        notes.append("The vessel file states no parameter_std: its parameters count as known.")
    return tuple(notes)
