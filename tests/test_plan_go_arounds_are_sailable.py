"""Go-around paths of ships that sail arcs: shortest where there is room, turns no tighter than sailed, never ashore."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.chart.goal_distance import clearance_field
from expdesign.plan.chart.visibility_graph import polyline_length
from expdesign.plan.control import Helmsman
from expdesign.plan.legs._ompl import dubins_curve
from expdesign.plan.monte_carlo import guidance as guiding
from expdesign.plan.monte_carlo import procedure
from expdesign.plan.monte_carlo.guidance import Guidance
from expdesign.plan.monte_carlo.procedure import Approach, goal_within_m, slowing, steady_states, tolerances
from expdesign.plan.monte_carlo.return_paths import GO_AROUND_ROOM, GoAroundPaths, PathFollowers
from expdesign.plan.runs import Fleet, Truths
from expdesign.simulation import CALM
from expdesign.vessel import Vessel
from helm_case import coaster, offshore_vessel, open_water
from plan_case import area

RADIUS, SPACING = 40.0, 5.0
GOAL = np.array([0.0, 0.0, 0.7])
ISLES = [shapely.Point(120 * np.cos(k), 120 * np.sin(k)).buffer(35) for k in (0.2, 1.7, 3.1, 4.9)]
SEA = shapely.box(-500, -500, 500, 500).difference(shapely.union_all(ISLES))


def go_arounds(water: shapely.Geometry, goal: np.ndarray = GOAL) -> GoAroundPaths:
    return GoAroundPaths(
        goal=goal,
        radius_m=RADIUS,
        spacing_m=SPACING,
        holds=lambda path: bool(shapely.covers(water, shapely.LineString(path[:, ::-1]))),
    )


def poses(count: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    found = rng.uniform([-450, -450, -np.pi], [450, 450, np.pi], (4 * count, 3))
    clear = shapely.contains_xy(shapely.buffer(SEA, -10), found[:, 1], found[:, 0])
    return found[clear][:count]


def test_in_open_water_the_go_around_is_the_shortest_curve():
    sea = go_arounds(shapely.box(-2000, -2000, 2000, 2000))
    for pose in poses(20):
        shortest = dubins_curve(pose, GOAL, radius_m=RADIUS, spacing_m=SPACING)
        np.testing.assert_allclose(sea.find(pose), shortest[:, :2])


def test_among_islands_paths_stay_in_the_water_connect_the_ends_and_turn_no_tighter_than_the_ship():
    direct, around, straits = 0, 0, go_arounds(SEA)
    for pose in poses(60):
        path = straits.find(pose)
        shortest = dubins_curve(pose, GOAL, radius_m=RADIUS, spacing_m=SPACING)[:, :2]
        if path is None:
            continue
        assert straits.holds(path)
        np.testing.assert_allclose(path[[0, -1]], [pose[:2], GOAL[:2]], atol=1e-6)
        steps = np.diff(path, axis=0)
        turns = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(*steps.T[::-1])))))
        lengths = np.hypot(*steps.T)
        assert (turns <= 1.01 * (lengths[1:] + lengths[:-1]) / 2 / RADIUS + 1e-6).all()
        assert polyline_length(path) >= polyline_length(shortest) - 1e-6
        direct, around = direct + straits.holds(shortest), around + (not straits.holds(shortest))
    assert direct + around >= 0.9 * 60
    assert around >= 10


def test_paths_turn_with_the_water():
    turn = 1.1
    c, s = np.cos(turn), np.sin(turn)
    turned = go_arounds(shapely.affinity.rotate(SEA, -np.degrees(turn), origin=(0, 0)), np.add(GOAL, (0, 0, turn)))
    straits = go_arounds(SEA)
    lengths = []
    for pose in poses(12):
        path, other = straits.find(pose), turned.find(np.r_[np.array([[c, -s], [s, c]]) @ pose[:2], pose[2] + turn])
        lengths.append([0.0 if found is None else polyline_length(found) for found in (path, other)])
    ours, turned_ones = np.array(lengths).T
    assert (ours > 0).sum() >= 10
    np.testing.assert_allclose(turned_ones, ours, rtol=1e-6)


def test_out_of_a_closed_pool_there_is_no_path():
    pool = SEA.union(shapely.box(-900, -900, -700, -700))
    assert go_arounds(pool).find(np.array([-800.0, -800.0, 0.0])) is None


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_ships_keep_to_the_arcs_that_they_go_around_by(side):
    """Steered by the bends ahead: a helm that waits to be off the path swings a ship length wide."""
    vessel, water, count = coaster(), open_water(coaster()), 8
    ship, rng = water.ship, np.random.default_rng(5)
    drawn = vessel.model.parameters * (1.0 + 0.1 * rng.uniform(-1, 1, (count, len(vessel.model.parameters))))
    truths = Truths(parameters=drawn, current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)))
    start, approach = np.array([0.0, 0.0, 0.0, *ship.approach.velocity]), ship.approach.inputs
    fleet = Fleet(vessel, CALM, truths, state=start, standing=approach, rng=rng)
    helm = Helmsman(vessel=vessel, environment=CALM, ship=ship)
    radius = 1.5 * ship.turning_radius_m  # which leaves the helm something to correct with
    back = np.array([0.0, side * 2.5 * radius, np.pi])
    path = dubins_curve(start[:3], back, radius_m=radius, spacing_m=vessel.length_m)[:, :2]
    followers = PathFollowers(helm, np.r_[back, start[3:]], count, reach_m=vessel.length_m / 2)
    for number in range(count):
        followers.start(number, path)
    ships, off_m, unexplained = np.arange(count), [], np.zeros((count, 3))
    for _ in range(int(polyline_length(path) / ship.transit_speed_mps / vessel.sample_time_s)):
        before = fleet.states
        fleet.advance(helm.commands(followers.desired(ships, before), before, fleet.given, unexplained=unexplained))
        unexplained = helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
        off_m.append(shapely.distance(shapely.LineString(path), shapely.points(fleet.states[:, :2])))
    assert np.max(off_m) < 0.75 * vessel.length_m


@pytest.mark.parametrize(("room", "turns_north"), [(0.5, True), (1.5, False)])
def test_go_arounds_keep_off_the_shore_where_there_is_room(room, turns_north):
    """The shortest way round leads by the southern shore, another one through open water."""
    vessel, water = coaster(), open_water(coaster())
    radius, length = water.ship.turning_radius_m, vessel.length_m
    helm = Helmsman(vessel=vessel, environment=CALM, ship=water.ship)
    leg = np.tile([0.0, 0.0, np.pi / 2, *water.ship.approach.velocity], (60, 1))
    leg[:, 1] = np.linspace(-6.0 * length, 0.0, 60)
    shore = -2.0 * radius - water.leg_margin_m - room * radius
    sea = area(shapely.box(-40 * length, shore, 40 * length, 40 * length))
    near = replace(water, area=sea, field=clearance_field(sea, resolution_m=length / 4))
    guidance = Guidance(
        helm,
        near,
        leg,
        within=tolerances(near),
        sailing=np.ones(1, bool),
        inputs=water.ship.approach.inputs,
        last=False,
    )
    guidance._go_around(np.array([0]), np.array([[0.1 * radius, 2.0 * length, np.pi / 2, 5.0, 0.0, 0.0]]))
    path = guidance._followers._path[0]
    assert (path[:, 0].max() > radius) == turns_north
    assert path[:, 0].min() >= shore + water.leg_margin_m + GO_AROUND_ROOM * radius - 1.0


def test_ships_beside_their_arc_go_back_to_it_instead_of_circling_beside_its_next_bend():
    """With the arc's yaw rate wherever she is, a ship turned round beside the bend until the current had her ashore."""
    vessel, water, count = coaster(), open_water(coaster()), 48
    ship, length, rng = water.ship, vessel.length_m, np.random.default_rng(3)
    helm = Helmsman(vessel=vessel, environment=CALM, ship=ship)
    start = np.array([0.0, 0.0, 0.0, *ship.approach.velocity])
    back = np.array([0.0, 2.0 * ship.turning_radius_m, np.pi])
    path = dubins_curve(start[:3], back, radius_m=ship.turning_radius_m, spacing_m=length)[:, :2]
    off = np.column_stack([rng.uniform(-5.0, 5.0, (count, 2)) * length, rng.uniform(-1.5, 1.5, count)])
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    current = 0.1 * ship.transit_speed_mps * np.column_stack([np.cos(angle), np.sin(angle)])
    parameters = np.tile(vessel.model.parameters, (count, 1))
    truths = Truths(parameters=parameters, current_to=current, wind_to=np.zeros((count, 2)))
    fleet = Fleet(vessel, CALM, truths, state=start, standing=ship.approach.inputs, rng=rng)
    fleet.states = fleet.states + np.column_stack([off, np.zeros((count, 3))])
    followers, ships = PathFollowers(helm, np.r_[back, start[3:]], count, reach_m=length), np.arange(count)
    for number in range(count):
        followers.start(number, path)
    unexplained, arrived = np.zeros((count, 3)), np.zeros(count, dtype=bool)
    for _ in range(round(3.0 * (polyline_length(path) + 10.0 * length) / ship.transit_speed_mps)):
        before = fleet.states
        fleet.advance(helm.commands(followers.desired(ships, before), before, fleet.given, unexplained=unexplained))
        unexplained = helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
        arrived |= followers.arrived(ships, fleet.states)
    assert arrived.all()


@pytest.mark.thorough
def test_ships_that_do_not_settle_on_a_run_up_take_a_longer_one(monkeypatch):
    """Another attempt of the same length ends as the last one did, mirrored where she turns to the other side."""
    vessel = coaster()
    water = replace(open_water(vessel), start_tolerance=3.0)
    helm, rng = Helmsman(vessel=vessel, environment=CALM, ship=water.ship), np.random.default_rng(7)
    start = np.r_[0.0, 0.0, 0.0, water.ship.approach.velocity]
    leg = np.vstack([steady_states(helm, start, np.arange(-100, 0)), start])
    drawn = vessel.model.parameters * (1.0 + 0.4 * rng.uniform(-1, 1, (60, len(vessel.model.parameters))))
    slow = drawn[[2, 6, 15, 21, 24, 46]]  # of these 60 ships half of those that do not settle
    count = len(slow)
    truths = Truths(parameters=slow, current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)))
    beside = leg[0] + np.array([0.0, 2.0 * vessel.length_m, 0.5, 0.0, 0.0, 0.0])  # too far to return to the leg

    def begun() -> int:
        fleet = Fleet(
            vessel, CALM, truths, state=beside, standing=water.ship.approach.inputs, rng=np.random.default_rng(5)
        )
        guidance = Guidance(
            helm,
            water,
            leg,
            within=tolerances(water),
            sailing=np.ones(count, bool),
            inputs=water.ship.approach.inputs,
            last=False,
            longest=10_000,
        )
        return int(guidance.sail(fleet, np.zeros((count, 3))).begun.sum())

    longer = begun()
    monkeypatch.setattr(procedure, "LONGER_RUN_UPS", ())
    assert longer == count
    assert begun() <= count / 2


def test_where_no_way_leads_to_the_beginning_of_a_run_up_a_shorter_one_is_taken():
    """The beginning of the usual one is near the shore: a ship would have to come out of it."""
    vessel, water = coaster(), open_water(coaster())
    radius, length = water.ship.turning_radius_m, vessel.length_m
    helm = Helmsman(vessel=vessel, environment=CALM, ship=water.ship)
    leg = np.tile([0.0, 0.0, 0.0, *water.ship.approach.velocity], (60, 1))
    leg[:, 0] = np.linspace(-2.0 * length, 0.0, 60)
    usual_m = water.ship.run_up_s(vessel, water.ship.transit_speed_mps) * water.ship.transit_speed_mps
    sea = area(shapely.box(-10 * radius, -usual_m - water.leg_margin_m - length, 10 * radius, 20 * radius))
    near = replace(water, area=sea, field=clearance_field(sea, resolution_m=length / 4))
    guidance = Guidance(
        helm,
        near,
        leg,
        within=tolerances(near),
        sailing=np.ones(1, bool),
        inputs=water.ship.approach.inputs,
        last=False,
    )
    path = guidance._round(0, np.array([length, length, 0.0]))
    assert path is not None
    begins_m = -path[-1, 0]
    assert 0.2 * usual_m < begins_m < 0.9 * usual_m
    assert guidance._arcs(guidance._usual)[-1].find(np.array([length, length, 0.0])) is None


def stopped(vessel: Vessel, offset: tuple[float, float], *, spare_m: float, heading_rad: float = 0.0) -> Approach:
    """24 drawn ships on a leg to a standing start, some hull lengths north and east of where it begins."""
    water, count = open_water(vessel), 24
    ship, rng, length = water.ship, np.random.default_rng(5), vessel.length_m
    helm = Helmsman(vessel=vessel, environment=CALM, ship=ship)
    most_s = 40.0 * length / ship.transit_speed_mps
    leg = np.vstack([slowing(helm, np.zeros(6), round(most_s / vessel.sample_time_s)), np.zeros(6)])
    drawn = vessel.model.parameters * (1.0 + 0.1 * rng.uniform(-1, 1, (count, len(vessel.model.parameters))))
    current = rng.normal(0.0, 0.1, (count, 2))
    truths = Truths(parameters=drawn, current_to=current, wind_to=np.zeros((count, 2)))
    state = leg[0] + np.array([offset[0] * length, offset[1] * length, heading_rad, 0.0, 0.0, 0.0])
    fleet = Fleet(vessel, CALM, truths, state=state, standing=ship.approach.inputs, rng=rng)
    guidance = Guidance(
        helm,
        water,
        leg,
        within=tolerances(water, spare_m=spare_m),
        sailing=np.ones(count, bool),
        inputs=np.zeros(len(vessel.limits)),
        last=False,
    )
    return guidance.sail(fleet, np.zeros((count, 3)))


def test_a_ship_that_comes_near_enough_to_a_standing_start_stops_there_instead_of_circling_round_it():
    found = stopped(coaster(), (0.0, 0.0), spare_m=4.0 * coaster().length_m)
    assert found.begun.all()
    assert not found.go_arounds.any()
    assert np.abs(found.poses[..., 2]).max() < 1.0


def test_a_ship_that_misses_a_standing_start_stops_beside_it_and_is_then_said_to_go_around(monkeypatch):
    """She neither comes nearer at rest, nor circles round the place until her time is over."""
    monkeypatch.setattr(guiding, "GO_AROUNDS", 0)
    found = stopped(coaster(), (0.0, 1.5), spare_m=0.0)
    assert 0 < found.begun.sum() < len(found.begun)
    assert np.abs(found.poses[..., 2]).max() < 1.0
    assert found.samples.max() < 1.5 * found.samples.min()


def test_thrusters_bring_a_ship_that_stops_beside_a_standing_start_to_it_on_the_spot():
    ship = open_water(offshore_vessel()).ship
    assert ship.hovers
    assert not ship.keeps_station
    found = stopped(offshore_vessel(), (0.5, 1.0), spare_m=0.0, heading_rad=0.2)
    assert found.begun.all()
    assert not found.go_arounds.any()
    assert np.abs(found.poses[..., 2]).max() < 1.0


def to_the_goal(leg: np.ndarray, state: np.ndarray, count: int) -> tuple[Guidance, Fleet]:
    """Nominal coasters at a state, on a leg to the goal."""
    vessel, water = coaster(), open_water(coaster())
    ship = water.ship
    parameters = np.tile(vessel.model.parameters, (count, 1))
    truths = Truths(parameters=parameters, current_to=np.zeros((count, 2)), wind_to=np.zeros((count, 2)))
    guidance = Guidance(
        Helmsman(vessel=vessel, environment=CALM, ship=ship),
        water,
        leg,
        within=tolerances(water),
        sailing=np.ones(count, bool),
        inputs=np.zeros(len(vessel.limits)),
        last=True,
    )
    standing = ship.approach.inputs
    return guidance, Fleet(vessel, CALM, truths, state=state, standing=standing, rng=np.random.default_rng(5))


def test_a_ship_that_passes_the_goal_while_she_slows_down_has_reached_it():
    water, count = open_water(coaster()), 2
    helm = Helmsman(vessel=coaster(), environment=CALM, ship=water.ship)
    leg = np.vstack([slowing(helm, np.zeros(6), 200), np.zeros(6)])  # she cannot stop on it
    state = leg[0] + np.array([0.0, 0.0, 0.0, water.ship.transit_speed_mps - leg[0, 3], 0.0, 0.0])
    guidance, fleet = to_the_goal(leg, state, count)
    found = guidance.sail(fleet, np.zeros((count, 3)))
    off_m = np.hypot(*(found.poses[:, 0, :2] - leg[-1, :2]).T)
    assert off_m[-1] > goal_within_m(water) > off_m.min()
    assert found.begun.all()
    assert not found.go_arounds.any()


@pytest.mark.parametrize("hulls", [1.0, 2.0])
def test_a_leg_that_leads_past_the_goal_reaches_it_at_its_end(hulls):
    water, length = open_water(coaster()), coaster().length_m
    away = np.linspace(0.0, 20.0 * length, 200)
    leg = np.zeros((400, 6))
    leg[:, 0] = np.r_[away, away[::-1]]
    guidance, _ = to_the_goal(leg, leg[0], 1)
    ships, beside = np.zeros(1, dtype=int), np.array([[0.0, hulls * length, 0.0, 1.0, 0.0, 0.0]])
    guidance._reach(ships, beside)
    assert not guidance._arrived.any()  # all of the leg is left
    guidance._at[:] = len(leg) - 2
    guidance._reach(ships, beside)
    assert guidance._arrived.any() == (hulls * length <= goal_within_m(water))


def test_a_ship_too_far_ahead_for_her_leg_and_without_a_way_round_sails_it_all_the_same(monkeypatch):
    monkeypatch.setattr(procedure, "RUN_UP_SHARES", (1.0,))  # shorter ones begin ahead of her
    vessel = coaster()
    water, length = open_water(vessel), vessel.length_m
    ship, radius = water.ship, water.ship.turning_radius_m
    helm = Helmsman(vessel=vessel, environment=CALM, ship=ship)
    leg = np.tile([0.0, 0.0, np.pi / 2, *ship.approach.velocity], (100, 1))
    leg[:, 1] = np.arange(100) * vessel.sample_time_s * ship.transit_speed_mps
    channel = area(shapely.box(-40 * length, -0.8 * radius, 40 * length, 0.8 * radius))
    narrow = replace(water, area=channel, field=clearance_field(channel, resolution_m=length / 4))
    parameters = vessel.model.parameters[None]
    truths = Truths(parameters=parameters, current_to=np.zeros((1, 2)), wind_to=np.zeros((1, 2)))
    state = leg[0] + np.array([0.0, 0.4 * leg[-1, 1], 0.0, 0.0, 0.0, 0.0])
    fleet = Fleet(vessel, CALM, truths, state=state, standing=ship.approach.inputs, rng=np.random.default_rng(5))
    guidance = Guidance(
        helm,
        narrow,
        leg,
        within=tolerances(narrow),
        sailing=np.ones(1, bool),
        inputs=ship.approach.inputs,
        last=False,
    )
    assert guidance._round(0, state[:3]) is None
    found = guidance.sail(fleet, np.zeros((1, 3)))
    assert found.begun.all()
    assert not found.go_arounds.any()
