"""A fixed piece of the kind of work that plans consist of, by which processor seconds of machines can be compared.

``python tests/benchmarks/baseline.py`` prints the processor seconds of both halves, the best of three: dense linear
algebra of small matrices in NumPy, and the shortest time of a double integrator from rest to rest in CasADi and IPOPT.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import casadi
import numpy as np

STEPS = 60  # intervals of the transfer


@dataclass(frozen=True)
class Baseline:
    """Processor seconds of both halves."""

    numpy_s: float
    ipopt_s: float

    @property
    def total_s(self) -> float:
        """Of the whole."""
        return self.numpy_s + self.ipopt_s


def measured_baseline() -> Baseline:
    """The baseline of this machine now."""
    return Baseline(numpy_s=_best_s(numpy_loop), ipopt_s=_best_s(ipopt_transfers))


def numpy_loop(rounds: int = 6000) -> float:
    """Norm of the solution of x = A x + b by products and by elimination, again and again: they agree."""
    rng = np.random.default_rng(0)
    matrix, right = rng.normal(size=(48, 48)) / 100.0, rng.normal(size=(48, 6))
    for _ in range(rounds):
        summed = term = right
        for _ in range(20):
            term = matrix @ term
            summed = summed + term
        solved = np.linalg.solve(np.eye(48) - matrix, right)
        assert np.allclose(summed, solved)
    return float(np.linalg.norm(solved))


def ipopt_transfers(times: int = 96) -> float:
    """Least time over distance 1 with acceleration up to 1, which is 2."""
    controls, duration = casadi.SX.sym("u", STEPS), casadi.SX.sym("T")
    states = casadi.SX.sym("x", 2, STEPS + 1)
    step = duration / STEPS
    gaps = [
        states[:, k + 1]
        - casadi.vertcat(
            states[0, k] + step * states[1, k] + step**2 / 2 * controls[k], states[1, k] + step * controls[k]
        )
        for k in range(STEPS)
    ]
    ends = [states[:, 0], states[:, -1] - casadi.vertcat(1.0, 0.0)]
    unknown = casadi.vertcat(duration, controls, casadi.vec(states))
    program = {"x": unknown, "f": duration, "g": casadi.vertcat(*gaps, *ends)}
    solver = casadi.nlpsol(
        "transfer", "ipopt", program, {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
    )
    low = np.r_[0.1, np.full(STEPS, -1.0), np.full(2 * (STEPS + 1), -np.inf)]
    high = np.r_[10.0, np.full(STEPS, 1.0), np.full(2 * (STEPS + 1), np.inf)]
    for number in range(times):
        guess = np.r_[3.0 + 0.01 * number, np.zeros(3 * STEPS + 2)]
        shortest = float(solver(x0=guess, lbx=low, ubx=high, lbg=0.0, ubg=0.0)["f"])
        assert abs(shortest - 2.0) < 1e-4
    return shortest


def _best_s(work: Callable[[], float]) -> float:
    """Processor seconds, the least of three."""
    times = []
    for _ in range(3):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


if __name__ == "__main__":
    found = measured_baseline()
    print(f"NumPy {found.numpy_s:.2f} s, IPOPT {found.ipopt_s:.2f} s")
