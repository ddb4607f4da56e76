"""The mapping that names and units suggest; unit and sense by readings where these tell; and readings of nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.importing.channels import Channel, Log, Places
from expdesign.importing.mapping import (
    COG,
    EASTWARD,
    FACTORS,
    MAGNETIC,
    NORTHWARD,
    SOG,
    VARIATION,
    FileClock,
    Mapping,
    Use,
    counted,
    dimension,
)
from expdesign.importing.names import COURSE_OR_HEADING, ORDER, Mark, family_of, marked, numbered, shared
from expdesign.values import Array
from expdesign.vessel import Actuator

NINES = tuple(float(f"{'9' * digits}{end}") for digits in (2, 3, 4, 5, 6) for end in ("", ".9", ".99"))
FILLS = np.array([
    *NINES, 511.0, 51.1, 102.3, 102.2, 1023.0, 91.0, 181.0, 128.0, 127.0, 327.67, 327.68, 655.35, 3276.7, 6553.5,
    32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0, 4294967295.0, 214.7483647, 1e10, 1e15,
])  # fmt: skip
"""Sizes of numbers that stand for no reading: nines; of AIS (ITU-R M.1371: speed 102.3, heading 511, position 91 and
181, rate of turn 128); the largest of integers, plain and scaled."""
APART = 1.2  # ratio to the largest of other readings beyond which one of these is no reading
MOST = 0.95  # share of readings that may be fills, else these are readings


def cleaned(log: Log) -> Log:
    """The log without readings that stand for none, with notes on how many of which."""
    channels, notes = [], [*log.notes]
    at_zero = dict(_at_zero(log))
    for channel in log.channels:
        values = channel.values
        gone = at_zero.get(id(channel), np.zeros(len(values), dtype=bool))
        if gone.any():
            notes.append(f"{channel.name}: {counted(int(gone.sum()), 'position')} at 0, 0 left out")
        for fill in sorted(_fills(values[~gone])):
            own = np.isclose(values, fill, rtol=1e-7, atol=0.0)
            notes.append(
                f"{channel.name}: {counted(int(own.sum()), 'reading')} of {fill:.10g} left out, which says none"
            )
            gone = gone | own
        if gone.all() and len(gone):
            continue
        channels.append(replace(channel, time_s=channel.time_s[~gone], values=values[~gone]) if gone.any() else channel)
    return replace(log, channels=tuple(channels), notes=tuple(notes))


def _fills(values: Array) -> Iterator[float]:
    """Fill values among readings, each far beyond all others of its sign."""
    left = values
    while len(left):
        largest = left[np.argmax(np.abs(left))]
        own = np.isclose(left, largest, rtol=1e-7, atol=0.0)
        rest = left[~own]
        known = np.isclose(FILLS, abs(largest), rtol=1e-7, atol=0.0).any()
        if not known or not len(rest) or len(rest) < (1.0 - MOST) * len(values):
            return
        if abs(largest) < APART * float(np.abs(rest).max()):
            return
        yield float(largest)
        left = rest


def _at_zero(log: Log) -> Iterator[tuple[int, np.ndarray]]:
    """(identity of a channel, (k,) where latitude and longitude beside each other are both 0)."""
    places: dict[str, dict[tuple[str, str], Channel]] = {"lat_deg": {}, "lon_deg": {}}
    for channel in log.channels:
        if (column := marked(channel).column) in places:
            places[column].setdefault(family_of(channel), channel)
    for family, lat in places["lat_deg"].items():
        lon = places["lon_deg"].get(family)
        if lon is None or len(lon) != len(lat):
            continue
        zero = (lat.values == 0.0) & (lon.values == 0.0)
        if zero.any() and not zero.all():
            yield id(lat), zero
            yield id(lon), zero


RADIANS = {"heading_rad": 6.4, MAGNETIC: 6.4, COG: 6.4, "roll_rad": 1.6, "rudder": 1.6, "a": 13.0, VARIATION: 0.6,
           "wind_angle_rad": 6.4}  # fmt: skip
"""Largest size of an angle in radians, by column or kind."""
MOST_DEGREES = {"lat_deg": 90.0, "lon_deg": 180.0}
TURN_DEG = 360.5
MOST_HELM_DEG, MOST_PERCENT = 75.0, 101.0
SWAPPED = "no place"
RADIANS_RATIO = 0.1  # way by positions over that by speed below which positions, read in degrees, are in radians
DECIMALS = 2  # most decimals of an angle that is taken for degrees
SURE = 0.9  # share that a comparison must explain before it questions a unit that is stated
FIT = 0.3  # share that a comparison must explain before it tells a unit
NEAR = 1.6  # factor within which a ratio is that of a unit
WINDOW, WINDOW_S = 5, 10.0  # readings, and seconds, over which changes are compared, at least
PULSES = (700.0, 2300.0)  # us
SENSE = "turned over"
DIRECTIONS = ("heading_rad", MAGNETIC, COG)
NEAR_RAD = 0.5  # median by which heading and course, magnetic and true, differ at most


def used(channel: Channel, mark: Mark, channels: Sequence[Channel], chosen: dict[tuple[str, ...], Channel]) -> Use:
    """The use of a channel, with its unit and sense: a rate's by the heading, any other by what its name says."""
    use = _in_unit(channel, mark, channels, chosen)
    if mark.sense >= 0.0 or not use.column:
        return use
    ratio = _turning(channel, channels, chosen) if use.column == "r_radps" else None
    if ratio is not None and ratio.explained >= FIT:
        return use
    return replace(use, scale=-use.scale, why=f"{use.why}; port is positive by its name: {SENSE}")


def _in_unit(channel: Channel, mark: Mark, channels: Sequence[Channel], chosen: dict[tuple[str, ...], Channel]) -> Use:
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
        unit, why = (mark.unit, " and unit") if mark.unit else _place_unit(*_places(channel, chosen), chosen)
        return replace(use, column="" if unit == SWAPPED else mark.column, unit=unit, why=f"its name{why}")
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
    if mark.column == "rudder" and MOST_HELM_DEG < largest < MOST_PERCENT:
        return replace(use, unit="percent", why=f"its name; up to {largest:.4g}, which no rudder turns, so per cent")
    if kind == "angle":
        if (
            mark.column in DIRECTIONS
            and largest < RADIANS[mark.column]
            and (like := _as_beside(mark, channel, channels))
        ):
            return replace(use, unit=like[0], why=f"its name; {like[0]}, in which it is near {like[1]}")
        rounded = bool((channel.values == np.round(channel.values, DECIMALS)).all())
        unit = "deg" if largest > RADIANS[mark.column] or rounded or _degrees_beside(channel, channels) else "rad"
        if mark.column in DIRECTIONS and largest > TURN_DEG:
            unit, why = _parts_of_degrees(channel, chosen)
            return replace(use, unit=unit, why=f"its name; up to {largest:.4g}, {why}")
        few = "" if largest > RADIANS[mark.column] or not rounded else " and of few decimals"
        return replace(use, unit=unit, why=f"its name; up to {largest:.4g}{few}, so {unit}")
    if kind == "revolutions":
        unit = (
            "rps" if re.search(r"\b(rps|hz)\b", mark.name) else "rpm" if "rpm" in mark.name or largest > 30 else "rps"
        )
        return replace(use, unit=unit, why=f"its name; up to {largest:.4g}, so {unit}")
    return replace(use, unit="mps")


def _places(channel: Channel, chosen: dict[tuple[str, ...], Channel]) -> tuple[Channel, Channel]:
    """Latitude and longitude, of which a channel is one."""
    found = {key[0]: own for key, own in chosen.items() if key[0] in MOST_DEGREES}
    return found.get("lat_deg", channel), found.get("lon_deg", channel)


def _place_unit(lat: Channel, lon: Channel, chosen: dict[tuple[str, ...], Channel]) -> tuple[str, str]:
    """Unit of latitude and longitude, which is the same, by their sizes, and words on it."""
    largest, other = float(np.abs(lat.values).max()), float(np.abs(lon.values).max())
    minutes = max(float((np.abs(own.values) % 100.0).max()) for own in (lat, lon))
    if largest <= MOST_DEGREES["lat_deg"] and other <= 2 * MOST_DEGREES["lon_deg"]:
        small = largest <= np.pi / 2 and other <= np.pi + 1e-6
        ratio = _going_by(lat, lon, chosen) if small else None
        if ratio is not None and ratio.explained > FIT and ratio.value < RADIANS_RATIO:
            return "rad", f"; in radians, as {ratio.of} moves by what the speed says"
        return "deg", ""
    if largest <= MOST_DEGREES["lon_deg"] and other <= MOST_DEGREES["lat_deg"] and lat is not lon:
        return SWAPPED, f"; up to {largest:.4g}, which no latitude is: is it the longitude?"
    if largest < 100.0 * MOST_DEGREES["lat_deg"] and other < 100.0 * MOST_DEGREES["lon_deg"] and minutes < 60.0:
        negative = bool((lat.values < 0).any() or (lon.values < 0).any())
        return "ddmm", "; degrees and minutes run together" + ("" if negative else " (scale = -1.0 for S or W)")
    return (
        ("1e-7 deg", "; in units of 1e-7 degrees")
        if largest > 1e6
        else (SWAPPED, f"; up to {largest:.4g}, no latitude")
    )


def _of_depth(use: Use, channel: Channel) -> Use:
    """Depths are counted downwards; heights of the bottom are turned over."""
    if np.mean(channel.values < 0) > 0.5:
        return replace(
            use, unit=use.unit or "m", scale=-1.0, why="its name; negative, a height of the bottom: turned over"
        )
    return use


def _degrees_beside(channel: Channel, channels: Sequence[Channel]) -> bool:
    """Whether a heading or course of the same table is in degrees."""
    beside = [c for c in channels if family_of(c) == family_of(channel) and c is not channel]
    names = [(c, marked(c).column) for c in beside]
    return any(name in RADIANS and np.abs(c.values).max() > RADIANS[name] for c, name in names)


def _as_beside(mark: Mark, channel: Channel, channels: Sequence[Channel]) -> tuple[str, str] | None:
    """The unit in which a direction is near another one of its table that is in degrees, and the name of that one."""
    for other in channels:
        column = marked(other).column
        beside = family_of(other) == family_of(channel) and len(other) == len(channel) and other is not channel
        if beside and column in DIRECTIONS and column != mark.column and np.abs(other.values).max() > RADIANS[column]:
            course = np.exp(-1j * np.radians(other.values))
            apart = {
                unit: float(np.median(np.abs(np.angle(np.exp(1j * factor * channel.values) * course))))
                for unit, factor in (("rad", 1.0), ("deg", np.pi / 180.0))
            }
            near = min(apart, key=lambda unit: apart[unit])
            return (near, other.name) if apart[near] < NEAR_RAD else None
    return None


def _parts_of_degrees(channel: Channel, chosen: dict[tuple[str, ...], Channel]) -> tuple[str, str]:
    """The unit of a direction beyond a turn, and words on it: degrees that count on, tenths or hundredths of them.

    By the way of the positions where they show one; else by where it goes round, or begins.
    """
    values, units = channel.values, {"deg": 1.0, "ddeg": 0.1, "cdeg": 0.01}
    lat, lon = _places(channel, chosen)
    if lat is not lon and len(lat) == len(lon) and lat.source == channel.source:
        windows = _windows(channel, lat)
        north, east = _metres(lat, lon, marked(lat).unit or _place_unit(lat, lon, chosen)[0])
        way = windows.changes(lat.time_s, north + 1j * east)
        nearest = values[np.clip(np.searchsorted(channel.time_s, windows.middles), 0, len(values) - 1)]
        if (total := float(np.abs(way).sum())) > 0:
            fits = {
                unit: float((way * np.exp(-1j * np.radians(share * nearest))).real.sum()) / total
                for unit, share in units.items()
            }
            best = max(fits, key=lambda unit: fits[unit])
            if fits[best] > SURE:
                return best, f"so {best}, by the way of the positions"
    largest, jump = float(values.max()), float(np.abs(np.diff(values)).max(initial=0.0))
    for turn, unit in ((10 * TURN_DEG, "ddeg"), (100 * TURN_DEG, "cdeg")):
        if values.min() >= 0.0 and turn / 10.0 < largest <= turn and (jump > turn / 2 or values[0] > turn / 10.0):
            return unit, f"so {unit}"
    return "deg", "so deg that count on"


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
    windows = _windows(channel, heading)
    area = np.concatenate([[0.0], np.cumsum((channel.values[1:] + channel.values[:-1]) / 2 * np.diff(channel.time_s))])
    return _ratio(windows.changes(channel.time_s, area), windows.changes(heading.time_s, angle), heading.name)


def _going(channel: Channel, channels: Sequence[Channel], chosen: dict[tuple[str, ...], Channel]) -> _Ratio | None:
    """The way over ground by the integral of a speed."""
    lat, lon = (next((c for key, c in chosen.items() if key[0] == name), None) for name in ("lat_deg", "lon_deg"))
    if lat is None or lon is None or len(lat) != len(lon) or lat.source != channel.source:
        return None
    return _way(channel, lat, lon, marked(lat).unit or _place_unit(lat, lon, chosen)[0])


def _going_by(lat: Channel, lon: Channel, chosen: dict[tuple[str, ...], Channel]) -> _Ratio | None:
    """The way over ground, as if places were in degrees, by the integral of the speed; m/s where nothing says more."""
    speed = next((own for key, own in chosen.items() if key[0] in (SOG, "u_mps") and own.source == lat.source), None)
    if speed is None or len(lat) != len(lon) or lat is lon:
        return None
    ratio = _way(speed, lat, lon, "deg")
    unit = marked(speed).unit
    return None if ratio is None else replace(ratio, value=ratio.value / FACTORS["speed"].get(unit, 1.0))


def _way(channel: Channel, lat: Channel, lon: Channel, unit: str) -> _Ratio | None:
    """The way over ground by the integral of a speed, with places in a unit."""
    north, east = _metres(lat, lon, unit)
    windows = _windows(channel, lat)
    area = np.concatenate([[0.0], np.cumsum((channel.values[1:] + channel.values[:-1]) / 2 * np.diff(channel.time_s))])
    going = np.abs(windows.changes(lat.time_s, north + 1j * east))
    return _ratio(windows.changes(channel.time_s, area), going, "the position", offset=False)


def _metres(lat: Channel, lon: Channel, unit: str) -> tuple[Array, Array]:
    """North and east [m] of places in a unit."""
    lat_deg, lon_deg = (
        Use(file="", channel="", column=name, unit=unit).applied(one).values
        for name, one in (("lat_deg", lat), ("lon_deg", lon))
    )
    return 111195.0 * lat_deg, 111195.0 * lon_deg * np.cos(np.radians(lat_deg[0]))


@dataclass(frozen=True, eq=False)
class _Windows:
    """Windows of one length, over even times which two channels cover without a gap."""

    times: Array  # (k,) [s]
    begins: Places  # (w,) indices of times
    length: int  # steps

    @property
    def middles(self) -> Array:
        """Times (w,) [s]."""
        return (self.times[self.begins] + self.times[self.begins + self.length]) / 2.0

    def changes(self, at: Array, values: np.ndarray) -> np.ndarray:
        """Changes (w,) over the windows of values (n,) at times (n,)."""
        even = np.interp(self.times, at, values)
        return np.asarray(even[self.begins + self.length] - even[self.begins])


def _windows(one: Channel, other: Channel) -> _Windows:
    """Windows over the time that both channels cover; none where that is short."""
    first, last = max(one.time_s[0], other.time_s[0]), min(one.time_s[-1], other.time_s[-1])
    slower = max(one, other, key=lambda channel: channel.interval_s)
    step_s = slower.interval_s
    if not np.isfinite(step_s) or not last - first > 4 * WINDOW * step_s:
        return _Windows(np.zeros(0), np.zeros(0, dtype=int), WINDOW)
    at = (slower.time_s - first) / step_s
    places = np.unique(np.concatenate([np.floor(at), np.ceil(at)]))  # beside readings, so that a gap has none
    places = places[(places >= 0) & (places * step_s < last - first)]
    length = max(WINDOW, min(int(np.ceil(WINDOW_S / step_s)), len(places) // 4))
    return _Windows(first + step_s * places, np.flatnonzero(places[length:] - places[:-length] == length), length)


def _ratio(x: Array, y: Array, of: str, *, offset: bool = True) -> _Ratio | None:
    """Ratio of y to x, and the share of y that it explains; None where there is nothing to tell it from."""
    if not len(x):
        return None
    x, y = (x - x.mean(), y - y.mean()) if offset else (x, y)
    if not (x @ x > 0 and y @ y > 0):
        return None
    return _Ratio(float(x @ y / (x @ x)), float((x @ y) ** 2 / (x @ x) / (y @ y)), of)


def guess(logs: Sequence[Log], actuators: Sequence[Actuator] = ()) -> Mapping:
    """The mapping that names, units and readings suggest.

    Args:
        logs: with clocks of their own or a common one.
        actuators: of the vessel, which number thrusters by their places; () where no vessel is known.
    """
    channels = [channel for log in logs for channel in log.channels]
    marks = [marked(channel) for channel in channels]
    if any(mark.column == "heading_rad" and mark.rank < COURSE_OR_HEADING for mark in marks):
        marks = [replace(mark, column=COG) if mark.rank == COURSE_OR_HEADING else mark for mark in marks]
    chosen = _best(channels, marks)
    uses = [
        used(channel, mark, channels, chosen) if chosen.get(mark.key) is channel else _unused(channel, mark, chosen)
        for channel, mark in zip(channels, marks, strict=True)
    ]
    by_machine = dict(numbered([(u, m) for u, m in zip(uses, marks, strict=True) if u.column], channels, actuators))
    uses = [by_machine.get(k, use) for k, use in ((id(use), use) for use in uses)]
    uses += shared(uses, marks, actuators)
    return Mapping(uses=tuple(uses), files=tuple(FileClock(file=log.source) for log in logs))


def _best(channels: Sequence[Channel], marks: Sequence[Mark]) -> dict[tuple[str, ...], Channel]:
    """The channel of each column: by rank of its name, then readings; companions from one sentence or message."""
    found: dict[tuple[str, ...], Channel] = {}
    for key in sorted({mark.key for mark in marks if mark.column}):
        own = [
            (m.rank + 10 * (np.ptp(c.values) == 0), -len(c), k)
            for k, (c, m) in enumerate(zip(channels, marks, strict=True))
            if m.key == key
        ]
        longest = max(-count for _, count, _ in own)
        own = [item for item in own if -item[1] > 0.1 * longest]
        found[key] = channels[min(own)[2]]
    for first, second in (("lat_deg", "lon_deg"), (SOG, COG), (NORTHWARD, EASTWARD), ("north_m", "east_m")):
        one = next((c for key, c in found.items() if key[0] == first), None)
        if one is None:
            continue
        for channel, mark in zip(channels, marks, strict=True):
            if mark.column == second and family_of(channel) == family_of(one):
                found[mark.key] = channel
                break
    there = {key[0] for key in found}
    for better, worse in (({"heading_rad"}, (MAGNETIC,)), ({"lat_deg", "lon_deg"}, ("north_m", "east_m"))):
        for name in worse if better <= there else ():
            found.pop((name, "", "", "", ""), None)
    return found


def _unused(channel: Channel, mark: Mark, chosen: dict[tuple[str, ...], Channel]) -> Use:
    better = chosen.get(mark.key)
    instead = {MAGNETIC: "the true heading", "north_m": "latitude", "east_m": "longitude"}.get(mark.column, "")
    why = f"{better.name} is used" if better is not None else "no quantity that is read"
    if not mark.is_actuator and re.search(ORDER, mark.name):
        why = "an order by its name, no reading"
    why = f"{instead} is used" if instead and better is None else why
    return Use(file=channel.source, channel=channel.name, why=why)
