"""A planned trial with nothing hidden, as a diagnosis sees it before it looks for causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.motion import Motion, initial_states, simulate_from_measured, stable_windows
from expdesign.diagnosis.select import ScoreTest, fit_nuisance, open_candidates, score_tests
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.foresight.trial import TrialRun, simulated_record, weather_without_causes
from expdesign.foresight.tuning import TUNING
from expdesign.simulation import Environment
from expdesign.vessel import Vessel

UNSEEN = {
    "shallow_water": "no depth is recorded",
    "actuator_deadband": "commands have too few sizes, or a dead band is stated",
    "actuator_scale": "the ship has no rudder, or the scale is stated",
    "wind": "the model has no equation that air acts in",
    "current": "no heading is measured",
    "log_scale": "surge and sway are not measured by a log, or positions beside them tell its scale without a model",
    "gyro_scale": "no yaw rate is measured",
    "heading_bias": "surge and sway are not both measured",
    "lever_arm": "sway and yaw are not both measured",
    "roll_coupling": "sway and yaw are not both in the model",
    "thruster_asymmetry": "yaw is not in the model",
}
"""Cause -> why a trial's records cannot show it, where they cannot."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Background:
    """A trial with nothing hidden, as a diagnosis sees it before it looks for causes.

    Attributes:
        base: the fit of uncertain parameters and of the noise.
        windows: the data.
        again: the same runs with other noise, simulated by the model in use as it is and cut like the data.
        candidates: of the catalogue.
        tests: of those candidates that differ from everything in the fit.
    """

    base: Fit
    windows: Windows
    again: tuple[Motion, ...]
    candidates: tuple[Candidate, ...]
    tests: tuple[ScoreTest, ...]


def background(vessel: Vessel, runs: Sequence[TrialRun], weather: Environment, *, seed: int = 0) -> Background:
    """Simulate a trial without hidden effects, and prepare its tests.

    Args:
        vessel: the model in use, with its sensors.
        runs: of the trial.
        weather: the forecast.
        seed: of sensor noise, weather and the null distribution of the tests.
    """
    rng = np.random.default_rng(seed)
    calm = weather_without_causes(vessel, weather)
    record = simulated_record(vessel, runs, calm, rng)
    ship = extended_model(vessel, record)
    windows = stable_windows(ship, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    candidates = tuple(open_candidates(base, windows))
    tests = score_tests(base, candidates, rng)
    records = [simulated_record(vessel, runs, calm, rng) for _ in range(TUNING.records)]
    like = {"longest_s": windows.steps * windows.step_s, "step_s": windows.step_s}
    again = [simulate_from_measured(ship, cut_windows(ship.model, item, **like)) for item in records]
    return Background(base=base, windows=windows, again=tuple(again), candidates=candidates, tests=tests)
