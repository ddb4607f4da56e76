"""A ship in operation: how often alarms are false, how soon changes are found, and how they are named.

``python tests/benchmarks/monitoring.py [--trials N] [--days D]``: the tender sails ordinary voyages in a current that
wanders, with a mean of its own in each. The watch is calibrated on eight voyages of 2 hours. False alarms are counted
over D days of voyages of 12 hours each, at thresholds for one in 6 hours, one in a day and one in 30 days. Each change
is then made in N voyages of 3 hours, of which the first hour is without it. ``--year`` instead sends a year at 1 Hz
through the command, as a stream, and prints its time and its peak memory. ``--ports`` gives the ship another load in a
port call of eight hours in N voyages, and takes 5 % of its thrust an hour later. ``--weather`` sails N voyages of 6
hours in each of several weathers, most of them beyond the reference, in which time should not be judged. ``--sea``
sails N voyages of another ship in each of several cases, on autopilot in a slight sea, beside a plain average of her
steady speeds; ``--calm`` the same without waves; ``--seas`` and ``--cases`` those alone, of more seas than these;
``--white`` with no model of the noise within stretches; ``--seed`` with other numbers than those that constants were
chosen on.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.monitoring.evidence import STRETCH_S

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.export.monitor_page.content import said_of_reference
from expdesign.monitoring import (
    AS_LIKELY,
    WHITE,
    Alarm,
    Calibration,
    Change,
    Grams,
    Noise,
    Rules,
    State,
    calibrate,
    grams_and_noise,
    grams_of,
    joined,
    later_part,
    stretch_length,
    threshold,
    watch,
    watched_changes,
)
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel
from monitoring_case import TENDER, tender, voyage_csv, voyage_record
from sea_case import CALM, OTHER_SEAS, Sea, Ship, sailed, vessel_file
from sea_case import CASES as SEA_CASES
from sea_case import NAMES as SEA_COLUMNS

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
    ship, alarms, first = extended_model(vessel, record), list[Alarm](), 0

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
    ship = extended_model(vessel, references[0])
    changes = watched_changes(ship)
    parts = [
        grams_of(ship, reference, changes, begins_s=[3.0 * HOUR * number], stretch_s=STRETCH_S)
        for number, reference in enumerate(references)
    ]
    return changes, calibrate(joined(parts), load=np.array([change.load for change in changes]))


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


SEAS: tuple[tuple[str, Sea], ...] = (
    ("waves that sensors feel", Sea()),
    ("waves that push the ship", Sea(pushed_s=5.0)),
    ("waves that push her slowly", Sea(pushed_s=20.0)),
)
EXPECTED = {
    "unchanged": (),
    "thrust - 8 %": ("gain", "theta:X_nn"),
    "drag + 15 %": ("theta:X_uu",),
    "rudder + 2 degrees": ("offset:rudder",),
    "yaw rate times 0.97": ("gyro",),
    "mass + 12 %": ("inertia:u", "inertia:v", "inertia:r"),
    "wind in yaw over an hour": ("push:r",),
}
"""Effects that name each case; a push is one of the weather, which is not the ship's."""
WITHIN = 1.96
"""Standard errors that 95 % of the sizes are to be within."""
STEADY_S = 120
"""Time without another set point from which speed counts as steady [s]."""


def as_record(vessel: Vessel, table: np.ndarray) -> Record:
    """A voyage of `sailed` as a record."""
    column = dict(zip(SEA_COLUMNS, table.T, strict=True))
    batch = Batch(
        name="voyage",
        sample_time_s=1.0,
        input_names=vessel.model.inputs,
        inputs=np.column_stack([column["n1_rps"], column["rudder1_rad"]]),
        velocity=np.column_stack([column["u_mps"], column["v_mps"], column["r_radps"]]),
        pose=np.column_stack([column["north_m"], column["east_m"], column["heading_rad"]]),
    )
    return Record(batches=(batch,), notes=())


def steady_ratios(table: np.ndarray) -> np.ndarray:
    """Means of speed per propeller speed over spans of ten minutes, of seconds that are steady."""
    u, n, rudder = table[:, 4], table[:, 7], table[:, 8]
    moving = (np.abs(np.diff(n, prepend=n[0])) > 1e-3) | (
        np.abs(np.convolve(rudder, np.full(30, 1 / 30), "same")) > 0.05
    )
    steady = np.convolve(moving, np.ones(STEADY_S), "full")[: len(u)] < 0.5
    spans = [slice(begin, begin + 600) for begin in range(0, len(u) - 599, 600)]
    return np.array([(u[span] / n[span])[steady[span]].mean() for span in spans if steady[span].sum() > 60])


def sea_study(trials: int, seas: Sequence[tuple[str, Sea]], cases: Sequence[str], *, first: int, white: bool) -> None:
    """Statements about an unchanged ship, and delays and names of changes, after 4 hours of reference."""
    with tempfile.TemporaryDirectory() as folder:
        vessel = load_vessel(vessel_file(Path(folder) / "vessel.toml"))
    stretch_s = stretch_length(vessel.length_m)
    print(
        "| sea | case | voyages | alarms before | said of the reference | found | in an hour | median delay |"
        " named | or as likely | sizes in 95 % | bias, in std | left out | plain average beyond 4 std |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for sea_name, sea in seas:
        seeds = range(trials)
        references = sailed([Ship()] * trials, 4 * HOUR, seeds=[10 * k + first for k in seeds], sea=sea)
        known = []
        for table in references:
            record = as_record(vessel, table)
            ship = extended_model(vessel, record)
            changes = watched_changes(ship)
            words = {"begins_s": [0.0], "stretch_s": stretch_s}
            if white:
                grams, noise = grams_of(ship, record, changes, **words), WHITE
            else:
                grams, noise = grams_and_noise(ship, record, changes, **words)
            load = np.array([change.load for change in changes])
            known.append((changes, noise, calibrate(grams, load=load)))
        for number, (case, changed) in enumerate(SEA_CASES.items()):
            if case not in cases:
                continue
            tables = sailed(
                [changed] * trials, 3 * HOUR, seeds=[10 * k + first + 1 + number for k in seeds], sea=sea, since_s=HOUR
            )
            rows = [sea_trial(vessel, *one) for one in zip(references, tables, known, [case] * trials, strict=True)]
            found = [row for row in rows if row["delay"] is not None]
            delay = f"{np.median([row['delay'] for row in found]) / 60:.0f} min" if found else "-"
            counts = [sum(row[key] for row in rows) for key in ("hour", "named", "likely")]
            far = np.array([row["far"] for row in rows if row["far"] is not None])
            inside, bias = f"{(np.abs(far) < WITHIN).sum()} of {len(far)}", f"{far.mean():+.2f}" if len(far) else "-"
            left = 100 * np.mean([row["left"] for row in rows])
            print(
                f"| {sea_name} | {case} | {trials} | {sum(row['early'] for row in rows)} | "
                f"{sum(row['said'] for row in rows)} | {len(found)} | {counts[0]} | {delay} | {counts[1]} | "
                f"{counts[2]} | {inside} | {bias} | {left:.0f} % | {sum(row['plain'] for row in rows)} |",
                flush=True,
            )


def sea_trial(
    vessel: Vessel, reference: np.ndarray, table: np.ndarray, known: tuple[Any, ...], case: str
) -> dict[str, Any]:
    """What is said in one voyage whose ship changes after an hour."""
    changes, noise, calibration = known
    rules = Rules(limit=threshold(int(calibration.watched.sum()), 30.0 * DAY / calibration.stretch_s))
    record = as_record(vessel, table)
    if not noise.white:
        words = {"begins_s": [0.0], "stretch_s": calibration.stretch_s, "known": noise}
        _, noise = grams_and_noise(extended_model(vessel, record), record, changes, **words)
    state, alarms = gone_on(
        State.begun(calibration, time_s=0.0), vessel, record, changes, calibration, rules, begin_s=0.0, noise=noise
    )
    alarms = alarms if state.alarm is None else [*alarms, state.alarm]
    late = [alarm for alarm in alarms if alarm.time_s >= HOUR]
    last = [alarm for alarm in late if alarm.time_s == late[0].time_s][-1] if late else None
    names = names_of(last, changes) if last else []
    before, after = steady_ratios(reference), steady_ratios(table[HOUR : 2 * HOUR])
    spread = before.std(ddof=1) * np.sqrt(1 / len(before) + 1 / max(len(after), 1))
    plain = bool(len(after)) and abs(after.mean() - before.mean()) > 4 * spread
    return {
        "early": any(alarm.time_s < HOUR for alarm in alarms),
        "said": bool(said_of_reference(calibration).any()),
        "delay": last.time_s - HOUR if last else None,
        "hour": bool(last and last.time_s <= 2 * HOUR),
        "named": bool(names and names[0] in EXPECTED[case]),
        "likely": bool(set(names) & set(EXPECTED[case])),
        "far": error_of(last, changes[last.change], case) if last and sized(last, changes, case) else None,
        "left": state.left_out_s / max(state.left_out_s + state.judged_s, 1.0),
        "plain": plain,
    }


def names_of(alarm: Alarm, changes: tuple[Change, ...]) -> list[str]:
    """What an alarm says it may be: pushes that explain the data better, the change, and what explains them as well."""
    better = [f"push:{'uvr'[axis]}" for axis, gain in alarm.pushes if gain > AS_LIKELY]
    as_well = [f"push:{'uvr'[axis]}" for axis, gain in alarm.pushes if gain <= AS_LIKELY]
    return [*better, *(changes[k].effect for k in (alarm.change, *alarm.as_likely)), *as_well]


def sized(alarm: Alarm, changes: tuple[Change, ...], case: str) -> bool:
    """Whether the change that is named is the one that was made, so that its size may be judged."""
    return changes[alarm.change].effect in EXPECTED[case]


def error_of(alarm: Alarm, change: Change, case: str) -> float:
    """By how much a size was told too large, in its standard errors; below zero: too small."""
    true = true_size(change, case) / change.size
    return float((alarm.value - true) / alarm.std * np.sign(true))


def true_size(change: Change, case: str) -> float:
    """The size of a case in the unit of an effect."""
    share = {"gain": -0.08, "theta:X_nn": -0.08, "theta:X_uu": 0.15, "offset:rudder": np.deg2rad(2.0), "gyro": -0.03}
    size = share.get(change.effect, 0.12)
    return float(size * change.whole if change.effect.startswith("theta:") else size)


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
    parser.add_argument("--sea", action="store_true", help="another ship on autopilot in a slight sea")
    parser.add_argument("--calm", action="store_true", help="the same without waves")
    parser.add_argument("--white", action="store_true", help="of these, without a model of the noise in stretches")
    parser.add_argument("--weather", action="store_true", help="weathers beyond the reference")
    every = {**dict(SEAS), "calm": CALM, **OTHER_SEAS}
    parser.add_argument("--seas", nargs="+", choices=every, help="of --sea, these")
    parser.add_argument("--cases", nargs="+", choices=SEA_CASES, default=list(SEA_CASES), help="of --sea, these")
    parser.add_argument("--seed", type=int, default=5000, help="of --sea, the first")
    asked = parser.parse_args()
    if asked.sea or asked.calm or asked.seas:
        names = asked.seas or (["calm"] if asked.calm else [name for name, _ in SEAS])
        sea_study(
            asked.trials, [(name, every[name]) for name in names], asked.cases, first=asked.seed, white=asked.white
        )
    elif asked.weather:
        weathers(asked.trials)
    elif asked.year:
        year(asked.year)
    elif asked.ports:
        ports(asked.trials)
    else:
        study(asked.trials, asked.days)
