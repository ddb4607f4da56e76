"""The verdict says what the simulation lacks, how much the error falls, and what would distinguish causes."""

import itertools
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import from_pose, hidden_record, vessel_of
from expdesign.diagnosis import CAUSES
from expdesign.diagnosis.accuracy import Accuracy
from expdesign.diagnosis.conclusions.findings import (
    error_reductions_of,
    note_beside_the_same_fit,
    note_on_predictions,
    note_on_random_current,
)
from expdesign.diagnosis.conclusions.verdict import MISSING_EFFECTS, as_sign, doubt, remarks, verdict
from expdesign.diagnosis.data.noise import Noise, white_noise
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.values import ErrorReduction, Estimate, Finding, Lead, Unexplained
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
REDUCTION_AHEAD = ErrorReduction(output="all", share=0.13, low=0.06, high=0.19)


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


NO_GAIN = {
    "error_reductions": tuple(ErrorReduction(output=name, share=0.2, low=-0.2, high=0.5) for name in OUTPUTS),
    "gain": 0.3, "gain_interval": (-0.5, 1.0),
}  # fmt: skip
"""What is not certain of simulations."""


def test_a_verdict_names_the_alternative_and_the_manoeuvre():
    assert verdict([finding("wind", alternatives=["current"], would_tell_apart="turning_circle")], BEFORE) == (
        "The simulation lacks wind or a current (these data cannot tell which). Adding it halves the sway error (42 to "
        "58 %) on runs held out of the fit. Sail a turning circle to tell wind from a current."
    )


def test_a_headline_gives_the_few_numbers_of_a_cause_and_what_the_file_says():
    drag = Estimate(name="X_abs_u_u", value=-0.049031, std=0.00057, unit="", stated=-0.03)
    one = replace(finding("parameters"), keys=("theta:X_abs_u_u",), estimates=(drag,))
    sizes = "-0.04903 \N{PLUS-MINUS SIGN} 0.00057, the file says -0.03"
    assert verdict([one], BEFORE).startswith(f"The simulation lacks the correct value of X_abs_u_u ({sizes}). ")
    flow = [Estimate(name=name, value=0.1, std=0.02, unit="m/s") for name in ("north_mps", "east_mps")]
    current = replace(finding("current"), estimates=tuple(flow))
    sizes = "0.100 \N{PLUS-MINUS SIGN} 0.020 m/s to north, 0.100 \N{PLUS-MINUS SIGN} 0.020 m/s to east"
    assert f"lacks a current ({sizes})" in verdict([current], BEFORE)
    assert "lacks a current." in verdict([replace(current, estimates=(*flow, drag))], BEFORE)  # the table has them all
    unknown = replace(current, estimates=(replace(drag, value=np.nan),))
    assert "lacks a current." in verdict([unknown], BEFORE)


def test_an_unfit_model_is_said_to_be_unfit_before_causes_are_named():
    """A cause beside which an output is still worse than a constant, or several wrong parameters; no large fault."""
    bad = replace(BEFORE, fit=np.array([30.0, -20.0, -5.0]))
    rest = Unexplained(outputs=OUTPUTS, fit=np.array([40.0, 10.0, 20.0]), force_share=np.zeros(3), leads=())
    lost = replace(rest, fit=np.array([40.0, -10.0, 20.0]))
    several = replace(finding("parameters"), keys=("theta:N_d", "theta:N_ur"))
    unfit = "The model is unfit for these runs, the fit is 30 % in surge, -20 % in sway and -5 % in yaw: "
    for found, before, left, first in (
        (finding("wind"), bad, lost, True), (several, bad, rest, True), (several, bad, None, True),
        (finding("wind"), bad, rest, False), (finding("wind"), bad, None, False),
        (finding("wind"), BEFORE, rest, False),
    ):  # fmt: skip
        assert verdict([found], before, unexplained=left).startswith(unfit) is first
    told = verdict([finding("wind")], bad, unexplained=lost)
    assert "The simulation lacks wind" in told
    assert "Use the extended vessel file" not in told


def test_every_cause_of_a_verdict_has_its_own_number():
    some = [
        finding("missing_term:Y_r"),
        finding("gyro_scale", error_reductions=((0.0, 0, 0), (0.0, 0, 0), (0.3, 0.25, 0.36))),
    ]
    assert verdict(some, BEFORE).startswith(
        "The simulation lacks the term Y_r and the scale of the rate gyro. On runs held out of the fit, adding "
        "the term Y_r halves the sway error (42 to 58 %) and adding the scale of the rate gyro cuts the yaw error by "
        "30 % (25 to 36 %). "
    )


def test_the_best_candidate_is_the_one_that_gains_most_wherever_it_was_found():
    """A sign of the search or the best of those compared by predictions; what gains nothing is none."""
    bad, lever = replace(BEFORE, fit=np.array([30.0, -10.0, 50.0])), Lead("lever_arm", 13.7, (-1.0, 18.0))
    lost = Unexplained(outputs=OUTPUTS, fit=bad.fit, force_share=np.zeros(3), leads=(Lead("wind", 4.9, (0.5, 8.9)),))
    for signs, best in (((lever,), "the distance of a sensor"), ((), "wind"), ((replace(lever, gain=-1.0),), "wind")):
        assert f"the best candidate is {best}" in verdict([], bad, unexplained=lost, signs=signs)


def test_a_gain_is_told_by_the_output_that_improves_most_of_those_that_surely_do():
    """Not by the surest one, which may gain little, nor by a larger gain that may be none."""
    shares = ((0.7, -0.1, 0.9), (0.4, 0.1, 0.6), (0.2, 0.18, 0.22))
    assert "cuts the sway error by 40 % (10 to 60 %)" in verdict([finding("current", error_reductions=shares)], BEFORE)
    little = ((0.7, 0.004, 0.9), (0.0, -0.1, 0.1), (0.0, -0.1, 0.1))  # which is not "from 0 %"
    assert "by 70 % (0.4 to 90 %)" in verdict([finding("current", error_reductions=little)], BEFORE)
    none = finding("current", error_reductions=((0.004, 0.001, 0.01),) * 3)
    assert "raises the mean fit by 1.0 points (0.5 to 1.5) on runs" in verdict([none], BEFORE)
    assert "reduces no error for certain" in verdict([replace(none, gain_interval=(-0.1, 1.5))], BEFORE)
    assert "reduces no error for certain" in verdict([replace(none, gain=0.04, gain_interval=(0.02, 0.06))], BEFORE)


def combinations():
    """Findings with all that may and may not be certain of them."""
    reductions = (finding("wind").error_reductions, NO_GAIN["error_reductions"])
    gains, ahead = ((1.0, (0.5, 1.5)), (0.3, (-0.5, 1.0))), (REDUCTION_AHEAD, None)
    for p_value, fall, (gain, interval), predicted in itertools.product((1e-6, 0.42), reductions, gains, ahead):
        yield replace(
            finding("load_change"), p_value=p_value, error_reductions=fall, gain=gain, gain_interval=interval,
            predicted=predicted,
        )  # fmt: skip


def certain_of(item):
    """Whether chance is excluded, and whether simulations of held-out data get better, by all intervals given."""
    by_output = any(one.low > 0.0 for one in item.error_reductions)
    return item.p_value < 0.05, by_output or item.gain_interval[0] > 0.0


CLAIMS = {
    (True, True): ("he simulation lacks ", ""),
    (True, False): ("he record shows ", "whether simulations get better with {} is not certain"),
    (False, True): ("imulations get better with ", "chance may explain that"),
    (False, False): ("he likeliest cause is ", "nothing is certain of {}"),
}
"""By what is certain: the beginning of a claim, and what is left open."""


@pytest.mark.parametrize("item", [*combinations()])
def test_no_two_sentences_of_a_verdict_contradict_each_other_whatever_is_certain(item):
    """Chance is excluded or not; simulations of an output, of all or of none get better; predictions do or do not."""
    certain, better = certain_of(item)
    begin, open_still = CLAIMS[certain, better]
    inertia = "the correct inertia" if certain and better else "an inertia unlike the file's"
    if better:
        gained = "sway error" if item.error_reductions[1].low > 0.0 else "raises the mean fit"
    else:
        gained = "predictions from sample to sample" if item.predicted else "reduces no error for certain"
    assert doubt(item).rstrip(".").lower() == open_still.format("it")
    for other in (None, *combinations()):
        both = [item] if other is None else [item, replace(other, cause="wind")]
        what, sure, todo = verdict(both, BEFORE).split(". ")
        alike = other is not None and certain_of(other) == (certain, better)
        assert f"{begin}{inertia}{' and wind' if alike else ''}" in what
        assert open_still.format("them" if alike else "it") in what
        assert gained in sure.split(" and adding wind ")[0]
        assert ("lacks" in what) is any(certain_of(one) == (True, True) for one in both)
        assert ("correct" in what + sure) is (certain and better)
        nothing = not any(sum(map(certain_of, both), ()))
        assert todo.startswith("Keep the vessel file" if nothing else "Use the extended vessel file")


def test_what_shows_in_predictions_alone_is_in_the_record_and_not_lacking_in_simulations():
    """Beside what simulations show, too, and several with one verb."""
    delay, gyro = (
        replace(finding(cause), **NO_GAIN, predicted=REDUCTION_AHEAD) for cause in ("actuator_delay", "gyro_scale")
    )
    late, scale = "the dead time of the actuators", "the scale of the rate gyro"
    assert verdict([delay], BEFORE) == (
        f"The record shows {late}, but whether simulations get better with it is not certain. Adding it takes 13 % (6 "
        "to 19 %) off the squared error of predictions from sample to sample on runs held out of the fit. Use the "
        "extended vessel file, after a look at runs that it has not seen."
    )
    open_still = "but whether simulations get better with it is not certain"
    assert verdict([finding("wind"), delay], BEFORE).startswith(
        f"The simulation lacks wind; the record shows {late}, {open_still}. "
    )
    assert f"{late} and {scale}, but whether simulations get better with them" in verdict([delay, gyro], BEFORE)


@pytest.mark.parametrize("name", MISSING_EFFECTS)
def test_only_what_the_simulation_lacks_for_certain_is_called_correct(name):
    """Not what a record shows in predictions alone, a candidate, what was refused, or other answers to these."""
    shown = replace(finding(name), **NO_GAIN, predicted=REDUCTION_AHEAD)
    others = replace(finding("roll_coupling", alternatives=[name]), **NO_GAIN, predicted=REDUCTION_AHEAD)
    lead = Lead(name, 0.5, (-0.6, 1.2))
    told = [verdict([shown], BEFORE), verdict([shown, others], BEFORE), verdict([], BEFORE, signs=(lead,))]
    told += remarks("runs", None, (lead,), (name,), ())
    assert not [text for text in told if "correct " in text.replace("Correct the instruments", "")]
    assert all(as_sign(MISSING_EFFECTS[name]) in text for text in told)
    assert f"lacks {MISSING_EFFECTS[name]}." in verdict([finding(name)], BEFORE)


@pytest.mark.parametrize("name", MISSING_EFFECTS)
@pytest.mark.parametrize("beside_stated", [True, False])
def test_notes_which_do_not_know_what_is_certain_call_nothing_correct(name, beside_stated):
    chosen = SimpleNamespace(candidate=SimpleNamespace(cause=name), parameters=())
    kept = SimpleNamespace(steps=(SimpleNamespace(chosen=chosen),), beside_stated=beside_stated)
    held = HeldOut(squared_error=np.ones((3, 2)), squared_deviation=2 * np.ones((3, 2)))
    told = [*note_beside_the_same_fit(kept), *note_on_predictions(held, held, kept, kept.steps, 0)]
    assert as_sign(MISSING_EFFECTS[name]) in told[0]
    assert not [text for text in told if "the correct" in text]


def test_values_that_a_record_shows_are_those_that_the_file_does_not_have():
    """Of the file's own the numbers are not; every one of several has its name."""
    u, r = (Estimate(name=name, value=-0.5, std=0.01, unit="", stated=-0.3) for name in ("X_u", "N_r"))
    one = replace(finding("parameters"), **NO_GAIN, keys=("theta:X_u",), estimates=(u,))
    size = "-0.500 \N{PLUS-MINUS SIGN} 0.010, the file says -0.3"
    assert verdict([one], BEFORE).startswith(f"The record shows a value of X_u unlike the file's ({size}), but whether")
    two = replace(finding("parameters"), keys=("theta:X_u", "theta:N_r"), estimates=(u, r))
    assert f"lacks the correct values of X_u and N_r (X_u {size}; N_r {size}). Adding them" in verdict([two], BEFORE)
    inertia = replace(finding("load_change"), **NO_GAIN)
    assert verdict([inertia], BEFORE).startswith("The record shows an inertia unlike the file's, but whether")


def test_a_verdict_without_findings_states_the_accuracy():
    assert verdict([], BEFORE).startswith("These data show no error of the model. The fit is 60 % in surge")
    delay, wind = Lead("actuator_delay", 0.5, (-0.6, 1.2)), Lead("wind", -2.0, (-3.0, 0.0))
    text = verdict([], BEFORE, signs=(delay, wind))
    assert text.startswith("No cause of the remaining error is certain. The fit is 60 % in surge")
    assert "the dead time of the actuators (+0.5 points of fit, -0.6 to 1.2) improves nothing for certain" in text
    assert remarks("runs", None, (delay, wind), (), ()) == (
        "Not certain, by their gains on data held out: the dead time of the actuators (+0.5 points of fit, -0.6 to "
        "1.2) on runs.",
    )
    lost = Accuracy(**{**vars(BEFORE), "fit": np.array([-66608676.0, 50.0, 10.0])})
    assert "diverges from the ship" in verdict([], lost)
    assert "66608676" not in verdict([], lost)


def test_an_offset_of_angles_is_named_after_them_and_not_after_thrust():
    offset = replace(finding("thruster_asymmetry"), keys=("offset:rudder",))
    assert verdict([offset], BEFORE).startswith("The simulation lacks the offset of the rudder angle. Adding it")
    assert "lacks an asymmetry of thrust." in verdict([replace(offset, keys=("asymmetry",))], BEFORE)


def test_equivalent_answers_of_one_cause_are_both_named():
    """A rudder offset and a steady yaw moment of thrust are answers of their own, whatever the catalogue calls them."""
    offset = replace(
        finding("thruster_asymmetry"), keys=("offset:rudder",), not_distinguishable_from=("thruster_asymmetry",),
        alternatives=("an asymmetry of thrust",),
    )  # fmt: skip
    assert verdict([offset], BEFORE).startswith(
        "The simulation lacks the offset of the rudder angle or an asymmetry of thrust (these data cannot tell which)."
    )


def test_what_parameters_gain_within_their_standard_deviations_is_no_missing_effect():
    gains = (ErrorReduction(output="u", share=0.62, low=0.55, high=0.7),)
    gains += (ErrorReduction(output="v", share=0.9, low=-0.1, high=0.95),)
    assert verdict([], BEFORE, within_std=gains) == (
        "These data show no error of the model beyond the stated standard deviations of its parameters. Re-estimated "
        "within these, the parameters cut the surge error by 62 % (55 to 70 %) on runs held out. Use the extended "
        "vessel file, which has them."
    )


REMAINS = Unexplained(
    outputs=OUTPUTS, fit=np.array([29.0, np.nan, -400.0]), force_share=np.array([0.4, np.nan, 0.1]),
    leads=(Lead("wind", 3.2, (-1.0, 6.0)),),
)  # fmt: skip


@pytest.mark.parametrize("faults", [(), ("the gyro shows 95 % of the rate of the heading",)])
@pytest.mark.parametrize("remains", [None, REMAINS])
def test_every_verdict_is_a_sentence_of_what_one_of_how_sure_and_one_of_what_to_do(remains, faults):
    """Whatever the cause is, alone or not, and whatever else is known; all of its numbers are numbers."""
    open_questions = (((), None), (("current", "wind"), None), (("wind",), "zigzag"))
    some = [
        [finding(name, alternatives=others, would_tell_apart=told)]
        for name in MISSING_EFFECTS
        for others, told in open_questions
    ]
    some += [[finding("wind"), finding("current")], []]
    lead = Lead("wind", float("nan"), (float("nan"),) * 2)
    empty = replace(BEFORE, fit=np.array([60.0, np.nan, 90.0]))
    cases = [(found, {}) for found in some]
    cases += [([], {"kinds": ("a steady force",)}), ([], {"signs": (Lead("wind", 1.0, (-1.0, 2.0)),)})]
    for found, more in cases:
        text = verdict(found, empty, unexplained=remains, faults=faults, **more)
        cleared = not (found or more or remains)  # of which a doubtful record leaves the accuracy alone
        assert text.count(". ") == (1 if faults and cleared else 2), text
        assert text.endswith(".")
        assert "nan" not in text
        assert text.startswith("Look at the record first") is bool(faults)
        shown = verdict(found, empty, unexplained=remains, faults=faults, confirmed=("The watch was right",), **more)
        assert shown == f"The watch was right. {text.replace('show no error', 'show no other error')}"
    for said in remarks("runs", remains, (lead,), ("wind",), ("a steady force",)):
        assert "nan" not in said


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
    assert vessel.sensors.position_delay_s == max(delay_s, 0.0)
    assert any("below zero" in text for text in missing) == left_out
    (cause,) = (cause for cause in CAUSES if cause.name == "sensor_delay")
    assert f"2.000 ± 0.050 s {word}" in cause.explain({"late:position": (delay_s, 0.05)}, ship)


def test_a_large_varying_current_is_noted():
    assert note_on_random_current(varying(0.03, 300.0)) == ()
    (text,) = note_on_random_current(varying(0.25, 400.0))
    assert "0.25 m/s" in text
    assert "400 s" in text


def test_causes_that_would_harm_the_simulation_are_said_in_one_sentence():
    (said,) = remarks("runs", None, (), ("wind",), ())
    assert said == "With wind the simulation of these data would diverge or be worse, so it is not written."


def test_what_is_left_beside_findings_is_said():
    (said,) = remarks("runs", None, (), (), (), ("a lag of rudder that changes with speed (-1.2 s)",))
    assert "left beside the findings looks like a lag of rudder that changes with speed (-1.2 s)" in said


@pytest.mark.parametrize("fault", ["the gyro is late.", "is the rudder positive to port?", "read every 5 s"])
def test_a_fault_of_the_record_comes_first_and_then_no_model_is_called_free_of_error(fault):
    mark = "[?]" if fault.endswith("?") else "[.]"
    for within in ((), (ErrorReduction(output="r", share=0.3, low=0.2, high=0.4),)):
        said = verdict([], BEFORE, within_std=within, faults=[fault, "another"])
        assert re.match(rf"Look at the record first: [^.?]+{mark} The fit is ", said)
        assert "no error" not in said
    assert re.match(
        rf".* first: [^.?]+{mark} The simulation lacks a current[.] ",
        verdict([finding("current")], BEFORE, faults=[fault]),
    )


@pytest.mark.parametrize("cause", ["gyro_scale", "heading_bias", "lever_arm", "log_scale", "sensor_delay", "wind"])
def test_instruments_are_to_be_corrected_and_nothing_else(cause):
    said = verdict([finding(cause)], BEFORE)
    assert ("Correct the instruments" in said) is (cause != "wind")
