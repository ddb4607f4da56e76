"""Limits on the standard deviations of parameters, and on the 95 % intervals of outcomes of standard trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.durations import DurationDesign
from expdesign.errors import InputError
from expdesign.information.outcome_gradients import outcome_gradients
from expdesign.information.prior import equation_noise
from expdesign.shortest_day.values import AccuracySettings
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

NORMAL_95 = 1.959963984540054
"""Half of the interval that holds a normal variable in 95 of 100 cases, in standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Limits:
    """Largest standard deviations of parameters and of outcomes.

    Attributes:
        names: of the k limited parameters and outcomes.
        slopes: (k, p) of each by the parameters.
        std: (k,) largest standard deviation of each.
        prior: (p, p) information known before, in the parameters' units.
        outcomes: how many of them, at the end, are outcomes.
    """

    names: tuple[str, ...]
    slopes: Array
    std: Array
    prior: Array
    outcomes: int = 0

    def __post_init__(self) -> None:
        seal(self, slopes="k p", std="k", prior="p p")

    def found(self, covariance: Array) -> Array:
        """(k,) standard deviations with estimates of a covariance (p, p), and what is known before."""
        if self.prior.any():
            covariance = np.asarray(np.linalg.inv(np.linalg.inv(covariance) + self.prior))
        variance = np.einsum("kp,pq,kq->k", self.slopes, covariance, self.slopes)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def used(self, covariance: Array) -> Array:
        """(k,) the same as shares of the largest."""
        return np.asarray(self.found(covariance) / self.std)

    def told(self, covariance: Array) -> dict[str, float]:
        """Standard deviations of parameters, and half-widths of the 95 % intervals of outcomes, by name."""
        return dict(zip(self.names, (self.found(covariance) * self._scale).tolist(), strict=True))

    def words(self, covariance: Array, index: int) -> str:
        """How well one of them is told."""
        name, scale = self.names[index], self._scale[index]
        what = "standard deviation" if scale == 1.0 else "half-width of the 95 % interval"
        value, asked = self.found(covariance)[index] * scale, self.std[index] * scale
        return f"the {what} of {name} is {value:.3g} where {asked:.3g} is asked for"

    @property
    def _scale(self) -> Array:
        """(k,) from standard deviations to what is stated of them."""
        return np.where(np.arange(len(self.std)) < len(self.std) - self.outcomes, 1.0, NORMAL_95)


def asked_limits(settings: AccuracySettings, design: DurationDesign, vessel: Vessel, prior: Array) -> Limits | None:
    """Standard deviations asked for; None without any.

    Raises:
        InputError, NoAnswer: as `accuracy.stated_accuracy`.
    """
    parameters = design.problem.parameters
    nominal = dict(zip(vessel.model.names, np.abs(vessel.model.parameters).tolist(), strict=True))
    asked = {**settings.std, **{name: share * nominal[name] for name, share in settings.relative_std.items()}}
    if not asked and not settings.outcomes_95:
        return None
    noise, names = equation_noise(vessel, parameters), [name for name in parameters if name in asked]
    for key, needed in (("", names), (".outcomes_95", list(parameters) if settings.outcomes_95 else [])):
        silent = [name for name in needed if not noise[parameters.index(name)] > 0]
        if silent:
            raise InputError(
                f"design.accuracy{key} needs the noise of the sensor for {silent[0]}: expected [sensors] "
                "in the vessel file to state it"
            )
    slopes, stds = [np.eye(len(parameters))[[parameters.index(name) for name in names]]], [asked[n] for n in names]
    outcomes: tuple[str, ...] = ()
    if settings.outcomes_95:
        found = outcome_gradients(vessel, tuple(settings.outcomes_95), parameters, speed_mps=settings.outcome_speed_mps)
        outcomes = found.names
        slopes.append(found.gradients)
        stds += [settings.outcomes_95[name] / NORMAL_95 for name in outcomes]
    p, sure = len(parameters), np.where(noise > 0, noise, np.inf)
    return Limits(
        names=(*names, *outcomes),
        slopes=np.concatenate(slopes),
        std=np.array(stds),
        prior=prior[:p, :p] / np.outer(sure, sure),
        outcomes=len(outcomes),
    )
