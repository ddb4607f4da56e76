"""Whole trials of drawn ships, legs steered and runs open loop from where they really begin: few leave the water."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.scenario import load_scenario

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_runs_begun_in_place_keep_the_promise_and_runs_begun_elsewhere_need_not(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "benchmarks"))
    import safety

    case = load_scenario(ROOT / "scenarios" / "narrows.toml")
    information = workflows.scored(case)
    plan = workflows.planned(case, information, workflows.designed(case, information))
    in_place, unbroken = (
        safety.sailed(case, plan, draws=100, in_place=wanted, rng=np.random.default_rng(3)) for wanted in (True, False)
    )
    sys.modules.pop("safety")
    share, error = safety.share_of("primitive", plan.legs, in_place.leaves)
    assert share <= 1.0 - case.plan.confidence + 2 * error
    runs = [leg.kind == "primitive" for leg in plan.legs]
    assert np.median(in_place.off_m[runs]) < 0.1 * case.vessel.length_m
    assert np.median(unbroken.off_m[runs]) > np.median(in_place.off_m[runs])
    assert safety.share_of("primitive", plan.legs, unbroken.leaves)[0] > share


def test_steady_motion_leads_through_the_planned_state_at_the_planned_time(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "benchmarks"))
    import safety

    wanted = np.array([10.0, -20.0, 0.7, 1.5, 0.2, 0.0])
    states = safety.steady(wanted, np.arange(-60.0, 5.0))
    sys.modules.pop("safety")
    np.testing.assert_allclose(states[60], wanted)
    moved = np.diff(states[:, :2], axis=0)
    np.testing.assert_allclose(np.hypot(*moved.T), np.hypot(1.5, 0.2))
    course = np.arctan2(moved[:, 1], moved[:, 0])
    np.testing.assert_allclose(course, 0.7 + np.arctan2(0.2, 1.5))
