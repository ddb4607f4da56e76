"""A roll mode is one oscillator beside the model's terms; every simulation follows it, or says that it does not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from design_case import SCENARIOS
from diagnosis_case import hidden_record, vessel_of
from expdesign import workflows
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.equations_of_motion import ROLL_ANGLE_RAD
from expdesign.diagnosis.motion.simulation import simulate_windows
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.dictionary.trim import drift
from expdesign.errors import InputError
from expdesign.estimation.methods import estimate
from expdesign.estimation.replay.replay import Integration, simulate_batch
from expdesign.export.files import vessel_toml
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands
from expdesign.simulation import CALM, simulate, simulate_ensemble
from expdesign.simulation.run import simulate_many
from expdesign.vessel import NUMPY, Limit, Roll, Term, VesselModel

ROLL = Roll(period_s=7.0, damping_ratio=0.06, Y_phi=0.3, N_phi=0.01)
FREE = vessel_of("barge")
BOUNDED = tuple(replace(one, limits=(Limit(low=-90.0, high=90.0),) * 3) for one in FREE.actuators)
BARGE = replace(FREE, model=replace(FREE.model, actuators=BOUNDED))
SHIP = replace(BARGE, model=replace(BARGE.model, roll=ROLL))
RNG = np.random.default_rng(1)
ORDERS = np.repeat(RNG.uniform([6, -6, -60], [20, 6, 60], (8, 3)), 15, axis=0)
COMMANDS = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=ORDERS)
STATE = ((3.0, -2.0, 0.4), (1.5, 0.1, 0.02))


def test_sway_in_beam_thrust_is_the_linear_system_s_exact_solution():
    """Held side force on a ship that only sways: (v, phi, phi') is a linear system with a matrix exponential."""
    y_v, y_mu, push = -0.15, 0.02, 10.0
    terms = (Term("v", "Y_v", "v"), Term("v", "Y_mu", "tau_y"), Term("r", "N_r", "r"))
    model = VesselModel(
        terms=terms, parameters=np.array([y_v, y_mu, -1.0]), parameter_std=np.zeros(3), form="continuous",
        sample_time_s=1.0, actuators=BARGE.actuators, roll=replace(ROLL, N_phi=0.0),
    )  # fmt: skip
    held = Commands(sample_time_s=1.0, names=model.inputs, values=np.tile([0.0, push, 0.0], (30, 1)))
    sailed = simulate(replace(BARGE, model=model), held, substeps=20)
    w0, z, k = 2 * np.pi / ROLL.period_s, ROLL.damping_ratio, ROLL.Y_phi
    A = np.array([[y_v, k, 0, y_mu], [0, 0, 1, 0], [w0**2 * y_v, -(w0**2), -2 * z * w0, w0**2 * y_mu], [0, 0, 0, 0]])
    exact = [(expm(A * t) @ [0, 0, 0, push])[0] for t in sailed.time_s]
    np.testing.assert_allclose(sailed.velocity[:, 1], exact, atol=1e-6)


def test_every_simulation_gives_the_same_motion():
    alone = simulate(SHIP, COMMANDS, pose=STATE[0], velocity=STATE[1], substeps=2)
    plain = simulate(BARGE, COMMANDS, pose=STATE[0], velocity=STATE[1], substeps=2)
    assert np.abs(alone.velocity - plain.velocity)[:, 1].max() > 0.02
    many = simulate_many(
        SHIP, COMMANDS, pose=np.array([STATE[0]]), velocity=np.array([STATE[1]]), current_to=np.zeros((1, 2)),
        wind_to=np.zeros((1, 2)), parameters=SHIP.model.parameters[None], substeps=2,
    )  # fmt: skip
    np.testing.assert_allclose(many[:, 0, 3:], alone.velocity, atol=1e-12)
    ensemble = simulate_ensemble(
        SHIP, ORDERS, runs=2, environment=CALM, rng=np.random.default_rng(0), pose=STATE[0], velocity=STATE[1],
        integrator="rk4", substeps=2,
    )  # fmt: skip
    np.testing.assert_allclose(ensemble.velocity[:, 1], alone.velocity[:-1], atol=1e-12)
    batch = Batch(
        name="run", sample_time_s=1.0, input_names=SHIP.model.inputs, inputs=ORDERS, velocity=alone.velocity[:-1],
        pose=alone.pose[:-1],
    )  # fmt: skip
    replayed = simulate_batch(SHIP.model, batch, integration=Integration("rk4", 2))
    np.testing.assert_allclose(replayed.velocity, alone.velocity[:-1], atol=1e-12)


def test_the_diagnosis_moves_as_the_file_that_it_writes(tmp_path):
    record = hidden_record("barge", seed=2, batches=2, samples=120)
    keys = {"roll:period": 7.0, "roll:damping": 0.06, "roll:sway": 0.3, "roll:yaw": 0.01}
    final = extended_model(BARGE, record).with_effects(keys)
    extended, _ = extend(BARGE, final, {})
    assert extended.model.roll == ROLL
    path = tmp_path / "ship.toml"
    path.write_text(vessel_toml(extended), encoding="utf-8")
    assert load_vessel(path).model.roll == ROLL
    windows = cut_windows(final.model, record)
    again = extended_model(load_vessel(path), record)
    assert again.effects == keys
    start = np.column_stack([np.tile([1.5, 0.1, 0.02], (len(windows.batch), 1)), np.zeros((len(windows.batch), 2))])
    states = simulate_windows(again, windows, start).states
    for index, inputs in enumerate(windows.batch_inputs):
        commands = Commands(sample_time_s=windows.step_s, names=SHIP.model.inputs, values=inputs)
        parts = math.ceil(2 * math.pi / ROLL.period_s * windows.step_s / ROLL_ANGLE_RAD)
        sailed = simulate(extended, commands, velocity=STATE[1], substeps=parts)
        np.testing.assert_allclose(states[index, :, :3], sailed.velocity[:-1], atol=1e-9)


def test_roll_stands_still_where_the_side_acceleration_holds_it():
    """A motion without change: the oscillator's own equation gives the roll, and its push is the one that is added."""
    velocity, inputs = np.array([1.5, 0.1, 0.02]), ORDERS[0]
    plain = SHIP.model.accelerations(velocity, velocity[:2], inputs, NUMPY)
    angle = plain[1] + velocity[0] * velocity[2]
    with_roll = ROLL.rates(plain, velocity[0] * velocity[2], (angle, 0.0))
    assert with_roll[4] == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(drift(SHIP, velocity, inputs), with_roll[:3], rtol=1e-12)


def test_what_does_not_follow_roll_says_so(tmp_path):
    record = hidden_record("barge", seed=2, batches=1, samples=120)
    with pytest.raises(InputError, match=r"roll mode.*estimate does not support"):
        estimate(record, SHIP.model)
    with pytest.raises(InputError, match=r"roll mode.*does not support"):
        ROLL.rates((0.0, 0.0, 0.0), 0.0, ())
    with pytest.raises(InputError, match="expected integrator rk4"):
        simulate(SHIP, COMMANDS, integrator="euler", substeps=1)
    with pytest.raises(InputError, match="period_s is -1"):
        replace(ROLL, period_s=-1.0)
    scenario, vessel = tmp_path / "scenario.toml", tmp_path / "vessel.toml"
    own = load_vessel(SCENARIOS / "vessels/tender-20m.toml")
    vessel.write_text(vessel_toml(replace(own, model=replace(own.model, roll=ROLL))), encoding="utf-8")
    text = (SCENARIOS / "story.toml").read_text(encoding="utf-8")
    for name in ("dictionaries/", "areas/"):
        text = text.replace(f'"{name}', f'"{SCENARIOS}/{name}')
    text = "\n".join(f'vessel = "{vessel}"' if line.startswith("vessel ") else line for line in text.splitlines())
    scenario.write_text(text, encoding="utf-8")
    for command in (workflows.run, workflows.plan):
        with pytest.raises(InputError, match=r"roll mode, \[model.roll\], which plans do not follow"):
            command(scenario, tmp_path / "out", seed=0)
    with pytest.raises(InputError, match="expected it in the vessel of --truth only"):
        workflows.validate_design(scenario, tmp_path / "out")
    assert not (tmp_path / "out").exists()
