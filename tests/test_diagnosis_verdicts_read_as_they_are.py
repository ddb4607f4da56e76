"""The one sentence of a diagnosis says what is lacking, by how much which error falls, and what would tell."""

import numpy as np
import pytest

from diagnosis_case import from_pose, hidden_record, vessel_of
from expdesign.diagnosis import CAUSES
from expdesign.diagnosis.extension import as_extended, extend
from expdesign.diagnosis.fit.cross_validation import HeldOut
from expdesign.diagnosis.notes import note_on_weather
from expdesign.diagnosis.select.forward_search import _onward
from expdesign.diagnosis.values import Accuracy, Fall, Finding
from expdesign.diagnosis.verdict import LACKS, error_falls, verdict
from expdesign.signals import Record

OUTPUTS = ("u", "v", "r")
BEFORE = Accuracy(
    outputs=OUTPUTS, fit=np.array([60.0, 55.0, 90.0]), rmse=np.ones(3), bias=np.zeros(3), horizons_s=np.zeros(0),
    growth=np.zeros((0, 3)), per_batch=np.zeros((1, 3)),
)  # fmt: skip


def finding(cause: str, falls=((0.1, 0.0, 0.2), (0.5, 0.42, 0.58), (0.0, -0.1, 0.1)), rivals=(), telling=None):
    return Finding(
        cause=cause, estimates=(), p_value=1e-6, fit_before=np.zeros(3), fit_after=np.ones(3),
        falls=tuple(Fall(output=n, share=s, low=a, high=b) for n, (s, a, b) in zip(OUTPUTS, falls, strict=True)),
        gain=1.0, gain_interval=(0.5, 1.5), not_distinguishable_from=tuple(rivals), would_tell_apart=telling,
        explanation="", worth=30.0, keys=(),
    )  # fmt: skip


def test_a_cause_with_a_rival_is_told_whole():
    assert verdict([finding("wind", rivals=["current"], telling="turning_circle")], BEFORE) == (
        "The simulation lacks wind; adding it halves the sway error (42 to 58 %) on runs it has not seen; a turning "
        "circle would tell wind from a current, which explains this data as well."
    )


def test_several_causes_each_have_their_own_number():
    some = [finding("missing_term:Y_r"), finding("gyro_scale", falls=((0.0, 0, 0), (0.0, 0, 0), (0.3, 0.25, 0.36)))]
    assert verdict(some, BEFORE) == (
        "The simulation lacks the term Y_r and the scale of the rate gyro; on runs it has not seen, adding the term "
        "Y_r halves the sway error (42 to 58 %) and the scale of the rate gyro cuts the yaw error by 30 % (25 to 36 %)."
    )


@pytest.mark.parametrize("share", [0.004, 0.0, -0.02])
def test_what_no_picture_shows_is_not_given_a_number(share):
    text = verdict([finding("current", falls=((share, -0.1, 0.1),) * 3)], BEFORE)
    assert "adding it takes less than 1 % off any error on runs it has not seen; it shows in a test, not yet" in text


def test_nothing_found_says_how_good_it_is_and_a_lost_one_that_it_is_lost():
    assert verdict([], BEFORE).startswith("Nothing is wrong that this data can show: it accounts for 60 % of surge")
    lost = Accuracy(**{**vars(BEFORE), "fit": np.array([-66608676.0, 50.0, 10.0])})
    assert "parts from the ship altogether" in verdict([], lost)
    assert "66608676" not in verdict([], lost)


def test_every_cause_of_the_catalogue_has_words():
    assert {cause.name for cause in CAUSES} - {"missing_term"} == set(LACKS)


def test_the_fall_of_an_error_is_that_of_its_root_mean_square():
    before = HeldOut(lost=np.array([[4.0, 1.0], [12.0, 1.0]]), spread=np.ones((2, 2)))
    after = HeldOut(lost=np.array([[1.0, 1.0], [3.0, 1.0]]), spread=np.ones((2, 2)))
    falls = error_falls(("u", "v"), before, after, 0)
    assert [fall.share for fall in falls] == pytest.approx([0.5, 0.0])
    assert [(fall.low, fall.high) for fall in falls] == [pytest.approx((0.5, 0.5)), pytest.approx((0.0, 0.0))]


def test_progress_never_goes_back():
    """A round that looks at something again begins at its own share."""
    shares: list[float] = []
    tell = _onward(lambda what, share: shares.append(share))
    for share in (0.1, 0.46, 0.43, 0.5):
        tell("testing", share)
    assert shares == [0.1, 0.46, 0.46, 0.5]


@pytest.mark.parametrize(("delay_s", "word", "left_out"), [(2.0, "late", False), (-2.0, "early", True)])
def test_a_signal_before_its_time_is_called_early_and_the_file_says_that_it_lacks_it(delay_s, word, left_out):
    """A vessel file knows sensors that are late; a position before its time means that the heading is late, say."""
    record = hidden_record("barge", seed=1, batches=1, samples=120)
    ship = as_extended(vessel_of("barge"), Record(batches=tuple(from_pose(batch) for batch in record.batches)))
    vessel, missing = extend(vessel_of("barge"), ship.having({"late:position": delay_s}), {})
    assert vessel.sensors.position.delay_s == max(delay_s, 0.0)
    assert any("below zero" in text for text in missing) == left_out
    (cause,) = (cause for cause in CAUSES if cause.name == "sensor_delay")
    assert f"2.000 ± 0.050 s {word}" in cause.explain({"late:position": (delay_s, 0.05)}, ship)


def test_a_current_that_varies_much_is_told():
    assert note_on_weather(0.03, 300.0) == ()
    (text,) = note_on_weather(0.25, 400.0)
    assert "0.25 m/s" in text
    assert "400 s" in text
