"""`expdesign monitor` of a ship with [roll]: lost stability is an alarm, another load after a port call is none."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from expdesign.monitoring import RollWatch, roll_learnt, roll_watched
from expdesign.roll import Run
from expdesign.saved import restored, saved
from expdesign.vessel import NOMINAL, Load
from expdesign.workflows import monitor
from expdesign.workflows.steps.watching import DAY
from rolling_ship import HIGH, ROLL_MODEL, loaded, measured, roll_model, trial, write_csv

SHIP = roll_model()
assert SHIP.pendulum is not None
PENDULUM = SHIP.pendulum
LOST = replace(
    SHIP,
    pendulum=replace(
        PENDULUM, parameters={**PENDULUM.parameters, "k": PENDULUM.parameters["k"] - 0.2 * PENDULUM.righting_nm}
    ),
)
"""The metacentric height is less by a fifth."""
SAMPLES = 2000
PIECE_S = SAMPLES * SHIP.sample_time_s


@cache
def piece(ship: str, load: Load, seed: int) -> Run:
    return measured({"same": SHIP, "lost": LOST}[ship], load, seed, SAMPLES)


def watched(pieces: list[tuple[str, Load, int]], *, called: int | None = None, mean_days: float = 60.0) -> RollWatch:
    """After two pieces of a reference and these, a port call ending in one of them."""
    now = RollWatch()
    for seed in (501, 502):
        now = roll_learnt(now, SHIP, [piece("same", NOMINAL, seed)])
    for number, (ship, load, seed) in enumerate(pieces):
        now = roll_watched(
            now, SHIP, [piece(ship, load, seed)], begin_s=number * PIECE_S, end_s=(number + 1) * PIECE_S,
            mean_time_s=mean_days * DAY, called=number == called,
        )  # fmt: skip
        now = restored(RollWatch, json.loads(json.dumps(saved(now))))
    return now


@pytest.mark.thorough
def test_false_alarms_keep_to_the_rate_asked() -> None:
    """One in a hundred pieces is asked for, so that two or more in ten have a chance of 0.4 %."""
    now = watched([("same", NOMINAL, seed) for seed in range(510, 520)], mean_days=100 * PIECE_S / DAY)
    assert now.judged_s >= 7 * PIECE_S
    assert len(now.alarms) <= 1


@pytest.mark.thorough
@pytest.mark.parametrize(("ship", "load", "cause"), [("lost", NOMINAL, "k"), ("same", HIGH, "load")])
def test_lost_stability_and_a_load_are_alarms_once(ship: str, load: Load, cause: str) -> None:
    now = watched([("same", NOMINAL, 521), *((ship, load, seed) for seed in (522, 523, 525))])
    (alarm,) = now.alarms
    assert alarm.causes == (cause,)
    assert alarm.settled
    assert PIECE_S <= alarm.since_s <= alarm.time_s <= 3 * PIECE_S
    before, after = alarm.righting_nm
    truth = loaded(LOST if ship == "lost" else SHIP, load).pendulum
    assert truth is not None
    assert after / before == pytest.approx(truth.righting_nm / PENDULUM.righting_nm, abs=0.03)


def test_a_load_after_a_port_call_is_told_and_no_alarm() -> None:
    now = watched([("same", NOMINAL, 521), *(("same", HIGH, seed) for seed in (522, 523, 525))], called=1)
    assert now.alarms == ()
    (event,) = now.events
    assert event.causes == ("load",)
    assert event.load is not None
    assert event.load[0] == pytest.approx(HIGH.mass_kg, rel=0.1)


@pytest.mark.thorough
def test_monitor_tells_lost_stability_from_files(tmp_path: Path) -> None:
    reference = write_csv(tmp_path / "reference.csv", trial(SHIP, NOMINAL, 531, samples=20800))
    data = [
        write_csv(tmp_path / f"{seed}.csv", trial(ship, NOMINAL, seed, samples=2500))
        for seed, ship in ((532, SHIP), (533, LOST))
    ]
    summary = monitor(data, tmp_path / "out", vessel=ROLL_MODEL, reference=[reference]).summary
    told = json.loads((tmp_path / "out" / "monitor.json").read_text())
    assert told["alarms"] == []
    (change,) = told["roll"]["changes"]
    assert (change["alarm"], list(change["causes"])) == (True, ["k"])
    assert summary["alarms"] == 1
    assert "She rolls otherwise since a time between" in (tmp_path / "out" / "monitor.html").read_text()
