"""On real trials the diagnosis names what is known to act, and mending it helps on runs that nobody used."""

import numpy as np
import pytest

from diagnosis_real import tried
from diagnosis_real_hulls import averaged_over
from expdesign.signals import Batch
from real_data_cases import POND
from sample_files import outside


def test_averages_keep_means_and_are_cut_to_whole_samples() -> None:
    """What is measured is averaged around an instant, inputs from there to the next one."""
    rows = np.arange(23.0)[:, None] * [1.0, 2.0, 3.0]
    batch = Batch(name="run", sample_time_s=0.1, input_names=("n1",), inputs=rows[:, :1], velocity=rows, pose=rows)
    found = averaged_over(batch, 5, 2.1)
    assert len(found) == 3
    assert found.sample_time_s == pytest.approx(0.5)
    np.testing.assert_allclose(found.velocity.mean(axis=0), rows[2:17].mean(axis=0))
    np.testing.assert_allclose(found.inputs[0], rows[5:10, :1].mean(axis=0))


@pytest.mark.outside
@pytest.mark.slow
def test_wind_is_named_first_on_the_pond_and_sway_is_predicted_better() -> None:
    """The pond's wind of 1-2 m/s acts on a model that makes 0.05-0.4 m/s: Wakita et al. (2022) measured it for that."""
    result = tried(POND, outside(POND.folder).parent)
    assert result.found.findings[0].cause == "wind"
    sway = [np.mean([rows[name][1] for name in rows]) for rows in (result.before, result.after)]
    assert sway[1] < sway[0]
    for name in ("zig-zags", "random"):
        assert result.after[name][1] < result.before[name][1], name
