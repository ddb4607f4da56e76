"""The aim of a design: a criterion with its settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.durations.criteria.measures import Measure
from expdesign.errors import InputError, UnknownName
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Aim:
    """A criterion with its settings.

    The noise of an equation is the standard deviation of its one-step residual; M / noise^2 is information in the units
    of the parameters. D and D_s do not depend on it, because each parameter stands in one equation. A, E and V compare
    parameters of different equations and need it.
    """

    criterion: str = "D"  # name in `CRITERIA`
    interest: tuple[str, ...] = ()  # parameters of interest, without those of disturbances; empty for all
    # (p,) unit of the error of each parameter in A and E, e.g. |theta|; empty when not stated, zero where unknown.
    unit: Array = field(default_factory=lambda: np.zeros(0))
    # (p,) residual noise of each parameter's equation; empty when not stated, zero where unknown
    noise: Array = field(default_factory=lambda: np.zeros(0))
    outcomes: tuple[str, ...] = ()  # names of the predicted outcomes
    # (o, p) derivative of each outcome by the parameters, in the outcome's unit of error
    gradients: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        seal(self, unit="a", noise="b", gradients="o g")


@dataclass(frozen=True, kw_only=True)
class Picked:
    """The arguments of a criterion."""

    aim: Aim  # the criterion's settings
    parameters: tuple[str, ...]  # p names
    dimension: int  # d, size of the information matrix: parameters, then means

    def columns(self, names: tuple[str, ...]) -> Array:
        """(d, k) unit columns of named parameters.

        Raises:
            UnknownName: no such parameter.
        """
        for name in names:
            if name not in self.parameters:
                raise UnknownName("parameter of interest", name, known=self.parameters)
        return np.eye(self.dimension)[:, [self.parameters.index(name) for name in names]]

    @property
    def interest(self) -> tuple[str, ...]:
        """Names of the parameters of interest."""
        return self.aim.interest or self.parameters

    def scaled_columns(self, criterion: str) -> Array:
        """(d, k) columns of the parameters of interest, each times its noise over its unit of error.

        Raises:
            InputError: a unit or a noise is not stated.
        """
        unit = self._stated(self.aim.unit, criterion, "a unit other than zero", self.interest)
        noise = self.noise(criterion, self.interest)
        return self.columns(self.interest) * (noise / unit)

    def noise(self, criterion: str, names: tuple[str, ...]) -> Array:
        """(k,) residual noise of the equations of named parameters.

        Raises:
            InputError: it is not stated.
        """
        return self._stated(self.aim.noise, criterion, "the sensors' noise in its equation", names)

    def _stated(self, values: Array, criterion: str, what: str, names: tuple[str, ...]) -> Array:
        known: Mapping[str, float] = dict(zip(self.parameters, values.tolist(), strict=False))
        missing = [name for name in names if not known.get(name, 0.0) > 0.0]
        if missing:
            raise InputError(f"criterion {criterion} needs {what} for {', '.join(missing)}")
        return np.array([known[name] for name in names])


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """A design criterion."""

    name: str  # as in scenario files
    title: str  # the quantity that it minimises
    measure: Callable[[Picked], Measure]  # of the information matrix; raises InputError when the aim lacks a setting


def of_other_parameters(picked: Picked) -> Measure:
    """Criterion T has no measure of the model's parameters: see `concave.least_of_floors`.

    Raises:
        InputError: always.
    """
    raise InputError("criterion T needs causes in design.reveal or design.tell_apart")


def prediction_columns(picked: Picked) -> Array:
    """(d, o) derivatives of the outcomes by the parameters, times the residual noise of their equations.

    Raises:
        InputError: the outcomes are not stated, or no estimated parameter affects them.
    """
    aim, p = picked.aim, len(picked.parameters)
    if not aim.gradients.size:
        raise InputError("criterion V needs outcomes to predict")
    if aim.gradients.shape[1] != p:
        raise InputError(f"gradients of outcomes have {aim.gradients.shape[1]} columns for {p} parameters")
    moved = tuple(name for name, column in zip(picked.parameters, aim.gradients.T, strict=True) if column.any())
    if not moved:
        raise InputError(f"no estimated parameter affects {', '.join(aim.outcomes)}")
    L = np.zeros((picked.dimension, len(aim.gradients)))
    index = [picked.parameters.index(name) for name in moved]
    L[index] = (aim.gradients[:, index] * picked.noise("V", moved)).T
    return L
