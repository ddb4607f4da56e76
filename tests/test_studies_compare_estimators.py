"""Comparisons of estimators on subsets of runs and on fewer samples count what they say."""

import numpy as np
import pytest

from fit_by_samples import fits_by_samples
from manoeuvring import SEVERE
from subsets import STUDIES, Found, subsets, table


def test_every_subset_is_taken_once() -> None:
    tank, pond = STUDIES
    names = [f"zigzag_{size}_{rest}" for size in (10, 15) for rest in ("01", "05")] + ["zigzag_25_05", "zigzag_30_05"]
    found = subsets(tank, [*names, *tank.tests])
    assert len(set(found)) == len(found) == 20
    assert not {name for subset in found for name in subset} & set(tank.tests)
    starts = [start for kind, _ in pond.kinds for start in kind]
    assert len(subsets(pond, starts)) == 9


def test_unstable_subsets_lose_and_are_counted() -> None:
    """Of three subsets the second method wins two in surge and one in yaw, where it diverges once."""
    tank = STUDIES[0]
    steady, other = np.full((3, 3), 50.0), np.array([[60.0, 40.0, 60.0], [55.0, 40.0, -np.inf], [45.0, 40.0, 45.0]])
    values = ({"X_abs_u_u": -1.0, "Y_v": 0.0, "N_r": 0.0}, {"X_abs_u_u": -3.0, "Y_v": 0.0, "N_r": 0.0}, {})
    lines = list(table(tank, {"ls": Found(steady, values), "iv": Found(other, values)}))
    row = [cell.strip() for cell in lines[3].strip("|").split("|")]
    assert row[0] == "iv"
    assert row[2].startswith("2 of 3")
    assert row[4].startswith("0 of 3")
    assert row[6].startswith("1 of 3")
    assert row[1].startswith("52.5 ±")  # of the two stable ones
    assert row[7] == "1 of 3"
    assert "-2 ± 1.4" in lines[-1]


@pytest.mark.thorough
def test_measured_wind_saves_the_fit_of_surge_in_severe_wind() -> None:
    """Figure 6.3 of F. Ljungberg's doctoral thesis, by the order of the two lines, from 3000 samples."""
    found = fits_by_samples(SEVERE, runs=3, sets=1, sizes=(3000,), estimators=("IV1", "IV3"))
    blind, seeing = found["IV1", 3000], found["IV3", 3000]
    assert seeing.unstable == 0
    assert np.nanmax(blind.fits[:, 0], initial=-np.inf) < seeing.fits[:, 0].min()
