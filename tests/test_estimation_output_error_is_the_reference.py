"""Output error: exact without noise, as good as the noise allows with it, and in agreement with IV."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from estimation_case import CURRENT, NOMINAL, QUIET, TRUE, commands, measured, record
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.disturbance import current_moments
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.output_error import minimise
from expdesign.estimation.replay import Stretches, compiled
from expdesign.estimation.replay.replay import Integration, build_replay, simulate_batch, start_state
from expdesign.signals import Batch, Record, fit_percent
from expdesign.simulation import Environment, Variation, motion_rates, simulate
from expdesign.vessel import VesselModel
from measured_trials import MODEL_SHIP_TRUE, model_ship_commands, prompt

TRUTH = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
MERGED = {"X_abs_u_u": "W_abs_u_u", "Y_abs_v_v": "W_abs_v_v", "N_uv": "W_uv"}


def trials(vessel, seeds: tuple[int, ...] = (1, 2), samples: int = 700):
    rng = np.random.default_rng(41)
    return record(*(measured(vessel, commands(samples, rng), seed=seed) for seed in seeds))


def truth(names: tuple[str, ...]) -> np.ndarray:
    return np.array([TRUTH[name] + TRUTH.get(MERGED.get(name, ""), 0.0) for name in names])


def test_noise_free_data_give_the_truth() -> None:
    found = estimate(trials(QUIET), NOMINAL, method="oe")
    np.testing.assert_allclose(found.values, truth(found.names), rtol=1e-6)


def test_it_beats_instruments_and_both_agree_within_their_uncertainty() -> None:
    data = trials(TRUE)
    found, other = estimate(data, NOMINAL, method="oe"), estimate(data, NOMINAL, method="iv")
    assert (found.std < other.std).all()
    assert (np.abs(found.values - truth(found.names)) < 4.5 * found.std).all()
    assert (np.abs(found.values - other.values) < 4.5 * np.hypot(found.std, other.std)).all()
    noise = [TRUE.sensors.velocity_mps] * 2 + [TRUE.sensors.yaw_rate_radps]
    count = found.residuals.rows
    np.testing.assert_allclose(found.residuals.std, noise, rtol=4.5 / np.sqrt(2 * count) + 0.01)
    assert (np.abs(found.residuals.correlation) < 4.5 / np.sqrt(count)).all()


def test_without_forces_the_covariance_is_the_inverse_of_the_information() -> None:
    """Sensors alone: J^T Q J, with derivatives J by the parameters and first velocities, and variances 1 / Q."""
    data = trials(TRUE)
    found = estimate(data, NOMINAL, method="oe")
    model = found.model(NOMINAL)
    places = [model.names.index(name) for name in found.names]
    information = np.zeros((len(places),) * 2)
    for batch in data.batches:
        ready = compiled(
            Stretches(
                model=model,
                sought=tuple(places),
                states=(0, 1, 2),
                drive=batch.inputs[:, None],
                windy=False,
                sample_time_s=1.0,
                integrator="euler",
                substeps=1,
            )
        )
        values = np.append(found.values, np.zeros(3))[None]
        by_values, by_start = ready.sensitivities(values, ready.states(values, batch.velocity[:1]))
        J, S = by_values[:, 0, :, : len(places)], by_start[:, 0]
        noise = np.array([TRUE.sensors.velocity_mps] * 2 + [TRUE.sensors.yaw_rate_radps])
        J, S = ((rows / noise[:, None]).reshape(-1, rows.shape[2]) for rows in (J, S))
        information += J.T @ J - J.T @ S @ np.linalg.solve(S.T @ S, S.T @ J)
    expected = np.sqrt(np.diag(np.linalg.inv(information)))
    assert (found.std > 0.93 * expected).all()  # variances are known to 4 %, and forces found that are not there
    assert np.median(found.std / expected) < 1.15


@pytest.mark.thorough
def test_forces_that_nobody_measured_widen_its_intervals() -> None:
    """A wandering current is seen few times, while sensors are read at every sample."""
    errors, alone = [], estimate(trials(TRUE), NOMINAL, method="oe").std
    weather = Environment(current_variation=Variation(std_mps=0.03, correlation_s=100.0))
    for seed in range(4):
        inputs = commands(700, np.random.default_rng(seed))
        found = estimate(record(measured(TRUE, inputs, weather=weather, seed=seed)), NOMINAL, method="oe")
        errors.append((found.values - truth(found.names)) / found.std)
        assert np.median(found.std / alone) > 1.5
    assert np.sqrt(np.mean(np.square(errors))) < 2.0, errors


def test_no_neighbouring_model_simulates_the_data_better() -> None:
    """The weighted simulation error, each time with the best first velocity, is least along every parameter."""
    batch = trials(TRUE, seeds=(3,), samples=500).batches[0]
    found = estimate(record(batch), NOMINAL, method="oe")
    replay = build_replay(NOMINAL, record(batch))

    def error(values: np.ndarray) -> float:
        assignments = dict(zip(found.names, values.tolist(), strict=True))
        parameters = NOMINAL.with_parameters({**found.held, **assignments}).parameters

        def residuals(start: np.ndarray) -> np.ndarray:
            simulated = replay.states(measured_from(batch, start), parameters)[:, 3:]
            return ((batch.velocity - simulated) / found.residuals.std).ravel()

        return 2 * least_squares(residuals, batch.velocity[0], xtol=1e-10).cost

    best = error(found.values)
    for index, std in enumerate(found.std):
        for sign in (-1, 1):
            moved = found.values.copy()
            moved[index] += sign * 0.3 * std
            assert error(moved) > best


def measured_from(batch, start):
    """The batch with another first velocity, where simulations begin."""
    velocity = batch.velocity.copy()
    velocity[0] = start
    return replace(batch, velocity=velocity)


@pytest.mark.parametrize(("integrator", "windy"), [("rk4", False), ("euler", True)])
@pytest.mark.parametrize("flowing", [False, True])
def test_sensitivities_are_derivatives(integrator: str, windy: bool, flowing: bool) -> None:
    """Of two stretches side by side, by parameters, a current, constants and starts."""
    batch = trials(QUIET, seeds=(1,), samples=80).batches[0]
    blown = 3 * np.random.default_rng(2).normal(size=(40, 2, 2))
    drive = np.stack([batch.inputs[:40], batch.inputs[40:]], axis=1)
    course = np.stack([np.cos(blown[..., 0]), np.sin(blown[..., 0])], axis=2)
    stretches = Stretches(
        model=TRUE.model,
        sought=(0, 6, 12),
        states=(0, 1, 2),
        drive=np.concatenate([drive, *([blown] if windy else []), *([course] if flowing else [])], axis=2),
        windy=windy,
        flowing=flowing,
        sample_time_s=1.0,
        integrator=integrator,
        substeps=1,
    )
    ready = compiled(stretches)
    current = (0.2, -0.1) if flowing else ()
    values = np.tile([*TRUE.model.parameters[[0, 6, 12]], *current, 1e-3, -2e-3, 1e-4], (2, 1))
    start = batch.velocity[[0, 40]]
    by_values, by_start = ready.sensitivities(values, ready.states(values, start))
    for index in range(values.shape[1]):
        step = 1e-6 * np.eye(values.shape[1])[index]
        numeric = (ready.states(values + step, start) - ready.states(values - step, start)) / 2e-6
        np.testing.assert_allclose(by_values[..., index], numeric, rtol=1e-5, atol=1e-6)
    for index in range(3):
        step = 1e-6 * np.eye(3)[index]
        numeric = (ready.states(values, start + step) - ready.states(values, start - step)) / 2e-6
        np.testing.assert_allclose(by_start[..., index], numeric, rtol=1e-5, atol=1e-6)


def test_a_simulated_fit_is_near_what_the_noise_allows() -> None:
    data = trials(TRUE)
    found = estimate(data, NOMINAL, method="oe")
    for batch in data.batches:
        simulated = simulate_batch(found.model(NOMINAL), batch).velocity
        noise = np.array([TRUE.sensors.velocity_mps] * 2 + [TRUE.sensors.yaw_rate_radps])
        best = 100 * (1 - noise / batch.velocity.std(axis=0))
        assert (fit_percent(batch.velocity, simulated) > best - 3).all()


def test_batches_of_different_sample_times_are_refused() -> None:
    one, other = trials(QUIET, samples=100).batches
    with pytest.raises(InputError, match="one sample time"):
        estimate(record(one, replace(other, sample_time_s=0.5)), NOMINAL, method="oe")


def windy_trials() -> Record:
    weather = Environment(wind_to=np.array([4.0, -3.0]), wind_variation=Variation(std_mps=1.0))
    rng = np.random.default_rng(6)
    return record(*(measured(TRUE, commands(900, rng), weather=weather, seed=seed) for seed in (1, 2)))


@pytest.mark.thorough
def test_measured_wind_leads_to_the_air_terms_and_without_it_the_wind_is_misfit() -> None:
    data = windy_trials()
    found, calm = (estimate(data, NOMINAL, method=name) for name in ("oe-air", "oe"))
    exact = np.array([TRUTH[name] for name in found.names])
    assert (np.abs(found.values - exact) < 4.5 * found.std).all()
    assert (calm.residuals.std[:2] > 2 * found.residuals.std[:2]).all()


@pytest.mark.parametrize("method", ["oe-current", "oe-air-current"])
def test_a_steady_current_is_estimated_with_the_parameters(method: str) -> None:
    wind = np.array([3.0, 2.0]) if "air" in method else np.zeros(2)
    weather = Environment(current_to=CURRENT, wind_to=wind)
    rng = np.random.default_rng(43)
    data = record(*(measured(QUIET, commands(400, rng), weather=weather, seed=seed) for seed in (1, 2)))
    model = NOMINAL if "air" in method else without_air(NOMINAL)
    fixed = () if "air" in method else tuple(MERGED.values())
    found = estimate(data, model, method=method, settings=Settings(fixed=fixed))
    np.testing.assert_allclose(found.values, [TRUTH[name] for name in found.names], rtol=1e-6)
    np.testing.assert_allclose(current_moments(found).mean, CURRENT, rtol=1e-6)


def without_air(model: VesselModel) -> VesselModel:
    """With the true drag in still air, to be held."""
    return model.with_parameters({name: TRUTH[name] for name in MERGED.values()})


def test_a_current_that_nobody_knows_needs_a_heading() -> None:
    blind = record(*(replace(batch, pose=None) for batch in trials(TRUE, samples=200).batches))
    with pytest.raises(InputError, match="heading"):
        estimate(blind, NOMINAL, method="oe-current")


def test_a_shorter_horizon_agrees_with_whole_runs() -> None:
    data = trials(TRUE)
    whole = estimate(data, NOMINAL, method="oe")
    short = estimate(data, NOMINAL, method="oe", settings=Settings(horizon_s=60.0))
    assert (np.abs(short.values - truth(short.names)) < 4.5 * short.std).all()
    assert (np.abs(short.values - whole.values) < 4.5 * short.std).all()


def test_a_refusal_names_a_horizon_with_which_there_is_an_answer(capfd: pytest.CaptureFixture[str]) -> None:
    """Held so, yaw rates grow e-fold in a twentieth of a second: the search overflows, and says how far it came."""
    data, model = trials(TRUE, seeds=(1,), samples=60), NOMINAL.with_parameters({"N_r": 20.0})
    with pytest.raises(NoAnswer, match=r"diverges within") as refused:
        estimate(data, model, method="oe", settings=Settings(fixed=("N_r",)))
    (longest,) = re.findall(r"--horizon (\d+), up to which it does not", str(refused.value))
    assert 1 < int(longest) < 60
    found = estimate(data, model, method="oe", settings=Settings(fixed=("N_r",), horizon_s=float(longest)))
    assert np.isfinite(found.residuals.std).all()
    assert capfd.readouterr().err == ""


def test_a_steady_force_nobody_recorded_is_found_and_leaves_the_parameters_alone() -> None:
    force = np.array([0.002, -0.003, 0.0001])
    pushed = []
    for number, batch in enumerate(trials(QUIET, samples=400).batches):
        extra, state = (number + 1) * force, start_state(TRUE.model, batch)
        rows = [state]
        for inputs in batch.inputs[:-1]:
            rates = motion_rates(TRUE.model, tuple(rows[-1]), inputs)
            rows.append(rows[-1] + np.array(rates) + np.concatenate([np.zeros(3), extra]))
        pushed.append(replace(batch, velocity=np.array(rows)[:, 3:], pose=np.array(rows)[:, :3]))
    settings = Settings(constant=True)
    found = estimate(record(*pushed), NOMINAL, method="oe", settings=settings)
    np.testing.assert_allclose(found.values, truth(found.names), rtol=1e-4)
    np.testing.assert_allclose(found.nuisance_values, [*force, *(2 * force)], rtol=1e-3)
    blind = estimate(record(*pushed), NOMINAL, method="oe")
    assert np.abs(blind.values / truth(blind.names) - 1).max() > 0.02


def test_runge_kutta_gives_the_parameters_of_the_motion_and_euler_those_of_its_map() -> None:
    """Sampled eight times finer than estimated, with a decay of 0.35 per sample in yaw for Euler's map to miss."""
    commands_ = model_ship_commands(1200)
    motion = simulate(prompt(MODEL_SHIP_TRUE), commands_, velocity=(1.0, 0.0, 0.0), substeps=8)
    batch = Batch(
        name="run",
        sample_time_s=0.125,
        input_names=commands_.names,
        inputs=commands_.values,
        velocity=motion.velocity[:-1],
        pose=motion.pose[:-1],
    )
    model = MODEL_SHIP_TRUE.model
    exact = estimate(record(batch), model, method="oe", settings=Settings(integration=Integration("rk4", 2)))
    np.testing.assert_allclose(exact.values, model.parameters, rtol=1e-3)
    euler = estimate(record(batch), model, method="oe")
    assert euler.value("N_r") == pytest.approx(np.expm1(exact.value("N_r")), rel=0.01)


@pytest.mark.thorough
def test_thinner_samples_on_the_way_do_not_change_where_the_search_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    data = trials(TRUE)
    found = estimate(data, NOMINAL, method="oe")
    monkeypatch.setattr(minimise, "ROUGH_SAMPLES", 300)
    monkeypatch.setattr(minimise, "ROUGH_STEP_S", 3.0)
    thinned = []
    build = minimise.build_problem
    monkeypatch.setattr(minimise, "build_problem", lambda *args: thinned.append(args[3].every) or build(*args))
    other = estimate(data, NOMINAL, method="oe")
    assert max(thinned) == 3
    assert (np.abs(other.values - found.values) < 0.05 * found.std).all()


def test_steps_of_the_search_are_told_as_they_are_taken() -> None:
    """Shares rise to nearly one, in more than ten steps, none of them larger than a third."""
    shares: list[float] = []
    estimate(trials(TRUE), NOMINAL, method="oe", progress=lambda activity, share: shares.append(share))
    rises = np.diff([*shares, 1.0])
    assert (rises >= 0).all()
    assert rises.max() < 1 / 3
    assert (rises > 0).sum() > 10
