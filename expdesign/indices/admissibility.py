"""Conditions of IMO MSC/Circ.1053 (2002), 2.2, for a planned trial."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

BEAUFORT_MPS = (0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8, 24.5, 28.5, 32.7)
"""Mean wind speed [m/s] at which Beaufort numbers 1 to 12 begin (WMO)."""
STRONGEST_WIND, HIGHEST_SEA, DEPTH_BY_DRAUGHT = 5, 4, 4.0


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Place and weather of a planned trial.

    Attributes:
        draught_m: mean draught.
        least_depth_m: least charted depth under the track, or None when it is not charted.
        wind_mps: expected mean wind speed.
        wind_std_mps: standard deviation of its components.
        sea_state: World Meteorological Organization code, or None when not given.
        current_mps: expected mean current.
        current_std_mps: standard deviation of its components.
        room_m: least distance from the hull to forbidden water over the trial.
        required_room_m: the required least distance.
    """

    draught_m: float
    least_depth_m: float | None
    wind_mps: float
    wind_std_mps: float
    sea_state: int | None
    current_mps: float
    current_std_mps: float
    room_m: float
    required_room_m: float


@dataclass(frozen=True, kw_only=True)
class Condition:
    """One condition of a trial.

    Attributes:
        what: the condition.
        found: its expected value, in words.
        required: the requirement of the source.
        met: True, False, or None where it cannot be known in advance.
    """

    what: str
    found: str
    required: str
    met: bool | None


def beaufort(wind_mps: float) -> int:
    """Beaufort number of a mean wind speed [m/s]."""
    return bisect_right(BEAUFORT_MPS, wind_mps)


def admissibility(known: Conditions) -> tuple[Condition, ...]:
    """All conditions."""
    return (_depth(known), _wind(known), _sea(known), _current(known), _room(known))


def _depth(known: Conditions) -> Condition:
    needed = DEPTH_BY_DRAUGHT * known.draught_m
    depth = known.least_depth_m
    found = "not charted" if depth is None else f"at least {depth:g} m ({depth / known.draught_m:.1f} draughts)"
    return Condition(
        what="Water depth under the track",
        found=found,
        required=f"more than {needed:g} m (4 mean draughts)",
        met=None if depth is None else depth > needed,
    )


def _wind(known: Conditions) -> Condition:
    mean, windy = beaufort(known.wind_mps), beaufort(known.wind_mps + 2 * known.wind_std_mps)
    spread = f", up to {windy} with two standard deviations" if windy > mean else ""
    return Condition(
        what="Wind",
        found=f"{known.wind_mps:.1f} m/s, Beaufort {mean}{spread}",
        required=f"Beaufort {STRONGEST_WIND} at most",
        met=windy <= STRONGEST_WIND or (None if mean <= STRONGEST_WIND else False),
    )


def _sea(known: Conditions) -> Condition:
    state = known.sea_state
    return Condition(
        what="Sea state",
        found="not given" if state is None else f"{state}",
        required=f"{HIGHEST_SEA} at most",
        met=None if state is None else state <= HIGHEST_SEA,
    )


def _current(known: Conditions) -> Condition:
    return Condition(
        what="Current",
        found=f"{known.current_mps:.2f} m/s, assumed uniform; standard deviation {known.current_std_mps:.2f} m/s",
        required="uniform, so that it can be corrected for",
        met=None,
    )


def _room(known: Conditions) -> Condition:
    return Condition(
        what="Sea room",
        found=f"{known.room_m:.0f} m from the hull to forbidden water",
        required=f"at least {known.required_room_m:g} m",
        met=known.room_m >= known.required_room_m,
    )
