"""Coupled inertia of sway and yaw obeys mechanics, and whatever does not follow it says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.simulation import simulate_windows
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.errors import FileError, InputError
from expdesign.estimation.methods import estimate
from expdesign.export.files import vessel_toml
from expdesign.information import estimated_parameters
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import simulate
from expdesign.simulation.run import simulate_many
from expdesign.vessel import Inertia, Term, Vessel, VesselModel, required_push

MASS, TURNING, AHEAD = 4e5, 6e7, 3.5  # of a body; its moment of inertia about its centre of gravity, x_g
SAMPLE_S = 0.5


def body(x_g: float, values: dict[str, tuple[str, str, float]], inertia: Inertia | None) -> Vessel:
    """A ship that is pushed by forces, with the origin of its b-frame so far behind its centre of gravity."""
    barge = vessel_of("barge", sample_time_s=SAMPLE_S)
    terms = tuple(Term(equation, name, text) for name, (equation, text, _) in values.items())
    model = VesselModel(
        terms=terms, parameters=np.array([value for *_, value in values.values()]), inertia=inertia,
        parameter_std=np.zeros(len(terms)), form="continuous", sample_time_s=SAMPLE_S, actuators=barge.actuators,
    )  # fmt: skip
    return replace(barge, model=model, name=f"x_g {x_g:g}")


def rigid(x_g: float) -> Vessel:
    """Newton's law for a rigid body, at an origin so far behind its centre of gravity; no water."""
    about = TURNING + MASS * x_g**2
    inertia = Inertia(sway_kg=MASS, yaw_kgm2=about, sway_yaw_kgm=MASS * x_g) if x_g else None
    rows = {
        "X_vr": ("u", "v*r", 1.0), "X_rr": ("u", "r*r", x_g), "Y_ur": ("v", "u*r", -1.0),
        "N_ur": ("r", "u*r", -MASS * x_g / about), "X_x": ("u", "tau_x", 1.0 / MASS),
        "Y_y": ("v", "tau_y", 1.0 / MASS), "N_y": ("r", "tau_y", x_g / about), "N_psi": ("r", "tau_psi", 1.0 / about),
    }  # fmt: skip
    return body(x_g, rows, inertia)


def energy(velocity: np.ndarray, x_g: float) -> np.ndarray:
    u, v, r = velocity.T
    about = TURNING + MASS * x_g**2
    return 0.5 * (MASS * (u**2 + v**2) + 2.0 * MASS * x_g * v * r + about * r**2)


def pushed(ship: Vessel) -> Commands:
    """Forces through the centre of gravity, and a moment."""
    rng = np.random.default_rng(3)
    values = np.repeat(rng.uniform([-1, -1, -1], [1, 1, 1], (8, 3)) * [8e4, 5e4, 9e5], 15, axis=0)
    return Commands(sample_time_s=SAMPLE_S, names=ship.model.inputs, values=values)


def test_without_forces_a_body_keeps_its_energy() -> None:
    ship = rigid(AHEAD)
    still = Commands(sample_time_s=SAMPLE_S, names=ship.model.inputs, values=np.zeros((400, 3)))
    track = simulate(ship, still, velocity=(5.0, 0.8, 0.09), substeps=8)
    kept = energy(track.velocity, AHEAD)
    assert np.ptp(track.velocity[:, 0]) > 1.0  # it does move
    np.testing.assert_allclose(kept, kept[0], rtol=1e-8)


def test_the_motion_is_the_same_whatever_point_of_the_body_is_its_origin() -> None:
    central, aft = rigid(0.0), rigid(AHEAD)
    one = simulate(central, pushed(central), velocity=(4.0, 0.3, 0.05), substeps=8)
    u, v, r = one.velocity.T
    two = simulate(aft, pushed(aft), pose=(-AHEAD, 0.0, 0.0), velocity=(4.0, 0.3 - AHEAD * 0.05, 0.05), substeps=8)
    np.testing.assert_allclose(two.velocity, np.stack([u, v - AHEAD * r, r], axis=1), atol=1e-7)
    heading = one.pose[:, 2]
    moved = one.pose[:, :2] - AHEAD * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    np.testing.assert_allclose(two.pose[:, :2], moved, atol=1e-5)
    assert abs(AHEAD * r).max() > 0.1


def test_every_simulation_and_the_inverse_follow_it() -> None:
    ship = rigid(AHEAD)
    commands, start = pushed(ship), np.array([4.0, 0.1, 0.05])
    alone = simulate(ship, commands, velocity=start)
    many = simulate_many(
        ship, commands, pose=np.zeros((60, 3)), velocity=np.tile(start, (60, 1)), current_to=np.zeros((60, 2)),
        wind_to=np.zeros((60, 2)), parameters=np.tile(ship.model.parameters, (60, 1)),
    )  # fmt: skip
    np.testing.assert_allclose(many[:, 7, 3:], alone.velocity, atol=1e-10)
    barge = vessel_of("barge")
    coupled = replace(barge, model=replace(barge.model, inertia=Inertia(sway_kg=4e5, yaw_kgm2=9e7, sway_yaw_kgm=2e6)))
    record = hidden_record("barge", seed=2, batches=1, samples=120)
    windows = cut_windows(coupled.model, record)
    states = simulate_windows(extended_model(coupled, record), windows, np.tile([1.5, 0.1, 0.02], (1, 1))).states
    held = Commands(sample_time_s=windows.step_s, names=coupled.model.inputs, values=windows.batch_inputs[0])
    sailed = simulate(coupled, held, velocity=(1.5, 0.1, 0.02), substeps=1).velocity[:-1]
    np.testing.assert_allclose(states[0], sailed, atol=1e-9)
    assert np.abs(simulate(barge, held, velocity=(1.5, 0.1, 0.02)).velocity[:-1] - sailed).max() > 1e-3
    velocity, wanted = np.array([2.0, 0.2, 0.03]), np.array([0.02, -0.03, 0.004])
    force = required_push(ship.model, velocity, wanted)
    np.testing.assert_allclose(ship.model.accelerations(velocity, velocity[:2], force), wanted, atol=1e-12)


def test_a_matrix_without_symmetry_is_taken_as_it_is() -> None:
    matrix = np.array([[7e5, -2e5], [9e5, 6e7]])
    inertia = Inertia(sway_kg=7e5, yaw_kgm2=6e7, sway_yaw_kgm=-2e5, yaw_sway_kgm=9e5)
    sway, yaw = 0.03, -0.002
    exact = np.linalg.solve(matrix, [7e5 * sway, 6e7 * yaw])
    np.testing.assert_allclose(inertia.coupled(sway, yaw), exact, rtol=1e-12)
    np.testing.assert_allclose(inertia.uncoupled(*inertia.coupled(sway, yaw)), (sway, yaw), rtol=1e-12)


def test_a_vessel_file_states_it_and_what_does_not_follow_it_says_so(tmp_path: Path) -> None:
    own = load_vessel(SCENARIOS / "vessels/tender-20m.toml")
    stated = Inertia(sway_kg=7e4, yaw_kgm2=2e6, sway_yaw_kgm=4e4)
    path = tmp_path / "ship.toml"
    path.write_text(vessel_toml(replace(own, model=replace(own.model, inertia=stated))), encoding="utf-8")
    ship = load_vessel(path)
    assert ship.model.inertia == stated
    with pytest.raises(InputError, match=r"\[model.inertia\], which estimate does not support"):
        estimate(hidden_record("barge", seed=2, batches=1, samples=120), ship.model)
    with pytest.raises(InputError, match=r"\[model.inertia\], which information does not support"):
        estimated_parameters(ship.model, ())
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("sway_yaw_kgm = 40000.0", "sway_yaw_kgm = 400000.0"), encoding="utf-8")
    with pytest.raises(FileError, match=r"model.inertia: has no inverse: inertia.sway_yaw_kgm is 400000"):
        load_vessel(path)
