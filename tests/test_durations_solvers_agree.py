"""The problem as stated to cvxpy, the quickest method and working sets find the same optimum, by each other's proof."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest

from design_case import duration_problem, random_matrices
from expdesign.durations import (
    Aim,
    Budget,
    Constraints,
    DurationProblem,
    InformationFloor,
    maximise,
    optimal_shares,
    solve_durations,
)
from expdesign.durations.maximise import CVXPY, LARGEST_GAP, NEWTON, TARGET_GAP, WORKING_SET, Optimum, maximised
from expdesign.durations.solve import concave_problem
from expdesign.errors import NoAnswer

P, MEANS, ROUNDING = 5, 2, 1e-9


def cases(count: int, draw: int = 0, *, models: int = 3) -> Iterator[tuple[str, DurationProblem]]:
    """Every criterion with every kind of limit, prior and set of models."""
    rng = np.random.default_rng(draw)
    stacks = [random_matrices(rng, count=count, parameters=P, outputs=MEANS, samples=P + 2) for _ in range(models)]
    plain = duration_problem(stacks[0], means=MEANS, run_s=10.0, total_s=1000.0)
    plain = replace(plain, equations=("u", "v", "u", "v", "u"))
    names, told = plain.names, rng.standard_normal((count, 6, 3))
    floor = InformationFloor(
        name="power of lag", matrices=np.swapaxes(told, 1, 2) @ told, prior=np.eye(3), L=np.eye(3)[:, 2:], least=1.0
    )
    floor = replace(floor, least=0.8 * _most(plain, floor))
    costs = dict(zip(names, rng.uniform(1, 9, count).tolist(), strict=True))
    limits = {
        "no limits": Constraints(),
        "least times": Constraints(least_s={names[0]: 60.0}, required=(names[3],), excluded=(names[4],)),
        "most times": Constraints(most_s=dict.fromkeys(names, 5000.0 / count)),
        "a budget": Constraints(budgets=(Budget(name="energy", cost_per_s=costs, limit=2200.0),)),
        "all limits": Constraints(
            least_s={names[0]: 60.0},
            most_s=dict.fromkeys(names[1:3], 30.0),
            excluded=(names[4],),
            budgets=tuple(Budget(name=name, cost_per_s=costs, limit=2500.0 + i) for i, name in enumerate("ab")),
        ),
        "balance": Constraints(balance=0.6),
    }
    unit, noise = rng.uniform(0.1, 10, P), rng.uniform(0.1, 1, P)
    stated = {"unit": unit, "noise": noise, "outcomes": ("a", "b"), "gradients": rng.standard_normal((2, P))}
    for criterion in ("D", "D_s", "A", "E", "V"):
        aim = Aim(criterion=criterion, interest=plain.parameters[:2] if criterion == "D_s" else (), **stated)
        for what, constraints in limits.items():
            given = replace(plain, aim=aim, constraints=constraints)
            yield f"{criterion}, {what}", given
        yield f"{criterion}, least information", replace(plain, aim=aim, floors=(floor,))
        yield f"{criterion}, prior", replace(plain, aim=aim, prior=0.1 * np.eye(P + MEANS))
        for robust in ("average", "worst"):
            yield f"{criterion}, {robust}", replace(plain, aim=aim, robust=robust, sampled=np.array(stacks))
    yield "T", replace(plain, aim=Aim(criterion="T"), floors=(floor, replace(floor, name="gain", L=np.eye(3)[:, :1])))


def _most(problem: DurationProblem, floor: InformationFloor) -> float:
    """The most information of its kind."""
    found = maximised(concave_problem(replace(problem, aim=Aim(criterion="T"), floors=(floor,))))
    return float(np.exp(found.certificate.value)) * floor.least


FEW, MANY = dict(cases(25)), dict(cases(60, 1))
OFTEN = ("A, a budget", "A, least information", "D_s, all limits", "D_s, worst", "E, balance", "E, average", "T",
         "V, most times", "V, prior")  # fmt: skip
"""With everything of criterion D; the other pairs are tried with the slow tests."""
CASES = [case if case in OFTEN or case.startswith("D,") else pytest.param(case, marks=pytest.mark.slow) for case in FEW]


def check_agreement(one: Optimum, other: Optimum) -> None:
    """Neither is better than the other's bound: the gaps alone say how far they may differ."""
    for here, there in ((one, other), (other, one)):
        degree = here.certificate.degree
        assert here.gap < LARGEST_GAP
        assert here.certificate.value <= there.certificate.value + degree * max(there.gap, 0.0) + ROUNDING


@pytest.mark.parametrize("case", CASES)
def test_cvxpy_and_the_quickest_method_agree(case: str):
    task = concave_problem(FEW[case])
    stated, own = maximised(task, as_stated=True), maximised(task)
    check_agreement(stated, own)
    assert stated.method == CVXPY
    if task.smooth:
        assert own.method in (NEWTON, WORKING_SET)
        assert stated.gap < TARGET_GAP
        np.testing.assert_allclose(stated.fractions, own.fractions, atol=1e-4)
    assert (task.polytope.rows @ stated.fractions <= task.polytope.limits + (1e-12 if task.smooth else 1e-8)).all()


@pytest.mark.parametrize("case", CASES)
def test_working_sets_agree_with_all_candidates_at_once(case: str, monkeypatch):
    task = concave_problem(MANY[case])
    whole = maximised(task, as_stated=True)
    monkeypatch.setattr(maximise, "CONIC_CANDIDATES", 20)
    few = maximised(task, as_stated=True)
    check_agreement(few, whole)
    assert few.method == WORKING_SET
    assert whole.method == CVXPY or not task.smooth  # of which the answer with more digits is taken


@pytest.mark.thorough
def test_thousands_of_candidates_are_solved_a_few_at_a_time_under_any_limits(monkeypatch):
    asked = []
    newton = maximise._by_newton
    monkeypatch.setattr(maximise, "_by_newton", lambda part, kind: asked.append(part) or newton(part, kind))
    chosen = ("A, all limits", "D, average", "V, least information", "D, balance", "D_s, most times")
    for case, given in cases(1500, models=2):
        if case in chosen:
            assert maximised(concave_problem(given), as_stated=True).gap < ROUNDING
    assert len(asked) >= len(chosen)
    assert max(len(part.polytope.least) for part in asked) < 750


@pytest.mark.thorough
def test_floors_beyond_reach_are_refused_however_many_candidates_there_are():
    for given in (FEW["D, least information"], dict(cases(1000, models=1))["D, least information"]):
        (floor,) = given.floors
        with pytest.raises(NoAnswer, match="power of lag"):
            solve_durations(replace(given, floors=(replace(floor, least=1.5 * floor.least),)))


def test_the_durations_name_what_found_them():
    given = FEW["D, no limits"]
    found, quick = solve_durations(given).solver, optimal_shares(given).solver
    assert found is not None
    assert quick is not None
    assert (found.name, found.versions) == (CVXPY, {name: version(name) for name in ("cvxpy", "clarabel")})
    assert quick.name == WORKING_SET
    assert 0 < found.wall_s < 60


IMPORTED_WHEN_USED = """
import importlib, pkgutil, sys
import numpy as np
import expdesign
for module in pkgutil.walk_packages(expdesign.__path__, "expdesign."):
    if not module.name.rpartition(".")[2].startswith("_"):
        importlib.import_module(module.name)
from expdesign.durations import DurationProblem, optimal_shares, solve_durations
matrices = np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])
problem = DurationProblem(
    names=("a", "b"), parameters=("x", "y"), mean_subtraction="none", matrices=matrices, run_s=np.ones(2), total_s=4.0
)
assert optimal_shares(problem).repeats == (0, 0)
assert "cvxpy" not in sys.modules
assert solve_durations(problem).repeats == (2, 2)
assert "cvxpy" in sys.modules
"""


@pytest.mark.thorough
def test_only_final_durations_load_cvxpy():
    """No module does when it is imported, nor does D without limits where it is solved only to compare."""
    subprocess.run([sys.executable, "-c", IMPORTED_WHEN_USED], check=True)


@pytest.mark.parametrize("criterion", ["D", "A", "E"])
def test_problems_of_many_parameters_are_left_to_the_quickest_method(
    criterion: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The conic solver's work grows by about their sixth power; a twin-screw ship's 44 took it 14 s. E has no other."""
    size = P + MEANS
    monkeypatch.setattr(maximise, "CONIC_PARAMETERS", size)
    task = concave_problem(FEW[f"{criterion}, prior"])
    stated = maximised(task, as_stated=True)
    monkeypatch.setattr(maximise, "CONIC_PARAMETERS", size - 1)
    found = maximised(task, as_stated=True)
    assert stated.method == CVXPY
    assert (found.method == CVXPY) == (criterion == "E")
    assert max(stated.gap, found.gap) < LARGEST_GAP
    assert found.certificate.value == pytest.approx(stated.certificate.value, abs=2 * size * LARGEST_GAP)
