"""The desired motion of a family is compared with the motion of the ship; new families follow their settings."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import SCENARIOS, WIND, example_dictionary, spec, vessel, with_limit
from expdesign.dictionary import build_dictionary, build_primitive, family
from expdesign.dictionary.build import REPORTED_DEVIATION, desired_motion, deviating, deviation
from expdesign.growing.loop import optimum
from expdesign.information import score_primitives
from expdesign.scenario import load_dictionary
from expdesign.vessel import Limit

TIME_S = np.linspace(0.0, 60.0, 6001)
MULTISINE = {"period_s": 20.0, "speed_mps": 1.0, "speed_swing_mps": 0.5, "sway_mps": 0.2, "yaw_rate_radps": 0.1}


def test_a_multisine_has_its_amplitudes_around_its_mean():
    desired = family("multisine").reference(spec("multisine", duration_s=60.0, **MULTISINE).settings, TIME_S)
    np.testing.assert_allclose(np.abs(desired - (1.0, 0.0, 0.0)).max(axis=0), (0.5, 0.2, 0.1), rtol=1e-12)
    np.testing.assert_allclose(desired[0], (1.0, 0.0, 0.0), atol=1e-12)


def test_the_three_velocities_of_a_multisine_share_no_frequency():
    desired = family("multisine").reference(spec("multisine", duration_s=60.0, **MULTISINE).settings, TIME_S)
    middle = desired[2000:4000] - desired[2000:4000].mean(axis=0)  # one whole period, outside the fades
    products = np.corrcoef(middle.T)
    np.testing.assert_allclose(products, np.eye(3), atol=1e-2)


def test_a_sway_step_goes_and_comes_back():
    settings = spec("sway_step", duration_s=60.0, sway_mps=0.3, rise_s=5.0, speed_mps=0.7, held_fraction=0.5).settings
    u, v, r = family("sway_step").reference(settings, TIME_S).T
    assert (u == 0.7).all()
    assert not r.any()
    np.testing.assert_allclose(v[(TIME_S >= 5) & (TIME_S <= 30)], 0.3, rtol=1e-12)
    np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "more"), [("zigzag", {"period_s": 20.0}), ("telegraph", {"hold_s": 8.0, "rise_s": 2.0})]
)
def test_offsets_lie_beneath_the_wave_and_begin_and_end_at_zero(name: str, more: dict):
    given = {"duration_s": 60.0, "speed_mps": 1.0, "sway_mps": 0.1, "yaw_rate_radps": 0.1, **more}
    given |= {"speed_swing_mps": 0.0} if name == "telegraph" else {}
    plain, lifted = (
        family(name).reference(spec(name, **given, **offsets).settings, TIME_S)
        for offsets in ({}, {"sway_offset_mps": 0.3, "yaw_offset_radps": -0.2})
    )
    inside = (TIME_S > 6) & (TIME_S < 54)
    np.testing.assert_allclose((lifted - plain)[inside], np.tile((0.0, 0.3, -0.2), (inside.sum(), 1)), atol=1e-12)
    np.testing.assert_allclose((lifted - plain)[[0, -1]], 0.0, atol=1e-12)


def test_a_ship_with_slow_actuators_deviates_and_a_ship_without_limits_does_not():
    request = spec("sway_zigzag", duration_s=60, sway_mps=0.3, period_s=30)
    free, slow = (
        build_primitive(with_limit(vessel("azimuth-30m"), Limit(low=-40, high=40), rate), request)
        for rate in (1e6, 0.5)
    )
    assert deviation(free) < 0.05
    assert deviation(slow) > REPORTED_DEVIATION
    assert deviating([free, slow]) == (slow,)


def test_departure_is_the_largest_difference_by_hand():
    run = build_primitive(vessel("model-ship"), spec("acceleration", duration_s=20, speed_mps=0.8))
    moved = np.add(run.trajectory.velocity, (0.04, -0.02, 0.0))
    changed = replace(run, trajectory=replace(run.trajectory, velocity=moved))
    desired = desired_motion(run)
    assert desired is not None
    assert deviation(changed) == pytest.approx(np.abs(moved - desired)[:, 0].max() / 0.8, rel=1e-12)


def test_families_that_give_commands_have_no_desired_velocities():
    run = build_primitive(vessel("model-ship"), spec("turning_circle_helm", duration_s=20, speed_mps=0.8))
    assert desired_motion(run) is None
    assert deviation(run) == 0.0


def test_only_steep_waves_deviate_with_slow_thrusters():
    assert not deviating(example_dictionary("model-ship"))
    names = {item.name for item in deviating(example_dictionary("standard"))}
    waves = ("zigzag-steep", "sway-zigzag", "telegraph")
    assert {"zigzag-steep-speed-0.5", "sway-zigzag-speed-0"} <= names
    assert all(name.startswith(waves) for name in names)


def test_the_compact_dictionary_follows_its_references_in_little_room_with_twice_the_information_per_minute():
    ship = vessel("azimuth-30m")
    runs = build_dictionary(ship, load_dictionary(SCENARIOS / "dictionaries" / "compact-azimuth-30m.toml"))
    assert not deviating(runs)
    compact, standard = (
        optimum(score_primitives(ship, items, environment=WIND), "complete").log_det
        for items in (runs, example_dictionary("standard"))
    )
    assert np.exp((compact - standard) / len(ship.model.names)) > 2
