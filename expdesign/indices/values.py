"""Indices of the standard trials.

A record shows an order to one sample. Tolerances are how far the ship goes or turns in a sample at the order, for what
is counted from there; 0 in simulations. Remarks are phrases that follow the name of the run.
"""

from __future__ import annotations

from dataclasses import dataclass


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
