"""How far the information of a day is from the accuracy asked for.

The margin f(M) of an information matrix M is the logarithm of the share of time that could be saved, or is missing, at
M's rate: f(a M) = f(M) + log a, and the accuracy is reached where f(M) >= 0. It is concave in M, being the least of

    log of the efficiency by the design's criterion against the optimal durations
    log(s_i^2 / (sigma_i^2 (M^-1)_ii)) for parameters with a largest standard deviation s_i
    log(s_o^2 / (c_o' M^-1 c_o)) for outcomes of trials, c_o their gradients by parameters, in noise units

Source: F. Pukelsheim, Optimal Design of Experiments (2006), 5.4 for concavity of 1 / (M^-1)_ii; combined here.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from expdesign.durations import Collected, DurationDesign
from expdesign.durations.criteria.models import congruent
from expdesign.errors import InputError
from expdesign.information.outcome_gradients import outcome_gradients
from expdesign.information.prior import equation_noise
from expdesign.information.unknown_current import beside_current, slope_of_whole
from expdesign.shortest_day.values import AccuracySettings
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

NORMAL_95 = 1.959963984540054
"""Half of the interval that holds a normal variable in 95 of 100 cases, in standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy:
    """An accuracy to be reached; information matrices (d, d) are sums over samples.

    They may also be (d + 2, d + 2), about a steady current that is unknown too: what they tell of the ship counts, see
    `information.unknown_current`, which is concave as well.

    Attributes:
        collected: the criterion, of information per sample of `samples`; None where it is not asked for.
        level: value of the criterion to be reached.
        samples: of the time that the level is reached in.
        prior: (d, d) information known before.
        variance: (p,) largest variance of each parameter in units of its equation's noise variance; inf without limit.
        parameters: names.
        outcomes: names of outcomes with a largest standard deviation.
        gradients: (o, d) of each by the parameters, in units of that standard deviation and of the noise.
    """

    collected: Collected | None
    level: float
    samples: float
    prior: Array
    variance: Array
    parameters: tuple[str, ...]
    outcomes: tuple[str, ...] = ()
    gradients: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not self.outcomes:
            object.__setattr__(self, "gradients", np.zeros((0, len(self.prior))))
        seal(self, prior="d d", variance="p", gradients="o d")

    def margin(self, information: Array) -> float:
        """f of information (d, d) besides the prior; -inf where it is singular."""
        information = self.about_ship(information)
        return min(self._criterion_margin(information), float(self._margins(information).min()))

    def about_ship(self, information: Array) -> Array:
        """(d, d) of what information tells of the ship."""
        if len(information) == len(self.prior):
            return information
        return beside_current(information, len(self.parameters))

    def supergradient(self, information: Array) -> Array:
        """G, shaped as M, with f(N) <= f(M) + <G, N - M> for every N, at a regular M."""
        slope = self._slope(self.about_ship(information))
        if len(information) == len(self.prior):
            return slope
        return slope_of_whole(information, len(self.parameters), slope)

    def _slope(self, information: Array) -> Array:
        """(d, d) the same by information (d, d)."""
        if self._criterion_margin(information) <= self._margins(information).min():
            assert self.collected is not None
            piece, degree = self.collected.pieces[0], self.collected.degree
            G = piece.measure.gradient(self._whitened(information))
            T = piece.transformation
            return np.asarray(T.T @ G @ T) / (self.samples * degree)
        index = int(np.argmin(self._margins(information)))
        direction = self._directions[index]
        column = self._inverse(information) @ direction
        return np.asarray(np.outer(column, column) / (column @ direction))

    def scarcest(self, information: Array) -> str:
        """The parameter or outcome whose standard deviation is furthest from its limit; "" where the criterion is."""
        information = self.about_ship(information)
        margins = self._margins(information)
        if self._criterion_margin(information) <= margins.min():
            return ""
        return (*self.parameters, *self.outcomes)[int(np.argmin(margins))]

    def _criterion_margin(self, information: Array) -> float:
        if self.collected is None:
            return np.inf
        value = float(self.collected.values((self._whitened(information)[None],))[0])
        return (value - self.level) / self.collected.degree

    def _whitened(self, information: Array) -> Array:
        assert self.collected is not None
        piece = self.collected.pieces[0]
        return np.asarray(piece.prior + congruent(piece.transformation, information / self.samples))

    @property
    def _directions(self) -> Array:
        """(p + o, d) whose variances are limited: of parameters, and of outcomes."""
        return np.concatenate([np.eye(len(self.variance), len(self.prior)), self.gradients])

    def _margins(self, information: Array) -> Array:
        """(p + o,) of the standard deviations; inf without limit."""
        largest = np.r_[self.variance, np.ones(len(self.outcomes))]
        limited = np.isfinite(largest)
        margins = np.full(len(largest), np.inf)
        if limited.any():
            along = self._directions[limited]
            found = np.einsum("od,de,oe->o", along, self._inverse(information), along)
            with np.errstate(divide="ignore", invalid="ignore"):
                margins[limited] = np.where(found > 0, np.log(largest[limited] / found), -np.inf)
        return margins

    def _inverse(self, information: Array) -> Array:
        """(d, d), computed with a unit diagonal; zeros where it is singular."""
        total = self.prior + information
        scale = np.sqrt(np.maximum(np.diag(total), 0.0))
        if not (scale > 0).all():
            return np.zeros_like(total)
        try:
            root = np.linalg.inv(np.linalg.cholesky(total / np.outer(scale, scale)))
        except np.linalg.LinAlgError:
            return np.zeros_like(total)
        return np.asarray(root.T @ root / np.outer(scale, scale))


def stated_accuracy(settings: AccuracySettings, design: DurationDesign, vessel: Vessel) -> Accuracy:
    """The accuracy that settings ask for.

    Args:
        settings: of the scenario.
        design: the optimal durations in `total_s`.
        vessel: gives nominal values and the noise of sensors.

    Raises:
        InputError: settings of the design under which the information of a track cannot be added up, or a standard
            deviation of a parameter without stated noise.
    """
    problem = design.problem
    _check_adds_up(design)
    nominal = dict(zip(vessel.model.names, np.abs(vessel.model.parameters).tolist(), strict=True))
    asked = {**settings.std, **{name: share * nominal[name] for name, share in settings.relative_std.items()}}
    noise = dict(zip(asked, equation_noise(vessel, list(asked)).tolist(), strict=True))
    if silent := [name for name in asked if not noise[name] > 0]:
        raise InputError(
            f"design.accuracy asks for the standard deviation of {silent[0]}, which needs the noise of its sensor: "
            "expected [sensors] in the vessel file to state it"
        )
    outcomes, gradients = _outcomes(settings, design, vessel)
    samples = problem.total_s / vessel.sample_time_s
    collected = Collected.of(problem) if settings.as_durations else None
    return Accuracy(
        collected=collected,
        level=collected.value(design.fractions) if collected else -np.inf,
        samples=samples,
        prior=problem.prior * samples,
        variance=np.array([(asked[n] / noise[n]) ** 2 if n in asked else np.inf for n in problem.parameters]),
        parameters=problem.parameters,
        outcomes=outcomes,
        gradients=gradients,
    )


def _outcomes(settings: AccuracySettings, design: DurationDesign, vessel: Vessel) -> tuple[tuple[str, ...], Array]:
    """Outcomes asked for, and their gradients (o, d) in units of their largest standard deviation and of the noise.

    Raises:
        InputError: an outcome without stated noise of a sensor, or the vessel cannot run its trial.
        NoAnswer: a trial does not end, or an outcome is not smooth in a parameter.
    """
    problem, asked = design.problem, settings.outcomes_95
    if not asked:
        return (), np.zeros((0, 0))
    found = outcome_gradients(vessel, tuple(asked), problem.parameters, speed_mps=settings.outcome_speed_mps)
    noise = equation_noise(vessel, problem.parameters)
    silent = [name for name, size in zip(problem.parameters, noise.tolist(), strict=True) if not size > 0]
    if silent:
        raise InputError(
            f"design.accuracy.outcomes_95 needs the noise of the sensor for {silent[0]}: expected [sensors] in the "
            "vessel file to state it"
        )
    std = np.array([asked[name] for name in found.names]) / NORMAL_95
    gradients = np.zeros((len(found.names), len(problem.prior)))
    gradients[:, : len(problem.parameters)] = found.gradients * noise / std[:, None]
    return found.names, gradients


def _check_adds_up(design: DurationDesign) -> None:
    problem = design.problem
    for is_set, key, value in (
        (problem.robust != "nominal", "robust", repr(problem.robust)),
        (bool(problem.nuisance), "predictor", "not 'model'"),
        (not problem.symmetric, "the dictionary", "with recorded primitives"),
        (bool(problem.constraints.budgets), "budgets", "set"),
        (bool(problem.constraints.balance), "balance", f"{problem.constraints.balance:g}"),
        (bool(problem.floors), "reveal", "set"),
    ):
        if is_set:
            raise InputError(
                f"design.accuracy: design.{key} is {value}, which the shortest day does not count; expected it without"
            )
