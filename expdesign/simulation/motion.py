"""Equations of motion and their integrators, written once for floats, NumPy arrays and CasADi symbols.

State (north, east, heading, u, v, r): pose in the n-frame, velocity over ground in the b-frame. Models with a roll mode
have two states more, roll and its rate, see `vessel.roll`.

In water that moves steadily, a ship moves as in still water, and drifts with it besides (Galileo's principle). So terms
give the rate of the velocity through water. The rate over ground has besides how the current's components change along
the axes of a ship that turns. F. Ljungberg's (3.57) leaves that out, and so does Euler's map of the discrete
parameters, which is his. Without it, a turning circle of the 80 m coaster in a current of 0.5 m/s would end 90 m beside
where it does after 300 s.

Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), (2.26), and 8.3 for the current;
F. Ljungberg, doctoral thesis, Linköping University, (3.18), (3.27) and (3.58).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from expdesign.errors import InputError, UnknownName
from expdesign.vessel import NUMPY, Operators, VesselModel

State = tuple[Any, ...]
Rates = Callable[[State], State]
Step = Callable[[Rates, State, Any], State]


def to_body(vector_n: Any, heading_rad: Any, ops: Operators) -> tuple[Any, Any]:
    """A horizontal (north, east) vector in the b-frame of a heading."""
    return _turned(vector_n, ops.cos(heading_rad), ops.sin(heading_rad))


def _turned(vector_n: Any, c: Any, s: Any) -> tuple[Any, Any]:
    """`to_body` with cosine and sine known: they cost more than all the rest."""
    return vector_n[0] * c + vector_n[1] * s, vector_n[1] * c - vector_n[0] * s


def relative_velocity(state: State, current_to: Any, wind_to: Any, ops: Operators) -> tuple[State, State]:
    """(u, v, r) through water and (u_q, v_q) through air, from the state and the n-frame current and wind."""
    heading = state[2]
    return _relative(state, current_to, wind_to, ops.cos(heading), ops.sin(heading))


def _relative(state: State, current_to: Any, wind_to: Any, c: Any, s: Any) -> tuple[State, State]:
    u, v, r = state[3:6]
    u_c, v_c = _turned(current_to, c, s)
    u_w, v_w = _turned(wind_to, c, s)
    return (u - u_c, v - v_c, r), (u - u_w, v - v_w)


def rates_over_ground(through_water: State, current_b: tuple[Any, Any], yaw_rate: Any) -> State:
    """d/dt (u, v, r) over ground, from that through water and the b-frame components (u_c, v_c) of a steady current."""
    (surge, sway, yaw), (u_c, v_c) = through_water, current_b
    return surge + yaw_rate * v_c, sway - yaw_rate * u_c, yaw


def motion_rates(
    model: VesselModel,
    state: State,
    inputs: Any,
    *,
    current_to: Any = (0.0, 0.0),
    wind_to: Any = (0.0, 0.0),
    ops: Operators = NUMPY,
    parameters: Any = None,
    turning: bool = True,
) -> State:
    """Time derivative of the state, (6,) or with roll (8,), under held inputs and steady n-frame current and wind.

    Args:
        state: as above.
        inputs: delivered by the actuators.
        current_to, wind_to: to north and east [m/s].
        ops: the functions for that kind of number.
        parameters: (p,) in the model's own form; None for the model's.
        turning: the current's components change along the axes of a ship that turns; see `turns_current`.
    """
    _, _, heading, u, v, r, *roll = state
    c, s = ops.cos(heading), ops.sin(heading)
    water, air = _relative(state, current_to, wind_to, c, s)
    rates: State = model.accelerations(water, air, inputs, ops, parameters)
    if turning:
        rates = rates_over_ground(rates, _turned(current_to, c, s), r)
    if model.roll is not None:
        rates = model.roll.rates(rates, u * r, tuple(roll))
    return (u * c - v * s, u * s + v * c, r, *rates)


def begun(model: VesselModel, state: State) -> State:
    """A state that a model's motion begins from, (6,): upright where it has a roll mode."""
    return (*state, *(0.0 * x for x in state[: model.states - len(state)]))


def euler_step(rates: Rates, state: State, step_s: Any) -> State:
    """One explicit Euler step, the map the discrete parameters are defined by."""
    return tuple(x + step_s * dx for x, dx in zip(state, rates(state), strict=True))


def rk4_step(rates: Rates, state: State, step_s: Any, later: tuple[Rates, Rates] | None = None) -> State:
    """One classical Runge-Kutta step of order four; `later` are rates at its middle and its end, where they differ."""
    middle, end = later or (rates, rates)

    def ahead(slope: State, fraction: float) -> State:
        return tuple(x + fraction * step_s * dx for x, dx in zip(state, slope, strict=True))

    k1 = rates(state)
    k2 = middle(ahead(k1, 0.5))
    k3 = middle(ahead(k2, 0.5))
    k4 = end(ahead(k3, 1.0))
    return tuple(
        x + step_s / 6.0 * (a + 2.0 * b + 2.0 * c + d) for x, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True)
    )


def turns_current(integrator: str) -> bool:
    """Whether rates for an integrator count a current's change along the axes of a ship that turns: but for Euler's."""
    return integrator != "euler"


STEPS: dict[str, Step] = {"rk4": rk4_step, "euler": euler_step}


def integrator_step(name: str, model: VesselModel) -> Step:
    """A step by the integrator's name, for a model.

    Raises:
        UnknownName: there is none.
        InputError: Euler's map for a model that rolls, whose oscillation it would make grow.
    """
    if name not in STEPS:
        raise UnknownName("integrator", name, known=STEPS)
    if name == "euler" and model.roll is not None:
        raise InputError("the vessel's model has a roll mode, [model.roll], expected integrator rk4 rather than euler")
    return STEPS[name]
