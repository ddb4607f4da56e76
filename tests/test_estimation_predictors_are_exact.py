"""Predictors: the published nuisance regressors, exact recovery without noise, and what must not matter."""

from dataclasses import replace

import numpy as np
import pytest

from estimation_case import CURRENT, NOMINAL, QUIET, TRUE, commands, measured, record
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.estimation.disturbance import READINGS, current_moments
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import ESTIMATORS, METHODS, estimate, method_for, method_named, methods_for
from expdesign.estimation.regression import UNKNOWN, build_layout, build_regression
from expdesign.estimation.solve.solution import Weighting
from expdesign.signals import Batch
from expdesign.simulation import Environment, Variation
from expdesign.vessel import Sensors, Term

TRUTH = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
MERGED = {"X_abs_u_u": "W_abs_u_u", "Y_abs_v_v": "W_abs_v_v", "N_uv": "W_uv"}


def calm_trial(seed: int = 0, samples: int = 400, **kwargs) -> Batch:
    return measured(QUIET, commands(samples, np.random.default_rng(seed)), **kwargs)


def expected(name: str, names: tuple[str, ...]) -> float:
    """The truth, with air drag added where the method cannot tell it from water's."""
    air = MERGED.get(name)
    return TRUTH[name] + (TRUTH[air] if air and air not in names else 0.0)


def assert_true(found, rtol: float = 1e-6) -> None:
    truth = [expected(name, found.names) for name in found.names]
    np.testing.assert_allclose(found.values, truth, rtol=rtol, atol=1e-12)


def test_nuisance_regressors_are_the_published_ones() -> None:
    """(5.68)-(5.70) of F. Ljungberg's doctoral thesis."""
    layout = build_layout(TRUE.model, record(calm_trial()), predictor="augmented")
    both = ("cos psi", "sin psi")
    surge = {f"u: {x}{c}" for x in ("", "u ", "r ", "tau_x ") for c in both}
    sway = {f"v: {x}{c}" for x in ("", "v ", "r ") for c in both}
    yaw = {f"r: {x}{c}" for x in ("r ", "v ", "u ") for c in both}
    second = {f"{e}: {c}" for e in "uvr" for c in ("cos^2 psi", "sin 2psi")}
    assert {item.name for item in layout.nuisance} == surge | sway | yaw | second
    wind = build_layout(TRUE.model, record(calm_trial()), predictor="wind")
    assert {item.name for item in wind.nuisance} == {item.name for item in layout.nuisance}
    assert set(wind.parameters) - set(layout.parameters) == set(MERGED.values())


def test_reduced_sets_are_the_published_ones_for_still_water() -> None:
    """(6.5)-(6.7) of the same, but for sway's factor v, which the thesis leaves out because that fitted better."""
    data = record(calm_trial())
    still = build_layout(TRUE.model, data, predictor="no-current")
    both = ("cos psi", "sin psi")
    first = {f"{e}: {x} {c}" for e, x in (("u", "u"), ("v", "v"), ("r", "v"), ("r", "u")) for c in both}
    second = {f"{e}: {c}" for e in "uvr" for c in ("cos^2 psi", "sin 2psi")}
    assert {item.name for item in still.nuisance} == first | second
    everything = {item.name for item in build_layout(TRUE.model, data, predictor="augmented").nuisance}
    calm_air = {item.name for item in build_layout(TRUE.model, data, predictor="no-wind").nuisance}
    assert calm_air | {item.name for item in still.nuisance} == everything


@pytest.mark.parametrize(
    ("method", "weather"),
    [
        ("iv-no-current", Environment(wind_to=np.array([0.2, -0.15]))),
        ("iv-no-wind", Environment(current_to=CURRENT)),
    ],
)
def test_reduced_sets_remove_exactly_what_they_are_for(method: str, weather: Environment) -> None:
    batches = [calm_trial(seed, samples=900, weather=weather) for seed in (4, 5)]
    assert_true(estimate(record(*batches), NOMINAL, method=method), rtol=1e-5)


def test_still_water_without_terms_of_air_has_nothing_to_add() -> None:
    kept = [index for index, name in enumerate(NOMINAL.names) if name not in MERGED.values()]
    waterborne = replace(
        NOMINAL,
        terms=tuple(NOMINAL.terms[index] for index in kept),
        parameters=NOMINAL.parameters[kept],
        parameter_std=NOMINAL.parameter_std[kept],
    )
    with pytest.raises(InputError, match="needs terms of the velocity through the air"):
        estimate(record(calm_trial()), waterborne, method="iv-no-current")


@pytest.mark.parametrize("method", ["ls", "iv"])
def test_calm_noise_free_data_give_the_truth(method: str) -> None:
    batches = calm_trial(1), calm_trial(2, velocity=(1.0, 0.3, 0.05)), calm_trial(3, samples=90)
    assert_true(estimate(record(*batches), NOMINAL, method=method))


@pytest.mark.parametrize("mean", ["complete", "batch"])
def test_a_steady_current_is_removed_exactly_and_read_out(mean: str) -> None:
    weather = Environment(current_to=CURRENT)
    batches = [calm_trial(seed, samples=900, weather=weather) for seed in (4, 5)]
    found = estimate(
        record(*batches), NOMINAL, method="iv-augmented", settings=Settings(weighting=Weighting(mean=mean))
    )
    assert_true(found, rtol=1e-5)
    np.testing.assert_allclose(current_moments(found).mean, CURRENT, rtol=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("mean", ["none", "complete", pytest.param("batch", marks=pytest.mark.slow)])
def test_a_steady_current_of_two_parameters_is_found_whatever_the_moduli_do(mean: str) -> None:
    """Moduli change their sign here, which the nuisance regressors of (5.68)-(5.70) do not allow."""
    weather = Environment(current_to=CURRENT, wind_to=np.array([3.0, 2.0]))
    batches = [calm_trial(seed, samples=400, weather=weather, velocity=(0.0, 0.0, 0.0)) for seed in (4, 5)]
    weighting = Weighting(mean=mean)
    found = estimate(record(*batches), NOMINAL, method="iv-air-current", settings=Settings(weighting=weighting))
    assert_true(found, rtol=1e-6)
    np.testing.assert_allclose(current_moments(found).mean, CURRENT, rtol=1e-6)


@pytest.mark.parametrize("lost", ["X_u", "Y_v"])
def test_surge_and_sway_each_tell_the_current(lost: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the damping of one equation the other one's reading is left; both together are no less certain."""
    weather = Environment(current_to=CURRENT)
    noisy = replace(QUIET, sensors=Sensors(velocity_mps=0.01, yaw_rate_radps=0.01, heading_rad=0.01))
    rng = np.random.default_rng(12)
    batch = measured(noisy, commands(3000, rng), weather=weather)
    found = estimate(record(batch), NOMINAL, method="iv-augmented")
    both = current_moments(found, heading_std_rad=0.01)
    left = tuple(reading for reading in READINGS if reading[0] != lost)
    monkeypatch.setattr("expdesign.estimation.disturbance.READINGS", left)
    alone = current_moments(found, heading_std_rad=0.01)
    variance, wider = (np.diag(reading.covariance)[:2] for reading in (both, alone))
    for reading, spread in ((both, variance), (alone, wider)):
        assert (np.abs(reading.mean - CURRENT) < 5 * np.sqrt(spread)).all()
    assert (variance <= wider * (1 + 1e-9)).all()


def test_batches_excited_the_other_way_round_flip_the_signs_of_nuisance_terms() -> None:
    """(5.37): with the ship sailing astern and to port in one batch, moduli there are minus signs."""
    weather = Environment(current_to=CURRENT)
    ahead = calm_trial(6, samples=900, weather=weather)
    inputs = commands(900, np.random.default_rng(7)) * [-1, 1, -1, 1]
    astern = measured(QUIET, inputs, weather=weather, velocity=(-1.7, -0.7, 0.0))
    assert (astern.velocity[:, :2] < 0).all()
    assert (ahead.velocity[:, :2] > 0).all()
    found = estimate(record(ahead, astern), NOMINAL, method="iv-augmented")
    assert any("sign" in name for name in found.nuisance_names)
    assert_true(found, rtol=1e-5)


def test_differences_never_cross_batches() -> None:
    whole = calm_trial(8, samples=300)
    parts = [
        replace(whole, **{name: getattr(whole, name)[rows] for name in ("inputs", "velocity", "pose", "wind")})
        for rows in (slice(0, 120), slice(120, 300))
    ]
    layout = build_layout(TRUE.model, record(*parts), predictor="basic")
    rows = build_regression(layout, record(*parts)).regression
    assert len(rows) == 119 + 179
    one = build_regression(build_layout(TRUE.model, record(whole), predictor="basic"), record(whole)).regression
    np.testing.assert_array_equal(rows.Phi, np.delete(one.Phi, 119, axis=0))
    np.testing.assert_array_equal(rows.y, np.delete(one.y, 119, axis=0))


def test_rows_with_missing_numbers_are_left_out_and_said_so() -> None:
    batch = calm_trial(9)
    velocity = batch.velocity.copy()
    velocity[50:53, 1] = np.nan
    found = estimate(record(replace(batch, velocity=velocity)), NOMINAL, method="ls")
    assert found.residuals.left_out == 4
    assert any("4 samples with missing values are not used" in warning for warning in found.warnings)
    assert_true(found)


def test_parameters_held_fixed_move_to_the_left_side() -> None:
    batch = calm_trial(10)
    model = NOMINAL.with_parameters({"X_vr": TRUTH["X_vr"], "N_mu": TRUTH["N_mu"]})
    found = estimate(record(batch), model, method="iv", settings=Settings(fixed=("X_vr", "N_mu")))
    assert "X_vr" not in found.names
    assert found.held["N_mu"] == TRUTH["N_mu"]
    assert_true(found)


def test_a_continuous_model_is_estimated_in_its_own_form() -> None:
    batch = calm_trial(11)
    half = replace(TRUE.model, form="continuous", parameters=NOMINAL.parameters)
    slow = replace(batch, sample_time_s=0.5)  # the same numbers, sampled twice as fast: twice the parameters
    found = estimate(record(slow), half, method="iv")
    np.testing.assert_allclose(found.values / 2, [expected(name, found.names) for name in found.names], rtol=1e-6)


def test_generalised_forces_serve_as_well_as_actuators() -> None:
    batch = calm_trial(12)
    n1, a1, n2, a2 = batch.inputs.T
    force = np.stack(
        [n1 * np.cos(a1) + n2 * np.cos(a2), n1 * np.sin(a1) + n2 * np.sin(a2), np.zeros(len(batch))], axis=1
    )
    force[:, 2] = 9 * (n1 * np.sin(a1) - n2 * np.sin(a2))
    plain = replace(batch, inputs=force, input_names=("tau_x", "tau_y", "tau_psi"))
    one, other = (estimate(record(b), NOMINAL, method="iv") for b in (batch, plain))
    np.testing.assert_allclose(one.values, other.values, rtol=1e-8)


@pytest.mark.parametrize("method", ["ls-augmented", "iv-augmented", "iv-wind"])
def test_a_mirrored_ship_gives_mirrored_parameters(method: str) -> None:
    """Port for starboard: the symmetric parameters stay, one of an asymmetric term changes its sign."""
    model = replace(
        NOMINAL,
        terms=(*NOMINAL.terms, Term("v", "Y_walk", "tau_x")),
        parameters=np.append(NOMINAL.parameters, 0.0),
        parameter_std=np.append(NOMINAL.parameter_std, 0.0),
    )
    weather = Environment(
        current_to=CURRENT,
        wind_to=np.ones(2),
        current_variation=Variation(std_mps=0.03),
        wind_variation=Variation(std_mps=0.03),
    )
    batch = measured(TRUE, commands(1500, np.random.default_rng(13)), weather=weather)
    flipped = replace(
        batch,
        inputs=batch.inputs * [1, -1, 1, -1],
        velocity=batch.velocity * [1, -1, -1],
        pose=batch.pose * [1, -1, -1],
        wind=batch.wind * [1, -1],
    )
    settings = Settings(wind="measured", most_refinements=2)
    one, other = (estimate(record(b), model, method=method, settings=settings) for b in (batch, flipped))
    signs = np.where(np.array(one.names) == "Y_walk", -1.0, 1.0)
    np.testing.assert_allclose(other.values * signs, one.values, rtol=1e-6)
    np.testing.assert_allclose(other.std, one.std, rtol=1e-6)


def test_parameters_that_a_constant_speed_run_cannot_identify_are_named() -> None:
    inputs = np.tile([10.0, 0.0, 10.0, 0.0], (200, 1))
    batch = measured(QUIET, inputs, velocity=(1.7, 0.0, 0.0))
    steady = replace(batch, velocity=np.tile(batch.velocity[-1], (200, 1)))
    with pytest.raises(NotInformative, match="X_abs_u_u") as caught:
        estimate(record(steady), NOMINAL, method="ls")
    assert {"X_u", "X_abs_u_u", "X_mu", "Y_v", "N_r"} <= set(caught.value.parameters)


def test_unusable_requests_say_what_is_missing() -> None:
    batch = calm_trial(14)
    with pytest.raises(UnknownName, match="iv-augmented"):
        estimate(record(batch), NOMINAL, method="iv-augmentd")
    with pytest.raises(InputError, match="no measured wind"):
        estimate(record(replace(batch, wind=None)), NOMINAL, method="ls-wind")
    with pytest.raises(InputError, match="no measured heading"):
        estimate(record(replace(batch, pose=None)), NOMINAL, method="ls-augmented")
    with pytest.raises(UnknownName, match="did you mean 'X_u'"):
        estimate(record(batch), NOMINAL, settings=Settings(fixed=("Xu",)))
    with pytest.raises(InputError, match="expected n1, a1, n2, a2"):
        estimate(record(replace(batch, input_names=("n1", "a1", "n2", "rudder1"))), NOMINAL)
    assert len({method.name for method in METHODS}) == len(METHODS)


def test_a_method_is_an_estimator_and_what_is_unknown_of_the_weather_and_keeps_its_name() -> None:
    """Names as scripts outside have them."""
    assert {method.name for method in METHODS} == {
        "ls", "ls-air", "ls-augmented", "ls-wind", "ls-no-current", "ls-no-wind", "iv", "iv-air", "iv-augmented",
        "iv-wind", "iv-no-current", "iv-no-wind", "iv-current", "iv-air-current", "oe", "oe-air", "oe-current",
        "oe-air-current",
    }  # fmt: skip
    for method in METHODS:
        weather = method.weather
        assert method_for(method.solver, weather.unknown, wind=weather.wind) == method_named(method.name) == method
    assert methods_for((), "nothing", wind=True) == ("ls-air", "iv-air", "oe-air")
    assert methods_for((), "both", wind=True) == ("ls-augmented", "iv-augmented")
    assert methods_for(("oe", "iv"), "steady-current", wind=False) == ("oe-current", "iv-current")
    for solver in ESTIMATORS:
        for unknown in UNKNOWN:
            method = method_for(solver, unknown, wind=False)
            if method is None:
                with pytest.raises(InputError, match=f"{solver} has no method for {unknown} unknown, expected one of"):
                    methods_for((solver,), unknown, wind=False)
            else:
                assert (method.solver, method.weather.unknown, method.weather.wind) == (solver, unknown, False)
    with pytest.raises(UnknownName, match="unknown estimator 'iv-air'"):
        methods_for(("iv-air",), "current", wind=True)
    with pytest.raises(UnknownName, match="known: nothing, current, wind, both, steady-current"):
        methods_for((), "currents and tides", wind=True)
