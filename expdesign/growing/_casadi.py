"""Optimal control with CasADi: commands that maximise a linear functional of a run's information.

Multiple shooting with one interval per sample. The solver's status is not used: the caller simulates the commands
exactly, checks the limits, and uses them only if they are more informative.

Source: H. G. Bock and K. J. Plitt, A multiple shooting algorithm for direct solution of optimal control problems, IFAC
Proc. Vol. 17(2) (1984), 1603-1608; A. Waechter and L. T. Biegler, IPOPT, Math. Program. 106 (2006), 25-57.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from expdesign.simulation import motion_rates, rk4_step
from expdesign.values import Array, sealed
from expdesign.vessel import Operators, Vessel

ITERATIONS = 300  # most iterations of the optimal control solver
MARGIN = 0.005  # share of each range kept from the limits, for the solver's integration error
MODULUS_ROUNDING = 1e-3  # moduli are smoothed within this share of a signal's size
END_MOTION = 1e-3  # share of their ranges that sway and yaw rate may have at the end
CALMNESS = 1e-4  # weight of the squared changes of commands, relative to the initial sensitivity


@sealed(gradient="d d", limits="3 2", entry_inputs="m", commands="k m", velocity="n 3")
class FreeForm:
    """Find the commands whose run has the largest trace(G B)."""

    vessel: Vessel  # nominal, in calm water
    names: tuple[str, ...]  # parameters to estimate
    gradient: Array  # (d, d) G, for the D criterion B(w)^-1
    mean_subtraction: str  # "none", "batch" or "complete"
    limits: Array  # (3, 2) low and high of u, v, r
    entry_inputs: Array  # (m,) commands before the run
    commands: Array  # (k, m) initial guess
    velocity: Array  # (k + 1, 3) motion under the guess; its first row is fixed


def optimise_commands(problem: FreeForm) -> Array | None:
    """Optimised commands (k, m), or None where the solver gives no numbers.

    Sway and yaw rate are zero at the end of the run.
    """
    k, m = problem.commands.shape
    low, high = problem.limits.T
    span, size = high - low, _command_scale(problem)
    x, c = ca.MX.sym("x", 3, k + 1), ca.MX.sym("c", m, k)
    states, inputs = ca.DM(span) * x, ca.DM(size) * c
    ends = _step(problem).map(k)(states[:, :-1], inputs)
    defects = ca.vec((ends - states[:, 1:]) / ca.DM(span))
    before = ca.horzcat(ca.DM(problem.entry_inputs / size), c[:, :-1])
    reach = problem.vessel.rates * problem.vessel.sample_time_s / size
    bounded = np.flatnonzero(np.isfinite(reach))
    changes = c - before
    constraints = ca.vertcat(defects, *(changes[int(i), :].T for i in bounded))
    sides = np.r_[np.zeros(3 * k), np.repeat(reach[bounded], k)]
    information = _sensitivity(problem, states[:, :-1], inputs)
    variables = ca.vertcat(ca.vec(x), ca.vec(c))
    guess = np.r_[(problem.velocity / span).ravel(), (problem.commands / size).ravel()]
    scale = max(abs(float(ca.Function("start", [variables], [information])(guess))), 1e-12)
    cost = -information / scale + CALMNESS * ca.sumsqr(changes) / k
    solver = ca.nlpsol("freeform", "ipopt", {"x": variables, "f": cost, "g": constraints}, _options())
    lower, upper = _variable_bounds(problem, span, size)
    answer = solver(x0=np.clip(guess, lower, upper), lbx=lower, ubx=upper, lbg=-sides, ubg=sides)
    if solver.stats()["return_status"] == "NonIpopt_Exception_Thrown":
        raise KeyboardInterrupt  # the only exception possible without Python callbacks
    values = np.asarray(answer["x"]).ravel()[3 * (k + 1) :].reshape(k, m) * size
    return values if np.isfinite(values).all() else None


def _options() -> dict[str, Any]:
    return {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.sb": "yes",
        "ipopt.max_iter": ITERATIONS,
        "ipopt.tol": 1e-5,
        "ipopt.constr_viol_tol": 1e-7,
        "ipopt.mu_strategy": "adaptive",
    }


def _command_scale(problem: FreeForm) -> Array:
    """(m,) sizes of the commands: their limits, a radian for angles that turn freely."""
    largest = np.abs(problem.commands).max(axis=0)
    finite = [
        max(abs(x.low), abs(x.high)) if np.isfinite([x.low, x.high]).all() else 0.0 for x in problem.vessel.limits
    ]
    return np.asarray(np.where(np.array(finite) > 0, finite, np.maximum(largest, 1.0)))


def _variable_bounds(problem: FreeForm, span: Array, size: Array) -> tuple[Array, Array]:
    k = len(problem.commands)
    low, high = problem.limits.T / span
    lows, highs = (np.tile(side, (k + 1, 1)) for side in (low + MARGIN, high - MARGIN))
    lows[0] = highs[0] = problem.velocity[0] / span
    lows[-1, 1:], highs[-1, 1:] = -END_MOTION, END_MOTION
    least, most = (np.array([getattr(x, side) for x in problem.vessel.limits]) / size for side in ("low", "high"))
    return np.r_[lows.ravel(), np.tile(least, k)], np.r_[highs.ravel(), np.tile(most, k)]


def _step(problem: FreeForm) -> ca.Function:
    """Velocity (3,) a sample later, by one Runge-Kutta step through calm water and air."""
    nu, held = ca.SX.sym("nu", 3), ca.SX.sym("c", problem.commands.shape[1])
    ops = _operators(problem)
    state: tuple[Any, ...] = (0.0, 0.0, 0.0, *ca.vertsplit(nu))

    def rates(s: tuple[Any, ...]) -> tuple[Any, ...]:
        return motion_rates(problem.vessel.model, s, ca.vertsplit(held), ops=ops)

    after = rk4_step(rates, state, problem.vessel.sample_time_s)
    return ca.Function("step", [nu, held], [ca.vertcat(*after[3:])])


def _operators(problem: FreeForm) -> Operators:
    small = MODULUS_ROUNDING * float(np.abs(problem.limits[:2]).max())
    return Operators(lambda x: ca.sqrt(x * x + small**2), ca.sin, ca.cos)


def _sensitivity(problem: FreeForm, states: ca.MX, inputs: ca.MX) -> ca.MX:
    """trace(G B) of the run, up to a constant."""
    model, k = problem.vessel.model, len(problem.commands)
    chosen = [model.names.index(name) for name in problem.names]
    equations = [model.terms[index].equation for index in chosen]
    p = len(chosen)
    same = np.array([[a == b for b in equations] for a in equations])
    G = np.where(same, problem.gradient[:p, :p], 0.0)
    nu, held = ca.SX.sym("nu", 3), ca.SX.sym("c", problem.commands.shape[1])
    motion = ca.vertsplit(nu)
    values = model.regressors(motion, motion[:2], ca.vertsplit(held), _operators(problem))
    phi = ca.vertcat(*(values[index] for index in chosen))
    linear = _linear(problem, equations, model.outputs)
    stage = ca.Function("stage", [nu, held], [ca.bilin(ca.DM(G), phi, phi) + ca.dot(ca.DM(linear), phi), phi])
    information, rows = stage.map(k)(states, inputs)
    total = ca.sum2(information) / k
    if problem.mean_subtraction == "batch":
        mean = ca.sum2(rows) / k
        total = total - ca.bilin(ca.DM(G), mean, mean)
    return total


def _linear(problem: FreeForm, equations: Sequence[str], outputs: Sequence[str]) -> Array:
    """(p,) weight of each mean regressor: twice G's border, where B has one."""
    p = len(equations)
    if problem.mean_subtraction != "complete":
        return np.zeros(p)
    return np.array([2 * problem.gradient[i, p + outputs.index(name)] for i, name in enumerate(equations)])
