"""Durations keep a least information about other parameters: closed forms, a grid, refusals, whole runs."""

from dataclasses import replace

import numpy as np
import pytest

from expdesign.durations import Aim, DurationProblem, InformationFloor, limits_kept, optimal_shares, solve_durations
from expdesign.durations.certificate import certify
from expdesign.durations.solve import concave_problem
from expdesign.errors import FloorOutOfReach, NoAnswer


def floor(least: float, *, matrices=None, prior=None, L=None, name: str = "power of lag") -> InformationFloor:
    """Information about one number: 1 if all time goes to the second primitive, nothing else."""
    matrices = np.array([[[0.0]], [[1.0]], [[0.0]]]) if matrices is None else matrices
    d = matrices.shape[1]
    return InformationFloor(
        name=name,
        matrices=matrices,
        prior=np.zeros((d, d)) if prior is None else prior,
        L=np.eye(d)[:, -1:] if L is None else L,
        least=least,
    )


def problem(*floors: InformationFloor) -> DurationProblem:
    """Two parameters; the first and the third primitive each tell about one, the second little about both."""
    matrices = np.array([np.diag([1.0, 0.0]), 0.1 * np.eye(2), np.diag([0.0, 1.0])])
    return DurationProblem(
        names=("a", "b", "c"),
        parameters=("x", "y"),
        mean_subtraction="none",
        matrices=matrices,
        run_s=np.array([10.0, 10.0, 10.0]),
        total_s=1000.0,
        floors=floors,
    )


def random_floor(rng: np.random.Generator, least: float) -> InformationFloor:
    """Two combinations beside two nuisance parameters with a prior."""
    rows = rng.standard_normal((3, 6, 4))
    return floor(
        least, matrices=np.swapaxes(rows, 1, 2) @ rows, prior=np.diag([1.0, 1.0, 0.0, 0.0]), L=np.eye(4)[:, 2:]
    )


def information(item: InformationFloor, w: np.ndarray) -> float:
    M = item.prior + np.tensordot(w, item.matrices, axes=1)
    return float(1.0 / np.trace(item.L.T @ np.linalg.inv(M) @ item.L))


def test_the_share_of_a_primitive_that_alone_tells_is_what_is_asked():
    for least in (0.05, 0.3, 0.7):
        found = optimal_shares(problem(floor(least)))
        assert found.fractions == pytest.approx([(1 - least) / 2, least, (1 - least) / 2], abs=1e-6)
        assert found.gap < 1e-6
        assert found.certificate.multipliers["power of lag"] > 0
    free = optimal_shares(problem())
    assert free.fractions == pytest.approx([0.5, 0.0, 0.5], abs=1e-6)


def test_the_optimum_is_the_best_of_a_grid_and_certified_from_the_problem_alone():
    rng, step = np.random.default_rng(5), 1.0 / 60
    grid = [np.array([i, j, 60 - i - j]) * step for i in range(61) for j in range(61 - i)]
    for _ in range(3):
        asked = random_floor(rng, 1.0)
        most = max(information(asked, w) for w in grid)
        asked = replace(asked, least=0.8 * most)
        task = problem(asked)
        found = optimal_shares(task)
        assert information(asked, found.fractions) >= 0.8 * most * (1 - 1e-5)
        best = max(
            np.linalg.slogdet(np.tensordot(w, task.matrices, axes=1))[1]
            for w in grid
            if information(asked, w) >= 0.8 * most
        )
        assert best <= found.log_det_bound + 1e-9
        assert found.log_det <= best + 0.2  # the grid is coarse
        again, _ = certify(concave_problem(task), found.fractions, kind="")
        assert again.gap < 1e-5


def test_what_cannot_be_reached_is_named_with_the_most_that_can():
    with pytest.raises(FloorOutOfReach, match="power of lag") as refused:
        optimal_shares(problem(floor(1.5)))
    assert refused.value.share == pytest.approx(1.0 / 1.5, rel=1e-5)
    dark = floor(1.0, matrices=np.zeros((3, 1, 1)))
    with pytest.raises(FloorOutOfReach) as refused:
        optimal_shares(problem(dark))
    assert refused.value.share == 0.0
    other = floor(0.8, matrices=np.array([[[1.0]], [[0.0]], [[0.0]]]), name="power of wind")
    with pytest.raises(NoAnswer, match="together, though each alone"):
        optimal_shares(problem(floor(0.8), other))


def test_whole_runs_keep_it_too():
    asked = floor(0.333)
    found = solve_durations(problem(asked))
    shares = np.array(found.repeats) * 10.0 / 1000.0
    assert shares.sum() <= 1.0 + 1e-9
    assert information(asked, shares) >= 0.333 * (1 - 1e-6)
    (kept,) = limits_kept(found)
    assert (kept.name, kept.limit) == ("power of lag", 0.333)
    assert kept.continuous == pytest.approx(0.333, rel=1e-5)
    assert kept.repeats == pytest.approx(information(asked, shares))


def test_criterion_t_shares_time_by_what_each_cause_needs():
    """Each of two primitives alone tells of one effect: their times are as what is asked for."""
    other = floor(0.6, matrices=np.array([[[1.0]], [[0.0]], [[0.0]]]), name="power of wind")
    found = solve_durations(replace(problem(floor(0.3), other), aim=Aim(criterion="T")))
    assert found.fractions == pytest.approx([2 / 3, 1 / 3, 0.0], abs=1e-6)
    assert found.gap < 1e-6
    assert np.array(found.repeats) * 10.0 == pytest.approx([670.0, 330.0, 0.0], abs=11.0)
    assert [item.continuous / item.limit for item in limits_kept(found)] == pytest.approx([10 / 9, 10 / 9], rel=1e-5)


def test_criterion_t_is_the_best_of_a_grid_within_its_certificate():
    rng, step = np.random.default_rng(8), 1.0 / 60
    grid = [np.array([i, j, 60 - i - j]) * step for i in range(61) for j in range(61 - i)]
    for _ in range(3):
        floors = [replace(random_floor(rng, 1.0), name=name) for name in ("one", "two")]
        found = optimal_shares(replace(problem(*floors), aim=Aim(criterion="T")))

        def worst(w: np.ndarray, floors: list[InformationFloor] = floors) -> float:
            return float(np.log(min(information(item, w) for item in floors)))

        best = max(worst(w) for w in grid)
        assert found.certificate.value == pytest.approx(worst(found.fractions), abs=1e-6)
        assert best <= found.certificate.bound + 1e-9
        assert best <= found.certificate.value + 1e-5
        assert found.certificate.value <= best + 0.05  # the grid is coarse
