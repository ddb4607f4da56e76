"""Unit and sense of a channel, by its name and, where that is silent, by the readings themselves."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.mapping import COG, MAGNETIC, SOG, VARIATION, Use, dimension
from expdesign.importing.names import Mark, family_of, marked
from expdesign.importing.units import FACTORS
from expdesign.values import Array

RADIANS = {"heading_rad": 6.4, MAGNETIC: 6.4, COG: 6.4, "roll_rad": 1.6, "rudder": 1.6, "a": 13.0, VARIATION: 0.6,
           "wind_angle_rad": 6.4}  # fmt: skip
"""Largest size of an angle in radians, by column or kind."""
MOST_DEGREES = {"lat_deg": 90.0, "lon_deg": 180.0}
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
        if (
            mark.column in DIRECTIONS
            and largest < RADIANS[mark.column]
            and (like := _as_beside(mark, channel, channels))
        ):
            return replace(use, unit=like[0], why=f"its name; {like[0]}, in which it is near {like[1]}")
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
