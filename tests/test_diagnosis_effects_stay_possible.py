"""Every effect of every cause keeps within physical bounds, and what is said of it has finite numbers."""

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import from_pose, hidden_record, vessel_of
from expdesign.diagnosis import CAUSES
from expdesign.diagnosis.causes.candidate import Candidate, Situation
from expdesign.diagnosis.conclusions.findings import cause_of
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.fit import after_step, best_step, step_bounds
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion.simulation import initial_states, simulate_windows
from expdesign.diagnosis.select.fitted_candidate import _limits
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.errors import NoAnswer
from expdesign.signals import Record
from expdesign.vessel import Response

ANY_SIZE = ("theta", "term", "roll", "asymmetry", "wind:toward", "deadband")
"""Effects whose numbers may have any size; some of them may have one sign only."""


def situations() -> list[Situation]:
    """Ships with forces, azimuths and a rudder; velocities measured or from the pose, no pose; depth; a stated rate."""
    found = []
    kinds = (
        ("barge", False, True, True),
        ("tug", True, False, True),
        ("coaster", False, False, True),
        ("tug", False, False, False),
    )
    for ship, pose_only, wind, posed in kinds:
        record = hidden_record(ship, seed=3, batches=2, samples=150)
        batches = [from_pose(batch, wind=wind) if pose_only else batch for batch in record.batches]
        deep = np.linspace(4.0, 40.0, len(batches[0]))
        named = [f"run {number}" for number in range(len(batches))]
        batches = [replace(one, name=name, depth_m=deep) for one, name in zip(batches, named, strict=True)]
        batches = batches if wind else [replace(one, wind=None) for one in batches]
        batches = batches if posed else [replace(one, pose=None) for one in batches]
        vessel, model = vessel_of(ship), vessel_of(ship).model
        slow = tuple(
            replace(one, responses=(Response(rate=0.1),) * len(one.signals)) if one.kind == "rudder" else one
            for one in model.actuators
        )
        vessel = replace(vessel, model=replace(model, actuators=slow))
        record = Record(batches=tuple(batches))
        extended = extended_model(vessel, record)
        found.append(Situation(ship=extended, windows=cut_windows(extended.model, record)))
    return found


@pytest.fixture(scope="module")
def candidates() -> list[tuple[Situation, Candidate]]:
    return [(one, item) for one in situations() for cause in CAUSES for item in cause.candidates(one)]


def test_every_cause_is_walked_through(candidates):
    assert {item.cause.split(":")[0] for _, item in candidates} >= {cause.name for cause in CAUSES} - {"parameters"}


def test_every_effect_has_bounds_that_fits_keep(candidates):
    """However far the linear model asks to go, either way."""
    for situation, item in candidates:
        ship, keys = situation.ship.with_effects({**item.fixed, **item.free}), tuple(item.free)
        for key in keys:
            finite = np.isfinite(ship.bounds(key)).all()
            assert finite or key.startswith(ANY_SIZE), key
            assert ship.bounds(key)[0] <= 0.0 <= ship.bounds(key)[1]
        for way in (-1e9, 1e9):
            step, _ = best_step(np.eye(len(keys)), np.full(len(keys), way), step_bounds(ship, keys))
            for key, value in after_step(ship, keys, step).items():
                low, high = ship.bounds(key)
                assert low - 1e-9 <= value <= high + 1e-9, key
                if key.startswith(("lag", "delay", "slew", "deadband")):
                    assert value >= 0.0


def test_an_effect_at_its_bound_is_impossible_and_no_effect_is_not(candidates):
    for situation, item in candidates:
        for key in item.free:
            ship = situation.ship
            low, high = ship.bounds(key)
            assert ship.with_effects({key: 0.0}).is_possible([key])
            for bound in (low, high):
                if math.isfinite(bound) and bound:
                    assert not ship.with_effects({key: bound}).is_possible([key])
                    assert ship.with_effects({key: 0.5 * bound}).is_possible([key])


@pytest.mark.parametrize("std", [0.0, 0.02, math.inf, math.nan])
def test_every_explanation_has_finite_numbers(candidates, std):
    """Of estimates with any standard error, or none that is known."""
    for situation, item in candidates:
        ship = situation.ship.with_effects({**item.fixed, **dict.fromkeys(item.free, 0.3)})
        fixed = [] if item.grid is None else [item.grid[0]]
        fixed += [key for key in item.fixed if key.startswith("roll")]
        values = {**dict.fromkeys(item.free, (0.3, std)), **{key: (ship.get(key), std) for key in fixed}}
        text = cause_of(item.cause).explain(values, ship)
        assert "nan" not in text.lower()
        assert "inf " not in text.replace("inertia", "")


def changes(candidates: list[tuple[Situation, Candidate]]) -> list[tuple[Situation, Candidate]]:
    return [(situation, item) for situation, item in candidates if item.cause == "change_point"]


def test_a_change_lies_within_one_run_and_ends_with_it(candidates):
    """Other runs are simulated as without it, and its time is one that the run has."""
    for situation, item in changes(candidates)[::7]:
        ship, windows = situation.ship, situation.windows
        time = item.fixed["change:time"]
        run, begin, length = windows.place(time)
        for value in (time, *item.grid[1], *_limits_of(ship, windows, time)):
            assert windows.place(value)[0] == run
            assert 0.0 < value - begin < length <= 150.0
        starts = initial_states(windows)
        changed, plain = (
            simulate_windows(one, windows, starts).predicted
            for one in (ship.with_effects({**item.fixed, **dict.fromkeys(item.free, 0.3)}), ship)
        )
        mine = np.array(windows.names)[windows.batch.astype(int)] == run
        differs = (np.abs(changed - plain) > 1e-7).any(axis=(1, 2))  # of rounding in solutions side by side
        assert differs[mine].any()
        assert not differs[~mine].any()


def _limits_of(ship: ExtendedModel, windows, time: float) -> tuple[float, float]:
    class Found:
        def __init__(self):
            self.ship, self.value = ship, lambda _key: time
            self.linear = type("L", (), {"motion": type("M", (), {"windows": windows})})

    return _limits(Found(), "change:time")  # type: ignore[arg-type]


def test_a_search_that_cannot_begin_as_parameters_lead_away_is_no_answer(monkeypatch):
    """Not a defect: the motion is finite, but not what its parameters do to it."""

    def unbounded(*_arguments):
        raise FloatingPointError

    diagnosing = importlib.import_module("expdesign.diagnosis.diagnose")
    monkeypatch.setattr(diagnosing, "select_causes", unbounded)
    with pytest.raises(NoAnswer, match=r"its simulation of the data diverges.*expdesign estimate --method oe"):
        diagnosing.diagnose(vessel_of("barge"), hidden_record("barge", seed=3, batches=2, samples=150))
