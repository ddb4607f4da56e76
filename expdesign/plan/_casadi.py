"""The only door to CasADi and IPOPT: fastest smooth commands between two states, within limits and a corridor.

Direct multiple shooting on the very map that simulates the trial: commands are linear between nodes, sampled and held,
and each sample is integrated with the simulation's Runge-Kutta steps.

Source: H. G. Bock and K. J. Plitt, A multiple shooting algorithm for direct solution of optimal control problems,
IFAC Proc. 17 (1984), 1603-1608.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from expdesign.simulation import Environment, motion_rates, rk4_step
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array, seal
from expdesign.vessel import Operators, Vessel

CASADI = Operators(ca.fabs, ca.sin, ca.cos)
SMOOTHNESS = 0.02
"""Weight of squared command steps against relative time."""
SMALLNESS = 1e-4
"""Weight of squared commands: decides between commands that give the same force."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LegProblem:
    """A leg to be made into commands.

    Attributes:
        vessel: model, actuator limits and rates.
        environment: its means act.
        start, end: (6,) states; heading continuous along the reference.
        start_inputs, end_inputs: (m,) commands standing before the leg, and as its last sample.
        reference: (j + 1, 6) states at the nodes: first guess, and what the corridor is measured from.
        guess: (j + 1, m) commands at the nodes.
        duration_s: first guess.
        side: (j + 1, 2) unit normals of the path, to starboard, north/east.
        room_port_m, room_starboard_m: (j + 1,) how far the origin may be from the reference to either side.
        hull_arm_m: points this far ahead and astern of the origin must keep to the corridor too.
        top_speed_mps, yaw_rate_radps: bounds on speed over ground, in any direction, and yaw rate at the nodes.
    """

    vessel: Vessel
    environment: Environment
    start: Array
    end: Array
    start_inputs: Array
    end_inputs: Array
    reference: Array
    guess: Array
    duration_s: float
    side: Array
    room_port_m: Array
    room_starboard_m: Array
    hull_arm_m: float
    top_speed_mps: float
    yaw_rate_radps: float

    def __post_init__(self) -> None:
        seal(self, start="6", end="6", start_inputs="m", end_inputs="m", reference="j 6", guess="j m")
        seal(self, side="j 2", room_port_m="j", room_starboard_m="j")


def solve_leg(problem: LegProblem) -> Array | None:
    """Commands (k, m) at the vessel's sample time, or None when IPOPT finds none.

    First the fastest motion is sought with the sample time free, then the smoothest one on whole samples in that
    time. The answer is for the caller to check by simulation.
    """
    nodes, sample_s = len(problem.reference) - 1, problem.vessel.sample_time_s
    for stretch in (1.0, 1.6):
        guess_s = stretch * problem.duration_s
        block = max(1, round(guess_s / (nodes * sample_s)))
        fastest = _Transcription(problem, block, free_time=True)
        found = fastest.solve(problem.reference, problem.guess, guess_s / (nodes * block))
        if found is None:
            continue
        states, commands, step_s = found
        time_s = nodes * block * step_s
        block = max(1, int(np.ceil(time_s / (nodes * sample_s) - 1e-6)))
        least = int(np.ceil(time_s / (block * sample_s) - 1e-6))
        for count in (least, least + 1, least + 3, least + 8):
            smooth = _Transcription(_respaced(problem, count), block, free_time=False)
            exact = smooth.solve(_spread(states, count), _spread(commands, count), sample_s)
            if exact is not None:
                return _samples(exact[1], block)
    return None


def _spread(rows: Array, count: int) -> Array:
    """Rows (j + 1, ...) linearly resampled to count + 1."""
    old, new = np.linspace(0, 1, len(rows)), np.linspace(0, 1, count + 1)
    return np.stack([np.interp(new, old, column) for column in rows.T], axis=1)


def _respaced(problem: LegProblem, count: int) -> LegProblem:
    """The same leg with another number of nodes."""
    side = _spread(problem.side, count)
    return replace(
        problem,
        reference=_spread(problem.reference, count),
        guess=_spread(problem.guess, count),
        side=side / np.linalg.norm(side, axis=1, keepdims=True),
        room_port_m=_spread(problem.room_port_m[:, None], count)[:, 0],
        room_starboard_m=_spread(problem.room_starboard_m[:, None], count)[:, 0],
    )


def _samples(nodes: Array, block: int) -> Array:
    """(count x block, m) commands, linear from node to node; the first node is what stands before the leg."""
    shares = (np.arange(1, block + 1) / block)[:, None]
    return np.concatenate([a + (b - a) * shares for a, b in pairwise(nodes)])


class _Transcription:
    """The nonlinear program of one leg with a given number of nodes and samples per node."""

    def __init__(self, problem: LegProblem, block: int, *, free_time: bool) -> None:
        self.problem, self.nodes, self.block = problem, len(problem.reference) - 1, block
        self.limits = problem.vessel.limits
        self.state_scale = np.array(
            [problem.vessel.length_m] * 2 + [1.0] + [problem.top_speed_mps] * 2 + [problem.yaw_rate_radps]
        )
        self.input_scale = np.array([max(abs(x.low), abs(x.high)) if np.isfinite(x.high) else 1.0 for x in self.limits])
        self._build(free_time)

    def _build(self, free_time: bool) -> None:
        p, j, m = self.problem, self.nodes, len(self.limits)
        x, u, h = ca.MX.sym("x", 6, j + 1), ca.MX.sym("u", m, j + 1), ca.MX.sym("h")
        states = ca.DM(self.state_scale) * x + ca.DM([*p.start[:2], 0, 0, 0, 0])
        inputs = ca.DM(self.input_scale) * u
        ends = self._block_map().map(j)(states[:, :-1], inputs[:, :-1], inputs[:, 1:], ca.repmat(h, 1, j))
        defects = (ends - states[:, 1:]) / ca.DM(self.state_scale)
        constraints, low, high = [ca.vec(defects)], [np.zeros(6 * j)], [np.zeros(6 * j)]
        for row, lower, upper in self._corridor(states):
            constraints.append(row)
            low.append(lower)
            high.append(upper)
        reach = np.array([limit.rate for limit in self.limits]) * self.block
        for index in np.flatnonzero(np.isfinite(reach)):
            change = (inputs[int(index), 1:] - inputs[int(index), :-1]).T - reach[index] * h
            fall = (inputs[int(index), :-1] - inputs[int(index), 1:]).T - reach[index] * h
            constraints += [ca.vertcat(change, fall) / self.input_scale[index]]
            low.append(np.full(2 * j, -np.inf))
            high.append(np.zeros(2 * j))
        constraints.append(ca.sum1(x[3:5, 1:-1] ** 2).T)  # speed over ground in units of its bound
        low.append(np.zeros(j - 1))
        high.append(np.ones(j - 1))
        steps, sample = ca.diff(u, 1, 1), p.vessel.sample_time_s
        cost = SMOOTHNESS * ca.sumsqr(steps) + SMALLNESS * ca.sumsqr(u) / j
        if free_time:
            cost = cost + h * j * self.block / p.duration_s
        self.variables = ca.vertcat(ca.vec(x), ca.vec(u), h)
        self.constraint_low, self.constraint_high = np.concatenate(low), np.concatenate(high)
        self.time_low, self.time_high = (0.2 * sample, 3.0 * sample) if free_time else (sample, sample)
        options: dict[str, Any] = {
            "ipopt.print_level": 0,
            "print_time": False,
            "ipopt.sb": "yes",
            "ipopt.max_iter": 400,
        }
        options |= {"ipopt.tol": 1e-7, "ipopt.constr_viol_tol": 1e-9, "ipopt.acceptable_iter": 0}
        nlp: Any = {"x": self.variables, "f": cost, "g": ca.vertcat(*constraints)}
        self.solver = ca.nlpsol("leg", "ipopt", nlp, options)

    def _block_map(self) -> ca.Function:
        """State after a block of samples with commands running linearly from one node's to the next's."""
        p, m = self.problem, len(self.limits)
        x, a, b, h = ca.SX.sym("x", 6), ca.SX.sym("a", m), ca.SX.sym("b", m), ca.SX.sym("h")
        current, wind = p.environment.current_to.tolist(), p.environment.wind_to.tolist()
        state: tuple[Any, ...] = tuple(ca.vertsplit(x))
        for sample in range(1, self.block + 1):
            held = ca.vertsplit(a + (b - a) * (sample / self.block))

            def rates(s: tuple[Any, ...], held: Any = held) -> tuple[Any, ...]:
                return motion_rates(p.vessel.model, s, held, current_to=current, wind_to=wind, ops=CASADI)

            for _ in range(SUBSTEPS):
                state = rk4_step(rates, state, h / SUBSTEPS)
        return ca.Function("block", [x, a, b, h], [ca.vertcat(*state)])

    def _corridor(self, states: ca.MX) -> list[tuple[ca.MX, Array, Array]]:
        """Rows (expression, low, high): origin, bow point and stern point between the sides of the corridor."""
        p = self.problem
        inner = slice(1, self.nodes)
        side = ca.DM(p.side[inner].T)
        centre = ca.DM(p.reference[inner, :2].T)
        heading = states[2, inner]
        ahead = ca.vertcat(ca.cos(heading), ca.sin(heading))
        length = p.vessel.length_m
        rows = []
        for arm in (0.0, p.hull_arm_m, -p.hull_arm_m):
            offset = ca.sum1(side * (states[:2, inner] + arm * ahead - centre)).T
            # the reference hull itself may stick out of the corridor in a bend; it is what must be possible
            own = arm * np.sum(p.side[inner] * _direction(p.reference[inner, 2]), axis=1)
            low = -p.room_port_m[inner] + np.minimum(own, 0.0)
            high = p.room_starboard_m[inner] + np.maximum(own, 0.0)
            rows.append((offset / length, low / length, high / length))
        return rows

    def solve(self, states: Array, inputs: Array, step_s: float) -> tuple[Array, Array, float] | None:
        """Node states (j + 1, 6), node commands (j + 1, m) and the sample time found, or None."""
        p, j, m = self.problem, self.nodes, len(self.limits)
        origin = np.array([*p.start[:2], 0, 0, 0, 0])
        ends = ((p.start - origin) / self.state_scale, (p.end - origin) / self.state_scale)
        big = np.full((j + 1, 6), np.inf)
        big[:, 3:] = 1.0  # speeds and yaw rate in units of their bounds
        low, high = -big, big.copy()
        low[0] = high[0] = ends[0]
        low[-1] = high[-1] = ends[1]
        command_low = np.tile([limit.low for limit in self.limits] / self.input_scale, (j + 1, 1))
        command_high = np.tile([limit.high for limit in self.limits] / self.input_scale, (j + 1, 1))
        command_low[0] = command_high[0] = p.start_inputs / self.input_scale
        command_low[-1] = command_high[-1] = p.end_inputs / self.input_scale
        answer = self.solver(
            x0=np.r_[((states - origin) / self.state_scale).ravel(), (inputs / self.input_scale).ravel(), step_s],
            lbx=np.r_[low.ravel(), command_low.ravel(), self.time_low],
            ubx=np.r_[high.ravel(), command_high.ravel(), self.time_high],
            lbg=self.constraint_low,
            ubg=self.constraint_high,
        )
        outcome = self.solver.stats()
        if outcome["return_status"] == "NonIpopt_Exception_Thrown":
            raise KeyboardInterrupt  # the only exception there can be, as nothing in the program calls back to Python
        if not outcome["success"]:
            return None
        values = np.asarray(answer["x"]).ravel()
        found = values[: 6 * (j + 1)].reshape(j + 1, 6) * self.state_scale + origin
        commands = values[6 * (j + 1) : -1].reshape(j + 1, m) * self.input_scale
        return found, commands, float(values[-1])


def _direction(heading: Array) -> Array:
    return np.stack([np.cos(heading), np.sin(heading)], axis=-1)
