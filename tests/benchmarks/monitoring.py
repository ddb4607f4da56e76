"""A ship in operation: how often alarms are false, how soon changes are found, and how they are named.

``python tests/benchmarks/monitoring.py [--trials N] [--days D]``: the tender sails ordinary voyages in a current that
wanders, with a mean of its own in each. The watch is calibrated on eight voyages of 2 hours. False alarms are counted
over D days of voyages of 12 hours each, at thresholds for one in 6 hours, one in a day and one in 30 days. Each change
is then made in N voyages of 3 hours, of which the first hour is without it. ``--year`` instead sends a year at 1 Hz
through the command, as a stream, and prints its time and its peak memory. ``--ports`` gives the ship another load in a
port call of eight hours in N voyages, and takes 5 % of its thrust an hour later. ``--weather`` sails N voyages of 6
hours in each of several weathers, most of them beyond the reference, in which time should not be judged. A ship on
autopilot in a sea is sailed by ``monitoring_sea.py``.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.monitoring.evidence import STRETCH_S

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.monitoring import (
    WHITE,
    Alarm,
    Calibration,
    Change,
    Grams,
    Noise,
    Rules,
    State,
    calibrate,
    grams_of,
    joined,
    later_part,
    threshold,
    watch,
    watched_changes,
    watched_ship,
)
from expdesign.signals import Record
from expdesign.vessel import Vessel
from monitoring_case import TENDER, tender, voyage_csv, voyage_record

HOUR, DAY = 3600, 86400


def heavier(vessel: Vessel, equation: str, factor: float) -> Vessel:
    """More inertia in one equation: all its terms act less."""
    model = vessel.model
    values = {
        term.name: value / factor
        for term, value in zip(model.terms, model.parameters.tolist(), strict=True)
        if term.equation == equation
    }
    return replace(vessel, model=model.with_parameters(values))


def weaker(vessel: Vessel, factor: float) -> Vessel:
    """Less thrust."""
    values = {name: factor * v for name, v in zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True)}
    return replace(
        vessel, model=vessel.model.with_parameters({name: values[name] for name in values if name.endswith("_mu")})
    )


def gyro(vessel: Vessel, scale: float) -> Vessel:
    """A wrong scale of the yaw rate."""
    return replace(vessel, sensors=replace(vessel.sensors, yaw_rate_scale=scale))


CASES: tuple[tuple[str, str, float, Callable[[Vessel], Vessel]], ...] = (
    ("damping in yaw + 10 %", "theta:N_r", 0.1, lambda v: tender(N_r=1.1)),
    ("damping in yaw + 3 %", "theta:N_r", 0.03, lambda v: tender(N_r=1.03)),
    ("drag + 10 %", "theta:X_abs_u_u", 0.1, lambda v: tender(X_abs_u_u=1.1)),
    ("damping in sway + 10 %", "theta:Y_v", 0.1, lambda v: tender(Y_v=1.1)),
    ("yaw by drift + 20 %", "theta:N_uv", 0.2, lambda v: tender(N_uv=1.2)),
    ("thrust - 5 %", "gain", -0.05, lambda v: weaker(v, 0.95)),
    ("inertia in yaw + 10 %", "inertia:r", 0.1, lambda v: heavier(v, "r", 1.1)),
    ("inertia in surge + 20 %", "inertia:u", 0.2, lambda v: heavier(v, "u", 1.2)),
    ("scale of yaw rate 0.97", "gyro", -0.03, lambda v: gyro(v, 0.97)),
)
"""Name, effect, its size in the effect's unit (of parameters as a share), and the changed ship."""


def watched(
    vessel: Vessel, record: Record, changes: tuple[Change, ...], calibration: Calibration, limit: float
) -> tuple[State, list[Alarm]]:
    """A record watched from its beginning."""
    state, alarms = gone_on(
        State.begun(calibration, time_s=0.0), vessel, record, changes, calibration, Rules(limit=limit), begin_s=0.0
    )
    return state, alarms if state.alarm is None else [*alarms, state.alarm]


def gone_on(
    state: State,
    vessel: Vessel,
    record: Record,
    changes: tuple[Change, ...],
    calibration: Calibration,
    rules: Rules,
    *,
    begin_s: float,
    noise: Noise = WHITE,
) -> tuple[State, list[Alarm]]:
    """A record watched from a state on, linearised anew after each change, and the alarms in it."""
    ship, alarms, first = watched_ship(vessel, record), list[Alarm](), 0

    def linearised(shift: np.ndarray, since_s: float = begin_s) -> Grams:
        effects = {c.effect: c.size * x for c, x in zip(changes, shift.tolist(), strict=True) if x}
        part, begins_s = later_part(record, [begin_s], since_s, calibration.stretch_s)
        words = {"begins_s": begins_s, "stretch_s": calibration.stretch_s, "noise": noise}
        return grams_of(ship.with_effects(effects), part, changes, **words)

    grams = linearised(state.shift)
    while first < len(grams):
        part = grams.part(slice(first, None))
        state, more, _, used = watch(calibration, state, part, rules=rules, again=linearised)
        alarms, first = [*alarms, *more], first + used
        if first < len(grams):
            grams = linearised(state.shift)
    return state, alarms


def loaded(vessel: Vessel, inertia: float, hull: float) -> Vessel:
    """Another load: more inertia, and more damping of the deeper hull."""
    model = vessel.model
    values = {
        term.name: value * (hull if term.name in ("X_u", "X_abs_u_u", "Y_v", "N_r", "N_uv") else 1.0) / inertia
        for term, value in zip(model.terms, model.parameters.tolist(), strict=True)
        if term.name not in ("X_vr", "Y_ur")
    }
    return replace(vessel, model=model.with_parameters(values))


LOADS: tuple[tuple[str, Callable[[Vessel], Vessel]], ...] = (
    ("the same load", lambda v: v),
    ("inertia + 12 %", lambda v: loaded(v, 1.12, 1.0)),
    ("inertia + 25 %", lambda v: loaded(v, 1.25, 1.0)),
    ("inertia - 20 %", lambda v: loaded(v, 0.8, 1.0)),
    ("inertia + 15 %, damping + 8 %", lambda v: loaded(v, 1.15, 1.08)),
)


def ports(trials: int) -> None:
    """Alarms after a port call that brought another load, and after thrust is lost an hour later."""
    vessel = tender()
    changes, calibration = calibrated(vessel)
    rules = Rules(limit=threshold(int(calibration.watched.sum()), 30.0 * DAY / STRETCH_S), port_s=6.0 * HOUR)
    print("| load | trials | alarms | without port calls | thrust - 5 % found | named first |")
    print("|---|---|---|---|---|---|")
    for name, with_load in LOADS:
        rows = [called(vessel, with_load(vessel), seed, changes, calibration, rules) for seed in range(trials)]
        print(
            f"| {name} | {trials} | " + " | ".join(str(sum(row[k] for row in rows)) for k in range(4)) + " |",
            flush=True,
        )


def called(
    vessel: Vessel, other: Vessel, seed: int, changes: tuple[Change, ...], calibration: Calibration, rules: Rules
) -> tuple[bool, bool, bool, bool]:
    """Alarm after a port call, alarm where it is not taken for one, loss of thrust found afterwards, and named."""
    before = voyage_record(vessel, HOUR, seed=3 * seed + 9000)
    after = voyage_record(other, HOUR, seed=3 * seed + 9001)
    weak = voyage_record(weaker(other, 0.95), HOUR, seed=3 * seed + 9002)
    state, _ = gone_on(State.begun(calibration, time_s=0.0), vessel, before, changes, calibration, rules, begin_s=0.0)
    plain = gone_on(state, vessel, after, changes, calibration, replace(rules, port_s=np.inf), begin_s=9.0 * HOUR)[1]
    state, false = gone_on(state, vessel, after, changes, calibration, rules, begin_s=9.0 * HOUR)
    _, found = gone_on(state, vessel, weak, changes, calibration, rules, begin_s=10.0 * HOUR)
    effects = [changes[alarm.change].effect for alarm in found]
    return bool(false), bool(plain), bool(found), bool(found) and effects[-1] == "gain"


WEATHERS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("as in the reference", {}),
    ("currents twice as strong", {"stronger": 2.0}),
    ("currents five times as strong", {"stronger": 5.0}),
    ("currents ten times as strong", {"stronger": 10.0}),
    ("twice as strong at once after 3 h", {"stronger": 2.0, "since": 3 * HOUR}),
    ("five times as strong at once after 3 h", {"stronger": 5.0, "since": 3 * HOUR}),
    ("swell of 0.05 m/s in sway", {"swell_mps": 0.05}),
    ("swell of 0.2 m/s in sway", {"swell_mps": 0.2}),
    ("swell of 0.5 m/s in sway", {"swell_mps": 0.5}),
)


def weathers(trials: int) -> None:
    """Voyages with a false alarm, and time that is not judged, at one false alarm in 30 days."""
    vessel = tender()
    changes, calibration = calibrated(vessel)
    limit = threshold(int(calibration.watched.sum()), 30.0 * DAY / STRETCH_S)
    print("| weather | voyages of 6 h | with a false alarm | not judged |")
    print("|---|---|---|---|")
    for name, weather in WEATHERS:
        rows = [
            watched(vessel, voyage_record(vessel, 6 * HOUR, seed=7000 + seed, **weather), changes, calibration, limit)
            for seed in range(trials)
        ]
        alarms = sum(bool(found) for _, found in rows)
        left, judged = (sum(getattr(state, key) for state, _ in rows) for key in ("left_out", "judged"))
        print(f"| {name} | {trials} | {alarms} | {100.0 * left / (left + judged):.0f} % |", flush=True)


def calibrated(vessel: Vessel) -> tuple[tuple[Change, ...], Calibration]:
    """Changes that are watched for, and a calibration on voyages of two hours."""
    references = [voyage_record(vessel, 2 * HOUR, seed=500 + number) for number in range(8)]
    ship = watched_ship(vessel, references[0])
    changes = watched_changes(ship)
    parts = [
        grams_of(ship, reference, changes, begins_s=[3.0 * HOUR * number], stretch_s=STRETCH_S)
        for number, reference in enumerate(references)
    ]
    return changes, calibrate(joined(parts), changes=changes)


def study(trials: int, days: float) -> None:
    """False alarms, then changes."""
    vessel = tender()
    changes, calibration = calibrated(vessel)
    number = int(calibration.watched.sum())
    voyages = max(1, round(days * 2))
    limits = {between: threshold(number, between * DAY / STRETCH_S) for between in (0.25, 1.0, 30.0)}
    false = dict.fromkeys(limits, 0)
    for seed in range(voyages):
        record = voyage_record(vessel, 12 * HOUR, seed=1000 + seed)
        for between, limit in limits.items():
            found = watched(vessel, record, changes, calibration, limit)[1]
            false[between] += len({alarm.time_s for alarm in found})
    print(f"{number} changes are watched for.\n")
    print("| at most one false alarm in | days | alarms | allowed |")
    print("|---|---|---|---|")
    for between, count in false.items():
        print(f"| {between:g} d | {voyages / 2:g} | {count} | {voyages / 2 / between:.1f} |")
    print("\n| change | found | median delay | named first | or as likely | size within 2 std | false before |")
    print("|---|---|---|---|---|---|---|")
    effects = [change.effect for change in changes]
    for name, effect, share, changed in CASES:
        change = changes[effects.index(effect)]
        true = share * change.unit[0] / 0.01 if effect.startswith("theta:") else share
        rows = [
            trial(vessel, changed(vessel), seed, changes, calibration, limits[30.0], effects.index(effect), true)
            for seed in range(trials)
        ]
        hits = [row for row in rows if row[0] is not None]
        delay = float(np.median([row[0] for row in hits])) / 60.0 if hits else float("nan")
        first, likely, close = (sum(row[place] for row in hits) for place in (1, 2, 3))
        print(
            f"| {name} | {len(hits)} of {trials} | {delay:.0f} min | {first} | {likely} | {close} "
            f"| {sum(row[4] for row in rows)} |",
            flush=True,
        )


def trial(
    vessel: Vessel,
    true: Vessel,
    seed: int,
    changes: tuple[Change, ...],
    calibration: Calibration,
    limit: float,
    number: int,
    size: float,
) -> tuple[float | None, bool, bool, bool, bool]:
    """Delay [s], named first, named or as likely, size right, and whether there was an alarm before the change."""
    before = voyage_record(vessel, HOUR, seed=2 * seed)
    after = voyage_record(true, 2 * HOUR, seed=2 * seed + 1)
    _, early = watched(vessel, before, changes, calibration, limit)
    _, alarms = watched(vessel, after, changes, calibration, limit)
    if not alarms:
        return None, False, False, False, bool(early)
    first = alarms[0].time_s
    alarm = [item for item in alarms if item.time_s == first][-1]
    named = alarm.change == number
    close = named and abs(alarm.value * changes[number].size - size) < 2.0 * alarm.std * changes[number].size
    return first, named, named or number in alarm.as_likely, close, bool(early)


def year(days: int) -> None:
    """A year at 1 Hz as a stream: a day's voyage again and again, with times that go on."""
    with tempfile.TemporaryDirectory() as folder:
        reference = voyage_csv(Path(folder) / "reference.csv", tender(), 12 * HOUR, seed=0)
        day = voyage_csv(Path(folder) / "day.csv", tender(), DAY, seed=1)
        header, *rows = day.read_text().splitlines(keepends=True)
        ends = [row[row.index(",") :] for row in rows]
        words = ["monitor", "-", "--vessel", str(TENDER), "--reference", str(reference), "--out", f"{folder}/out"]
        began = time.perf_counter()
        with subprocess.Popen(
            [sys.executable, "-m", "expdesign", *words, "--every-s", "21600", "--quiet"],
            stdin=subprocess.PIPE,
            text=True,
        ) as process:
            assert process.stdin is not None
            process.stdin.write(header)
            for block in blocks(ends, days):
                process.stdin.write(block)
            process.stdin.close()
            process.wait()
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds, processor = time.perf_counter() - began, usage.ru_utime + usage.ru_stime
        print(
            f"{days} days, {days * DAY} rows: {seconds:.0f} s, {processor:.0f} s of processor time, "
            f"{usage.ru_maxrss / 1024:.0f} MiB, status {process.returncode}"
        )


def blocks(ends: list[str], days: int) -> Iterator[str]:
    """The text of each day."""
    for number in range(days):
        begin = number * len(ends)
        yield "".join(f"{begin + index}{end}" for index, end in enumerate(ends))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--days", type=float, default=30.0)
    parser.add_argument("--year", type=int, nargs="?", const=365, help="days of it")
    parser.add_argument("--ports", action="store_true", help="loads that change in port")
    parser.add_argument("--weather", action="store_true", help="weathers beyond the reference")
    asked = parser.parse_args()
    if asked.weather:
        weathers(asked.trials)
    elif asked.year:
        year(asked.year)
    elif asked.ports:
        ports(asked.trials)
    else:
        study(asked.trials, asked.days)
