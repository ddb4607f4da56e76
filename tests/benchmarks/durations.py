"""Speed of the durations beside other solvers: many candidates, every criterion under limits, and scoring.

Run with ``python tests/benchmarks/durations.py``. What counts is the ratio of processor times in one run, all on one
thread; gaps are relative to the dimension. Baselines that take too long are stopped; their ratio is then "at least".
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")  # read on import of NumPy
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import cvxpy
import numpy as np
from scipy.optimize import minimize

from design_case import CALM, WIND, duration_problem, example_dictionary, random_matrices, vessel
from expdesign.durations import (
    Aim,
    Budget,
    Constraints,
    DurationProblem,
    d_optimal,
    log_det,
    optimal_shares,
    scaled,
    sensitivities,
)
from expdesign.information import score_primitives
from expdesign.signals import Commands
from expdesign.values import Array

COUNT, PARAMETERS, OUTPUTS = 1000, 18, 3
PATIENCE_S = 20.0
"""Baselines are stopped after this time."""


def main() -> None:
    many_candidates()
    dense_candidates()
    every_criterion()
    scoring()


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
            begun = time.perf_counter()
            try:
                design = optimal_shares(problem)
                found = f"gap {design.gap_relative:.1e}"
            except Exception as error:
                found = f"{type(error).__name__}: {error}"
            print(f"{count:4d} candidates, {what:>26}: {time.perf_counter() - begun:6.2f} s   {found}", flush=True)


def variants(count: int) -> Iterator[tuple[str, DurationProblem]]:
    """(what, problem)."""
    rng = np.random.default_rng(count)
    stacks = [random_matrices(rng, count=count, parameters=18, outputs=3, samples=12) for _ in range(5)]
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
    main()
