"""An alarm of what passes is withdrawn and said so; one of a change that lasts is not."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from expdesign.export.monitor_content import MonitorContent
from expdesign.export.monitor_results import monitor_json
from expdesign.export.monitor_verdict import sentences
from expdesign.monitoring import Calibration, State, calibrate, threshold
from expdesign.saved import restored, saved
from monitoring_case import CHANGES, STRETCH_S, content_of, drawn_columns, drawn_grams, grams_from, watched

LIMIT = threshold(CHANGES, 1e4)
SINCE, UNTIL, LATER, COUNT = 30, 46, 66, 96
SEEDS = range(40, 52)


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrate(drawn_grams(600, seed=0))


def voyage(seed: int, *, until: int = COUNT) -> np.ndarray:
    """Columns of a voyage with a change from `SINCE` on, which is over after a while."""
    change = np.array([0.0, 0.0, 0.6, 0.0])
    columns = drawn_columns(COUNT, seed=seed, change=change, since=SINCE)
    columns[until:, :, -1] -= columns[until:, :, :CHANGES] @ change
    return columns


def content(calibration: Calibration, seed: int, until: int) -> MonitorContent:
    return content_of(calibration, watched(calibration, grams_from(voyage(seed, until=until)), LIMIT), LIMIT)


def test_what_lasts_stays_an_alarm_and_what_passes_is_withdrawn_and_said_so(calibration: Calibration) -> None:
    lasting = [content(calibration, seed, COUNT) for seed in SEEDS]
    assert all(len(one.found) == 1 and not one.withdrawn for one in lasting)
    passing = [content(calibration, seed, UNTIL) for seed in SEEDS]
    raised = [one for one in passing if one.alarms]
    assert len(raised) == len(SEEDS)
    gone = [one for one in raised if one.withdrawn]
    assert len(gone) >= len(raised) - 1
    for one in gone:
        told, words = json.loads(monitor_json(one, [])), " ".join(sentences(one))
        (first, last), *_ = one.withdrawn
        assert first.time_s < last.judged_s
        assert [entry["time_s"] for entry in told["withdrawn"]] == [first.time_s]
        assert "was withdrawn at" in words
        assert bool(told["alarms"]) == ("has changed" in words) == bool(one.found)
        statistic = re.search(r"with the statistic ([\d.]+) above the threshold ([\d.]+)", words)
        assert statistic
        assert float(statistic[1]) > float(statistic[2])
        assert one.found or "The largest statistic" not in words  # it would stand above the threshold beside no alarm
        assert one.found or words.startswith("No alarm that stands")


def test_after_it_is_withdrawn_the_watch_goes_on_from_the_ship_before(calibration: Calibration) -> None:
    """Another change later is found, named and measured as if there had been no alarm."""
    found = 0
    for seed in SEEDS:
        columns = voyage(seed, until=UNTIL)
        columns[LATER:, :, -1] += columns[LATER:, :, 3]
        state, alarms, _ = watched(calibration, grams_from(columns), LIMIT)
        if not any(alarm.withdrawn and alarm.judged_s < LATER * STRETCH_S for alarm in alarms):
            continue
        found += 1
        later = state.alarm or alarms[-1]
        assert later.change == 3
        assert abs(later.value - 1.0) < 4.0 * later.std
        assert np.abs(np.delete(state.shift, 3)).max() < 0.2
        assert json.dumps(saved(restored(State, json.loads(json.dumps(saved(state)))))) == json.dumps(saved(state))
    assert found >= 8
