"""Speed of the durations: the examples, growth with candidates, every criterion under limits, other solvers, scoring.

Run with ``python tests/benchmarks/durations.py [PART ...] [--most N]``, by default all parts, and growth up to 10,000
candidates. What counts is the ratio of processor times in one run, all on one
thread; gaps are relative to the dimension. Baselines that take too long are stopped; their ratio is then "at least".
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")  # read on import of NumPy
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import cvxpy
import numpy as np
from scipy.optimize import minimize

from design_case import CALM, WIND, duration_problem, example_dictionary, random_matrices, sensitivities, vessel
from expdesign.durations import (
    Aim,
    Budget,
    Constraints,
    DurationProblem,
    d_optimal,
    efficiencies,
    log_det,
    optimal_shares,
    scaled,
    solve_durations,
)
from expdesign.durations.maximise import _by_cvxpy, maximised
from expdesign.durations.solve import concave_problem
from expdesign.information import score_primitives
from expdesign.progress import silent
from expdesign.signals import Commands
from expdesign.values import Array
from expdesign.workflows.steps.case import loaded
from expdesign.workflows.steps.design_problem import duration_problem as stated_problem
from expdesign.workflows.steps.scored import ready

COUNT, PARAMETERS, OUTPUTS = 1000, 18, 3
PATIENCE_S = 20.0  # baselines are stopped after this time


EXAMPLES = ("helsinki", "story", "harbour", "narrows", "coaster", "model-ship", "fast-boat-designed", "roll-trial")
GROWTH = (10, 30, 100, 300, 1000, 3000, 10000)
LOADING = "import time, scipy.optimize; t, c = time.perf_counter(), time.process_time(); import cvxpy; "
LOADING += "print(time.perf_counter() - t, time.process_time() - c)"


def examples() -> None:
    """The durations of the examples: the problem as stated to cvxpy, polished, beside the quickest method."""
    times = np.array(
        [
            subprocess.run([sys.executable, "-c", LOADING], check=True, capture_output=True, text=True).stdout.split()
            for _ in range(3)
        ],
        dtype=float,
    ).min(axis=0)
    print(f"loading cvxpy once: {times[0]:.2f} s, processor {times[1]:.2f} s")
    print("| scenario | candidates | cvxpy | gap | quickest | gap | times as long | whole step | comparing criteria |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in EXAMPLES:
        case = loaded(Path(__file__).parents[2] / "scenarios" / f"{name}.toml", silent)
        problem = stated_problem(case, ready(case, seed=0, progress=silent)[0], seed=0)
        row = compared(problem)
        step, design = cost(partial(solve_durations, problem))
        comparing, _ = cost(partial(efficiencies, design))
        print(f"| {name} | {row} | {step:.2f} s | {comparing:.2f} s |", flush=True)


def growth(most: int = GROWTH[-1]) -> None:
    """The same with the number of candidates; cvxpy also beyond the number up to which it is asked."""
    print("| criterion | candidates | cvxpy | gap | quickest | gap | times as long |")
    print("|---|---|---|---|---|---|---|")
    for count in (count for count in GROWTH if count <= most):
        chosen = dict(variants(count, samples=12 if count > 10 else 60))
        for what in (
            "D, no limits",
            "A, no limits",
            "D, limits and budgets",
            "E, no limits",
            "D, average of 5, limits",
        ):
            if count <= 1000 or "average" not in what:
                print(f"| {what} | {compared(chosen[what])} |", flush=True)


def compared(problem: DurationProblem) -> str:
    """Columns of a table: candidates, seconds of processor and gap of both, and their ratio."""
    task = concave_problem(problem)
    theirs_s, theirs = cost(partial(_by_cvxpy, task, ""))
    own_s, own = cost(partial(maximised, task))
    gap = f"{max(theirs.gap, 0.0):.0e}" if theirs else "no answer"
    return (
        f"{len(problem.names)} | {theirs_s:.3f} s | {gap} | {own_s:.3f} s | {max(own.gap, 0.0):.0e} | "
        f"{theirs_s / max(own_s, 1e-6):.1f}"
    )


def cost(work: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of processor, and the result."""
    begun = time.process_time()
    result = work()
    return time.process_time() - begun, result


def many_candidates() -> None:
    """One regressor row for each candidate, D without limits, beside the multiplicative algorithm in NumPy."""
    for count in (10**5, 10**6):
        rows = np.random.default_rng(count).standard_normal((count, PARAMETERS))
        begun, started = time.perf_counter(), time.process_time()
        design = d_optimal(rows, tolerance=1e-7)
        wall, mine = time.perf_counter() - begun, time.process_time() - started
        print(f"{count} candidates, {PARAMETERS} parameters: {wall:.2f} s, processor {mine:.2f} s, "
              f"gap {row_gap(rows, design.fractions):.1e}")  # fmt: skip
        begun = time.process_time()
        w = multiplicative(rows, 1e-6)
        taken = time.process_time() - begun
        print(f"    multiplicative algorithm: {taken / mine:.1f} times as long, gap {row_gap(rows, w):.1e}", flush=True)


def row_gap(rows: Array, w: Array) -> float:
    """Gap per parameter of the D-optimal design with rows (q, p), from the rows alone."""
    used = w > 0
    inverse = np.linalg.inv((rows[used].T * w[used]) @ rows[used])
    return float(np.einsum("qi,ij,qj->q", rows, inverse, rows, optimize=True).max()) / rows.shape[1] - 1.0


def multiplicative(rows: Array, tolerance: float) -> Array:
    """S. D. Silvey, D. M. Titterington and B. Torsney (1978): w_q <- w_q d_q / p, until the gap or the time is up."""
    ends, w = time.process_time() + PATIENCE_S, np.full(len(rows), 1.0 / len(rows))
    while time.process_time() < ends:
        factor = np.linalg.inv(np.linalg.cholesky((rows.T * w) @ rows))
        d = np.sum((rows @ factor.T) ** 2, axis=1) / rows.shape[1]
        if d.max() < 1 + tolerance:
            break
        w = w * d
    return w


def dense_candidates() -> None:
    """Information matrices of rank 12 and three means, D without limits."""
    draw = np.random.default_rng(COUNT)
    matrices, _ = scaled(random_matrices(draw, count=COUNT, parameters=PARAMETERS, outputs=OUTPUTS, samples=12))
    own(matrices[:50])  # first use loads and warms
    mine = min(timed("own", own, matrices) for _ in range(3))
    for name, solve in (("SLSQP, exact gradients", slsqp), ("cvxpy, default solver", by_cvxpy)):
        print(f"{timed(name, solve, matrices) / mine:31.1f} times as long")


def timed(what: str, solve: Callable[[Array], Array], matrices: Array) -> float:
    begun = time.process_time()
    w = solve(matrices)
    taken = time.process_time() - begun
    w = np.clip(w, 0.0, None) / np.clip(w, 0.0, None).sum()
    gap = float(sensitivities(matrices, w).max()) / matrices.shape[1] - 1.0
    print(f"{what:>28}: {taken:8.3f} s   gap {gap:.1e}", flush=True)
    return taken


def own(matrices: Array) -> Array:
    return np.asarray(optimal_shares(duration_problem(matrices, means=OUTPUTS)).fractions)


def slsqp(matrices: Array) -> Array:
    count, ends = len(matrices), time.process_time() + PATIENCE_S
    best = [np.full(count, 1.0 / count)]

    def minus(w: Array) -> float:
        if time.process_time() > ends:
            raise TimeoutError
        if log_det(matrices, np.clip(w, 0, None)) > log_det(matrices, best[0]):
            best[0] = np.array(w)
        return -log_det(matrices, w)

    with contextlib.suppress(TimeoutError):
        minimize(
            minus,
            best[0],
            jac=lambda w: -sensitivities(matrices, w),
            method="SLSQP",
            bounds=[(0.0, 1.0)] * count,
            constraints=[{"type": "eq", "fun": lambda w: w.sum() - 1.0, "jac": lambda w: np.ones(count)}],
            options={"maxiter": 300, "ftol": 1e-9},
        )
    return best[0]


def by_cvxpy(matrices: Array) -> Array:
    count, size = matrices.shape[:2]
    w = cvxpy.Variable(count, nonneg=True)
    total = cvxpy.reshape(matrices.reshape(count, size * size).T @ w, (size, size), order="C")
    cvxpy.Problem(cvxpy.Maximize(cvxpy.log_det((total + total.T) / 2)), [cvxpy.sum(w) == 1]).solve()
    return np.asarray(w.value)


def every_criterion() -> None:
    """Each criterion with limits, budgets, balance, prior or several models, 18 parameters and three means."""
    for count in (25, 100, 300):
        for what, problem in variants(count):
            for how, solve in (("quickest", optimal_shares), ("as written", solve_durations)):
                begun = time.perf_counter()
                try:
                    design = solve(problem)
                    found = f"gap {design.gap_relative:.1e} by {design.solver.name if design.solver else ''}"
                except Exception as error:
                    found = f"{type(error).__name__}: {error}"
                taken = time.perf_counter() - begun
                print(f"{count:4d} candidates, {what:>26}, {how:>10}: {taken:6.2f} s   {found}", flush=True)


def variants(count: int, samples: int = 12) -> Iterator[tuple[str, DurationProblem]]:
    """(what, problem)."""
    rng = np.random.default_rng(count)
    stacks = [random_matrices(rng, count=count, parameters=18, outputs=3, samples=samples) for _ in range(5)]
    plain = duration_problem(stacks[0], means=3, run_s=60.0, total_s=3600.0)
    plain = replace(plain, equations=("u", "v", "r") * 6)
    names, ones = plain.names, np.ones(18)
    limits = Constraints(
        least_s={names[0]: 60.0},
        most_s={names[1]: 90.0, names[2]: 90.0},
        budgets=tuple(
            Budget(
                name=name, cost_per_s=dict(zip(names, rng.uniform(1, 9, count).tolist(), strict=True)), limit=14400.0
            )
            for name in ("energy", "wear")
        ),
    )
    aims = {
        "D": Aim(),
        "D_s": Aim(criterion="D_s", interest=plain.parameters[:6]),
        "A": Aim(criterion="A", unit=ones, noise=ones),
        "E": Aim(criterion="E", unit=ones, noise=ones),
        "V": Aim(criterion="V", noise=ones, outcomes=("a", "b"), gradients=rng.standard_normal((2, 18))),
    }
    for name, aim in aims.items():
        yield f"{name}, no limits", replace(plain, aim=aim)
        yield f"{name}, limits and budgets", replace(plain, aim=aim, constraints=limits)
    yield "D, balance", replace(plain, constraints=replace(limits, budgets=(), balance=0.6))
    yield "D, prior and limits", replace(plain, constraints=limits, prior=0.1 * np.eye(plain.dimension))
    for robust in ("average", "worst"):
        yield f"D, {robust} of 5, limits", replace(plain, robust=robust, sampled=np.array(stacks), constraints=limits)


def scoring() -> None:
    """1000 runs of 300 samples."""
    ship, primitive = vessel("azimuth-30m"), example_dictionary("standard")[3]
    values = np.concatenate([primitive.commands.values] * 2)[:300]
    runs = [
        replace(primitive, commands=Commands(sample_time_s=1.0, names=primitive.commands.names, values=x * values))
        for x in np.linspace(0.95, 1.05, COUNT)
    ]
    for what, sea in (("calm", CALM), ("wind, eight headings", WIND)):
        begun = time.process_time()
        score_primitives(ship, runs, environment=sea)
        print(f"scoring {COUNT} runs of 300 samples, {what}: {time.process_time() - begun:.2f} s")


if __name__ == "__main__":
    parts = {
        part.__name__: part for part in (examples, growth, many_candidates, dense_candidates, every_criterion, scoring)
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", default=[*parts], choices=[*parts])
    parser.add_argument("--most", type=int, default=GROWTH[-1], help="candidates, in the growth with their number")
    asked = parser.parse_args()
    for name in asked.parts:
        parts[name](*([asked.most] if name == "growth" else []))
