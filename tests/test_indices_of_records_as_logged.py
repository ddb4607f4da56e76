"""Measured indices are those of the motion, however the record begins, whatever the helm did before, at any rate."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.export.indices_form import IndicesContent
from expdesign.export.indices_page import indices_document
from expdesign.export.pages import document_html
from expdesign.indices import (
    Circle,
    NotStandard,
    Stop,
    ZigZag,
    criteria,
    judge,
    measured_trial,
    standard_results,
    with_drift_of_circles,
)
from expdesign.indices.criteria import Verdict
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch
from expdesign.simulation import Conduct, simulate, stopping, turning_circle, zigzag
from expdesign.simulation.standard_trials import Trial
from expdesign.vessel import Actuator, Limit, Response, Vessel
from logged_trials import (
    APPROACHES,
    FULL,
    LEAD,
    SHIP,
    SPEED,
    STEP,
    TEN,
    TWENTY,
    overshoots,
    record,
    sailed,
)
from measured_trials import TUG, TUG_TRUE, as_batch, quiet, write_run
from nomoto_ship import nomoto_ship
from sample_files import OUTSIDE, outside
from synthetic_ship import sail, vessel_file, write
from vessel_files import ESSO_WIND, KVLCC2, write_vessel


@pytest.mark.parametrize("interval", [1.0, 0.1])
@pytest.mark.parametrize("column", ["order", "reached"])
@pytest.mark.parametrize("orders_every", [STEP, 1.0])
def test_indices_of_orders_and_of_reached_angles_hold_within_the_stated_tolerance(
    interval: float, column: str, orders_every: float
) -> None:
    """Orders fall between samples (20 ms), or at samples as a simulation's do (1 s): those are found exactly."""
    rows, orders = sailed(TWENTY, TWENTY, orders_every_s=orders_every)
    found = measured_trial(SHIP, record(rows, interval, column))
    assert isinstance(found, ZigZag)
    error = np.abs(found.overshoots_rad - overshoots(rows, orders)[: len(found.overshoots_rad)])
    stated = np.array([order.tolerance_rad for order in found.executes[1 : len(error) + 1]])
    assert len(error) == 4
    assert (error <= stated + math.radians(0.01)).all()
    assert stated.max() == pytest.approx(interval * np.abs(rows[:, 6]).max(), rel=0.1)
    if (orders_every, column) == (1.0, "order"):
        assert [order.time_s for order in found.executes] == pytest.approx(orders)
        assert error.max() < math.radians(0.02)
    rows, (order,) = sailed(FULL, math.inf, orders_every_s=orders_every, seconds=120.0)
    circle = measured_trial(SHIP, record(rows, interval, column))
    assert isinstance(circle, Circle)
    quarter = rows[np.argmax(rows[:, 3] >= math.pi / 2), 1] - rows[round(order / STEP), 1]
    assert abs(circle.advance_m - quarter) <= circle.tolerance_m + 0.05
    assert circle.tolerance_m == pytest.approx(SPEED * interval, rel=0.01)


@pytest.mark.parametrize("vessel", [nomoto_ship(), nomoto_ship(helm_rate=math.inf), TUG_TRUE])
@pytest.mark.parametrize("interval", [1.0, 0.1])
@pytest.mark.parametrize("angle", [TEN, TWENTY])
def test_a_record_of_a_simulated_trial_agrees_with_it_within_the_tolerance(
    vessel: Vessel, interval: float, angle: float
) -> None:
    speed = 2.0 if vessel is TUG_TRUE else 7.0
    conduct = Conduct(speed_mps=speed, approach_s=60.0, sample_time_s=interval)
    expected = standard_results(vessel, speed_mps=speed, sides=("starboard",))
    zig = next(item for item in expected.zigzags if abs(item.helm_rad - angle) < 1e-9)
    trial = zigzag(vessel, heading_rad=angle, helm_rad=angle, conduct=conduct)
    found = measured_trial(vessel, as_batch(vessel, *trial))
    assert isinstance(found, ZigZag)
    assert found.remarks == ()
    error = np.abs(np.subtract(found.overshoots_rad, zig.overshoots_rad))
    assert (error <= [order.tolerance_rad for order in found.executes[1:]]).all()
    assert abs(found.initial_turning_m - zig.initial_turning_m) <= found.tolerance_m
    circle = measured_trial(vessel, as_batch(vessel, *turning_circle(vessel, conduct=conduct)))
    assert abs(circle.advance_m - expected.circles[0].advance_m) <= circle.tolerance_m
    assert circle.helm_rad == pytest.approx(expected.circles[0].helm_rad)


@pytest.mark.parametrize("approach", sorted(set(APPROACHES) - {"steady"}))
@pytest.mark.parametrize("angle", [TEN, TWENTY])
def test_steering_on_the_approach_is_no_order_and_is_not_subtracted(approach: str, angle: float) -> None:
    """From rest under a wandering helm, with 3.5 degrees held against wind, or with 23 degrees to get on course."""
    rows, orders = sailed(angle, angle, seconds=360.0, approach=approach)
    found = measured_trial(SHIP, record(rows, 0.1))
    assert isinstance(found, ZigZag)
    assert [order.time_s for order in found.executes] == pytest.approx(orders, abs=0.1)
    assert found.helm_rad == pytest.approx(angle)
    steady = "the approach is not steady" in " ".join(found.remarks)
    assert steady == (approach == "from rest")
    circle, _ = sailed(angle, math.inf, seconds=360.0, approach=approach)
    found = measured_trial(SHIP, record(circle, 0.1, "reached"))
    assert isinstance(found, Circle)
    assert found.helm_rad == pytest.approx(angle)
    assert abs(found.advance_m - measured_trial(SHIP, record(circle, 0.1)).advance_m) < 2 * found.tolerance_m


@pytest.mark.parametrize("reversals", [0, 1, 2])
def test_a_zigzag_that_begins_with_the_helm_over_gives_overshoots_from_its_second_reversal_on(reversals: int) -> None:
    """A 30/30 zig-zag of eleven reversals."""
    thirty = math.radians(30)
    rows, orders = sailed(thirty, thirty, seconds=790.0)
    assert len(orders) == 12
    begin = round(orders[reversals]) + 5.0
    found = measured_trial(SHIP, record(rows, 1.0, first_s=begin))
    assert isinstance(found, ZigZag)
    assert len(found.executes) == 11 - reversals
    count = len(found.overshoots_rad)
    assert count >= 9 - reversals
    true = overshoots(rows, orders)[reversals + 1 :][:count]
    stated = np.array([order.tolerance_rad for order in found.executes[1 : count + 1]])
    assert (np.abs(found.overshoots_rad - true) <= stated).all()
    assert (found.side, found.speed_mps, found.initial_turning_m) == ("", None, None)
    assert judge((found,), length_m=50.0) == ()
    assert "approach course and speed and the numbers of the overshoots cannot be had" in found.remarks[0]


def test_a_circle_that_begins_with_the_helm_over_gives_its_steady_diameter_alone() -> None:
    rows, _ = sailed(FULL, math.inf, seconds=320.0)
    whole = measured_trial(SHIP, record(rows, 1.0))
    for begin in (LEAD + 10.0, LEAD + 60.0):
        found = measured_trial(SHIP, record(rows, 1.0, first_s=begin))
        assert isinstance(found, Circle)
        assert found.steady_diameter_m == pytest.approx(whole.steady_diameter_m, rel=2e-3)
        known = (found.speed_mps, found.advance_m, found.transfer_m, found.tactical_diameter_m, found.initial_turning_m)
        assert known == (None,) * 5
        assert "which count from the order, cannot be had" in found.remarks[0]
    short = measured_trial(SHIP, record(rows[: round(110 / STEP)], 1.0, first_s=LEAD + 10.0))
    assert isinstance(short, NotStandard)
    assert short.reason.startswith("the record begins with the helm over and turns by ")
    straight, _ = sailed(TEN, math.inf, seconds=58.0, approach="against wind")
    assert "the helm stays at 3.5 deg" in measured_trial(SHIP, record(straight, 1.0)).reason


def in_current(batch: Batch, north_mps: float, east_mps: float) -> Batch:
    """The record of the same ship in water that moves over ground."""
    assert batch.pose is not None
    flow, heading = np.array([north_mps, east_mps]), batch.pose[:, 2]
    pose, velocity = np.array(batch.pose), np.array(batch.velocity)
    pose[:, :2] += batch.time_s[:, np.newaxis] * flow
    c, s = np.cos(heading), np.sin(heading)
    velocity[:, :2] += np.stack([c * flow[0] + s * flow[1], c * flow[1] - s * flow[0]], axis=1)
    return replace(batch, pose=pose, velocity=velocity)


@pytest.mark.parametrize("seconds", [90.0, 130.0, 150.0])
def test_a_current_that_a_circle_is_too_short_to_show_is_told_with_what_it_does(seconds: float) -> None:
    calm = record(sailed(FULL, math.inf, seconds=seconds)[0], 0.5)
    flow = (0.3, -0.4)
    still, moving = measured_trial(SHIP, calm), measured_trial(SHIP, in_current(calm, *flow))
    assert isinstance(still, Circle)
    assert isinstance(moving, Circle)
    told = [remark for remark in moving.remarks if remark.startswith("no current is taken out of advance")]
    assert bool(told) == (moving.current_north_mps is None)
    if not told:
        assert (moving.current_north_mps, moving.current_east_mps) == pytest.approx(flow, abs=0.02)
        return
    assert still.remarks == moving.remarks  # in still water nobody knows it either
    shift = float(told[0].split()[-2]) * math.hypot(*flow) / 0.1
    for one, other in (
        (still.advance_m, moving.advance_m),
        (still.tactical_diameter_m, moving.tactical_diameter_m),
    ):
        if one is not None and other is not None:
            assert abs(one - other) < 1.05 * shift
    if still.tactical_diameter_m is not None and moving.tactical_diameter_m is not None:
        assert abs(still.tactical_diameter_m - moving.tactical_diameter_m) > 0.3 * shift


def test_zigzags_in_the_current_of_a_circle_are_told_to_be_over_ground() -> None:
    """Speed over ground decides their limits, and initial turning is counted over ground."""
    batches = [record(sailed(TEN, TEN)[0], 0.5), record(sailed(FULL, math.inf, seconds=260.0)[0], 0.5)]
    flow = (0.3, -0.4)
    still = with_drift_of_circles([measured_trial(SHIP, batch) for batch in batches])
    moving = with_drift_of_circles([measured_trial(SHIP, in_current(batch, *flow)) for batch in batches])
    zigzag, circle = moving
    assert not [remark for one in (*still, circle) for remark in one.remarks if "over ground" in remark]
    (told,) = [remark for remark in zigzag.remarks if "over ground" in remark]
    drift = float(re.search(r"drift by ([\d.]+) m/s", told)[1])
    assert drift == pytest.approx(math.hypot(*flow), abs=0.02)
    assert abs(zigzag.speed_mps - still[0].speed_mps) == pytest.approx(0.3, abs=0.02)  # it sails north
    assert zigzag.overshoots_rad == pytest.approx(still[0].overshoots_rad)


def test_helm_let_go_ends_a_trial_and_a_second_trial_is_refused() -> None:
    rows, orders = sailed(TWENTY, TWENTY, seconds=190.0)
    cut = np.array(rows)
    cut[round((orders[-1] + 20) / STEP) :, 7] = 0.0
    whole, part = (measured_trial(SHIP, record(item, 1.0)) for item in (rows, cut))
    assert len(whole.overshoots_rad) == len(part.overshoots_rad) == len(orders) - 1
    early = np.array(rows)
    early[round((orders[-1] + 5) / STEP) :, 7] = 0.0  # before the last overshoot is complete
    assert len(measured_trial(SHIP, record(early, 1.0)).overshoots_rad) == len(orders) - 2
    twice, _ = sailed(FULL, math.inf, seconds=320.0)
    twice = np.array(twice)
    twice[round(150 / STEP) : round(200 / STEP), 7] = 0.0
    assert "expected one trial in a file" in measured_trial(SHIP, record(twice, 1.0)).reason


@pytest.mark.parametrize("late", [False, True])
def test_circles_to_both_sides_are_no_zigzag_of_many_turns(late: bool) -> None:
    rows, _ = sailed(FULL, 2.0 * math.pi, seconds=900.0)
    both = record(np.array(rows)[round(40 / STEP) if late else 0 :], 1.0)
    found = measured_trial(SHIP, both)
    assert isinstance(found, NotStandard)
    assert "expected 90.0 deg or less in a zig-zag: are these turning circles?" in found.reason


@pytest.mark.parametrize("angle", [TEN, TWENTY])
@pytest.mark.parametrize("seed", range(3))
def test_noise_on_the_rudder_reading_makes_no_orders(angle: float, seed: int) -> None:
    """Half a degree, about helm held against wind on the approach, at the angles of the trial, and during a stop."""
    rng = np.random.default_rng(seed)
    rows, orders = sailed(angle, angle, seconds=360.0, approach="against wind")
    batch = record(rows, 1.0, "reached")
    noisy = replace(
        batch, inputs=batch.inputs + np.stack([np.zeros(360), rng.normal(0, math.radians(0.5), 360)], axis=1)
    )
    found = measured_trial(SHIP, noisy)
    assert isinstance(found, ZigZag)
    assert [order.time_s for order in found.executes] == pytest.approx(orders, abs=2.0)
    ship = nomoto_ship(sample_time_s=1.0)
    commands, trial = stopping(ship, conduct=Conduct(speed_mps=7.0, approach_s=30.0, duration_s=600.0))
    stop = as_batch(ship, commands, trial)
    helm = np.array(stop.inputs)
    helm[:, 1] = rng.normal(math.radians(3.5), math.radians(0.5), len(helm))
    assert isinstance(measured_trial(ship, replace(stop, inputs=helm)), Stop)


@pytest.mark.parametrize(("ahead_s", "stops"), [(0, True), (120, True), (900, False)])
def test_a_stop_after_which_the_ship_sails_on_is_more_than_one_trial(ahead_s: int, stops: bool) -> None:
    """A whole day of trials was judged by the first seconds of it, in which the engines happened to stop."""
    ship = nomoto_ship(sample_time_s=1.0)
    commands, stop = stopping(ship, conduct=Conduct(speed_mps=7.0, approach_s=30.0, duration_s=600.0))
    values = np.concatenate([commands.values, np.repeat(commands.values[:1], ahead_s, axis=0)])
    commands = replace(commands, values=values)
    found = measured_trial(ship, as_batch(ship, commands, simulate(ship, commands, velocity=tuple(stop.velocity[0]))))
    assert isinstance(found, Stop) == stops
    if not stops:
        assert "one trial in a file" in found.reason


@pytest.mark.parametrize("earlier", [1.0, 0.6, 1.4])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_change_to_the_speed_of_the_approach_is_no_order_to_stop(earlier: float, noise: float) -> None:
    """Its track reach counted from there."""
    ship = nomoto_ship(sample_time_s=1.0)
    commands, stop = stopping(ship, conduct=Conduct(speed_mps=7.0, approach_s=60.0, duration_s=600.0))
    batch = as_batch(ship, commands, stop)
    expected = measured_trial(ship, batch)
    orders = np.array(batch.inputs)
    orders[:20, 0] *= earlier
    orders[:, 0] *= 1.0 + noise * np.random.default_rng(0).standard_normal(len(orders))
    found = measured_trial(ship, replace(batch, inputs=orders))
    assert isinstance(expected, Stop)
    assert isinstance(found, Stop)
    assert abs(found.track_reach_m - expected.track_reach_m) <= 2 * expected.tolerance_m


@pytest.mark.parametrize("trial", [zigzag, turning_circle])
@pytest.mark.parametrize("way", ["helm alone", "shafts slow down", "engines ordered anew", "tunnel thruster"])
def test_turns_that_something_else_drives_are_no_standard_trials(trial: Callable[..., Trial], way: str) -> None:
    """A run of thrusters in every direction was judged as a turning circle, by the mean of its azimuths."""
    ship = nomoto_ship(sample_time_s=1.0)
    bow = Actuator(
        kind="tunnel", number=2, forward_m=30.0, limits=(Limit(low=-5.0, high=5.0),), responses=(Response(),)
    )
    angles = {} if trial is turning_circle else {"heading_rad": TWENTY, "helm_rad": TWENTY}
    batch = as_batch(ship, *trial(ship, conduct=Conduct(speed_mps=7.0, approach_s=60.0), **angles))
    inputs = np.column_stack([batch.inputs, np.zeros(len(batch))])
    late = np.arange(len(batch)) > 80
    if way == "shafts slow down":
        inputs[late, 0] *= 0.7
    if way == "engines ordered anew":
        inputs[late, 0] *= 0.3
    if way == "tunnel thruster":
        inputs[late, 2] = -3.0
    ship = replace(ship, model=replace(ship.model, actuators=(*ship.model.actuators, bow)))
    found = measured_trial(ship, replace(batch, input_names=(*batch.input_names, "n2"), inputs=inputs))
    assert isinstance(found, NotStandard) == (way in ("engines ordered anew", "tunnel thruster"))
    if isinstance(found, NotStandard):
        assert found.reason.startswith("the engine order" if "engines" in way else "the tunnel thruster n2")


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("heading", [TWENTY, math.inf])
@pytest.mark.parametrize("first", [0.0, LEAD + 10.0])
def test_a_rudder_recorded_with_the_other_sign_is_asked_about(sense: float, heading: float, first: float) -> None:
    vessel = replace(nomoto_ship(sense=sense), length_m=50.0)
    rows, _ = sailed(TWENTY, heading, seconds=400.0)
    found = measured_trial(vessel, record(rows, 1.0, first_s=first))
    assert any("is the sign of the recorded helm right?" in remark for remark in found.remarks) == (sense < 0)


@pytest.mark.parametrize(("value", "met"), [(23.9, True), (24.1, None), (25.9, None), (26.1, False)])
def test_a_verdict_is_open_where_the_limit_is_within_the_tolerance(value: float, met: bool | None) -> None:
    limit = next(row for row in criteria(50.0, 4.0) if row.key == "overshoot_20_20_rad")
    angles = math.radians(value), math.radians(1.0)
    assert Verdict(criterion=limit, run="", side="", value=angles[0], tolerance=angles[1]).met is met


def test_only_reversals_near_the_nominal_heading_give_an_index_with_a_criterion() -> None:
    rows, orders = sailed(TWENTY, TWENTY)
    found = measured_trial(SHIP, record(rows, 0.1))
    assert [v.criterion.key for v in judge((found,), length_m=50.0)] == ["overshoot_20_20_rad"]
    late, second = replace(found.executes[1], heading_rad=math.radians(22.5)), found.executes[2]
    moved = replace(found, executes=(found.executes[0], late, second, *found.executes[3:]))
    assert judge((moved,), length_m=50.0) == ()
    assert len(orders) == 5


def test_the_distance_to_ten_degrees_of_heading_is_not_given_where_the_helm_is_reversed_before() -> None:
    five = math.radians(5)
    rows, _ = sailed(TEN, five, seconds=120.0)
    assert measured_trial(SHIP, record(rows, 0.1)).initial_turning_m is None
    rows, (order, *_) = sailed(TEN, TEN)
    (first, last) = round(order / STEP), int(np.argmax(rows[:, 3] >= TEN))
    way = np.hypot(*np.diff(rows[first : last + 1, 1:3], axis=0).T).sum()
    assert measured_trial(SHIP, record(rows, 0.1)).initial_turning_m == pytest.approx(way, abs=SPEED * 0.1)


def content(found: tuple[object, ...]) -> IndicesContent:
    return IndicesContent(
        vessel=SHIP, scale=1.0, simulated=standard_results(nomoto_ship(), speed_mps=7.0), simulated_why_not="",
        measured=found, notes=("log.csv: odd",),
    )  # fmt: skip


def test_counts_are_of_what_they_say_and_every_remark_is_on_the_page() -> None:
    wide = Circle(
        name="wide", side="port", helm_rad=0.6, speed_mps=4.0, advance_m=226.0, transfer_m=1.0,
        tactical_diameter_m=251.0, initial_turning_m=1.0, steady_diameter_m=None, tolerance_m=4.0,
    )  # fmt: skip
    refused = NotStandard(name="odd", reason="no helm")
    form = content((wide, refused))
    assert form.counted("measured") == {"met": 0, "not met": 1, "open": 1}
    simulated = [verdict.met for source, verdict in form.verdicts if source == "simulated"]
    assert form.counted("simulated") == {"met": simulated.count(True), "not met": simulated.count(False)}
    assert form.remarks[0] == ("odd", "no result: no helm")
    assert ("simulation", "is at 7 m/s, the runs at 4 m/s: --speed-mps makes them alike") in form.remarks
    page = document_html(indices_document(form))
    assert "Measured results beside their criteria: 0 met, 1 not met, 1 open." in page
    assert all(remark in page for _, remark in form.remarks)


def test_the_terminal_counts_apart_and_says_why_a_run_gives_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ship = quiet(TUG_TRUE)
    commands, trial = turning_circle(ship, turn_rad=1.0, conduct=Conduct(speed_mps=2.0, approach_s=40.0))
    path = write_run(tmp_path / "short.csv", ship, commands, velocity=tuple(trial.velocity[0]))
    given = ["indices", str(path), "--vessel", str(TUG), "--out", str(tmp_path / "out")]
    assert main([*given, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)["summary"]
    assert (summary["measured_runs"], summary["measured_runs_without_result"]) == (1, 1)
    assert (summary["measured_criteria_met"], summary["measured_criteria_not_met"]) == (0, 0)
    rows = json.loads((tmp_path / "out" / "indices.json").read_text())["verdicts"]
    assert {row["source"] for row in rows} == {"simulated"}
    assert summary["simulated_criteria_met"] == sum(row["met"] is True for row in rows)
    assert main(given) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "short.csv: no result: one helm order, and the heading changes by" in printed
    assert "Measured results beside their criteria: none." in printed


POND = sorted(path.name for path in OUTSIDE.glob("esso-osaka-3m/*.csv") if path.stem.startswith(("zigzag", "turn")))


@pytest.mark.outside
@pytest.mark.parametrize("name", POND)
def test_pond_trials_are_read_whatever_the_helm_did_before(name: str, tmp_path: Path) -> None:
    """A plain reading: the first sample of every stretch over which an order beyond 10 degrees stands for 6 s."""
    vessel = load_vessel(write_vessel(tmp_path / "esso.toml", ESSO_WIND))
    (batch,) = load_records([outside(f"esso-osaka-3m/{name}")], vessel_inputs=("n1", "rudder1")).batches
    rudder = batch.inputs[:, 1]
    cuts = [0, *np.flatnonzero(np.abs(np.diff(rudder)) > 1e-3) + 1, len(rudder)]
    held = [a for a, b in pairwise(cuts) if b - a > 60 and abs(rudder[a]) > TEN]
    found = measured_trial(vessel, batch)
    if name.startswith("turn"):
        assert isinstance(found, Circle)
        assert found.helm_rad == pytest.approx(abs(rudder[held[0]]), abs=1e-3)
        assert len(held) == 1
    else:
        assert isinstance(found, ZigZag)
        times = [order.time_s for order in found.executes]
        assert times == pytest.approx([a * batch.sample_time_s for a in held][: len(times)], abs=0.11)
        assert found.helm_rad == pytest.approx(np.mean(np.abs(rudder[held])), abs=0.01)


@pytest.mark.outside
def test_tank_zigzags_cut_short_give_the_later_overshoots_of_the_whole(tmp_path: Path) -> None:
    vessel = load_vessel(write_vessel(tmp_path / "kvlcc2.toml", KVLCC2))
    path = outside("kvlcc2-hsva-7m/zigzag_30_05.csv")
    (batch,) = load_records([path], vessel_inputs=("n1", "rudder1")).batches
    whole, late = (measured_trial(vessel, part) for part in (batch, batch.cut(slice(80, None))))
    assert late.overshoots_rad == pytest.approx(whole.overshoots_rad[1:], abs=math.radians(0.02))


@pytest.mark.outside
def test_field_records_that_begin_late_give_what_the_whole_ones_give() -> None:
    """Noise of 0.17 degrees on the heading; the same trials with other noise."""
    field = outside("field")
    ship = load_vessel(field / "rudder-rate" / "ship-truth.toml")

    def read(name: str) -> ZigZag | Circle:
        return measured_trial(ship, load_records([field / name], vessel_inputs=ship.model.inputs).batches[0])

    whole, late = read("rudder-rate/zz20.csv"), read("no-approach/zz20-noapproach.csv")
    assert late.overshoots_rad == pytest.approx(whole.overshoots_rad[1:], abs=math.radians(1.0))
    assert read("rudder-rate/zz20-act.csv").overshoots_rad == pytest.approx(whole.overshoots_rad, abs=math.radians(0.1))
    circles = read("rudder-rate/tc35.csv"), read("no-approach/tc35-late.csv")
    assert circles[1].steady_diameter_m == pytest.approx(circles[0].steady_diameter_m, rel=0.01)


def test_inputs_that_never_move_are_noted_where_something_is_estimated_and_not_by_indices(tmp_path: Path) -> None:
    """Every standard trial holds the engines; a page of indices said of each that effects cannot be estimated."""
    data = write(tmp_path / "trial.csv", sail(np.column_stack([np.full(300, 3.0), np.repeat([0.0, 0.5], [60, 240])])))
    ship = vessel_file(tmp_path / "ship.toml")
    said = {}
    for command, more in (("indices", []), ("estimate", ["--fixed", "X_nn", "X_uu", "--method", "ls"])):
        call = [command, str(data), "--vessel", str(ship), "--out", str(tmp_path / command), *more]
        assert main([*call, "--quiet"]) == 0
        said[command] = (tmp_path / command / f"{command}.html").read_text(encoding="utf-8")
    assert "in all rows" in said["estimate"]
    assert "in all rows" not in said["indices"]
    assert "advance" in said["indices"]
