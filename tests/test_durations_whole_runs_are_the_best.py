"""Whole runs fit the time, inform about every parameter, and are optimal or nearly so."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from design_case import WIND, duration_problem, one_line, random_matrices, scored_example, vessel
from expdesign.durations import (
    DurationDesign,
    DurationProblem,
    build_durations,
    rounding,
    solve_durations,
    with_repeats,
)
from expdesign.durations.certificate import scaled
from expdesign.durations.rounding import _completed, _Search
from expdesign.errors import NoAnswer, NotInformative
from expdesign.values import Array


def information_of(problem: DurationProblem, runs: Array) -> Array:
    """(n,) log det of the information that runs (n, q) collect, means taken off over all runs; -inf when singular."""
    p = len(problem.parameters)
    matrices, _ = scaled(problem.matrices)
    total = np.tensordot(runs * problem.run_s, matrices, axes=1)
    collected = total[:, :p, :p]
    if problem.dimension > p:
        collected = collected - total[:, :p, p:] @ np.linalg.solve(total[:, p:, p:], total[:, p:, :p])
    values = np.maximum(np.linalg.eigvalsh(collected), 1e-300)
    return np.where(values[:, 0] > 1e-12 * values[:, -1], np.log(values).sum(axis=1), -np.inf)


def information(problem: DurationProblem, repeats: tuple[int, ...]) -> float:
    """The same of one set of whole runs."""
    return float(information_of(problem, np.array([repeats]))[0]) if any(repeats) else -np.inf


def best(problem: DurationProblem) -> float:
    """The same of the best of all sets of whole runs."""
    counts = (np.arange(int(problem.total_s / run_s + 1e-9) + 1) for run_s in problem.run_s)
    runs = np.stack(np.meshgrid(*counts), axis=-1).reshape(-1, len(problem.run_s))
    fitting = runs[(runs @ problem.run_s <= problem.total_s + 1e-9) & runs.any(axis=1)]
    return float(information_of(problem, fitting).max())


def loss(problem: DurationProblem, design: DurationDesign) -> float:
    """1 - efficiency of the whole runs against the best whole runs."""
    return 1 - float(np.exp((information(problem, design.repeats) - best(problem)) / len(problem.parameters)))


def small_problem(draw: int, *, equal: bool) -> DurationProblem:
    """Few primitives and a time that holds few runs, so that all sets can be tried."""
    rng = np.random.default_rng(draw)
    parameters, count = int(rng.integers(1, 4)), int(rng.integers(3, 6))
    matrices = random_matrices(rng, count=count, parameters=parameters, outputs=1, samples=parameters + 1)
    run_s = 10.0 if equal else rng.integers(5, 25, count).astype(float).tolist()
    return duration_problem(matrices, means=1, run_s=run_s, total_s=float(rng.integers(50, 80)))


def test_whole_runs_of_one_length_are_the_best_there_are():
    losses = [loss(problem, solve_durations(problem)) for problem in (small_problem(d, equal=True) for d in range(20))]
    assert max(losses) < 1e-9


@pytest.mark.thorough
def test_whole_runs_of_different_lengths_are_mostly_the_best_and_never_far_from_it():
    losses = [loss(problem, solve_durations(problem)) for problem in (small_problem(d, equal=False) for d in range(30))]
    # Exchange finds a local optimum; `whole_runs` states how good those were on such problems.
    assert np.mean(np.array(losses) < 1e-9) >= 0.9
    assert max(losses) < 0.03


@pytest.mark.parametrize("draw", range(20))
def test_whole_runs_fit_and_leave_no_room_and_say_their_efficiency(draw: int):
    problem = small_problem(draw, equal=draw % 2 == 0)
    design = solve_durations(problem)
    left = problem.total_s - np.dot(design.repeats, problem.run_s)
    assert -1e-9 <= left < problem.run_s.min()
    optimal = design.log_det + len(problem.parameters) * np.log(problem.total_s)
    assert len(design.repeats) == len(problem.names)
    _, offset = scaled(problem.matrices)
    ratio = np.exp((information(problem, design.repeats) + offset - optimal) / len(problem.parameters))
    assert design.efficiency_repeats == pytest.approx(ratio, rel=1e-9)
    assert design.efficiency_repeats <= 1 + 1e-9


@pytest.mark.parametrize("weak", [1.0, 1e-3, 1e-8])
@pytest.mark.parametrize("total_s", [20.0, 50.0, 1000.0])
def test_the_only_primitive_with_information_about_a_parameter_is_never_dropped(weak: float, total_s: float):
    rich = [np.diag([a, b, 0.0]) for a, b in ((3.0, 1.0), (1.0, 3.0), (2.0, 2.0))]
    design = solve_durations(duration_problem([*rich, np.diag([0.0, 0.0, weak])], run_s=10.0, total_s=total_s))
    assert design.repeats[3] >= 1
    assert sum(design.repeats) == total_s / 10


def test_a_long_run_that_is_needed_pushes_short_ones_out():
    # 3 s runs would leave no room for the 40 s run that alone informs about the second parameter.
    design = solve_durations(
        duration_problem([np.diag([1.0, 0.0]), np.diag([0.0, 1e-6])], run_s=[3.0, 40.0], total_s=47)
    )
    assert design.repeats == (2, 1)


@pytest.mark.parametrize(("run_s", "total_s"), [(60.0, 50.0), (30.0, 50.0)])
def test_too_little_time_for_what_is_needed_has_no_answer(run_s: float, total_s: float):
    matrices = [np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]
    with pytest.raises(
        NoAnswer, match=rf"^design\.total_s is 50: whole runs .* shortest run takes {run_s:g} s"
    ) as caught:
        solve_durations(duration_problem(matrices, run_s=run_s, total_s=total_s))
    assert one_line(caught.value)


def test_just_enough_time_is_enough():
    matrices = [np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]
    assert solve_durations(duration_problem(matrices, run_s=[20.0, 30.0], total_s=50.0)).repeats == (1, 1)


def apportioned(fractions: Array, runs: int) -> Array:
    """Efficient apportionment: F. Pukelsheim and S. Rieder, Biometrika 79 (1992), 763-770."""
    support = np.flatnonzero(fractions > 1e-6)
    w = fractions[support] / fractions[support].sum()
    counts = np.ceil((runs - len(support) / 2) * w).astype(int)
    while (left := runs - counts.sum()) != 0:
        index = np.argmin(counts / w) if left > 0 else np.argmax((counts - 1) / w)
        counts[index] += np.sign(left)
    repeats = np.zeros(len(fractions), dtype=int)
    repeats[support] = counts
    return repeats


@pytest.mark.parametrize(("count", "total_s"), [(12, 900.0), (60, 3600.0), (200, 6000.0)])
def test_whole_runs_of_one_length_are_never_worse_than_efficient_apportionment(count: int, total_s: float):
    matrices = random_matrices(np.random.default_rng(count), count=count, parameters=6, outputs=2, samples=8)
    problem = duration_problem(matrices, means=2, run_s=60.0, total_s=total_s)
    design = solve_durations(problem)
    other = apportioned(design.fractions, int(total_s / 60))
    assert other.sum() == sum(design.repeats)
    assert information(problem, design.repeats) >= information(problem, tuple(other)) - 1e-9


@pytest.mark.thorough
def test_many_candidates_of_different_lengths_are_rounded_better_than_downwards():
    rng = np.random.default_rng(0)
    matrices = random_matrices(rng, count=200, parameters=18, outputs=3, samples=12)
    problem = duration_problem(matrices, means=3, run_s=rng.uniform(20, 120, 200).round().tolist(), total_s=3600.0)
    design = solve_durations(problem)
    down = np.floor(design.fractions * 3600.0 / problem.run_s).astype(int)
    assert information(problem, design.repeats) > information(problem, tuple(down))
    assert np.dot(design.repeats, problem.run_s) <= 3600.0


@pytest.mark.parametrize(("dictionary", "sea", "total_s"), [("model-ship", None, 450.0), ("standard", WIND, 3600.0)])
def test_no_swap_of_one_run_improves_the_examples(dictionary: str, sea: object, total_s: float):
    items = scored_example(dictionary, *([sea] if sea else []))
    names = vessel({"model-ship": "model-ship", "standard": "azimuth-30m"}[dictionary]).model.names
    problem = build_durations(items, names, total_s=total_s)
    design = solve_durations(problem)
    here, swaps = information(problem, design.repeats), 0
    for out, into in product(range(len(items)), repeat=2):
        runs = np.array(design.repeats)
        runs[out] -= 1
        runs[into] += 1
        if runs.min() >= 0 and runs @ problem.run_s <= total_s + 1e-9:
            assert information(problem, tuple(runs)) <= here + 1e-8
            swaps += 1
    assert swaps > len(items)


def test_given_repeats_are_measured_against_the_same_optimum():
    problem = small_problem(3, equal=True)
    design = solve_durations(problem)
    again = with_repeats(design, design.repeats)
    assert again.efficiency_repeats == design.efficiency_repeats
    halved = with_repeats(design, tuple(2 * n for n in design.repeats))
    assert halved.efficiency_repeats == pytest.approx(2 * design.efficiency_repeats)
    with pytest.raises(NotInformative, match="do not inform about every parameter"):
        with_repeats(design, (0,) * len(problem.names))


def test_a_problem_without_information_about_a_parameter_has_no_answer():
    with pytest.raises(NotInformative, match="do not inform about every parameter") as caught:
        solve_durations(duration_problem([np.diag([1.0, 0.0]), np.diag([2.0, 0.0])]))
    assert one_line(caught.value)


@pytest.mark.parametrize("draw", range(12))
def test_runs_that_lack_something_get_what_they_lack_within_the_limits(draw: int):
    """Some runs of one primitive are asked for; others give way to them where the time is full."""
    rng = np.random.default_rng(400 + draw)
    problem = small_problem(draw, equal=bool(draw % 2))
    fractions = rng.dirichlet(np.ones(len(problem.run_s)))
    search = _Search.of(problem, fractions)
    short = int(np.argmin(problem.run_s))
    asked = int(problem.total_s / problem.run_s[short] / 2.0)

    def shortfall(shares: Array) -> float:
        return max(0.0, asked * search.shares[short] - float(shares[short]) - 1e-12)

    begun = search.filled_up(np.where(np.arange(len(fractions)) == short, 0, search.rounded(fractions)))
    begun = np.where(np.arange(len(fractions)) == short, 0, begun)
    found = _completed(search, begun, shortfall)
    assert shortfall(begun * search.shares) > 0.0
    assert found[short] == asked
    assert search.allowed(found)
    assert _completed(search, found, shortfall) is found


@pytest.mark.parametrize("draw", range(12))
def test_time_that_is_left_is_filled_by_the_run_that_gains_most_a_second(draw: int):
    problem = small_problem(draw, equal=False)
    search = _Search.of(problem, np.full(len(problem.run_s), 1.0 / len(problem.run_s)))
    runs = np.zeros(len(problem.run_s), dtype=int)
    units = np.eye(len(runs), dtype=int)
    while allowed := [q for q in range(len(runs)) if search.allowed(runs + units[q])]:
        gains = [(search.value_of(runs + units[q]) - search.value_of(runs)) / problem.run_s[q] for q in allowed]
        runs = runs + units[allowed[int(np.argmax(gains))]]
    assert search.filled_up(np.zeros(len(runs), dtype=int)).tolist() == runs.tolist()


def test_regressors_that_merge_are_told_of_the_shares_that_whole_runs_take(monkeypatch: pytest.MonkeyPatch):
    problem = duration_problem(np.tile(np.eye(2), (3, 1, 1)), run_s=[20.0, 30.0, 50.0], total_s=200.0)
    asked: list[Array] = []
    monkeypatch.setattr(rounding, "merged_nuisance", lambda _, shares: asked.append(shares) or [("one", "other")])
    told = rounding.note_on_runs(
        SimpleNamespace(nuisance=True, run_s=problem.run_s, total_s=200.0), np.array([2, 1, 2])
    )
    assert asked[0] == pytest.approx([0.2, 0.15, 0.5])
    assert told.endswith("the estimator merges them: one with other")
