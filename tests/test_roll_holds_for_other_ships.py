"""Roll of a coaster that the project does not simulate: damping by the square, sensors out of place, waves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from expdesign.export.roll_page import RollContent, headline, parameter_rows, roll_sentences
from expdesign.roll import Body, RollEstimate, metacentric_height, null_space, stiffness
from expdesign.roll.model import parameters
from expdesign.roll.profile import _with_mass
from expdesign.roll.record import levelled
from expdesign.roll.runs import EFFECTS, LowPass
from plain_roller import GM_M, MASS_KG, SENSOR_HEIGHT_M, STEP_S, Sea, estimated, height_deviations, run

FEW_S = 600.0


@cache
def found(seed: int, sea: Sea) -> RollEstimate:
    return estimated(seed, sea)


def inside(one: RollEstimate, mass_kg: float) -> bool:
    assert one.load_interval is not None
    return one.load_interval[0] <= mass_kg <= one.load_interval[1]


@pytest.mark.thorough
def test_damping_by_the_square_is_estimated_and_costs_no_answer() -> None:
    sea = Sea(quadratic=0.5, run_s=FEW_S)
    one = found(0, sea)
    value, std = one.effects["quadratic"]
    assert one.trusted
    assert abs(value - sea.quadratic / 0.1) < 4 * std < sea.quadratic / 0.1
    assert inside(one, sea.load[0])


@pytest.mark.thorough
def test_a_rudder_set_by_the_clock_does_not_answer_roll() -> None:
    """A helm by the clock foresees itself, and what a model misses follows the rudder; neither is an answer."""
    assert not found(0, Sea(zigzag_s=12.0, quadratic=0.08, run_s=FEW_S)).answering


def test_chance_alone_takes_no_answer_from_a_calm_sea() -> None:
    """Where the rudder does nearly all, what would follow from an answer is small; one in 20 would be said."""
    one = replace(found(0, Sea(quadratic=0.5, run_s=FEW_S)), unanswered=0.02)
    assert one.strength > 10.0
    assert not one.answering
    assert replace(one, unanswered=0.0005).answering
    assert replace(one, strength=5.0).answering


@pytest.mark.thorough
def test_the_sensors_place_and_tilt_are_found() -> None:
    sea = Sea(quadratic=0.2, forward_m=2.0, tilt_deg=2.0)
    one = found(0, sea)
    for name, truth in {"forward": sea.forward_m, "tilt": np.radians(sea.tilt_deg)}.items():
        value, std = one.effects[name]
        assert abs(value - truth) < 4 * std
    assert one.trusted
    assert inside(one, sea.load[0])


def test_a_stated_place_and_tilt_are_those_of_a_level_sensor_at_midships() -> None:
    """Up to the noise, and to a derivative by differences."""
    body = Body(mass_kg=MASS_KG, z_g=0.0, z_s=-SENSOR_HEIGHT_M, forward_m=3.0, tilt_rad=np.radians(4.0))
    plain, moved = (run(4, (0.0, 0.0), Sea(run_s=60.0, forward_m=x, tilt_deg=t)) for x, t in ((0.0, 0.0), (3.0, 4.0)))
    corrected = levelled(moved, body, STEP_S)
    assert np.std(corrected - plain, axis=0)[:3] == pytest.approx([0.0, 0.0, 0.0], abs=0.03)
    assert np.std(corrected - plain, axis=0)[0] < 0.2 * np.std(moved - plain, axis=0)[0]


@pytest.mark.thorough
def test_a_tilt_that_nobody_measured_is_found_in_waves_or_takes_the_trust_in_what_it_moves() -> None:
    """In waves a level sensor fits nearly as well as a tilted one, with another added mass."""
    sea = Sea(roll_deg=1.0, forward_m=2.0, tilt_deg=2.0, run_s=FEW_S)
    one = found(0, sea)
    if "tilt" in one.effects:
        value, std = one.effects["tilt"]
        assert abs(value - np.radians(sea.tilt_deg)) < 4 * std
    else:
        assert one.by_tilt == ("d", "K_r", "K_vd", "K_delta") or not one.trusted


@pytest.mark.thorough
def test_a_load_is_positive_and_its_interval_longer_above_than_below_in_waves() -> None:
    """The moments tell mass times height and mass times its square: the smaller the height, the larger the mass."""
    sea = Sea(roll_deg=1.0, run_s=FEW_S)
    one = found(0, sea)
    assert one.load_interval is not None
    low, high = one.load_interval
    assert 0.0 <= low <= one.values["m"] <= high
    assert high - one.values["m"] > one.values["m"] - low


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [40001, 40005, 40012])
def test_the_profile_of_a_load_rises_as_slowly_as_the_data_say(seed: int) -> None:
    """A search for parameters beside another mass that begins with the height of this one ends beside the profile.

    Of these trials, whose loads are told by little, the interval began at 6.3 to 27.7 t, where 5 t were on board.
    """
    one = found(seed, Sea(roll_deg=1.0))
    assert one.trusted
    assert inside(one, Sea().load[0])


def test_a_load_of_another_mass_has_the_same_moment_about_the_axis() -> None:
    body, theta = Body(mass_kg=MASS_KG, z_g=0.4, z_s=-4.0), parameters(k=1e6, A_x=1e6, z_f=0.3, m=4000.0, z_m=-5.0)
    rights = [stiffness(_with_mass(theta, mass), body, None) for mass in (1000.0, 4000.0, 9000.0)]
    assert rights == pytest.approx([stiffness(theta, body, None)] * 3, rel=1e-12)


@pytest.mark.thorough
def test_weights_of_a_poor_fit_do_not_lead_the_search_away() -> None:
    """They followed the parameters while damping by the square was missing, and the search ended at no upright ship."""
    sea = Sea(zigzag_s=12.0, quadratic=0.08)
    one = found(40003, sea)
    assert one.trusted
    assert inside(one, sea.load[0])


@pytest.mark.thorough
def test_a_search_that_ends_at_bounds_says_so_and_gives_no_interval_of_the_load() -> None:
    """Rounding made the variance of a mass of nothing negative."""
    one = found(40004, Sea(roll_deg=1.0))
    assert (np.diag(one.covariance) >= 0).all()
    assert not one.trusted
    assert (one.load_interval is None) == ("m" in one.reached)


def test_metacentric_heights_are_within_what_is_stated() -> None:
    """Of each load case; their slopes are exact, as the height is linear in every parameter but the load's mass."""
    sea = Sea(quadratic=0.5, run_s=FEW_S)
    one = found(0, sea)
    assert max(abs(z) for z in height_deviations(one, sea)) < 4.0
    empty, std = metacentric_height(one, one.problem.cases[0].load)
    assert empty == pytest.approx(GM_M, abs=4 * std)
    assert std < 0.01


def test_nothing_to_be_trusted_is_said_first() -> None:
    one = replace(found(0, Sea(quadratic=0.5, run_s=FEW_S)), unanswered=0.0)
    blank = LowPass(taps=np.ones(1), every=1, roll_hz=0.1, passed=1.0, bandwidth_hz=5.0, step_s=STEP_S)
    content = RollContent(estimate=one, report=null_space(one), filter=blank, notes=(), command="")
    assert headline(content) == "the rudder seems to answer roll"
    assert next(roll_sentences(content)) == f"None of these estimates is to be trusted: {headline(content)}."
    assert all("none to be trusted" in row[3] for row in parameter_rows(content) if row[3] != "given")
    assert set(one.effects) <= set(EFFECTS)


def test_what_an_unknown_tilt_moves_is_not_trusted_and_the_rest_is() -> None:
    one = replace(found(0, Sea(quadratic=0.5, run_s=FEW_S)), tilt_told=False)
    blank = LowPass(taps=np.ones(1), every=1, roll_hz=0.1, passed=1.0, bandwidth_hz=5.0, step_s=STEP_S)
    content = RollContent(estimate=one, report=null_space(one), filter=blank, notes=(), command="")
    assert one.trusted
    texts = tuple(roll_sentences(content))
    moved = "d, K_r, K_vd, K_delta, damping by the square"
    assert any(text.startswith(f"{moved} are not to be trusted") for text in texts)
    assert not any("estimated beside d" in text for text in texts)
    assert [row[0] for row in parameter_rows(content) if "none to be trusted" in row[3]] == [
        "d",
        "K_r",
        "K_vd",
        "K_delta",
    ]
