"""Regressors and accelerations are those of the thesis, in every kind of number and both forms, and have mirrors."""

from dataclasses import replace

import casadi
import numpy as np
import pytest

from design_case import azimuth, force_actuator, structured, vessel
from expdesign.errors import InputError, UnknownName
from expdesign.signals import Commands
from expdesign.simulation import Environment, simulate
from expdesign.vessel import NUMPY, SCALAR, STRUCTURES, Operators, Term, VesselModel, structure_terms

CASADI = Operators(casadi.fabs, casadi.sin, casadi.cos)
FORCES = (force_actuator(),)
TEN = STRUCTURES["manoeuvring-10"]


def random_state(rng: np.random.Generator) -> tuple[list[float], list[float], list[float]]:
    """(u, v, r) through water, (u_q, v_q) through air, (tau_x, tau_y, tau_psi)."""
    return rng.standard_normal(3).tolist(), rng.standard_normal(2).tolist(), rng.standard_normal(3).tolist()


@pytest.mark.parametrize("draw", range(20))
def test_regressors_of_the_full_structure_are_3_61_to_3_63(draw: int):
    (u, v, r), (u_q, v_q), (tx, ty, tpsi) = state = random_state(np.random.default_rng(draw))
    phi_u = [u, v * r, u * abs(u), u_q * abs(u_q), tx, u * tx]
    phi_v = [v, u * r, v * abs(v), r * abs(v), v_q * abs(v_q), ty]
    phi_r = [r, u * v, v * abs(v), r * abs(v), u_q * v_q, tpsi]
    model = structured("manoeuvring-18", np.zeros(18), FORCES)
    np.testing.assert_allclose(model.regressors(*state), phi_u + phi_v + phi_r, rtol=1e-14)
    assert [term.equation for term in model.terms] == ["u"] * 6 + ["v"] * 6 + ["r"] * 6


@pytest.mark.parametrize("draw", range(5))
def test_regressors_of_the_smaller_structures_are_9_1_and_3_65(draw: int):
    (u, v, r), (u_q, _), (tx, ty, tpsi) = state = random_state(np.random.default_rng(draw))
    ten = structured("manoeuvring-10", np.zeros(10), FORCES).regressors(*state)
    surge = structured("surge", np.zeros(4), FORCES).regressors(*state)
    np.testing.assert_allclose(ten, [u, u * abs(u), v * r, tx, v, u * r, ty, r, u * v, tpsi], rtol=1e-14)
    np.testing.assert_allclose(surge, [u, abs(u) * u, abs(u_q) * u_q, tx], rtol=1e-14)


@pytest.mark.parametrize("draw", range(5))
def test_one_euler_step_adds_the_regressors_times_the_discrete_parameters(draw: int):
    rng = np.random.default_rng(draw)
    ship = vessel("azimuth-30m-true")
    nu, heading = rng.standard_normal(3), rng.uniform(-3, 3)
    current, wind = rng.standard_normal(2), rng.standard_normal(2)
    command = rng.standard_normal(4)
    R = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    water, air = nu - np.append(R.T @ current, 0.0), nu[:2] - R.T @ wind
    phi = np.array(ship.model.regressors(water, air, command))
    step = [sum(p * x for p, x, t in zip(ship.model.parameters, phi, ship.model.terms, strict=True) if t.equation == e)
            for e in "uvr"]  # fmt: skip
    run = simulate(
        ship,
        Commands(sample_time_s=1.0, names=ship.model.inputs, values=command[None]),
        pose=(0.0, 0.0, heading),
        velocity=nu,
        environment=Environment(current_to=current, wind_to=wind),
        integrator="euler",
        substeps=1,
    )
    np.testing.assert_allclose(run.velocity[1], nu + step, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("sample_time_s", [0.125, 1.0, 7.0])
def test_discrete_parameters_are_the_sample_time_times_the_continuous_ones(sample_time_s: float):
    rng = np.random.default_rng(1)
    theta, state = rng.standard_normal(18), random_state(rng)
    continuous = structured("manoeuvring-18", theta, FORCES, form="continuous", sample_time_s=sample_time_s)
    discrete = structured("manoeuvring-18", sample_time_s * theta, FORCES, sample_time_s=sample_time_s)
    np.testing.assert_allclose(discrete.accelerations(*state), continuous.accelerations(*state), rtol=1e-13)


def test_floats_arrays_and_symbols_give_the_same_accelerations():
    rng = np.random.default_rng(2)
    actuators = (azimuth(1, forward_m=9.0), azimuth(2, forward_m=-9.0, starboard_m=1.0))
    model = structured("manoeuvring-18", rng.standard_normal(18), actuators)
    nu, air, command = rng.standard_normal((3, 50)), rng.standard_normal((2, 50)), rng.standard_normal((4, 50))
    arrays = np.array(model.accelerations(nu, air, command, NUMPY))
    floats = [model.accelerations(nu[:, k].tolist(), air[:, k].tolist(), command[:, k].tolist(), SCALAR)
              for k in range(50)]  # fmt: skip
    symbols = casadi.SX.sym("x", 9)
    parts = casadi.vertsplit(symbols)
    expression = casadi.vertcat(*model.accelerations(parts[:3], parts[3:5], parts[5:], CASADI))
    function = casadi.Function("rates", [symbols], [expression])
    by_symbol = np.array(function(np.vstack([nu, air, command])))
    np.testing.assert_allclose(arrays, np.array(floats).T, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(by_symbol, arrays, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("structure", ["manoeuvring-10", "manoeuvring-18"])
def test_the_mirrored_ship_accelerates_as_the_mirror_image(structure: str):
    rng = np.random.default_rng(3)
    model = structured(structure, rng.standard_normal(len(STRUCTURES[structure])), FORCES)
    (u, v, r), (u_q, v_q), (tx, ty, tpsi) = random_state(rng)
    du, dv, dr = model.accelerations((u, v, r), (u_q, v_q), (tx, ty, tpsi))
    mirrored = model.accelerations((u, -v, -r), (u_q, -v_q), (tx, -ty, -tpsi))
    np.testing.assert_allclose(mirrored, (du, -dv, -dr), rtol=1e-14)


def test_mirrored_azimuths_push_the_mirror_image():
    ship = vessel("azimuth-30m-true")
    n1, a1, n2, a2 = np.random.default_rng(4).standard_normal(4)
    nu, air = (1.0, 0.2, -0.3), (-2.0, 1.5)
    du, dv, dr = ship.model.accelerations(nu, air, (n1, a1, n2, a2))
    mirrored = ship.model.accelerations((1.0, -0.2, 0.3), (-2.0, -1.5), (n1, -a1, n2, -a2))
    np.testing.assert_allclose(mirrored, (du, -dv, -dr), rtol=1e-13)


def test_a_custom_structure_with_the_same_terms_is_the_built_in_one():
    rng = np.random.default_rng(5)
    spelled = (
        Term("u", "X_u", " u "), Term("u", "X_vr", "(r)*v"), Term("u", "X_abs_u_u", "u*abs(-u)"),
        Term("u", "W_abs_u_u", "u_q*abs(u_q)"), Term("u", "X_mu", "1.0*tau_x"), Term("u", "X_kappa", "tau_x*u"),
        Term("v", "Y_v", "v + 0"), Term("v", "Y_ur", "-(-u*r)"), Term("v", "Y_abs_v_v", "v*abs(v)"),
        Term("v", "Y_abs_v_r", "r*abs(v)"), Term("v", "W_abs_v_v", "v_q*abs(v_q)"), Term("v", "Y_mu", "tau_y"),
        Term("r", "N_r", "r"), Term("r", "N_uv", "v*u"), Term("r", "N_abs_v_v", "v*abs(v)"),
        Term("r", "N_abs_v_r", "r*abs(v)"), Term("r", "W_uv", "v_q*u_q"), Term("r", "N_mu", "tau_psi - 0*u"),
    )  # fmt: skip
    built_in = structured("manoeuvring-18", rng.standard_normal(18), FORCES)
    custom = replace(built_in, terms=structure_terms("custom", spelled))
    state = random_state(rng)
    np.testing.assert_allclose(custom.accelerations(*state), built_in.accelerations(*state), rtol=1e-14)


def test_a_velocity_without_equation_stays():
    model = structured("surge", np.array([-0.2, 0.0, 0.0, 0.01]), FORCES)
    assert model.outputs == ("u",)
    assert model.accelerations((1.0, 2.0, 3.0), (0.0, 0.0), (5.0, 5.0, 5.0))[1:] == (0.0, 0.0)


def test_parameters_are_set_by_name_or_in_order():
    model = structured("manoeuvring-10", np.arange(10.0), FORCES)
    changed = model.with_parameters({"Y_v": -7.0})
    assert dict(zip(changed.names, changed.parameters, strict=True))["Y_v"] == -7.0
    assert np.count_nonzero(changed.parameters != model.parameters) == 1
    assert np.array_equal(model.with_parameters(np.ones(10)).parameters, np.ones(10))
    with pytest.raises(UnknownName, match="did you mean 'N_uv'"):
        model.with_parameters({"N_vu": 1.0})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"parameters": np.ones(3)}, "10 terms"),
        ({"form": "sampled"}, "unknown model form 'sampled'"),
        (
            {"terms": (Term("w", "A", "u"),), "parameters": np.ones(1), "parameter_std": np.ones(1)},
            "equation of term A",
        ),
        ({"terms": (Term("u", "A", "u"),) * 2, "parameters": np.ones(2), "parameter_std": np.ones(2)}, "repeat"),
        ({"terms": (Term("u", "A", "n1"),), "parameters": np.ones(1), "parameter_std": np.ones(1)}, "'n1'"),
    ],
)
def test_models_that_contradict_themselves_are_refused(change: dict[str, object], says: str):
    model = structured("manoeuvring-10", np.zeros(10), FORCES)
    with pytest.raises(InputError, match=says):
        replace(model, **change)


def test_structures_are_named_or_custom_never_both():
    extra = (Term("u", "A", "u"),)
    for structure, terms, says in (("abkowitz", (), "unknown model structure"), ("surge", extra, "built in"),
                                   ("custom", (), "needs")):  # fmt: skip
        with pytest.raises(InputError, match=says):
            structure_terms(structure, terms)
    assert isinstance(structured("surge", np.zeros(4), FORCES), VesselModel)


def test_a_model_reads_the_air_and_the_depth_where_a_term_does():
    for structure in STRUCTURES:
        terms = structure_terms(structure)
        model = structured(structure, np.ones(len(terms)), FORCES)
        assert model.reads_air == any("_q" in term.expression for term in terms)
        assert not model.reads_depth
        assert model.read_signals() == {name for one in model.expressions for name in one.signals}
        silent = model.with_parameters(np.zeros(len(terms)))
        assert silent.read_signals() == set()
        unsure = replace(silent, parameter_std=np.eye(len(terms))[0])
        assert unsure.read_signals() == set(model.expressions[0].signals)
    assert {structured(name, np.ones(len(structure_terms(name))), FORCES).reads_air for name in STRUCTURES} == {
        True,
        False,
    }
