"""What limits a fit is found: constants, noise, instability and uncertain parameters where nothing else acts."""

import re
from dataclasses import replace

import numpy as np
import pytest

from expdesign.assessment import EstimateOptions, assess, check_run, decomposed, sentence
from expdesign.assessment.misfit import AHEAD_S, Limits, RunCheck
from expdesign.estimation.methods import estimate
from expdesign.estimation.replay.replay import Integration
from expdesign.signals import Batch, Record
from expdesign.simulation import simulate
from expdesign.vessel import Actuator, Limit, Term, VesselModel
from measured_trials import MODEL_SHIP_TRUE, model_ship_commands, prompt
from real_data_cases import POND, TANK, vessel_of
from sample_files import outside_record

RK4 = Integration("rk4", 2)
MODEL = MODEL_SHIP_TRUE.model


def driven(samples: int = 1200, *, push: float = 0.0, noise: float = 0.0) -> Batch:
    """The model ship's run; a constant side force that nobody recorded, and white noise on every velocity."""
    commands = model_ship_commands(samples)
    pushed = replace(commands, values=commands.values + np.array([0, push, 0]))
    motion = simulate(prompt(MODEL_SHIP_TRUE), pushed, velocity=(1.0, 0.0, 0.0))
    velocity = motion.velocity[:-1] + noise * np.random.default_rng(5).normal(size=(samples, 3))
    return Batch(
        name="run",
        sample_time_s=0.125,
        input_names=commands.names,
        inputs=commands.values,
        velocity=velocity,
        pose=motion.pose[:-1],
    )


def judged(batch: Batch, model: VesselModel = MODEL) -> tuple[Limits, RunCheck]:
    """Limits of a model that is known without error."""
    found = estimate(Record(batches=(batch,)), model, method="ls")
    known = replace(found, values=model.parameters, covariance=0 * found.covariance)
    run = check_run(model, batch, use="test", wind=False, integration=RK4)
    return decomposed(model, run, known, wind=False, integration=RK4), run


def test_a_constant_force_is_named_as_one() -> None:
    limits, run = judged(driven(push=400.0))
    assert limits.constant[1] == pytest.approx(1.0, abs=0.02)
    assert abs(limits.slow[1]) + abs(limits.quick[1]) < 0.03
    words = sentence(limits, run)
    assert "The worst output is v" in words
    assert "100 % from a constant unmodelled force" in words or "99 % from a constant unmodelled force" in words


@pytest.mark.parametrize("wrong", [{"N_r": 0.3}, {"Y_v": 0.2}, {"X_u": 0.1}])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_shares_add_up_to_one_however_far_the_simulation_is_from_the_ship(
    wrong: dict[str, float], noise: float
) -> None:
    """The difference that one step makes of two motions is no slope times their distance where damping is a square."""
    factors = {name: float(MODEL.parameters[MODEL.names.index(name)]) * by for name, by in wrong.items()}
    limits, run = judged(driven(push=800.0, noise=noise), MODEL.with_parameters(factors))
    assert run.fit_percent.min() < 50
    assert limits.constant + limits.slow + limits.quick == pytest.approx(np.ones(3), abs=1e-6)


@pytest.mark.parametrize("shares", [(0.7, 0.2, 0.1), (-0.13, 0.65, 0.48), (1.05, -0.03, -0.02), (-0.004, 0.5, 0.504)])
def test_shares_that_cancel_others_are_said_to_and_all_add_up(shares: tuple[float, float, float]) -> None:
    limits, run = judged(driven(push=400.0))
    constant, slow, quick = (np.full(3, share) for share in shares)
    words = sentence(replace(limits, constant=constant, slow=slow, quick=quick), run)
    parts = words.partition("Its squared error: ")[2].partition(".")[0]
    assert "-" not in parts
    assert "Among all these, errors of the parameters" in words
    added = sum(int(text) for text in re.findall(r"(\d+) % from", parts))
    taken = sum(int(text) for text in re.findall(r"less (\d+) % by", parts))
    assert added - taken == pytest.approx(100, abs=1)
    assert bool(taken) == (min(shares) < -0.005)


def test_noise_is_quick_and_its_size_is_seen() -> None:
    """The first velocity is noisy too, so that the simulation starts wrong; that dies away within seconds."""
    noise = 0.02
    batch = driven(noise=noise)
    limits, run = judged(batch)
    assert (limits.quick > 0.9).all()
    assert limits.constant + limits.slow + limits.quick == pytest.approx(np.ones(3), abs=1e-6)
    best = 100 * (1 - noise / batch.velocity.std(axis=0))
    counted = len(batch)  # third differences of white noise: variance of their mean square over n is about 4.6 / n
    within = 4.5 * np.sqrt(4.6 / counted) / 2 * (100 - best).max()
    assert limits.ceiling_percent[:2] == pytest.approx(best[:2], abs=within)
    assert limits.ceiling_percent[2] < best[2] + within  # yaw is so quick that third differences see some of it
    assert (run.fit_percent[:2] < limits.ceiling_percent[:2] + within).all()
    assert limits.growth < 1


def test_an_unstable_ship_is_named_with_the_rate_of_her_error() -> None:
    """dr/dt = a r + b tau_psi has errors that grow as exp(a t)."""
    rate = 0.03
    force = Actuator(kind="force", number=1, limits=(Limit(), Limit(), Limit()))
    model = VesselModel(
        terms=(Term("r", "N_r", "r"), Term("r", "N_mu", "tau_psi")),
        parameters=np.array([rate, 1.0]),
        parameter_std=np.zeros(2),
        form="continuous",
        sample_time_s=0.5,
        actuators=(force,),
    )
    count, rng = 241, np.random.default_rng(1)
    r, moment = np.zeros(count), np.zeros(count)
    grown = np.exp(rate * 0.5)
    for k in range(count - 1):  # feedback holds her
        moment[k] = -0.1 * r[k] + 0.01 * rng.normal()
        r[k + 1] = grown * r[k] + (grown - 1) / rate * moment[k] + 1e-3 * rng.normal()
    zeros = np.zeros(count)
    batch = Batch(
        name="run",
        sample_time_s=0.5,
        input_names=("tau_x", "tau_y", "tau_psi"),
        inputs=np.stack([zeros, zeros, moment], axis=1),
        velocity=np.stack([zeros, zeros, r], axis=1),
    )
    limits, run = judged(batch, model)
    assert limits.growth == pytest.approx(np.exp(rate * 0.5 * (count - 1)), rel=1e-4)
    assert limits.doubling_s == pytest.approx(np.log(2) / rate, rel=0.01)
    assert "unstable" in sentence(limits, run)
    assert limits.constant + limits.slow + limits.quick == pytest.approx([1.0], abs=1e-6)


def test_the_misfit_that_a_wrong_parameter_makes_is_the_one_to_be_expected_of_it() -> None:
    batch = driven()
    index = MODEL.names.index("N_r")
    off = 0.002
    wrong = MODEL.with_parameters({"N_r": float(MODEL.parameters[index]) + off})
    found = estimate(Record(batches=(batch,)), MODEL, method="ls")
    covariance = np.zeros_like(found.covariance)
    covariance[index, index] = off**2
    known = replace(found, values=wrong.parameters, covariance=covariance)
    run = check_run(wrong, batch, use="test", wind=False, integration=RK4)
    limits = decomposed(wrong, run, known, wind=False, integration=RK4)
    assert limits.parameters[2] == pytest.approx(1.0, abs=0.05)


def test_without_misfit_prediction_ahead_is_exact() -> None:
    limits, _ = judged(driven())
    assert limits.ahead_share == pytest.approx(np.zeros(3), abs=1e-6)
    assert AHEAD_S > 0


@pytest.mark.outside
def test_a_tanker_is_unstable_on_her_course_and_stable_in_large_turns() -> None:
    """KVLCC2 is known not to keep her course: about it, in 10/1 zig-zags, errors grow, far from it they die away."""
    used, tests = outside_record(TANK.folder, TANK.used), outside_record(TANK.folder, ("zigzag_10_01", "zigzag_30_05"))
    found = assess(vessel_of(TANK), used, EstimateOptions(methods=("ls",)), tests=tests)
    limits = {run.batch.name: item for item, run in zip(found.limits, found.best.runs, strict=True)}
    assert limits["zigzag_10_01.csv"].unstable
    assert limits["zigzag_30_05.csv"].growth < 0.1
    fits = {run.batch.name: run.fit_percent for run in found.best.runs}
    assert fits["zigzag_10_01.csv"].max() < 0 < 80 < fits["zigzag_30_05.csv"].min()
    assert all(item.ahead_share.max() < 0.25 for item in limits.values())
    for name, item in limits.items():
        if not item.unstable:
            assert item.constant + item.slow + item.quick == pytest.approx(np.ones(3), abs=1e-6), name


@pytest.mark.outside
@pytest.mark.slow
def test_on_the_pond_instruments_in_the_measured_wind_give_a_stable_model() -> None:
    """Simulated in calm air instruments do not follow a ship that drifts in the wind, and every run diverged."""
    used, tests = outside_record(POND.folder, POND.used), outside_record(POND.folder, POND.tests)
    found = assess(vessel_of(POND), used, EstimateOptions(methods=("iv-air", "ls-air")), tests=tests)
    instruments, squares = found.methods
    assert instruments.stable
    ahead = [
        np.median([limits.ahead_share for limits in _limits(item)], axis=0).mean() for item in (instruments, squares)
    ]
    assert ahead[0] < ahead[1]


def _limits(item):
    how = Integration("rk4", 1)
    return [decomposed(item.model, run, item.estimate, wind=True, integration=how) for run in item.runs]
