"""Orders for many ships at once are those for one, and no side of a pair of propellers is asked for more than all."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.scenario import load_vessel
from expdesign.simulation.helm import Helm
from helm_case import catamaran, coaster
from plan_case import VESSELS, ship

SHIPS = {
    "rudder": coaster,
    "propeller": catamaran,
    "azimuth": ship,
    "force": lambda: load_vessel(VESSELS / "model-ship.toml"),
}


@pytest.mark.parametrize("means", SHIPS)
def test_rows_for_many_are_the_rows_for_one(means):
    helm = Helm(vessel=SHIPS[means]())
    assert helm.means == means
    drive, angle = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 300))
    drive[:3] = -1.0, 0.0, 1.0
    one_by_one = [helm.inputs(*pair) for pair in zip(drive.tolist(), angle.tolist(), strict=True)]
    np.testing.assert_allclose(helm.rows(drive, angle), one_by_one, rtol=0, atol=1e-12 * np.abs(one_by_one).max())


def test_propellers_that_steer_share_what_is_left():
    port, starboard = (15.0 * np.clip(0.5 + side * np.sin([0.3, 0.7]), -1.0, 1.0) for side in (1, -1))
    given = Helm(vessel=catamaran()).rows(np.array(0.5), np.array([0.3, 0.7]))
    np.testing.assert_allclose(given, np.stack([port, starboard], axis=1), rtol=1e-14)
    assert port[1] == 15.0
