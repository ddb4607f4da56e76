"""A ship in service as files tell it: shoals, loads, stops, clocks, broken streams, and what a diagnosis takes over.

``python tests/benchmarks/monitoring_service.py [STUDY ...] [--trials N] [--seed FIRST] [--rows N]``: each of N ships
sails four hours of reference and an hour unchanged in a slight sea that pushes her, and then a voyage of her own for
every case, all by the simulation that the tests own (`sea_case`). Files go through the commands, so that what is
counted is what a user is told.

shoal: from 60 m into 6 m of depth, where drag and inertia grow. load: another load, at sea. stops: an hour at rest or
without data, with and without another load, and less thrust later. clocks: a clock that is put back or ahead.
resumed: a stream that breaks off and goes on from its own log. handed: what `diagnose` tests first in the rows since a
change, and how wide it takes the prior.
"""

from __future__ import annotations

import argparse
import io
import json
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.cli import main
from expdesign.diagnosis.motion import stable_windows
from expdesign.diagnosis.select import Suspected, suspected_tests
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.kinematics import in_stated_time
from expdesign.workflows.commands.diagnose import with_alarms
from expdesign.workflows.steps.measured import equipped, measured
from monitoring_sea import EXPECTED, WITHIN
from sea_case import CASES, HOUR, Sea, Ship, sailed, vessel_file, written

SEA = Sea(pushed_s=5.0)
BEGIN_S = HOUR + 60  # of every voyage, on the clock of the hour before
DEEP_M, SHOAL_M, SHOALING_S = 60.0, 6.0, 600  # of a draught of 3 m
SHOALED = Ship(drag=1.4, mass=1.2)
LOADED = Ship(drag=1.08, mass=1.2)
STOP_S = (1200, 1200 + HOUR + 30)
CORRECTIONS_S = (-2.0, -0.4, 0.4, -30.0)
MANY = "one cause may change several"
Told = dict[str, Any]


class Service:
    """Ships with a watch that has seen the reference and an hour, in a folder."""

    def __init__(self, folder: Path, trials: int, first: int) -> None:
        self.folder, self.seeds = folder, [1000 * k + first for k in range(trials)]
        self.vessel = vessel_file(folder / "vessel.toml")
        hours = [self.sailed(Ship(), length * HOUR, number) for number, length in ((0, 4), (1, 1))]
        self.states = []
        for k, (reference, hour) in enumerate(zip(*hours, strict=True)):
            known, same = written(folder / "known.csv", reference), written(folder / "same.csv", hour)
            self.told(same, "--reference", known)
            self.states.append(Path(shutil.copy(folder / "out" / "monitor-state.json", folder / f"state-{k}.json")))

    def sailed(self, ship: Ship, seconds: int, number: int, **words: Any) -> list[np.ndarray]:
        """Voyages of all ships; every study has numbers of its own from the seeds of the ships."""
        seeds = [seed + number for seed in self.seeds]
        return [*sailed([ship] * len(seeds), seconds, seeds=seeds, sea=SEA, **words)]

    def told(self, *words: object, stream: str = "", into: str = "out") -> Told:
        """What `monitor` writes; its page is not drawn."""
        out = self.folder / into
        asked = [*map(str, words), "--vessel", str(self.vessel), "--out", str(out), "--jobs", "1", "--quiet"]
        page = mock.patch("expdesign.workflows.commands.monitor.document_html", return_value="")
        with page, mock.patch("sys.stdin", io.StringIO(stream)), redirect_stdout(io.StringIO()):
            status = main(["monitor", *asked])
        assert status == 0, asked
        return dict(json.loads((out / "monitor.json").read_text(encoding="utf-8")))

    def resumed(self, k: int, *words: object, stream: str = "", into: str = "out") -> Told:
        """What `monitor` writes that goes on from the state of a ship."""
        (self.folder / into).mkdir(exist_ok=True)
        shutil.copy(self.states[k], self.folder / into / "monitor-state.json")
        return self.told(*words, "--resume", stream=stream, into=into)

    def watched(self, tables: list[np.ndarray], change: Callable[[str], str] = str) -> Iterator[Told]:
        """What is told of each voyage, whose text may be changed."""
        for k, table in enumerate(tables):
            path = written(self.folder / "voyage.csv", table, begin_s=BEGIN_S)
            path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
            yield self.resumed(k, path)


def with_depth(text: str) -> str:
    """A voyage with the depth of a water that shoals."""
    header, *rows = text.splitlines()
    depth = np.interp(np.arange(len(rows)), [0, SHOALING_S], [DEEP_M, SHOAL_M])
    told = [f"{row},{value:.2f}" for row, value in zip(rows, depth.tolist(), strict=True)]
    return "\n".join([f"{header},depth_m", *told]) + "\n"


def summary(rows: list[Told], *words: str) -> str:
    """Voyages with an alarm, the largest number of alarms and of names in a voyage, and sentences with words."""
    names = [len({name for one in row["alarms"] for name in (one["effect"], *one["as_likely"])}) for row in rows]
    alarms = [len(row["alarms"]) for row in rows]
    said = [sum(any(one in sentence for sentence in row["verdict"]) for row in rows) for one in words]
    texts = "".join(f"; {one!r} in {count}" for one, count in zip(words, said, strict=True))
    few = f", {max(alarms)} and {max(names)} names at most" * any(alarms)
    return f"an alarm in {sum(map(bool, alarms))} of {len(rows)}{few}{texts}"


def loads_told(rows: list[Told], mass: float) -> str:
    """How often another load is told as likely or likelier than one change, and whether its size holds."""
    told = [one["as_likely_load"] for row in rows for one in row["alarms"][:1] if one["as_likely_load"]]
    inside = sum(abs(one["value"] - mass) < WITHIN * one["std"] for one in told)
    return f"; another load told in {len(told)}, as likelier in {sum(one['likelier'] for one in told)}, inside {inside}"


def shoal(service: Service) -> Iterator[tuple[str, str]]:
    tables = service.sailed(SHOALED, 2 * HOUR, 10, over_s=SHOALING_S)
    rows = list(service.watched(tables, with_depth))
    yield "6 m of water, depth measured", summary(rows, "the measured depth_m is less")
    rows = list(service.watched(tables))
    yield "6 m of water, depth not measured", summary(rows, MANY) + loads_told(rows, 0.2)


def load(service: Service) -> Iterator[tuple[str, str]]:
    cases = {"mass + 20 %, drag + 8 %": LOADED, "mass + 12 %": CASES["mass + 12 %"], "unchanged": Ship()}
    for number, (name, ship) in enumerate(cases.items()):
        rows = list(service.watched(service.sailed(ship, 2 * HOUR, 20 + number)))
        yield f"{name} at sea", summary(rows, MANY) + loads_told(rows, ship.mass - 1.0)


def stops(service: Service) -> Iterator[tuple[str, str]]:
    for name, ship in (("another load", LOADED), ("the same load", Ship())):
        kept = service.sailed(ship, 3 * HOUR, 30, moored_s=STOP_S, since_s=STOP_S[0])
        gaps = [np.delete(table, np.s_[slice(*STOP_S)], axis=0) for table in kept]
        for how, tables in (("at rest", kept), ("without data", gaps)):
            rows = list(service.watched(tables))
            calls = sum(len(row["port_calls"]) == 1 for row in rows)
            told = summary(rows, "the same load afterwards", "another load afterwards")
            yield f"an hour {how}, {name}", f"one port call in {calls}; {told}"
    laden = service.sailed(LOADED, 3 * HOUR, 30, moored_s=STOP_S, since_s=STOP_S[0])
    weaker = service.sailed(replace(LOADED, thrust=0.92), 3 * HOUR, 31)
    late, later_s = [], BEGIN_S + 3 * HOUR + 60
    for k, tables in enumerate(zip(laden, weaker, strict=True)):
        path = written(service.folder / "voyage.csv", tables[0], begin_s=BEGIN_S)
        after = written(service.folder / "after.csv", tables[1], begin_s=later_s)
        late.append(service.resumed(k, path, after)["alarms"])
    found = [one[-1] for one in late if one and one[-1]["time_s"] > later_s]
    right = sum(bool({one["effect"], *one["as_likely"]} & {*EXPECTED["thrust - 8 %"]}) for one in found)
    soon, early = sum(one["time_s"] < later_s + HOUR for one in found), sum(map(len, late)) - len(found)
    told = f"found in {len(found)} of {len(late)}, {soon} in an hour, {right} as thrust; other alarms {early}"
    yield "another load in an hour at rest, later thrust - 8 %", told


def clocks(service: Service) -> Iterator[tuple[str, str]]:
    tables = service.sailed(Ship(), 3 * HOUR // 2, 40)
    plain = [row["judged_h"] for row in service.watched(tables)]
    for correction_s in CORRECTIONS_S:
        moved = [table.copy() for table in tables]
        for table in moved:
            table[HOUR // 2 :, 0] += correction_s
        rows = list(service.watched(moved))
        apart = max(abs(row["judged_h"] - known) for row, known in zip(rows, plain, strict=True))
        calls = sum(bool(row["port_calls"]) for row in rows)
        way = "back" if correction_s < 0 else "ahead"
        told = f"{summary(rows)}; port calls in {calls}; judged time {60 * apart:.1f} min apart at most"
        yield f"a clock put {way} by {abs(correction_s):g} s", told


def resumed(service: Service) -> Iterator[tuple[str, str]]:
    same = dict.fromkeys(("hours", "alarms", "last sums"), 0)
    tables = service.sailed(CASES["thrust - 8 %"], 2 * HOUR, 50)
    for k, table in enumerate(tables):
        path = written(service.folder / "log.csv", table, begin_s=BEGIN_S)
        header, *lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        every = header + "".join(lines)
        whole = service.resumed(k, "-", "--every-s", 900, stream=every, into="whole")
        cut = int(np.random.default_rng([service.seeds[k], 3]).integers(600, len(lines) - 600))
        part = header + "".join(lines[:cut])
        service.resumed(k, "-", "--every-s", 900, stream=part, into="parts")
        # the log holds what the stream brought and more; then the stream begins anew with all of it
        service.told(path, "--resume", into="parts")
        parts = service.told("-", "--resume", "--every-s", 900, stream=every, into="parts")
        same["hours"] += abs(parts["judged_h"] - whole["judged_h"]) < 1e-6
        alarms = [[(one["effect"], one["time_s"]) for one in told["alarms"]] for told in (whole, parts)]
        same["alarms"] += alarms[0] == alarms[1]
        last = [[*told["history"][-1].values()] for told in (whole, parts)]
        same["last sums"] += np.allclose(*last, rtol=1e-6)
    yield "a stream that broke off, thrust - 8 %", f"of {len(tables)} the same: {same}"


def handed(service: Service) -> Iterator[tuple[str, str]]:
    for number, case in enumerate(("rudder + 2 degrees", "thrust - 8 %", "drag + 15 %")):
        counts = dict.fromkeys(("an alarm", "the right one", "taken over", "prior as wide", "shown"), 0)
        for told in service.watched(service.sailed(CASES[case], HOUR, 60 + number)):
            if not told["alarms"]:
                continue
            alarm = told["alarms"][-1]
            tests, prior = taken_over(service)
            counts["an alarm"] += 1
            counts["the right one"] += alarm["effect"] in EXPECTED[case]
            counts["taken over"] += [one.effect for one in tests] == [alarm["effect"]]
            counts["prior as wide"] += prior is None or prior >= abs(alarm["value"]) * (1 - 1e-9)
            counts["shown"] += any(one.confirmed for one in tests)
        yield f"handed over, {case}", ", ".join(f"{name} {count}" for name, count in counts.items())


def taken_over(service: Service) -> tuple[tuple[Suspected, ...], float | None]:
    """What `diagnose` tests first in the rows that a watch left, and the standard deviation it gives a parameter."""
    rows = [service.folder / "out" / "since-change.csv"]
    ship, told = equipped(service.vessel, rows)
    ship, named = with_alarms(ship, rows)
    record = in_stated_time(measured(rows, ship, velocity="auto", told=told), ship.sensors)
    extended = extended_model(ship, record)
    tests = suspected_tests(extended, stable_windows(extended, record), [*named])
    parameter = next(iter(named)).removeprefix("theta:")
    own = dict(zip(ship.model.names, ship.model.parameter_std.tolist(), strict=True))
    return tests, own.get(parameter)


STUDIES = {"shoal": shoal, "load": load, "stops": stops, "clocks": clocks, "resumed": resumed, "handed": handed}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--rows", type=int, help="only so many of each study, the first")
    asked = parser.parse_args()
    print("| case | found | processor s |\n|---|---|---|")
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        service = Service(Path(folder), asked.trials, asked.seed)
        for study in asked.studies or STUDIES:
            for case, text in islice(STUDIES[study](service), asked.rows):
                print(f"| {case} | {text} | {time.process_time() - begun:.0f} |", flush=True)
                begun = time.process_time()
