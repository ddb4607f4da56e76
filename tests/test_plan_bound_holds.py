"""The bound on repositioning time: closed forms where there are some, and below everything that can be done."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest
import shapely

from expdesign.plan import PlanSettings
from expdesign.plan.bounds.displacement import (
    Displacement,
    Headway,
    _deviation_adrift_m,
    displacement_of,
    exit_motion,
)
from expdesign.plan.bounds.repositioning import (
    _grown,
    cheapest_orders,
    least_losses,
    reposition_bound_s,
    time_to_sail_s,
)
from expdesign.plan.control.acceleration_limits import LegEnd, SpeedChanges, least_loss, leg_end
from expdesign.plan.control.ships import capability
from expdesign.plan.legs import LegTask
from expdesign.plan.legs.water import leg_speed_mps, through_water
from expdesign.plan.values import UnderWay
from expdesign.signals import Commands
from expdesign.simulation import CALM, Environment, simulate, to_body
from expdesign.vessel import NUMPY
from plan_case import area, at_rest, find_leg, leg_water, primitive, random_path, ship

OPEN = shapely.box(-1000, -1000, 1000, 1000)
WALL = shapely.box(-10, -1000, 10, 300)
ENDS = (np.array([0.0, -200.0, 0.0]), np.array([0.0, 200.0, 0.0]))
STILL = Headway(speed_mps=1.0, current_to=np.zeros(2))  # a metre takes a second


def steady(speed_mps: float, rate_mps2: float, top_mps: float) -> LegEnd:
    """An end of a leg where speed changes at one rate, whatever the commands."""
    rates = np.full((1, 7), rate_mps2)
    changes = SpeedChanges(
        edges_mps=np.linspace(0, top_mps, 8), until_s=np.array([np.inf]), faster_mps2=rates, slower_mps2=rates
    )
    return LegEnd(slowest_mps=speed_mps, fastest_mps=speed_mps, inputs=None, changes=changes)


def to_sail(water, displacements, repeats, ends=ENDS, margin_m=5.0) -> float:
    return time_to_sail_s(area(water), margin_m, displacements, repeats, ends, STILL, 0.5)


def test_open_water_leaves_the_straight_line_less_the_chords():
    run = Displacement(chord_s=30.0, path_s=80.0, deviation_m=20.0)
    assert to_sail(OPEN, {"run": run}, {"run": 3}) == pytest.approx(400 - 90, abs=1e-6)
    assert to_sail(OPEN, {}, {}) == pytest.approx(400, abs=1e-6)


def test_round_a_wall_the_path_is_the_shortest_one():
    detour = 2 * np.hypot(305, 195) + 2 * 5 + 10  # at most: corners rounded at 5 m are cut off
    found = to_sail(OPEN.difference(WALL), {}, {})
    assert 0.99 * detour < found <= detour


def test_a_run_whose_chord_crosses_the_wall_may_not_be_counted_by_its_chord():
    # a run round the wall: 20 m from side to side, but 700 m of path, 300 m from the chord
    around = Displacement(chord_s=20.0, path_s=700.0, deviation_m=300.0)
    string = to_sail(OPEN.difference(WALL), {}, {})
    found = to_sail(OPEN.difference(WALL), {"run": around}, {"run": 1})
    assert found == pytest.approx(max(string - 700, 400 - 20), abs=30)
    assert found <= string - 20


def test_a_straight_run_makes_good_its_length_and_does_not_deviate():
    run, speed = primitive(ship()), 1.3
    found = displacement_of(ship(), run, CALM, Headway(speed_mps=speed, current_to=np.zeros(2)))
    length = np.hypot(*(run.trajectory.pose[-1] - run.trajectory.pose[0])[:2])
    assert found.chord_s == pytest.approx(length / speed)
    assert found.chord_s == pytest.approx(found.path_s)
    assert found.deviation_m < 0.01 * length


@pytest.mark.parametrize("speed", [1.3, 0.6])  # faster than the run, and slower
def test_what_a_run_is_credited_with_in_a_current_is_the_most_over_all_headings(speed):
    run, current = primitive(ship()), np.array([0.3, 0.4])
    headway = Headway(speed_mps=speed, current_to=current)
    found = displacement_of(ship(), run, Environment(current_to=current), headway)
    heading = np.linspace(-np.pi, np.pi, 3601)
    track = run.trajectory.pose[:, :2]
    length = np.hypot(*(track[-1] - track[0]))
    ground = length * np.stack([np.cos(heading), np.sin(heading)], axis=1) + current * run.duration_s
    assert found.chord_s == pytest.approx(headway.seconds(ground).max(), rel=1e-5)
    assert found.path_s >= found.chord_s - 1e-9


def test_the_least_time_in_a_current_makes_good_the_step_and_obeys_the_triangle_inequality():
    rng = np.random.default_rng(0)
    ground, more = rng.normal(size=(2, 500, 2))
    for current in rng.uniform(-0.6, 0.6, (5, 2)):
        headway = Headway(speed_mps=1.0, current_to=current)
        seconds = headway.seconds(ground)
        np.testing.assert_allclose(np.hypot(*(ground - seconds[:, None] * current).T), seconds)
        assert (headway.seconds(ground + more) <= seconds + headway.seconds(more) + 1e-12).all()


def test_no_point_of_a_drifting_runs_chord_exceeds_its_deviation():
    run = primitive(ship())
    turn = np.radians(120.0) * np.linspace(0, 1, len(run.trajectory))
    arc = np.column_stack([40 * np.sin(turn), 40 * (1 - np.cos(turn)), turn])
    bent = replace(run, trajectory=replace(run.trajectory, pose=arc))
    for current in (np.zeros(2), np.array([0.2, 0.0])):
        told = displacement_of(
            ship(), bent, Environment(current_to=current), Headway(speed_mps=1.3, current_to=current)
        ).deviation_m
        for heading in np.linspace(-np.pi, np.pi, 37):
            c, s = np.cos(heading), np.sin(heading)
            track = arc[:, :2] @ np.array([[c, s], [-s, c]]) + current * run.trajectory.time_s[:, None]
            chord = track[0] + np.linspace(0, 1, 400)[:, None] * (track[-1] - track[0])
            assert shapely.distance(shapely.points(chord), shapely.linestrings(track)).max() <= told


def test_the_deviation_of_a_track_that_does_not_drift_is_that_of_its_chord_wherever_it_lies():
    turn = np.radians(120.0) * np.linspace(0, 1, 400)
    arc = np.column_stack([40 * np.sin(turn), 40 * (1 - np.cos(turn))])
    sagitta, length = 40 * (1 - np.cos(np.radians(60.0))), 80 * np.sin(np.radians(60.0))
    for shift in (np.zeros(2), np.array([300.0, -70.0])):
        told = _deviation_adrift_m(arc + shift, 0.0)
        assert sagitta <= told <= 1.001 * sagitta + length / 400
        assert _deviation_adrift_m(arc + shift, 5.0) >= told  # a drift sets the chord no nearer


def windy(share: float = 1.0):
    """The ship with superstructure: much of it, so that headings differ in any weather, or a share of that."""
    model = ship().model
    wind = {"W_abs_u_u": -0.02 * share, "W_abs_v_v": -0.03 * share, "W_uv": 0.0003 * share}
    values = [wind.get(name, value) for name, value in zip(model.names, model.parameters.tolist(), strict=True)]
    return replace(ship(), model=replace(model, parameters=np.array(values)))


WEATHERS = {
    "current alone": Environment(current_to=np.array([0.3, -0.25])),
    "wind alone": Environment(wind_to=np.array([-1.5, 2.0])),
    "wind across a current": Environment(current_to=np.array([0.3, 0.0]), wind_to=np.array([0.0, -2.0])),
}


@pytest.mark.parametrize("weather", WEATHERS)
def test_no_heading_displaces_a_run_in_wind_by_more_than_the_bound(weather):
    vessel, environment = windy(), WEATHERS[weather]
    run, headway = primitive(vessel), Headway(speed_mps=1.3, current_to=environment.current_to)
    told = displacement_of(vessel, run, environment, headway)
    slowest, fastest, turning = exit_motion(vessel, run, environment)
    chords = []
    for heading in np.random.default_rng(4).uniform(-np.pi, np.pi, 60):
        u_c, v_c = to_body(environment.current_to, heading, NUMPY)
        begin = run.entry_velocity + np.array([u_c, v_c, 0.0])
        track = simulate(vessel, run.commands, pose=np.array([0, 0, heading]), velocity=begin, environment=environment)
        places = track.pose[:, :2]
        chords.append(headway.seconds(places[-1] - places[0]))
        assert headway.seconds(np.diff(places, axis=0)).sum() <= told.path_s
        chord = places[0] + np.linspace(0, 1, 100)[:, None] * (places[-1] - places[0])
        assert shapely.distance(shapely.points(chord), shapely.linestrings(places)).max() <= told.deviation_m
        last = through_water(environment, np.r_[track.pose[-1], track.velocity[-1]])
        assert slowest <= np.hypot(*last[:2]) <= fastest
        assert abs(last[2]) <= turning
    assert max(chords) <= told.chord_s <= 1.05 * max(chords)


def test_air_that_moves_with_the_water_is_calm():
    current, run = np.array([0.3, 0.4]), primitive(windy())
    drifting, headway = Environment(current_to=current, wind_to=current), Headway(speed_mps=1.3, current_to=current)
    blind = displacement_of(ship(), run, Environment(current_to=current), headway)
    told = displacement_of(windy(), run, drifting, headway)
    assert (told.chord_s, told.path_s, told.deviation_m) == (blind.chord_s, blind.path_s, blind.deviation_m)


@pytest.mark.parametrize("wind", [np.array([4.0, 0.0]), np.array([-3.0, 2.0])])
def test_a_leg_in_wind_takes_no_less_than_the_bound(wind):
    sea = Environment(current_to=np.array([0.2, 0.1]), wind_to=wind)
    water = replace(leg_water(OPEN), vessel=windy(0.1), environment=sea)
    water = replace(water, ship=capability(water.vessel, PlanSettings()))
    rest = np.r_[water.environment.current_to, 0.0]  # heading north
    start, end = np.r_[-60.0, 0.0, 0.0, rest], np.r_[60.0, 0.0, 0.0, rest]
    bound_s = reposition_bound_s(
        water.vessel,
        water.area,
        water.environment,
        clearance_m=20.0,
        primitives=(),
        repeats={},
        ends=(start[:3], end[:3]),
        transit_mps=water.ship.transit_speed_mps,
        yaw_rate_radps=water.ship.spot_rate_radps + water.ship.yaw_rate_radps,
    )
    values = find_leg(LegTask(start=start, end=end, start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1), water)
    assert values is not None
    assert 0 < bound_s <= len(values) * water.vessel.sample_time_s


def test_grown_water_holds_all_that_is_as_near():
    grown = _grown(shapely.box(-1, -1, 1, 1), 50.0)
    angle = np.linspace(0, np.pi / 2, 2000)
    within = np.stack([1 + 50 * np.cos(angle), 1 + 50 * np.sin(angle)], axis=1)
    assert shapely.contains_properly(grown, shapely.points(within)).all()
    assert shapely.area(grown) < 1.001 * shapely.area(shapely.buffer(shapely.box(-1, -1, 1, 1), 50.0, quad_segs=500))


@pytest.mark.parametrize("seed", range(20))
def test_a_planted_plan_costs_no_less_than_the_bound(seed):
    """Water is laid round a plan: legs that wander at full speed, runs at random headings, in a random current."""
    rng = np.random.default_rng(seed)
    current, margin = rng.uniform(-0.4, 0.4, 2) * (seed % 3 > 0), 8.0
    headway, sea = Headway(speed_mps=1.2, current_to=current), Environment(current_to=current)
    straight = primitive(ship())
    turns = rng.uniform(-4, 4, 2)[:, None] * np.linspace(0, 1, len(straight.trajectory))
    runs = {}
    for name, turn in zip("ab", turns, strict=True):
        away = np.cumsum(np.stack([np.cos(turn), np.sin(turn)], axis=1), axis=0) * rng.uniform(0.3, 1.2)
        track = replace(straight.trajectory, pose=np.column_stack([away - away[0], turn]))
        runs[name] = replace(straight, name=name, trajectory=track)
    here, spent, waters, repeats = np.zeros(2), 0.0, [], {"a": 0, "b": 0}
    for name in [*rng.choice(["a", "b"], 4), ""]:
        leg = random_path(rng, here, int(rng.integers(1, 8)))
        spent, here = spent + headway.seconds(np.diff(leg, axis=0)).sum(), leg[-1]
        waters.append(shapely.LineString(leg[:, ::-1]))
        if name:
            repeats[name] += 1
            c, s = np.cos(heading := rng.uniform(-np.pi, np.pi)), np.sin(heading)
            track = here + runs[name].trajectory.pose[:, :2] @ np.array([[c, s], [-s, c]])
            track = track + current * runs[name].trajectory.time_s[:, None]
            waters.append(shapely.LineString(track[:, ::-1]))
            here = track[-1]
    lakes = shapely.buffer(shapely.points(rng.uniform(-400, 400, (3, 2))), 60.0)
    water = shapely.union_all([*(shapely.buffer(way, margin + 0.5) for way in waters), *lakes])
    displacements = {name: displacement_of(ship(), run, sea, headway) for name, run in runs.items()}
    bound = time_to_sail_s(area(water), margin, displacements, repeats, (np.zeros(2), here), headway, 0.5)
    assert bound <= spent + 1e-6
    none = {name: Displacement(chord_s=0.0, path_s=0.0, deviation_m=0.0) for name in runs}
    assert bound <= time_to_sail_s(area(water), margin, none, repeats, (np.zeros(2), here), headway, 0.5)


def without_runs_s(current_mps: float, under_way: UnderWay | None = None, water: shapely.Geometry = OPEN) -> float:
    """The bound in open water, or in other, with the current or against it."""
    return reposition_bound_s(
        ship(),
        area(water),
        Environment(current_to=np.array([0.0, current_mps])),
        clearance_m=20.0,
        primitives=(),
        repeats={},
        ends=ENDS,
        transit_mps=1.3,
        yaw_rate_radps=0.1,
        under_way=under_way,
    )


def test_a_channel_that_holds_the_hull_and_its_clearance_may_be_sailed():
    """Amidships keep the clearance and half the beam: 20 m and 4.5 m."""
    for half_m, open_ in ((20.0 + 0.7 * ship().beam_m, True), (20.0 + 0.2 * ship().beam_m, False)):
        channel = shapely.box(-30, -half_m, 30, half_m)
        bound_s = without_runs_s(0.0, water=OPEN.difference(shapely.box(-30, -500, 30, 500)).union(channel))
        straight_s = 400 / leg_speed_mps(1.3, ())
        assert (bound_s == pytest.approx(straight_s, rel=1e-3)) is open_
        assert bound_s > straight_s * (1 - 1e-9)


@pytest.mark.parametrize("start", [-200.0, -14.0, -13.0, -12.0, -11.0])  # all but the first too near to the wall
def test_a_world_elsewhere_has_the_same_bound(start: float):
    water, ends = OPEN.difference(WALL), (np.array([0.0, start, 0.0]), ENDS[1])
    shift = np.array([3000.0, -7000.0])  # north, east
    moved = shapely.transform(water, lambda places: places + shift[::-1])
    found = to_sail(moved, {}, {}, ends=tuple(end + np.r_[shift, 0.0] for end in ends))
    assert found == pytest.approx(to_sail(water, {}, {}, ends=ends), rel=1e-6)
    assert found >= 200 - start - 1e-6  # whatever leads an end outside the water into it, the straight line is shorter


def test_orders_are_enumerated_up_to_a_number_of_combinations():
    assert cheapest_orders(np.ones((3, 3)), np.zeros(3), [27] * 3) is None  # 21 952
    table = cheapest_orders(np.ones((3, 3)), np.zeros(3), [9] * 3)
    assert table is not None
    assert table[-1] == pytest.approx(27.0)  # one for every run that remains


@pytest.mark.parametrize("current", [0.2, -0.2])
def test_with_and_against_a_current_the_bound_is_the_distance_by_the_speed_over_ground(current):
    assert without_runs_s(current) == pytest.approx(400 / (leg_speed_mps(1.3, ()) + current), abs=1e-6)


def test_what_is_lost_by_stopping_is_lost_through_water():
    """A ship at full speed comes to rest: she sails her way less what stopping loses, and the water carries her on."""

    def bound_s(current: float) -> float:
        return without_runs_s(
            current, UnderWay(velocity=np.array([1.3, current, 0.0]), inputs=np.zeros(len(ship().limits)))
        )

    speed = leg_speed_mps(1.3, (np.array([1.3, 0.0]),))
    lost_m = speed * bound_s(0.0) - 400
    assert lost_m > 1.0  # not rounding: from rest to rest, over no way at all, nothing need be lost
    for current in (0.1, 0.3):
        assert bound_s(current) == pytest.approx((400 + lost_m) / (speed + current), rel=1e-9)


@pytest.mark.parametrize("counts", [(1, 1, 1), (2, 1, 2), (3,), (1, 4)])
def test_the_losses_counted_are_those_of_the_best_order(counts):
    rng = np.random.default_rng(len(counts))
    losses = rng.uniform(0, 5, (len(counts) + 1, len(counts) + 1))
    runs = np.repeat(np.arange(len(counts)), counts)
    totals = [
        losses[0, order[0]] + sum(losses[a + 1, b] for a, b in pairwise(order)) + losses[order[-1] + 1, -1]
        for order in permutations(runs.tolist())
    ]
    assert least_losses(losses, counts) == pytest.approx(min(totals))


def test_where_orders_are_too_many_the_losses_counted_are_less():
    losses = np.random.default_rng(0).uniform(0, 5, (21, 21))
    order = [0, *np.random.default_rng(1).permutation(20).tolist()]
    some = losses[0, order[1]] + sum(losses[a + 1, b] for a, b in pairwise(order[1:])) + losses[order[-1] + 1, -1]
    assert 0 <= least_losses(losses, [1] * 20) <= some


def test_changing_speed_loses_what_constant_acceleration_loses():
    step_s = 0.1  # a hundredth of the time that the ship's engines take to full
    for first, last in ((0.0, 1.0), (1.0, 0.0), (0.4, 0.9), (0.0, 0.0), (0.7, 0.7)):
        lost, least = least_loss([steady(first, 0.5, 1.0)], [steady(last, 0.5, 1.0)], ship())[0, 0]
        change_s = abs(last - first) / 0.5
        assert least <= change_s + 1e-9  # no more than the truth, and little less
        assert lost <= change_s * (1 - (first + last) / 2) + 1e-9
        assert least == pytest.approx(change_s, abs=3 * step_s)
        assert lost == pytest.approx(change_s * (1 - (first + last) / 2), abs=3 * step_s)


def test_no_random_change_of_speed_is_faster_than_the_limit():
    vessel, rng = ship(), np.random.default_rng(1)
    told = leg_end(vessel, CALM, 0.0, None, top_mps=1.36, yaw_rate_radps=0.3).changes
    speed, way, n = 1.36 * np.sqrt(rng.uniform(1e-6, 1, 200_000)), rng.uniform(-np.pi, np.pi, 200_000), 200_000
    u, v, r = speed * np.cos(way), speed * np.sin(way), rng.uniform(-0.3, 0.3, n)
    inputs = tuple(rng.choice([-15.0, 15.0], n) if k % 2 == 0 else rng.uniform(-np.pi, np.pi, n) for k in range(4))
    surge, sway, _ = vessel.model.accelerations((u, v, r), (u, v), inputs, NUMPY)
    rate = surge * np.cos(way) + sway * np.sin(way)
    band = np.minimum(np.searchsorted(told.edges_mps, speed) - 1, told.faster_mps2.shape[1] - 1)
    assert (rate <= told.faster_mps2[-1, band]).all()
    assert (-rate <= told.slower_mps2[-1, band]).all()
    # full ahead against what drags is as fast as it goes
    ahead = vessel.model.accelerations((0.0, 0.0, 0.0), (0.0, 0.0), (15.0, 0.0, 15.0, 0.0), NUMPY)[0]
    assert ahead <= told.faster_mps2[-1, 0] <= 1.11 * ahead


def test_simulated_ships_with_rate_limited_commands_stay_between_the_speed_bounds():
    vessel, rng = ship(), np.random.default_rng(2)
    rates = vessel.rates
    for standing, speed in ((np.array([8.0, 0.0, 8.0, 0.0]), 0.8), (np.array([-3.0, 1.5, 2.0, -0.5]), 0.3)):
        told = leg_end(vessel, CALM, speed, standing, top_mps=1.36, yaw_rate_radps=0.4).changes
        most, least = told.most(speed, 0.1 * np.arange(301)), told.least(speed, 0.1 * np.arange(301))
        for _ in range(40):
            # mostly hard ahead or astern, the angles random_path
            steps = np.where(rng.uniform(size=(30, 4)) < 0.7, rng.choice([-1.0, 1.0], 4), rng.uniform(-1, 1, (30, 4)))
            values = standing + np.cumsum(rates * steps, axis=0)
            values[:, ::2] = values[:, ::2].clip(-15.0, 15.0)
            orders = Commands(sample_time_s=1.0, names=vessel.model.inputs, values=values)
            track = simulate(vessel, orders, velocity=np.array([speed, 0.0, 0.0]))
            sailed = np.hypot(*track.velocity[:, :2].T)
            allowed = (np.abs(track.velocity[:, 2]) <= 0.4) & (sailed <= 1.36)
            known = np.cumprod(allowed).astype(bool)
            assert (sailed[known] <= most[::10][known] + 1e-6).all()
            assert (sailed[known] >= least[::10][known] - 1e-6).all()


def test_ships_with_stopped_engines_accelerate_no_faster_than_the_limit_at_any_angles():
    vessel, rng = ship(), np.random.default_rng(3)
    rates = vessel.rates
    stopped = np.array([0.0, np.nan, 0.0, np.nan])
    told = leg_end(vessel, CALM, 0.0, stopped, top_mps=1.36, yaw_rate_radps=0.4).changes
    free = leg_end(vessel, CALM, 0.0, None, top_mps=1.36, yaw_rate_radps=0.4).changes
    time_s = 0.1 * np.arange(201)
    most = told.most(0.0, time_s)
    assert (most[1:30] < free.most(0.0, time_s)[1:30]).all()
    fastest: np.ndarray = np.zeros(21)
    for k in range(40):
        angle = 0.0 if k == 0 else rng.uniform(-np.pi, np.pi)
        steps = np.tile(rates * [1, 0, 1, 0], (20, 1))
        steps *= 1.0 if k < 10 else rng.uniform(-0.5, 1.0, (20, 1))
        values = np.array([0.0, angle, 0.0, angle]) + np.cumsum(steps, axis=0)
        values[:, ::2] = values[:, ::2].clip(-15.0, 15.0)
        track = simulate(vessel, Commands(sample_time_s=1.0, names=vessel.model.inputs, values=values))
        sailed = np.hypot(*track.velocity[:, :2].T)
        fastest = np.maximum(fastest, sailed)
    within = np.cumprod(fastest <= 1.36).astype(bool)
    assert (fastest[within] <= most[::10][within] + 1e-6).all()


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
def test_legs_found_in_random_water_take_longer_than_the_bound(seed):
    rng = np.random.default_rng(seed)
    rocks = shapely.union_all(shapely.buffer(shapely.points(rng.uniform(-300, 300, (12, 2))), rng.uniform(5, 60, 12)))
    ends = (np.array([-500.0, -500.0, 0.7]), np.array([500.0, 500.0, 0.7]))
    water = leg_water(OPEN.difference(rocks))
    bound_s = reposition_bound_s(
        water.vessel,
        water.area,
        CALM,
        clearance_m=20.0,
        primitives=(),
        repeats={},
        ends=ends,
        transit_mps=water.ship.transit_speed_mps,
        yaw_rate_radps=water.ship.spot_rate_radps,
    )
    task = LegTask(
        start=at_rest(*ends[0]), end=at_rest(*ends[1]), start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1
    )
    values = find_leg(task, water)
    assert values is not None
    seconds = len(values) * water.vessel.sample_time_s
    assert bound_s < seconds < 1.1 * bound_s + 20
