"""The table of ship quantities row by row: a file states it, a ship is measured with it, and a diagnosis knows it.

That records are rid of it before parameters are estimated is shown by
`test_reduction_undoes_what_the_vessel_file_states`.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis_case import from_pose
from estimation_case import TRUE
from expdesign.diagnosis.data import cut_windows
from expdesign.diagnosis.diagnose import diagnose
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.diagnosis.vessel_file import extended_model, public_name
from expdesign.export.files.vessel_file import vessel_toml
from expdesign.kinematics import in_stated_time
from expdesign.reduction import with_reduced_wind
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.simulation import Environment, measure, simulate
from expdesign.vessel import Response, Sensors, Vessel
from expdesign.vessel.quantities import STD, Quantity, rows_of
from measured_trials import tug_commands

WIND = Environment(wind_to=np.array([4.0, -3.0]))
BEFORE = 20
SIZES = {"rate": 0.02, "deadband": 0.9}
ROWS = {row.key: row for row in (*rows_of(Response), *rows_of(Sensors)) if row.takes != STD}


def size(row: Quantity) -> float:
    """A large one, so that what is not told shows."""
    usual = {"m": 5.0, "s": 2.0, "rad/s": 0.01}.get(row.unit, 0.1)
    return SIZES.get(row.key, 1.2 if row.is_gain else usual)


def stating(row: Quantity, folder: Path) -> Vessel:
    """The ship whose file states the quantity, of angles where it is that of an actuator."""
    if row.key in Response.__dataclass_fields__:
        changed = Response(**{row.key: size(row)})
        actuators = tuple(replace(one, responses=(Response(), changed)) for one in TRUE.actuators)
        ship = replace(TRUE, model=replace(TRUE.model, actuators=actuators))
    else:
        ship = replace(TRUE, sensors=replace(TRUE.sensors, **{row.key: size(row)}))
    path = folder / "ship.toml"
    path.write_text(vessel_toml(ship), encoding="utf-8")
    return load_vessel(path)


def sailed(ship: Vessel, *, noise: bool, samples: int, seed: int = 0) -> Batch:
    """A run in wind as the ship's sensors measure it."""
    commands = tug_commands(samples, seed=seed)
    motion = simulate(ship, commands, velocity=(1.7, 0.7, 0.0), environment=WIND)
    quiet = {row.key: 0.0 for row in rows_of(Sensors) if row.takes == STD}
    own = ship if noise else replace(ship, sensors=replace(ship.sensors, **quiet))
    seen = measure(own, commands, motion, environment=WIND, rng=np.random.default_rng(seed))
    run = Batch(
        name=f"run{seed}", sample_time_s=commands.sample_time_s, input_names=commands.names, inputs=commands.values,
        velocity=np.stack([seen["u_mps"], seen["v_mps"], seen["r_radps"]], axis=1),
        pose=np.stack([seen["north_m"], seen["east_m"], np.unwrap(seen["heading_rad"])], axis=1),
        wind=np.stack([seen["wind_u_mps"], seen["wind_v_mps"]], axis=1),
    )  # fmt: skip
    return run.cut(slice(BEFORE, None))  # what is late shows a ship that stands still before she is measured


def as_read(batch: Batch, row: Quantity, ship: Vessel) -> Record:
    """The record as `diagnose` reads it; velocities come from the pose where these show the quantity."""
    batch = from_pose(batch) if row.sensor in ("position", "heading") else batch
    return in_stated_time(Record(batches=(batch,)), ship.sensors)


def misfit(ship: Vessel, record: Record) -> float:
    """Root mean square error of a simulation, over that of the measured velocities."""
    record = with_reduced_wind(record, ship.sensors)
    windows = cut_windows(extended_model(ship, record).model, record)
    motion = simulate_from_measured(extended_model(ship, record), windows)
    error, measured = motion.error[..., :3], windows.measured[..., :3]
    return float(np.sqrt(np.nanmean((error / np.nanstd(measured, axis=(0, 1))) ** 2)))


@pytest.mark.parametrize("key", ROWS)
def test_a_row_that_a_file_states_is_read_simulated_and_known_to_a_diagnosis(key: str, tmp_path: Path):
    row = ROWS[key]
    ship = stating(row, tmp_path)
    stated = ship.responses[1] if hasattr(ship.responses[1], key) else ship.sensors
    assert getattr(stated, key) == size(row)
    batch = sailed(ship, noise=False, samples=300)
    others = sailed(TRUE, noise=False, samples=300)
    changed = any(not np.allclose(getattr(batch, what), getattr(others, what)) for what in ("velocity", "pose", "wind"))
    assert changed
    known, unknown = (misfit(one, as_read(batch, row, one)) for one in (ship, TRUE))
    assert known < (0.2 if key.endswith("interval_s") else 0.02) * unknown  # between readings signals are interpolated


def test_effects_of_a_row_are_named_and_bounded():
    record = Record(batches=(sailed(TRUE, noise=False, samples=60),))
    ship = extended_model(TRUE, record)
    for row in ROWS.values():
        for effect in row.effects:
            key = effect if ":" in effect or row.key in Sensors.__dataclass_fields__ else f"{effect}:a"
            low, high = ship.bounds(key)
            name, factor, offset, unit = public_name(key, ship)
            assert low < high
            assert "{}" not in name
            assert factor in (1.0, -1.0)
            assert offset == (1.0 if row.is_gain else 0.0)
            assert unit.startswith(row.unit)


@pytest.mark.thorough
@pytest.mark.parametrize("key", [key for key, row in ROWS.items() if row.effects])
def test_a_diagnosis_finds_nothing_in_what_the_file_states(key: str, tmp_path: Path):
    row = ROWS[key]
    ship = stating(row, tmp_path)
    batches = tuple(sailed(ship, noise=True, samples=300, seed=seed) for seed in range(2))
    record = Record(batches=tuple(as_read(batch, row, ship).batches[0] for batch in batches))
    assert diagnose(ship, record, seed=0).findings == ()
