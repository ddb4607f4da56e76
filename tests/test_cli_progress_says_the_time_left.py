"""The time left is what the rest takes if it goes on as the work so far; nothing is said of less than a second."""

import pytest

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
