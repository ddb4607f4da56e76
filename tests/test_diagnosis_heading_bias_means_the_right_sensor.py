"""A turned compass and a turned velocity sensor: which of them it can be depends on where velocities come from.

Both make measured sway v + u sin(bias). Whatever is found goes into the vessel file so that its sensors, simulated by
the package's own measurement, show the same.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import vessel_of
from expdesign.diagnosis.accuracy import accuracy
from expdesign.diagnosis.causes.candidate import Situation
from expdesign.diagnosis.causes.sensors import _of_row
from expdesign.diagnosis.data.sampled_batch import derived_outputs
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.linearisation import sensor_outputs
from expdesign.diagnosis.vessel_file.reading import extended_model, public_name
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.records import load_records
from expdesign.signals import Commands
from expdesign.simulation import CALM, measure, simulate
from expdesign.vessel import Sensors
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, LOG, Fault, Quantity

BIAS = 0.06
SHIP = vessel_of("barge")


def trial(folder, sensors: Sensors, *, pose_only: bool):
    """A noise-free trial of the barge as its own sensors record it, read from a file."""
    rng = np.random.default_rng(3)
    values = np.repeat(rng.uniform([6, -6, -60], [20, 6, 60], (12, 3)), 25, axis=0)
    commands = Commands(sample_time_s=1.0, names=("tau_x", "tau_y", "tau_psi"), values=values)
    sailed = simulate(SHIP, commands, velocity=(1.5, 0.0, 0.0), substeps=5)
    columns = measure(replace(SHIP, sensors=sensors), commands, sailed, environment=CALM, rng=rng)
    kept = {n: v for n, v in columns.items() if not (pose_only and n in ("u_mps", "v_mps", "r_radps"))}
    path = folder / f"trial-{pose_only}.csv"
    rows = "\n".join(",".join(f"{x:.12g}" for x in row) for row in zip(*kept.values(), strict=True))
    path.write_text(",".join(kept) + "\n" + rows + "\n", encoding="utf-8")
    return load_records([path], vessel_inputs=SHIP.model.inputs), sailed


FAULTS = {
    "compass": (Sensors(heading_bias_rad=-BIAS), True),
    "velocity sensor": (Sensors(velocity_angle_rad=-BIAS), False),
    "antenna": (Sensors(position_forward_m=4.0, position_starboard_m=-1.0), True),
    "place of the velocity sensor": (Sensors(velocity_forward_m=4.0, velocity_starboard_m=-1.0), False),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_stated_fault_of_a_sensor_explains_the_data_it_makes(fault, tmp_path):
    """Without noise what is left is integration and differencing; ignoring the fault leaves much more."""
    sensors, pose_only = FAULTS[fault]
    record, _ = trial(tmp_path, sensors, pose_only=pose_only)
    knowing, blind = (accuracy(extended_model(ship, record), record) for ship in (replace(SHIP, sensors=sensors), SHIP))
    assert (knowing.rmse < 0.006).all()
    assert blind.rmse[1] > 5 * knowing.rmse[1]


@pytest.mark.parametrize("pose_only", [True, False])
def test_a_fault_of_the_other_sensor_is_not_seen(pose_only, tmp_path):
    """A compass does not turn velocities that a sensor of their own measures, and the other way round."""
    sensors = Sensors(velocity_angle_rad=-BIAS) if pose_only else Sensors(heading_bias_rad=-BIAS)
    record, _ = trial(tmp_path, sensors, pose_only=pose_only)
    assert set(derived_outputs(record)) == (set("uvr") if pose_only else set())
    assert extended_model(replace(SHIP, sensors=sensors), record).get("heading_bias") == 0.0


@pytest.mark.parametrize("pose_only", [True, False])
def test_what_is_found_is_written_to_the_sensor_that_does_it(pose_only, tmp_path):
    record, _ = trial(tmp_path, Sensors(), pose_only=pose_only)
    found = extended_model(SHIP, record).with_effects({"heading_bias": BIAS, "lever:forward": 2.0})
    ship, _ = extend(SHIP, found, {})
    named = ("heading_bias_rad", "velocity_angle_rad")[:: 1 if pose_only else -1]
    assert [getattr(ship.sensors, name) for name in named] == [-BIAS, 0.0]
    assert extended_model(ship, record).effects == found.effects
    again, _ = trial(tmp_path, ship.sensors, pose_only=pose_only)
    assert (accuracy(extended_model(ship, again), again).rmse < 0.006).all()


def test_surge_leaks_into_sway_by_the_sine_of_the_bias(tmp_path):
    record, _ = trial(tmp_path, Sensors(), pose_only=False)
    ship = extended_model(SHIP, record).with_effects({"heading_bias": BIAS})
    windows = cut_windows(ship.model, record)
    states = np.zeros((len(windows.batch), windows.steps, 3))
    states[..., 0] = 2.0
    predicted = sensor_outputs(ship, states, windows)
    np.testing.assert_allclose(predicted[..., 1], 2.0 * np.sin(BIAS), rtol=1e-12)


@pytest.mark.parametrize("pose_only", [True, False])
def test_every_number_of_the_results_is_the_vessel_files_by_name_and_sign(pose_only, tmp_path):
    """One name, one sign, one definition: what a page prints and what the written vessel file states."""
    record, _ = trial(tmp_path, Sensors(), pose_only=pose_only)
    place = "position" if pose_only else "velocity"
    effects = {
        "heading_bias": 0.04, "lever:forward": 2.0, "lever:starboard": -1.0, "late:psi": 0.5, "current:north": 0.2,
        "current:east": -0.1, **({"late:position": 0.6} if pose_only else {"late:r": 0.7}),
    }  # fmt: skip
    effects |= {} if pose_only else {fault.effects[0]: -fault.matters for fault in GAINS_AND_OFFSETS}
    driven = SHIP.model.inputs[0]
    effects |= {f"{kind}:{driven}": value for kind, value in {"offset": 0.03, "lag": 2.0, "delay": 1.0}.items()}
    found = extended_model(SHIP, record).with_effects(effects)
    ship, missing = extend(SHIP, found, {})
    assert not missing
    sensors, response = ship.sensors, ship.responses[0]
    written = {
        "heading_bias": sensors.heading_bias_rad if pose_only else sensors.velocity_angle_rad,
        **dict(zip(("lever:forward", "lever:starboard"), sensors.place(place), strict=True)),
        "late:psi": sensors.heading_delay_s, "late:position": sensors.position_delay_s,
        "late:r": sensors.yaw_rate_delay_s,
        **{fault.effects[0]: getattr(sensors, fault.key) for fault in GAINS_AND_OFFSETS},
        "current:north": ship.environment.current_to[0], "current:east": ship.environment.current_to[1],
        f"offset:{driven}": response.offset, f"lag:{driven}": response.lag_s,
        f"delay:{driven}": response.delay_s,
    }  # fmt: skip
    for key, effect in effects.items():
        name, factor, offset, _ = public_name(key, found)
        assert offset + factor * effect == pytest.approx(written[key]), name
    assert public_name("heading_bias", found)[0] == ("heading_bias_rad" if pose_only else "velocity_angle_rad")


@pytest.mark.parametrize(
    ("neutral", "looked_for"), [pytest.param(1.0, False, id="gain"), pytest.param(0.0, True, id="offset")]
)
def test_beside_positions_the_diagnosis_leaves_the_gain_of_a_log_to_them_and_looks_for_its_offset(
    tmp_path, neutral, looked_for
):
    """A new row is one field: an offset of the log is proposed although no comparison of instruments tells it."""
    words = Fault(name="log_bias", title="", missing="", summary="", explained="{}", unseen="")
    row = Quantity(
        stage="sensors", sensor="velocity", signals=("u",), neutral=neutral, shown_by=LOG, effects=("log_bias",)
    )
    record, _ = trial(tmp_path, Sensors(), pose_only=False)
    ship = extended_model(SHIP, record)
    windows = cut_windows(ship.model, record)
    found = _of_row(row, words).candidates(Situation(ship=ship, windows=windows))
    assert windows.has_position
    assert [dict(one.free) for one in found] == [{"log_bias": 0.0}] * looked_for
