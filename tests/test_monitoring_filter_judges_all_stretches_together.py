"""The filter of the unmeasured force judges stretch by stretch as all of them together would be judged."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from expdesign.monitoring import State, calibrate
from expdesign.monitoring.cusum import SURELY, _rougher, _scattered
from expdesign.monitoring.evidence import stretches_of
from expdesign.monitoring.force import Force, Known, after_gap, after_stretch, beside, judged, likelihood, surprise
from monitoring_case import CHANGES, FORCES, STARTS, STRETCH_S, drawn_columns, drawn_grams, grams_from

NOISE = np.array([1.0, np.inf, np.inf, np.inf])
FORCE = Force(variance=np.array([0.09, 0.09, 0.04, 0.04]), time_s=np.array([300.0, 300.0, 43200.0, 43200.0]))


def dense_covariance(columns: np.ndarray) -> np.ndarray:
    """Of the errors of all stretches together: noise, force over time, and initial velocities nobody knows."""
    count, samples, _ = columns.shape
    time_s = STRETCH_S * np.arange(count)
    blocks = np.zeros((count, samples, count, FORCES))
    pushed = columns[:, :, CHANGES + STARTS : -1]
    blocks[np.arange(count), :, np.arange(count)] = pushed
    F = blocks.reshape(count * samples, count * FORCES)
    apart = np.abs(np.subtract.outer(time_s, time_s))
    over_time = sum(np.kron(np.exp(-apart / t), v * np.eye(FORCES)) for v, t in ((0.09, 300.0), (0.04, 43200.0)))
    S = np.zeros((count, samples, count, STARTS))
    S[np.arange(count), :, np.arange(count)] = columns[:, :, CHANGES : CHANGES + STARTS]
    S = S.reshape(count * samples, count * STARTS)
    return np.eye(count * samples) + F @ over_time @ F.T + 1e6 * S @ S.T


def test_the_likelihood_and_the_scores_are_those_of_all_stretches_together() -> None:
    columns = drawn_columns(6, seed=1, change=np.array([0.5, 0.0, -0.3, 0.0]))
    R = dense_covariance(columns)
    e, X = columns[:, :, -1].ravel(), columns[:, :, :CHANGES].reshape(-1, CHANGES)
    stretches = stretches_of(grams_from(columns), NOISE, np.zeros(0))
    known, taken = Known.nothing(FORCE), np.zeros((2 * FORCES, CHANGES))
    score, information, quadratic = np.zeros(CHANGES), np.zeros((CHANGES, CHANGES)), 0.0
    for index, products in enumerate(stretches.products):
        if index:
            known, taken = after_gap(known, FORCE, STRETCH_S), FORCE.memory(STRETCH_S)[:, None] * taken
        one = judged(products, CHANGES, known)
        more, told, taken = beside(one, taken)
        score, information = score + more, information + told
        quadratic += float(one.quadratic)
        known = after_stretch(known, one)
    assert quadratic == pytest.approx(e @ np.linalg.solve(R, e), rel=1e-4)
    assert score == pytest.approx(X.T @ np.linalg.solve(R, e), rel=1e-3, abs=1e-3)
    assert information == pytest.approx(X.T @ np.linalg.solve(R, X), rel=1e-3, abs=1e-3)


def test_of_two_forces_the_likelihood_prefers_as_the_dense_one_does_of_an_unknown_ship() -> None:
    columns = drawn_columns(6, seed=2, change=np.array([0.5, 0.0, -0.3, 0.0]))
    stretches = stretches_of(grams_from(columns), NOISE, np.zeros(0))
    other = Force(variance=4.0 * FORCE.variance, time_s=FORCE.time_s)
    both = Force(variance=np.stack([FORCE.variance, other.variance]), time_s=FORCE.time_s)
    one, two = likelihood(stretches, FORCE), likelihood(stretches, other)
    assert likelihood(stretches, both) == pytest.approx([float(one), float(two)])
    e = columns[:, :, -1].ravel()
    dense = dense_covariance(columns)
    starts = columns[:, :, CHANGES : CHANGES + STARTS]
    S = np.zeros((6, 20, 6, STARTS))
    S[np.arange(6), :, np.arange(6)] = starts
    S = S.reshape(120, 18)
    X = columns[:, :, :CHANGES].reshape(-1, CHANGES)
    plain = np.eye(120) + 1e6 * S @ S.T
    wider, ship = plain + 4.0 * (dense - plain), X @ X.T
    costs = [e @ np.linalg.solve(R, e) + np.linalg.slogdet(R)[1] for R in (dense + ship, wider + ship)]
    assert float(two - one) == pytest.approx(costs[1] - costs[0], abs=1e-2)


def test_a_watch_counts_by_how_much_other_weathers_are_likelier_than_that_of_the_reference() -> None:
    columns = drawn_columns(6, seed=2)
    stretches = stretches_of(grams_from(columns), NOISE, np.zeros(0))
    weathers = Force(variance=np.stack([FORCE.variance, 4.0 * FORCE.variance]), time_s=FORCE.time_s)
    state = State.begun(calibrate(drawn_grams(200, seed=0)), time_s=0.0)
    state = replace(state, known=Known.nothing(FORCE), rough=Known.nothing(weathers), rougher=np.zeros(2))
    for index, products in enumerate(stretches.products):
        if index:
            known, rough = after_gap(state.known, FORCE, STRETCH_S), after_gap(state.rough, weathers, STRETCH_S)
            state = replace(state, known=known, rough=rough)
        state = _rougher(state, products, judged(products, CHANGES, state.known), np.zeros(0, dtype=np.int64))
    e, dense = columns[:, :, -1].ravel(), dense_covariance(columns)
    S = np.zeros((6, 20, 6, STARTS))
    S[np.arange(6), :, np.arange(6)] = columns[:, :, CHANGES : CHANGES + STARTS]
    plain = np.eye(120) + 1e6 * S.reshape(120, 18) @ S.reshape(120, 18).T
    costs = [e @ np.linalg.solve(R, e) + np.linalg.slogdet(R)[1] for R in (dense, plain + 4.0 * (dense - plain))]
    assert state.rougher == pytest.approx([0.0, (costs[0] - costs[1]) / 2.0], abs=1e-2)
    assert abs(costs[0] - costs[1]) > 1.0


def test_what_a_force_surprises_by_is_one_on_average_per_component() -> None:
    stretches = stretches_of(drawn_grams(2000, seed=5), NOISE, np.zeros(0))
    known, found = Known.nothing(FORCE), list[np.ndarray]()
    for products in stretches.products:
        known = after_gap(known, FORCE, STRETCH_S)
        one = judged(products, CHANGES, known)
        found.append(surprise(products, CHANGES, known))
        known = after_stretch(known, one)
    assert np.abs(np.mean(found, axis=0) - 1.0).max() < 3.0 * np.std(found) / np.sqrt(len(found))


def test_a_wind_that_keeps_its_direction_is_known_by_the_cosine_of_a_turn() -> None:
    """Over all directions of the wind, its push along an axis of the ship before and after a turn."""
    turning = Force(variance=np.ones(3), time_s=np.full(3, 600.0), turning=np.array([1.0, 0.0, 1.0]))
    directions = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    for turn in (0.3, 1.2):
        before, after = np.cos(directions), np.cos(directions - turn)
        expected = float(before @ after / (before @ before)) * np.exp(-60.0 / 600.0)
        assert turning.memory(60.0, turn)[[0, 2]] == pytest.approx(expected)
        assert turning.memory(60.0, turn)[1] == pytest.approx(np.exp(-0.1))
    assert turning.memory(60.0, 2.0)[0] == 0.0
    assert turning.memory(60.0, np.nan) == pytest.approx(np.exp(-0.1))


def test_a_steady_wind_on_all_headings_is_no_change_of_the_ship_and_a_push_that_turns_with_her_is() -> None:
    """A wind's columns go with the heading: once she has turned, the filter tells it from a change along her axis."""
    headings = np.tile([0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi], 10)
    force = Force(
        variance=np.array([1e-3, 1e-3, 4.0, 4.0]), time_s=np.array([300.0, 43200.0, 7200.0, 7200.0]),
        turning=np.array([1.0, 0.0, 0.0, 0.0]),
    )  # fmt: skip
    ratio = dict[str, float]()
    for name, pushed in (("wind", np.cos(headings - 0.4)), ("change", np.ones(len(headings)))):
        known, taken, score, information = Known.nothing(force), np.zeros((4, 1)), 0.0, 0.0
        for index, heading in enumerate(headings):
            if index:
                gap = (STRETCH_S, float(heading - headings[index - 1]))
                known, taken = after_gap(known, force, *gap), force.memory(*gap)[:, None] * taken
            row = np.array([1.0, np.cos(heading), np.sin(heading), 1.0, pushed[index]])
            one = judged(9.0 * np.outer(row, row), 1, known)
            more, told, taken = beside(one, taken)
            known, score, information = after_stretch(known, one), score + more[0], information + told[0, 0]
        ratio[name] = score / information
    assert abs(ratio["wind"]) < 0.1
    assert ratio["change"] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("scatter", "shift"), [(1.0, 0.0), (1.0, 5.0), (3.0, 0.0)])
def test_scores_that_scatter_by_chance_count_whole_and_those_moved_up_and_down_by_gusts_do_not(scatter, shift) -> None:
    """A steady change moves all scores by its size times their information, and is no scatter."""
    rng, trials, count = np.random.default_rng(8), 2000, 12
    information = rng.uniform(0.5, 2.0, (trials, count))
    score = shift * information + scatter * np.sqrt(information) * rng.standard_normal((trials, count))
    calibration = SimpleNamespace(inflation=np.ones(1))
    found = []
    for known, seen in zip(information, score, strict=True):
        sums = SimpleNamespace(
            stretches=np.array([float(count)]),
            information=np.array([[[known.sum()]]]),
            score=np.array([[seen.sum()]]),
            squares=np.array([[(seen**2 / known).sum()]]),
        )
        found.append(_scattered(SimpleNamespace(shift=np.zeros(1), sums=sums), 0, calibration))
    more = np.mean(np.array(found) > 1.0)
    if scatter == 1.0:
        chance = 1.0 - SURELY
        assert abs(more - chance) < 3.0 * np.sqrt(chance * SURELY / trials)
    else:
        assert more > 0.99
        assert np.median(found) > 3.0
