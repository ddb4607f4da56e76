"""Actuators with delay, dead band, lag or misalignment: information is that of the delivered inputs, by any path.

With dead time of whole samples, dead band and misalignment a vessel does exactly what an ideal one does under shifted,
cut and turned commands; with lag what is delivered changes within a sample, and they agree to second order in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.dictionary import Primitive, build_dictionary
from expdesign.durations import bordered
from expdesign.information import score_primitives
from expdesign.information.disturbed import bordered_runs, score_augmented
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.information.recorded import recorded_information
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.signals import Batch, Record
from expdesign.simulation import Environment, delivered, simulate
from expdesign.vessel import IDEAL, Response, Vessel
from scenario_files import SCENARIOS

TENDER = load_vessel(SCENARIOS / "vessels/tender-20m.toml")
SPECS = load_dictionary(SCENARIOS / "dictionaries/tender-20m.toml")
SEA = Environment(current_to=np.array([0.1, -0.2]))
NAMES = TENDER.model.names


def with_responses(speed: Response, angle: Response) -> Vessel:
    actuators = tuple(replace(item, responses=(speed, angle)) for item in TENDER.actuators)
    return replace(TENDER, model=replace(TENDER.model, actuators=actuators))


IDEAL_SHIP = with_responses(IDEAL, IDEAL)
EXACT = with_responses(Response(delay_s=3.0, deadband=2.0), Response(delay_s=2.0, offset=0.1))
LAGGING = with_responses(Response(lag_s=4.0), Response(lag_s=2.0, delay_s=1.5))


def pair(ship: Vessel) -> tuple[list[Primitive], list[Primitive]]:
    """The dictionary run by a ship, and the ideal ship's runs under what the first one's actuators deliver."""
    own = [
        replace(
            item,
            trajectory=simulate(ship, item.commands, velocity=item.entry_velocity, standing=item.entry_inputs),
        )
        for item in build_dictionary(IDEAL_SHIP, SPECS)
    ]
    given = [delivered(ship, item.commands, standing=item.entry_inputs) for item in own]
    ideal = [
        replace(
            item,
            commands=commands,
            entry_inputs=commands.values[0],
            trajectory=simulate(IDEAL_SHIP, commands, velocity=item.entry_velocity),
        )
        for item, commands in zip(own, given, strict=True)
    ]
    return own, ideal


def apart(a: np.ndarray, b: np.ndarray) -> float:
    size = np.sqrt(np.where(np.diag(b) > 0, np.diag(b), 1.0))
    return float(np.abs((a - b) / np.outer(size, size)).max())


@pytest.mark.parametrize(("ship", "tolerance"), [(EXACT, 1e-9), (LAGGING, 0.05)], ids=["exact", "lagging"])
def test_scores_are_those_of_delivered_signals(ship, tolerance):
    own, ideal = pair(ship)
    found = score_primitives(ship, own, environment=SEA)
    wanted = score_primitives(IDEAL_SHIP, ideal, environment=SEA)
    raw = score_primitives(IDEAL_SHIP, own, environment=SEA)
    for item, other in zip(found, wanted, strict=True):
        assert apart(item.X, other.X) < tolerance
        assert np.abs(item.Y - other.Y).max() <= tolerance * np.sqrt(np.diag(other.X).max())
    assert max(apart(item.X, other.X) for item, other in zip(raw, wanted, strict=True)) > 0.2


@pytest.mark.parametrize(("ship", "tolerance"), [(EXACT, 1e-9), (LAGGING, 0.05)], ids=["exact", "lagging"])
def test_augmented_scores_are_those_of_delivered_signals(ship, tolerance):
    own, ideal = pair(ship)
    found = score_augmented(ship, own[:3], predictor="augmented", environment=SEA)
    wanted = score_augmented(IDEAL_SHIP, ideal[:3], predictor="augmented", environment=SEA)
    for item, other in zip(found.information, wanted.information, strict=True):
        assert apart(item.X, other.X) < tolerance


@pytest.mark.parametrize("ship", [EXACT, LAGGING], ids=["exact", "lagging"])
@pytest.mark.parametrize("subtraction", ["none", "batch", "complete"])
def test_many_runs_at_once_give_the_same_numbers(ship, subtraction):
    own, _ = pair(ship)
    same = [item for item in own if len(item.commands) == len(own[-1].commands)]
    matrices, _ = bordered_runs(
        ship,
        np.array([item.commands.values for item in same]),
        np.array([item.entry_velocity for item in same]),
        NAMES,
        environment=SEA,
        mean_subtraction=subtraction,
        standing=np.array([item.entry_inputs for item in same]),
    )
    for matrix, item in zip(matrices, score_primitives(ship, same, environment=SEA), strict=True):
        assert apart(matrix, bordered(item, subtraction)) < 1e-9


def test_expected_covariances_are_those_of_delivered_signals():
    own, ideal = pair(EXACT)
    parts = [
        [TrialPart(commands=item.commands, velocity=item.entry_velocity, standing=item.entry_inputs) for item in runs]
        for runs in (own, ideal)
    ]
    found = expected_covariance(EXACT, parts[0], NAMES)
    assert apart(found, expected_covariance(IDEAL_SHIP, parts[1], NAMES)) < 1e-9


def test_recorded_batches_are_those_of_delivered_signals():
    def record(runs):
        batches = [
            Batch(
                name=item.name,
                sample_time_s=1.0,
                input_names=item.commands.names,
                inputs=item.commands.values,
                velocity=item.trajectory.velocity[:-1],
                pose=item.trajectory.pose[:-1],
            )
            for item in runs
        ]
        return Record(batches=tuple(batches))

    own, _ = pair(EXACT)
    given = [replace(item, commands=delivered(EXACT, item.commands)) for item in own]
    found = recorded_information(record(own), EXACT.model, NAMES)
    wanted = recorded_information(record(given), IDEAL_SHIP.model, NAMES)
    for item, other in zip(found, wanted, strict=True):
        assert apart(item.X, other.X) < 1e-12
