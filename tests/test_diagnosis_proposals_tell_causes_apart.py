"""The manoeuvre proposed is the one where two explanations part, sailed on every heading, in the model's own inputs."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes import CAUSES, Situation, wind_can_be_told
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.discriminating_manoeuvre import (
    Proposal,
    _turning,
    _windows,
    mean_measured_wind,
    most_discriminating,
    standard_proposals,
)
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.errors import InputError
from expdesign.signals import Commands
from expdesign.workflows.commands.diagnose import as_inputs

STD = np.array([0.02, 0.02, 0.003, np.inf])


def case(ship: str, **options):
    record = hidden_record(ship, seed=5, batches=3, samples=150, **options)
    extended = extended_model(vessel_of(ship), record)
    return extended, cut_windows(extended.model, record)


def test_a_circle_is_sailed_through_all_headings():
    """The heading that current and wind act by is the simulated one within a degree."""
    ship, like = case("barge")
    circle = next(one for one in standard_proposals(like, ship.model.inputs, 1.0) if one.name == "turning_circle")
    wind = np.array([3.0, -4.0])
    windows = _turning(ship, _windows([circle], like, wind), [circle], wind)
    heading_change = windows.heading - windows.heading[:, :1]
    assert np.abs(heading_change).max() > 2 * np.pi
    np.testing.assert_allclose(np.hypot(*np.moveaxis(windows.wind, -1, 0)), 5.0)
    again = _turning(ship, windows, [circle], wind)
    assert np.abs(again.heading - windows.heading).max() < np.radians(1.0)


def test_the_wind_of_the_data_blows():
    _, like = case("tug", wind=(6.0, 4.0))
    np.testing.assert_allclose(
        mean_measured_wind(like), [6.0, 4.0], atol=1.0
    )  # gusts of 0.5 m/s for a minute, in 450 s


def test_a_current_and_a_misaligned_sensor_part_where_the_ship_turns():
    """On one straight course either is a constant sideways speed; in a circle the current comes from all sides."""
    ship, like = case("barge")
    current, bias = ship.with_effects({"current:east": 0.1}), ship.with_effects({"heading_bias": 0.05})
    pair = [
        Proposal(
            name=name,
            inputs=np.tile([12.0, 0.0, moment], (240, 1)),
            velocity=np.array([1.5, 0.0, 0.0]),
            sample_time_s=1.0,
        )
        for name, moment in (("straight", 0.0), ("turning_circle", 50.0))
    ]
    assert most_discriminating(current, [bias], pair, STD, like) == "turning_circle"
    assert most_discriminating(current, [current], pair, STD, like) is None


def test_commands_become_the_inputs_that_the_data_have():
    """Azimuths at 9 m fore and aft, by hand; commands of a ship whose rudder no force stands for are refused."""
    tug, barge, coaster = (vessel_of(name) for name in ("tug", "barge", "coaster"))
    values = np.array([[8.0, 0.0, 6.0, np.pi / 2]])
    commands = Commands(sample_time_s=1.0, names=("n1", "a1", "n2", "a2"), values=values)
    np.testing.assert_allclose(as_inputs(commands, tug, barge.model), [[8.0, 6.0, -54.0]], atol=1e-12)
    np.testing.assert_array_equal(as_inputs(commands, tug, tug.model), values)
    orders = Commands(sample_time_s=1.0, names=("n1", "rudder1"), values=np.ones((1, 2)))
    with pytest.raises(InputError, match="'coaster' takes n1, rudder1, the inputs in the data are tau_x"):
        as_inputs(orders, coaster, barge.model)


def test_without_thrust_a_wrong_thrust_is_not_seen():
    ship, like = case("barge")
    still = Proposal(name="drifting", inputs=np.zeros((60, 3)), velocity=np.zeros(3), sample_time_s=1.0)
    assert most_discriminating(ship, [ship.with_effects({"gain": 0.2})], [still], STD, like) is None


def test_a_wind_that_nobody_measured_is_tested_only_where_courses_differ():
    """On one course it is a constant force and moment, whatever its direction: many causes are that."""
    ship, like = case("barge")
    still = replace(like, has_wind=False)
    for turned_rad, told in ((0.7, False), (0.9, True)):
        heading = np.linspace(-turned_rad, turned_rad, like.heading.size).reshape(like.heading.shape) + np.pi
        windows = replace(still, heading=heading)
        assert wind_can_be_told(windows) == told
        candidates = [cause.candidates(Situation(ship=ship, windows=windows)) for cause in CAUSES]
        assert any(item.imitates for some in candidates for item in some) == told
