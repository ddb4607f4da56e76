"""Speed of the durations: the certified optimum of 1000 candidates, 18 parameters and 3 means, beside other solvers.

Run with ``python tests/benchmarks/durations.py``. What counts is the ratio of processor times in one run; certificates
are relative to the dimension. Sequential quadratic programming, with exact gradients, is stopped when it takes too
long; cvxpy stops at its default solver's own, looser, tolerance. Scoring is timed for 1000 runs of 300 samples.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import cvxpy
import numpy as np
from scipy.optimize import minimize

from design_case import CALM, WIND, duration_problem, example_dictionary, random_matrices, vessel
from expdesign.durations import log_det, optimal_shares, sensitivities
from expdesign.durations.certificate import scaled
from expdesign.information import score_primitives
from expdesign.signals import Commands
from expdesign.values import Array

COUNT, PARAMETERS, OUTPUTS = 1000, 18, 3
PATIENCE_S = 30.0
"""Sequential quadratic programming is stopped after this time; its ratio is then "at least"."""


def gap(matrices: Array, w: Array) -> float:
    w = np.clip(w, 0.0, None) / np.clip(w, 0.0, None).sum()
    return float(sensitivities(matrices, w).max()) / matrices.shape[1] - 1.0


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
        _minimised(matrices, minus)
    return best[0]


def _minimised(matrices: Array, minus: Callable[[Array], float]) -> None:
    count = len(matrices)
    minimize(
        minus,
        np.full(count, 1.0 / count),
        jac=lambda w: -sensitivities(matrices, w),
        method="SLSQP",
        bounds=[(0.0, 1.0)] * count,
        constraints=[{"type": "eq", "fun": lambda w: w.sum() - 1.0, "jac": lambda w: np.ones(count)}],
        options={"maxiter": 300, "ftol": 1e-9},
    )


def by_cvxpy(matrices: Array) -> Array:
    count, size = matrices.shape[:2]
    w = cvxpy.Variable(count, nonneg=True)
    total = cvxpy.reshape(matrices.reshape(count, size * size).T @ w, (size, size), order="C")
    cvxpy.Problem(cvxpy.Maximize(cvxpy.log_det((total + total.T) / 2)), [cvxpy.sum(w) == 1]).solve()
    return np.asarray(w.value)


def timed(what: str, solve: object, matrices: Array) -> float:
    begun = time.process_time()
    w = solve(matrices)  # type: ignore[operator]
    taken = time.process_time() - begun
    print(f"{what:>28}: {taken:8.3f} s   certificate {gap(matrices, w):.1e}", flush=True)
    return taken


def main() -> None:
    draw = np.random.default_rng(COUNT)
    matrices, _ = scaled(random_matrices(draw, count=COUNT, parameters=PARAMETERS, outputs=OUTPUTS, samples=12))
    own(matrices[:50])  # first use loads and warms
    mine = min(timed("own", own, matrices) for _ in range(3))
    for name, solve in (("SLSQP, exact gradients", slsqp), ("cvxpy, default solver", by_cvxpy)):
        print(f"{timed(name, solve, matrices) / mine:31.1f} times as long")
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
