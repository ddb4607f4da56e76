"""Meaning of column names: the quantity and the factor from the file's unit; which columns are used."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from expdesign.conventions import KNOTS_PER_MPS, METRES_PER_NAUTICAL_MILE
from expdesign.errors import FileError, nearest
from expdesign.signals import AUXILIARY

FORCES = ("tau_x", "tau_y", "tau_psi")
STEERED, PLANNED, REACHED = "steered", "planned_", "reached_"
PLAIN = ("batch", STEERED, *FORCES)  # names without a unit
LABEL = "manoeuvre"  # a column of texts, which only `records.labels` reads

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


PAIRS = (
    ("north_m", "east_m"),
    ("lat_deg", "lon_deg"),
    ("wind_u_mps", "wind_v_mps"),
    ("wind_speed_mps", "wind_angle_rad"),
)
INSTEAD = (("lat_deg", "north_m"), ("lon_deg", "north_m"))  # a column that is not used when the other one is there

MOST_NAMED = 8  # unknown columns, in a message

Sources = dict[str, Source]


@dataclass(frozen=True)
class Inputs:
    """The inputs a file must give."""

    columns: tuple[str, ...]  # their columns, e.g. ("n1_rps", "rudder1_rad").
    whose: str  # who takes or gives them, for messages, e.g. "the vessel".


def choose_columns(path: Path, header: tuple[str, ...], *, inputs: Inputs | None) -> tuple[Sources, tuple[str, ...]]:
    """The columns to read, by the contract's names, and notes on those that are converted or ignored.

    Args:
        header: names in the file.
        inputs: what must be there, or None for all inputs in the file.

    Raises:
        FileError: time or inputs are missing, a pair is incomplete, a known quantity has no unit or stands there twice.
    """
    meanings = [meaning(name, column) for column, name in enumerate(header)]
    used = _one_each(path, [source for source in meanings if isinstance(source, Source)])
    wanted = _wanted(path, header, used, inputs)
    _refuse_unitless(path, [name for name in meanings if isinstance(name, Unitless)], used, wanted)
    if "time_s" not in used:
        raise FileError(path, "row 1", f"names no time_s, expected it{mistyped('time_s', header)}")
    for pair in PAIRS:
        _check_pair(path, used, pair, header)
    chosen = {
        name: source
        for name, source in used.items()
        if not (is_input(own := input_name(name)) and own not in wanted)
        and not any(name == a and b in used for a, b in INSTEAD)
    }
    _check_planned(path, chosen, wanted)
    return chosen, (*_conversions(chosen), *_ignored(header, chosen, meanings))


def mistyped(name: str, header: Iterable[str]) -> str:
    """A hint at the unknown column that may have been meant, or ""."""
    unknown = [other for column, other in enumerate(header) if other and meaning(other, column) is None]
    near = nearest(name, unknown)
    return f" (is {near} a misspelling?)" if near else ""


def _one_each(path: Path, sources: Iterable[Source]) -> Sources:
    """One source per quantity; the contract's own name wins."""
    used: Sources = {}
    for source in sorted(sources, key=lambda source: (source.header != source.name, source.column)):
        other = used.setdefault(source.name, source)
        if other is not source and not other.exact:
            problem = f"gives {source.name} twice, as {other.header} and {source.header}, expected one of them"
            raise FileError(path, "row 1", problem)
    return dict(sorted(used.items(), key=lambda item: item[1].column))


def _wanted(path: Path, header: tuple[str, ...], used: Sources, inputs: Inputs | None) -> tuple[str, ...]:
    """Names of the input columns to read, all of them there or refused later for want of a unit."""
    there = tuple(dict.fromkeys(input_name(name) for name in used if is_input(name.removeprefix(REACHED))))
    if inputs is None:
        if there:
            return there
        expected = "tau_x tau_y tau_psi (in any unit, also throttle or PWM), or n1_rps a1_rad rudder1_rad ..."
        unknown = [name for column, name in enumerate(header) if name and meaning(name, column) is None]
        found = f"; unknown are {', '.join(unknown[:MOST_NAMED])}" if unknown else ""
        raise FileError(path, "row 1", f"names no inputs, expected {expected}{found}")
    meanings = [meaning(name, column) for column, name in enumerate(header)]
    unitless = {name for known in meanings if isinstance(known, Unitless) for name in known.names}
    missing = [name for name in inputs.columns if not {name, REACHED + name} & used.keys() and name not in unitless]
    if missing:
        found = f"the file gives {', '.join(there) or 'none'}"
        problem = f"names no {' '.join(missing)}, expected every input of {inputs.whose}; {found}"
        raise FileError(path, "row 1", problem + mistyped(missing[0], header))
    return inputs.columns


def _refuse_unitless(path: Path, names: Iterable[Unitless], used: Sources, wanted: tuple[str, ...]) -> None:
    for name in names:
        own = name.names[0]
        if own not in used and (own in wanted or not is_input(own)):
            raise FileError(path, "row 1", f"names {name.header} without a unit, expected {' or '.join(name.names)}")


def _check_pair(path: Path, used: Sources, pair: tuple[str, str], header: tuple[str, ...]) -> None:
    there = [name for name in pair if name in used]
    if len(there) == 1:
        missing = pair[1 - pair.index(there[0])]
        problem = f"names {used[there[0]].header} but no {missing}, expected both{mistyped(missing, header)}"
        raise FileError(path, "row 1", problem)


def _check_planned(path: Path, chosen: Sources, wanted: tuple[str, ...]) -> None:
    there = [name for name in chosen if name.startswith(PLANNED)]
    missing = [PLANNED + name for name in wanted if PLANNED + name not in chosen]
    if there and missing:
        problem = f"names {chosen[there[0]].header} but no {' '.join(missing)}, expected all or none of them"
        raise FileError(path, "row 1", problem)


def _conversions(chosen: Sources) -> list[str]:
    changed = [source for source in chosen.values() if not source.exact]
    return [
        f"{source.header} is read as {source.name}" + (f", times {source.factor:.6g}" if source.factor != 1.0 else "")
        for source in changed
    ]


def _ignored(header: tuple[str, ...], chosen: Sources, meanings: list[Source | Unitless | None]) -> list[str]:
    used = {source.column for source in chosen.values()}
    used |= {column for column, name in enumerate(header) if name == LABEL}
    extra = [name or f"column {column + 1}" for column, name in enumerate(header) if column not in used]
    return [f"ignored {', '.join(extra)}"] if extra else []
