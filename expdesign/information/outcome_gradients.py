"""Gradients of predicted outcomes of standard trials, by central differences of the simulated trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.errors import NoAnswer
from expdesign.indices import outcomes
from expdesign.progress import Progress, silent
from expdesign.simulation.helm import steady_ahead
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

PARAMETER_STEP = 1e-3  # relative step of central differences in a parameter
GRADIENT_AGREEMENT = 0.05  # change of a gradient when the step is halved, relative to the outcome's largest gradient


@dataclass(frozen=True, kw_only=True, eq=False)
class OutcomeGradients:
    """Outcomes and their gradients."""

    names: tuple[str, ...]  # of the outcomes
    values: Array  # (o,) at the nominal parameters
    gradients: Array  # (o, p) derivative by each parameter

    def __post_init__(self) -> None:
        seal(self, values="o", gradients="o p")


def outcome_gradients(
    vessel: Vessel,
    names: Sequence[str],
    parameters: Sequence[str],
    *,
    speed_mps: float | None = None,
    progress: Progress = silent,
) -> OutcomeGradients:
    """Gradients of named outcomes by named parameters, at the nominal model.

    Args:
        vessel: nominal.
        names: keys of `indices.OUTCOMES`.
        parameters: p names.
        speed_mps: approach speed for all parameter values; that of the nominal model when not given.

    Raises:
        InputError: the vessel cannot run a trial, or a name is not an outcome.
        NoAnswer: a trial does not end, or an outcome is not smooth in a parameter.
    """
    speed = float(steady_ahead(vessel, speed_mps).velocity[0])
    theta = vessel.model.parameters

    def found(values: Array) -> Array:
        table = outcomes(vessel, speed_mps=speed, parameters=values, names=tuple(names))
        return np.array([table[name] for name in names])

    base = found(theta)
    slopes, sizes = [], []
    for number, name in enumerate(parameters):
        progress("simulating standard trials with other parameters", number / len(parameters))
        index = vessel.model.names.index(name)
        sizes.append(abs(float(theta[index])) or float(np.median(np.abs(theta[theta != 0]))))
        slopes.append(_slopes(found, theta, index, sizes[-1]))
    coarse, fine = np.array(slopes).transpose(1, 2, 0)  # (o, p) each
    _check_smooth(coarse * sizes, fine * sizes, names, parameters)
    return OutcomeGradients(names=tuple(names), values=base, gradients=(4 * fine - coarse) / 3)


def _slopes(found: Callable[[Array], Array], theta: Array, index: int, size: float) -> list[Array]:
    """Central differences (o,) in one parameter, with the step and with half of it."""
    slopes = []
    for step in (PARAMETER_STEP * size, PARAMETER_STEP * size / 2):
        moved = np.zeros_like(theta)
        moved[index] = step
        slopes.append((found(theta + moved) - found(theta - moved)) / (2 * step))
    return slopes


def _check_smooth(coarse: Array, fine: Array, names: Sequence[str], parameters: Sequence[str]) -> None:
    """Refuse gradients (o, p), as effects of relative changes, that depend on the step."""
    jumps = np.argwhere(np.abs(coarse - fine) > GRADIENT_AGREEMENT * np.abs(fine).max(axis=1, keepdims=True))
    if len(jumps):
        o, p = jumps[0]
        raise NoAnswer(
            f"outcome {names[o]} is not smooth in {parameters[p]}: its derivative by a relative change is "
            f"{coarse[o, p]:.3g} with a step of {PARAMETER_STEP:g} and {fine[o, p]:.3g} with half of that"
        )
