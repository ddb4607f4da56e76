"""How far the information of a day is from the accuracy asked for.

The margin f(M) of an information matrix M is the logarithm of the share of time that could be saved, or is missing, at
M's rate: f(a M) = f(M) + log a, and the accuracy is reached where f(M) >= 0. It is concave in M, being the least of

    log of the efficiency by the design's criterion against the optimal durations
    log(s_i^2 / (sigma_i^2 (M^-1)_ii)) for parameters with a largest standard deviation s_i
    log(s_o^2 / (c_o' M^-1 c_o)) for outcomes of trials, c_o their gradients by parameters, in noise units

Information takes the residuals of samples one after the other for independent. Those of measured velocities share a
sample and partly cancel where regressors change slowly: standard deviations then are two to five times smaller than
(M^-1)_ii says. So limits s_i and s_o are widened by that ratio, as it is for the optimal durations, which makes f a
forecast; whether a track reaches them is judged by its own first-order covariance (`information.expected`).

Source: F. Pukelsheim, Optimal Design of Experiments (2006), 5.4 for concavity of 1 / (M^-1)_ii; combined here.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import Collected, DurationDesign
from expdesign.durations.criteria import LogTrace, congruent
from expdesign.durations.measures import SmoothMeasure
from expdesign.errors import InputError, NotInformative
from expdesign.indices import outcome_gradients
from expdesign.information.disturbed import beside_current, curved_beside_current, slope_of_whole
from expdesign.information.expected import expected_covariance
from expdesign.information.prior import equation_noise
from expdesign.rehearsal import trial_parts
from expdesign.shortest_day.values import AccuracySettings
from expdesign.simulation import CALM, Environment
from expdesign.values import Array, seal, sealed
from expdesign.vessel import Vessel

NORMAL_95 = 1.959963984540054
"""Half of the interval that holds a normal variable in 95 of 100 cases, in standard deviations."""


@sealed(slopes="k p", std="k", prior="p p")
class Limits:
    """Largest standard deviations of parameters and of outcomes."""

    names: tuple[str, ...]  # of the k limited parameters and outcomes
    slopes: Array  # (k, p) of each by the parameters
    std: Array  # (k,) largest standard deviation of each
    prior: Array  # (p, p) information known before, in the parameters' units
    outcomes: int = 0  # how many of them, at the end, are outcomes

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
        outcomes = tuple(settings.outcomes_95)
        slopes.append(outcome_gradients(vessel, outcomes, parameters, speed_mps=settings.outcome_speed_mps)[1])
        stds += [settings.outcomes_95[name] / NORMAL_95 for name in outcomes]
    p, sure = len(parameters), np.where(noise > 0, noise, np.inf)
    return Limits(
        names=(*names, *outcomes),
        slopes=np.concatenate(slopes),
        std=np.array(stds),
        prior=prior[:p, :p] / np.outer(sure, sure),
        outcomes=len(outcomes),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy:
    """An accuracy to be reached; information matrices (d, d) are sums over samples.

    They may also be (d + 2, d + 2), about a steady current that is unknown too: what they tell of the ship counts, see
    `information.unknown_current`, which is concave as well.
    """

    collected: Collected | None  # the criterion, of information per sample of `samples`; None where it is not asked for
    level: float  # value of the criterion to be reached
    samples: float  # of the time that the level is reached in
    prior: Array  # (d, d) information known before
    # (p,) largest variance of each parameter in units of its equation's noise variance; inf without limit
    variance: Array
    parameters: tuple[str, ...]  # names
    outcomes: tuple[str, ...] = ()  # names of outcomes with a largest standard deviation
    # (o, d) of each by the parameters, in units of that standard deviation and of the noise
    gradients: Array = field(default_factory=lambda: np.zeros((0, 0)))
    limits: Limits | None = None  # by which tracks are judged; None where they are judged by `margin`

    def __post_init__(self) -> None:
        if not self.outcomes:
            object.__setattr__(self, "gradients", np.zeros((0, len(self.prior))))
        seal(self, prior="d d", variance="p", gradients="o d")

    def margin_of_track(self, information: Array, covariance: Array | None) -> float:
        """f of a track by its information (d, d), and by its covariance (p, p) where standard deviations are limited.

        -inf where the track does not determine every parameter.
        """
        if self.limits is None:
            return self.margin(information)
        if covariance is None:
            return -np.inf
        criterion = self._criterion_margin(self.about_ship(information))
        return min(criterion, float(-2 * np.log(self.limits.used(covariance)).max()))

    def lacking(self, information: Array, covariance: Array | None) -> str:
        """What a track lacks most: the parameter or outcome, how well it is told, and what was asked for.

        "" where that is the criterion, or where the track does not determine every parameter.
        """
        if self.limits is None or covariance is None:
            return ""
        used = self.limits.used(covariance)
        if self._criterion_margin(self.about_ship(information)) <= -2 * np.log(used.max()):
            return ""
        return self.limits.words(covariance, int(np.argmax(used)))

    def told(self, covariance: Array | None) -> dict[str, float]:
        """Standard deviations of parameters that sensors' noise leaves, and half-widths of outcomes asked for."""
        if covariance is None:
            return {}
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
        found = {name: value for name, value in zip(self.parameters, std, strict=True) if value > 0}
        return found if self.limits is None else found | self.limits.told(covariance)

    @property
    def of_information(self) -> Accuracy:
        """What of it is a statement about information matrices alone, and so bounds every track."""
        if self.limits is None:
            return self
        without = np.full_like(self.variance, np.inf)
        return replace(self, variance=without, outcomes=(), gradients=np.zeros((0, len(self.prior))), limits=None)

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

    def curved(self, information: Array, parts: Array) -> tuple[Array, Array, Array]:
        """What f is the least of, as functions of the weights of parts of regular information.

        Args:
            information: as of `margin`.
            parts: (c, d, d) or (c, d + 2, d + 2), shaped as it.

        Returns:
            (k,) values, (k, ...) derivatives by the information, shaped as it, and (k, c, c) minus the second ones by
            the weights; without E, which has none.
        """
        p, whole, current = len(self.parameters), information, len(information) > len(self.prior)
        moved, information = parts, self.about_ship(information)
        if current:
            bent, moved = curved_beside_current(whole, p, parts)
        found = list[tuple[float, Array, Array]]()
        if self.collected is not None and isinstance(measure := self.collected.pieces[0].measure, SmoothMeasure):
            white = congruent(self.collected.pieces[0].transformation, moved / self.samples)
            M, degree = self._whitened(information), self.collected.degree
            G, T = measure.gradient(M) / degree, self.collected.pieces[0].transformation
            curvature = measure.curvature(M, white) / degree
            found.append((self._criterion_margin(information), T.T @ G @ T / self.samples, curvature))
        margins = self._margins(information)
        for index in np.flatnonzero(np.isfinite(margins)).tolist():
            measure = LogTrace(self._directions[index][:, None])
            total = self.prior + information
            found.append((float(margins[index]), measure.gradient(total), measure.curvature(total, moved)))
        values, gradients = np.array([value for value, _, _ in found]), [gradient for _, gradient, _ in found]
        curvatures = np.array([curvature for _, _, curvature in found]).reshape(-1, len(parts), len(parts))
        if current:
            curvatures += np.array([bent(G[:p, :p]) for G in gradients]).reshape(curvatures.shape)
            gradients = [slope_of_whole(whole, p, G) for G in gradients]
        return values, np.array(gradients).reshape(-1, *whole.shape), curvatures

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


def stated_accuracy(
    settings: AccuracySettings,
    design: DurationDesign,
    vessel: Vessel,
    runs: Sequence[Primitive] = (),
    environment: Environment = CALM,
) -> Accuracy:
    """The accuracy that settings ask for.

    Args:
        design: the optimal durations in `total_s`.
        vessel: gives nominal values and the noise of sensors.
        runs: of the design, in its order; needed where standard deviations are asked for.
        environment: that the trial is sailed in.

    Raises:
        InputError: settings of the design under which the information of a track cannot be added up, a standard
            deviation of a parameter without stated noise, or a vessel that cannot run the trial of an outcome.
        NoAnswer: a trial does not end, or an outcome is not smooth in a parameter.
    """
    problem = design.problem
    _check_adds_up(design)
    samples = problem.total_s / vessel.sample_time_s
    collected = Collected.of(problem) if settings.as_durations else None
    found = Accuracy(
        collected=collected,
        level=collected.value(design.fractions) if collected else -np.inf,
        samples=samples,
        prior=problem.prior * samples,
        variance=np.full(len(problem.parameters), np.inf),
        parameters=problem.parameters,
    )
    limits = asked_limits(settings, design, vessel, found.prior)
    return found if limits is None else _forecast(found, limits, design, vessel, runs, environment)


def _forecast(
    accuracy: Accuracy,
    limits: Limits,
    design: DurationDesign,
    vessel: Vessel,
    runs: Sequence[Primitive],
    environment: Environment,
) -> Accuracy:
    """The accuracy with limits, whose margins forecast what tracks will reach.

    The ratio of standard deviations to those of independent residuals is that of the optimal durations; 1 where these
    do not determine every parameter.
    """
    problem = design.problem
    p, d = len(problem.parameters), len(accuracy.prior)
    noise = equation_noise(vessel, problem.parameters)
    slopes = np.zeros((len(limits.std), d))
    slopes[:, :p] = limits.slopes * noise / limits.std[:, None]
    ratio, blind = np.ones(len(limits.std)), np.zeros_like(accuracy.prior)
    M = accuracy.samples * np.tensordot(design.fractions, problem.matrices, axes=1)
    white = replace(accuracy, prior=blind)._inverse(M)
    with suppress(NotInformative):
        own = expected_covariance(
            vessel,
            trial_parts(runs, (design.fractions * problem.total_s / problem.run_s).tolist(), environment=environment),
            problem.parameters,
            environment=environment,
            mean_subtraction=problem.mean_subtraction,
            unknown_current=environment.current_std_mps > 0,
        )
        taken = np.sqrt(np.einsum("kd,de,ke->k", slopes, white, slopes))
        ratio = np.divide(replace(limits, prior=np.zeros((p, p))).used(own), taken, out=ratio, where=taken > 0)
    count, parameters = len(limits.std) - limits.outcomes, problem.parameters
    variance = np.array(accuracy.variance)
    for k, name in enumerate(limits.names[:count]):
        index = parameters.index(name)
        variance[index] = (limits.std[k] / (noise[index] * ratio[k])) ** 2
    return replace(
        accuracy,
        variance=variance,
        outcomes=limits.names[count:],
        gradients=slopes[count:] * ratio[count:, None],
        limits=limits,
    )


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
