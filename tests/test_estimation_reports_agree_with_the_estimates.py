"""Fit, excitation condition and many trials at once: closed forms and round trips."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from estimation_case import CURRENT, NOMINAL, QUIET, TRUE, commands, measured, record
from expdesign.assessment.misfit import Limits
from expdesign.errors import Diverged
from expdesign.estimation.excitation import WorstCase, check_excitation, worst_case
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate, faint_notes
from expdesign.estimation.replay.replay import Integration, simulate_batch
from expdesign.estimation.solve.null_space import Direction, NullSpace
from expdesign.export.files.estimates import limit_entries
from expdesign.signals import Commands, fit_percent
from expdesign.simulation import CALM, Environment, Variation, simulate, simulate_ensemble


def test_fit_is_hundred_zero_negative_and_undefined_where_it_should_be() -> None:
    y = np.random.default_rng(0).normal(size=(50, 1)) + 3
    assert fit_percent(y, y)[0] == 100
    assert abs(fit_percent(y, np.full_like(y, y.mean()))[0]) < 1e-9
    assert fit_percent(y, y.mean() + 2 * (y - y.mean()) + 0)[0] == pytest.approx(0)
    assert fit_percent(y, -y)[0] < 0
    assert np.isnan(fit_percent(np.full((9, 1), 0.1), y[:9])[0])
    holes = np.where(np.arange(50)[:, None] % 7 == 0, np.nan, y)
    whole = np.isfinite(holes[:, 0])
    np.testing.assert_allclose(fit_percent(holes, y + 0.1), fit_percent(y[whole], y[whole] + 0.1))


@pytest.mark.parametrize("integration", [Integration(), Integration("rk4", 2)])
def test_replay_is_the_simulation(integration: Integration) -> None:
    inputs = commands(120, np.random.default_rng(1))
    run = Commands(sample_time_s=1.0, names=TRUE.model.inputs, values=inputs)
    expected = simulate(
        QUIET, run, velocity=(1.7, 0.7, 0.0), integrator=integration.integrator, substeps=integration.substeps
    )
    replayed = simulate_batch(TRUE.model, measured(QUIET, inputs), integration=integration)
    np.testing.assert_allclose(replayed.velocity, expected.velocity[:-1], rtol=1e-9)
    np.testing.assert_allclose(replayed.pose, expected.pose[:-1], rtol=1e-9, atol=1e-9)


def test_an_unstable_model_is_reported_and_not_used() -> None:
    batch = measured(QUIET, commands(300, np.random.default_rng(2)))
    wild = NOMINAL.with_parameters({"X_u": 0.5})
    with pytest.raises(Diverged, match="nominal model"):
        estimate(record(batch), wild, method="iv")
    with pytest.raises(Diverged, match=r"diverges after \d+\.0 s"):
        simulate_batch(wild, batch)
    assert estimate(record(batch), wild, method="iv", settings=Settings(start="ls")).warnings is not None


def test_the_excitation_condition_names_the_samples_that_break_it() -> None:
    batch = measured(QUIET, commands(200, np.random.default_rng(3)))
    assert check_excitation(record(batch), TRUE.model, worst=WorstCase()) == ()
    velocity = batch.velocity.copy()
    velocity[[20, 21, 22, 90], 0] = [0.2, -0.1, 0.3, 0.39]
    broken = replace(batch, velocity=velocity, first_row=2)
    (breach,) = check_excitation(record(broken), TRUE.model, worst=WorstCase(velocity_mps=0.1, current_mps=0.35))
    assert breach.samples.tolist() == [20, 21, 22]
    assert breach.parameters == ("X_abs_u_u", "W_abs_u_u")
    assert "rows 22 to 24" in str(breach)
    assert "3 of 200" in str(breach)
    windy = check_excitation(record(broken), TRUE.model, worst=WorstCase(wind_mps=0.395))
    assert windy[0].samples.tolist() == [20, 21, 22, 90]  # without measured wind the ship must be faster than it
    measured_wind = check_excitation(
        record(broken), TRUE.model, worst=WorstCase(wind_mps=9.0, wind_sensor_mps=0.01), wind_measured=True
    )
    assert [b.inside for b in measured_wind] == ["u"]
    assert worst_case(TRUE.sensors).velocity_mps == pytest.approx(3 * TRUE.sensors.velocity_mps)


def test_many_trials_at_once_are_single_trials() -> None:
    """Every run of an ensemble in steady weather is the plain simulation with its own commands and parameters."""
    rng = np.random.default_rng(4)
    inputs = np.stack([commands(80, rng) for _ in range(3)], axis=1)
    parameters = TRUE.model.parameters * (1 + 0.1 * rng.normal(size=(3, len(TRUE.model.terms))))
    weather = Environment(current_to=CURRENT, wind_to=np.array([3.0, -2.0]))
    many = simulate_ensemble(
        QUIET, inputs, runs=3, environment=weather, rng=rng, velocity=(1.0, 0.2, 0.0), parameters=parameters
    )
    for run in range(3):
        truth = replace(QUIET, model=TRUE.model.with_parameters(parameters[run]))
        command = Commands(sample_time_s=1.0, names=TRUE.model.inputs, values=inputs[:, run])
        environment = Environment(current_to=weather.current_to, wind_to=weather.wind_to)
        alone = simulate(
            truth, command, velocity=(1.0, 0.2, 0.0), environment=environment, integrator="euler", substeps=1
        )
        np.testing.assert_allclose(many.velocity[:, run], alone.velocity[:-1], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(many.measured_pose[:, run], alone.pose[:-1], rtol=1e-9, atol=1e-9)
    assert not CALM.current_to.any()


def test_noise_of_many_trials_has_the_stated_spread() -> None:
    rng = np.random.default_rng(5)
    inputs = commands(600, rng)
    many = simulate_ensemble(
        TRUE,
        inputs,
        runs=50,
        environment=Environment(wind_variation=Variation(std_mps=0.5)),
        rng=rng,
        velocity=(1.7, 0.7, 0),
    )
    count = many.velocity[..., 0].size
    for noise, std in (
        (many.measured_velocity - many.velocity, [TRUE.sensors.velocity_mps] * 2 + [TRUE.sensors.yaw_rate_radps]),
        (many.measured_pose - many.pose, [TRUE.sensors.position_m] * 2 + [TRUE.sensors.heading_rad]),
        (many.measured_wind - many.velocity[..., :2], [np.hypot(0.5, TRUE.sensors.wind_mps)] * 2),
    ):
        np.testing.assert_allclose(noise.std(axis=(0, 1)), std, rtol=5 / np.sqrt(2 * count))
        assert (np.abs(noise.mean(axis=(0, 1))) < 5 * np.array(std) / np.sqrt(count)).all()


@pytest.mark.parametrize(("growth", "told"), [(3.0, True), (1e12, False)])
def test_shares_of_a_misfit_are_told_only_where_they_add_up(growth: float, told: bool) -> None:
    shares = {name: np.full(3, 1e10 if growth > 1e6 else 0.3) for name in ("constant", "slow", "quick", "parameters")}
    rest = {name: np.full(3, 0.5) for name in ("ceiling_percent", "ahead_rms", "ahead_share")}
    limits = Limits(outputs=("u", "v", "r"), **shares, **rest, growth=growth, duration_s=700.0)
    run = SimpleNamespace(batch=SimpleNamespace(name="a"), problem="", fit_percent=np.array([90.0, 80.0, 70.0]))
    (entry,) = limit_entries(SimpleNamespace(limits=(limits,), best=SimpleNamespace(runs=(run,)))).values()  # type: ignore[arg-type]
    assert (entry["slow"] is not None) == told
    assert entry["ahead_share"] == {"u": 0.5, "v": 0.5, "r": 0.5}
    assert ("unstable" in entry["sentence"]) == (not told)


def test_combinations_that_data_hardly_show_are_told_in_one_sentence() -> None:
    """Twenty sentences of a twin-screw ship hid what else was to be said."""
    names = ("X_n1", "X_n2", "X_un1")

    def faint(*strengths: float) -> NullSpace:
        directions = tuple(
            Direction(parameters=names[place : place + 2], weights=np.array([0.8, -0.6]), strength=strength, change={})
            for place, strength in enumerate(strengths)
        )
        return NullSpace(singular_values=np.ones(3), unseen=(), faint=directions)

    assert faint_notes(faint()) == []
    (alone,) = faint_notes(faint(1e-6))
    assert alone.endswith("this combination of parameters: X_n1 and X_n2: 0.80 X_n1 - 0.60 X_n2.")
    (several,) = faint_notes(faint(1e-6, 1e-8))
    assert "2 combinations of X_n1, X_n2, X_un1; least about X_n2 and X_un1:" in several
