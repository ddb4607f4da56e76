"""Joint estimate of roll parameters over load cases: closed-loop instrumental variables, or least squares.

    min over theta of  sum over cases of  || V^(-1/2) Z' (y - X c(theta, load)) ||^2,     V = sum |Z(f)|^2 S(f)

c are the sampled coefficients. An autoregression whitens equation and instruments; S is the spectrum of what colour is
left, and the instruments Z, which come from the rudder, pass 1 / S. The sum over frequencies is the covariance of Z' e
for any stationary noise e that the instruments do not depend on, narrow-band waves too.

Waves are in the regressors X, too. With V as at earlier parameters the estimate leans towards those of least squares,
which hide waves best, and more with each V from a new estimate. So V follows the parameters in the search, by the
spectra of what instruments do not explain of y and X, once the model fits: what it misses is no noise.

Source: doctoral thesis on grey-box identification of roll with few sensors, approach 5.3 and algorithm 5.1; L. P.
Hansen, Econometrica 50 (1982), 1029-1054, for weights; L. P. Hansen, J. Heaton and A. Yaron, J. Business and Economic
Statistics 14 (1996), 262-280, for weights that follow; W. K. Newey and F. Windmeijer, Econometrica 77 (2009), 687-719,
for the covariance with weak instruments.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from expdesign.errors import InputError
from expdesign.roll.effects import (
    EFFECT_NAMES,
    MOST_TRIES,
    TILT,
    by_effects,
    missed_effects,
    missing_sizes,
    most_effects,
    tilts_of,
    unseen_effects,
    with_effects,
    without_effects,
)
from expdesign.roll.instruments import Weighted, chance_of_answers, folds, weighted_equations
from expdesign.roll.model import PARAMETERS, discrete, named, relative_sensitivity, roll_frequency, stiffness
from expdesign.roll.problem import (
    RollProblem,
    noise_of,
    noise_of_slopes,
    residuals_of,
    sampled,
    slopes_of,
    solved,
    surprise_of,
)
from expdesign.roll.profile import load_interval
from expdesign.roll.regression import MOST_SURPRISE, flat_spectrum, spectrum
from expdesign.values import Array, sealed
from expdesign.vessel import ROLL_PARAMETERS, RollPendulum
from expdesign.vessel.roll import G_MPS2, Load

# of instruments, below which noise alone seems to give nearly as much information, and no interval is trusted
LEAST_STRENGTH = 1.5

AT_BOUND = 1e-4  # share of the range of the search, within which of its end a parameter stands at the bound
MOST_ROUNDS, WAVERING = 12, 8  # of instruments and noise models, and after which of them every other step is halved
SETTLED = 0.1  # change in a round, in standard deviations of each parameter, that ends them
# chance without feedback, below which the rudder is said to answer roll; and where instruments are so strong that an
# answer moves the estimate by a small part of what it would move least squares
LEAST_UNANSWERED, LEAST_UNANSWERED_STRONG, STRONG = 0.05, 0.001, 10.0
LEAST_ROUNDS = 3  # before effects are looked for
MOST_SCANS = 3  # of all tilts
BY_TILT = ("d", "K_r", "K_vd", "K_delta")  # parameters that an unknown tilt moves
SMALL_DEVIATION = 1e-2  # of second derivatives, in standard deviations that a parameter alone would have
SMALL_STEP = 1e-6  # of derivatives, in typical sizes of the parameters
UNSEEN = 1e-9  # relative sensitivity below which the equations themselves leave a direction open


METHODS = ("iv", "ls")


@sealed(theta="9", covariance="p p", sensed="q p", rounds="r 9")
class RollEstimate:
    """The estimate."""

    problem: RollProblem  # that it answers
    method: str  # "iv" or "ls"
    theta: Array  # (9,) parameters
    covariance: Array  # (p, p) of the free ones, for the held ones as they are
    held: tuple[str, ...]  # free parameters that kept their start values because the equations leave directions open
    sensed: Array  # (q, p) change of the weighted residuals, in their own standard deviations, by the free parameters
    rounds: Array  # (r, 9) parameters after each round of spectra
    settled: bool  # whether the last round changed little
    # of the instruments: their information about the least certain combination of parameters over what noise alone
    # would seem to give, zero where they tell nothing; nan for least squares, and where the model does not fit
    strength: float
    # least sum of squares over its expected value, 1 for a model that fits; nan where nothing is left over
    surprise: float
    # chance that a rudder without feedback correlates with the roll moment as much as this one, 0 to 1; nan for least
    # squares and a ship that does not stay upright
    unanswered: float
    freedom: float  # degrees of freedom of the noise's power, of the case with the fewest, at each frequency

    # effect of `EFFECTS` -> value and standard deviation, of those that the data show
    effects: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tilt_told: bool = True  # whether the sensor's tilt was measured, or the data tell it
    load_interval: tuple[float, float] | None = None  # of m, 95 % by its profile [kg]; None where it is not sought

    @property
    def std(self) -> dict[str, float]:
        """Standard deviations of the free parameters by name."""
        return dict(zip(self.problem.free, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def values(self) -> dict[str, float]:
        """All parameters by name."""
        return named(self.theta)

    @property
    def reached(self) -> tuple[str, ...]:
        """Free parameters that stand at a bound of the search, where no interval holds."""
        low, high = self.problem.bounds
        near = AT_BOUND * (high - low)
        at = (self.theta <= low + near) | (self.theta >= high - near)
        return tuple(name for name in self.problem.free if name not in self.held and at[PARAMETERS.index(name)])

    @property
    def trusted(self) -> bool:
        """Whether intervals are valid: instruments are strong, the rudder does not follow roll, and the model fits."""
        fits = self.settled and not self.reached and not self.surprise > MOST_SURPRISE
        return self.method == "iv" and fits and not self.weak and not self.answering

    @property
    def by_tilt(self) -> tuple[str, ...]:
        """Free parameters that may be far off, as nothing tells how the sensor is tilted, while the others are not."""
        return () if self.tilt_told else tuple(name for name in BY_TILT if name in self.problem.free)

    @property
    def weak(self) -> bool:
        """Whether noise hides what the rudder does, so that the estimate leans towards least squares."""
        return self.strength < LEAST_STRENGTH

    @property
    def answering(self) -> bool:
        """Whether the rudder answers what rolls the ship, so that it is no instrument."""
        return self.unanswered < (LEAST_UNANSWERED_STRONG if self.strength > STRONG else LEAST_UNANSWERED)


def estimate_roll(problem: RollProblem, *, method: str = "iv") -> RollEstimate:
    """The estimate by instruments from the rudder, or by least squares.

    Raises:
        NotInformative: there are fewer equations than free parameters, or the rudder does not move the ship.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
    held = _held(problem)
    instruments = [folds(case.runs) if method == "iv" else None for case in problem.cases]
    theta, history, settled = np.array(problem.start), [], False
    values: list[Array | None] = [None] * len(problem.cases)
    if method == "iv" and any(run.planned is not None for case in problem.cases for run in case.runs):
        theta = estimate_roll(_by_rudder(problem)).theta
        values = [*sampled(problem, theta)]
    added: list[int] = []
    unseen_before: list[int] = []
    unmeasured = method == "iv" and problem.body.tilt_rad is None and "K_vd" in problem.free
    scans, fits = 0, False  # what a model misses is no noise, and would be taken for some
    while True:
        parts = zip(problem.cases, instruments, values, strict=True)
        weighted = [weighted_equations(case, own, one, follows=fits) for case, own, one in parts]
        before, (theta, sensed, left) = theta, solved(problem, weighted, theta, held)
        history.append(theta)
        weighed, following = method == "iv" and values[0] is not None, weighted[0].spread is not None
        fits = weighed and not surprise_of(left, len(problem.free)) > MOST_SURPRISE
        if following and not fits and len(history) < MOST_ROUNDS:
            # where the model misses something, weights that follow are least at parameters that hide it, far away
            theta = before
            continue
        settled = len(history) > 1 and _little(problem, theta - before, sensed) and fits == following
        by = by_effects(problem, weighted, theta)
        more, std = missing_sizes(problem, by, sensed, left, added)
        settled = settled and bool((np.abs(more) <= 2 * SETTLED * std).all())
        looked = settled or len(history) in (LEAST_ROUNDS, MOST_ROUNDS)
        tilts = None
        if unmeasured and TILT not in added and looked and scans < MOST_SCANS:
            scans += 1
            tilts = tilts_of(problem, weighted, theta, held, by)
            if tilts.other:
                problem = with_effects(without_effects(problem, added), [TILT], np.array([tilts.best_rad]))
                added, unseen_before, theta = [TILT], [], tilts.theta
                values, settled = [*sampled(problem, theta)], False
                continue
        if weighed and len(history) >= LEAST_ROUNDS:
            unseen = unseen_effects(problem, added, std)
            problem, unseen_before = without_effects(problem, unseen), [*unseen_before, *unseen]
            added = [place for place in added if place not in unseen]
            banned = [place for place in unseen_before if unseen_before.count(place) >= MOST_TRIES]
            banned += [TILT] * unmeasured  # it is found by looking at all tilts
            new = [] if unseen else missed_effects(problem, by, sensed, left, added, banned)
            added, settled = [*added, *new], settled and not new and not unseen
        if settled or len(history) >= MOST_ROUNDS * (1 + bool(added) + (TILT in added)):
            break
        share = 0.5 if len(history) > WAVERING and len(history) % 2 else 1.0  # rounds may go back and forth
        if added:
            more, _ = missing_sizes(problem, by, sensed, left, added)
            problem = with_effects(problem, added, share * more)
        values = [*sampled(problem, before + share * (theta - before))]
    if unmeasured and tilts is None:
        tilts = tilts_of(problem, weighted, theta, held, by)
    _, std = missing_sizes(problem, by, sensed, left, added)
    effects = dict(zip([EFFECT_NAMES[place] for place in added], zip(
        [problem.cases[0].runs[0].effects[place] for place in added], std.tolist(), strict=True
    ), strict=True))  # fmt: skip
    gone = np.linalg.qr(by[:, added])[0]
    sensed, left = sensed - gone @ (gone.T @ sensed), left - gone @ (gone.T @ left)
    settled = settled and bool((np.abs(problem.cases[0].runs[0].effects) < 0.999 * most_effects(problem)).all())
    surprise = surprise_of(left, len(problem.free) - len(held) + len(added))
    covariance = _covariance(problem, weighted, theta, sensed, held, gone, method)
    return RollEstimate(
        problem=problem,
        method=method,
        theta=theta,
        covariance=covariance,
        held=held,
        sensed=sensed,
        rounds=np.array(history),
        settled=settled,
        strength=_strength(problem, weighted, theta, covariance, gone) if method == "iv" else float("nan"),
        surprise=surprise,
        unanswered=_unanswered(problem, weighted, theta, sensed, surprise) if method == "iv" else float("nan"),
        freedom=min(spectrum(residuals).freedom for residuals in noise_of(problem, weighted, theta)),
        effects=effects,
        tilt_told=tilts is None or tilts.told,
        load_interval=load_interval(problem, weighted, theta, sensed, covariance, held, gone),
    )


def _by_rudder(problem: RollProblem) -> RollProblem:
    """The problem with instruments from the rudder itself: its estimate may be biased, and is a good start."""
    cases = [replace(case, runs=tuple(replace(run, planned=None) for run in case.runs)) for case in problem.cases]
    return replace(problem, cases=tuple(cases))


def _unanswered(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, sensed: Array, surprise: float
) -> float:
    hertz = np.array([roll_frequency(theta, problem.body, case.load) for case in problem.cases])
    if not (hertz > 0).all():
        return float("nan")
    jacobians = [discrete(theta, problem.body, case.load, problem.step_s).jacobian for case in problem.cases]
    slopes = [rows[:, problem.places] for rows in jacobians]
    periods = (1.0 / (hertz * problem.step_s)).tolist()
    noise = noise_of(problem, weighted, theta)
    return chance_of_answers(problem.cases, weighted, noise, slopes, sensed, periods, surprise)


def _held(problem: RollProblem) -> tuple[str, ...]:
    """Free parameters without which the rank stays as large; first those that other trials can give."""
    generic = np.where(np.abs(problem.start) > 0.01 * problem.scale, problem.start, problem.scale)
    loads, kept = [case.load for case in problem.cases], list(problem.free)

    def rank(names: list[str]) -> int:
        sensitivity = relative_sensitivity(generic, problem.body, loads, names)
        return int(np.linalg.matrix_rank(sensitivity, tol=UNSEEN * np.linalg.norm(sensitivity)))

    most = rank(kept)
    for name in ("k", "z_f", "K_vd", *PARAMETERS):
        others = [other for other in kept if other != name]
        if len(kept) > most and name in kept and rank(others) == most:
            kept = others
    return tuple(name for name in problem.free if name not in kept)


def _little(problem: RollProblem, change: Array, sensed: Array) -> bool:
    """Whether a change of the parameters moves no weighted residual by more than a small part of its deviation."""
    return bool(np.linalg.norm(sensed @ change[problem.places]) <= SETTLED * np.sqrt(len(problem.free)))


def _covariance(
    problem: RollProblem,
    weighted: Sequence[Weighted],
    theta: Array,
    sensed: Array,
    held: Sequence[str],
    gone: Array,
    method: str,
) -> Array:
    """(p, p) covariance from the spectra of the noise at the estimate; zero for what is held.

    By noise in the regressors the slopes have more information than the curvature of the sum of squares, which counts
    what the rudder does: the errors of weak instruments are as large as both together say. The same data give spectra
    and moments. With 2 K degrees of freedom at each frequency the variance is larger by K / (K - 1) than with the true
    spectrum, and the inverse of the curvature smaller by (K - 1) / K: so it is for chi-square powers that count among
    the K they are divided by.
    """
    scale = problem.scale[problem.places] * [name not in held for name in problem.free]
    if method == "ls":
        inverse = np.linalg.pinv(sensed * scale, rcond=1e-12)
        first, middle = 0, np.zeros((len(scale),) * 2)
        for part, residuals in zip(weighted, noise_of(problem, weighted, theta), strict=True):
            last = first + len(part.top)
            change = inverse[:, first:last]
            middle += change @ flat_spectrum(residuals).covariance(part.basis) @ change.T
            first = last
        return np.asarray(middle * np.outer(scale, scale))
    inverse = np.linalg.pinv(_curvature(problem, weighted, theta, gone) * np.outer(scale, scale), rcond=1e-10)
    freedom = min(spectrum(residuals).freedom for residuals in noise_of(problem, weighted, theta))
    moved = inverse @ (sensed * scale).T / (1.0 - 2.0 / freedom)  # its square has no negative variance by rounding
    middle = moved @ moved.T
    return np.asarray(middle * np.outer(scale, scale))


def _curvature(problem: RollProblem, weighted: Sequence[Weighted], theta: Array, gone: Array) -> Array:
    """(p, p) half the second derivatives of the sum of squares by the free parameters, beside effects (q, e)."""

    def gradient(at: Array) -> Array:
        rows = slopes_of(problem, weighted, at)[:, problem.places]
        return np.asarray(rows.T @ residuals_of(problem, weighted, at))

    seen = np.linalg.norm(slopes_of(problem, weighted, theta)[:, problem.places], axis=0)
    steps = SMALL_DEVIATION / np.maximum(seen, 1e-3 / problem.scale[problem.places])
    changes = np.zeros((len(steps), len(PARAMETERS)))
    changes[np.arange(len(steps)), problem.places] = steps
    rows = np.array([gradient(theta + change) - gradient(theta - change) for change in changes])
    rows /= 2.0 * steps[:, None]
    along = gone.T @ slopes_of(problem, weighted, theta)[:, problem.places]
    return np.asarray((rows + rows.T) / 2.0 - along.T @ along)


def _strength(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, covariance: Array, gone: Array
) -> float:
    """Least ratio, over combinations of the free parameters, of what the rudder tells to what noise alone seems to.

    That is the smallest F statistic of a regression of the regressors on the instruments, less one.

    Source: J. G. Cragg and S. G. Donald, Econometric Theory 9 (1993), 222-240, with spectra in place of variances;
    D. Staiger and J. H. Stock, Econometrica 65 (1997), 557-586, for what weak instruments do.
    """
    if weighted[0].spread is None:
        return math.nan
    std = np.sqrt(np.diag(covariance))
    kept = np.flatnonzero(std > 0)
    places = np.array(problem.places)[kept]
    noise = noise_of_slopes(problem, weighted, theta)[np.ix_(places, places)]
    size = np.outer(std[kept], std[kept])
    information = _curvature(problem, weighted, theta, gone)[np.ix_(kept, kept)] * size
    powers, axes = np.linalg.eigh(noise * size)
    if not powers[-1] > 0:
        return math.inf
    by = axes / np.sqrt(np.maximum(powers, 1e-12 * powers[-1]))
    return float(np.linalg.eigvalsh(by.T @ information @ by)[0])


def metacentric_height(estimate: RollEstimate, load: Load | None) -> tuple[float, float]:
    """Metacentric height with a load on board, and its standard deviation for the held parameters as they are [m].

    Args:
        load: on board; None for the unknown one.
    """
    problem = estimate.problem

    def height(theta: Array) -> float:
        mass = theta[PARAMETERS.index("m")] if load is None else load.mass_kg
        return stiffness(theta, problem.body, load) / (G_MPS2 * float(problem.body.mass_kg + mass))

    steps = SMALL_STEP * np.diag(problem.scale)[problem.places]
    changes = [height(estimate.theta + step) - height(estimate.theta - step) for step in steps]
    slope = np.array(changes) / (2.0 * SMALL_STEP * problem.scale[problem.places])
    return height(estimate.theta), math.sqrt(max(float(slope @ estimate.covariance @ slope), 0.0))


def fitted_pendulum(estimate: RollEstimate) -> RollPendulum:
    """The ship without load, with the estimate's uncertainty; parameters that were held or given count as known.

    Raises:
        InputError: the estimate is no pendulum, as its inertia is not positive.
    """
    stds = {name: std for name, std in estimate.std.items() if name in ROLL_PARAMETERS and std > 0}
    place = estimate.problem.free.index
    return RollPendulum(
        body=estimate.problem.body,
        parameters={name: estimate.values[name] for name in ROLL_PARAMETERS},
        parameter_std=stds,
        parameter_correlation={
            (one, other): float(estimate.covariance[place(one), place(other)] / (stds[one] * stds[other]))
            for one in stds
            for other in stds
            if place(other) < place(one)
        },
    )
