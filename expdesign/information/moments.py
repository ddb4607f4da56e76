"""Moments of regressors and instruments from a noise-free simulation.

The thesis estimates X, Y and Z of a primitive from data or simulation (7.50)-(7.55). Here regressors and instruments
come from the same noise-free run of the nominal model, so Z = Phi, X is symmetric, and the design problem is convex.

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.57).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.information.primitive_information import PrimitiveInformation
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, relative_velocity, simulate, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Operators, Vessel, VesselModel
from expdesign.vessel.expressions import Expression, Signals
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS

MEAN_SUBTRACTIONS = ("none", "batch", "complete")
HEADINGS = 8
"""Headings over which information is averaged when wind or current make it depend on them."""
ROUNDING = 1e-12
"""A regressor that stays below this share of what the run's velocities and forces could make of it is rounding."""


def estimated_parameters(model: VesselModel, fixed: Sequence[str]) -> tuple[str, ...]:
    """Names of the parameters to estimate: all but the fixed ones.

    Raises:
        UnknownName: a fixed name is not a parameter.
        InputError: nothing is left to estimate.
    """
    for name in fixed:
        if name not in model.names:
            raise UnknownName("parameter", name, known=model.names)
    kept = tuple(name for name in model.names if name not in fixed)
    if not kept:
        raise InputError("fixed_parameters names every parameter, nothing is left to estimate")
    return kept


def regressor_rows(model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment) -> Array:
    """(k, p) value of every term at every command's start, under the environment's mean current and wind.

    A term that only rounding keeps from being zero throughout the run is zero: no matrix could tell afterwards.
    """
    table = _signals(model, trajectory, commands, environment)
    values = [np.broadcast_to(expression.evaluate(table, NUMPY), (len(commands),)) for expression in model.expressions]
    rows = np.stack(values, axis=1).astype(float)
    return np.where(np.abs(rows).max(axis=0) > ROUNDING * _magnitudes(model, table), rows, 0.0)


def _signals(model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment) -> Signals:
    """Everything a term may read, at every command's start."""
    k = len(commands)
    state = (*trajectory.pose[:k].T, *trajectory.velocity[:k].T)
    water, air = relative_velocity(state, environment.current_to, environment.wind_to, NUMPY)
    return model.signals(water, air, commands.values.T, NUMPY)


def _magnitudes(model: VesselModel, table: Signals) -> Array:
    """(p,) every term with its signals replaced by the largest of their kind in the run."""
    largest = {name: float(np.abs(values).max()) for name, values in table.items()}
    for kind in (MOTION_SIGNALS, FORCE_SIGNALS):
        largest.update(dict.fromkeys(kind, max(largest[name] for name in kind)))
    bounds = Operators(abs, lambda angle: 1.0, lambda angle: 1.0)
    return np.array([abs(expression.evaluate(largest, bounds)) for expression in model.expressions])


def moments(model: VesselModel, rows: Array, parameters: Sequence[str]) -> tuple[Array, Array]:
    """X = mean Phi Phi^T (p, p) and Y = mean Phi (p, n) for the named parameters, from regressor rows (k, all)."""
    chosen = [model.names.index(name) for name in parameters]
    terms = [model.terms[index] for index in chosen]
    kept = rows[:, chosen]
    same = np.array([[a.equation == b.equation for b in terms] for a in terms])
    member = np.array([[term.equation == output for output in model.outputs] for term in terms])
    return np.where(same, kept.T @ kept / len(kept), 0.0), np.where(member, kept.mean(axis=0)[:, None], 0.0)


def score_primitives(
    vessel: Vessel,
    primitives: Iterable[Primitive],
    *,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
) -> tuple[PrimitiveInformation, ...]:
    """Information of every primitive about the parameters to estimate.

    When a mean current or wind singles out headings, each primitive is simulated on `HEADINGS` evenly spread ones
    and its moments are averaged, because its heading is not known before the plan is.

    Raises:
        UnknownName: no such parameter or mean subtraction.
        InputError: nothing is left to estimate.
        Diverged: the nominal model is unstable.
    """
    names = estimated_parameters(vessel.model, fixed_parameters)
    if mean_subtraction not in MEAN_SUBTRACTIONS:
        raise UnknownName("mean subtraction", mean_subtraction, known=MEAN_SUBTRACTIONS)
    return tuple(
        _score(vessel, primitive, names, environment=environment, mean_subtraction=mean_subtraction)
        for primitive in primitives
    )


def _score(
    vessel: Vessel, primitive: Primitive, names: Sequence[str], *, environment: Environment, mean_subtraction: str
) -> PrimitiveInformation:
    headings = [0.0] if environment.isotropic else 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    pieces = [_run_rows(vessel, primitive, float(heading), environment) for heading in headings]
    runs = [moments(vessel.model, rows, names) for rows, _ in pieces]
    X, Y = np.mean([X for X, _ in runs], axis=0), np.mean([Y for _, Y in runs], axis=0)
    YZ = np.mean([Y @ Y.T for _, Y in runs], axis=0)
    taken = {"none": np.zeros_like(X), "batch": YZ, "complete": Y @ Y.T}[mean_subtraction]
    return PrimitiveInformation(
        primitive=primitive,
        X=X,
        Y=Y,
        Z=Y,
        YZ=YZ,
        log_det_alone=log_det_or_none(X - taken, np.diag(X)),
        excitation_condition=all(holds for _, holds in pieces),
    )


def _run_rows(vessel: Vessel, primitive: Primitive, heading: float, environment: Environment) -> tuple[Array, bool]:
    current_b = np.array(to_body(environment.current_to, heading, NUMPY))
    start = primitive.entry_velocity + np.append(current_b, 0.0)
    trajectory = simulate(vessel, primitive.commands, pose=(0.0, 0.0, heading), velocity=start, environment=environment)
    rows = regressor_rows(vessel.model, trajectory, primitive.commands, environment)
    return rows, excitation_condition(vessel, trajectory, primitive.commands, environment)


def excitation_condition(
    vessel: Vessel, trajectory: Trajectory, commands: Commands, environment: Environment, *, sigmas: float = 3.0
) -> bool:
    """Whether everything inside a modulus keeps its sign and stays clear of zero by `sigmas` deviations.

    The deviation counts the sensors' noise and the stated spread of current (through water) and wind (through air), as
    far as they move what is inside the modulus; moduli of commands only have to keep their sign.

    Source: F. Ljungberg, doctoral thesis, Linköping University, assumptions A5 and A7, (5.8).
    """
    table = _signals(vessel.model, trajectory, commands, environment)
    noise = _signal_noise(vessel, environment)
    moduli = [modulus for expression in vessel.model.expressions for modulus in expression.moduli]
    return all(_keeps_clear(modulus, table, noise, sigmas) for modulus in moduli)


def _signal_noise(vessel: Vessel, environment: Environment) -> dict[str, float]:
    """Standard deviation of what a sensor says of each motion signal about the disturbed true one."""
    sensors = vessel.sensors
    water = math.hypot(sensors.velocity_mps, environment.current_std_mps)
    air = math.hypot(sensors.velocity_mps, sensors.wind_mps, environment.wind_std_mps)
    return {"u": water, "v": water, "r": sensors.yaw_rate_radps, "u_q": air, "v_q": air}


def _keeps_clear(modulus: Expression, table: Signals, noise: Mapping[str, float], sigmas: float) -> bool:
    inside = np.asarray(modulus.evaluate(table, NUMPY))
    shifted = (
        modulus.evaluate({**table, name: table[name] + noise[name]}, NUMPY) for name in modulus.signals if name in noise
    )
    margin = sigmas * np.sqrt(sum(((other - inside) ** 2 for other in shifted), np.zeros_like(inside)))
    return bool(np.all(inside > margin) or np.all(inside < -margin))


def log_det_or_none(information: Array, squares: Array) -> float | None:
    """log det of an information matrix, or None when it is singular to working precision, whatever its scaling.

    Args:
        information: (p, p) symmetric, after means were taken off.
        squares: (p,) mean squares of the regressors, its diagonal before.
    """
    if _blind(information, squares).any():
        return None
    scale = np.sqrt(np.diag(information))
    return float(np.linalg.slogdet(information / np.outer(scale, scale))[1] + 2 * np.log(scale).sum())


def check_informative(information: Sequence[PrimitiveInformation], names: Sequence[str], mean_subtraction: str) -> None:
    """Refuse a dictionary that cannot tell all parameters apart.

    Raises:
        NotInformative: naming the parameters in the null space of the equal-share information matrix.
    """
    X = np.mean([item.X for item in information], axis=0)
    S = np.mean([item.Y for item in information], axis=0)
    YZ = np.mean([item.YZ for item in information], axis=0)
    taken = {"none": np.zeros_like(X), "batch": YZ, "complete": S @ S.T}[mean_subtraction]
    unseen = _blind(X - taken, np.diag(X))
    if not unseen.any():
        return
    blind = tuple(name for name, is_unseen in zip(names, unseen, strict=True) if is_unseen)
    raise NotInformative(
        f"the dictionary cannot tell these parameters apart: {', '.join(blind)}; add primitives that excite them, "
        "state a mean wind if they are W terms, or list some in design.fixed_parameters",
        parameters=blind,
    )


def _blind(information: Array, squares: Array) -> Array:
    """(p,) whether a parameter moves nothing beyond its mean, or nothing that the others could not move alike.

    The limits allow for what subtracting means leaves of rounding.
    """
    spread = np.diag(information)
    blind = ~(spread > 1e-9 * squares)
    seen = np.flatnonzero(~blind)
    if not len(seen):
        return np.asarray(blind)
    scale = np.sqrt(spread[seen])
    values, vectors = np.linalg.eigh(information[np.ix_(seen, seen)] / np.outer(scale, scale))
    rounding = 1e-11 + 1e-15 * float((squares[seen] / spread[seen]).max())
    null = vectors[:, values < rounding * values[-1]]
    blind[seen[np.linalg.norm(null, axis=1) > 0.05]] = True
    return np.asarray(blind)
