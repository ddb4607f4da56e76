"""Channels on one common clock: stretches without a gap, in even steps, in the columns of our CSV.

Readings faster than the steps are averaged over each of them, or, of orders, as they act from a step to the next;
others of about the same rate are interpolated; slower ones are repeated, so that their interval can be seen and is
undone where data are used (`expdesign.kinematics`). Angles go round: no mean and no line passes through north.
"""

from __future__ import annotations

import math
from collections.abc import Mapping as Table
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from expdesign.conventions import listed, rotated
from expdesign.errors import NoAnswer
from expdesign.importing.channels import RESTART_GAP_S, Channel
from expdesign.importing.mapping import COG, EASTWARD, MAGNETIC, NORTHWARD, SOG, VARIATION, Mapping
from expdesign.kinematics import held
from expdesign.records.file import PLANNED, REACHED, STEERED, input_name, is_input
from expdesign.values import Array
from expdesign.vessel.structures import FORCE_SIGNALS

MAIN = ("lat_deg", "lon_deg", "north_m", "east_m", "heading_rad", "u_mps", "v_mps", NORTHWARD, EASTWARD, "r_radps")
PAIRS = (
    ("lat_deg", "lon_deg"),
    ("north_m", "east_m"),
    ("wind_speed_mps", "wind_angle_rad"),
    ("wind_u_mps", "wind_v_mps"),
)
PLACES = {"lat_deg", "lon_deg", "north_m", "east_m"}
LONGEST_STEP_S, SHORTEST_STEP_S = 1.0, 0.01
JITTER = 0.02  # share by which a usual interval may differ from the nearest round one
SAME = 1.5  # ratio of intervals within which two rates are the same
GAP = 3.5  # intervals without a reading that are a gap
LEAST_GAP_S = 1.5
SHORTEST = 10  # samples of a stretch
FASTEST_SHAFT_RPS = 100.0  # of thrusters of small craft; ships turn slower than 5
COVERED = 0.98  # share of a stretch that a column beside the main ones must cover
EARLY = 0.25  # share of a step by which a stamp may be late and the reading still belongs to that step
FAST = 20.0  # degrees between readings from which a way through north may be an average
EARTH_M = 6.371e6  # radius, for the few metres between antenna and midships
SENSORS_READ = (
    ("lat_deg", "lon_deg"), ("north_m", "east_m"), ("u_mps", "v_mps"), (SOG, COG), (NORTHWARD, EASTWARD),
    ("heading_rad",), (MAGNETIC,), ("r_radps",), ("wind_speed_mps", "wind_angle_rad"),
)  # fmt: skip
"""Columns of one sensor, which are read together."""
LOOKED_AT, EVEN = 20_000, 0.95
"""Samples from which it is told whether a log repeats readings, and share of their changes that must fit."""
NORTH_CLOSE = 80.0  # degrees between its ends, at most


class NothingToWrite(NoAnswer):
    """The logs hold nothing that makes a record."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretch:
    """Rows without a gap."""

    time_s: Array  # (k,) in even steps
    columns: Table[str, Array]  # (k,) by name

    def __len__(self) -> int:
        return len(self.time_s)

    def cut(self, part: slice) -> Stretch:
        """Consecutive rows."""
        return Stretch(time_s=self.time_s[part], columns={name: own[part] for name, own in self.columns.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampled:
    """All that was put on the common clock."""

    stretches: tuple[Stretch, ...]
    sample_time_s: float
    notes: tuple[str, ...]
    held_s: Table[str, float]  # column -> interval of a sensor that is read less often [s]
    channels: Table[str, Channel]  # column -> the readings that it was made from


def sampled(found: Table[str, Channel], mapping: Mapping) -> Sampled:
    """Columns on a common clock.

    Args:
        found: column -> channel in its unit, on one time scale.
        mapping: for the sample time, the variation and the antenna.

    Raises:
        NothingToWrite: there is neither a position nor a velocity, or no time that all main columns cover.
    """
    table, notes = dict(found), []
    for name in [name for name in table if _is_angle(name)]:
        table[name], bad = _without_north(table[name])
        if bad:
            notes.append(f"{name}: {bad} readings on the way through north were averages across it, and are left out")
    for step in (_own_readings, partial(_true_heading, mapping=mapping), partial(_ground_velocity, mapping=mapping)):
        table, more = step(table)
        notes += more
    for pair in PAIRS:
        if len(lone := set(pair) & set(table)) == 1:
            notes.append(f"{next(iter(lone))} is left out, as {next(iter(set(pair) - lone))} is missing")
            del table[lone.pop()]
    main = [name for name in table if name in MAIN or _is_input(name)]
    if not set(main) & (PLACES | {"u_mps", NORTHWARD}):
        raise NothingToWrite("the logs give neither positions nor velocities, expected one of them")
    notes += [
        f"{name} is up to {largest:.4g} revolutions per second, which is {60 * largest:.0f} rpm: is the channel in rpm "
        "(unit in the mapping)?"
        for name in main
        if name.endswith("_rps") and (largest := float(np.abs(table[name].values).max())) > FASTEST_SHAFT_RPS
    ]
    step_s = mapping.sample_time_s or _step(table)
    stretches = []
    for first, last in _covered([table[name] for name in main], step_s):
        times = _grid(table, first, last, step_s)
        if len(times) < SHORTEST:
            continue
        columns = {name: _resampled(name, table[name], times, step_s) for name in main}
        for name in table.keys() - set(main):
            if _covers(table[name], times, step_s):
                columns[name] = _resampled(name, table[name], times, step_s)
            else:
                notes.append(f"{name} does not cover all of a stretch, and is left out of it")
        stretches.append(Stretch(time_s=times, columns=_finished(columns, mapping)))
    if not stretches:
        ends = {name: table[name].time_s[[0, -1]] - _origin(table) for name in main}
        spans = "; ".join(f"{name} from {first:.0f} to {last:.0f} s" for name, (first, last) in ends.items())
        raise NothingToWrite(f"no stretch of {SHORTEST} samples is covered by all main columns: {spans}")
    held = {name: table[name].interval_s for name in table if table[name].interval_s > SAME * step_s}
    written = dict.fromkeys(name for stretch in stretches for name in stretch.columns if name in table)
    notes += _filled({name: table[name] for name in written}, stretches, step_s)
    notes += _left_out({name: table[name] for name in main}, step_s)
    return Sampled(
        stretches=tuple(stretches), sample_time_s=step_s, notes=tuple(dict.fromkeys(notes)), held_s=held, channels=table
    )  # fmt: skip


def _origin(table: Table[str, Channel]) -> float:
    return min(float(channel.time_s[0]) for channel in table.values())


def _is_input(name: str) -> bool:
    return is_input(input_name(name))


def _acts_on(name: str) -> bool:
    """Whether a reading, as an order does, acts until the next one."""
    return (_is_input(name) and not name.startswith(REACHED)) or name.startswith(PLANNED) or name in (STEERED, "batch")


def _is_angle(name: str) -> bool:
    return name in ("heading_rad", MAGNETIC, COG, "wind_angle_rad") or (input_name(name)[:1] == "a" and _is_input(name))


def _without_north(channel: Channel) -> tuple[Channel, int]:
    """The channel without readings that were averaged or interpolated the long way round, and their number.

    Such readings go from 359 to 1 degrees by 180: steps of one sense, each large, which together make nearly a turn.
    """
    degrees = np.degrees(channel.values) % 360.0
    steps = np.diff(degrees)
    if len(steps) and np.quantile(np.abs((steps + 180.0) % 360.0 - 180.0), 0.9) > FAST / 2.0:
        return channel, 0  # a course of a ship that lies still goes anywhere
    sense = np.sign(steps) * (np.abs(steps) > FAST)
    edges = np.flatnonzero(np.diff(sense)) + 1
    bad = np.zeros(len(degrees), dtype=bool)
    for part in np.split(np.arange(len(steps)), edges):
        if len(part) < 2 or not sense[part[0]]:
            continue
        total = float(degrees[part[-1] + 1] - degrees[part[0]])
        if 360.0 - abs(total) < NORTH_CLOSE:
            bad[part[1:]] = True
    if not bad.any():
        return channel, 0
    return replace(channel, time_s=channel.time_s[~bad], values=channel.values[~bad]), int(bad.sum())


def _own_readings(table: dict[str, Channel]) -> tuple[dict[str, Channel], list[str]]:
    """Channels of sensors that a log repeats from row to row, with each reading once, at the row where it is new."""
    notes = []
    for pair in SENSORS_READ:
        own = [table[name] for name in pair if name in table]
        if not own or len({len(channel) for channel in own}) > 1:
            continue
        how = held(np.column_stack([channel.values[:LOOKED_AT] for channel in own]))
        if how is None or how.interpolated or how.interval != round(how.interval):
            continue
        interval = round(how.interval)
        changes = np.flatnonzero(np.any([np.diff(channel.values) != 0 for channel in own], axis=0)) + 1
        counts = np.bincount(changes % interval, minlength=interval)
        if counts.max() < EVEN * len(changes):
            continue
        new = slice(int(counts.argmax()), None, interval)
        for channel in own:
            table[channel.name] = replace(channel, time_s=channel.time_s[new], values=channel.values[new])
        names = " and ".join(channel.name for channel in own)
        notes.append(f"{names}: the log repeats each reading in {interval} rows; it counts once, where it is new")
    return table, notes


def _true_heading(table: dict[str, Channel], mapping: Mapping) -> tuple[dict[str, Channel], list[str]]:
    """The heading from a magnetic one."""
    variation = table.pop(VARIATION, None)
    if MAGNETIC not in table:
        return table, []
    magnetic = table.pop(MAGNETIC)
    if "heading_rad" in table:
        return table, []
    if mapping.variation_deg is not None:
        east, words = np.radians(mapping.variation_deg), f"{mapping.variation_deg:g} degrees, as the mapping says"
    elif variation is not None:
        east = np.interp(magnetic.time_s, variation.time_s, variation.values)
        words = f"{np.degrees(np.median(variation.values)):.2g} degrees, as the log says"
    else:
        east, words = 0.0, ""
    heading = replace(magnetic, name="heading_rad", values=magnetic.values + east)
    note = (
        f"the heading is magnetic; the variation added is {words}"
        if words
        else "the heading is magnetic, and no variation is known: it stays magnetic (variation_deg in the mapping)"
    )
    return {**table, "heading_rad": heading}, [note]


def _ground_velocity(table: dict[str, Channel], mapping: Mapping) -> tuple[dict[str, Channel], list[str]]:
    """Velocity of midships in the ship's axes, from speed and course, unless it is measured so."""
    speed, course = table.pop(SOG, None), table.pop(COG, None)
    if len({"u_mps", "v_mps"} & set(table)) == 1 and (NORTHWARD in table or (speed is not None and course is not None)):
        (alone,) = {"u_mps", "v_mps"} & set(table)
        del table[alone]
        table, notes = _ground_velocity(
            {**table, **({} if speed is None or course is None else {SOG: speed, COG: course})}, mapping
        )
        return table, [f"{alone} alone is no velocity, and is left out", *notes]
    if {"u_mps", "v_mps"} <= set(table):
        for name in (NORTHWARD, EASTWARD):
            table.pop(name, None)
        return table, []
    if NORTHWARD not in table and speed is not None and course is not None and len(course) > 1:
        # at the times of the speed; the course of a ship that lies still is anything, and counts by her speed
        angle = np.interp(speed.time_s, course.time_s, np.unwrap(course.values))
        known = (speed.time_s >= course.time_s[0] - 1e-3) & (speed.time_s <= course.time_s[-1] + 1e-3)
        for name, part in ((NORTHWARD, np.cos(angle)), (EASTWARD, np.sin(angle))):
            table[name] = replace(speed, name=name, time_s=speed.time_s[known], values=(speed.values * part)[known])
    if NORTHWARD not in table or EASTWARD not in table:
        return table, []
    north, east = table.pop(NORTHWARD), table.pop(EASTWARD)
    if "heading_rad" not in table:
        return table, [
            "no heading is recorded: u and v cannot be had from speed and course, and course is not taken for heading"
        ]
    # at the readings' own times, so that a velocity that is read less often is one of the ship's axes then
    heading = table["heading_rad"]
    known = (north.time_s >= heading.time_s[0] - 1e-3) & (north.time_s <= heading.time_s[-1] + 1e-3)
    times = north.time_s[known]
    angle = np.interp(times, heading.time_s, np.unwrap(heading.values))
    ahead, right = north.values[known], np.interp(times, east.time_s, east.values)
    u, v = rotated((ahead, right), -angle)
    rate = np.interp(times, table["r_radps"].time_s, table["r_radps"].values) if "r_radps" in table else np.zeros(1)
    u, v = u + rate * mapping.antenna_starboard_m, v - rate * mapping.antenna_forward_m
    for name, values in (("u_mps", u), ("v_mps", v)):
        table[name] = replace(north, name=name, time_s=times, values=values)
    return table, [
        "u_mps and v_mps are the velocity over ground, from speed and course or north and east, in the ship's axes"
    ]


def _step(table: Table[str, Channel]) -> float:
    """The interval of the slowest main sensor, at most a second; positions beside velocities do not count."""
    without = PLACES if "u_mps" in table else set()
    own = [channel.interval_s for name, channel in table.items() if name in MAIN and name not in without]
    interval_s = max((value for value in own if value < math.inf), default=LONGEST_STEP_S)
    fastest_s = min(own, default=interval_s)
    if interval_s > LONGEST_STEP_S:
        interval_s = max(LONGEST_STEP_S, fastest_s)
    interval_s = max(interval_s, SHORTEST_STEP_S)
    rate = float(f"{interval_s:.1g}")  # of which stamps at reception differ by a little
    return rate if abs(interval_s / rate - 1.0) < JITTER else float(f"{interval_s:.4g}")


def _longest_gap_s(channel: Channel, step_s: float) -> float:
    """Time between readings up to which the samples between them are filled."""
    return max(GAP * channel.interval_s, GAP * step_s, LEAST_GAP_S)


def _filled(table: Table[str, Channel], stretches: Sequence[Stretch], step_s: float) -> list[str]:
    """Notes on columns that have no reading at some samples: how many, over which gaps, and what stands there."""
    times = np.concatenate([stretch.time_s for stretch in stretches])
    groups: dict[str, list[str]] = {}
    for name, channel in table.items():
        own = channel.time_s
        later = np.clip(np.searchsorted(own, times + 1e-3 * step_s, side="right"), 1, len(own) - 1)
        gaps = np.maximum(own[later], times) - own[later - 1]
        near = np.minimum(np.abs(times - own[later - 1]), np.abs(own[later] - times)) < 0.5 * step_s
        empty = ((gaps > SAME * step_s) | (times > own[-1])) & ~near & (times > own[0])
        if not empty.any():
            continue
        repeats = _acts_on(name) or channel.interval_s > SAME * step_s
        often = f"read every {channel.interval_s:.4g} s" if channel.interval_s > SAME * step_s else "missing in places"
        how = "the last reading is repeated in between" if repeats else "a straight line is drawn in between"
        most = f"over gaps of {gaps[empty].max():.3g} s at most, in {_percent(float(empty.mean()))} of the samples"
        groups.setdefault(f"{often}; {how}, {most}", []).append(name)
    return [f"{listed(names)} {'is' if len(names) == 1 else 'are'} {words}" for words, names in groups.items()]


def _percent(share: float) -> str:
    return f"{share:.0%}" if share >= 0.01 else f"{share:.1%}" if share >= 0.001 else "less than 0.1%"


def _left_out(main: Table[str, Channel], step_s: float) -> list[str]:
    """Notes on where a record ends for gaps that are too long to be filled, by the columns that have them."""
    groups: dict[tuple[float, ...], list[str]] = {}
    for name, channel in main.items():
        gaps = np.diff(channel.time_s)
        if len(long := gaps[gaps > _longest_gap_s(channel, step_s)]):
            groups.setdefault((len(long), float(long.min()), float(long.max())), []).append(name)
    notes = []
    for (count, shortest, longest), names in groups.items():
        shared = len(names) == len(main) > 1
        if shared and abs(shortest - RESTART_GAP_S) + abs(longest - RESTART_GAP_S) < 1e-3:
            continue  # put between files, or where a clock began anew, which is told there
        who = "all main columns" if shared else listed(names)
        size = f"{shortest:.3g} to {longest:.3g} s" if longest > 1.01 * shortest else f"{longest:.3g} s"
        gap = f"{count} gaps of {size}" if count > 1 else f"a gap of {size}"
        verb = "has" if len(names) == 1 else "have"
        notes.append(f"{who} {verb} {gap}, too long to be filled: the record is cut there")
    return notes


def _covered(channels: list[Channel], step_s: float) -> list[tuple[float, float]]:
    """Times that all channels cover without a gap."""
    spans = [(-np.inf, np.inf)]
    for channel in channels:
        cuts = np.flatnonzero(np.diff(channel.time_s) > _longest_gap_s(channel, step_s))
        begins, ends = channel.time_s[np.r_[0, cuts + 1]], channel.time_s[np.r_[cuts, len(channel) - 1]]
        own = list(zip(begins.tolist(), ends.tolist(), strict=True))
        spans = _crossed(spans, own)
    return [(first, last) for first, last in spans if np.isfinite([first, last]).all()]


def _crossed(one: list[tuple[float, float]], two: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Intersections of two lists of intervals in order."""
    found, i, j = [], 0, 0
    while i < len(one) and j < len(two):
        first, last = max(one[i][0], two[j][0]), min(one[i][1], two[j][1])
        if first < last:
            found.append((first, last))
        if one[i][1] < two[j][1]:
            i += 1
        else:
            j += 1
    return found


def _grid(table: Table[str, Channel], first: float, last: float, step_s: float) -> Array:
    """Even times, which meet the stamps of the slowest main sensor of about this rate."""
    main = [c for name, c in table.items() if name in MAIN and 1 / SAME < c.interval_s / step_s < SAME]
    start = first
    if main:
        stamps = max(main, key=lambda channel: channel.interval_s).time_s
        later = stamps[(stamps >= first - 1e-9) & (stamps <= last)]
        start = float(later[0]) if len(later) else first
    return np.asarray(start + step_s * np.arange(int((last - start) / step_s + 1e-6) + 1))


def _covers(channel: Channel, times: Array, step_s: float) -> bool:
    longest = _longest_gap_s(channel, step_s)
    place = np.clip(np.searchsorted(channel.time_s, times), 1, max(len(channel) - 1, 1))
    if len(channel) < 2:
        return False
    inside = (times >= channel.time_s[0] - step_s) & (times <= channel.time_s[-1] + longest)
    near = channel.time_s[place] - channel.time_s[place - 1] <= longest
    return float(np.mean(inside & (near | (times > channel.time_s[-1])))) >= COVERED


def _resampled(name: str, channel: Channel, times: Array, step_s: float) -> Array:
    """Values (k,) at even times."""
    own, values = channel.time_s, channel.values
    if _is_angle(name):
        values = np.unwrap(values)
    ratio = channel.interval_s / step_s
    parts = math.ceil(1.0 / max(ratio, 1e-4)) if ratio < 1.0 / SAME else 1
    shares = (np.arange(parts) + 0.5) / parts
    if _acts_on(name):
        shift = EARLY * min(channel.interval_s, step_s) if parts == 1 else 0.0
        at = np.zeros(1) if parts == 1 else shares
        found = np.zeros(len(times))
        for share in at:
            places = np.searchsorted(own, times + share * step_s + shift + 1e-9, side="right") - 1
            found += values[np.maximum(places, 0)]
        return np.asarray(found / len(at))
    if ratio > SAME:
        places = np.searchsorted(own, times + 1e-3 * step_s, side="right") - 1
        return np.asarray(values[np.maximum(places, 0)])
    if parts == 1:
        return np.interp(times, own, values)
    found = np.zeros(len(times))
    for share in shares:
        found += np.interp(times + (share - 0.5) * step_s, own, values)
    return found / parts


def _finished(columns: dict[str, Array], mapping: Mapping) -> dict[str, Array]:
    """The columns of our CSV: all three forces, positions of midships."""
    if forces := [name for name in FORCE_SIGNALS if name in columns]:
        columns |= {name: np.zeros(len(columns[forces[0]])) for name in FORCE_SIGNALS if name not in columns}
    ahead, beside = mapping.antenna_forward_m, mapping.antenna_starboard_m
    if not (ahead or beside) or "heading_rad" not in columns:
        return columns
    north, east = rotated((ahead, beside), columns["heading_rad"])
    if "lat_deg" in columns:
        columns["lon_deg"] = columns["lon_deg"] - np.degrees(east / EARTH_M) / np.cos(np.radians(columns["lat_deg"]))
        columns["lat_deg"] = columns["lat_deg"] - np.degrees(north / EARTH_M)
    elif "north_m" in columns:
        columns |= {"north_m": columns["north_m"] - north, "east_m": columns["east_m"] - east}
    return columns
