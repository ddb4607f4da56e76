"""A ship on autopilot in a sea: what is said of her unchanged, how soon changes are found, and how they are named.

``python tests/benchmarks/monitoring_sea.py [--trials N]``: a ship sails N voyages in each of several cases, on
autopilot in a slight sea, beside a plain average of her steady speeds. ``--calm`` the same without waves; ``--seas``
and ``--cases`` those alone, of more seas than these; ``--white`` with no model of the noise within stretches;
``--seed`` with other numbers than those that constants were chosen on; ``--plain`` the plain average alone, which the
same voyages and a day of each unchanged ship show at equal rates of false alarms; ``--winds`` an unchanged ship in
winds that nobody measures, after a reference in a fresh one; with ``--measured`` a vane on board measures them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.diagnosis.data import has_wind
from expdesign.export.monitor_content import said_of_reference
from expdesign.monitoring import (
    AS_LIKELY,
    WHITE,
    Alarm,
    Change,
    Rules,
    State,
    calibrate,
    grams_and_noise,
    grams_of,
    stretch_length,
    threshold,
    watched_changes,
    watched_ship,
)
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel
from monitoring import DAY, HOUR, gone_on
from sea_case import (
    CALM,
    CASES,
    FRESH,
    NAMES,
    OTHER_SEAS,
    WINDS,
    WINDY_SEAS,
    Sea,
    Ship,
    relative_wind,
    sailed,
    vessel_file,
)

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
WITHIN = 1.96  # standard errors that 95 % of the sizes are to be within
STEADY_S = 120  # time without another set point from which speed counts as steady [s]
SPANS = 6  # of ten minutes in the hour that a plain average compares with the reference


def as_record(vessel: Vessel, table: np.ndarray) -> Record:
    """A voyage of `sailed` as a record."""
    column = dict(zip(NAMES, table.T[: len(NAMES)], strict=True))
    batch = Batch(
        name="voyage",
        sample_time_s=1.0,
        input_names=vessel.model.inputs,
        inputs=np.column_stack([column["n1_rps"], column["rudder1_rad"]]),
        velocity=np.column_stack([column["u_mps"], column["v_mps"], column["r_radps"]]),
        pose=np.column_stack([column["north_m"], column["east_m"], column["heading_rad"]]),
        wind=relative_wind(table),
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


def plain_average(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(k,) differences of hours of steady speeds from those of the reference, in standard errors by its spans.

    Hours begin every ten minutes; there is none of less than two steady spans.
    """
    hours = [after[first : first + SPANS] for first in range(max(len(after) - SPANS + 1, 1))]
    spread = before.std(ddof=1)
    apart = [
        (one.mean() - before.mean()) / spread / np.sqrt(1 / len(before) + 1 / len(one)) for one in hours if len(one) > 1
    ]
    return np.array(apart)


def sea_study(trials: int, seas: Sequence[tuple[str, Sea]], cases: Sequence[str], *, first: int, white: bool) -> None:
    """Statements about an unchanged ship, and delays and names of changes, after 4 hours of reference."""
    with tempfile.TemporaryDirectory() as folder:
        vessel = load_vessel(vessel_file(Path(folder) / "vessel.toml"))
    print(
        "| sea | case | voyages | alarms before | said of the reference | found | in an hour | median delay |"
        " named | or as likely | sizes in 95 % | bias, in std | left out | plain average beyond 4 std |"
        " beyond its largest unchanged | of these not by the watch |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for sea_name, sea in seas:
        seeds = range(trials)
        references = sailed([Ship()] * trials, 4 * HOUR, seeds=[10 * k + first for k in seeds], sea=sea)
        known, largest = [learnt(vessel, table, white=white) for table in references], np.nan
        for number, (case, changed) in enumerate(CASES.items()):
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
            largest = max(abs(row["plain"]) for row in rows) if case == "unchanged" else largest
            plain = np.abs([row["plain"] for row in rows])
            alone = sum(one > largest and not row["hour"] for one, row in zip(plain, rows, strict=True))
            print(
                f"| {sea_name} | {case} | {trials} | {sum(row['early'] for row in rows)} | "
                f"{sum(row['said'] for row in rows)} | {len(found)} | {counts[0]} | {delay} | {counts[1]} | "
                f"{counts[2]} | {inside} | {bias} | {left:.0f} % | {(plain > 4).sum()} | "
                f"{(plain > largest).sum()} of {largest:.1f} std | {alone} |",
                flush=True,
            )


def plain_study(trials: int, seas: Sequence[tuple[str, Sea]], cases: Sequence[str], *, first: int) -> None:
    """The plain average in the hour after a change, at the limit that a day of each unchanged ship does not pass."""
    print("| sea | case | voyages | beyond 4 std | beyond the largest of a day of each | in each voyage |")
    print("|---|---|---|---|---|---|")
    for name, sea in seas:
        seeds = np.arange(trials) * 10 + first
        references = [steady_ratios(one) for one in sailed([Ship()] * trials, 4 * HOUR, seeds=seeds.tolist(), sea=sea)]
        days = sailed([Ship()] * trials, DAY, seeds=(seeds + 9).tolist(), sea=sea)
        largest = [np.abs(plain_average(*pair)) for pair in zip(references, map(steady_ratios, days), strict=True)]
        limit = max(one.max() for one in largest)
        false = sum(int((np.diff(one > 4, prepend=False) & (one > 4)).sum()) for one in largest)
        print(f"| {name} | unchanged | {trials} | {false} times in {24 * trials} h | {limit:.2f} | |", flush=True)
        for number, (case, changed) in enumerate(CASES.items()):
            if case not in cases or case == "unchanged":
                continue
            own = (seeds + 1 + number).tolist()
            tables = sailed([changed] * trials, 3 * HOUR, seeds=own, sea=sea, since_s=HOUR)
            after = [steady_ratios(table[HOUR : 2 * HOUR]) for table in tables]
            far = [np.abs(plain_average(*pair)).max(initial=0.0) for pair in zip(references, after, strict=True)]
            told = ", ".join(f"{one:.1f}" for one in far)
            beyond = [sum(one > most for one in far) for most in (4.0, limit)]
            print(f"| {name} | {case} | {trials} | {beyond[0]} | {beyond[1]} | {told} |", flush=True)


def learnt(vessel: Vessel, table: np.ndarray, *, white: bool = False) -> tuple[Any, ...]:
    """Changes that are watched for, the noise and the calibration of a reference."""
    record = as_record(vessel, table)
    ship = watched_ship(vessel, record)
    changes, words = (
        watched_changes(ship, wind=has_wind(record)),
        {"begins_s": [0.0], "stretch_s": stretch_length(vessel.length_m)},
    )
    if white:
        grams, noise = grams_of(ship, record, changes, **words), WHITE
    else:
        grams, noise = grams_and_noise(ship, record, changes, **words)
    return changes, noise, calibrate(grams, changes=changes)


def wind_study(trials: int, *, first: int, measured: bool) -> None:
    """Alarms in 3 hours of an unchanged ship, after 4 hours of reference in a fresh wind."""
    with tempfile.TemporaryDirectory() as folder:
        vessel = load_vessel(vessel_file(Path(folder) / "vessel.toml"))
    seeds, ships = [10 * k + first for k in range(trials)], [Ship()] * trials
    fresh = Sea(wind=replace(FRESH, measured=measured))
    known = [learnt(vessel, table) for table in sailed(ships, 4 * HOUR, seeds=seeds, sea=fresh)]
    print(
        "| wind | voyages | with an alarm | that stands | of which a push is named, too | left out |\n"
        "|---|---|---|---|---|---|"
    )
    for number, (name, wind) in enumerate(WINDS.items()):
        own = [seed + 1 + number for seed in seeds]
        tables = sailed(ships, 3 * HOUR, seeds=own, sea=Sea(wind=replace(wind, measured=measured)), since_s=HOUR)
        rows = [sea_trial(vessel, table, table, one, "unchanged") for table, one in zip(tables, known, strict=True)]
        raised, alarms, pushes = (sum(row[key] for row in rows) for key in ("raised", "any", "push"))
        left = 100 * np.mean([row["left"] for row in rows])
        print(f"| {name} | {trials} | {raised} | {alarms} | {pushes} | {left:.0f} % |", flush=True)


def sea_trial(
    vessel: Vessel, reference: np.ndarray, table: np.ndarray, known: tuple[Any, ...], case: str
) -> dict[str, Any]:
    """What is said in one voyage whose ship changes after an hour."""
    changes, noise, calibration = known
    rules = Rules(limit=threshold(int(calibration.watched.sum()), 30.0 * DAY / calibration.stretch_s))
    record = as_record(vessel, table)
    if not noise.white:
        words = {"begins_s": [0.0], "stretch_s": calibration.stretch_s, "known": noise}
        _, noise = grams_and_noise(watched_ship(vessel, record), record, changes, **words)
    state, alarms = gone_on(
        State.begun(calibration, time_s=0.0), vessel, record, changes, calibration, rules, begin_s=0.0, noise=noise
    )
    alarms = alarms if state.alarm is None else [*alarms, state.alarm]
    gone = {alarm.time_s for alarm in alarms if alarm.withdrawn}
    raised, alarms = len({alarm.time_s for alarm in alarms}), [one for one in alarms if one.time_s not in gone]
    late = [alarm for alarm in alarms if alarm.time_s >= HOUR]
    last = [alarm for alarm in late if alarm.time_s == late[0].time_s][-1] if late else None
    names = names_of(last, changes) if last else []
    plain = plain_average(
        steady_ratios(reference), steady_ratios(table if case == "unchanged" else table[HOUR : 2 * HOUR])
    )
    return {
        "any": bool(alarms),
        "raised": raised > 0,
        "push": any(alarm.pushes for alarm in alarms),
        "early": any(alarm.time_s < HOUR for alarm in alarms),
        "said": bool(said_of_reference(calibration).any()),
        "delay": last.time_s - HOUR if last else None,
        "hour": bool(last and last.time_s <= 2 * HOUR),
        "named": bool(names and names[0] in EXPECTED[case]),
        "likely": bool(set(names) & set(EXPECTED[case])),
        "far": error_of(last, changes[last.change], case) if last and sized(last, changes, case) else None,
        "left": state.left_out_s / max(state.left_out_s + state.judged_s, 1.0),
        "plain": float(np.abs(plain).max(initial=0.0)),
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


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--calm", action="store_true", help="without waves")
    parser.add_argument("--white", action="store_true", help="without a model of the noise in stretches")
    every = {**dict(SEAS), "calm": CALM, **OTHER_SEAS, **WINDY_SEAS}
    parser.add_argument("--seas", nargs="+", choices=every)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--seed", type=int, default=5000, help="the first")
    parser.add_argument("--plain", action="store_true", help="the plain average of steady speeds alone")
    parser.add_argument("--winds", action="store_true", help="an unchanged ship in winds")
    parser.add_argument("--measured", action="store_true", help="which a vane on board measures")
    asked = parser.parse_args()
    if asked.winds:
        wind_study(asked.trials, first=asked.seed, measured=asked.measured)
        sys.exit()
    names = asked.seas or (["calm"] if asked.calm else [name for name, _ in SEAS])
    seas = [(name, every[name]) for name in names]
    if asked.plain:
        plain_study(asked.trials, seas, asked.cases, first=asked.seed)
    else:
        sea_study(asked.trials, seas, asked.cases, first=asked.seed, white=asked.white)
