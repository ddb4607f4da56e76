"""The time left is what the rest takes if it goes on as the work so far, or it is said that it is not known."""

import io
import math
import re

import pytest
from rich.console import Console

from expdesign.cli import app


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(app.time, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize(
    ("after_s", "share", "words"),
    [
        (10.0, 0.25, "about 30 s left"),
        (300.0, 0.5, "about 5 min left"),
        (10.0, 0.05, ""),
        (10.0, 0.95, ""),
        (10.0, 1.0, ""),
        (0.0, 0.5, ""),
    ],
)
def test_the_rest_goes_on_as_the_work_so_far(clock, capsys, after_s, share, words):
    with app.shown_progress(quiet=False) as report:
        clock[0] += after_s
        report("at work", share)
    line = capsys.readouterr().err.strip()
    assert line == f"[{share:4.0%}] at work" + (f", {words}" if words else "")


def words_of(clock, shares):
    """What is said at every second of work that has done such shares by then."""
    left, words = app._TimeLeft(), []
    for share in shares:
        clock[0] += 1.0
        left.at(share)
        words.append(str(left))
    return words


@pytest.mark.parametrize("total", [20, 90])
def test_steady_work_ends_when_it_was_said_to(clock, total):
    words = words_of(clock, [second / total for second in range(1, total + 1)])
    expected = [f"about {total - second} s left" for second in range(1, total)]
    expected = [text if second * 10 >= total else "" for second, text in enumerate(expected, start=1)]
    assert words == [*expected, ""]


@pytest.mark.parametrize("left", [5.0, 20.0, 60.0])
def test_seconds_left_never_stand(clock, left):
    """Work that grows as it goes has the same seconds left all the time."""
    words = words_of(clock, [second / (second + left) for second in range(1, 600)])
    known = [second for second, text in enumerate(words, start=1) if re.match("about", text)]
    assert max(known) <= left + 2 * app.STANDING_S
    assert set(words[max(known) :]) == {"time left not known"}


def test_the_time_left_runs_down_while_nothing_is_told_and_is_not_known_thereafter(clock):
    words = words_of(clock, [0.25, 0.5, *[0.5] * 5, 0.9])
    assert words == ["about 3 s left", "about 2 s left", "about 1 s left", "", *["time left not known"] * 3, ""]


def test_work_whose_rest_nobody_knows_says_so_until_more_is_done(clock):
    words = words_of(clock, [math.nan, 0.1, 0.2, math.nan, 0.2, 0.3])
    unknown = "time left not known"
    assert words == [unknown, "about 18 s left", "about 12 s left", unknown, unknown, "about 14 s left"]


def test_a_bar_says_what_is_not_known(clock, monkeypatch):
    shown = io.StringIO()
    monkeypatch.setattr(app, "Console", lambda **_: Console(file=shown, force_terminal=True, width=120))
    with app.shown_progress(quiet=False) as report:
        clock[0] += 50.0
        report("at work", 0.5)
        clock[0] += 20.0
        report("still at work", 0.5)
        clock[0] += 40.0
        report("not done yet", math.nan)
    text = shown.getvalue()
    assert "time left not known" in text
    assert "nan" not in text
