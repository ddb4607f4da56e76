"""The manoeuvring model: regressors and accelerations, written once for floats, NumPy arrays and CasADi symbols.

    d/dt nu = (1/T) Phi(nu, inputs)^T theta        T = sample time in discrete form, 1 in continuous form

so the explicit Euler map at the sample time is nu(k+1) = nu(k) + Phi^T theta with discrete parameters.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.58)-(3.64).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, UnknownName
from expdesign.values import Array, readonly
from expdesign.vessel.actuators import Actuator, generalised_force
from expdesign.vessel.roll import Roll
from expdesign.vessel.structures import (
    FORCE_SIGNALS,
    MOTION_SIGNALS,
    NUMPY,
    SHOAL,
    Expression,
    Operators,
    Signals,
    Term,
    parse_expression,
)

# Coupled inertia of sway and yaw, as of a ship whose centre of gravity is not at the origin of the b-frame.
#
#     [ sway_kg       sway_yaw_kgm ] [ dv/dt ]   [ sway_kg   Y(u, v, r, ...) ]
#     [ yaw_sway_kgm  yaw_kgm2     ] [ dr/dt ] = [ yaw_kgm2  N(u, v, r, ...) ]
#
# Y and N are what the model's terms say: the accelerations were there no coupling. For a rigid body of mass m with
# added mass and its centre of gravity x_g ahead of midships, the four numbers are m - Y_dv, m x_g - Y_dr, m x_g - N_dv
# and I_z - N_dr, with I_z about midships. Coriolis forces are terms: m x_g r^2 in surge, m u r in sway, m x_g u r in
# yaw. The accelerations stay linear in the parameters, as the matrix is known from the vessel file.
#
# Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), (6.41)-(6.44).


@dataclass(frozen=True, kw_only=True)
class Inertia:
    """The matrix."""

    sway_kg: float  # mass with added mass in sway [kg], positive
    yaw_kgm2: float  # moment of inertia with added inertia in yaw, about midships [kg m2], positive
    sway_yaw_kgm: float  # sway force per yaw acceleration [kg m]
    yaw_sway_kgm: float | None = None  # yaw moment per sway acceleration [kg m]; None where it is the same

    def __post_init__(self) -> None:
        for name in ("sway_kg", "yaw_kgm2"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"inertia.{name} is {getattr(self, name):g}, expected more than 0")
        if not self._determinant > 0:
            raise InputError(
                f"inertia.sway_yaw_kgm is {self.sway_yaw_kgm:g}, expected a product with the other coupling of less "
                f"than sway_kg times yaw_kgm2, {self.sway_kg * self.yaw_kgm2:g}"
            )

    @property
    def arm_m(self) -> float:
        """Sway acceleration per yaw acceleration [m], but for the sign."""
        return self.sway_yaw_kgm / self.sway_kg

    @property
    def turn_per_m(self) -> float:
        """Yaw acceleration per sway acceleration [rad/m], but for the sign."""
        return (self.sway_yaw_kgm if self.yaw_sway_kgm is None else self.yaw_sway_kgm) / self.yaw_kgm2

    @property
    def _determinant(self) -> float:
        return 1.0 - self.arm_m * self.turn_per_m

    def coupled(self, sway: Any, yaw: Any) -> tuple[Any, Any]:
        """dv/dt and dr/dt from those without coupling; numbers, arrays or symbols."""
        scale = 1.0 / self._determinant
        return scale * (sway - self.arm_m * yaw), scale * (yaw - self.turn_per_m * sway)

    def uncoupled(self, sway: Any, yaw: Any) -> tuple[Any, Any]:
        """The inverse of `coupled`."""
        return sway + self.arm_m * yaw, yaw + self.turn_per_m * sway


NOT_SUPPORTED = (
    "the vessel's model has coupled inertia, [model.inertia], which {what} does not support; expected a vessel file "
    "without that table"
)

UNSTATED_SHARE = 0.1  # standard deviation, as a share of the value, with which drawn ships differ where none is stated
FEWEST_DRAWN = 1000
SHARE_DRAWN = 2500
FAR_OUTSIDE = 3.0  # standard deviations outside of its range from which on a parameter contradicts it
LEAST_KEPT = 1e-3  # share of drawn vessels within the stated range below which the range contradicts the prior


@dataclass(frozen=True, kw_only=True)
class Missed:
    """By how much predictions as long as a standard trial miss runs that they have not seen, standard deviations."""

    way_share: float  # of the way sailed ahead
    turn_share: float  # of the heading turned


@dataclass(frozen=True, kw_only=True, eq=False)
class VesselModel:
    """Model structure with parameter values."""

    terms: tuple[Term, ...]  # the rows of the regressor matrix, in parameter order
    parameters: Array  # (p,) parameter values in that order
    parameter_std: Array  # (p,) prior standard deviations, zero where the value counts as known
    form: str  # "discrete" (parameters hold the sample time) or "continuous"
    sample_time_s: float  # of the discrete form [s]
    actuators: tuple[Actuator, ...]  # they turn commands into generalised forces
    roll: Roll | None = None  # a mode that oscillates beside what the terms say, or None
    inertia: Inertia | None = None  # coupled inertia of sway and yaw; None where neither accelerates the other
    # of pairs of them, by their names; zero for others. Names that are no parameters are ignored.
    parameter_correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)
    # least and most value of parameters by name, on which the prior is conditioned: the signs of damping and thrust of
    # a vessel that is known to be stable, for example
    parameter_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # standard deviation of drawn ships in parameters, by name, where the file states none. It is no prior: estimates
    # and designs take nothing from it. Names that have a standard deviation, or are no parameters, are ignored
    unstated_std: Mapping[str, float] = field(default_factory=dict)
    # least and most surge speed of the data that determined the parameters, where known
    speeds_mps: tuple[float, float] | None = None
    missed: Missed | None = None  # what the same method missed of runs of these data that it had not seen, where known
    expressions: tuple[Expression, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", readonly(self.parameters))
        object.__setattr__(self, "parameter_std", readonly(self.parameter_std))
        if not self.parameters.shape == self.parameter_std.shape == (len(self.terms),):
            raise InputError(f"VesselModel has {len(self.terms)} terms but {self.parameters.shape} parameters")
        names = self.names
        if len(set(names)) < len(names):
            repeated = sorted({name for name in names if names.count(name) > 1})
            raise InputError(f"model terms repeat the parameter names {', '.join(repeated)}")
        if self.form not in ("discrete", "continuous"):
            raise UnknownName("model form", self.form, known=("discrete", "continuous"))
        for term in self.terms:
            if term.equation not in OUTPUTS:
                raise UnknownName(f"equation of term {term.name}", term.equation, known=OUTPUTS)
        known = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *self.inputs)))
        parsed = tuple(parse_expression(term.expression, signals=known) for term in self.terms)
        object.__setattr__(self, "expressions", parsed)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names in order."""
        return tuple(term.name for term in self.terms)

    @property
    def drawn_std(self) -> Array:
        """(p,) standard deviations of drawn ships: `parameter_std`, or else `unstated_std`."""
        stated = zip(self.names, self.parameter_std.tolist(), strict=True)
        return np.array([std or self.unstated_std.get(name, 0.0) for name, std in stated])

    @property
    def parameter_covariance(self) -> Array:
        """(p, p) prior covariance of the parameters."""
        return np.asarray(self.parameter_correlation_matrix * np.outer(self.parameter_std, self.parameter_std))

    @cached_property
    def parameter_correlation_matrix(self) -> Array:
        """(p, p) prior correlation of the parameters."""
        index = {name: place for place, name in enumerate(self.names)}
        correlation = np.eye(len(index))
        for (one, other), value in self.parameter_correlation.items():
            if one in index and other in index:
                correlation[index[one], index[other]] = correlation[index[other], index[one]] = value
        return readonly(correlation)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """The velocities that have an equation, in the order u, v, r; the others stay zero."""
        return tuple(name for name in OUTPUTS if any(term.equation == name for term in self.terms))

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Actuator signals in command order."""
        return tuple(name for actuator in self.actuators for name in actuator.signals)

    @property
    def states(self) -> int:
        """Pose and velocity, and with a roll mode its angle and rate."""
        return 6 if self.roll is None else 8

    @property
    def time_scale_s(self) -> float:
        """Divides Phi^T theta to give accelerations [s]."""
        return self.sample_time_s if self.form == "discrete" else 1.0

    @property
    def reads_air(self) -> bool:
        """Whether a term reads a velocity through air."""
        return any({"u_q", "v_q"} & set(expression.signals) for expression in self.expressions)

    def read_signals(self, equation: str = "") -> frozenset[str]:
        """Signals read by the terms, of one equation or of all, whose parameter is not zero for certain."""
        acting = (self.parameters != 0) | (self.parameter_std > 0)
        terms = zip(self.terms, self.expressions, acting.tolist(), strict=True)
        return frozenset(
            name for term, expression, acts in terms if acts and term.equation.startswith(equation)
            for name in expression.signals
        )  # fmt: skip

    @property
    def unread_inputs(self) -> tuple[str, ...]:
        """Actuator signals that move no ship: neither they nor the forces they give are read."""
        read = self.read_signals()

        def acts(actuator: Actuator) -> bool:
            forces = actuator.force(dict.fromkeys(actuator.signals, 1.0), NUMPY)
            return any(force and name in read for force, name in zip(forces, FORCE_SIGNALS, strict=True))

        return tuple(name for one in self.actuators for name in one.signals if name not in read and not acts(one))

    @property
    def reads_depth(self) -> bool:
        """Whether a term depends on the depth of the water."""
        return any(SHOAL in expression.signals for expression in self.expressions)

    def with_parameters(self, values: Mapping[str, float] | Array) -> VesselModel:
        """The model with other parameter values, all (p,) or some by name."""
        if not isinstance(values, Mapping):
            return replace(self, parameters=values)
        for name in values:
            if name not in self.names:
                raise UnknownName("parameter", name, known=self.names)
        return replace(
            self, parameters=readonly([values.get(n, old) for n, old in zip(self.names, self.parameters, strict=True)])
        )

    def with_covariance(self, names: Sequence[str], covariance: Array) -> VesselModel:
        """The model with another prior covariance of its parameters; those not named count as known.

        Args:
            covariance: (n, n) of these.
        """
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        scale = np.where(std > 0, std, np.inf)
        correlation = covariance / np.outer(scale, scale)
        own = dict(zip(names, std.tolist(), strict=True))
        return replace(
            self,
            parameter_std=np.array([own.get(name, 0.0) for name in self.names]),
            unstated_std={},
            parameter_correlation={
                (names[i], names[j]): float(correlation[i, j])
                for i, j in zip(*np.nonzero(np.tril(correlation, -1)), strict=True)
            },
        )

    def with_kept_ranges(self) -> VesselModel:
        """The model without the ranges that its own values contradict, whose ships could not be drawn.

        They are `FAR_OUTSIDE` standard deviations outside: data say otherwise than the vessel file.
        """
        kept = self.parameter_range.keys() - self.contradicted_ranges
        return replace(self, parameter_range={name: self.parameter_range[name] for name in self.names if name in kept})

    @property
    def contradicted_ranges(self) -> tuple[str, ...]:
        """Parameters whose value is far outside the range that is stated of them."""
        rows = zip(self.names, self.parameters.tolist(), self.drawn_std.tolist(), strict=True)
        ranged = [
            (name, value, std, *self.parameter_range[name]) for name, value, std in rows if name in self.parameter_range
        ]
        return tuple(
            name for name, value, std, low, high in ranged if max(low - value, value - high) > FAR_OUTSIDE * std
        )

    def drawn_parameters(self, count: int, rng: np.random.Generator) -> Array:
        """(count, p) parameters drawn from the normal prior and `unstated_std`, conditioned on `parameter_range`.

        Raises:
            InputError: hardly any vessel of the prior is within the range.
        """
        if not self.parameter_range:
            return self._normal_parameters(count, rng)
        kept: list[Array] = []
        tried = 0
        while (missing := count - sum(map(len, kept))) > 0:
            drawn = self._normal_parameters(max(2 * missing, FEWEST_DRAWN), rng)
            tried += len(drawn)
            kept.append(drawn[self._in_range(drawn)])
            if sum(map(len, kept)) < LEAST_KEPT * tried:
                raise InputError(
                    f"of the vessels drawn from model.parameter_std fewer than {LEAST_KEPT:.1%} are within "
                    "model.parameter_min and model.parameter_max: state less uncertainty, or values inside"
                )
        return np.concatenate(kept)[:count]

    def share_in_range(self) -> float:
        """The share of the normal prior that is within `parameter_range`, to about 1 %."""
        drawn = self._normal_parameters(SHARE_DRAWN, np.random.default_rng(0))
        return float(self._in_range(drawn).mean())

    def _in_range(self, drawn: Array) -> npt.NDArray[np.bool_]:
        """(n,) whether parameters (n, p) are within the range."""
        low, high = np.array([self.parameter_range.get(name, (-np.inf, np.inf)) for name in self.names]).T
        return np.asarray(((low <= drawn) & (drawn <= high)).all(axis=1))

    def _normal_parameters(self, count: int, rng: np.random.Generator) -> Array:
        """(count, p) parameters drawn from the normal prior."""
        drawn = rng.standard_normal((count, len(self.terms)))
        if not self.parameter_correlation:
            return np.asarray(self.parameters + self.drawn_std * drawn)
        covariance = self.parameter_covariance + np.diag(self.drawn_std**2 - self.parameter_std**2)
        values, vectors = np.linalg.eigh(covariance)
        return np.asarray(self.parameters + drawn @ (vectors * np.sqrt(np.maximum(values, 0.0))).T)

    def regressors(self, velocity_r: Any, velocity_q: Any, inputs: Any, ops: Operators = NUMPY) -> tuple[Any, ...]:
        """Value of every term, in parameter order.

        Args:
            velocity_r: (u, v, r) through water; each entry a number, an array or a symbol.
            velocity_q: (u_q, v_q) through air.
            inputs: actuator signals in the order of `inputs`.
            ops: the functions for that kind of number.
        """
        signals = self.signals(velocity_r, velocity_q, inputs, ops)
        return tuple(expression.evaluate(signals, ops) for expression in self.expressions)

    def accelerations(
        self, velocity_r: Any, velocity_q: Any, inputs: Any, ops: Operators = NUMPY, parameters: Any = None
    ) -> tuple[Any, Any, Any]:
        """d/dt (u, v, r) [m/s2, m/s2, rad/s2] by the terms, without roll.

        Arguments are as in `regressors`, other parameter values optional.
        """
        theta = self.parameters if parameters is None else parameters
        totals: dict[str, Any] = dict.fromkeys(OUTPUTS, 0.0)
        values = self.regressors(velocity_r, velocity_q, inputs, ops)
        for index, (term, value) in enumerate(zip(self.terms, values, strict=True)):
            totals[term.equation] = totals[term.equation] + theta[index] * value
        scale = 1.0 / self.time_scale_s
        sway, yaw = totals["v"] * scale, totals["r"] * scale
        return totals["u"] * scale, *(self.inertia.coupled(sway, yaw) if self.inertia else (sway, yaw))

    def signals(self, velocity_r: Any, velocity_q: Any, inputs: Any, ops: Operators) -> Signals:
        """The table of everything an expression may read; the water is deep unless depth is among the inputs."""
        u, v, r = velocity_r
        u_q, v_q = velocity_q
        commands = dict(zip(self.inputs, inputs, strict=True))
        forces = dict(zip(FORCE_SIGNALS, generalised_force(self.actuators, commands, ops), strict=True))
        return {"u": u, "v": v, "r": r, "u_q": u_q, "v_q": v_q, SHOAL: 0.0, **forces, **commands}
