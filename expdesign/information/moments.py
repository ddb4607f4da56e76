"""Moments of regressors and instruments from a noise-free simulation.

The thesis estimates X, Y and Z of a primitive from data or simulation (7.50)-(7.55). Here regressors and instruments
come from the same noise-free run of the nominal model, so Z = Phi, X is symmetric, and the design problem is convex.

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.57).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from expdesign.dictionary.spec import Primitive
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, relative_velocity
from expdesign.simulation.motion import State
from expdesign.values import Array, frozen_set, seal
from expdesign.vessel import NOT_SUPPORTED, NUMPY, Operators, VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS, Signals

HEADINGS = 8  # evenly spread headings over which information is averaged in wind or current
RUNS_AT_ONCE = 2048  # runs simulated together, so that their states stay in the processor's cache

REGRESSOR_ROUNDING = 1e-12  # a regressor below this share of its possible size is rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class PrimitiveInformation:
    """Per-sample moments of regressors and instruments over one run (thesis (7.50)-(7.55))."""

    primitive: Primitive  # the manoeuvre
    X: Array  # (p, p) mean of Phi Z^T
    # (p, n) mean of Phi; with samples of each equation's own, over the samples of each stratum, of which n counts all
    # of all equations, times their share of the run
    Y: Array
    Z: Array  # (p, n) mean of the instruments
    YZ: Array  # (p, p) to subtract from X in batch mean subtraction: the mean of Y Z^T over headings
    # log det of its own information matrix under the design's mean subtraction, or None if singular
    log_det_alone: float | None
    excitation_condition: bool  # whether every argument of a modulus keeps its sign, with a margin for the stated noise
    excites: Mapping[str, bool] = field(default_factory=dict)  # the same by equation, for the moduli in its terms
    # share of the samples that meet it, by equation; where it is required, 0 for runs that do not
    clear_share: Mapping[str, float] = field(default_factory=dict)
    # (n,) share of the run's samples in each column of Y; 1 where all are used
    used: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not self.used.size:
            frozen_set(self, "used", np.ones(self.Y.shape[1]))
        seal(self, X="p p", Y="p n", Z="p n", YZ="p p", used="n")


def over_shares(Y: Array, used: Array) -> Array:
    """(..., p, n) columns of Y over their shares (..., n); zero where nothing is used."""
    shares = used[..., None, :]
    return np.divide(Y, shares, out=np.zeros_like(Y), where=shares > 0)


MEAN_SUBTRACTIONS = ("none", "batch", "complete")


def estimated_parameters(model: VesselModel, fixed: Sequence[str]) -> tuple[str, ...]:
    """Names of the parameters to estimate: all but the fixed ones.

    Raises:
        UnknownName: a fixed name is not a parameter.
        InputError: every parameter is fixed, or inertia is coupled.
    """
    if model.inertia is not None:
        raise InputError(NOT_SUPPORTED.format(what="information"))
    for name in fixed:
        if name not in model.names:
            raise UnknownName("parameter", name, known=model.names)
    kept = tuple(name for name in model.names if name not in fixed)
    if not kept:
        raise InputError("fixed_parameters names every parameter, expected at least one parameter to estimate")
    return kept


def regressor_rows(model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment) -> Array:
    """(k, p) value of every term at every command's start, under the environment's mean current and wind.

    Commands are the inputs that the actuators deliver, `simulation.delivered`. A term that differs from zero only by
    rounding throughout the run is set to zero.
    """
    return rows_of(model, _signals(model, trajectory, commands, environment), (len(commands),)).T


def _signals(model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment) -> Signals:
    """All signals of terms, at every command's start."""
    k = len(commands)
    state = (*trajectory.pose[:k].T, *trajectory.velocity[:k].T)
    return signals_of(model, state, commands.values.T, environment)


def signals_of(model: VesselModel, state: State, inputs: Array, environment: Environment) -> Signals:
    """All signals of terms, for states and inputs of any shape (k, ...)."""
    water, air = relative_velocity(state, environment.current_to, environment.wind_to, NUMPY)
    return model.signals(water, air, inputs, NUMPY)


def rows_of(model: VesselModel, table: Signals, shape: tuple[int, ...]) -> Array:
    """(p, k, ...) value of every term, for signals that broadcast to (k, ...); rounding counts as zero."""
    rows = np.empty((len(model.expressions), *shape))
    for row, expression in zip(rows, model.expressions, strict=True):
        row[...] = expression.evaluate(table, NUMPY)
    largest = np.maximum(rows.max(axis=1), -rows.min(axis=1))
    rounding = largest <= REGRESSOR_ROUNDING * _magnitudes(model, table, shape[1:])
    if rounding.any():
        np.multiply(rows, ~rounding[:, None], out=rows)
    return rows


def _magnitudes(model: VesselModel, table: Signals, shape: tuple[int, ...]) -> Array:
    """(p, ...) every term with its signals replaced by the largest of their kind in the run."""
    largest = {name: np.broadcast_to(np.abs(values).max(axis=0), shape) for name, values in table.items()}
    for kind in (MOTION_SIGNALS, FORCE_SIGNALS):
        largest.update(dict.fromkeys(kind, np.max([largest[name] for name in kind], axis=0)))
    bounds = Operators(abs, np.ones_like, np.ones_like)
    return np.array(
        [np.broadcast_to(np.abs(expression.evaluate(largest, bounds)), shape) for expression in model.expressions]
    )


def moments(model: VesselModel, rows: Array, parameters: Sequence[str]) -> tuple[Array, Array]:
    """X = mean Phi Phi^T (p, p) and Y = mean Phi (p, n) for the named parameters, from regressor rows (k, all)."""
    chosen = [model.names.index(name) for name in parameters]
    terms = [model.terms[index] for index in chosen]
    kept = rows[:, chosen]
    same = np.array([[a.equation == b.equation for b in terms] for a in terms])
    member = np.array([[term.equation == output for output in model.outputs] for term in terms])
    return np.where(same, kept.T @ kept / len(kept), 0.0), np.where(member, kept.mean(axis=0)[:, None], 0.0)


def log_det_or_none(information: Array, squares: Array) -> float | None:
    """log det of an information matrix, or None when it is singular to working precision in any scaling.

    Args:
        information: (p, p) symmetric, after mean subtraction.
        squares: (p,) mean squares of the regressors.
    """
    if _unidentifiable(information, squares).any():
        return None
    scale = np.sqrt(np.diag(information))
    return float(np.linalg.slogdet(information / np.outer(scale, scale))[1] + 2 * np.log(scale).sum())


def check_informative(information: Sequence[PrimitiveInformation], names: Sequence[str], mean_subtraction: str) -> None:
    """Refuse a dictionary from which not all parameters are identifiable.

    Raises:
        NotInformative: naming the parameters in the null space of the equal-share information matrix.
    """
    X = np.mean([item.X for item in information], axis=0)
    S = np.mean([item.Y for item in information], axis=0)
    YZ = np.mean([item.YZ for item in information], axis=0)
    used = np.mean([item.used for item in information], axis=0)
    taken = {"none": np.zeros_like(X), "batch": YZ, "complete": over_shares(S, used) @ S.T}[mean_subtraction]
    unidentifiable = _unidentifiable(X - taken, np.diag(X))
    if not unidentifiable.any():
        return
    blind = tuple(np.array(names)[unidentifiable].tolist())
    raise NotInformative(
        f"the dictionary cannot separate these parameters: {', '.join(blind)}; add primitives that excite them, "
        "state a mean wind if they are W terms, count what is known of them (model.parameter_std with design.prior = "
        "'parameter_std'), or list some in design.fixed_parameters",
        parameters=blind,
    )


def _unidentifiable(information: Array, squares: Array) -> Array:
    """(p,) whether a regressor is constant, or a linear combination of the others.

    The tolerances allow for the rounding of mean subtraction.
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
