"""Indices of the standard trials.

A record shows an order to one sample. Tolerances are how far the ship goes or turns in a sample at the order, for what
is counted from there; 0 in simulations. Remarks are phrases that follow the name of the run.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A turning circle; None where the trial ended too early to show it.

    Attributes:
        name: of the run.
        side: "starboard" or "port", to which the ship turned.
        helm_rad: size of the helm, positive.
        speed_mps: approach speed; None where the record begins later.
        advance_m: distance along the approach heading from the rudder order to 90 degrees change of heading.
        transfer_m: distance across it to 90 degrees.
        tactical_diameter_m: distance across it to 180 degrees.
        initial_turning_m: distance sailed until the heading has changed by 10 degrees.
        steady_diameter_m: of the steady turn.
        current_north_mps, current_east_mps: uniform current, estimated from the turn and subtracted, or None.
        tolerance_m: of advance and initial turning.
        remarks: on the approach, the helm, and what is missing.
    """

    name: str
    side: str
    helm_rad: float
    speed_mps: float | None
    advance_m: float | None
    transfer_m: float | None
    tactical_diameter_m: float | None
    initial_turning_m: float | None
    steady_diameter_m: float | None
    current_north_mps: float | None = None
    current_east_mps: float | None = None
    tolerance_m: float = 0.0
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Execute:
    """A rudder order of a zig-zag.

    Attributes:
        time_s: since the start of the run.
        heading_rad: change of heading from the approach, positive to the side of the first turn.
        tolerance_rad: of that heading.
    """

    time_s: float
    heading_rad: float
    tolerance_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ZigZag:
    """A zig-zag.

    Attributes:
        name: of the run.
        side: of the first turn; "" where the record begins later.
        heading_rad, helm_rad: mean change of heading at which the helm was reversed, and the helm's size, positive.
        speed_mps: approach speed; None where the record begins later.
        executes: rudder orders, the first included; where the record begins later, its reversals, with headings from
            the middle of the swings.
        overshoots_rad: change of heading from the second, third, ... of `executes` to the largest heading, positive.
        initial_turning_m: distance sailed from the first execute until the heading has changed by 10 degrees; None
            where the helm is reversed well before.
        tolerance_m: of initial turning.
        remarks: on the approach, the helm, and what is missing.
    """

    name: str
    side: str
    heading_rad: float
    helm_rad: float
    speed_mps: float | None
    executes: tuple[Execute, ...]
    overshoots_rad: tuple[float, ...]
    initial_turning_m: float | None
    tolerance_m: float = 0.0
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A stopping trial.

    Attributes:
        name: of the run.
        speed_mps: approach speed.
        track_reach_m: distance sailed from the order astern until the ship has no headway.
        head_reach_m: the same along the approach heading.
        lateral_m: deviation to starboard of the approach heading.
        heading_change_rad: at the end, positive to starboard.
        time_s: from the order.
        tolerance_m: of track reach and head reach.
        remarks: on the approach.
    """

    name: str
    speed_mps: float
    track_reach_m: float
    head_reach_m: float
    lateral_m: float
    heading_change_rad: float
    time_s: float
    tolerance_m: float = 0.0
    remarks: tuple[str, ...] = ()
