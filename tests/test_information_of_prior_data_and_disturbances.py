"""Information with nuisance regressors, of measured data, and slopes of outcomes, each against another way to it."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import CALM, Environment, example_dictionary, vessel
from expdesign.dictionary import Primitive
from expdesign.durations import DurationProblem, bordered, build_durations, optimal_shares
from expdesign.errors import InputError
from expdesign.estimation.methods import method_named
from expdesign.estimation.regression import build_layout, model_for
from expdesign.indices import outcome_gradients, outcomes
from expdesign.information import score_primitives
from expdesign.information.disturbed import score_augmented
from expdesign.information.recorded import pooled, recorded_information
from expdesign.signals import Batch, Record
from expdesign.simulation import simulate, steady_ahead
from expdesign.values import Array

BREEZE = Environment(wind_to=np.array([3.0, 2.0]))
FEW = example_dictionary("standard")[::4]


def scaled(matrix: Array, other: Array) -> tuple[Array, Array]:
    """Both in units of the second one's diagonal."""
    size = np.sqrt(np.where(np.diag(other) > 0, np.diag(other), 1.0))
    return matrix / np.outer(size, size), other / np.outer(size, size)


@pytest.mark.parametrize("predictor", ["wind", "augmented"])
@pytest.mark.parametrize("sea", [CALM, BREEZE], ids=["calm", "breeze"])
def test_information_about_the_ship_is_a_block_of_that_with_disturbances(predictor: str, sea: Environment):
    ship = vessel("azimuth-30m")
    wide = score_augmented(ship, FEW, predictor=predictor, environment=sea)
    assert wide.parameters[: len(wide.interest)] == wide.interest
    place = [ship.model.names.index(name) for name in wide.interest]
    p = len(place)
    for item, plain in zip(wide.information, score_primitives(ship, FEW, environment=sea), strict=True):
        np.testing.assert_allclose(*scaled(item.X[:p, :p], plain.X[np.ix_(place, place)]), atol=1e-10)
        np.testing.assert_allclose(*scaled(item.YZ[:p, :p], plain.YZ[np.ix_(place, place)]), atol=1e-10)
        size = np.sqrt(np.where(np.diag(item.X) > 0, np.diag(item.X), 1.0))[:, None]
        np.testing.assert_allclose(item.Y[:p] / size[:p], plain.Y[place] / size[:p], atol=1e-10)
        eigenvalues = np.linalg.eigvalsh(item.X / (size * size.T))
        assert eigenvalues[0] > -1e-12  # mean squares


def test_unknown_disturbances_never_add_information_about_the_ship():
    ship, primitives = vessel("azimuth-30m"), example_dictionary("standard")
    wide = score_augmented(ship, primitives, predictor="wind", environment=BREEZE)
    p = len(wide.interest)
    plain = score_primitives(ship, primitives, environment=BREEZE)
    known, along = (np.array([bordered(item, "complete") for item in items]) for items in (plain, wide.information))
    for w in np.random.default_rng(0).dirichlet(np.ones(len(primitives)), 20):
        whole, own = np.tensordot(w, along, axes=1), np.tensordot(w, known, axes=1)
        whole, own = scaled(whole, whole)[0], scaled(own, own)[0]
        rest = slice(p, len(whole))
        left = whole[:p, :p] - whole[:p, rest] @ np.linalg.pinv(whole[rest, rest], hermitian=True) @ whole[rest, :p]
        alone = own[:p, :p] - own[:p, p:] @ np.linalg.solve(own[p:, p:], own[p:, :p])
        assert np.linalg.eigvalsh(alone - left)[0] > -1e-8
        assert np.trace(left) < 0.9 * np.trace(alone)


def measured(primitive: Primitive, heading: float = 0.0) -> Batch:
    """A run in calm water as perfect sensors see it."""
    run = simulate(vessel("azimuth-30m"), primitive.commands, pose=(0, 0, heading), velocity=primitive.entry_velocity)
    return Batch(
        name=primitive.name,
        sample_time_s=primitive.commands.sample_time_s,
        input_names=primitive.commands.names,
        inputs=primitive.commands.values,
        velocity=run.velocity[:-1],
        pose=run.pose[:-1],
    )


def of_water() -> tuple[str, ...]:
    return tuple(name for name in vessel("azimuth-30m").model.names if not name.startswith("W_"))


@pytest.mark.parametrize("subtraction", ["none", "batch", "complete"])
@pytest.mark.parametrize("regressors", ["measured", "simulated"])
def test_data_of_a_simulated_run_have_the_information_of_the_run(subtraction: str, regressors: str):
    ship, names, air = vessel("azimuth-30m"), of_water(), ("W_abs_u_u", "W_abs_v_v", "W_uv")
    shorter = [  # the last sample of data has no successor, so it does not count
        replace(primitive, commands=replace(primitive.commands, values=primitive.commands.values[:-1]))
        for primitive in FEW
    ]
    scored = score_primitives(ship, shorter, fixed_parameters=air, mean_subtraction=subtraction)
    record = Record(batches=tuple(measured(primitive) for primitive in FEW))
    batches = recorded_information(record, ship.model, names, regressors=regressors)
    problem = build_durations(scored, names, total_s=3600.0, mean_subtraction=subtraction)
    squares = np.mean([np.diag(item.X) for item in scored], axis=0)
    size = np.sqrt(np.r_[squares, np.ones(problem.dimension - len(squares))])
    units = np.outer(size, size)  # before means are taken off, which leaves rounding of numbers of this size
    for batch, B, primitive in zip(batches, problem.matrices, shorter, strict=True):
        assert batch.samples == len(primitive.commands)
        np.testing.assert_allclose(batch.bordered(subtraction) / units, B / units, atol=1e-12)
    # Pooled data are all their samples: N_prior times B of each, added.
    matrix, samples = pooled(batches, subtraction)
    parts = sum(len(item.commands) * B for item, B in zip(shorter, problem.matrices, strict=True))
    np.testing.assert_allclose(matrix / units, parts / (samples * units), atol=1e-12)


def test_pooling_no_batches_is_refused():
    with pytest.raises(InputError, match="pooling needs batches"):
        pooled((), "complete")


def prior_problem() -> DurationProblem:
    air = ("W_abs_u_u", "W_abs_v_v", "W_uv")
    scored = score_primitives(vessel("azimuth-30m"), example_dictionary("standard"), fixed_parameters=air)
    return build_durations(scored, of_water(), total_s=3600.0)


@pytest.mark.parametrize("draw", range(3))
def test_data_from_before_never_take_anything_away(draw: int):
    problem = prior_problem()
    run = int(np.random.default_rng(draw).integers(len(problem.names)))
    values = [optimal_shares(replace(problem, prior=c * problem.matrices[run])).log_det for c in (0.0, 0.1, 0.3, 1.0)]
    assert (np.diff(values) > -1e-6).all()


def test_a_parameter_known_beyond_doubt_no_longer_decides_what_is_run():
    problem = prior_problem()
    index = problem.parameters.index("N_r")
    known = np.zeros((problem.dimension,) * 2)
    known[index, index] = 1e9 * problem.matrices[:, index, index].max()
    kept = [i for i in range(problem.dimension) if i != index]
    without = DurationProblem(
        names=problem.names,
        parameters=tuple(name for name in problem.parameters if name != problem.parameters[index]),
        mean_subtraction=problem.mean_subtraction,
        matrices=problem.matrices[:, kept][:, :, kept],
        run_s=problem.run_s,
        total_s=problem.total_s,
    )
    design, other = optimal_shares(replace(problem, prior=known)), optimal_shares(without)
    np.testing.assert_allclose(design.fractions, other.fractions, atol=1e-4)


def test_slopes_of_outcomes_are_those_of_a_straight_line_through_other_steps():
    ship = vessel("azimuth-30m")
    wanted, parameters = ("advance_m",), ("X_u", "N_r")
    _, gradients = outcome_gradients(ship, wanted, parameters)
    speed = float(steady_ahead(ship).velocity[0])
    for column, name in enumerate(parameters):
        index = ship.model.names.index(name)
        steps = np.array([-4e-3, -2e-3, 2e-3, 4e-3]) * abs(ship.model.parameters[index])
        table = []
        for step in steps:
            theta = np.array(ship.model.parameters)
            theta[index] += step
            values = outcomes(ship, speed_mps=speed, parameters=theta, names=wanted)
            table.append([values[item] for item in wanted])
        slopes = np.polyfit(steps, np.array(table), 3)[-2]
        size = np.abs(gradients).max(axis=1) * 1e-2
        assert (np.abs(gradients[:, column] - slopes) <= 1e-3 * np.abs(slopes) + 1e-2 * size).all()


@pytest.mark.parametrize("predictor", ["augmented", "wind", "no-current", "no-wind"])
def test_designs_and_estimates_have_the_same_columns(predictor: str):
    """Reduced sets, (6.5) to (6.7), too: what a design counts is what the method of that name estimates."""
    ship = vessel("azimuth-30m")
    wide = score_augmented(ship, FEW, predictor=predictor, environment=BREEZE)
    primitive = FEW[0]
    run = simulate(ship, primitive.commands, velocity=primitive.entry_velocity, standing=primitive.entry_inputs)
    batch = Batch(
        name="run",
        sample_time_s=ship.sample_time_s,
        input_names=primitive.commands.names,
        inputs=primitive.commands.values,
        velocity=run.velocity[:-1],
        pose=run.pose[:-1],
        wind=run.velocity[:-1, :2] - np.array([3.0, 2.0]),
    )
    record = Record(batches=(batch,))
    layout = build_layout(model_for(ship.model, record), record, predictor=predictor)
    assert method_named(f"iv-{predictor}").weather.name == predictor
    assert set(wide.parameters) == set(layout.names)
    assert wide.interest == layout.parameters
