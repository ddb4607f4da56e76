"""A structure explains all of its own accelerations, and of real ones as much as others found."""

from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import InputError, NoAnswer
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import VesselModel
from real_data import explained_accelerations
from sample_files import outside_record
from vessel_files import ESSO_WIND, KVLCC2, write_vessel


def tanker(folder: Path, text: str = KVLCC2) -> VesselModel:
    return load_vessel(write_vessel(folder / "tanker.toml", text)).model


def swinging(noise: float = 0.0) -> Record:
    """A run at 1 m/s in which v follows dv/dt = -0.2 v + 3 rudder |u| u with a slow rudder, at 10 Hz."""
    time = 0.1 * np.arange(2000)
    rudder = 0.3 * np.sin(0.11 * time) + 0.2 * np.sin(0.037 * time)
    v = np.zeros(len(time))
    for k in range(len(time) - 1):
        force = 3 * (rudder[k] + rudder[k + 1]) / 2
        v[k + 1] = v[k] * np.exp(-0.02) + force * (1 - np.exp(-0.02)) / 0.2
    v += noise * np.random.default_rng(0).normal(size=len(v))
    ones = np.ones_like(time)
    velocity = np.stack([ones, v, 0.1 * np.cos(0.07 * time)], axis=1)
    velocity[1000, 0] = 1.001  # accelerations of u that are not exactly zero
    inputs = np.stack([10 * ones, rudder], axis=1)
    batch = Batch(
        name="run", sample_time_s=0.1, input_names=("n1", "rudder1"), inputs=inputs, velocity=velocity, pose=None
    )
    return Record(batches=(batch,))


def test_a_motion_of_the_structure_is_explained(tmp_path: Path) -> None:
    assert explained_accelerations(tanker(tmp_path), swinging(), window_s=2.0)["v"] > 0.9999


def test_noise_hides_accelerations_until_the_window_is_long_enough(tmp_path: Path) -> None:
    model, noisy = tanker(tmp_path), swinging(noise=0.2)
    shares = [explained_accelerations(model, noisy, window_s=window)["v"] for window in (0.2, 2.0, 8.0)]
    assert shares[0] < 0.3 < 0.8 < shares[2]
    assert shares == sorted(shares)


def test_wrong_windows_are_refused(tmp_path: Path) -> None:
    model = tanker(tmp_path)
    with pytest.raises(InputError, match="three samples"):
        explained_accelerations(model, swinging(), window_s=0.05)
    with pytest.raises(NoAnswer, match="longer than the window"):
        explained_accelerations(model, swinging(), window_s=900.0)
    with pytest.raises(InputError, match="no measured wind"):
        explained_accelerations(model, swinging(), window_s=2.0, wind=True)


@pytest.mark.outside
def test_the_towing_tank_is_nearly_all_explained(tmp_path: Path) -> None:
    """An independent fit of the same data reached 0.98, 1.00 and 0.98."""
    found = explained_accelerations(tanker(tmp_path), outside_record("kvlcc2-hsva-7m"), window_s=4.0)
    assert list(found.values()) == pytest.approx([0.98, 1.00, 0.98], abs=0.03)


@pytest.mark.outside
def test_on_the_pond_wind_explains_a_good_part(tmp_path: Path) -> None:
    """An independent fit reached 0.70, 0.74, 0.66 with wind and 0.62, 0.46, 0.53 without."""
    model, record = tanker(tmp_path, ESSO_WIND), outside_record("esso-osaka-3m")
    windy = explained_accelerations(model, record, window_s=8.0, wind=True)
    still = explained_accelerations(model, record, window_s=8.0)
    assert list(windy.values()) == pytest.approx([0.70, 0.74, 0.66], abs=0.06)
    assert list(still.values()) == pytest.approx([0.62, 0.46, 0.53], abs=0.12)
    assert windy["v"] - still["v"] > 0.2
