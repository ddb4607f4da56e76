"""Meaning of column names: the quantity, and the factor from the file's unit to the package's."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

from expdesign.conventions import KNOTS_PER_MPS, METRES_PER_NAUTICAL_MILE
from expdesign.signals import AUXILIARY

FORCES = ("tau_x", "tau_y", "tau_psi")
STEERED, PLANNED, REACHED = "steered", "planned_", "reached_"
PLAIN = ("batch", STEERED, *FORCES)
LABEL = "manoeuvre"
"""A column of texts, which only `records.labels` reads."""
"""Names without a unit."""

DEGREE = math.pi / 180.0
SPEED = {
    "mps": 1.0,
    **dict.fromkeys(("m/s", "m_s"), 1.0),
    **dict.fromkeys(("knots", "knot", "kn", "kt", "kts"), 1.0 / KNOTS_PER_MPS),
    **dict.fromkeys(("kmph", "kmh", "km/h", "kph"), 1.0 / 3.6),
    **dict.fromkeys(("cmps", "cm/s"), 0.01),
}
ANGLE = {"rad": 1.0, **dict.fromkeys(("deg", "degrees"), DEGREE)}
LENGTH = {"m": 1.0, "km": 1000.0, "cm": 0.01, "nm": METRES_PER_NAUTICAL_MILE}
YAW_RATE = {
    "radps": 1.0,
    **dict.fromkeys(("rad/s", "rad_s"), 1.0),
    **dict.fromkeys(("degps", "dps", "deg/s", "deg_s"), DEGREE),
    **dict.fromkeys(("degpmin", "deg/min", "deg_min"), DEGREE / 60.0),
}
PLACE = {"deg": 1.0, "degrees": 1.0, "rad": 1.0 / DEGREE}
CLOCK = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
ACCELERATION = {"mps2": 1.0, **dict.fromkeys(("m/s2", "m/s^2"), 1.0), "g": 9.80665}
FORCE = {"n": 1.0, "kn": 1e3, "mn": 1e6}
MOMENT = {"nm": 1.0, "knm": 1e3, "mnm": 1e6}
REVOLUTIONS = {"rps": 1.0, "hz": 1.0, **dict.fromkeys(("rpm", "1/min"), 1.0 / 60.0)}


@dataclass(frozen=True)
class Quantity:
    """Columns that are read."""

    pattern: str  # of the part of a name before the unit
    units: dict[str, float]  # those it may be given in, with the factor to the package's own unit, which is the first
    names: str  # as the contract has them
    meaning: str  # one line for the user


QUANTITIES = (
    Quantity("time", CLOCK, "time_s", "time from any origin, in even steps"),
    Quantity("u|v", SPEED, "u_mps, v_mps", "surge speed forward and sway speed to starboard, over ground"),
    Quantity("r", YAW_RATE, "r_radps", "yaw rate, positive to starboard"),
    Quantity("north|east", LENGTH, "north_m, east_m", "position in a local frame"),
    Quantity("lat|lon", PLACE, "lat_deg, lon_deg", "position on the earth, WGS84, instead of north_m and east_m"),
    Quantity("heading", ANGLE, "heading_rad", "heading, clockwise from north"),
    Quantity(
        "wind_u|wind_v|wind_speed",
        SPEED,
        "wind_u_mps, wind_v_mps, wind_speed_mps",
        "the ship's velocity through the air: components forward and to starboard, or a vane's speed",
    ),
    Quantity(
        "wind_angle", ANGLE, "wind_angle_rad", "direction that the wind comes from at a vane, clockwise from the bow"
    ),
    Quantity("depth", LENGTH, "depth_m", "depth of the water"),
    Quantity("roll", ANGLE, "roll_rad", "roll angle, positive with the starboard side down"),
    Quantity("roll_rate", YAW_RATE, "roll_rate_radps", "rate of the roll angle"),
    Quantity(
        "sway_acceleration|lateral_acceleration",
        ACCELERATION,
        "sway_acceleration_mps2, lateral_acceleration_mps2",
        "time derivative of v, and the acceleration to starboard of midships with gravity taken off, which is that "
        "derivative plus u r; yaw models of expdesign monitor read one of them",
    ),
    Quantity(
        "imu_lateral",
        ACCELERATION,
        "imu_lateral_mps2",
        "reading of an accelerometer along the ship's starboard axis, with gravity in it, so that it is negative where "
        "the starboard side is down; expdesign roll reads it",
    ),
    Quantity(
        "actuator_x|actuator_y",
        FORCE,
        "actuator_x_n, actuator_y_n",
        "force of all actuators on the hull, forward and to starboard, as measured or from a table",
    ),
    Quantity(
        "actuator_psi",
        MOMENT,
        "actuator_psi_nm",
        "yaw moment of all actuators about midships; yaw models of expdesign monitor read it",
    ),
    Quantity(r"n\d+", REVOLUTIONS, "n1_rps, n2_rps", "commanded speed of propellers and thrusters"),
    Quantity(r"(?:a|rudder)\d+", ANGLE, "a1_rad, rudder1_rad", "commanded angle of thrusters and rudders"),
)
"""Pattern of the stem -> units it may be given in."""
COLUMNS = (
    *QUANTITIES,
    Quantity("", {}, "tau_x, tau_y, tau_psi", "generalised forces in the model's unit, instead of actuator signals"),
    Quantity("", {}, "batch", "a change of its value starts a new batch"),
    Quantity(
        "",
        {},
        STEERED,
        "1 where the inputs follow the ship's motion (an autopilot, a helmsman on a track), 0 where they were set "
        "beforehand; optional, see --steered of expdesign estimate",
    ),
    Quantity(
        "",
        {},
        "planned_n1_rps, planned_tau_x",
        "what an input was planned to be, whatever the ship did; optional, for every input or none",
    ),
    Quantity(
        "",
        {},
        "reached_n1_rps, reached_rudder1_rad",
        "the speed or angle that the actuator reached, as measured; beside or instead of the commanded one, and used "
        "in its place: of what the vessel file states of this actuator only a misalignment acts on it",
    ),
    Quantity("", {}, LABEL, "label of the manoeuvre, a text; only expdesign mine --labels column reads it"),
)
"""All columns that are read."""

SYNONYMS = {
    "latitude": "lat",
    "longitude": "lon",
    "psi": "heading",
    "hdg": "heading",
    "n": "n1",
    "a": "a1",
    "rudder": "rudder1",
}


@dataclass(frozen=True)
class Source:
    """Where a quantity comes from."""

    column: int  # index in the header
    header: str  # as written in the file
    name: str  # the contract's name, e.g. "u_mps".
    factor: float = 1.0  # the file's value times this is in the contract's unit

    @property
    def exact(self) -> bool:
        """True when the file uses a name of the contract."""
        return self.header in (self.name, "heading_deg")


@dataclass(frozen=True)
class Unitless:
    """A known quantity whose name lacks the unit: `heading`."""

    header: str  # as written in the file
    names: tuple[str, ...]  # the names that would be understood


def meaning(header: str, column: int) -> Source | Unitless | None:
    """The quantity of a column, or None for an unknown name."""
    name = re.sub(r"[\s\[\]()]+", "_", header.lower()).strip("_")
    for prefix in (PLANNED, REACHED):
        if name.startswith(prefix):
            return _of_input(meaning(name.removeprefix(prefix), column), header, prefix)
    if name in PLAIN:
        return Source(column, header, name)
    for quantity in QUANTITIES:
        pattern, units = quantity.pattern, quantity.units
        found = re.fullmatch(rf"({pattern}|{_synonyms(pattern)})(?:_(.+))?", name)
        if not found:
            continue
        stem, unit = SYNONYMS.get(found[1], found[1]), found[2]
        own = next(iter(units))
        if unit is None and f"{stem}_{own}" in AUXILIARY:
            return None
        if unit is None:
            return Unitless(header, _offered(stem, units)) if len(found[1]) > 1 or found[1] == stem else None
        if unit in units:
            return Source(column, header, f"{stem}_{own}", units[unit])
    return None


def _of_input(source: Source | Unitless | None, header: str, prefix: str) -> Source | None:
    """The planned or reached input, where the rest of its name is an input's."""
    if not isinstance(source, Source) or not is_input(source.name):
        return None
    return replace(source, header=header, name=prefix + source.name)


def input_name(name: str) -> str:
    """The contract's name of an input, without what says that it is planned or reached."""
    return name.removeprefix(PLANNED).removeprefix(REACHED)


def is_input(name: str) -> bool:
    """True for the contract's names of actuator signals and generalised forces."""
    return name in FORCES or re.fullmatch(r"n\d+_rps|(?:a|rudder)\d+_rad", name) is not None


def is_turning_input(name: str) -> bool:
    """True for the contract's names of angles of thrusters, commanded, planned or reached."""
    return re.fullmatch(r"a\d+_rad", input_name(name)) is not None


def _synonyms(pattern: str) -> str:
    words = [word for word, stem in SYNONYMS.items() if re.fullmatch(pattern, stem)]
    return "|".join(words) or "(?!)"


def _offered(stem: str, units: dict[str, float]) -> tuple[str, ...]:
    own = f"{stem}_{next(iter(units))}"
    other = {"heading_rad": ("heading_deg",)}.get(own, ())
    return (own, *other)
