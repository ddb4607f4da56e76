"""Indices of the standard trials, and the criteria of IMO MSC.137(76) (2002), 5.3, with its conditions.

A record shows an order to one sample. Tolerances are how far the ship goes or turns in a sample at the order, for what
is counted from there; 0 in simulations. Remarks are phrases that follow the name of the run.

The criteria apply to ships of 100 m and over, and to chemical tankers and gas carriers of any length; for others they
are a reference. Limits on overshoots depend on L/V, length over approach speed, of the full-scale ship.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

# largest deviation of helm and reversals of a 10/10 or 20/20 zig-zag from the nominal angles [rad]
ZIGZAG_DEVIATION_RAD = math.radians(2.0)


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A turning circle; None where the trial ended too early to show it."""

    name: str  # of the run
    side: str  # "starboard" or "port", to which the ship turned
    helm_rad: float  # size of the helm, positive
    speed_mps: float | None  # approach speed; None where the record begins later
    advance_m: float | None  # distance along the approach heading from the rudder order to 90 degrees change of heading
    transfer_m: float | None  # distance across it to 90 degrees
    tactical_diameter_m: float | None  # distance across it to 180 degrees
    initial_turning_m: float | None  # distance sailed until the heading has changed by 10 degrees
    steady_diameter_m: float | None  # of the steady turn
    # current_north_mps, current_east_mps: uniform current, estimated from the turn and subtracted, or None
    current_north_mps: float | None = None
    current_east_mps: float | None = None
    tolerance_m: float = 0.0  # of advance and initial turning
    remarks: tuple[str, ...] = ()  # on the approach, the helm, and what is missing


@dataclass(frozen=True, kw_only=True)
class Execute:
    """A rudder order of a zig-zag."""

    time_s: float  # since the start of the run
    heading_rad: float  # change of heading from the approach, positive to the side of the first turn
    tolerance_rad: float = 0.0  # of that heading


@dataclass(frozen=True, kw_only=True)
class ZigZag:
    """A zig-zag."""

    name: str  # of the run
    side: str  # of the first turn; "" where the record begins later
    # heading_rad, helm_rad: mean change of heading at which the helm was reversed, and the helm's size, positive
    heading_rad: float
    helm_rad: float
    speed_mps: float | None  # approach speed; None where the record begins later
    # rudder orders, the first included; where the record begins later, its reversals, with headings from the middle of
    # the swings
    executes: tuple[Execute, ...]
    # change of heading from the second, third, ... of `executes` to the largest heading, positive.
    overshoots_rad: tuple[float, ...]
    # distance sailed from the first execute until the heading has changed by 10 degrees; None where the helm is
    # reversed well before
    initial_turning_m: float | None
    tolerance_m: float = 0.0  # of initial turning
    remarks: tuple[str, ...] = ()  # on the approach, the helm, and what is missing


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A stopping trial."""

    name: str  # of the run
    speed_mps: float  # approach speed
    track_reach_m: float  # distance sailed from the order astern until the ship has no headway
    head_reach_m: float  # the same along the approach heading
    lateral_m: float  # deviation to starboard of the approach heading
    heading_change_rad: float  # at the end, positive to starboard
    time_s: float  # from the order
    tolerance_m: float = 0.0  # of track reach and head reach
    remarks: tuple[str, ...] = ()  # on the approach


# The criteria of IMO MSC.137(76) (2002), 5.3, and whether results meet them.

LEAST_LENGTH_M = 100.0
DEGREE = math.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One limit."""

    key: str  # of the index, unit in the name
    name: str  # for people
    limit: float  # largest value allowed [m or rad]
    rule: str  # the limit in words


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """One index compared with its limit."""

    criterion: Criterion  # the limit
    run: str  # name of the run that shows the index
    side: str  # "starboard", "port", or "" where there is none
    value: float | None  # of the index [m or rad], or None where the run does not show it
    tolerance: float = 0.0  # of the value [m or rad]

    @property
    def met(self) -> bool | None:
        """Whether the criterion is met; None where the run does not show it, or the limit is within the tolerance."""
        if self.value is None or abs(self.value - self.criterion.limit) < self.tolerance:
            return None
        return self.value <= self.criterion.limit


def criteria(length_m: float, speed_mps: float, *, scale: float = 1.0) -> tuple[Criterion, ...]:
    """All limits of a ship.

    Args:
        length_m: between perpendiculars, of the hull the results are from [m].
        speed_mps: approach speed of the trial.
        scale: of a model: ship length over model length; L/V of the ship is its root times the model's.
    """
    ratio_s = length_m / speed_mps * math.sqrt(scale)
    first = min(max(5.0 + ratio_s / 2.0, 10.0), 20.0)
    second = min(max(17.5 + 0.75 * ratio_s, 25.0), 40.0)
    rows = (
        ("advance_m", "advance", 4.5 * length_m, "4.5 L"),
        ("tactical_diameter_m", "tactical diameter", 5.0 * length_m, "5 L"),
        ("initial_turning_m", "initial turning, 10 deg of heading at 10 deg of helm", 2.5 * length_m, "2.5 L"),
        ("overshoot_10_10_rad", "10/10 zig-zag, first overshoot", first * DEGREE, f"at L/V = {ratio_s:.1f} s"),
        ("second_overshoot_10_10_rad", "10/10 zig-zag, second overshoot", second * DEGREE, f"at L/V = {ratio_s:.1f} s"),
        ("overshoot_20_20_rad", "20/20 zig-zag, first overshoot", 25.0 * DEGREE, "25 deg"),
        ("track_reach_m", "track reach, full astern", 15.0 * length_m, "15 L; the Administration may allow 20 L"),
    )
    return tuple(Criterion(key=key, name=name, limit=limit, rule=rule) for key, name, limit, rule in rows)


def judge(found: Iterable[Circle | ZigZag | Stop], *, length_m: float, scale: float = 1.0) -> tuple[Verdict, ...]:
    """Every index with a criterion, run by run.

    Zig-zags other than 10/10 and 20/20 have none, nor has a record that begins after the first order.
    """
    verdicts: list[Verdict] = []
    for trial in found:
        if trial.speed_mps is None:
            continue
        limits = {limit.key: limit for limit in criteria(length_m, trial.speed_mps, scale=scale)}
        side = getattr(trial, "side", "")
        verdicts += [
            Verdict(criterion=limits[key], run=trial.name, side=side, value=value, tolerance=tolerance)
            for key, (value, tolerance) in indices_of(trial).items()
        ]
    return tuple(verdicts)


def indices_of(trial: Circle | ZigZag | Stop) -> dict[str, tuple[float | None, float]]:
    """Key -> (value, tolerance) of the indices that have criteria."""
    if isinstance(trial, Circle):
        return {
            "advance_m": (trial.advance_m, trial.tolerance_m),
            "tactical_diameter_m": (trial.tactical_diameter_m, 0.0),
        }
    if isinstance(trial, Stop):
        return {"track_reach_m": (trial.track_reach_m, trial.tolerance_m)}
    if _reversed_at(trial, 1, 10.0):
        found = {
            "initial_turning_m": (trial.initial_turning_m, trial.tolerance_m),
            "overshoot_10_10_rad": _nth(trial, 1),
        }
        return found | ({"second_overshoot_10_10_rad": _nth(trial, 2)} if _reversed_at(trial, 2, 10.0) else {})
    return {"overshoot_20_20_rad": _nth(trial, 1)} if _reversed_at(trial, 1, 20.0) else {}


def _nth(trial: ZigZag, number: int) -> tuple[float | None, float]:
    """An overshoot and its tolerance [rad]."""
    value = trial.overshoots_rad[number - 1] if len(trial.overshoots_rad) >= number else None
    return value, trial.executes[number].tolerance_rad


def _reversed_at(trial: ZigZag, number: int, degrees: float) -> bool:
    """Whether a reversal was at a heading and from a helm of so many degrees."""
    angles = [trial.helm_rad, *(abs(order.heading_rad) for order in trial.executes[number : number + 1])]
    return len(angles) == 2 and all(abs(angle - degrees * DEGREE) < ZIGZAG_DEVIATION_RAD for angle in angles)


# Conditions of IMO MSC/Circ.1053 (2002), 2.2, for a planned trial.

BEAUFORT_MPS = (0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8, 24.5, 28.5, 32.7)
"""Mean wind speed [m/s] at which Beaufort numbers 1 to 12 begin (WMO)."""
STRONGEST_WIND, HIGHEST_SEA, DEPTH_BY_DRAUGHT = 5, 4, 4.0


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Place and weather of a planned trial."""

    draught_m: float  # mean draught
    least_depth_m: float | None  # least charted depth under the track, or None when it is not charted
    wind_mps: float  # expected mean wind speed
    wind_std_mps: float  # standard deviation of its components
    sea_state: int | None  # World Meteorological Organization code, or None when not given
    current_mps: float  # expected mean current
    current_std_mps: float  # standard deviation of its components
    room_m: float  # least distance from the hull to forbidden water over the trial
    required_room_m: float  # the required least distance


class Condition(NamedTuple):
    """A condition of a trial, or of a plan."""

    what: str
    found: str  # its value, in words
    required: str = ""
    met: bool | None = None  # None where nothing is required, or it cannot be known in advance


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
        "Water depth under the track",
        found,
        f"more than {needed:g} m (4 mean draughts)",
        None if depth is None else depth > needed,
    )


def _wind(known: Conditions) -> Condition:
    mean, windy = beaufort(known.wind_mps), beaufort(known.wind_mps + 2 * known.wind_std_mps)
    spread = f", up to {windy} with two standard deviations" if windy > mean else ""
    return Condition(
        "Wind",
        f"{known.wind_mps:.1f} m/s, Beaufort {mean}{spread}",
        f"Beaufort {STRONGEST_WIND} at most",
        windy <= STRONGEST_WIND or (None if mean <= STRONGEST_WIND else False),
    )


def _sea(known: Conditions) -> Condition:
    state = known.sea_state
    return Condition(
        "Sea state",
        "not given" if state is None else f"{state}",
        f"{HIGHEST_SEA} at most",
        None if state is None else state <= HIGHEST_SEA,
    )


def _current(known: Conditions) -> Condition:
    return Condition(
        "Current",
        f"{known.current_mps:.2f} m/s, assumed uniform; standard deviation {known.current_std_mps:.2f} m/s",
        "uniform, so that it can be corrected for",
        None,
    )


def _room(known: Conditions) -> Condition:
    return Condition(
        "Sea room",
        f"{known.room_m:.0f} m from the hull to forbidden water",
        f"at least {known.required_room_m:g} m",
        known.room_m >= known.required_room_m,
    )
