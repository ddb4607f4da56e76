"""The models of roll: closed forms, test vectors, and what follows from one another."""

import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st

from expdesign.errors import InputError
from expdesign.roll import (
    G_MPS2,
    NOMINAL,
    PARAMETERS,
    Body,
    Load,
    axis_inertia,
    coefficients,
    discrete,
    first_moment,
    named,
    parameters,
    sensed_inertia,
    stiffness,
)
from expdesign.waves import Jonswap, encounter, froude_factor
from roll_closed_forms import closed_loop, continuous, load_from, own_parameters, pendulum_system, simulated
from roll_truths import MODEL_SHIP, MODEL_SHIP_TRUTH, PENDULUM, PENDULUM_TRUTH, Hull, ship_system

LOAD = Load(mass_kg=0.2, z_m=-0.274)
CASE_ONE = parameters(k=9.0057, A_x=0.1583, d=0.2685, K_r=-2.01, K_vd=0.9607, K_delta=-0.4822, z_f=-0.0294)
THEIR_CASES = [NOMINAL, Load(mass_kg=0.2, z_m=-0.256), None]


def test_the_pendulum_of_the_thesis_has_the_coefficients_worked_out_by_hand() -> None:
    for load, inertia, wanted, sampled in (
        (NOMINAL, 0.059156, [1.80370546, 175.63729799, 6.70633579], [-1.96487029, 0.98220161, 0.03308799]),
        (LOAD, 0.0622248, [1.71475039, 166.97522531, 7.25627081], [-1.966581, 0.98306834, 0.03582466]),
    ):
        assert sensed_inertia(0.1385, PENDULUM, load) == pytest.approx(inertia, abs=1e-9)
        assert coefficients(PENDULUM_TRUTH, PENDULUM, load).values[:3] == pytest.approx(wanted, abs=1e-8)
        assert discrete(PENDULUM_TRUTH, PENDULUM, load, 0.01).values[:3] == pytest.approx(sampled, abs=1e-8)


def test_the_rig_of_the_thesis_has_its_coefficients() -> None:
    theta, body = parameters(k=1.84, A_x=0.00707, d=0.0032), Body(mass_kg=1.324, z_g=-0.0211, z_s=-0.1163)
    load = Load(mass_kg=0.0975, z_m=-0.1225)
    for case, wanted in (
        (NOMINAL, [-1.82708142, 0.98616651, 0.06038403]),
        (load, [-1.82980556, 0.98638444, 0.08484225]),
    ):
        assert discrete(theta, body, case, 0.02).values[:3] == pytest.approx(wanted, abs=1e-7)
    gains = [-first_moment(body, case) / axis_inertia(0.00707, body, case) for case in (NOMINAL, load)]
    assert gains[1] / gains[0] == pytest.approx(1.199, abs=0.002)


def test_the_model_ship_of_the_thesis_has_its_coefficients() -> None:
    theta = parameters(k=9.0067, A_x=0.1566, d=0.2668, K_r=-1.9911, K_vd=0.9408, K_delta=-0.4433, z_f=-0.0293)
    for load, wanted in (
        (NOMINAL, [0.9345, -0.7795, -1.5970, -6.9744, -1.5528]),
        (Load(mass_kg=0.2, z_m=-0.256), [0.9297, -0.7755, -1.3899, -6.9383, -1.5448]),
    ):
        assert coefficients(theta, MODEL_SHIP, load).values == pytest.approx(wanted, abs=5e-5)


NUMBERS = st.floats(0.05, 3.0)


@settings(max_examples=50, deadline=None)
@given(
    *(NUMBERS for _ in range(7)),
    st.floats(-0.4, 0.4),
    st.floats(-0.4, 0.4),
    st.booleans(),
    st.sampled_from([None, LOAD]),
)
def test_derivatives_are_those_of_finite_differences(
    k: float, A_x: float, d: float, K_r: float, K_vd: float, K_delta: float, m: float, z_m: float, z_f: float,
    from_axis: bool, load: Load | None,
) -> None:  # fmt: skip
    body = Body(mass_kg=1.0, z_g=0.1, z_s=-0.2, sensor_from_axis=from_axis)
    theta = parameters(k=8 + k, A_x=2 + A_x, d=d, K_r=-K_r, K_vd=K_vd / 10, K_delta=K_delta, z_f=z_f, m=m, z_m=z_m)
    for function in (
        lambda x: coefficients(x, body, load),
        lambda x: discrete(x, body, load, 0.02),
    ):
        steps = 1e-6 * np.eye(len(PARAMETERS))
        slopes = [(function(theta + step).values - function(theta - step).values) / 2e-6 for step in steps]
        jacobian = function(theta).jacobian
        assert jacobian == pytest.approx(np.array(slopes).T, abs=1e-7 * (1.0 + np.abs(jacobian).max()))


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-50.0, 50.0), min_size=5, max_size=5), st.floats(1e-3, 0.1))
def test_the_bilinear_map_and_its_inverse_undo_each_other(gains: list[float], step_s: float) -> None:
    alpha1, alpha2, *others = gains
    body = Body(mass_kg=1.0, z_g=0.0, z_s=0.0)  # A2 = A_x = 1, so that parameters are the coefficients
    theta = parameters(
        k=abs(alpha2) - G_MPS2 * others[0], A_x=1.0, d=abs(alpha1), K_vd=-others[0], K_r=others[1], K_delta=others[2]
    )
    theta[0] = abs(alpha2) + G_MPS2 * theta[PARAMETERS.index("K_vd")]
    wanted = coefficients(theta, body, NOMINAL).values
    found = continuous(discrete(theta, body, NOMINAL, step_s).values, step_s)
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_sampled_coefficients_are_those_of_the_bilinear_map_of_scipy() -> None:
    a, b, c, kappa, gamma = coefficients(MODEL_SHIP_TRUTH, MODEL_SHIP, None).values
    sampled = discrete(MODEL_SHIP_TRUTH, MODEL_SHIP, None, 0.02).values
    for gain, found in ((c, sampled[2]), (kappa, sampled[3]), (gamma, sampled[4])):
        above, below = scipy.signal.bilinear([gain, 0.0], [1.0, a, b], fs=50.0)
        assert below == pytest.approx([1.0, *sampled[:2]], abs=1e-12)
        assert above == pytest.approx([found, 0.0, -found], abs=1e-12)


def test_what_is_known_of_ratios_is_a_linear_constraint_on_sampled_coefficients() -> None:
    values, T = named(PENDULUM_TRUTH), 0.01
    for load in (NOMINAL, LOAD):
        theta, S1 = discrete(PENDULUM_TRUTH, PENDULUM, load, T).values[:3], first_moment(PENDULUM, load)
        beta = coefficients(PENDULUM_TRUTH, PENDULUM, load).values[2]
        r, s, w = S1 / values["k"], values["d"] / S1, values["d"] / values["k"]
        for row, right in (
            ([-r, -r, -2 * T], r),
            ([0, 1, -2 * s], 1.0),
            ([beta * T, -beta * T, 8], beta * T),
            ([w, w + T, 0], T - w),
        ):
            assert np.dot(row, theta) == pytest.approx(right, abs=1e-12)


def test_physical_parameters_of_the_pendulum_follow_from_its_coefficients() -> None:
    nominal = coefficients(PENDULUM_TRUTH, PENDULUM, NOMINAL).values
    assert own_parameters(nominal, PENDULUM, NOMINAL) == pytest.approx((10.39, 0.1385, 0.1067), rel=1e-9)
    found = load_from(coefficients(PENDULUM_TRUTH, PENDULUM, LOAD).values, PENDULUM, inertia=0.1385, damping=0.1067)
    assert (found.mass_kg, found.z_m) == pytest.approx((0.2, -0.274), rel=1e-9)


def test_the_pendulum_driven_by_side_acceleration_is_the_closed_loop_of_the_accelerometer() -> None:
    """Both transfer functions, at frequencies: the identity of positive feedback."""
    for load in (NOMINAL, LOAD):
        loop = closed_loop(coefficients(PENDULUM_TRUTH, PENDULUM, load).values, PENDULUM.z_s)
        A, B, C, D = pendulum_system(PENDULUM_TRUTH, PENDULUM, load)
        for p in (0.3j, 1.0 + 5j, 40j):
            wanted = (C @ np.linalg.solve(p * np.eye(2) - A, B) + D)[:, 0]
            powers = np.array([p * p, p, 1.0])
            found = -np.array([loop.roll @ powers, loop.sensor @ powers]) / (loop.below @ powers)
            assert found == pytest.approx(wanted, rel=1e-12)


def test_the_loop_has_a_direct_term() -> None:
    beta = coefficients(PENDULUM_TRUTH, PENDULUM, NOMINAL).values[2]
    assert beta * PENDULUM.z_s == pytest.approx(-1.462, abs=1e-3)


def test_the_equation_with_accelerometer_is_unstable_and_its_loop_is_stable() -> None:
    """At the thesis's own estimates."""
    values = coefficients(CASE_ONE, MODEL_SHIP, NOMINAL).values
    assert (np.roots([1.0, *values[:2]]).real > 0).any()
    loop = closed_loop(values, MODEL_SHIP.sensor(named(CASE_ONE)["z_f"]))
    assert loop.stable
    assert (np.roots(loop.below).real < 0).all()


def test_the_loop_simulates_a_ship_with_sway_and_yaw_as_her_own_equations_do() -> None:
    """Side acceleration and yaw rate of the full ship, given to the loop, move roll and accelerometer as they did."""
    A, B, C, D = ship_system(MODEL_SHIP_TRUTH, MODEL_SHIP, LOAD)
    loop = closed_loop(coefficients(MODEL_SHIP_TRUTH, MODEL_SHIP, LOAD).values, MODEL_SHIP.sensor(-0.0294))
    for p in (0.2j, 2.0 + 3j, 9j):
        states = np.linalg.solve(p * np.eye(4) - A, B[:, 0])
        roll, _, roll_rate, yaw_rate = states
        sensed = C[1] @ states + D[1, 0]
        side = MODEL_SHIP.sensor(-0.0294) * p * roll_rate + G_MPS2 * roll - sensed
        powers = np.array([p * p, p, 1.0])
        inner = loop.gains @ [yaw_rate, 1.0]
        assert loop.roll @ powers / (loop.below @ powers) * (inner - side) == pytest.approx(roll_rate, rel=1e-9)
        found = (loop.loop @ powers * inner - loop.sensor @ powers * side) / (loop.below @ powers)
        assert found == pytest.approx(sensed, rel=1e-9)


def test_simulated_signals_obey_the_sampled_equation_exactly() -> None:
    rng, T = np.random.default_rng(1), 0.02
    values = coefficients(MODEL_SHIP_TRUTH, MODEL_SHIP, NOMINAL).values
    driven = np.cumsum(rng.standard_normal((300, 3)), axis=0)
    roll, sensed = simulated(closed_loop(values, MODEL_SHIP.sensor(-0.0294)), driven, T)
    a1, a2, *gains = discrete(MODEL_SHIP_TRUTH, MODEL_SHIP, NOMINAL, T).values
    inputs = np.column_stack([sensed, driven[:, 1:]])
    left = roll[2:] + a1 * roll[1:-1] + a2 * roll[:-2] - (inputs[2:] - inputs[:-2]) @ gains
    assert np.abs(left).max() < 1e-9 * np.abs(inputs).max()


def test_a_family_of_parameters_has_the_same_transfer_functions() -> None:
    """The null direction of three load cases, as a curve."""
    body, calibration = MODEL_SHIP, THEIR_CASES[1]
    assert calibration is not None
    M, z_g, z_s, z_c = body.mass_kg, body.z_g, body.z_s, calibration.z_m
    old = named(MODEL_SHIP_TRUTH)
    for size in (0.9, 1.03, 1.1):
        z_f = size * (z_c + old["z_f"]) - z_c
        K_vd = size * (old["K_vd"] + M * (z_g + old["z_f"])) - M * (z_g + z_f)
        A2 = old["A_x"] + M * (z_g + old["z_f"]) * (z_g - z_s) - old["K_vd"] * (z_s + old["z_f"])
        new = parameters(
            k=size * (old["k"] - old["K_vd"] * G_MPS2) + G_MPS2 * K_vd,
            A_x=size * A2 - M * (z_g + z_f) * (z_g - z_s) + K_vd * (z_s + z_f),
            d=size * old["d"],
            K_r=size * old["K_r"],
            K_vd=K_vd,
            K_delta=size * old["K_delta"],
            z_f=z_f,
            m=size * old["m"] * (old["z_m"] + old["z_f"]) / (old["z_m"] + z_f),
            z_m=old["z_m"],
        )
        for load in THEIR_CASES:
            same = coefficients(MODEL_SHIP_TRUTH, body, load).values
            assert coefficients(new, body, load).values == pytest.approx(same, rel=1e-12)


def test_two_kilogrammes_on_the_bridge_make_the_model_ship_fall_over() -> None:
    heavy = stiffness(CASE_ONE, MODEL_SHIP, Load(mass_kg=2.0, z_m=-0.29))
    assert -2.25 < heavy < -1.95
    assert 2.25 < stiffness(CASE_ONE, MODEL_SHIP, Load(mass_kg=0.6, z_m=-0.28)) < 2.45
    assert not closed_loop(
        coefficients(CASE_ONE, MODEL_SHIP, Load(mass_kg=2.0, z_m=-0.29)).values, MODEL_SHIP.sensor(-0.0294)
    ).stable


def test_a_ship_leans_into_her_turn_first_and_out_of_it_then() -> None:
    A, B, _, _ = ship_system(MODEL_SHIP_TRUTH, MODEL_SHIP, NOMINAL, Hull())
    time = np.linspace(0.0, 20.0, 2001)
    _, angle = scipy.signal.step((A, B[:, :1], np.eye(4)[:1], np.zeros((1, 1))), T=time)
    assert np.sign(angle[5]) == -np.sign(angle[-1])
    assert np.abs(angle[-1]) > np.abs(angle[5])


@pytest.mark.parametrize("gamma", [1.0, 2.0, 3.3, 5.0])
def test_a_jonswap_sea_has_its_peak_and_height(gamma: float) -> None:
    sea, w = Jonswap(height_m=2.0, peak_radps=0.4, gamma=gamma), np.linspace(0.05, 20.0, 200_000)
    density = sea.density(w)
    assert w[np.argmax(density)] == pytest.approx(0.4, abs=1e-3)
    assert 4.0 * np.sqrt(np.trapezoid(density, w)) == pytest.approx(2.0, rel=0.015)


def test_waves_are_met_faster_ahead_and_slower_astern() -> None:
    assert encounter(np.array([0.5]), speed_mps=5.0, heading_rad=np.pi) == pytest.approx(0.5 + 0.25 * 5.0 / G_MPS2)
    assert encounter(np.array([0.5]), speed_mps=5.0, heading_rad=np.pi / 2) == pytest.approx(0.5)
    assert encounter(np.array([2.0]), speed_mps=20.0, heading_rad=0.0) == pytest.approx(4.0 * 20.0 / G_MPS2 - 2.0)


def test_froude_scales_the_model_ship_to_hers() -> None:
    assert froude_factor("time", 24.0) == pytest.approx(4.90, abs=0.005)
    assert froude_factor("length", 24.0) * 0.8 == pytest.approx(19.2)
    assert froude_factor("moment", 24.0, density_ratio=1.025) == pytest.approx(
        froude_factor("force", 24.0, density_ratio=1.025) * 24.0
    )
    with pytest.raises(InputError, match="quantity is 'colour', expected one of length, time"):
        froude_factor("colour", 24.0)
