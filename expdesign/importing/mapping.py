"""From channels to columns: a guess by names, units and the readings themselves, which the user may change.

A column has our unit in its name (`expdesign explain data`). Beside ours there are a few that others are made from:
speed and course over ground, velocity north and east, magnetic heading and variation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.importing.channels import Channel, Log
from expdesign.importing.units import FACTORS, SHARES, split_unit, unit_word, words
from expdesign.records.file import Source, is_input, meaning
from expdesign.values import Array
from expdesign.vessel import Actuator

SOG, COG, NORTHWARD, EASTWARD = "sog_mps", "cog_rad", "vn_mps", "ve_mps"
MAGNETIC, VARIATION = "magnetic_heading_rad", "variation_rad"
EXTRA_COLUMNS = {
    SOG: "speed over ground; with the course and the heading it gives u_mps and v_mps",
    COG: "course over ground",
    NORTHWARD: "velocity over ground towards north",
    EASTWARD: "velocity over ground towards east",
    MAGNETIC: "heading from magnetic north; the variation is added",
    VARIATION: "variation, positive where magnetic north is east of true north",
}
"""Columns that others are made from, and their meaning."""
RULES = (
    ("", 0, r"\b(des|desired|nav|target|tgt|wp|std|sigma|var|cov|err(or)?|quality|id|temp|volt\w*|curr\w*)\b"),
    ("", 0, r"\b(water|stw|longwaterspd|transwaterspd|true wind|tws|twd|twa|mwd)\b"),
    ("wind_angle_rad", 0, r"\bawa\b|mwv angle r\b|(rel\w*|app\w*|vane)?.*wind (angle|dir\w*)"),
    ("wind_speed_mps", 0, r"\baws\b|mwv speed r\b|(rel\w*|app\w*)?.*wind (speed|spd)"),
    ("lat_deg", 0, r"\b(gga|gns|gps|fix|global position)\b.*\b(lat\w*)\b"),
    ("lat_deg", 1, r"\b(lat|latitude|breite|breitengrad)\b"),
    ("lon_deg", 0, r"\b(gga|gns|gps|fix|global position)\b.*\b(lon\w*|lng)\b"),
    ("lon_deg", 1, r"\b(lon|lng|long|longitude|laenge|lange|langengrad)\b"),
    ("roll_rate_radps", 0, r"\b(roll ?(rate|speed)|rollspeed|gyr\w* x|angular velocity x|xgyro|gx|rx)\b"),
    ("r_radps", 0, r"\b(rot|rate of turn|yaw ?rate|yawspeed|turn rate|r)$|\brot\b"),
    ("r_radps", 1, r"\b(gyr\w* z|angular velocity z|zgyro|gz|rz)\b"),
    ("roll_rad", 0, r"\b(roll|heel|heeling)\b"),
    ("imu_lateral_mps2", 0, r"\b(acc\w* y|linear acceleration y|yacc|ay|lateral acceleration)\b"),
    (MAGNETIC, 2, r"\bheading m\b|\bhdg m\b|\bmagnetic heading\b|\bheading mag\w*\b"),
    (VARIATION, 0, r"\b(variation|mv|declination|magvar)\b"),
    (COG, 0, r"\b(kurs uber grund|course over ground|course made good)\b"),
    ("heading_rad", 0, r"\b(heading t|headt|true heading|hdt|ths|gyro heading)\b"),
    ("heading_rad", 1, r"\b(att|attitude) (yaw|heading)\b|\b(heading|hdg|psi|kurs|hdg t)\b"),
    ("heading_rad", 2, r"\b(yaw|compass|gyro)\b"),
    (COG, 0, r"\b(cogt|cog|course over ground|course|track|tmg|ctmg|g crs)\b"),
    (NORTHWARD, 0, r"\b(vn|vel n|v north|velocity north)\b|\blocal position ned vx\b|global position int vx"),
    (EASTWARD, 0, r"\b(ve|vel e|v east|velocity east)\b|\blocal position ned vy\b|global position int vy"),
    (SOG, 0, r"\b(sogn|sog|speed over ground|ground ?speed|gps speed|gps spd|rmc spd)\b"),
    (SOG, 1, r"\b(spd|speed|v ground|geschwindigkeit( uber grund)?|velocity|groundspeed)$"),
    ("u_mps", 0, r"^(?!.*\bgps\b).*\b(u|surge|longgroundspd|surge speed)$"),
    ("v_mps", 0, r"^(?!.*\bgps\b).*\b(v|sway|transgroundspd|sway speed)$"),
    ("depth_m", 0, r"\b(depth|depthm|dpt|sounding|dpth|tiefe)\b"),
    ("north_m", 2, r"\b(north|northing|pn)\b"),
    ("east_m", 2, r"\b(east|easting|pe)\b"),
    ("rudder", 0, r"\b(rudder\d*|rsa|rud|helm|steering|ruder|ruderlage|ruderwinkel|nozzle|roer)\b"),
    ("a", 0, r"\b(azi|azimuth|azim|pod angle|thruster angle|azi angle)\b"),
    (
        "n",
        0,
        r"\b(rpm\d*|rps|drehzahl|revs|revolutions|shaft speed|prop(eller)? speed)\b|^(?!.*\bpos).*(^|\s)n( ?\d+)?$",
    ),
    ("throttle", 0, r"\b(throttle|thrust|thruster|motor|engine order|power lever|lever)\b"),
)
"""Column, or kind of actuator signal, and rank of the pattern among those of a column; the first that fits counts. The
first column of all, "", is of what is no measurement of the ship's own motion."""
ACTUATORS = ("rudder", "a", "n", "throttle")
ACTUATOR_RULES = tuple(rule for rule in RULES if rule[0] in ACTUATORS)
ORDER = r"\b(order\w*|cmd|command\w*|set|setpoint|sp|demand|dem|req\w*|soll|desired|des|ref)\b"
REACHED = r"\b(act|actual|fb|fbk|feedback|meas\w*|resp\w*|ist|rsa|reached|pos|position)\b"
PORT, STARBOARD = r"\b(p|port|portangle|ps|bb|left|l)\b", r"\b(s|stbd|stbdangle|sb|starboard|stb|right|r)\b"
BOW = r"\b(bow|bt|tunnel|thr bow|fwd|forward)\b"
RADIANS = {"heading_rad": 6.4, MAGNETIC: 6.4, COG: 6.4, "roll_rad": 1.6, "rudder": 1.6, "a": 13.0, VARIATION: 0.6,
           "wind_angle_rad": 6.4}  # fmt: skip
"""Largest size of an angle in radians, by column or kind."""
BESIDE = ("roll_rad", "roll_rate_radps", "depth_m", "wind_speed_mps", "wind_angle_rad", "imu_lateral_mps2")
"""Columns that a record does without: one that is the same in all rows is no reading."""
MOST_DEGREES = {"lat_deg": 90.0, "lon_deg": 180.0}
FINE_DEG, MOSTLY = 1e-3, 0.5
"""Usual change of a coordinate below which it is in degrees; share of negative ones among heights."""
DECIMALS = 2  # most decimals of an angle that is taken for degrees
SURE = 0.9  # share that a comparison must explain before it questions a unit that is stated
FIT = 0.3  # share that a comparison must explain before it tells a unit
NEAR = 1.6  # factor within which a ratio is that of a unit
WINDOW, WINDOW_S = 5, 10.0  # readings, and seconds, over which changes are compared, at least
PULSES = (700.0, 2300.0)  # us
SENSE = "turned over"


@dataclass(frozen=True, kw_only=True)
class Use:
    """What becomes of one channel: column = readings in the unit, times scale, plus offset."""

    file: str
    channel: str
    column: str = ""  # "" where it is not used
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0  # in the unit of the column
    why: str = ""

    @property
    def factor(self) -> float:
        """From the unit to that of the column."""
        if self.unit in SHARES and (is_input(self.column.removeprefix("reached_")) or self.column.startswith("tau")):
            return SHARES[self.unit]
        return FACTORS[dimension(self.column)].get(self.unit, 1.0)

    def applied(self, channel: Channel) -> Channel:
        """The channel in the column's unit."""
        values = channel.values - (1500.0 if self.unit == "pwm" else 0.0)
        if self.unit == "ddmm":  # degrees and minutes run together
            size = np.abs(values)
            values = np.sign(values) * (np.floor(size / 100.0) + size % 100.0 / 60.0)
        values = values * self.factor * self.scale + self.offset
        return replace(channel, name=self.column, unit="", values=values)


@dataclass(frozen=True, kw_only=True)
class FileClock:
    """What is added to the times of a file."""

    file: str
    offset_s: float = 0.0
    offset_std_s: float = 0.0
    sample_time_s: float = 0.0  # between rows of a table without a clock; 0 where it has one


@dataclass(frozen=True, kw_only=True)
class Mapping:
    """All decisions."""

    uses: tuple[Use, ...]
    files: tuple[FileClock, ...] = ()
    sample_time_s: float = 0.0  # of what is written; 0 for the slowest of the main sensors
    variation_deg: float | None = None  # of a magnetic heading
    # antenna_forward_m, antenna_starboard_m: place of the satellite antenna
    antenna_forward_m: float = 0.0
    antenna_starboard_m: float = 0.0
    length_m: float = 0.0  # of the ship; 0 where it is not known


def dimension(column: str) -> str:
    """Key of `FACTORS` of a column."""
    if column in ("lat_deg", "lon_deg"):
        return "place"
    ends = (("_radps", "rate"), ("_rad", "angle"), ("_mps2", "acceleration"), ("_mps", "speed"),
            ("_rps", "revolutions"),
            ("_m", "length"))  # fmt: skip
    return next((name for end, name in ends if column.endswith(end)), "force")


def guess(logs: Sequence[Log], actuators: Sequence[Actuator] = ()) -> Mapping:
    """The mapping that names, units and readings suggest.

    Args:
        logs: with clocks of their own or a common one.
        actuators: of the vessel, which number thrusters by their places; () where no vessel is known.
    """
    channels = [channel for log in logs for channel in log.channels]
    marks = [_marked(channel) for channel in channels]
    chosen = _best(channels, marks)
    uses = [
        _used(channel, mark, channels, chosen) if chosen.get(mark.key) is channel else _unused(channel, mark, chosen)
        for channel, mark in zip(channels, marks, strict=True)
    ]
    numbered = dict(_numbered([(u, m) for u, m in zip(uses, marks, strict=True) if u.column], channels, actuators))
    uses = [numbered.get(k, use) for k, use in ((id(use), use) for use in uses)]
    return Mapping(uses=tuple(uses), files=tuple(FileClock(file=log.source) for log in logs))


@dataclass(frozen=True, kw_only=True)
class _Mark:
    """What the name of a channel says."""

    column: str  # a column or a kind of actuator signal; "" for neither
    rank: int = 9
    unit: str = ""
    name: str = ""  # in words
    exact: bool = False  # whether the name is one of ours

    @property
    def machine(self) -> tuple[str, str, str]:
        """(bow or not, side, number) of an actuator."""
        if self.exact or not self.is_actuator:
            return "", "", ""
        own = self.name
        number = re.search(r"(\d+)\b(?!.*\d)", own)
        side = "p" if re.search(PORT, own) else "s" if re.search(STARBOARD, own) else ""
        return "bow" if re.search(BOW, own) else "", side, "" if side else number[1] if number else ""

    @property
    def role(self) -> str:
        """Either "order" or "reached"; "" where the name says neither."""
        if self.exact or not self.is_actuator:
            return ""
        return "order" if re.search(ORDER, self.name) else "reached" if re.search(REACHED, self.name) else ""

    @property
    def is_actuator(self) -> bool:
        return self.column in ACTUATORS

    @property
    def key(self) -> tuple[str, ...]:
        """What only one channel may be."""
        return (self.column, *self.machine, self.role)


def _marked(channel: Channel) -> _Mark:
    own = meaning(channel.name, 0)
    if isinstance(own, Source):
        return _Mark(column=own.name, rank=-1, unit=f"times {own.factor!r}", exact=True, name=words(channel.name))
    bare, unit = split_unit(channel.name)
    name, unit = words(bare), channel.unit or unit
    if channel.unit and unit_word(channel.unit) not in {u for t in FACTORS.values() for u in t} | set(SHARES):
        unit = ""
    talker = re.match(r"([A-Z]{2})([A-Z]{3})\.", channel.name)
    if talker:  # the sentence without who talks
        name = words(f"{talker[2]}.{bare[6:]}")
    whole = words(channel.name) if bare != channel.name else name
    column, rank = _rule(name, RULES) or _rule(whole, RULES) or ("", 9)
    if column == "" and re.search(ORDER, name):
        column, rank = _rule(whole, ACTUATOR_RULES) or ("", 9)
    if name in ("x", "y", "z"):
        column, rank = _coordinate(name, channel.values), 3
    if column in BESIDE and np.ptp(channel.values) == 0:
        column = ""
    return _Mark(column=column, rank=rank, unit=unit_word(unit), name=name)


def _coordinate(name: str, values: Array) -> str:
    """What x, y, z are: degrees of latitude and longitude, which change by little; heights of the bottom, negative."""
    if name == "z":
        return "depth_m" if np.mean(values < 0) > MOSTLY else ""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    fine = len(steps) > 10 and float(np.median(steps)) < FINE_DEG and float(np.abs(values).max()) <= 180.0
    return ("lat_deg" if name == "x" else "lon_deg") if fine else ""


def _rule(name: str, rules: Sequence[tuple[str, int, str]]) -> tuple[str, int] | None:
    """Column and rank of the first pattern that a name fits."""
    return next(((column, rank) for column, rank, pattern in rules if re.search(pattern, name)), None)


def _best(channels: Sequence[Channel], marks: Sequence[_Mark]) -> dict[tuple[str, ...], Channel]:
    """The channel of each column: by rank of its name, then readings; companions from one sentence or message."""
    found: dict[tuple[str, ...], Channel] = {}
    for key in sorted({mark.key for mark in marks if mark.column}):
        own = [(m.rank, -len(c), k) for k, (c, m) in enumerate(zip(channels, marks, strict=True)) if m.key == key]
        longest = max(-count for _, count, _ in own)
        own = [item for item in own if -item[1] > 0.1 * longest]
        found[key] = channels[min(own)[2]]
    for first, second in (("lat_deg", "lon_deg"), (SOG, COG), (NORTHWARD, EASTWARD), ("north_m", "east_m")):
        one = next((c for key, c in found.items() if key[0] == first), None)
        if one is None:
            continue
        for channel, mark in zip(channels, marks, strict=True):
            if mark.column == second and _family(channel) == _family(one):
                found[mark.key] = channel
                break
    there = {key[0] for key in found}
    for better, worse in (({"heading_rad"}, (MAGNETIC,)), ({"lat_deg", "lon_deg"}, ("north_m", "east_m"))):
        for name in worse if better <= there else ():
            found.pop((name, "", "", "", ""), None)
    return found


def _family(channel: Channel) -> tuple[str, str]:
    """What a channel shares with those of the same sentence, message or table."""
    return channel.source, channel.name.rpartition(".")[0]


def _unused(channel: Channel, mark: _Mark, chosen: dict[tuple[str, ...], Channel]) -> Use:
    better = chosen.get(mark.key)
    instead = {MAGNETIC: "the true heading", "north_m": "latitude", "east_m": "longitude"}.get(mark.column, "")
    why = f"{better.name} is used" if better is not None else "no quantity that is read"
    why = f"{instead} is used" if instead and better is None else why
    return Use(file=channel.source, channel=channel.name, why=why)


def _used(channel: Channel, mark: _Mark, channels: Sequence[Channel], chosen: dict[tuple[str, ...], Channel]) -> Use:
    """The use of a channel, with its unit."""
    use = Use(file=channel.source, channel=channel.name, column=mark.column, unit=mark.unit, why="its name")
    if mark.exact:
        return replace(use, unit="", scale=float(mark.unit.removeprefix("times ")), why="a column of ours")
    kind = (
        "angle" if mark.column in ("rudder", "a") else "revolutions" if mark.column == "n" else dimension(mark.column)
    )
    if mark.column == "depth_m" or (mark.column == "throttle" and not mark.unit):
        use = _of_depth(use, channel) if mark.column == "depth_m" else use
    largest = float(np.abs(channel.values).max())
    low, high = float(channel.values.min()), float(channel.values.max())
    if mark.is_actuator and not mark.unit.startswith(("deg", "rad", "rp")) and PULSES[0] < low and high < PULSES[1]:
        return replace(use, unit="pwm", why="its name; pulses of 1000 to 2000 us")
    if mark.column == "throttle":
        unit = mark.unit or ("percent" if largest > 1.5 else "share")
        return replace(
            use, unit=unit, why=f"its name; {unit} as stated" if mark.unit else f"its name; size {largest:.3g}"
        )
    if kind == "place":
        unit, why = _place_unit(mark.column, channel.values)
        return replace(use, unit=unit, why=f"its name{why}")
    if kind in ("length", "acceleration"):
        return replace(use, unit=mark.unit or {"length": "m", "acceleration": "mps2"}[kind])
    if kind == "rate":
        return _by_fit(use, _turning(channel, channels, chosen), ("degpmin", "degps", "radps"), mark.unit,
                       usual="degpmin" if re.search(r"\brot\b", mark.name)
                       else "radps" if largest < 3.2 else "degps")  # fmt: skip
    if kind == "speed" and mark.column == SOG:
        return _by_fit(use, _going(channel, channels, chosen), ("kn", "mps", "kmph", "cmps"), mark.unit, usual="kn")
    if mark.unit:
        return replace(use, why="its name and unit")
    if kind == "angle":
        rounded = bool((channel.values == np.round(channel.values, DECIMALS)).all())
        unit = "deg" if largest > RADIANS[mark.column] or rounded or _degrees_beside(channel, channels) else "rad"
        few = "" if largest > RADIANS[mark.column] or not rounded else " and of few decimals"
        return replace(use, unit=unit, why=f"its name; up to {largest:.4g}{few}, so {unit}")
    if kind == "revolutions":
        unit = (
            "rps" if re.search(r"\b(rps|hz)\b", mark.name) else "rpm" if "rpm" in mark.name or largest > 30 else "rps"
        )
        return replace(use, unit=unit, why=f"its name; up to {largest:.4g}, so {unit}")
    return replace(use, unit="mps")


def _place_unit(column: str, values: Array) -> tuple[str, str]:
    """Unit of a latitude or longitude, by its size, and words on it."""
    largest, most = float(np.abs(values).max()), MOST_DEGREES[column]
    if largest <= most:
        return "deg", ""
    if largest < 100.0 * most:
        return "ddmm", "; degrees and minutes run together (scale = -1.0 for S or W)"
    return "1e-7 deg", "; in units of 1e-7 degrees"


def _of_depth(use: Use, channel: Channel) -> Use:
    """Depths are counted downwards; heights of the bottom are turned over."""
    if np.mean(channel.values < 0) > 0.5:
        return replace(
            use, unit=use.unit or "m", scale=-1.0, why="its name; negative, a height of the bottom: turned over"
        )
    return use


def _degrees_beside(channel: Channel, channels: Sequence[Channel]) -> bool:
    """Whether a heading or course of the same table is in degrees."""
    beside = [c for c in channels if _family(c) == _family(channel) and c is not channel]
    names = [(c, _marked(c).column) for c in beside]
    return any(name in RADIANS and np.abs(c.values).max() > RADIANS[name] for c, name in names)


@dataclass(frozen=True)
class _Ratio:
    """How a measured change follows a channel, in the unit of our columns for each of its own."""

    value: float
    explained: float
    of: str


def _by_fit(use: Use, ratio: _Ratio | None, units: Sequence[str], stated: str, *, usual: str) -> Use:
    """The unit that a comparison with another channel shows, and the sign."""
    table = FACTORS[dimension(use.column)]
    if ratio is None or ratio.explained < FIT:
        return replace(use, unit=stated or usual, why="its name and unit" if stated else f"its name; {usual}, as usual")
    size, sign = abs(ratio.value), 1.0 if ratio.value > 0 or use.column == SOG else -1.0
    near = min(units, key=lambda unit: abs(np.log(size / table[unit])))
    fits = 1.0 / NEAR < size / table[near] < NEAR
    turned = "" if sign > 0 else f"; it counts the other way than {ratio.of}: {SENSE}"
    if stated:
        off = size / table.get(stated, 1.0)
        sure = ratio.explained > SURE and not 1.0 / NEAR < off < NEAR
        doubt = "" if not sure else f"; but {ratio.of} changes {off:.3g} times as fast"
        return replace(use, unit=stated, scale=sign, why=f"its name and unit{doubt}{turned}")
    if fits:
        return replace(use, unit=near, scale=sign, why=f"its name; {near} by the change of {ratio.of}{turned}")
    why = f"its name; {usual}, as usual, but {ratio.of} changes {size / table[usual]:.3g} times as fast"
    return replace(
        use, unit=usual, scale=sign, why=f"{why}{turned}" if ratio.explained > SURE else "its name; as usual"
    )


def _turning(channel: Channel, channels: Sequence[Channel], chosen: dict[tuple[str, ...], Channel]) -> _Ratio | None:
    """The heading's change by the integral of a rate."""
    heading = next((c for key, c in chosen.items() if key[0] in ("heading_rad", MAGNETIC)), None)
    if heading is None or heading.source != channel.source:
        return None
    degrees = np.abs(heading.values).max() > RADIANS["heading_rad"]
    angle = np.unwrap(heading.values * (np.pi / 180.0 if degrees else 1.0))
    times, step = _common(channel, heading)
    if times is None:
        return None
    turned = np.interp(times, heading.time_s, angle)
    area = np.concatenate([[0.0], np.cumsum((channel.values[1:] + channel.values[:-1]) / 2 * np.diff(channel.time_s))])
    return _ratio(_steps(np.interp(times, channel.time_s, area), step), _steps(turned, step), heading.name)


def _going(channel: Channel, channels: Sequence[Channel], chosen: dict[tuple[str, ...], Channel]) -> _Ratio | None:
    """The way over ground by the integral of a speed."""
    lat, lon = (next((c for key, c in chosen.items() if key[0] == name), None) for name in ("lat_deg", "lon_deg"))
    if lat is None or lon is None or len(lat) != len(lon) or lat.source != channel.source:
        return None
    lat_deg, lon_deg = (
        Use(file="", channel="", column=name, unit=_place_unit(name, one.values)[0]).applied(one).values
        for name, one in (("lat_deg", lat), ("lon_deg", lon))
    )
    north, east = 111195.0 * lat_deg, 111195.0 * lon_deg * np.cos(np.radians(lat_deg[0]))
    times, step = _common(channel, lat)
    if times is None:
        return None
    place = np.interp(times, lat.time_s, north) + 1j * np.interp(times, lat.time_s, east)
    area = np.concatenate([[0.0], np.cumsum((channel.values[1:] + channel.values[:-1]) / 2 * np.diff(channel.time_s))])
    going = np.abs(_steps(place, step))
    return _ratio(_steps(np.interp(times, channel.time_s, area), step), going, "the position", offset=False)


def _common(one: Channel, other: Channel) -> tuple[Array | None, int]:
    """Even times that both channels cover, and the number of them in a window."""
    first, last = max(one.time_s[0], other.time_s[0]), min(one.time_s[-1], other.time_s[-1])
    step_s = max(one.interval_s, other.interval_s)
    if not np.isfinite(step_s) or not last - first > 4 * WINDOW * step_s:
        return None, 0
    times = np.arange(first, last, step_s)
    return times, max(WINDOW, min(int(np.ceil(WINDOW_S / step_s)), len(times) // 4))


def _steps(values: np.ndarray, window: int) -> np.ndarray:
    return np.asarray(values[window:] - values[:-window])


def _ratio(x: Array, y: Array, of: str, *, offset: bool = True) -> _Ratio | None:
    """Ratio of y to x, and the share of y that it explains."""
    x, y = (x - x.mean(), y - y.mean()) if offset else (x, y)
    if not (x @ x > 0 and y @ y > 0):
        return None
    return _Ratio(float(x @ y / (x @ x)), float((x @ y) ** 2 / (x @ x) / (y @ y)), of)


# Actuators: which machine a signal belongs to, its number, and whether it is an order or what was reached.


def _numbered(
    used: Sequence[tuple[Use, _Mark]], channels: Sequence[Channel], actuators: Sequence[Actuator]
) -> Iterator[tuple[int, Use]]:
    """Uses of actuators' signals with their columns, by the identity of the use without."""
    own = [(use, mark) for use, mark in used if mark.is_actuator]
    driven = {mark.machine for _, mark in own if mark.column in ("n", "throttle")}
    # an angle without revolutions beside it steers as a rudder does
    own = [
        (use, replace(mark, column="rudder") if mark.column == "a" and mark.machine not in driven else mark)
        for use, mark in own
    ]
    table = {(c.source, c.name): c for c in channels}
    shares = any(use.unit in SHARES for use, _ in own)
    forces = not actuators or any(one.kind == "force" for one in actuators)
    throttles = {mark.machine for _, mark in own if mark.column == "throttle"}
    as_forces = shares and forces and len(throttles) < 2 and not any(mark.column in ("n", "a") for _, mark in own)
    machines = sorted({mark.machine for _, mark in own if mark.column != "rudder"}, key=_as_listed)
    rudders = sorted({mark.machine for _, mark in own if mark.column == "rudder"}, key=_as_listed)
    turning = {mark.machine for _, mark in own if mark.column == "a"}
    numbers = {machine: str(k) for k, machine in enumerate(machines, start=1)}
    numbers |= _by_place(machines, turning, actuators)
    for use, mark in own:
        roles = {other.role for _, other in own if (other.column, other.machine) == (mark.column, mark.machine)}
        reached, said = _is_reached(mark, roles, table[use.file, use.channel])
        prefix = "reached_" if reached else ""
        if as_forces:
            column, extra = ("tau_psi" if mark.column == "rudder" else "tau_x"), "as a share of the largest"
            yield id(use), replace(use, column=column, why=f"{use.why}; {extra}")
            continue
        if mark.column == "rudder":
            signal, scale = f"rudder{rudders.index(mark.machine) + 1}", _largest(actuators, "rudder", use)
        else:
            stem = "a" if mark.column == "a" else "n"
            signal, scale = f"{stem}{numbers[mark.machine]}", _largest(actuators, stem, use)
        column = f"{prefix}{signal}_{'rps' if signal[0] == 'n' else 'rad'}"
        unit_words = (
            ""
            if use.unit not in SHARES
            else f"; of {scale:.4g}, {'as the vessel file has it' if actuators else 'as nothing tells the largest'}"
        )
        yield id(use), replace(use, column=column, scale=use.scale * scale, why=f"{use.why}; {said}{unit_words}")


def _as_listed(machine: tuple[str, str, str]) -> tuple[str, str, str]:
    """Stern before bow, port before starboard, by number."""
    bow, side, number = machine
    return bow, number.rjust(3), side


def _largest(actuators: Sequence[Actuator], stem: str, use: Use) -> float:
    """What 100 per cent of an order are."""
    if use.unit not in SHARES:
        return 1.0
    limits = [
        limit.high for one in actuators for name, limit in zip(one.signals, one.limits, strict=True)
        if name.rstrip("0123456789") == stem and np.isfinite(limit.high)
    ]  # fmt: skip
    return limits[0] if limits else 1.0 if stem == "n" else np.pi / 180.0 * 35.0


def _by_place(
    machines: Sequence[tuple[str, str, str]], turning: set[tuple[str, str, str]], actuators: Sequence[Actuator]
) -> dict[tuple[str, str, str], str]:
    """Numbers in the vessel file, where places tell: tunnels are at the bow, sides are as signed."""
    found = {}
    for machine in machines:
        bow, side, number = machine
        kinds = ("tunnel",) if bow else ("azimuth",) if machine in turning else ("propeller", "azimuth")
        able = [one for one in actuators if one.kind in kinds]
        if side:
            able = [one for one in able if np.sign(one.starboard_m) == (-1.0 if side == "p" else 1.0)]
        elif number:
            able = [one for one in able if str(one.number) == number]
        if len(able) == 1:
            found[machine] = str(able[0].number)
    return found if len(set(found.values())) == len(found) else {}


STEPPED = 0.5  # share of all movement in single jumps from which a signal is an order


def _is_reached(mark: _Mark, roles: set[str], channel: Channel) -> tuple[bool, str]:
    """Whether a signal is a position that was reached, and why."""
    if mark.role:
        return mark.role == "reached", f"{'an order' if mark.role == 'order' else 'feedback'} by its name"
    if "order" in roles:
        return True, "feedback, as there is an order too"
    if "reached" in roles:
        return False, "the order, as there is feedback too"
    if jumps(channel.values):
        return False, "it jumps as an order does"
    return True, "it moves as an actuator does, so what was reached (give the column without reached_ for an order)"


def jumps(values: Array) -> bool:
    """Whether a signal moves mostly by jumps from one held value to the next, as orders do."""
    steps = np.diff(values)
    size = float(np.abs(steps).max(initial=0.0))
    if not size:
        return True
    moving = np.abs(steps) > 0.02 * size
    alone = moving & ~np.r_[False, moving[:-1]] & ~np.r_[moving[1:], False]
    return float(np.abs(steps[alone]).sum()) > STEPPED * float(np.abs(steps[moving]).sum())


def bow_signals(mapping: Mapping) -> tuple[str, ...]:
    """Signals of thrusters across the bow, by the names of their channels."""
    return tuple(
        use.column.removeprefix("reached_").removesuffix("_rps")
        for use in mapping.uses
        if re.search(BOW, words(use.channel)) and use.column.endswith("_rps")
    )
