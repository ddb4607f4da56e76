"""What a reader must know of a diagnosis: what was not measured, not tested, or put in its place."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.diagnosis.data import Windows, unseen_wind
from expdesign.diagnosis.select import LARGE_WANDER_MPS, Search
from expdesign.diagnosis.verdict import lacking
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
    if not windows.has_wind and any(batch.wind is not None for batch in record.batches):
        notes.append("Wind is not measured in every run: what was measured of it was not used.")
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


def note_on_weather(wander_mps: float, time_s: float) -> tuple[str, ...]:
    """A varying current that took part of the error upon itself; the catalogue has no such cause.

    Args:
        wander_mps: standard deviation of the current that the tests allow for.
        time_s: its correlation time.
    """
    if wander_mps < LARGE_WANDER_MPS:
        return ()
    return (
        f"Some error is taken for a current that varies by {wander_mps:.2g} m/s with a memory of {time_s:.0f} s: "
        "the catalogue has no such cause, and the vessel file nothing of it.",
    )


def notes_on_dropped(found: Search, told: Search, apart: str) -> tuple[str, ...]:
    """What stood out in a test and is not told, one sentence each.

    Args:
        found: the search.
        told: what is left of it.
        apart: what gains are measured on.
    """
    kept = {id(step.chosen.candidate) for step in told.steps}
    return tuple(
        f"The data show a sign of {lacking(step.chosen.candidate.cause)} (chance {step.p_value:.1g}). It was left out: "
        f"{apart} that took no part in estimating it are not surely simulated better with it, or its size may be zero."
        for step in found.steps
        if id(step.chosen.candidate) not in kept
    )
