"""Output error: exact without noise, as good as the noise allows with it, and in agreement with IV."""

from dataclasses import replace

import numpy as np
import pytest
from estimation_case import NOMINAL, QUIET, TRUE, commands, measured, record

from expdesign.errors import InputError
from expdesign.estimation._casadi import OutputErrorProblem, sensitivities
from expdesign.estimation.fit import fit_percent
from expdesign.estimation.methods import estimate
from expdesign.estimation.replay import Integration, simulate_batch

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


def test_no_neighbouring_model_simulates_the_data_better() -> None:
    """The weighted simulation error is least at the estimate, along every parameter."""
    batch = trials(TRUE, seeds=(3,)).batches[0]
    found = estimate(record(batch), NOMINAL, method="oe")
    start = np.array(found.nuisance_values)

    def error(values: np.ndarray) -> float:
        model = NOMINAL.with_parameters({**found.held, **dict(zip(found.names, values, strict=True))})
        from_start = measured_from(batch, start)
        simulated = simulate_batch(model, from_start).velocity
        return float((((batch.velocity - simulated) / found.residuals.std) ** 2).sum())

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


def test_sensitivities_are_derivatives() -> None:
    batch = trials(QUIET, seeds=(1,), samples=60).batches[0]
    model = TRUE.model
    problem = OutputErrorProblem(
        model=model,
        sought=(0, 6, 12),
        states=(0, 1, 2),
        inputs=batch.inputs,
        measured=batch.velocity,
        weights=np.ones(3),
        last=np.arange(60) == 59,
        sample_time_s=1.0,
        integrator="rk4",
        substeps=1,
        start=model.parameters[[0, 6, 12]],
        scale=np.ones(3),
    )

    def run(values: np.ndarray) -> np.ndarray:
        changed = model.with_parameters({"X_u": values[0], "Y_v": values[1], "N_r": values[2]})
        return simulate_batch(changed, batch, integration=Integration("rk4", 1)).velocity

    centre = model.parameters[[0, 6, 12]]
    slopes = sensitivities(problem, centre, run(centre))
    for index in range(3):
        step = 1e-6 * np.eye(3)[index]
        numeric = (run(centre + step) - run(centre - step)) / 2e-6
        np.testing.assert_allclose(slopes[:, :, index], numeric, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(slopes[0, :, 3:], np.eye(3))


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
