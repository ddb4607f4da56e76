"""The watch over a ship: its alarms are as rare as stated, and changes are named and dated."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from expdesign.export.monitor_content import MonitorContent
from expdesign.export.monitor_page import MOST_LINEAR, monitor_document, statistic_figure
from expdesign.export.monitor_results import monitor_json
from expdesign.export.monitor_verdict import sentences
from expdesign.export.pages import document_html
from expdesign.export.pages.figures import report_style
from expdesign.monitoring import (
    AS_LIKELY,
    Alarm,
    Calibration,
    Grams,
    RollWatch,
    Rules,
    State,
    calibrate,
    calls_of,
    cusum,
    threshold,
    watch,
)
from expdesign.monitoring.alarms import beside_baseline
from expdesign.monitoring.calibration import FEWEST_STRETCHES, SPARE, _errors
from expdesign.monitoring.force import Force
from expdesign.monitoring.rolled import RollEvent
from expdesign.saved import restored, saved
from monitoring_case import CHANGES, FORCES, STRETCH_S, content_of, drawn_columns, drawn_grams, grams_from, watched

NOISE = np.array([1.0, np.inf, np.inf, np.inf])
FORCE = Force(variance=np.array([0.09, 0.09, 0.04, 0.04]), time_s=np.array([300.0, 300.0, 43200.0, 43200.0]))


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrate(drawn_grams(600, seed=0))


@pytest.mark.thorough
def test_the_calibration_finds_noise_and_force(calibration: Calibration) -> None:
    assert calibration.std[0] == pytest.approx(1.0, abs=0.03)
    quick, slow = calibration.force.variance.reshape(2, FORCES)
    total = quick + slow / (1.0 + SPARE)  # ten hours show one value of what varies within half a day
    assert np.all((total > 0.05) & (total < 0.5))  # 0.18 was drawn, the slow half of it once
    assert np.all(np.abs(calibration.baseline) < 5 * calibration.baseline_std)
    assert calibration.watched.all()


@pytest.mark.thorough
def test_where_nothing_changes_the_likelihood_ratio_has_mean_one_and_alarms_are_rare(calibration: Calibration) -> None:
    between, count = 150.0, 3000
    limit = threshold(CHANGES, between)
    _, alarms, steps = watched(calibration, drawn_grams(count, seed=3), limit)
    raised = [alarm for alarm in alarms if not alarm.settled]
    allowed = count / between
    assert len(raised) <= allowed + 3.0 * np.sqrt(allowed)
    assert len(steps) > 0.5 * count
    assert not watched(calibration, drawn_grams(600, seed=4), threshold(CHANGES, 1e6))[1]


@pytest.mark.parametrize(("number", "size"), [(0, 1.0), (2, -1.0), (3, 0.6)])
def test_a_change_is_named_dated_and_measured(calibration: Calibration, number: int, size: float) -> None:
    change = np.zeros(CHANGES)
    change[number] = size
    since = 200
    columns = drawn_columns(320, seed=5, change=change, since=since)
    state, alarms, _ = watched(calibration, grams_from(columns), threshold(CHANGES, 1e4))
    first, settled = alarms[0], alarms[1]
    assert settled.settled
    assert settled.change == number
    assert abs(settled.value - size) < 4.0 * settled.std
    assert since - 3 <= first.since_s / STRETCH_S <= since + 3
    assert first.time_s > first.since_s
    assert state.alarm is None
    assert state.shift[number] == pytest.approx(size, abs=5.0 * settled.std + 0.2)
    assert len(alarms) == 2  # the watch goes on from the changed ship


def test_a_watch_in_parts_and_out_of_a_file_is_the_same_to_the_last_bit(calibration: Calibration) -> None:
    change = np.array([0.0, 0.0, 1.0, 0.0])
    grams = drawn_grams(120, seed=6, change=change, since=60)
    limit = threshold(CHANGES, 1e4)
    whole = watched(calibration, grams, limit)
    state = State.begun(calibration, time_s=0.0)
    alarms: list[Alarm] = []
    again = restored(Calibration, json.loads(json.dumps(saved(calibration))))
    for first in range(0, 120, 7):
        state, more, _ = watched(again, grams.part(slice(first, first + 7)), limit, state)
        state = restored(State, json.loads(json.dumps(saved(state))))
        alarms += more
    assert saved(state) == saved(whole[0])
    assert tuple(alarms) == whole[1]


def test_stretches_unlike_the_reference_are_not_judged(calibration: Calibration) -> None:
    columns = drawn_columns(100, seed=7)
    columns[40:70, :, -1] += 8.0 * np.random.default_rng(0).standard_normal((30, 20))
    limit = threshold(CHANGES, 1e5)
    state, alarms, _ = watched(calibration, grams_from(columns), limit)
    assert state.left_out_s == 30 * STRETCH_S
    assert not alarms


def test_what_is_over_before_it_is_told_from_weather_is_no_change(
    calibration: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a squall: the sum falls from its peak, and one of a change that lasts does not."""
    change, limit = np.array([0.9, 0.0, 0.0, 0.0]), threshold(CHANGES, 1e4)
    lasting = [drawn_columns(60, seed=seed, change=change, since=30) for seed in range(21, 29)]
    over = [columns.copy() for columns in lasting]
    for columns in over:
        columns[35:, :, -1] -= columns[35:, :, :CHANGES] @ change

    def alarms(voyages: list[np.ndarray]) -> int:
        return sum(bool(watched(calibration, grams_from(columns), limit)[1]) for columns in voyages)

    assert (alarms(lasting), alarms(over)) == (8, 0)
    monkeypatch.setattr(cusum, "FALLEN", np.inf)
    assert alarms(over) >= 4


@pytest.mark.thorough
def test_stronger_weather_is_not_judged_and_is_no_change(calibration: Calibration) -> None:
    limit = threshold(CHANGES, 1e4)
    for quick, unlike in ((0.3, False), (3.0, True)):
        ends = [watched(calibration, drawn_grams(300, seed=80 + seed, quick=quick), limit) for seed in range(6)]
        left, judged_count = (sum(getattr(state, name) for state, *_ in ends) for name in ("left_out_s", "judged_s"))
        assert (left > 9 * judged_count) if unlike else (judged_count > 9 * left)
        assert sum(bool(alarms) for _, alarms, _ in ends) <= 1


def test_the_threshold_grows_with_the_time_between_false_alarms() -> None:
    assert threshold(10, 1e4) == pytest.approx(np.log(2e5))
    assert threshold(10, 1e6) > threshold(10, 1e4) > threshold(1, 1e4)
    assert FEWEST_STRETCHES > 0


HOUR = 3600.0
SEEDS = range(20, 28)
CALL = 60  # stretches before a port call


def with_call(seed: int, load: np.ndarray, later: np.ndarray) -> Grams:
    """Stretches with a port call of eight hours that changes the load, and a change of the ship afterwards."""
    columns = drawn_columns(220, seed=seed)
    columns[CALL:, :, -1] += columns[CALL:, :, :CHANGES] @ load
    columns[2 * CALL :, :, -1] += columns[2 * CALL :, :, :CHANGES] @ later
    grams = grams_from(columns)
    return replace(grams, time_s=grams.time_s + 8 * HOUR * (np.arange(len(grams)) >= CALL))


@pytest.fixture(scope="module")
def loaded(calibration: Calibration) -> Calibration:
    """A load may change the third and the fourth."""
    return replace(calibration, load=np.array([0.0, 0.0, 2.0, 2.0]))


LOAD, SAME = np.array([0.0, 0.0, 1.5, -0.8]), np.zeros(CHANGES)


@pytest.mark.thorough
def test_another_load_after_a_port_call_is_told_and_raises_no_alarm(loaded: Calibration) -> None:
    limit, far = threshold(CHANGES, 1e5), []
    for seed in SEEDS:
        state, alarms, _ = watched(loaded, with_call(seed, LOAD, SAME), limit, port_s=6 * HOUR)
        assert not alarms
        (call,) = calls_of(state, loaded)
        assert call.stay_s == pytest.approx(8 * HOUR)
        far.append((call.value - LOAD)[2:] / call.std[2:])
    assert (np.array(far) ** 2).mean() < 1.0 + 3.0 * np.sqrt(2.0 / np.size(far))


@pytest.mark.thorough
def test_without_port_calls_another_load_is_a_change_of_the_ship(loaded: Calibration) -> None:
    limit = threshold(CHANGES, 1e5)
    assert all(watched(loaded, with_call(seed, LOAD, SAME), limit)[1] for seed in SEEDS)


@pytest.mark.thorough
@pytest.mark.parametrize("number", [0, 2])
def test_a_change_under_way_after_a_port_call_is_an_alarm_even_if_it_is_one_of_load(
    loaded: Calibration, number: int
) -> None:
    later = np.zeros(CHANGES)
    later[number] = 1.0
    for seed in SEEDS:
        _, alarms, _ = watched(loaded, with_call(seed, LOAD, later), threshold(CHANGES, 1e5), port_s=6 * HOUR)
        assert alarms[0].since_s == pytest.approx(8 * HOUR + 2 * CALL * STRETCH_S, abs=3 * STRETCH_S)
        assert alarms[-1].settled
        assert alarms[-1].change == number or number in alarms[-1].as_likely


def test_sizes_carry_the_errors_of_the_reference(calibration: Calibration) -> None:
    """Their weights are those of the dense covariance J + J B J of the scores, and a short reference widens them."""
    columns = drawn_columns(60, seed=11, change=np.array([0.0, 0.0, 1.5, 0.0]))
    state, _, _ = watched(calibration, grams_from(columns), np.inf)
    score, information = beside_baseline(state.whole, calibration)
    J, B = state.whole.information[0] / calibration.common, calibration.baseline_covariance
    weights = np.linalg.inv(J + J @ B @ J)
    assert information == pytest.approx(J @ weights @ J)
    assert score == pytest.approx(J @ weights @ state.whole.score[0] / calibration.common)
    short = calibrate(drawn_grams(FEWEST_STRETCHES, seed=0))
    assert np.all(np.diag(beside_baseline(state.whole, short)[1]) < np.diag(information))


@pytest.mark.parametrize("apart", [0.2, 0.4, 1.0])
def test_errors_of_the_reference_are_right_in_what_tells_alike_changes_apart_too(apart: float) -> None:
    """Of 400 references: what acts on both changes varies slowly, what tells them apart does not.

    With a factor of each change on the covariance, squared errors of what tells them apart are 0.4 to 0.65 of it.
    """
    rng, acts, prior = np.random.default_rng(3), np.array([[1.5, 0.0], [1.5, 1.5 * apart]]), np.eye(2)
    information = np.tile(acts @ acts.T, (160, 1, 1))
    whole = information.sum(axis=0)
    axes = np.linalg.eigh(whole)[1]
    squares = []
    for _ in range(400):
        drawn, slow = rng.standard_normal((160, 2)), rng.standard_normal()
        for row in drawn:
            row[0] = slow = 0.5 * slow + np.sqrt(0.75) * row[0]
        score = drawn @ acts.T
        error = np.linalg.solve(whole + prior, score.sum(axis=0) + rng.standard_normal(2))
        told = np.einsum("ia,ij,ja->a", axes, _errors(score, information), axes)
        squares.append((axes.T @ error) ** 2 / told)
    assert np.mean(squares, axis=0) == pytest.approx(1.0, abs=0.07 * 3)  # the standard error of a mean square is 0.07


BENT = 0.1  # second-order part of the error, by which a change of three sizes acts a third more than it does when small


def bent(columns: np.ndarray, change: np.ndarray, since: int) -> tuple[Grams, Callable[[np.ndarray, float], Grams]]:
    """Stretches whose error is no linear function of a change, and the same linearised anew."""

    def linearised(shift: np.ndarray, since_s: float = 0.0) -> Grams:
        own = columns.copy()
        X = columns[:, :, :CHANGES]
        for place, added in enumerate(
            change * np.ones((len(columns), 1)) * (np.arange(len(columns)) >= since)[:, None]
        ):
            own[place, :, -1] += X[place] @ (
                added + BENT * added * np.abs(added) - shift - BENT * shift * np.abs(shift)
            )
        own[:, :, :CHANGES] = X * (1.0 + 2.0 * BENT * np.abs(shift))
        grams = grams_from(own)
        return grams.part(slice(int(np.searchsorted(grams.time_s, since_s - 1e-6)), None))

    return linearised(np.zeros(CHANGES)), linearised


@pytest.mark.thorough
def test_the_size_of_a_large_change_is_right_once_it_is_simulated(calibration: Calibration) -> None:
    """Over ships: without bias, and within what is stated; linearised at the ship before, it is too large."""
    change, since = np.array([0.0, 0.0, 3.0, 0.0]), 30
    far = dict[bool, list[float]]({True: [], False: []})
    for seed in range(12):
        grams, linearised = bent(drawn_columns(80, seed=900 + seed), change, since)
        for simulated, values in far.items():
            state = State.begun(calibration, time_s=0.0)
            again = linearised if simulated else None
            state, _, _, used = watch(
                calibration, state, grams, rules=Rules(limit=threshold(CHANGES, 1e4)), again=again
            )
            assert state.alarm is not None
            if simulated:
                assert used < len(grams)  # the ship is another: what follows is to be linearised anew
            assert state.alarm.change == 2
            values.append((state.alarm.value - change[2]) / state.alarm.std)
    mean = {simulated: abs(np.mean(values)) for simulated, values in far.items()}
    assert mean[True] < 3.0 / np.sqrt(12)
    assert np.mean(np.square(far[True])) < 1.0 + 3.0 * np.sqrt(2.0 / 12)
    assert mean[False] > 3.0 / np.sqrt(12)


def test_a_large_alarm_does_not_hide_the_threshold_on_the_page(calibration: Calibration) -> None:
    """Its sum may be hundreds of times the threshold: the scale is linear up to that and logarithmic above."""
    change, limit = np.array([0.0, 0.0, 4.0, 0.0]), threshold(CHANGES, 1e4)
    content = content_of(
        calibration, watched(calibration, drawn_grams(60, seed=6, change=change, since=40), limit), limit
    )
    largest = max(moment.statistic for moment in content.moments)
    assert largest > MOST_LINEAR * limit
    with report_style():
        figure = statistic_figure(content)
    ticks = [float(text) for text in re.findall(r">\s*(\d[\d.e+]*)\s*</text>", figure)]
    assert {0.0, 10.0, 100.0} <= set(ticks)
    assert "mathdefault" not in figure


@pytest.mark.thorough
def test_no_statistic_above_the_threshold_stands_beside_no_alarm(calibration: Calibration) -> None:
    limit, passed = threshold(CHANGES, 1e3), 0
    for seed in (101, 110, 128, 151, 152):  # squalls of four stretches, told at every moment
        columns = drawn_columns(70, seed=seed, quick=0.5)
        columns[50:54, :, -1] += 2.0 * columns[50:54, :, 0]
        for count in (53, 54, 55, 58, 70):
            ends = watched(calibration, grams_from(columns[:count]), limit)
            state, alarms, steps = ends
            words = " ".join(sentences(content_of(calibration, ends, limit)))
            largest = max((step.statistic for step in steps if step.compared), default=0.0)
            assert bool(alarms) == (largest > limit)
            if not alarms and (told := re.search(r"statistic is ([\d.]+), the threshold ([\d.]+)\.", words)):
                assert float(told[1]) <= float(told[2])
            undecided, dismissed = state.undecided_s > 0, state.brief + state.by_weather > 0
            passed += undecided or dismissed
            assert undecided == ("too short to tell a change of the ship from weather" in words and not alarms)
            assert dismissed == ("passed without an alarm" in words)
            assert (largest > limit or undecided or dismissed) == any(step.statistic > limit for step in steps)
    assert passed


CHANGED = re.compile("(ship|weather|sensor) has changed|no longer the ship")
AS_BEFORE = re.compile("the ship is the one of the reference")
ROLLED = RollEvent(
    since_s=0.0, time_s=9.0, after_call=False, settled=True, p_value=0.0, causes=(), sizes=(), stds=(), load=None,
    others=(), values={}, righting_nm=(1.0, 1.0), mass_kg=1.0,
)  # fmt: skip


def told_of(content: MonitorContent) -> tuple[str, str, str]:
    """In sentences, as the terminal has them, on the page and in the file."""
    page = document_html(monitor_document(content))
    return " ".join(sentences(content)), page, monitor_json(content, [])


def states(loaded: Calibration) -> Iterator[tuple[str, MonitorContent]]:
    """What a watch may come to, and what it is told of."""
    limit = threshold(CHANGES, 1e4)

    def content(grams: Grams) -> MonitorContent:
        told = content_of(loaded, watched(loaded, grams, limit, port_s=6 * HOUR), limit)
        effects = ("inertia:u", "inertia:v", "inertia:r", "gain")
        return replace(told, changes=tuple(map(lambda one, name: replace(one, effect=name), told.changes, effects)))

    same = content(drawn_grams(200, seed=4))
    noisy = drawn_columns(100, seed=7)
    noisy[40:70, :, -1] += 8.0 * np.random.default_rng(0).standard_normal((30, 20))
    squall = drawn_columns(70, seed=110, quick=0.5)
    squall[50:54, :, -1] += 2.0 * squall[50:54, :, 0]
    alarm = content(drawn_grams(200, seed=6, change=np.array([0.0, 0.0, 3.0, 0.0]), since=60))
    yield "same", same
    yield "partly beyond the reference", content(grams_from(noisy))
    yield "beyond the reference", content(drawn_grams(300, seed=80, quick=3.0))
    yield "too short", content(drawn_grams(2, seed=4))
    for count in (53, 54, 55, 70):
        yield f"squall, {count}", content(grams_from(squall[:count]))
    yield "another load", content(with_call(20, LOAD, SAME))
    for call in (True, False):
        event = replace(ROLLED, after_call=call)
        yield f"rolls otherwise, {call}", replace(same, roll=RollWatch(judged_s=HOUR, events=(event,)))
    yield "rolls as before", replace(same, roll=RollWatch(judged_s=HOUR))
    yield "alarm", alarm
    for gain in (0.0, 2.0 * AS_LIKELY):
        pushed = replace(alarm.found[-1], pushes=((2, gain),))
        yield f"alarm or a push, {gain}", replace(alarm, alarms=(pushed,), state=replace(alarm.state, alarm=None))


@pytest.mark.usefixtures("undrawn_here")
@pytest.mark.parametrize("gap_s", [0.0, 600.0])
@pytest.mark.parametrize("change", [(2.0, 2.0, 2.0, 0.0), (0.0, 0.0, 3.0, 0.0), (0.0, 0.0, 0.0, 2.0)])
def test_another_load_is_told_as_one_cause_where_it_explains_more_than_a_change(
    calibration: Calibration, change: tuple[float, ...], gap_s: float
) -> None:
    """Also where it came while there were no data: the alarm is of what follows, and all of that is at hand."""
    heavier = replace(calibration, heavier=np.array([1.0, 1.0, 1.0, 0.0]))
    grams = drawn_grams(120, seed=6, change=np.array(change), since=60)
    grams = replace(grams, time_s=grams.time_s + gap_s * (np.arange(120) >= 60))

    def again(shift: np.ndarray, since_s: float) -> Grams:
        after = np.eye(grams.products.shape[-1])
        after[:CHANGES, -1] = -shift
        return replace(grams, products=after.T @ grams.products @ after)

    limit = threshold(CHANGES, 1e4)
    state, alarms, steps, _ = watch(
        heavier, State.begun(heavier, time_s=0.0), grams, rules=Rules(limit=limit), again=again
    )
    content = content_of(heavier, (state, alarms, steps), limit)
    alarm = content.found[-1]
    assert restored(Alarm, json.loads(json.dumps(saved(alarm)))) == alarm
    told, page, _ = told_of(content)
    assert alarm.since_s in grams.time_s
    alike = 0.0 < change[0] == change[1]
    if alike:
        assert alarm.loaded is not None
        gain, value, std = alarm.loaded
        assert gain > AS_LIKELY
        assert abs(value - change[0]) < 4.0 * std
        assert "has changed, or the wind, which is not measured: another load, mass and inertia by +" in told
        assert "or, explaining the data less well, parameter p" in told
        assert "explained as well by" not in told
        assert "is needed to explain them" not in told
    else:
        assert alarm.loaded is None
    assert ("another load, mass" in told) == ("another load, mass" in page) == alike


@pytest.fixture(scope="module")
def alarmed(loaded: Calibration) -> MonitorContent:
    """After an alarm of parameter p2, which may be one of three that another load changes alike."""
    told = next(content for name, content in states(loaded) if name == "alarm")
    return replace(told, calibration=replace(loaded, heavier=np.array([1.0, 1.0, 1.0, 0.0])))


@pytest.mark.parametrize("push", [-1.0, 1.5 * AS_LIKELY, 4.0 * AS_LIKELY])
@pytest.mark.parametrize("load", [-1.0, 1.5 * AS_LIKELY, 4.0 * AS_LIKELY])
def test_causes_of_an_alarm_are_told_in_the_order_of_how_well_they_explain_it(
    alarmed: MonitorContent, load: float, push: float
) -> None:
    """A push that explains the data better than the change was told first, before a load that explains them best."""
    alarm = replace(alarmed.found[-1], loaded=(load, 1.0, 0.1), pushes=((2, push),))
    content = replace(alarmed, alarms=(alarm,), state=replace(alarmed.state, alarm=None))
    told = next(text for text in sentences(content) if text.startswith("Since "))
    gains = {"parameter p2 by": 0.0, "another load, mass": load, "a steady push": push}
    places = sorted(gains, key=told.index)
    best = gains[places[0]]
    for words, gain in gains.items():
        assert best > gain - AS_LIKELY  # none is clearly better than the first
        less = told[: told.index(words)].endswith("or, explaining the data less well, ")
        assert less == (gain <= best - AS_LIKELY)
    assert ("the weather or the ship has changed" in told) == (places[0] == "a steady push")


@pytest.mark.usefixtures("undrawn_here")
def test_the_ship_has_changed_only_by_an_alarm_and_the_same_only_where_nothing_else_is_said(
    loaded: Calibration,
) -> None:
    alarms = same = 0
    for name, content in states(loaded):
        found, roll = bool(content.found), content.roll is not None and bool(content.roll.events)
        beyond = content.state.left_out_s > content.state.judged_s
        for text in told_of(content):
            assert bool(CHANGED.search(text)) == found, name
            assert ("For the cause, give the rows since then" in text) == found, name
            if found or roll or beyond or "another load" in text or content.state.undecided_s:
                assert not AS_BEFORE.search(text), name
            assert not ("She rolls as in the reference" in text and "She rolls otherwise" in text), name
            same += bool(AS_BEFORE.search(text))
        alarms += found
        if found and content.found[-1].pushes:
            told, page, _ = told_of(content)
            first = "weather or the ship" if content.found[-1].pushes[0][1] > AS_LIKELY else "ship or the weather"
            assert f"the {first} has changed: {'a steady push' if first[0] == 'w' else 'parameter p2'}" in told
            assert f"the {first} has changed" in page
    assert alarms >= 3
    assert same >= 6


def test_a_size_that_was_known_stays_known_while_it_is_refined(calibration: Calibration) -> None:
    change, since = np.array([0.0, 0.0, 3.0, 0.0]), 60
    grams, limit = drawn_grams(140, seed=6, change=change, since=since), threshold(CHANGES, 1e4)
    state, named = State.begun(calibration, time_s=0.0), list[tuple[float, float]]()
    for index in range(len(grams)):
        state, alarms, _ = watched(calibration, grams.part(slice(index, index + 1)), limit, state)
        told = state.alarm or next(iter(alarms), None)
        if told is not None and told.named:
            named.append((told.value, told.std))
    assert named
    assert all(abs(value - change[2]) < 4.0 * std for value, std in named)
    assert max(std for _, std in named) < 1.5 * named[0][1]
