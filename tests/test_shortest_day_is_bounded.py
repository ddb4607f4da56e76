"""No motion of a class tells what is needed in less time than the bound says, and its proof stands on its own."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from design_case import WIND, force_actuator, scored_example, vessel
from expdesign.durations import Collected, build_durations, optimal_shares
from expdesign.information import regressor_rows
from expdesign.scenario import load_scenario
from expdesign.shortest_day import Accuracy
from expdesign.shortest_day.bounds import Motions, day, fewest_samples, richest_sample, speed_changes
from expdesign.shortest_day.bounds import motions as motions_module
from expdesign.shortest_day.bounds.motions import AFFINE, over_boxes
from expdesign.signals import Commands
from expdesign.simulation import simulate
from expdesign.vessel import NUMPY, Limit, Term, VesselModel
from expdesign.vessel.structures import parse_expression
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored
from rudder_ship import rudder_ship
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

AZIMUTHS = vessel("azimuth-30m")
FASTEST = np.array([[-1.45, 1.45], [-0.7, 0.7], [-0.1, 0.1]])
FEW = 4000  # boxes; the bound holds with any number of them
SUBTRACTIONS = ("none", "batch", "complete")


def sea_motions(velocities=FASTEST):
    return Motions.within(
        AZIMUTHS.model, AZIMUTHS.model.names, velocities, air_to=np.subtract(WIND.wind_to, WIND.current_to)
    )


def std_accuracy(variance, names, means=0, prior=0.0):
    dimension = len(variance) + means
    return Accuracy(
        collected=None,
        level=-np.inf,
        samples=1.0,
        prior=prior * np.eye(dimension),
        variance=np.array(variance),
        parameters=tuple(names),
    )


def dictionary_accuracy(mean_subtraction):
    """As accurate as 1000 samples of the optimal durations of the standard dictionary in wind and current."""
    problem = build_durations(
        scored_example("standard", WIND),
        AZIMUTHS.model.names,
        total_s=1000 * AZIMUTHS.sample_time_s,
        mean_subtraction=mean_subtraction,
    )
    collected = Collected.of(problem)
    accuracy = Accuracy(
        collected=collected,
        level=collected.value(optimal_shares(problem).fractions),
        samples=1000.0,
        prior=np.zeros((problem.dimension,) * 2),
        variance=np.full(len(problem.parameters), np.inf),
        parameters=problem.parameters,
    )
    return problem, accuracy


def of_samples(motions, rows):
    """(k, k) sum over samples of regressor rows (k, p) with a 1 for each mean."""
    bordered = np.concatenate([rows, np.ones((len(rows), len(motions.model.outputs)))], axis=1)
    return motions.equations * (bordered.T @ bordered)


def counted(information, parameters, mean_subtraction):
    """What an accuracy counts of (k, k) information of one batch."""
    if mean_subtraction == "complete":
        return information
    A, C, D = information[:parameters, :parameters], information[:parameters, parameters:], information[parameters:]
    return A if mean_subtraction == "none" else A - C @ np.linalg.inv(D[:, parameters:]) @ C.T


@pytest.mark.parametrize("text", ["abs(u)*u", "u*v - 2*abs(v)*r", "sin(r)*cos(u*v)", "abs(u - v)*u*sin(3*r) - 1", "2"])
def test_affine_arithmetic_holds_every_value_over_a_box(text):
    rng = np.random.default_rng(len(text))
    expression = parse_expression(text, signals=("u", "v", "r"))
    centres, halves = rng.normal(size=(200, 3)), rng.uniform(0.0, 1.0, (200, 3))
    over = expression.evaluate(dict(zip("uvr", over_boxes(centres, halves), strict=True)), AFFINE)
    for _ in range(50):
        share = rng.uniform(-1.0, 1.0, (200, 3))
        value = expression.evaluate(dict(zip("uvr", (centres + halves * share).T, strict=True)), NUMPY)
        if isinstance(over, float):
            assert value == over
            continue
        linear = over.centre + np.einsum("db,bd->b", over.slopes, share)
        assert (np.abs(value - linear) <= over.error + 1e-12).all()


@pytest.mark.parametrize(
    ("mean_subtraction", "largest"),
    [("none", 3.0**2), ("complete", 2.0**2), ("batch", 2.0**2)],  # u from -1 to 3: least squares, or half the range
)
def test_one_parameter_has_the_closed_form(mean_subtraction, largest):
    model = VesselModel(
        terms=(Term("u", "X_u", "u"),),
        parameters=np.zeros(1),
        parameter_std=np.zeros(1),
        form="continuous",
        sample_time_s=1.0,
        actuators=(force_actuator(Limit(low=-1.0, high=1.0)),),
    )
    motions = Motions.within(model, model.names, np.array([[-1.0, 3.0], [0.0, 0.0], [0.0, 0.0]]), air_to=np.zeros(2))
    accuracy = std_accuracy([0.01], model.names, means=int(mean_subtraction == "complete"))
    found = fewest_samples(accuracy, motions, mean_subtraction=mean_subtraction)
    assert found.least == pytest.approx(1.0 / (0.01 * largest), rel=0.03)
    assert found.least <= (1 + 1e-9) / (0.01 * largest)
    prior = std_accuracy([0.01], model.names, means=int(mean_subtraction == "complete"), prior=40.0)
    if mean_subtraction == "none":  # 40 of the 100 units are known
        assert fewest_samples(prior, motions, mean_subtraction="none").least == pytest.approx(60.0 / 9.0, rel=0.03)


def test_the_richest_sample_is_found_and_no_sample_passes_its_bound():
    rng = np.random.default_rng(3)
    ship = rudder_ship()
    custom = Motions.within(ship.model, ship.model.names, 2 * FASTEST, air_to=np.array([4.0, 1.0]))
    for motions in (sea_motions(), custom):
        k = len(motions.equations)
        points = rng.uniform(motions.low, motions.high, (20_000, len(motions.low)))
        rows = motions.rows(points)
        force = motions.forces[rng.integers(len(motions.forces), size=len(points))] * rng.random((len(points), 1))
        rows = rows[0] + np.einsum("bi,ibk->bk", force, rows[1:])
        scale = 1.0 / np.maximum(np.abs(rows).max(axis=0), 1e-12)
        root = rng.normal(size=(k, k)) * scale
        found = richest_sample(motions, root.T @ root, most_boxes=20_000)
        values = np.einsum("bk,bk->b", rows @ (root.T @ root * motions.equations), rows)
        assert values.max() <= found.bound
        assert values.max() <= 1.05 * found.found <= 1.05 * found.bound


@pytest.mark.thorough
@pytest.mark.parametrize("mean_subtraction", SUBTRACTIONS)
def test_no_primitive_and_no_random_motion_needs_less_than_the_bound(mean_subtraction):
    """Whatever is accurate enough has <G, M> of 1 or more, and no sample has more than one over the bound."""
    problem, accuracy = dictionary_accuracy(mean_subtraction)
    motions, rng = sea_motions(2 * FASTEST), np.random.default_rng(0)
    found = fewest_samples(accuracy, motions, mean_subtraction=mean_subtraction, most_boxes=FEW)
    p = len(problem.parameters)
    assert found.least <= found.estimate
    assert found.least <= found.enough
    for matrix in problem.matrices:
        assert np.exp(-accuracy.margin(matrix)) >= found.least
    for _ in range(200):
        rows = telegraph_rows(rng)
        M = of_samples(motions, rows)
        margin = accuracy.margin(counted(M, p, mean_subtraction))
        assert np.exp(-margin) * len(rows) >= found.least
        told = float(np.sum(found.multiplier * M))
        assert told <= len(rows) / found.least
        assert np.exp(margin) <= told * (1 + 1e-9)


def telegraph_rows(rng):
    """(k, p) regressors of thrusters switched at random, on any heading, where they stay within twice the fastest."""
    count = 60
    orders = rng.uniform(-1.0, 1.0, (2, 4)) * [6.0, np.pi, 6.0, np.pi]
    switched = np.repeat(rng.integers(0, 2, (count // 10, 4)), 10, axis=0)
    commands = Commands(
        sample_time_s=AZIMUTHS.sample_time_s,
        names=AZIMUTHS.model.inputs,
        values=np.where(switched == 1, *orders),
    )
    motion = simulate(AZIMUTHS, commands, pose=(0.0, 0.0, rng.uniform(-np.pi, np.pi)), environment=WIND)
    drift = np.array([0.3, 0.3, 0.0])  # more than the current
    inside = (np.abs(motion.velocity[:count]) <= 2 * FASTEST[:, 1] - drift).all(axis=1)
    return regressor_rows(AZIMUTHS.model, motion, commands, WIND)[inside]


@pytest.mark.thorough
def test_wider_limits_never_raise_the_bound_and_twice_the_accuracy_doubles_it():
    _, accuracy = dictionary_accuracy("complete")
    twice = replace(accuracy, level=accuracy.level + accuracy.collected.degree * np.log(2.0))
    asked = ((0.5, accuracy), (1.0, accuracy), (0.5, twice))
    narrow, wide, doubled = (
        fewest_samples(wanted, sea_motions(size * FASTEST), mean_subtraction="complete", most_boxes=FEW)
        for size, wanted in asked
    )
    assert wide.least < narrow.least
    assert doubled.enough == pytest.approx(2 * narrow.enough, rel=0.03)
    assert doubled.least == pytest.approx(2 * narrow.least, rel=0.15)


def test_no_day_is_shorter_than_the_runs_that_limits_require(monkeypatch):
    """Nine runs from a berth and back, where neither way nor information takes any time."""
    case = load_scenario(SCENARIOS / "harbour.toml")
    information = scored(case)
    problem = plan_problem(case, information, designed(case, information))
    accuracy = std_accuracy(np.full(len(problem.design.problem.parameters), np.inf), case.vessel.model.names)
    trajectory = problem.primitives[0].trajectory
    monkeypatch.setattr(day, "fewest_samples", lambda *_, **__: SimpleNamespace(least=0.0, estimate=0.0))
    found = day.day_bound(problem, accuracy, SimpleNamespace(trajectory=trajectory))
    assert found.way_s < 30.0
    assert found.day_s == case.design.total_s == 1200.0


def test_a_ship_that_only_surges_gets_under_way_in_closed_form():
    drag, thrust, top, way_m = 0.1, 0.2, 1.5, 40.0
    model = VesselModel(
        terms=(Term("u", "X_u", "u"), Term("u", "X_tau", "tau_x")),
        parameters=np.array([-drag, 1.0]),
        parameter_std=np.zeros(2),
        form="continuous",
        sample_time_s=1.0,
        actuators=(force_actuator(Limit(low=-thrust, high=thrust)),),
    )
    motions = Motions.within(model, model.names, np.array([[-top, top], [0, 0], [0, 0.0]]), air_to=np.zeros(2))
    changes = speed_changes(motions, top)
    # u' = X - drag u and u' = -X - drag u
    gain_s, loss_s = -np.log(1 - drag * top / thrust) / drag, np.log(1 + drag * top / thrust) / drag
    covered_m = (thrust * gain_s - top) / drag + (top - thrust * loss_s) / drag
    exact_s = gain_s + loss_s + (way_m - covered_m) / top
    assert 0.97 * exact_s < changes.least_s(way_m, 0.0) <= exact_s
    assert changes.least_s(way_m, top) < changes.least_s(way_m, 0.0)
    assert speed_changes(motions, top, rounds=0).least_s(way_m, 0.0) <= changes.least_s(way_m, 0.0)
    assert changes.least_s(0.5, 0.0) > np.sqrt(4 * 0.5 / (thrust + drag * top + thrust))  # never up to speed


@pytest.mark.parametrize("ship", [AZIMUTHS, rudder_ship()], ids=["azimuths", "rudder"])
def test_no_motion_gains_or_loses_speed_faster_than_bounded(ship):
    rng, model = np.random.default_rng(4), ship.model
    motions = Motions.within(model, model.names, FASTEST, air_to=np.array([3.0, 2.0]))
    changes = speed_changes(motions, 1.6, rounds=3)
    points = rng.uniform(motions.low, motions.high, (20_000, len(motions.low)))
    base, gains = motions.regressors(tuple(points.T), NUMPY)
    force = motions.forces[rng.integers(len(motions.forces), size=len(points))] * rng.random((len(points), 1))
    speed = np.hypot(*points[:, :2].T)
    change = np.zeros(len(points))
    for index, (term, theta) in enumerate(zip(model.terms, model.parameters.tolist(), strict=True)):
        value = base[index] + sum(size * gain[index] for size, gain in zip(force.T, gains, strict=True))
        along = {"u": points[:, 0], "v": points[:, 1], "r": 0.0}[term.equation] / speed
        change = change + along * theta * value / model.time_scale_s
    kept = speed < 1.6
    place = np.searchsorted(changes.edges, speed[kept]) - 1
    assert (change[kept] <= changes.gain[place]).all()
    assert (-change[kept] <= changes.loss[place]).all()


def test_forces_inside_the_polytope_may_be_left_out_and_flat_ones_stay():
    rng = np.random.default_rng(5)
    points, directions = rng.standard_normal((60, 3)), rng.standard_normal((200, 3))
    kept = motions_module._outermost(points)
    assert len(kept) < len(points)
    assert (points[kept] @ directions.T).max(axis=0) == pytest.approx((points @ directions.T).max(axis=0))
    assert motions_module._outermost(points * [1.0, 1.0, 0.0]).tolist() == list(range(60))
