"""Runs agree with an independent solver, converge at their order, and do the same alone as together."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from design_case import one_line, structured, vessel
from expdesign.errors import Diverged, InputError
from expdesign.signals import Commands
from expdesign.simulation import Environment, simulate, simulate_many
from expdesign.simulation.run import FEW_RUNS
from expdesign.vessel import Vessel
from measured_trials import prompt

SHIP = prompt(vessel("azimuth-30m-true"))
SEA = Environment(current_to=np.array([0.3, -0.2]), wind_to=np.array([-4.0, 6.0]))
START = {"pose": (3.0, -2.0, 0.7), "velocity": (1.0, 0.2, 0.02)}


def random_commands(count: int, *, ship: Vessel = SHIP, seed: int = 0) -> Commands:
    """Both thrusters ahead, swinging about."""
    rng = np.random.default_rng(seed)
    values = np.stack([rng.uniform(5, 12, count), rng.uniform(-1, 1, count)] * 2, axis=1)
    return Commands(sample_time_s=ship.sample_time_s, names=ship.model.inputs, values=values)


def independent(commands: Commands, environment: Environment) -> np.ndarray:
    """(k + 1, 6) states by an adaptive method of order eight, sample by sample; the equations written out."""
    theta = dict(zip(SHIP.model.names, SHIP.model.parameters / SHIP.sample_time_s, strict=True))

    def rates(_: float, state: np.ndarray, n1: float, a1: float, n2: float, a2: float) -> list[float]:
        _, _, psi, u, v, r = state
        c, s = np.cos(psi), np.sin(psi)
        R = np.array([[c, -s], [s, c]])
        ur, vr = np.array([u, v]) - R.T @ environment.current_to
        uq, vq = np.array([u, v]) - R.T @ environment.wind_to
        tx = n1 * np.cos(a1) + n2 * np.cos(a2)
        ty = n1 * np.sin(a1) + n2 * np.sin(a2)
        tpsi = 9.0 * n1 * np.sin(a1) - 9.0 * n2 * np.sin(a2)
        p = theta
        du = p["X_u"] * ur + p["X_vr"] * vr * r + p["X_abs_u_u"] * abs(ur) * ur + p["W_abs_u_u"] * abs(uq) * uq
        dv = p["Y_v"] * vr + p["Y_ur"] * ur * r + p["Y_abs_v_v"] * abs(vr) * vr + p["Y_abs_v_r"] * abs(vr) * r
        dr = p["N_r"] * r + p["N_uv"] * ur * vr + p["N_abs_v_v"] * abs(vr) * vr + p["N_abs_v_r"] * abs(vr) * r
        du += p["X_mu"] * tx + p["X_kappa"] * ur * tx
        dv += p["W_abs_v_v"] * abs(vq) * vq + p["Y_mu"] * ty
        dr += p["W_uv"] * uq * vq + p["N_mu"] * tpsi
        du, dv = (du, dv) + r * np.array([v - vr, ur - u])  # the current's components as the ship turns
        return [c * u - s * v, s * u + c * v, r, du, dv, dr]

    states = [np.array([*START["pose"], *START["velocity"]])]
    for row in commands.values:
        step = solve_ivp(rates, (0, commands.sample_time_s), states[-1], "DOP853", args=row, rtol=1e-12, atol=1e-14)
        states.append(step.y[:, -1])
    return np.array(states)


def states(run: object) -> np.ndarray:
    """(k + 1, 6) of a trajectory."""
    return np.hstack([run.pose, run.velocity])


def test_runge_kutta_agrees_with_an_adaptive_solver_of_equations_written_out():
    commands = random_commands(100)
    exact = independent(commands, SEA)
    coarse, fine = (states(simulate(SHIP, commands, **START, environment=SEA, substeps=n)) for n in (8, 16))
    # Halving the step takes most of the error away, also where moduli cost order; what it changed bounds what is left.
    assert np.abs(fine - exact).max() <= np.abs(coarse - fine).max()


@pytest.mark.parametrize(("integrator", "order", "substeps"), [("rk4", 4, 4), ("euler", 1, 64)])
def test_integrators_converge_at_their_order(integrator: str, order: int, substeps: int):
    # One steady turn, so that nothing inside a modulus changes its sign.
    commands = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=np.tile([10.0, -0.2, 10.0, 0.2], (20, 1)))
    start = {"pose": (0.0, 0.0, 0.5), "velocity": (1.0, 0.5, -0.05)}
    calm = Environment(current_to=np.zeros(2), wind_to=np.zeros(2))
    runs = [states(simulate(SHIP, commands, **start, environment=calm, integrator=integrator, substeps=n * substeps))
            for n in (1, 2, 4)]  # fmt: skip
    first, second = (np.abs(a - b).max() for a, b in pairwise(runs))
    assert np.log2(first / second) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("count", [5, FEW_RUNS + 1])
def test_many_runs_at_once_are_the_single_runs(count: int):
    rng = np.random.default_rng(3)
    commands = random_commands(60)
    pose, velocity = rng.standard_normal((count, 3)), rng.uniform(0, 1, (count, 3)) * (1, 0.3, 0.05)
    current, wind = 0.3 * rng.standard_normal((count, 2)), 5 * rng.standard_normal((count, 2))
    theta = SHIP.model.parameters * rng.uniform(0.8, 1.2, (count, 18))
    together = simulate_many(
        SHIP, commands, pose=pose, velocity=velocity, current_to=current, wind_to=wind, parameters=theta
    )
    for index in range(count):
        alone = simulate(
            replace(SHIP, model=SHIP.model.with_parameters(theta[index])),
            commands,
            pose=pose[index],
            velocity=velocity[index],
            environment=Environment(current_to=current[index], wind_to=wind[index]),
        )
        np.testing.assert_allclose(together[:, index], states(alone), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("acting", [(), ("X_mu",), ("X_u", "X_mu", "Y_v", "Y_ur", "Y_mu", "N_uv", "N_mu")])
def test_many_runs_with_parameters_of_zero_are_the_single_runs(acting: tuple[str, ...]):
    count, commands, model = FEW_RUNS + 1, random_commands(20), SHIP.model
    theta = np.tile(np.where(np.isin(model.names, acting), model.parameters, 0.0), (count, 1))
    theta[1, model.names.index("X_mu")] *= 1.1
    start = {key: np.tile(value, (count, 1)) for key, value in START.items()}
    sea = {"current_to": np.tile(SEA.current_to, (count, 1)), "wind_to": np.tile(SEA.wind_to, (count, 1))}
    together = simulate_many(SHIP, commands, **start, **sea, parameters=theta)
    for index in (0, 1):
        ship = replace(SHIP, model=model.with_parameters(theta[index]))
        alone = simulate(ship, commands, **START, environment=SEA)
        np.testing.assert_allclose(together[:, index], states(alone), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("count", [3, FEW_RUNS + 1])
def test_a_run_that_diverges_is_missing_and_leaves_the_others_alone(count: int):
    commands = random_commands(60)
    theta = np.tile(SHIP.model.parameters, (count, 1))
    theta[1, SHIP.model.names.index("X_abs_u_u")] = 5.0
    rest = {"pose": np.zeros((count, 3)), "velocity": np.zeros((count, 3)), "current_to": np.zeros((count, 2)),
            "wind_to": np.zeros((count, 2))}  # fmt: skip
    together = simulate_many(SHIP, commands, **rest, parameters=theta)
    assert np.isnan(together[:, 1]).all()
    np.testing.assert_allclose(together[:, 0], states(simulate(SHIP, commands)), rtol=1e-11, atol=1e-12)
    np.testing.assert_array_equal(together[:, 0], together[:, 2])


@pytest.mark.parametrize("draw", range(40))
def test_unstable_models_are_reported_in_one_line_however_they_burst(draw: int):
    rng = np.random.default_rng(draw)
    signs, size = rng.choice([-1, 1], 18), 10.0 ** rng.uniform(1, 9, 18)
    wild = replace(SHIP, model=SHIP.model.with_parameters(signs * size))
    with pytest.raises(Diverged, match=r"'azimuth-30m-true': the simulation diverges after \d+\.\d s") as caught:
        simulate(wild, random_commands(50), velocity=(1.0, 0.5, 0.1), substeps=1 + draw % 4)
    assert one_line(caught.value)


def test_growth_at_a_known_rate_diverges_at_the_known_time():
    ship = replace(SHIP, model=structured("surge", np.array([0.5, 0.0, 0.0, 0.0]), SHIP.actuators))
    commands = Commands(sample_time_s=1.0, names=ship.model.inputs, values=np.zeros((50, 4)))
    # u = exp(t / 2) passes 1000 at t = 2 log 1000 = 13.8 s, found at the sample after.
    with pytest.raises(Diverged, match=r"after 14\.0 s"):
        simulate(ship, commands, velocity=(1.0, 0.0, 0.0), substeps=4)


def test_commands_of_another_vessel_and_unknown_integrators_are_refused():
    with pytest.raises(InputError, match="commands n1, a1, n2, a2 do not fit vessel 'model-ship'"):
        simulate(vessel("model-ship"), random_commands(3))
    with pytest.raises(InputError, match="unknown integrator 'rk5', did you mean 'rk4'"):
        simulate(SHIP, random_commands(3), integrator="rk5")
