"""Files of what a pilot card, a wheelhouse poster or an old trial sheet states of a ship, in a mariner's units."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from expdesign.particulars import WATER_KGPM3, Card, Hull, Rudder, Stated, Thruster, Trial, Windage
from expdesign.scenario.tables import Entry, Number, Positive, Table, Text, check_table, read_toml

KNOT_MPS = 1852.0 / 3600.0
SAME_DISPLACEMENT = 0.05  # share by which a displacement may differ from that of a stated block coefficient
LARGEST_DEG = 90.0
SHIP_M = 20.0
SOLAS_DEGPS, SMALL_DEGPS = 2.32, 10.0  # usual rates of rudders, of ships of `SHIP_M` and more, and of smaller craft


class ShipTable(Table):
    """`[ship]`."""

    name: Text = Field(description="the ship's name, in results")
    length_m: Positive = Field(description="the length between perpendiculars [m]")
    beam_m: Positive = Field(description="the moulded beam [m]; of one hull where there are two")
    draught_m: Positive = Field(description="the mean draught [m]")
    displacement_t: Positive | None = Field(
        default=None, description="the displacement [t]; or state block_coefficient"
    )
    block_coefficient: float | None = Field(
        default=None, ge=0.2, le=1.0, description="volume by length, beam and draught; or state displacement_t"
    )
    gravity_forward_m: Number = Field(default=0.0, description="the centre of gravity ahead of midships [m]")
    hulls: int = Field(default=1, ge=1, le=2, description="1, or 2 for a catamaran")
    beam_over_all_m: Positive | None = Field(
        default=None, description="the beam over both hulls of a catamaran [m], which her room in the water follows"
    )
    top_speed_kn: Positive | None = Field(
        default=None, description="the speed at full order ahead [kn], in calm deep water at this draught"
    )


class ThrusterTable(Table):
    """One of `[[thrusters]]`."""

    kind: Literal["propeller", "azimuth", "podded", "tunnel"] = Field(description="what it is")
    forward_m: Number = Field(description="its place ahead of midships [m], negative abaft")
    starboard_m: Number = Field(default=0.0, description="its place to starboard of the centre line [m]")
    diameter_m: Positive | None = Field(default=None, description="the diameter [m]; from the draught when not given")
    power_kw: Positive | None = Field(default=None, description="the power on the shaft at full order [kW]")
    max_rpm: Positive | None = Field(
        default=None, description="the shaft speed at full order ahead [rpm]; from power or top speed when not given"
    )
    pitch_ratio: float | None = Field(
        default=None, ge=0.3, le=2.0, description="pitch by diameter; from the top speed when not given"
    )
    astern_percent: float = Field(
        default=70.0,
        ge=0.0,
        le=100.0,
        description="the shaft speed at full astern, of that ahead [%]; 0 where it does not reverse: azimuths that can "
        "turn round then do",
    )
    full_order_s: Positive | None = Field(
        default=None,
        description="the time from stop to full ahead [s]; a quarter of the length in metres when not given",
    )
    turn_max_deg: Positive | None = Field(
        default=None, description="the largest angle of an azimuth thruster to each side [deg]; free when not given"
    )
    turn_degps: Positive = Field(default=10.0, description="how fast an azimuth thruster turns [deg/s]")


class RudderTable(Table):
    """One of `[[rudders]]`."""

    forward_m: Number = Field(description="its place ahead of midships [m], negative abaft")
    starboard_m: Number = Field(default=0.0, description="its place to starboard of the centre line [m]")
    area_m2: Positive | None = Field(default=None, description="the area [m2]; or state area_percent")
    area_percent: Positive | None = Field(
        default=None, description="the area, of length times draught [%]; or state area_m2"
    )
    aspect_ratio: Positive = Field(default=1.6, description="height squared by area")
    max_deg: float = Field(default=35.0, gt=0, le=LARGEST_DEG, description="the largest angle [deg]")
    rate_degps: Positive | None = Field(
        default=None, description="how fast it turns [deg/s]; 2.32 as SOLAS wants when not given, 10 below 20 m"
    )


class WindageTable(Table):
    """`[windage]`."""

    frontal_m2: Positive = Field(description="the frontal area above the water [m2]")
    lateral_m2: Positive = Field(description="the lateral area above the water [m2]")
    centre_forward_m: Number = Field(default=0.0, description="the centre of that area ahead of midships [m]")


class SpeedTable(Table):
    """One of `[[speeds]]`."""

    order_percent: float | None = Field(
        default=None, gt=0, le=110.0, description="the engine order, as shaft speed of that at full [%]; or state rpm"
    )
    rpm: Positive | None = Field(default=None, description="the shaft speed [rpm]; or state order_percent")
    speed_kn: Positive = Field(description="the speed [kn]")


class ApproachTable(Table):
    """What trials have in common."""

    speed_kn: Positive = Field(description="the speed of the approach [kn]")


class CircleTable(ApproachTable):
    """One of `[[circles]]`."""

    side: Literal["starboard", "port"] = Field(default="starboard", description="to which she turned")
    helm_deg: float = Field(default=35.0, gt=0, le=LARGEST_DEG, description="the helm [deg]")
    advance_m: Positive | None = Field(default=None, description="the advance to 90 degrees [m]")
    transfer_m: Positive | None = Field(default=None, description="the transfer to 90 degrees [m]")
    tactical_diameter_m: Positive | None = Field(default=None, description="the tactical diameter [m]")
    time_90_s: Positive | None = Field(default=None, description="the time to 90 degrees [s]")
    time_180_s: Positive | None = Field(default=None, description="the time to 180 degrees [s]")
    speed_90_kn: Positive | None = Field(default=None, description="the speed left at 90 degrees [kn]")
    speed_180_kn: Positive | None = Field(default=None, description="the speed left at 180 degrees [kn]")


class ZigZagTable(ApproachTable):
    """One of `[[zigzags]]`."""

    angle_deg: float = Field(gt=0, le=LARGEST_DEG, description="heading and helm, 10 for a 10/10 zig-zag [deg]")
    overshoot_1_deg: Positive | None = Field(default=None, description="the first overshoot [deg]")
    overshoot_2_deg: Positive | None = Field(default=None, description="the second overshoot [deg]")


class StopTable(ApproachTable):
    """One of `[[stops]]`."""

    astern_percent: float = Field(
        default=100.0,
        ge=0,
        le=100.0,
        description="the engine order, 100 for full astern; 0 for stopped engines, to a fifth of the speed [%]",
    )
    reach_m: Positive | None = Field(default=None, description="the track reach [m]")
    time_s: Positive | None = Field(default=None, description="the time [s]")


class SpinTable(Table):
    """`[spin]`."""

    turn_90_s: Positive = Field(
        description="the time to turn by 90 degrees from rest, all thrusters that turn her at full order [s]"
    )


class DriftTable(Table):
    """`[drift]`."""

    wind_kn: Positive = Field(description="the wind, on the beam [kn]")
    drift_kn: Positive = Field(description="the speed to leeward with stopped engines [kn]")


class CardFile(Table):
    """The whole file."""

    topic: ClassVar[str] = "card"

    ship: ShipTable = Field(description="a table [ship] with the particulars")
    thrusters: list[ThrusterTable] = Field(min_length=1, description="at least one table [[thrusters]]")
    rudders: list[RudderTable] = Field(default=[], description="tables [[rudders]]")
    windage: WindageTable | None = Field(
        default=None, description="a table [windage]; without it the vessel does not feel wind"
    )
    speeds: list[SpeedTable] = Field(default=[], description="tables [[speeds]], speeds at engine orders")
    circles: list[CircleTable] = Field(default=[], description="tables [[circles]], turning circles")
    zigzags: list[ZigZagTable] = Field(default=[], description="tables [[zigzags]]")
    stops: list[StopTable] = Field(default=[], description="tables [[stops]]")
    spin: SpinTable | None = Field(default=None, description="a table [spin], a turn on the spot")
    drift: DriftTable | None = Field(default=None, description="a table [drift], drift in wind")


def load_card(path: Path | str) -> Card:
    """Read a card.

    Raises:
        FileError: unreadable, or something in it is wrong, missing, unknown or contradicts itself.
    """
    entry = Entry(Path(path))
    file = check_table(CardFile, read_toml(entry.path), entry)
    ship, length = file.ship, file.ship.length_m
    for number, one in enumerate(file.thrusters, start=1):
        _check_place(one.forward_m, one.starboard_m, file.ship, entry.at("thrusters").item(number))
    for number, rudder in enumerate(file.rudders, start=1):
        _check_place(rudder.forward_m, 0.0, file.ship, entry.at("rudders").item(number))
    rudders = (_rudder(one, ship, entry.at("rudders").item(n)) for n, one in enumerate(file.rudders, start=1))
    windage = file.windage
    card = Card(
        name=ship.name,
        hull=Hull(
            length_m=length, beam_m=ship.beam_m, draught_m=ship.draught_m, mass_kg=_mass(ship, entry.at("ship")),
            gravity_forward_m=ship.gravity_forward_m, hulls=ship.hulls, over_all_m=_over_all_m(ship, entry.at("ship")),
        ),
        thrusters=tuple(_thruster(one, length) for one in file.thrusters),
        rudders=tuple(rudders),
        windage=None if windage is None else Windage(**windage.model_dump()),
        top_speed_mps=None if ship.top_speed_kn is None else KNOT_MPS * ship.top_speed_kn,
    )  # fmt: skip
    if not card.drives:
        raise entry.at("thrusters").error("has only tunnel thrusters, expected one that drives her ahead")
    return replace(card, stated=tuple(_stated(file, entry)), silent=tuple(_silent(file)))


def _silent(file: CardFile) -> Iterator[str]:
    """Keys of thrusters and rudders that the file leaves out."""
    for kind, tables in (("thrusters", file.thrusters), ("rudders", file.rudders)):
        for number, table in enumerate(tables, start=1):
            yield from (
                f"{kind}[{number}].{key}" for key in type(table).model_fields if key not in table.model_fields_set
            )


def _check_place(forward_m: float, starboard_m: float, ship: ShipTable, entry: Entry) -> None:
    ends = {
        "forward_m": (forward_m, 0.6 * ship.length_m, "midships"),
        "starboard_m": (starboard_m, ship.beam_over_all_m or ship.beam_m, "amidships"),
    }
    for name, (place, most, middle) in ends.items():
        if abs(place) > most:
            raise entry.at(name).error(f"is {place:g}, expected {-most:g} to {most:g}, counted from {middle}")


def _over_all_m(ship: ShipTable, entry: Entry) -> float | None:
    """Beam over both hulls of a catamaran [m]."""
    stated, least = ship.beam_over_all_m, ship.hulls * ship.beam_m
    if ship.hulls > 1 and stated is None:
        raise entry.at("beam_over_all_m").error("is missing, expected it of a ship of two hulls")
    if stated is not None and stated < least:
        raise entry.at("beam_over_all_m").error(f"is {stated:g}, expected no less than that of all hulls, {least:g}")
    return stated


def _mass(ship: ShipTable, entry: Entry) -> float:
    """Displacement [kg]."""
    box = WATER_KGPM3 * ship.hulls * ship.length_m * ship.beam_m * ship.draught_m
    if ship.displacement_t is None and ship.block_coefficient is None:
        raise entry.at("displacement_t").error("is missing, expected it or block_coefficient")
    if ship.displacement_t is None:
        return box * (ship.block_coefficient or 0.0)
    block = 1e3 * ship.displacement_t / box
    if ship.block_coefficient is not None and abs(block / ship.block_coefficient - 1.0) > SAME_DISPLACEMENT:
        raise entry.at("displacement_t").error(
            f"is {ship.displacement_t:g}, a block coefficient of {block:.3f} with these dimensions, and "
            f"block_coefficient is {ship.block_coefficient:g}: expected one of them, or both the same"
        )
    if not 0.15 <= block <= 1.0:
        raise entry.at("displacement_t").error(
            f"is {ship.displacement_t:g}, expected {0.15e-3 * box:.4g} to {1e-3 * box:.4g}, a block coefficient of "
            "0.15 to 1 with these dimensions"
        )
    return 1e3 * ship.displacement_t


def _thruster(table: ThrusterTable, length_m: float) -> Thruster:
    return Thruster(
        kind=table.kind, forward_m=table.forward_m, starboard_m=table.starboard_m, diameter_m=table.diameter_m,
        power_w=None if table.power_kw is None else 1e3 * table.power_kw,
        max_rps=None if table.max_rpm is None else table.max_rpm / 60.0, pitch_ratio=table.pitch_ratio,
        astern_share=table.astern_percent / 100.0, full_order_s=table.full_order_s or length_m / 4.0,
        angle_max_rad=None if table.turn_max_deg is None else math.radians(table.turn_max_deg),
        angle_rate_radps=math.radians(table.turn_degps),
    )  # fmt: skip


def _rudder(table: RudderTable, ship: ShipTable, entry: Entry) -> Rudder:
    if (table.area_m2 is None) == (table.area_percent is None):
        both = "both are given" if table.area_m2 else "neither is given"
        raise entry.at("area_m2").error(f"and area_percent: {both}, expected one of them")
    rate = table.rate_degps or (SOLAS_DEGPS if ship.length_m >= SHIP_M else SMALL_DEGPS)
    area = table.area_m2 or ship.length_m * ship.draught_m * (table.area_percent or 0.0) / 100.0
    return Rudder(
        area_m2=area, forward_m=table.forward_m, starboard_m=table.starboard_m, aspect_ratio=table.aspect_ratio,
        angle_max_rad=math.radians(table.max_deg), angle_rate_radps=math.radians(rate),
    )  # fmt: skip


UNITS = {"m": 1.0, "s": 1.0, "kn": KNOT_MPS, "deg": math.pi / 180}  # ending of a key -> SI
SI_NAMES = {"kn": "mps", "deg": "rad"}


def _stated(file: CardFile, entry: Entry) -> Iterator[Stated]:
    """Every trial value of the card."""
    full = max((one.max_rpm or 0.0 for one in file.thrusters if one.kind != "tunnel"), default=0.0)
    for number, speed in enumerate(file.speeds, start=1):
        place = entry.at("speeds").item(number)
        if (speed.rpm is None) == (speed.order_percent is None):
            both = "both are given" if speed.rpm else "neither is given"
            raise place.at("rpm").error(f"and order_percent: {both}, expected one of them")
        if speed.rpm is not None and not full:
            raise place.at("rpm").error("is given, expected max_rpm in [[thrusters]] too, or order_percent instead")
        order = speed.rpm / full if speed.rpm is not None else (speed.order_percent or 0.0) / 100.0
        if not 0 < order <= 1.1:
            raise place.at("rpm").error(f"is {speed.rpm:g}, expected up to max_rpm of [[thrusters]], {full:g}")
        yield from _values(speed, Trial(kind="speed", order=order), place, ("speed_kn",))
    for number, circle in enumerate(file.circles, start=1):
        trial = Trial(kind="circle", speed_mps=KNOT_MPS * circle.speed_kn, angle_rad=math.radians(circle.helm_deg))
        keys = tuple(key for key in CircleTable.model_fields if key not in ("speed_kn", "side", "helm_deg"))
        found = _values(circle, trial, entry.at("circles").item(number), keys)
        yield from (replace(one, side=circle.side) for one in found)
    for number, zigzag in enumerate(file.zigzags, start=1):
        trial = Trial(kind="zigzag", speed_mps=KNOT_MPS * zigzag.speed_kn, angle_rad=math.radians(zigzag.angle_deg))
        yield from _values(zigzag, trial, entry.at("zigzags").item(number), ("overshoot_1_deg", "overshoot_2_deg"))
    for number, stop in enumerate(file.stops, start=1):
        trial = Trial(kind="stop", speed_mps=KNOT_MPS * stop.speed_kn, order=stop.astern_percent / 100.0)
        yield from _values(stop, trial, entry.at("stops").item(number), ("reach_m", "time_s"))
    if file.spin is not None:
        yield from _values(file.spin, Trial(kind="spin"), entry.at("spin"), ("turn_90_s",))
    if file.drift is not None:
        if file.windage is None:
            raise entry.at("drift").error("is given, expected [windage] too, with the areas that the wind meets")
        trial = Trial(kind="drift", speed_mps=KNOT_MPS * file.drift.wind_kn)
        yield from _values(file.drift, trial, entry.at("drift"), ("drift_kn",))


def _values(table: Table, trial: Trial, entry: Entry, keys: tuple[str, ...]) -> Iterator[Stated]:
    given = [(key, getattr(table, key)) for key in keys if getattr(table, key) is not None]
    if not given:
        raise entry.error(f"states no result, expected some of {', '.join(keys)}")
    for key, value in given:
        stem, _, unit = key.rpartition("_")
        yield Stated(
            trial=trial, quantity=f"{stem}_{SI_NAMES.get(unit, unit)}", value=value * UNITS[unit],
            source=entry.at(key).key,
        )  # fmt: skip
