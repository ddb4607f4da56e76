"""Moments of regressors and instruments from a noise-free simulation.

The thesis estimates X, Y and Z of a primitive from data or simulation (7.50)-(7.55). Here regressors and instruments
come from the same noise-free run of the nominal model, so Z = Phi, X is symmetric, and the design problem is convex.

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.57).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.information.primitive_information import PrimitiveInformation
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, relative_velocity, simulate, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, VesselModel

HEADINGS = 8
"""Headings over which information is averaged when wind or current make it depend on them."""


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
    """(k, p) value of every term at every command's start, under the environment's mean current and wind."""
    k = len(commands)
    state = (*trajectory.pose[:k].T, *trajectory.velocity[:k].T)
    water, air = relative_velocity(state, environment.current_to, environment.wind_to, NUMPY)
    rows = model.regressors(water, air, commands.values.T, NUMPY)
    return np.stack([np.broadcast_to(row, (k,)) for row in rows], axis=1).astype(float)


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
    """
    names = estimated_parameters(vessel.model, fixed_parameters)
    return tuple(
        _score(vessel, primitive, names, environment=environment, subtract=mean_subtraction != "none")
        for primitive in primitives
    )


def _score(
    vessel: Vessel, primitive: Primitive, names: Sequence[str], *, environment: Environment, subtract: bool
) -> PrimitiveInformation:
    headings = [0.0] if environment.isotropic else 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    pieces = [_run_rows(vessel, primitive, float(heading), environment) for heading in headings]
    rows = np.concatenate([rows for rows, _ in pieces])
    X, Y = moments(vessel.model, rows, names)
    return PrimitiveInformation(
        primitive=primitive,
        X=X,
        Y=Y,
        Z=Y,
        log_det_alone=log_det_or_none(X - Y @ Y.T if subtract else X),
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

    The deviation counts the velocity sensor's noise and the stated spread of current (through water) or wind (through
    air). Source: F. Ljungberg, doctoral thesis, Linköping University, assumptions A5 and A7, (5.8).
    """
    k = len(commands)
    state = (*trajectory.pose[:k].T, *trajectory.velocity[:k].T)
    water, air = relative_velocity(state, environment.current_to, environment.wind_to, NUMPY)
    table = vessel.model.signals(water, air, commands.values.T, NUMPY)
    for expression in vessel.model.expressions:
        spread = environment.wind_std_mps if {"u_q", "v_q"} & set(expression.signals) else environment.current_std_mps
        margin = sigmas * float(np.hypot(vessel.sensors.velocity_mps, spread))
        for modulus in expression.moduli:
            inside = np.asarray(modulus.evaluate(table, NUMPY))
            if not (np.all(inside > margin) or np.all(inside < -margin)):
                return False
    return True


def log_det_or_none(matrix: Array) -> float | None:
    """log det of a symmetric matrix, or None when it is singular to working precision whatever its scaling."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    if not (scale > 0).all():
        return None
    eigenvalues = np.linalg.eigvalsh(matrix / np.outer(scale, scale))
    if eigenvalues[0] < 1e-11 * eigenvalues[-1]:
        return None
    return float(np.log(eigenvalues).sum() + 2 * np.log(scale).sum())


def check_informative(information: Sequence[PrimitiveInformation], names: Sequence[str], mean_subtraction: str) -> None:
    """Refuse a dictionary that cannot tell all parameters apart.

    Raises:
        NotInformative: naming the parameters in the null space of the equal-share information matrix.
    """
    X = np.mean([item.X for item in information], axis=0)
    if mean_subtraction == "complete":
        S = np.mean([item.Y for item in information], axis=0)
        X = X - S @ S.T
    elif mean_subtraction == "batch":
        X = X - np.mean([item.Y @ item.Z.T for item in information], axis=0)
    if log_det_or_none(X) is not None:
        return
    blind = _null_parameters(X, names)
    raise NotInformative(
        f"the dictionary cannot tell these parameters apart: {', '.join(blind)}; add primitives that excite them, "
        "state a mean wind if they are W terms, or list some in design.fixed_parameters",
        parameters=blind,
    )


def _null_parameters(matrix: Array, names: Sequence[str]) -> tuple[str, ...]:
    scale = np.sqrt(np.diag(matrix).clip(0))
    dark = scale <= 1e-9 * max(scale.max(), 1e-300)
    if dark.any():
        return tuple(name for name, unseen in zip(names, dark, strict=True) if unseen)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    null = vectors[:, values < 1e-11 * values[-1]]
    weight = np.abs(null).max(axis=1)
    return tuple(name for name, share in zip(names, weight, strict=True) if share > 0.05)
