"""Simulations of the diagnosis, their derivatives, and the vessel files that are written from them."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes.actuators import ACTUATOR_SCALE
from expdesign.diagnosis.causes.candidate import Situation
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.model import group_columns
from expdesign.diagnosis.motion.equations_of_motion import propagated
from expdesign.diagnosis.motion.inputs import exogenous_inputs
from expdesign.diagnosis.motion.linearisation import disturbance_of, linearise, responses, term_disturbances
from expdesign.diagnosis.motion.simulation import (
    _newton_from_measured,
    _step_by_step,
    initial_states,
    simulate_nearby,
    simulate_windows,
)
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import stem
from expdesign.vessel.quantities import GAINS_AND_OFFSETS

SMALL = {"theta:X_u": 1e-5, "current:north": 1e-4, "gain": 1e-4, "inertia:v": 1e-4, "heading_bias": 1e-4}


def case(ship="barge", **options):
    record = hidden_record(ship, seed=3, batches=2, samples=150, **options)
    extended = extended_model(vessel_of(ship), record)
    return extended, cut_windows(extended.model, record)


def test_sensitivities_are_differences_of_simulations():
    for ship in ("barge", "tug", "coaster"):
        extended, windows = case(ship)
        start = initial_states(windows)
        motion = simulate_windows(extended, windows, start)
        linear = linearise(motion)
        for key, size in SMALL.items():
            changed = extended.with_effects({key: size})
            answer = responses(linear, [disturbance_of(linear, changed, 1.0)])[0]
            difference = simulate_windows(changed, windows, start).predicted - motion.predicted
            assert np.abs(answer - difference).max() < 0.02 * np.abs(difference).max(), (ship, key)


def test_a_warm_start_changes_no_result():
    """Newton's method over all steps converges to the Runge-Kutta solution, from a close and from a distant start."""
    for ship in ("barge", "tug", "coaster"):
        extended, windows = case(ship)
        start = initial_states(windows)
        warm_start = linearise(simulate_windows(extended, windows, start))
        for effects in ({"gain": 0.01}, {"gain": -0.4, "inertia:v": 0.5}, {"lag:all": 6.0, "current:north": 0.5}):
            changed = extended.with_effects(effects)
            one = simulate_windows(changed, windows, start + 0.1)
            other = simulate_windows(changed, windows, start + 0.1, warm_start=warm_start)
            assert np.abs(one.states - other.states).max() < 1e-7, (ship, effects)
            near = simulate_nearby(changed, windows, start + 0.1, warm_start)
            assert near is None or np.abs(one.states - near.states).max() < 1e-7, (ship, effects)
            assert np.abs(one.heading_change - other.heading_change).max() < 1e-6, (ship, effects)
        little = extended.with_effects({"gain": 1e-3})
        assert simulate_nearby(little, windows, start, warm_start) is not None
        assert simulate_nearby(little, windows, start + 1e6, warm_start) is None


def test_fast_roll_is_simulated_at_once_as_step_by_step():
    """A roll of 2 s at steps of 1 s, from measured velocities alone, and its response to a push."""
    extended, windows = case("barge")
    ship = extended.with_effects({"roll:period": 2.0, "roll:damping": 0.1, "roll:sway": 0.2, "roll:yaw": 0.01})
    start = initial_states(windows, ship.states)
    exogenous = exogenous_inputs(ship, windows)
    at_once = _newton_from_measured(ship, windows, exogenous, start)
    assert at_once is not None
    np.testing.assert_allclose(at_once, _step_by_step(ship, windows, exogenous, start), atol=1e-7)
    motion = simulate_windows(ship, windows, start)
    changed = ship.with_effects({"current:north": 1e-4})
    answer = responses(linearise(motion), [disturbance_of(linearise(motion), changed, 1.0)])[0]
    difference = simulate_windows(changed, windows, start).predicted - motion.predicted
    assert np.abs(answer - difference).max() < 0.02 * np.abs(difference).max()


def test_gaps_between_steps_are_propagated_as_step_by_step():
    rng = np.random.default_rng(0)
    transition, first, missed = rng.normal(size=(2, 9, 3, 3)), rng.normal(size=(2, 3)), rng.normal(size=(2, 9, 3))
    change = propagated(transition, first, missed)
    np.testing.assert_allclose(change[:, 0], first)
    for step in range(9):
        after = np.einsum("wij,wj->wi", transition[:, step], change[:, step]) + missed[:, step]
        np.testing.assert_allclose(change[:, step + 1], after)


def test_shorter_windows_hold_the_same_data():
    """Every measurement once, each with the inputs and the heading that it had."""
    extended, windows = case("barge")
    short = windows.cut_shorter(40)
    assert short.measured.shape[1] == 38  # 150 samples in four windows
    assert np.isclose(np.nansum(short.measured), np.nansum(windows.measured))
    motion = simulate_windows(extended, windows, initial_states(windows))
    joints = motion.states[short.batch.astype(int), short.first.astype(int)]
    again = simulate_windows(extended, short, joints)
    errors = [np.sort(item.error[..., :3][np.isfinite(item.error[..., :3])]) for item in (motion, again)]
    assert np.allclose(*errors, atol=1e-9)


SENSED = {"lag:n": 2.0, "heading_bias": 0.02, "lever:forward": 1.0, "current:north": 0.1} | {
    fault.effects[0]: -fault.matters for fault in GAINS_AND_OFFSETS
}


TOGETHER = (
    ("tug", SENSED | {"gain": 0.1, "inertia:u": 0.2, "delay:a": 1.5, "offset:a1": 0.05, "theta:Y_v": -0.02}),
    ("tug", {"asymmetry": 0.4, "gain": 0.1, "inertia:r": 0.3, "theta:N_mu": 1e-4}),
    ("barge", {"asymmetry": 0.6, "gain": -0.2, "gain:propeller": 0.1, "inertia:r": 0.3}),
    ("barge", {"asymmetry": 0.6, "change:time": 0.0, "change:gain": 0.3, "change:damping_r": -0.2}),
    ("barge", {"term:Y_abs_v_v": -0.05, "inertia:v": 0.3, "change:time": 0.0, "change:damping": 0.2}),
    ("coaster", {"scale:rudder": -0.1, "gain": 0.1, "inertia:r": 0.2}),
    ("tug", {"scale:n1": -0.4, "scale:n2": 0.1, "asymmetry": 0.4, "gain": 0.1, "lag:n": 2.0, "offset:a1": 0.05}),
    ("coaster", SENSED | {"asymmetry": 2e-4, "inertia:r": 0.5, "gain": 0.1}),
    ("coaster", {"gain:propeller": 0.2, "gain": 0.1, "inertia:u": 0.2, "term:X_unn": -3e-4, "theta:X_nn": 1e-4}),
)


@pytest.mark.parametrize(("ship", "effects"), TOGETHER)
def test_an_extended_vessel_simulates_as_the_extended_model(ship, effects):
    """Effects written to a vessel and read again act as before, also together."""
    record = hidden_record(ship, seed=1, batches=2, samples=120)
    vessel = vessel_of(ship)
    extended = extended_model(vessel, record).with_effects(effects)
    again, missing = extend(vessel, extended, {})
    assert [note for note in missing if "after the change" not in note] == []
    windows = cut_windows(extended.model, record)
    start = initial_states(windows)
    one = simulate_windows(extended, windows, start).predicted
    other = simulate_windows(extended_model(again, record), windows, start).predicted
    assert np.abs(one - other).max() < 1e-9


SHIPS = sorted(Path(__file__).parents[1].glob("scenarios/vessels/*.toml"))
TEMPLATES = sorted(Path(__file__).parents[1].glob("expdesign/templates/*/vessel.toml"))


@pytest.mark.parametrize("path", [*SHIPS, *TEMPLATES], ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_each_rudder_and_each_of_several_engines_may_have_a_scale(path):
    """It is a candidate, and the vessel file with it simulates as the extended model does."""
    vessel, rng = load_vessel(path), np.random.default_rng(1)
    names = vessel.model.inputs
    inputs = np.repeat(rng.uniform(0.2, 0.4, (5, len(names))), 12, axis=0)
    batch = Batch(
        name="run", sample_time_s=1.0, input_names=names, inputs=inputs, velocity=np.full((60, 3), 0.1),
        pose=np.zeros((60, 3)), wind=np.zeros((60, 2)), depth_m=np.full(60, 30.0),
    )  # fmt: skip
    record = Record(batches=(batch,))
    plain = extended_model(vessel, record)
    windows = cut_windows(plain.model, record)
    found = ACTUATOR_SCALE.candidates(Situation(ship=plain, windows=windows))
    engines = [name for name in names if stem(name) == "n"]
    wanted = {name for name in names if stem(name) == "rudder"} | ({*engines} if len(engines) > 1 else set())
    keys = [key for one in found for key in one.free]
    assert {names[column] for key in keys for column in group_columns(key[6:], names)} == wanted
    start = initial_states(windows)
    before = simulate_windows(plain, windows, start).predicted
    for key, scale in itertools.product(keys, (-0.3, -1.0)):
        extended = plain.with_effects({key: scale})
        one = simulate_windows(extended, windows, start).predicted
        again, _ = extend(vessel, extended, {key: 0.1})
        assert np.isfinite(again.model.parameter_std).all()
        other = simulate_windows(extended_model(again, record), windows, start).predicted
        assert np.abs(one - other).max() < 1e-9
        assert np.abs(one - before).max() > 1e-6


def test_a_yaw_moment_of_thrust_is_written_whatever_reads_it():
    """A term that is not tau_psi alone is rewritten, and one that an earlier diagnosis wrote takes the new one in."""
    record, vessel = hidden_record("barge", seed=1, batches=2, samples=120), vessel_of("barge")
    terms = tuple(replace(term, expression="abs(tau_psi)*tau_psi*0.1") if term.name == "N_mu" else term
                  for term in vessel.model.terms)  # fmt: skip
    curved = replace(vessel, model=replace(vessel.model, terms=terms))
    once, _ = extend(vessel, extended_model(vessel, record).with_effects({"asymmetry": 0.3}), {})
    assert once.model.names[-1] == "N_tau_x"
    for ship in (curved, once):
        extended = extended_model(ship, record).with_effects({"asymmetry": 0.4, "gain": 0.1})
        again, _ = extend(ship, extended, {})
        assert again.model.names == ship.model.names
        windows = cut_windows(extended.model, record)
        one, other = (
            simulate_windows(x, windows, initial_states(windows)).predicted
            for x in (extended, extended_model(again, record))
        )
        assert np.abs(one - other).max() < 1e-8


def test_standard_errors_of_factors_propagate_into_the_vessel_file():
    """A factor of 0.88 +- 0.03 on X_mu = 0.02 +- 0.001 and a yaw moment: first-order error propagation by hand."""
    record, vessel = hidden_record("barge", seed=1, batches=2, samples=120), vessel_of("barge")
    values = vessel.model.parameters
    vessel = replace(vessel, model=replace(vessel.model, parameter_std=np.where(values == 0.02, 0.001, 0.0)))
    extended = extended_model(vessel, record).with_effects({"gain": -0.12, "asymmetry": 0.5})
    model = extend(vessel, extended, {"gain": 0.03, "asymmetry": 0.1})[0].model
    std = dict(zip(model.names, model.parameter_std, strict=True))
    assert np.isclose(std["X_mu"], np.hypot(0.88 * 0.001, 0.02 * 0.03))
    assert np.isclose(std["N_mu"], 0.0004 * 0.03)
    assert np.isclose(std["N_tau_x"], np.hypot(0.5 * 0.0004 * 0.03, 0.1 * 0.88 * 0.0004))
    assert std["Y_v"] == 0.0


def test_regressors_are_the_derivatives_by_parameters_and_terms():
    """Along a path with a factor on everything: current, load, thrust, shallow water, a change of the ship."""
    effects = {
        "current:north": 0.1, "inertia:v": 0.2, "gain": 0.1, "shallow:damping": 0.3, "shallow:inertia": 0.2,
        "change:time": 90.0, "change:gain": 0.1, "change:damping": -0.1, "asymmetry": 0.01,
    }  # fmt: skip
    for ship, roll in (("barge", {"roll:period": 9.0, "roll:damping": 0.1, "roll:sway": 0.3}), ("coaster", {})):
        extended, windows = case(ship, shoaling=True)
        changed = extended.with_effects(effects | roll)
        linear = linearise(simulate_windows(changed, windows, initial_states(windows, changed.states)))
        found = term_disturbances(linear, (*extended.unit_terms, "gain"))
        assert {"gain"}.isdisjoint(found)
        assert any(key.startswith("term:") for key in found)
        for key, exact in found.items():
            changed = linear.motion.ship.with_effects({key: linear.motion.ship.get(key) + 1e-3})
            other = disturbance_of(linear, changed, 1e-3)
            size = np.abs(exact.force).max()
            assert size > 0, key
            np.testing.assert_allclose(exact.force, other.force, atol=1e-6 * size, err_msg=f"{ship} {key}")
