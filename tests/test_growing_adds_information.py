"""A grown dictionary satisfies its limits, gains as much as certified, and bounds the sensitivities that were found."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from design_case import WIND, example_dictionary, scored_example, spec, vessel
from expdesign.dictionary import FAMILIES, build_primitive, family
from expdesign.dictionary.build import excite_many
from expdesign.durations import bordered, build_durations, solve_durations
from expdesign.errors import InputError, UnknownName
from expdesign.growing.loop import grow_dictionary, motion_limits, optimum, sensitivity
from expdesign.growing.search import GrowSettings, Growth, Measure, Worth, family_spaces, pool_of, refined, violation
from expdesign.information import MEAN_SUBTRACTIONS, score_primitives
from expdesign.information.disturbed import bordered_runs
from expdesign.simulation import CALM, Environment
from rudder_ship import rudder_ship

SMALL = GrowSettings(rounds=3, pool=32, run_s=12.5, families=("zigzag", "turning_circle", "multisine"))


@cache
def grown(*, free_form: bool = False) -> Growth:
    """tau1 to tau11 grown a little."""
    settings = replace(SMALL, rounds=2, free_form=free_form)
    return grow_dictionary(vessel("model-ship"), scored_example("model-ship"), settings=settings)


@pytest.mark.parametrize("ship", ["model-ship", "azimuth-30m"])
@pytest.mark.parametrize("sea", [CALM, WIND], ids=["calm", "wind"])
@pytest.mark.parametrize("mean", MEAN_SUBTRACTIONS)
def test_candidates_simulated_together_have_the_information_of_primitives(ship: str, sea: Environment, mean: str):
    nominal, run_s = vessel(ship), {"model-ship": 20.0, "azimuth-30m": 60.0}[ship]
    top = {"model-ship": (0.8, 0.1, 0.2), "azimuth-30m": (1.0, 0.2, 0.04)}[ship]
    limits = np.array([(0.0, top[0]), (-top[1], top[1]), (-top[2], top[2])])
    spaces = family_spaces(nominal, tuple(item for item in FAMILIES if not item.closed_loop), limits, run_s)
    specs = [space.spec(np.full(len(space.axes), 0.6)) for space in spaces]
    runs = excite_many(nominal, specs)
    specs = [item for item, fine in zip(specs, runs.possible, strict=True) if fine]
    assert len(specs) >= 10
    possible = runs.possible > 0
    names = nominal.model.names
    matrices, motion = bordered_runs(
        nominal, runs.commands[possible], runs.velocity[possible], names, environment=sea, mean_subtraction=mean
    )
    primitives = [build_primitive(nominal, item) for item in specs]
    scored = score_primitives(nominal, primitives, environment=sea, mean_subtraction=mean)
    for item, matrix, velocity in zip(scored, matrices, motion, strict=True):
        exact = bordered(item, mean)
        scale = np.sqrt(np.maximum(np.diag(bordered(item, "none" if mean == "none" else "complete")), 1e-30))
        scale = scale[: len(exact)]
        np.testing.assert_allclose(matrix / np.outer(scale, scale), exact / np.outer(scale, scale), atol=1e-7)
        np.testing.assert_allclose(velocity, item.primitive.trajectory.velocity, atol=1e-9)


@pytest.mark.thorough
def test_every_addition_gains_and_none_gains_more_than_concavity_allows():
    growth = grown()
    assert growth.rounds
    for row in growth.rounds:
        assert 0 < row.log_det_gain <= row.sensitivity - growth.dimension
        assert row.sensitivity == pytest.approx(row.searched, rel=1e-6)  # together and alone are the same run
    efficiencies = [row.efficiency for row in growth.rounds]
    assert efficiencies == sorted(efficiencies)


def test_the_gains_add_up_to_the_certified_optimum():
    growth = grown()
    first, last = (
        solve_durations(build_durations(items, vessel("model-ship").model.names, total_s=2000.0))
        for items in (scored_example("model-ship"), growth.information)
    )
    assert sum(row.log_det_gain for row in growth.rounds) == pytest.approx(last.log_det - first.log_det, abs=1e-6)
    gain = np.exp((last.log_det - first.log_det) / growth.parameters)
    assert growth.rounds[-1].efficiency == pytest.approx(gain, rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("free_form", [False, True])
def test_additions_keep_to_the_velocities_and_to_the_actuators_limits(free_form: bool):
    growth, ship = grown(free_form=free_form), vessel("model-ship")
    span = np.diff(growth.limits, axis=1)[:, 0]
    rate = ship.rates * ship.sample_time_s
    for item in growth.information[-len(growth.rounds) :]:
        velocity = item.primitive.trajectory.velocity
        assert (velocity >= growth.limits[:, 0] - 1e-6 * span).all()
        assert (velocity <= growth.limits[:, 1] + 1e-6 * span).all()
        commands = np.vstack([item.primitive.entry_inputs, item.primitive.commands.values])
        assert all(
            (np.abs(column) <= limit.high + 1e-6).all() for column, limit in zip(commands.T, ship.limits, strict=True)
        )
        assert (np.abs(np.diff(commands, axis=0)) <= rate * (1 + 1e-9)).all()


def test_freely_optimised_commands_tell_more_than_the_candidate_they_began_as_and_end_straight():
    growth, plain = grown(free_form=True), grown()
    row, item = growth.rounds[0], growth.information[len(scored_example("model-ship"))]
    assert row.family == "recorded"
    assert row.searched == pytest.approx(plain.rounds[0].sensitivity, rel=1e-6)
    assert row.sensitivity > 1.3 * row.searched
    span = np.diff(growth.limits, axis=1)[:, 0]
    assert (np.abs(item.primitive.exit_velocity[1:]) <= 0.01 * span[1:]).all()


@pytest.mark.thorough
def test_the_same_seed_grows_the_same_and_another_seed_looks_elsewhere():
    ship, information = vessel("model-ship"), scored_example("model-ship")
    given = replace(SMALL, rounds=1, pool=8)
    first, again, other = (
        grow_dictionary(ship, information, settings=replace(given, seed=seed)).rounds[0].settings for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


def test_a_familys_candidates_and_steps_do_not_depend_on_the_others_that_are_searched():
    ship, limits = vessel("model-ship"), np.array([(0.0, 0.8), (-0.1, 0.1), (-0.2, 0.2)])
    names, few = ship.model.names, ("zigzag", "multisine")
    measure = Measure(vessel=ship, names=names, environment=CALM, mean_subtraction="complete", limits=limits)
    worth = Worth(gradient=np.eye(len(names) + 3))  # bordered by the means of three equations

    def searched(families: tuple[str, ...], run_s: float = 12.5) -> dict[str, np.ndarray]:
        spaces = family_spaces(ship, tuple(family(name) for name in families), limits, run_s)
        archives = pool_of(spaces, measure, 8, 1)
        archives = refined(archives, worth, measure, np.random.default_rng(1))
        return {archive.space.family.name: archive.points for archive in archives}

    alone, among = searched(few), searched(("turning_circle", "multisine", "acceleration", "zigzag"))
    for name in few:
        assert len(alone[name]) > 8
        np.testing.assert_array_equal(alone[name], among[name])
    assert not np.array_equal(alone["zigzag"][:8], searched(few, run_s=25.0)["zigzag"][:8])


@pytest.mark.thorough
def test_what_is_left_is_the_largest_sensitivity_of_all_that_was_looked_at():
    # Grown from one family with one searched setting, so that all of it can be looked at from outside.
    ship = vessel("model-ship")
    growth = grow_dictionary(
        ship, scored_example("model-ship"), settings=GrowSettings(families=("acceleration",), pool=64, tolerance=1e-3)
    )
    best = optimum(growth.information, "complete")
    (space,) = family_spaces(ship, (family("acceleration"),), growth.limits, 37.5)
    points = np.random.default_rng(5).random((300, len(space.axes)))
    specs = [space.spec(point) for point in points]
    runs = excite_many(ship, specs)
    matrices, motion = bordered_runs(
        ship, runs.commands, runs.velocity, ship.model.names, environment=CALM, mean_subtraction="complete"
    )
    d = np.einsum("ij,nji->n", best.inverse, matrices)
    allowed = (runs.possible > 0) & (violation(motion, growth.limits) <= 1e-9)
    assert growth.best_left <= 1.001 * growth.dimension
    assert d[allowed].max() <= 1.01 * growth.dimension  # random points are no better than the search
    assert growth.efficiency_left >= 0.99
    for item in growth.information:
        assert sensitivity(best, item, "complete") <= growth.dimension * (1 + 1e-6)


@pytest.mark.thorough
def test_a_ship_with_propeller_and_rudder_grows_from_families_of_all_kinds():
    ship = rudder_ship()
    runs = [
        build_primitive(ship, spec("turning_circle_helm", duration_s=100, speed_mps=4.0, helm_rad=0.3)),
        build_primitive(ship, spec("crash_stop", duration_s=100, speed_mps=4.0, astern=0.5)),
        build_primitive(ship, spec("steps", duration_s=100, speed_mps=3.0, helm_rad=0.3, hold_s=9, engine_swing=0.3)),
    ]
    information = score_primitives(ship, runs)
    settings = GrowSettings(rounds=1, pool=16, families=("steps", "pull_out", "zigzag"))
    growth = grow_dictionary(ship, information, settings=settings)
    assert growth.rounds[0].efficiency > 1
    helm = replace(settings, families=("steps", "pull_out"))  # velocities are no settings of these
    assert grow_dictionary(ship, information, settings=helm).rounds[0].efficiency > 1


def test_limits_are_those_stated_or_the_range_of_the_dictionary():
    runs = example_dictionary("model-ship")
    spans = motion_limits(GrowSettings(), runs)
    velocity = np.concatenate([run.trajectory.velocity for run in runs])
    np.testing.assert_array_equal(spans, np.stack([velocity.min(axis=0), velocity.max(axis=0)], axis=1))
    stated = motion_limits(GrowSettings(limits={"v_mps": (-0.1, 0.3)}), runs)
    np.testing.assert_array_equal(stated, [spans[0], (-0.1, 0.3), spans[2]])


@pytest.mark.parametrize(
    ("settings", "error", "says"),
    [
        (GrowSettings(limits={"w_mps": (0.0, 1.0)}), UnknownName, "'w_mps', did you mean 'v_mps'"),
        (GrowSettings(limits={"v_mps": (1.0, 0.0)}), InputError, r"limits.v_mps is \[1, 0\], expected low below high"),
        (GrowSettings(families=("zigzagg",)), UnknownName, "'zigzagg', did you mean 'zigzag'"),
        (
            GrowSettings(families=("recorded",)),
            InputError,
            "vessel 'model-ship' can run no searched manoeuvre family",
        ),
    ],
)
def test_wrong_settings_are_named(settings: GrowSettings, error: type, says: str):
    with pytest.raises(error, match=says):
        grow_dictionary(vessel("model-ship"), scored_example("model-ship"), settings=settings)
