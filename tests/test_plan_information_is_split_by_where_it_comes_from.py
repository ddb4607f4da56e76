"""What whole runs, their places and the legs between them each add to or take from a plan's information."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.plan import Leg
from expdesign.plan.verify import realised_efficiencies
from expdesign.signals import Trajectory
from expdesign.simulation import CALM
from export_case import design, plan, tug


def split(legs: tuple[Leg, ...], trajectory: Trajectory | None = None) -> tuple[float, float]:
    sailed = plan()
    trial = replace(sailed.sailed, trajectory=trajectory or sailed.trajectory, legs=legs)
    placed, whole = realised_efficiencies(tug(), design(), CALM, trial)
    assert placed is not None
    assert whole is not None
    return placed, whole


def test_runs_placed_in_calm_water_have_the_information_of_the_designs_whole_runs():
    placed, _ = split(plan().legs)
    # entries differ from the primitives' own by what the legs leave over: parts in a hundred of speed
    assert placed == pytest.approx(design().efficiency_repeats, rel=0.1)


def test_legs_only_add():
    placed, whole = split(plan().legs)
    assert whole > placed


def test_a_trial_without_legs_has_nothing_to_add():
    everything = (Leg(kind="primitive", name="all", first=0, last=len(plan().commands)),)
    placed, whole = split(everything)
    assert placed == pytest.approx(whole, rel=1e-12)


def test_in_calm_water_headings_and_positions_do_not_matter():
    track = plan().trajectory
    turned = replace(track, pose=track.pose + np.array([100.0, -50.0, 1.2]))
    assert split(plan().legs, turned) == pytest.approx(split(plan().legs), rel=1e-9)
