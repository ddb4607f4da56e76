"""Windows that an unstable model shortens are fitted by output error: slow noise would hide what is steady."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.fit import fit, with_longer_windows
from expdesign.diagnosis.fit.output_error import AHEAD_S
from expdesign.diagnosis.motion import initial_states, longest_windows, stable_windows
from expdesign.diagnosis.vessel_file.reading import extended_model

CURRENT = {"current:north": 0.2, "current:east": 0.1}


def barge(*, seed, samples=150, relative_std=0.0, **parameters):
    """A barge that turns ever faster with `N_r` above zero, and a record of the tame one in a current."""
    record = hidden_record("barge", seed=seed, batches=3, samples=samples, current=tuple(CURRENT.values()))
    ship = vessel_of("barge", relative_std=relative_std)
    ship = replace(ship, model=ship.model.with_parameters(parameters))
    return extended_model(ship, record), record


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_current_is_certain_where_slow_noise_would_take_its_place(seed):
    """The Wald statistic of its two components is beyond the 0.5 % point, chi-squared, without slow noise alone."""
    ship, record = barge(seed=seed, N_r=0.1)
    begun, windows = with_longer_windows(ship, record, stable_windows(ship, record))
    assert begun is ship
    assert windows.white_noise
    assert windows.steps * windows.step_s < AHEAD_S
    found, slow = (current_in(ship, part) for part in (windows, replace(windows, white_noise=False)))
    assert slow[1] < chi2.isf(0.005, 2) < found[1]
    assert found[0] < slow[0]
    assert found[0] < np.hypot(*CURRENT.values()) / 2


def current_in(ship, windows):
    """Error of the estimated current [m/s], and its Wald statistic."""
    found = fit(ship, windows, (*CURRENT,), starts=initial_states(windows))
    value = np.array([found.value(key) for key in CURRENT])
    return np.hypot(*(value - [*CURRENT.values()])), value @ np.linalg.solve(found.covariance, value)


@pytest.mark.parametrize("samples", [150, 25])
def test_short_runs_of_a_stable_model_keep_their_slow_noise(samples):
    """Its windows are as long as the runs."""
    ship, record = barge(seed=1, samples=samples)
    windows = stable_windows(ship, record)
    assert windows.steps == longest_windows(ship, record).steps
    assert with_longer_windows(ship, record, windows) == (ship, windows)
    assert not windows.white_noise


def test_a_model_that_becomes_stable_gets_long_windows_with_slow_noise():
    """Its file allows damping, and the fit in short windows finds it."""
    ship, record = barge(seed=1, relative_std=0.5, N_r=0.1)
    begun, windows = with_longer_windows(ship, record, stable_windows(ship, record))
    assert begun.get("theta:N_r") < -0.1
    assert not windows.white_noise
    assert windows.steps == longest_windows(ship, record).steps
