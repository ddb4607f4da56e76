"""The planner's only use of CasADi and IPOPT: fastest smooth commands between states, within limits and a region.

Direct multiple shooting on the very map that simulates the trial: commands are linear between nodes, sampled and held,
and each sample is integrated with the simulation's Runge-Kutta steps. Programs of one size are built once and reused:
everything that differs from leg to leg is a bound or a parameter.

Derivatives follow the structure: those of the map over a block of samples are worked out symbolically, once for each
size of block, and placed by the constant matrix that gives the map's arguments from the variables. Second derivatives
are those of a map with one integrator step a sample: they choose IPOPT's direction, not its answer.

Source: H. G. Bock and K. J. Plitt, A multiple shooting algorithm for direct solution of optimal control problems,
IFAC Proc. 17 (1984), 1603-1608.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np

from expdesign.plan.legs.problem import LegProblem
from expdesign.simulation import Environment, SampleMap, motion_rates, rk4_step, sample_map, step_shares
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array
from expdesign.vessel import Vessel, by_force
from expdesign.vessel._casadi import CASADI

SMOOTHNESS = 0.02  # weight of squared command steps against time in units of `LegProblem.time_scale_s`
SMALLNESS = 1e-4  # weight of squared commands: decides between commands that give the same force
FREE_SAMPLES = (0.2, 3.0)  # least and largest time between samples while it is free, in sample times
SETTLED = 1e-4  # miss of what lagging actuators deliver at the end, relative to the largest
ITERATIONS = 100  # of IPOPT at most
# largest miss at a node, in scaled states, of answers in free time that count where IPOPT's iterations ended: the next
# program is only guessed from them, and about a good one IPOPT often goes to and fro
CLOSE = 0.03
CORNERED = 4  # iterations that IPOPT spends about a good answer before it is taken, where the model has corners
PROGRAMS = 24  # nonlinear programs kept built


IDLE_SHARE = 1e-9  # of a scale, below which a command of an answer is none: interior points end beside nothing

RELAXED = 1e-8
"""IPOPT may exceed bounds by this (its `bound_relax_factor`); rates of actuators keep as much away from theirs."""


class Program:
    """The nonlinear program of legs with a given number of nodes and samples per node."""

    def __init__(self, vessel: Vessel, environment: Environment, nodes: int, block: int, free_time: bool) -> None:
        self.vessel, self.environment, self.nodes, self.block, self.free = vessel, environment, nodes, block, free_time
        self.limits, self.rates = vessel.limits, vessel.rates
        self.state_scale = np.array([vessel.length_m] * 2 + [1.0] * 4)
        self.input_scale = np.array([max(abs(x.low), abs(x.high)) if np.isfinite(x.high) else 1.0 for x in self.limits])
        self.maps = [sample_map(x, sample_time_s=vessel.sample_time_s) for x in vessel.responses]
        self.lagging = np.flatnonzero([response.lag_s > 0 for response in vessel.responses])
        self.memory = 1 + max(through.lateness for through in self.maps)
        self._build()

    def _build(self) -> None:
        j, m, block = self.nodes, len(self.limits), self._blocks
        x, u, h = ca.MX.sym("x", 6, j + 1), ca.MX.sym("u", m, j + 1), ca.MX.sym("h")
        d, past = ca.MX.sym("d", len(self.lagging), j + 1), ca.MX.sym("past", m, self.memory)
        path, circle, displacement_value = (
            ca.MX.sym("path", 3, j - 1),
            ca.MX.sym("circle", 2),
            ca.MX.sym("displacement_value", 2),
        )
        unit_s, arm = ca.MX.sym("unit_s"), ca.MX.sym("arm")
        inputs, states = ca.DM(self.input_scale) * u, ca.DM(self.state_scale) * x
        delivered = ca.DM(self.input_scale[self.lagging]) * d
        variables = ca.vertcat(ca.vec(x), ca.vec(u), ca.vec(d), h)
        given = ca.vertcat(states, delivered)
        ends = (inputs[:, :-1], inputs[:, 1:]) if _prompt(self.maps) else self._arriving(past, inputs)
        arguments = ca.vertcat(given[:, :-1], *ends, ca.repmat(h, 1, j))
        scale = np.tile(1.0 / np.r_[self.state_scale, self.input_scale[self.lagging]], j)
        motion = ca.DM(scale) * ca.vec(block.value.map(j)(arguments) - given[:, 1:])
        rows = self._region(states[:, 1:-1], path, circle, arm)
        for index in self._rated:
            step = (inputs[int(index), 1:] - inputs[int(index), :-1]).T / self.input_scale[index]
            reach = self.rates[index] * self.block * h / self.input_scale[index]
            rows += [step - reach + RELAXED, RELAXED - step - reach]
        through = x[3:5, 1:-1] - self._current_b(x[2, 1:-1])
        others = ca.vertcat(*rows, ca.sum1(through**2).T, (through[0, :] * x[5, 1:-1]).T)
        constraints = ca.vertcat(motion, others)
        cost = (
            SMOOTHNESS * ca.sumsqr(ca.diff(u, 1, 1))
            + SMALLNESS * ca.sumsqr(u) / j
            - ca.dot(displacement_value, states[:2, -1]) / unit_s
        )
        if self.free:
            cost = cost + h * j * self.block / unit_s
        parameters = ca.vertcat(ca.vec(path), circle, displacement_value, unit_s, arm, ca.vec(past))

        variables_and_parameters = [variables, parameters]
        weights, jacobian, hessian = self._derivatives(variables, arguments, given[:, 1:], scale, cost, others)
        options: dict[str, Any] = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
        options |= {"ipopt.max_iter": ITERATIONS, "ipopt.constr_viol_tol": 1e-9, "ipopt.acceptable_iter": 0}
        options |= {"ipopt.tol": 1e-5 if self.free else 1e-7}
        options |= {"ipopt.mumps_pivot_order": 0}  # minimum degree: by far the least work for chains of samples
        # variables are scaled here, but multipliers and regularisation may grow to 1e12: without scaling by MUMPS,
        # pivots that it puts off fill its factors, and one iteration took a second instead of ten milliseconds
        options |= {"ipopt.mumps_scaling": 77, "ipopt.mumps_permuting_scaling": 0}
        options |= {"ipopt.min_refinement_steps": 0}  # refining all solutions changes no digit kept
        if not by_force(self.vessel.model):  # terms with corners, as |n|: there IPOPT goes to and fro
            options |= {"ipopt.acceptable_iter": CORNERED, "ipopt.acceptable_tol": 1e8}
            options |= {"ipopt.acceptable_constr_viol_tol": 1e-3 if self.free else 1e-7}
            options |= {"ipopt.acceptable_dual_inf_tol": 0.1, "ipopt.acceptable_compl_inf_tol": 0.01}
        if not self.free:
            options["ipopt.mu_strategy"] = "adaptive"  # from good guesses it takes half the iterations
        options["jac_g"] = ca.Function("nlp_jac_g", variables_and_parameters, [constraints, jacobian])
        options["hess_lag"] = ca.Function("nlp_hess_l", variables_and_parameters + weights, [ca.triu(hessian)])
        nlp: Any = {"x": variables, "p": parameters, "f": cost, "g": constraints}
        self.solver = ca.nlpsol("leg", "ipopt", nlp, options)

    def _derivatives(
        self, variables: ca.MX, arguments: ca.MX, arrivals: ca.MX, scale: Array, cost: ca.MX, others: ca.MX
    ) -> tuple[list[ca.MX], ca.MX, ca.MX]:
        """Weights of cost and constraints, Jacobian of the constraints, Hessian of the weighted sum.

        Arguments of the maps, and what they must arrive at, are linear in the variables: the chain rule takes two
        constant matrices.
        """
        block, j = self._blocks, self.nodes
        of_arguments, of_arrivals = (
            ca.evalf(ca.jacobian(ca.vec(linear), variables)) for linear in (arguments, arrivals)
        )
        slopes = ca.sparsity_cast(block.jacobian.map(j)(arguments), _repeated(block.jacobian, j))
        motion = ca.mtimes(ca.diag(ca.DM(scale)), ca.mtimes(slopes, of_arguments) - of_arrivals)
        cost_weight, weights = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(scale) + others.numel())
        motion_weights, other_weights = ca.vertsplit(weights, [0, len(scale), weights.numel()])
        per_map = ca.reshape(ca.DM(scale) * motion_weights, -1, j)
        bends = ca.sparsity_cast(block.hessian.map(j)(arguments, per_map), _repeated(block.hessian, j))
        hessian = ca.mtimes(of_arguments.T, ca.mtimes(bends, of_arguments))
        hessian += ca.hessian(cost_weight * cost + ca.dot(other_weights, others), variables)[0]
        return [cost_weight, weights], ca.vertcat(motion, ca.jacobian(others, variables)), hessian

    @property
    def _blocks(self) -> BlockMap:
        """The map from node to node."""
        return _block_map(_ship(self.vessel, self.environment), self.block)

    @property
    def _rated(self) -> np.ndarray:
        """Indices of the signals with a finite rate."""
        return np.flatnonzero(np.isfinite(self.rates))

    def _arriving(self, past: ca.MX, inputs: ca.MX) -> tuple[ca.MX, ca.MX]:
        """(m block, j) commands that arrive at the actuators in each sample: the earlier and the later one."""
        j, m, block = self.nodes, len(self.limits), self.block
        shares = np.zeros((j + 1, j * block))
        for sample in range(j * block):
            node, share = divmod(sample, block)
            shares[node, sample], shares[node + 1, sample] = 1 - (share + 1) / block, (share + 1) / block
        given = ca.horzcat(past, ca.mtimes(inputs, ca.sparsify(ca.DM(shares))))
        firsts = [self.memory - through.lateness for through in self.maps]
        late = ca.vertcat(*[given[i, first : first + j * block] for i, first in enumerate(firsts)])
        early = ca.vertcat(*[given[i, first - 1 : first - 1 + j * block] for i, first in enumerate(firsts)])
        return ca.reshape(early, m * block, j), ca.reshape(late, m * block, j)

    def _current_b(self, heading: ca.MX) -> Any:
        """(2, j) current ahead and to starboard at headings (1, j); 0 in still water."""
        north, east = self.environment.current_to.tolist()
        if not (north or east):
            return 0
        c, s = ca.cos(heading), ca.sin(heading)
        return ca.vertcat(north * c + east * s, east * c - north * s)

    def _region(self, inner: ca.MX, path: ca.MX, circle: ca.MX, arm: ca.MX) -> list[ca.MX]:
        """Rows for origin, bow point and stern point: offset from the path, and squared distance from the circle."""
        side = ca.vertcat(-ca.sin(path[2, :]), ca.cos(path[2, :]))
        ahead = ca.vertcat(ca.cos(inner[2, :]), ca.sin(inner[2, :]))
        length = self.vessel.length_m
        points = [inner[:2, :] + share * arm * ahead for share in (0, 1, -1)]
        offsets = [ca.sum1(side * (point - path[:2, :])).T / length for point in points]
        return offsets + [ca.sum1((point - circle) ** 2).T / length**2 for point in points]

    def _row_bounds(self, problem: LegProblem) -> tuple[Array, Array]:
        """Lower and upper bounds of the constraints, in the order of `_build`."""
        j, inner, length = self.nodes, slice(1, self.nodes), self.vessel.length_m
        low, high = [np.zeros((6 + len(self.lagging)) * j)], [np.zeros((6 + len(self.lagging)) * j)]
        low += 3 * [-problem.room_port_m[inner] / length]
        high += 3 * [problem.room_starboard_m[inner] / length]
        radius = problem.circle[2]
        low += [np.full(3 * (j - 1), -np.inf)]
        high += [np.full(3 * (j - 1), (radius / length) ** 2)]
        low += [np.full(2 * j * len(self._rated), -np.inf), np.full(j - 1, -np.inf)]
        high += [np.zeros(2 * j * len(self._rated)), np.full(j - 1, problem.top_speed_mps**2)]
        low += [np.full(j - 1, -problem.lateral_mps2)]
        high += [np.full(j - 1, problem.lateral_mps2)]
        return np.concatenate(low), np.concatenate(high)

    def _variable_bounds(self, problem: LegProblem, origin: Array) -> tuple[Array, Array]:
        """Lower and upper bounds of states, commands and sample time."""
        j = self.nodes
        high = np.full((j + 1, 6), np.inf)
        over_ground = problem.top_speed_mps + float(np.hypot(*self.environment.current_to))
        high[:, 3:] = [over_ground, over_ground, problem.yaw_rate_radps]
        low = -high
        low[0] = high[0] = (problem.start - origin) / self.state_scale
        low[-1] = high[-1] = (problem.end - origin) / self.state_scale
        if problem.displacement_value is not None:
            (
                low[-1, : 2 if problem.displacement_value.any() else 3],
                high[-1, : 2 if problem.displacement_value.any() else 3],
            ) = -np.inf, np.inf
        first, last = (np.tile([getattr(x, name) for x in self.limits], (j + 1, 1)) for name in ("low", "high"))
        first[0] = last[0] = problem.start_inputs
        for index, response in enumerate(self.vessel.responses):  # nothing may still be on its way at the end
            after = j - int(np.ceil(response.delay_s / (self.block * self.vessel.sample_time_s) - 1e-9))
            first[after:, index] = last[after:, index] = problem.end_inputs[index]
        offset = np.array([response.offset for response in self.vessel.responses])
        ends = ((problem.delivered - offset)[self.lagging], problem.end_inputs[self.lagging])
        least, most = (np.full((j + 1, len(self.lagging)), sign * np.inf) for sign in (-1, 1))
        scale = self.input_scale[self.lagging]
        least[0] = most[0] = ends[0] / scale
        least[-1], most[-1] = ends[1] / scale - SETTLED, ends[1] / scale + SETTLED
        sample_s = self.vessel.sample_time_s
        times = [share * sample_s for share in FREE_SAMPLES] if self.free else [sample_s, sample_s]
        return (
            np.r_[low.ravel(), (first / self.input_scale).ravel(), least.ravel(), times[0]],
            np.r_[high.ravel(), (last / self.input_scale).ravel(), most.ravel(), times[1]],
        )

    def solve(self, problem: LegProblem, step_s: float) -> tuple[LegProblem, float] | None:
        """The problem with states and inputs replaced by the answer, and the sample time found; or None."""
        if problem.budget.exhausted:
            return None
        j, m = self.nodes, len(self.limits)
        origin = np.array([*problem.start[:2], 0, 0, 0, 0])
        path = problem.path[1:j] - origin[:3]
        inputs = problem.inputs / self.input_scale
        guess = [
            ((problem.states - origin) / self.state_scale).ravel(),
            inputs.ravel(),
            inputs[:, self.lagging].ravel(),
        ]
        rows = len(problem.past) - 1 + np.arange(-self.memory + 1, 1)
        past = problem.past[np.maximum(rows, 0)]
        low, high = self._variable_bounds(problem, origin)
        least, most = self._row_bounds(problem)
        answer = self.solver(
            x0=np.clip(np.r_[*guess, step_s], low, high),
            p=np.r_[
                path.ravel(),
                problem.circle[:2] - origin[:2],
                np.zeros(2) if problem.displacement_value is None else problem.displacement_value,
                problem.time_scale_s,
                problem.hull_arm_m,
                past.ravel(),
            ],
            lbx=low,
            ubx=high,
            lbg=least,
            ubg=most,
        )
        outcome = self.solver.stats()
        problem.budget.optimised(outcome["iter_count"], j * self.block)
        if outcome["return_status"] == "NonIpopt_Exception_Thrown":
            raise KeyboardInterrupt  # the only exception there can be, as nothing in the program calls back to Python
        if not outcome["success"] and not (self.free and _near(outcome)):
            return None
        values = np.asarray(answer["x"]).ravel()
        states = values[: 6 * (j + 1)].reshape(j + 1, 6) * self.state_scale + origin
        inputs = values[6 * (j + 1) : (6 + m) * (j + 1)].reshape(j + 1, m)
        inputs = np.where(np.abs(inputs) < IDLE_SHARE, 0.0, inputs) * self.input_scale
        return replace(problem, states=states, inputs=inputs), float(values[-1])


def _near(outcome: dict[str, Any]) -> bool:
    """Whether IPOPT used up its iterations near an answer."""
    ended = outcome["return_status"] == "Maximum_Iterations_Exceeded"
    return bool(ended and outcome["iterations"]["inf_pr"][-1] < CLOSE)


@dataclass(frozen=True)
class BlockMap:
    """The map over a block of samples: state and what lagging actuators deliver, from these and the commands between.

    Its argument (n,) holds the state (6,), what lagging actuators deliver (c,), the earlier and the later commands that
    arrive in each sample (m block,) each, and the sample time. Where no actuator has a dead time, the commands at both
    nodes (m,) each stand for all between. Dead bands are left out: commands inside them make the leg miss its end,
    which the caller finds.
    """

    value: ca.Function  # argument -> (6 + c,)
    jacobian: ca.Function  # argument -> (6 + c, n)
    # argument, weights (6 + c,) -> (n, n) of the weighted sum, by one integrator step a sample. IPOPT needs second
    # derivatives for its direction only: what it finds is optimal by the exact first ones.
    hessian: ca.Function


@lru_cache(maxsize=PROGRAMS)
def _block_map(ship: _Ship, block: int) -> BlockMap:
    """The map over so many samples of a vessel in an environment's mean current and wind, with its derivatives."""
    vessel = ship.vessel
    lagging, m = sum(response.lag_s > 0 for response in vessel.responses), len(vessel.limits)
    x, d, h = ca.SX.sym("x", 6), ca.SX.sym("d", lagging), ca.SX.sym("h")
    if _prompt([sample_map(response, sample_time_s=vessel.sample_time_s) for response in vessel.responses]):
        ends = ca.SX.sym("before", m), ca.SX.sym("after", m)
        early = late = ca.horzcat(*[ends[0] + (k + 1) / block * (ends[1] - ends[0]) for k in range(block)])
        argument = ca.vertcat(x, d, *ends, h)
    else:
        early, late = ca.SX.sym("early", m, block), ca.SX.sym("late", m, block)
        argument = ca.vertcat(x, d, ca.vec(early), ca.vec(late), h)
    value = ca.cse(_after(ship, x, d, early, late, h, SUBSTEPS))
    weights = ca.SX.sym("weights", value.numel())
    bent = ca.cse(ca.dot(weights, _after(ship, x, d, early, late, h, 1)))
    return BlockMap(
        value=ca.Function("block", [argument], [value]),
        jacobian=ca.Function("block_jacobian", [argument], [ca.jacobian(value, argument)]),
        hessian=ca.Function("block_hessian", [argument, weights], [ca.hessian(bent, argument)[0]]),
    )


def _prompt(maps: Sequence[SampleMap]) -> bool:
    """Whether what actuators do in a sample depends on the command of that sample alone, and where they were."""
    return not any(through.lateness or through.means[:, 1].any() or through.end[1] for through in maps)


def _after(ship: _Ship, x: ca.SX, d: ca.SX, early: ca.SX, late: ca.SX, h: ca.SX, substeps: int) -> ca.SX:
    """State and what lagging actuators deliver after samples (m, block), each of so many integrator steps or more."""
    vessel, environment = ship.vessel, ship.environment
    shares = step_shares(vessel.responses, sample_time_s=vessel.sample_time_s, substeps=substeps)
    maps = [sample_map(r, sample_time_s=vessel.sample_time_s, substeps=shares) for r in vessel.responses]
    lagging = [index for index, response in enumerate(vessel.responses) if response.lag_s > 0]
    state: tuple[Any, ...] = tuple(ca.vertsplit(x))
    lagged: dict[int, Any] = dict(zip(lagging, ca.vertsplit(d), strict=True)) if lagging else {}
    current, wind = environment.current_to.tolist(), environment.wind_to.tolist()
    for sample in range(early.size2()):
        start, after = early[:, sample], late[:, sample]
        for part, share in enumerate(shares.tolist()):
            given = [
                _mixed(through.means[part], lagged.get(i, 0.0), start[i], after[i]) + through.offset
                for i, through in enumerate(maps)
            ]
            state = rk4_step(partial(_rates, vessel, given, current, wind), state, share * h)
        lagged = {i: _mixed(maps[i].end, value, start[i], after[i]) for i, value in lagged.items()}
    moved: ca.SX = ca.vertcat(*state, *lagged.values())
    return moved


def _rates(vessel: Vessel, given: list[Any], current: Any, wind: Any, state: tuple[Any, ...]) -> tuple[Any, ...]:
    return motion_rates(vessel.model, state, given, current_to=current, wind_to=wind, ops=CASADI)


def _repeated(block: ca.Function, count: int) -> ca.Sparsity:
    """Sparsity of a block-diagonal matrix of the function's results."""
    return ca.diagcat(*[block.sparsity_out(0)] * count)


def _mixed(weights: Array, start: Any, early: Any, late: Any) -> Any:
    """What a sample map makes of the value it starts from and of two commands; weights of zero leave no trace."""
    parts = [weight * value for weight, value in zip(weights.tolist(), (start, early, late), strict=True) if weight]
    return sum(parts[1:], parts[0]) if parts else 0.0


@dataclass(frozen=True)
class _Ship:
    """A vessel in an environment's means; equal where its equations of motion are, in another process, too."""

    content: tuple[Hashable, ...]
    vessel: Vessel = field(compare=False)
    environment: Environment = field(compare=False)


def _ship(vessel: Vessel, environment: Environment) -> _Ship:
    model = vessel.model
    equations = model.terms, model.form, model.sample_time_s, model.parameters.tobytes(), model.actuators
    weather = environment.current_to.tobytes(), environment.wind_to.tobytes()
    return _Ship((equations, weather, vessel.length_m, vessel.sample_time_s), vessel, environment)


def program(vessel: Vessel, environment: Environment, nodes: int, block: int, free_time: bool) -> Program:
    """The program of a size, built once and kept."""
    return _program(_ship(vessel, environment), nodes, block, free_time)


@lru_cache(maxsize=PROGRAMS)
def _program(ship: _Ship, nodes: int, block: int, free_time: bool) -> Program:
    return Program(ship.vessel, ship.environment, nodes, block, free_time)
