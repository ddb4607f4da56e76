"""Numbers and names as text: units, compass names, positions, manoeuvres."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime

import numpy as np

from expdesign.conventions import KNOTS_PER_MPS
from expdesign.values import Array
from expdesign.vessel import Vessel

NOTICED = 0.02  # relative differences below this are not reported

COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
MOST_DECIMALS = 12
HOUR = 3600.0
SINCE_1970_S = 3e8  # from which times of the data can only count from 1970 [s]: they are later than 1979
MINUS, NB = "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"


def duration(seconds: float) -> str:
    """45 s, 3 min 20 s, 15 min, 1 h 05 min, 2 h; with a minus sign below zero, "unknown" where it is no number."""
    if not math.isfinite(seconds):
        return "unknown"
    if seconds < 0:
        return f"{MINUS}{duration(-seconds)}"
    if seconds < 59.5:
        return f"{seconds:.3g}{NB}s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes}{NB}min{NB}{rest:02d}{NB}s" if rest else f"{minutes}{NB}min"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours}{NB}h{NB}{minutes:02d}{NB}min" if minutes else f"{hours}{NB}h"


def hours(time_s: float) -> str:
    """A time in words, as `duration` below a hundred hours, then in days or years."""
    days = time_s / HOUR / 24.0
    if time_s < 100 * HOUR:
        return duration(time_s)
    return f"{days:.1f} d" if days < 1000.0 else f"{days / 365.25:.3g} years"


def when(time_s: float) -> str:
    """A time of the data's clock: h:mm:ss since its beginning, or the date where it counts from 1970."""
    if time_s < SINCE_1970_S:
        return clock(time_s)
    return f"{datetime.fromtimestamp(time_s, tz=UTC):%Y-%m-%d %H:%M:%S} UTC"


def clock(seconds: float) -> str:
    """Time from the start as h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def distance(metres: float) -> str:
    """Metres with three digits, or kilometres from a thousand on."""
    if abs(metres) < 999.5:
        return f"{significant(metres)}{NB}m"
    return f"{significant(metres / 1000)}{NB}km"


def speed(mps: float) -> str:
    """Metres per second, and knots."""
    return f"{number(mps)}{NB}m/s ({number(mps * KNOTS_PER_MPS, 1)}{NB}kn)"


def number(value: float, decimals: int = 2) -> str:
    """Fixed decimals with a true minus sign, and no minus before zero."""
    text = f"{value:.{decimals}f}"
    return text.replace("-", "" if float(text) == 0 else MINUS)


def significant(value: float, digits: int = 3) -> str:
    """Significant digits with a true minus sign, written out unless that takes more than nine decimals."""
    if value and not 1e-7 <= abs(value) < 1e9:
        return f"{value:.{digits - 1}e}".replace("-", MINUS)
    return np.format_float_positional(value, precision=digits, fractional=False, trim="-").replace("-", MINUS)


def percent(share: float) -> str:
    """A share as per cent: 97.2 %, 0.03 %, 264 %; 100 % is the whole, and 99.9 % all but a little."""
    value = 100 * share
    if value == 0 or value >= 100:
        return f"{value:.0f}{NB}%"
    return f"{min(value, 99.9):.1f}{NB}%" if value >= 1 else f"{significant(value, 1)}{NB}%"


def told_apart(value: float, other: float, decimals: int = 1) -> tuple[str, str]:
    """Two numbers with as many decimals as show which is larger."""
    texts = number(value, decimals), number(other, decimals)
    if texts[0] != texts[1] or value == other or decimals > MOST_DECIMALS:
        return texts
    return told_apart(value, other, decimals + 1)


def ship(vessel: Vessel) -> str:
    """Her name and main dimensions."""
    size = f"{vessel.length_m:g} m \N{MULTIPLICATION SIGN} {vessel.beam_m:g} m, draught {vessel.draught_m:g} m"
    return f"{vessel.name} ({size})"


def times(count: int) -> str:
    """Once, twice, 3 times."""
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def bearing(radians: float) -> str:
    """A direction as three-figure degrees clockwise from north."""
    return f"{round(math.degrees(radians)) % 360:03d}\N{DEGREE SIGN}"


def place(pose: Array) -> str:
    """A position north and east [m], counted from the centre of the area."""
    north, east = pose[:2].tolist()
    return (
        f"{number(abs(north), 1)} m {'north' if north >= 0 else 'south'} and {number(abs(east), 1)} m "
        f"{'east' if east >= 0 else 'west'} of the area's centre"
    )


def compass(radians: float) -> str:
    """The nearest of the eight compass points."""
    return COMPASS[round(math.degrees(radians) / 45) % 8]


def current(velocity: Array, std_mps: float) -> str:
    """A current by speed and direction of flow."""
    spread = f", standard deviation {speed(std_mps)} north and east" if std_mps > 0 else ""
    if not np.any(velocity):
        return f"no mean current{spread}"
    towards = math.atan2(velocity[1], velocity[0])
    return f"{speed(float(np.hypot(*velocity)))} setting {bearing(towards)} ({compass(towards)}){spread}"


def wind(velocity: Array, std_mps: float) -> str:
    """A wind by speed and direction of origin."""
    spread = f", standard deviation {speed(std_mps)} north and east" if std_mps > 0 else ""
    if not np.any(velocity):
        return f"no mean wind{spread}"
    origin = math.atan2(-velocity[1], -velocity[0])
    return f"{speed(float(np.hypot(*velocity)))} from {bearing(origin)} ({compass(origin)}){spread}"


def latitude(degrees: float, decimals: int = 3) -> str:
    """Degrees and decimal minutes, N or S."""
    return _degrees_minutes(degrees, 2, decimals) + (f"{NB}N" if degrees >= 0 else f"{NB}S")


def longitude(degrees: float, decimals: int = 3) -> str:
    """Degrees and decimal minutes, E or W."""
    wrapped = (degrees + 180.0) % 360.0 - 180.0
    return _degrees_minutes(wrapped, 3, decimals) + (f"{NB}E" if wrapped >= 0 else f"{NB}W")


def _degrees_minutes(degrees: float, width: int, decimals: int) -> str:
    ticks = round(abs(degrees) * 60 * 10**decimals)
    whole, rest = divmod(ticks, 60 * 10**decimals)
    minutes = f"{rest / 10**decimals:0{3 + decimals if decimals else 2}.{decimals}f}"
    return f"{whole:0{width}d}\N{DEGREE SIGN}{minutes}\N{PRIME}"


def counted(count: float, one: str) -> str:
    """1 run, 3 runs, 0.5 days."""
    number = count if isinstance(count, int) else f"{count:g}"
    return f"{number} {one}{'' if count == 1 else 's'}"


IN_NAMES = {
    "rad": ("\N{DEGREE SIGN}", math.degrees(1.0)),
    "radps": ("\N{DEGREE SIGN}/s", math.degrees(1.0)),
    "mps": (f"{NB}kn", KNOTS_PER_MPS),
    "s": (f"{NB}s", 1.0),
}
"""Ending of a setting's name -> unit that people read in the name of a manoeuvre, and factor to it."""
ADDED = re.compile(r"added-\d+-.+")  # names that a search gives to the manoeuvres it adds


def family(name: str) -> str:
    """A manoeuvre family as people call it: sway zig-zag."""
    return name.replace("_", " ").replace("zigzag", "zig-zag")


def names(primitives: Iterable[tuple[str, str, Mapping[str, float]]]) -> dict[str, str]:
    """Name in the files -> name as people say it; the same where two would be said alike.

    What a search added is called by its family and a letter, such as Zig-zag B; other names have angles in degrees and
    speeds in knots, such as circle, speed 4 kn, helm 35\N{DEGREE SIGN} to port.

    Args:
        primitives: name, family and settings of each, in order.
    """
    counts, said = Counter[str](), dict[str, str]()
    for name, kind, settings in primitives:
        if ADDED.fullmatch(name):
            title, number = family(kind), counts[kind]
            counts[kind] += 1
            said[name] = f"{title[:1].upper()}{title[1:]}{NB}{_letters(number)}"
        else:
            said[name] = _in_degrees_and_knots(name, settings)
    twice = {text for text, count in Counter(said.values()).items() if count > 1}
    return {name: name if text in twice else text for name, text in said.items()}


def _letters(number: int) -> str:
    """A, B, ..., Z, AA, AB, ..."""
    before = _letters(number // 26 - 1) if number >= 26 else ""
    return f"{before}{chr(ord('A') + number % 26)}"


def _in_degrees_and_knots(name: str, settings: Mapping[str, float]) -> str:
    for key, value in settings.items():
        stem, _, ending = key.rpartition("_")
        unit, factor = IN_NAMES.get(ending, ("", 1.0))
        stem, number_text = stem.replace("_", "-"), f"{value:.12g}"
        if unit and f"-{stem}-{number_text}-" in f"{name}-":
            side = f"{NB}to port" if key == "helm_rad" and value < 0 else ""
            shown = abs(value) if side else value
            size = number(shown * factor, 1) if ending == "mps" else significant(shown * factor)
            name = f"{name}-".replace(f"-{stem}-{number_text}-", f", {stem.replace('-', ' ')} {size}{unit}{side}-")[:-1]
    return name
