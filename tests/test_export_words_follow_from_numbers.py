"""Sentences with numbers: what is larger looks larger, all is all, counts count, and time runs forward."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from expdesign.conventions import plus_minus
from expdesign.export import words
from expdesign.export.files import Known
from expdesign.export.report.design import known_sentences
from expdesign.export.whatif_content import Case, WhatIfContent, explanations
from expdesign.export.words import MINUS, NB
from expdesign.monitoring import Change
from expdesign.sea_area import LocalFrame
from expdesign.simulation import CALM

sizes = st.floats(1e-6, 1e6)
numbers = st.floats(-1e6, 1e6)


def read(text: str) -> float:
    return float(text.replace(MINUS, "-"))


@given(numbers, numbers)
def test_of_two_numbers_that_are_compared_the_larger_looks_larger(one: float, other: float) -> None:
    assume(abs(one - other) > 1e-9)
    texts = words.told_apart(one, other)
    assert (read(texts[0]) > read(texts[1])) == (one > other)


@given(st.floats(0.0, 2.0))
def test_a_share_is_all_or_nothing_only_where_it_is(share: float) -> None:
    text = words.percent(share).removesuffix(f"{NB}%")
    assert (text == "100") <= (share >= 1.0)
    assert (text == "0") == (share == 0.0)
    assert abs(read(text) - 100 * share) <= max(0.1, 0.5 * 100 * share) + 0.5 * (share > 1.0)


@given(st.floats(0.0, 1e6))
def test_a_time_below_zero_is_the_time_with_a_minus_sign(seconds: float) -> None:
    assume(seconds > 0)
    assert words.duration(-seconds) == f"{MINUS}{words.duration(seconds)}"
    assert words.duration(math.nan) == words.duration(math.inf) == "unknown"


@given(st.integers(0, 1000))
def test_counts_and_times_are_in_the_right_number(count: int) -> None:
    assert words.counted(count, "run") == (f"{count} run" if count == 1 else f"{count} runs")
    assert words.times(count) == {1: "once", 2: "twice"}.get(count, f"{count} times")


def test_times_are_counted_with_their_fractions():
    assert [words.counted(days, "day") for days in (0.5, 1.0, 30.0)] == ["0.5 days", "1 day", "30 days"]


@given(st.floats(1e6, 4e9), st.booleans())
def test_times_since_1970_are_dates_and_others_those_of_a_clock(time_s: float, late: bool) -> None:
    time_s = time_s if late else time_s / 1e3
    told = words.when(time_s)
    assert bool(re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC", told)) == (time_s >= words.SINCE_1970_S)
    if time_s < words.SINCE_1970_S:
        hours, minutes, seconds = map(int, told.split(":"))
        assert abs(3600 * hours + 60 * minutes + seconds - time_s) <= 0.5


@given(numbers, numbers)
def test_a_place_has_a_side_and_no_sign(north: float, east: float) -> None:
    told = words.place(np.array([north, east, 0.0]))
    assert "-" not in told
    assert MINUS not in told
    assert ("north" in told, "east" in told) == (north >= 0, east >= 0)


def case(name: str, *, day_s: float, variance: float) -> Case:
    return Case(
        name=name, criterion="D", runs={"circle": 1}, informative_s=100.0, efficiencies={},
        parameters=("X_u", "Y_v"), covariance=variance * np.eye(2), plan={"day_s": day_s},
    )  # fmt: skip


@given(st.floats(60.0, 1e5), st.floats(60.0, 1e5), st.floats(1e-8, 1e8))
def test_a_variant_is_longer_shorter_or_as_long_and_no_ratio_is_zero(one: float, other: float, ratio: float) -> None:
    cases = (case("first", day_s=one, variance=1.0), case("other", day_s=other, variance=ratio))
    ((_, sentences),) = explanations(WhatIfContent(cases=cases, planned=True))
    told = " ".join(sentences)
    assert ("as long as the scenario's" in told) == (abs(one - other) < 3.0)
    assert not re.search(r"\b0\.0+ (min|times)\b", told)
    assert ("min more" in told) <= (other > one)
    assert ("min less" in told) <= (other < one)


@given(st.lists(sizes, min_size=2, max_size=2), st.lists(sizes, min_size=2, max_size=2))
def test_what_the_rest_of_a_trial_adds_is_smaller_or_larger_as_the_numbers_are(
    so_far: list[float], after: list[float]
) -> None:
    known = Known(
        data=("a.csv",), sailed_s=1.0, total_s=2.0, remaining_s=1.0, remaining_stated=True, pose=np.zeros(3),
        speed_mps=0.0, model="as known", environment=CALM, weather="none", notes=(), parameters=("X_u", "Y_v"),
        before=np.ones(2), now=np.ones(2), stated=np.ones(2), so_far=np.array(so_far), after=np.array(after),
        purchases=(),
    )  # fmt: skip
    told = known_sentences(known, LocalFrame(lat_deg=0.0, lon_deg=0.0))[-1]
    ratio = math.sqrt(math.prod(so_far) / math.prod(after))
    assert ("times smaller" in told) == (ratio >= 1.02)
    assert ("times larger" in told) == (1 / ratio >= 1.02)
    factor = re.search(r"are ([\d.,e+]+) times", told)
    assert factor is None or float(factor[1]) > 1.0


@pytest.mark.parametrize(
    ("value", "std", "words"),
    [
        (-0.00769, 0.019, "-0.8 ± 1.9 %"),
        (0.0518, 0.16, "+5 ± 16 %"),
        (1.2, 1.5, "+120 ± 150 %"),
        (-1e-4, 0.03, "+0.0 ± 3.0 %"),
    ],
)
def test_a_change_is_told_with_the_digits_of_its_error(value: float, std: float, words: str) -> None:
    assert Change(effect="gain", size=0.1, unit=(0.01, "%"), words="thrust").in_words(value, std) == words


@pytest.mark.parametrize(("value", "std", "words"), [(-1e-5, 9.96e-3, "(0.0 ± 10.0)e-3"), (-0.01, 1.0, "0.0 ± 1.0")])
def test_a_value_that_rounds_to_zero_has_no_minus_sign(value: float, std: float, words: str) -> None:
    assert plus_minus(value, std) == words
