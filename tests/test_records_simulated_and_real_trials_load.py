"""Simulated trials come back from a file as they went in; real ones load, and their poses and velocities agree."""

from pathlib import Path

import numpy as np
import pytest

from expdesign.records import load_records
from expdesign.signals import Commands
from expdesign.simulation import CALM, Environment, measure, simulate
from expdesign.values import Array
from expdesign.vessel import Actuator, Limit, Vessel, VesselModel, structure_terms
from record_files import write_trial
from sample_files import outside, outside_record

STEP = 1.0

PARAMETERS = {
    "X_u": -0.05, "X_vr": 1.0, "X_abs_u_u": -0.05, "W_abs_u_u": -0.0005, "X_mu": 0.02, "X_kappa": -0.0025,
    "Y_v": -0.2, "Y_ur": -0.65, "Y_abs_v_v": -0.2, "Y_abs_v_r": -0.1, "W_abs_v_v": -0.0015, "Y_mu": 0.02,
    "N_r": -0.1, "N_uv": -0.0015, "N_abs_v_v": -0.001, "N_abs_v_r": -0.04, "W_uv": -0.00003, "N_mu": 0.0003,
}  # F. Ljungberg, doctoral thesis, table 6.1  # fmt: skip


def tugboat() -> Vessel:
    terms = structure_terms("manoeuvring-18", ())
    thrusters = tuple(
        Actuator(kind="azimuth", number=number, forward_m=forward, limits=(Limit(), Limit()))
        for number, forward in ((1, 9.0), (2, -9.0))
    )
    model = VesselModel(
        terms=terms,
        parameters=np.array([PARAMETERS[term.name] for term in terms]),
        parameter_std=np.zeros(len(terms)),
        form="discrete",
        sample_time_s=STEP,
        actuators=thrusters,
    )
    return Vessel(name="tug", length_m=30, beam_m=10, draught_m=4, sample_time_s=STEP, model=model)


def measured(vessel: Vessel, environment: Environment) -> tuple[dict[str, Array], Commands, Array, Array]:
    time = STEP * np.arange(200)
    angle = 0.6 * np.sin(0.05 * time)
    values = np.stack([8 + 0 * time, angle, 8 + np.sin(0.1 * time), -angle], axis=-1)
    commands = Commands(sample_time_s=STEP, names=vessel.model.inputs, values=values)
    trajectory = simulate(vessel, commands, velocity=(3.0, 0.0, 0.0), environment=environment)
    rng = np.random.default_rng(0)
    columns = measure(vessel, commands, trajectory, environment=environment, rng=rng)
    return columns, commands, trajectory.pose[:-1], trajectory.velocity[:-1]


WIND = Environment(current_to=np.array([0.2, -0.1]), wind_to=np.array([3.0, -5.0]))


@pytest.mark.parametrize("environment", [CALM, WIND], ids=["calm", "wind"])
def test_a_simulated_trial_comes_back_the_same(tmp_path: Path, environment: Environment) -> None:
    vessel = tugboat()
    columns, commands, pose, velocity = measured(vessel, environment)
    path = write_trial(tmp_path / "measured.csv", columns)
    record = load_records(path, vessel_inputs=vessel.model.inputs, sample_time_s=vessel.sample_time_s)
    (batch,) = record.batches
    assert np.array_equal(batch.velocity, velocity)
    assert np.array_equal(batch.inputs, commands.values)
    assert np.array_equal(batch.pose[:, :2], pose[:, :2])
    assert np.allclose(batch.pose[:, 2], pose[:, 2], atol=1e-13)
    assert np.array_equal(batch.wind, np.stack([columns["wind_u_mps"], columns["wind_v_mps"]], axis=-1))
    assert (batch.input_names, batch.sample_time_s, batch.first_row) == (vessel.model.inputs, STEP, 2)


def test_velocities_from_a_simulated_pose_are_those_of_the_simulation(tmp_path: Path) -> None:
    """The error of the central difference is Ts^2 / 6 times the third derivative: here some millimetres per second."""
    vessel = tugboat()
    columns, _, _, velocity = measured(vessel, WIND)
    path = write_trial(tmp_path / "measured.csv", columns)
    difference = load_records(path, velocity="difference").batches[0].velocity
    smoothed = load_records(path, velocity="smoothed").batches[0].velocity
    assert np.abs(difference - velocity[1:-1]).max() < 0.02
    assert np.abs(smoothed - velocity)[2:-2].max() < 0.02


def errors(folder: str, method: str) -> Array:
    """Root-mean-square difference of u, v, r from the measured ones per run, (runs, 3)."""
    pairs = zip(outside_record(folder, velocity=method).batches, outside_record(folder).batches, strict=True)
    return np.array(
        [
            np.sqrt(np.mean((a.velocity - b.velocity[a.first_row - 2 : a.first_row - 2 + len(a)]) ** 2, axis=0))
            for a, b in pairs
        ]
    )


REAL = [("kvlcc2-hsva-7m", 8, 0.05), ("esso-osaka-3m", 34, 0.1)]


@pytest.mark.outside
@pytest.mark.parametrize(("folder", "runs", "step"), REAL)
def test_real_files_load_whole(folder: str, runs: int, step: float) -> None:
    record = outside_record(folder)
    assert len(record.batches) == runs
    assert {batch.sample_time_s for batch in record.batches} == {step}
    for batch in record.batches:
        lines = (outside(folder) / batch.name).read_text(encoding="utf-8").count("\n")
        assert len(batch) == lines - 1
        assert np.abs(np.diff(batch.pose[:, 2])).max() < 0.2


@pytest.mark.outside
@pytest.mark.parametrize("method", ["difference", "smoothed"])
def test_velocities_of_the_towing_tank_agree_to_a_millimetre_per_second(method: str) -> None:
    assert (errors("kvlcc2-hsva-7m", method) < 0.001).all()


@pytest.mark.outside
def test_velocities_of_the_pond_agree_as_well_as_its_positions_allow() -> None:
    """Positions there jump by centimetres: a smoother halves the error of the difference, at a speed of 0.3 m/s."""
    difference, smoothed = errors("esso-osaka-3m", "difference"), errors("esso-osaka-3m", "smoothed")
    assert (np.median(smoothed, axis=0) < (0.025, 0.015, 0.012)).all()
    assert (smoothed < (0.11, 0.025, 0.022)).all()
    assert (np.median(smoothed / difference, axis=0) < 0.65).all()
