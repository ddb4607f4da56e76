"""Moments equal their definition, add over time, mirror, turn with the wind, and carry the Schur complement."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import WIND, example_dictionary, force_actuator, scored_example, spec, vessel
from expdesign.conventions import rotation
from expdesign.dictionary import Primitive, build_primitive
from expdesign.durations import bordered
from expdesign.errors import InputError, UnknownName
from expdesign.information import (
    MEAN_SUBTRACTIONS,
    PrimitiveInformation,
    estimated_parameters,
    log_det_or_none,
    moments,
    regressor_rows,
    score_primitives,
)
from expdesign.simulation import CALM, Environment, simulate
from expdesign.values import Array
from expdesign.vessel import Vessel

CASES = [("model-ship", "model-ship", CALM), ("azimuth-30m", "standard", CALM), ("azimuth-30m", "standard", WIND)]
cases = pytest.mark.parametrize(("ship", "dictionary", "sea"), CASES, ids=["model-ship", "calm", "wind"])


def scored(ship: str, dictionary: str, sea: Environment, **options: object) -> tuple[PrimitiveInformation, ...]:
    """Every third primitive of an example, scored."""
    return score_primitives(vessel(ship), example_dictionary(dictionary)[::3], environment=sea, **options)


def units(X: Array) -> Array:
    """(p,) root mean squares of the regressors, 1 where one is zero: the scale on which rounding counts."""
    return np.sqrt(np.where(np.diag(X) > 0, np.diag(X), 1.0))


def by_definition(ship: Vessel, primitive: Primitive, sea: Environment, heading: float) -> tuple[Array, Array]:
    """X and Y summed sample by sample from Phi (p x n): one column per output, zeros elsewhere."""
    current = rotation(heading).T @ sea.current_to
    run = simulate(
        ship,
        primitive.commands,
        pose=(0.0, 0.0, heading),
        velocity=primitive.entry_velocity + np.append(current, 0.0),
        environment=sea,
    )
    p, count = len(ship.model.names), len(primitive.commands)
    X, Y = np.zeros((p, p)), np.zeros((p, 3))
    for k in range(count):
        to_body = rotation(run.pose[k, 2]).T
        water = run.velocity[k] - np.append(to_body @ sea.current_to, 0.0)
        air = run.velocity[k, :2] - to_body @ sea.wind_to
        values = ship.model.regressors(water, air, primitive.commands.values[k])
        Phi = np.zeros((p, 3))
        for row, (term, number) in enumerate(zip(ship.model.terms, values, strict=True)):
            Phi[row, "uvr".index(term.equation)] = number
        X += Phi @ Phi.T / count
        Y += Phi / count
    return X, Y


@cases
def test_moments_are_the_sample_means_of_their_definition(ship: str, dictionary: str, sea: Environment):
    headings = np.arange(8) * np.pi / 4 if sea is WIND else [0.0]
    item = scored(ship, dictionary, sea)[1]
    runs = [by_definition(vessel(ship), item.primitive, sea, heading) for heading in headings]
    X, Y = np.mean([X for X, _ in runs], axis=0), np.mean([Y for _, Y in runs], axis=0)
    YZ = np.mean([Y @ Y.T for _, Y in runs], axis=0)
    scale = units(X)
    np.testing.assert_allclose(item.X / np.outer(scale, scale), X / np.outer(scale, scale), atol=1e-12)
    np.testing.assert_allclose(item.YZ / np.outer(scale, scale), YZ / np.outer(scale, scale), atol=1e-12)
    np.testing.assert_allclose(item.Y / scale[:, None], Y / scale[:, None], atol=1e-12)
    np.testing.assert_array_equal(item.Z, item.Y)


def test_in_calm_water_heading_and_averaging_do_not_matter():
    (item,) = score_primitives(vessel("model-ship"), example_dictionary("model-ship")[5:6])
    X, Y = by_definition(vessel("model-ship"), item.primitive, CALM, 1.234)
    np.testing.assert_allclose(item.X, X, rtol=1e-10, atol=1e-12 * X.max())
    np.testing.assert_allclose(item.YZ, Y @ Y.T, rtol=1e-8, atol=1e-12 * X.max())


def test_where_the_wind_blows_to_does_not_matter_when_headings_are_averaged():
    turned = Environment(wind_to=rotation(np.pi / 4) @ WIND.wind_to, current_to=rotation(np.pi / 4) @ WIND.current_to)
    for here, there in zip(*(scored("azimuth-30m", "standard", sea) for sea in (WIND, turned)), strict=True):
        scale = units(here.X)
        np.testing.assert_allclose(there.X / np.outer(scale, scale), here.X / np.outer(scale, scale), atol=1e-10)
        np.testing.assert_allclose(there.Y / scale[:, None], here.Y / scale[:, None], atol=1e-10)


@cases
@pytest.mark.parametrize("subtraction", MEAN_SUBTRACTIONS)
def test_the_design_matrix_of_every_primitive_is_positive_semidefinite(
    ship: str, dictionary: str, sea: Environment, subtraction: str
):
    for item in scored_example(dictionary, sea):
        B = bordered(item, subtraction)
        np.testing.assert_array_equal(B, B.T)
        scale = np.r_[units(item.X), np.ones(len(B) - len(item.X))]
        eigenvalues = np.linalg.eigvalsh(B / np.outer(scale, scale))
        assert eigenvalues[0] > -1e-13 * len(B)  # rounding of numbers of size one


@pytest.mark.parametrize("draw", range(5))
def test_the_log_det_after_mean_subtraction_is_that_of_the_bordered_matrix(draw: int):
    items = scored_example("standard", WIND) if draw % 2 else scored_example("model-ship")
    w = np.random.default_rng(draw).dirichlet(np.ones(len(items)))
    T, S, Z = (sum(share * getattr(item, name) for share, item in zip(w, items, strict=True)) for name in "XYZ")
    B = sum(share * bordered(item, "complete") for share, item in zip(w, items, strict=True))
    scale = units(T)
    subtracted = (T - S @ Z.T) / np.outer(scale, scale)
    padded = np.r_[scale, np.ones(S.shape[1])]
    whole = B / np.outer(padded, padded)
    rounding = 1e-14 * np.linalg.cond(whole)
    assert np.linalg.slogdet(subtracted)[1] == pytest.approx(np.linalg.slogdet(whole)[1], abs=rounding)


def test_information_adds_over_runs_one_after_the_other():
    ship = vessel("azimuth-30m")
    names = estimated_parameters(ship.model, ())
    batches = [
        regressor_rows(ship.model, primitive.trajectory, primitive.commands, WIND)
        for primitive in example_dictionary("standard")[:5]
    ]
    X, Y = moments(ship.model, np.concatenate(batches), names)
    samples = np.array([len(rows) for rows in batches])
    parts = [moments(ship.model, rows, names) for rows in batches]
    scale = units(X)
    summed = sum(n * part[0] for n, part in zip(samples, parts, strict=True)) / samples.sum()
    np.testing.assert_allclose(summed / np.outer(scale, scale), X / np.outer(scale, scale), atol=1e-13)
    summed = sum(n * part[1] for n, part in zip(samples, parts, strict=True)) / samples.sum()
    np.testing.assert_allclose(summed / scale[:, None], Y / scale[:, None], atol=1e-13)


def test_the_mirrored_primitive_has_the_same_information_with_mirrored_means():
    ship = vessel("azimuth-30m")
    ship = replace(ship, model=replace(ship.model, actuators=(force_actuator(),)))
    settings = {"duration_s": 60, "speed_mps": 1, "turn_speed_mps": 0.7, "entry_s": 20}
    starboard, port = score_primitives(
        ship,
        [build_primitive(ship, spec("turning_circle", **settings, yaw_rate_radps=side * 0.05, sway_mps=side * 0.1))
         for side in (1, -1)],
    )  # fmt: skip
    scale = units(starboard.X)
    np.testing.assert_allclose(port.X / np.outer(scale, scale), starboard.X / np.outer(scale, scale), atol=1e-12)
    np.testing.assert_allclose(port.Y / scale[:, None], starboard.Y / scale[:, None] * (1, -1, -1), atol=1e-12)
    assert np.abs(starboard.Y[:, 1:] / scale[:, None]).max() > 0.5


def test_fixed_parameters_are_left_out_of_every_matrix():
    fixed = ("X_kappa", "N_uv")
    names = estimated_parameters(vessel("azimuth-30m").model, fixed)
    kept = [name not in fixed for name in vessel("azimuth-30m").model.names]
    for all_, some in zip(
        scored("azimuth-30m", "standard", WIND),
        scored("azimuth-30m", "standard", WIND, fixed_parameters=fixed),
        strict=True,
    ):
        assert len(names) == 16 == len(some.X)
        np.testing.assert_array_equal(some.X, all_.X[np.ix_(kept, kept)])
        np.testing.assert_array_equal(some.Y, all_.Y[kept])


def test_unknown_parameters_or_subtractions_and_no_free_parameter_are_refused():
    ship = vessel("model-ship")
    with pytest.raises(UnknownName, match="'N_vu', did you mean 'N_uv'"):
        estimated_parameters(ship.model, ("N_vu",))
    with pytest.raises(InputError, match="expected at least one parameter to estimate"):
        estimated_parameters(ship.model, ship.model.names)
    with pytest.raises(UnknownName, match="'batches', did you mean 'batch'"):
        score_primitives(ship, example_dictionary("model-ship")[:1], mean_subtraction="batches")


@pytest.mark.parametrize("draw", range(5))
def test_log_det_is_that_of_the_eigenvalues_in_any_units(draw: int):
    rng = np.random.default_rng(draw)
    rows = rng.standard_normal((30, 6))
    matrix, units = rows.T @ rows, 10.0 ** rng.uniform(-8, 8, 6)
    value = log_det_or_none(matrix * np.outer(units, units), np.diag(matrix) * units**2)
    assert value == pytest.approx(np.log(np.linalg.eigvalsh(matrix)).sum() + 2 * np.log(units).sum(), abs=1e-10)


def test_a_straight_run_alone_does_not_inform_about_sway_and_a_rich_one_informs_about_all():
    straight, rich = score_primitives(vessel("azimuth-30m"), example_dictionary("standard")[::13], environment=WIND)
    assert straight.log_det_alone is None
    assert rich.log_det_alone is not None
    assert rich.log_det_alone == pytest.approx(np.linalg.slogdet(rich.X - rich.Y @ rich.Z.T)[1], rel=1e-9)
