"""The verdict says what the simulation lacks, how much the error falls, and what would distinguish causes."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import from_pose, hidden_record, vessel_of
from expdesign.diagnosis import CAUSES
from expdesign.diagnosis.accuracy.simulated_fit import Accuracy
from expdesign.diagnosis.conclusions.findings import error_reductions_of
from expdesign.diagnosis.conclusions.notes import note_on_random_current
from expdesign.diagnosis.conclusions.verdict import MISSING_EFFECTS, doubted, verdict
from expdesign.diagnosis.data.noise import Noise, white_noise
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.values import ErrorReduction, Finding, Lead
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.progress import never_falling
from expdesign.signals import Record

OUTPUTS = ("u", "v", "r")
BEFORE = Accuracy(
    outputs=OUTPUTS, fit=np.array([60.0, 55.0, 90.0]), rmse=np.ones(3), bias=np.zeros(3), horizons_s=np.zeros(0),
    growth=np.zeros((0, 3)), per_batch=np.zeros((1, 3)),
)  # fmt: skip


REDUCTIONS = ((0.1, 0.0, 0.2), (0.5, 0.42, 0.58), (0.0, -0.1, 0.1))


def varying(std_mps: float, time_s: float) -> Noise:
    return replace(white_noise(np.ones(4)), current_std_mps=std_mps, current_time_s=time_s)


def finding(cause: str, error_reductions=REDUCTIONS, alternatives=(), would_tell_apart=None):
    rows = zip(OUTPUTS, error_reductions, strict=True)
    return Finding(
        cause=cause, estimates=(), p_value=1e-6, fit_before=np.zeros(3), fit_after=np.ones(3),
        error_reductions=tuple(ErrorReduction(output=n, share=s, low=a, high=b) for n, (s, a, b) in rows),
        gain=1.0, gain_interval=(0.5, 1.5), not_distinguishable_from=tuple(alternatives),
        would_tell_apart=would_tell_apart, explanation="", likelihood_gain=30.0, keys=(),
    )  # fmt: skip


def test_a_verdict_names_the_alternative_and_the_manoeuvre():
    assert verdict([finding("wind", alternatives=["current"], would_tell_apart="turning_circle")], BEFORE) == (
        "The simulation lacks wind; adding it halves the sway error (42 to 58 %) on runs held out of the fit; a "
        "turning circle would distinguish wind from a current, which explains these data as well."
    )


def test_every_cause_of_a_verdict_has_its_own_number():
    some = [
        finding("missing_term:Y_r"),
        finding("gyro_scale", error_reductions=((0.0, 0, 0), (0.0, 0, 0), (0.3, 0.25, 0.36))),
    ]
    assert verdict(some, BEFORE) == (
        "The simulation lacks the term Y_r and the scale of the rate gyro; on runs held out of the fit, adding "
        "the term Y_r halves the sway error (42 to 58 %) and the scale of the rate gyro cuts the yaw error by 30 % "
        "(25 to 36 %)."
    )


@pytest.mark.parametrize("share", [0.004, 0.0, -0.02])
def test_an_invisible_improvement_is_given_no_number(share):
    text = verdict([finding("current", error_reductions=((share, -0.1, 0.1),) * 3)], BEFORE)
    assert (
        "adding it reduces no error by 1 % or more on runs held out of the fit; it is significant in a test, but"
        in text
    )


def test_a_verdict_without_findings_states_the_accuracy():
    assert verdict([], BEFORE).startswith("These data show no error of the model: the fit is 60 % in surge")
    delay, wind = Lead("actuator_delay", 0.5, (-0.6, 1.2)), Lead("wind", -2.0, (-3.0, 0.0))
    assert verdict([], BEFORE, signs=(delay, wind)).endswith(
        ". Signs of the dead time of the actuators (+0.5 points of fit, -0.6 to 1.2) and wind (-2.0 points of fit, "
        "-3.0 to 0.0) improve nothing for certain on runs held out."
    )
    assert verdict([], BEFORE, signs=(wind,)).startswith("No cause of the remaining error is certain: the fit is 60 %")
    lost = Accuracy(**{**vars(BEFORE), "fit": np.array([-66608676.0, 50.0, 10.0])})
    assert "diverges from the ship" in verdict([], lost)
    assert "66608676" not in verdict([], lost)


def test_an_offset_of_angles_is_named_after_them_and_not_after_thrust():
    offset = replace(finding("thruster_asymmetry"), keys=("offset:rudder",))
    assert verdict([offset], BEFORE).startswith("The simulation lacks the offset of the rudder angle; adding it")
    assert "lacks an asymmetry of thrust;" in verdict([replace(offset, keys=("asymmetry",))], BEFORE)


def test_what_parameters_gain_within_their_standard_deviations_is_no_missing_effect():
    gains = (ErrorReduction(output="u", share=0.62, low=0.55, high=0.7),)
    gains += (ErrorReduction(output="v", share=0.9, low=0.1, high=0.95),)
    assert verdict([], BEFORE, within_std=gains) == (
        "Parameters re-estimated within their stated standard deviations cut the surge error by 62 % (55 to 70 %) on "
        "runs held out. No other cause is certain."
    )


def test_every_cause_of_the_catalogue_has_words():
    assert {cause.name for cause in CAUSES} - {"missing_term"} == set(MISSING_EFFECTS)


def test_error_reductions_are_of_root_mean_squares():
    before = HeldOut(squared_error=np.array([[4.0, 1.0], [12.0, 1.0]]), squared_deviation=np.ones((2, 2)))
    after = HeldOut(squared_error=np.array([[1.0, 1.0], [3.0, 1.0]]), squared_deviation=np.ones((2, 2)))
    error_reductions = error_reductions_of(("u", "v"), before, after, 0)
    assert [fall.share for fall in error_reductions] == pytest.approx([0.5, 0.0])
    assert [(fall.low, fall.high) for fall in error_reductions] == [
        pytest.approx((0.5, 0.5)),
        pytest.approx((0.0, 0.0)),
    ]


def test_progress_never_goes_back():
    """A round may repeat work; its progress then starts below the last one."""
    shares: list[float] = []
    tell = never_falling(lambda what, share: shares.append(share))
    for share in (0.1, 0.46, 0.43, 0.5):
        tell("testing", share)
    assert shares == [0.1, 0.46, 0.46, 0.5]


@pytest.mark.parametrize(("delay_s", "word", "left_out"), [(2.0, "late", False), (-2.0, "early", True)])
def test_a_signal_before_its_time_is_called_early_and_the_file_says_that_it_lacks_it(delay_s, word, left_out):
    """A vessel file knows sensors that are late; a position before its time means that the heading is late, say."""
    record = hidden_record("barge", seed=1, batches=1, samples=120)
    ship = extended_model(vessel_of("barge"), Record(batches=tuple(from_pose(batch) for batch in record.batches)))
    vessel, missing = extend(vessel_of("barge"), ship.with_effects({"late:position": delay_s}), {})
    assert vessel.sensors.position.delay_s == max(delay_s, 0.0)
    assert any("below zero" in text for text in missing) == left_out
    (cause,) = (cause for cause in CAUSES if cause.name == "sensor_delay")
    assert f"2.000 ± 0.050 s {word}" in cause.explain({"late:position": (delay_s, 0.05)}, ship)


def test_a_large_varying_current_is_noted():
    assert note_on_random_current(varying(0.03, 300.0)) == ()
    (text,) = note_on_random_current(varying(0.25, 400.0))
    assert "0.25 m/s" in text
    assert "400 s" in text


def test_causes_that_would_harm_the_simulation_are_said_in_one_sentence():
    """Beside findings, and where nothing is found: then the model is not called right."""
    said = "With wind the simulation of these data would diverge or be worse, so it is not written"
    text = verdict([], BEFORE, refused=["wind"])
    assert text.startswith("No cause of the remaining error is certain: the fit is 60 %")
    assert text.endswith(f"{said}.")
    assert said in verdict([finding("current")], BEFORE, refused=["wind"])


@pytest.mark.parametrize("fault", ["the gyro is late.", "is the rudder positive to port?", "read every 5 s"])
def test_a_fault_of_the_record_is_one_sentence_before_the_verdict(fault):
    said = doubted([fault, "another"])
    assert re.fullmatch(r"Look at the record first: [^.?]+[.?] ", said)
    assert said.endswith("? ") == fault.endswith("?")
    assert doubted([]) == ""
