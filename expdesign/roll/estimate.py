"""Joint estimate of roll parameters over load cases: closed-loop instrumental variables, or least squares.

    min over theta of  sum over cases of  || V^(-1/2) Z' (y - X c(theta, load)) ||^2,     V = sum |Z(f)|^2 S(f)

c are the sampled coefficients. An autoregression whitens equation and instruments; S is the spectrum of what colour is
left, and the instruments Z, which come from the rudder, pass 1 / S. The sum over frequencies is the covariance of Z' e
for any stationary noise e that the instruments do not depend on, narrow-band waves too, so that the inverse of the
curvature is the covariance of the estimate, but for the errors of S.

Source: doctoral thesis on grey-box identification of roll with few sensors, approach 5.3 and algorithm 5.1; L. P.
Hansen, Econometrica 50 (1982), 1029-1054, for weights and covariance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from expdesign.errors import InputError, NotInformative
from expdesign.roll.instruments import Weighted, chance_of_answers, folds, weighted_equations
from expdesign.roll.model import PARAMETERS, discrete, named, parameters, relative_sensitivity, roll_frequency
from expdesign.roll.regression import cross_spectrum, flat_spectrum, spectrum
from expdesign.roll.runs import EFFECTS, Case, Run
from expdesign.roll.tuning import TUNING
from expdesign.values import Array, seal
from expdesign.vessel import ROLL_PARAMETERS, RollPendulum
from expdesign.vessel.masses import G_MPS2, NOMINAL, Body, first_moment

FARTHEST = 10.0  # typical sizes from zero, beyond which no parameter is sought
AT_BOUND = 1e-4  # share of the range of the search, within which of its end a parameter stands at the bound
MOST_ROUNDS = 12  # of instruments and noise models
SETTLED = 0.1  # change in a round, in standard deviations of each parameter, that ends them
LEAST_UNANSWERED = 0.05  # chance without feedback, below which the rudder is said to answer roll
SEEN = 3.0  # standard deviations of an effect, from which it is estimated
EXPLAINED = 0.1  # of the sum of squares that is left without it, that it takes away at least
STAYS, MOST_TRIES = 2.5, 2  # standard deviations, below which it is left out again, and times after which for good
# most of them: damping by the square over the linear one at the rms rate, lengths of 0.3 beams or heights of the load,
# an angle
MOST_BENT, MOST_LENGTHS, MOST_TILT_RAD = 5.0, 8.0, 0.5
LEAST_ROUNDS = 3  # before effects are looked for
EFFECT_NAMES = tuple(EFFECTS)
CHI2_95 = 3.841  # of one degree of freedom
UNSEEN = 1e-9  # relative sensitivity below which the equations themselves leave a direction open


METHODS = ("iv", "ls")


@dataclass(frozen=True, kw_only=True, eq=False)
class RollProblem:
    """What is sought, from what."""

    body: Body  # what is known of the ship
    cases: tuple[Case, ...]  # prepared, of one sample time
    free: tuple[str, ...]  # names of the parameters that are estimated; others keep their start values
    start: Array  # (9,) where the search begins
    scale: Array  # (9,) a typical size of each parameter, positive

    def __post_init__(self) -> None:
        seal(self, start="9", scale="9")
        if not self.cases:
            raise InputError("no load case is given, expected one or more")
        if len({run.step_s for case in self.cases for run in case.runs}) > 1:
            raise InputError("the load cases differ in sample time, expected one for all")
        if not self.free or not set(self.free) <= set(PARAMETERS):
            raise InputError(f"free is {self.free}, expected some of {', '.join(PARAMETERS)}")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest parameters (9,): many times their typical size; an inertia is positive."""
        low, high = -FARTHEST * self.scale, FARTHEST * self.scale
        place = PARAMETERS.index("A_x")
        low[place] = self.scale[place] / FARTHEST**2
        low[PARAMETERS.index("m")] = 0.0
        return np.minimum(low, self.start), np.maximum(high, self.start)

    @property
    def step_s(self) -> float:
        """Time between samples [s]."""
        return self.cases[0].runs[0].step_s

    @property
    def places(self) -> list[int]:
        """Places of the free parameters among all."""
        return [PARAMETERS.index(name) for name in self.free]


def build_problem(
    body: Body,
    cases: tuple[Case, ...],
    *,
    beam_m: float,
    roll_hz: float,
    known: Mapping[str, float],
    start: Mapping[str, float],
) -> RollProblem:
    """A problem that begins with what a ship of this beam and roll frequency usually has.

    Args:
        body, cases: what is known.
        beam_m: of the ship, whose radius of gyration is taken as 0.35 of it.
        roll_hz: frequency of roll, roughly.
        known: parameters that are not estimated.
        start: of some that are.

    Raises:
        InputError: known leaves nothing to estimate.
    """
    inertia = body.mass_kg * (0.35 * beam_m) ** 2
    turn, moment = 2.0 * np.pi * roll_hz, first_moment(body, NOMINAL)
    righting = (inertia + body.mass_kg * body.z_g**2) * turn**2
    stated = [case.load for case in cases if case.load is not None and case.load.mass_kg > 0]
    mass = max((load.mass_kg for load in stated), default=0.02 * body.mass_kg)
    place = min((load.z_m for load in stated), default=body.z_g - 0.5 * beam_m)
    k, size = righting - G_MPS2 * moment, 0.3 * beam_m
    scale = parameters(
        k=max(righting, abs(k)), A_x=inertia, d=0.2 * righting / turn, K_r=2.0 * righting / turn,
        K_vd=0.15 * body.mass_kg * beam_m, K_delta=0.1 * righting, z_f=0.1 * beam_m, m=mass, z_m=max(size, abs(place)),
    )  # fmt: skip
    begin = parameters(k=k, A_x=inertia, d=0.2 * righting / turn, m=mass, z_m=place)
    for name, value in {**start, **known}.items():
        begin[PARAMETERS.index(name)] = value
    sought = PARAMETERS if any(case.load is None for case in cases) else PARAMETERS[:-2]
    free = tuple(name for name in sought if name not in known)
    return RollProblem(body=body, cases=cases, free=free, start=begin, scale=np.maximum(scale, 0.1 * np.abs(begin)))


@dataclass(frozen=True, kw_only=True, eq=False)
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
    # would give; nan for least squares
    strength: float
    # least sum of squares over its expected value, 1 for a model that fits; nan where nothing is left over
    surprise: float
    # chance that a rudder without feedback correlates with the roll moment as much as this one, 0 to 1; nan for least
    # squares and a ship that does not stay upright
    unanswered: float
    freedom: float  # degrees of freedom of the noise's power, of the case with the fewest, at each frequency

    # effect of `EFFECTS` -> value and standard deviation, of those that the data show
    effects: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    load_interval: tuple[float, float] | None = None  # of m, 95 % by its profile [kg]; None where it is not sought

    def __post_init__(self) -> None:
        seal(self, theta="9", covariance="p p", sensed="q p", rounds="r 9")

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
        fits = self.settled and not self.reached and not self.surprise > TUNING.most_surprise
        return self.method == "iv" and fits and not self.weak and not self.answering

    @property
    def weak(self) -> bool:
        """Whether noise hides what the rudder does, so that the estimate leans towards least squares."""
        return self.strength < TUNING.least_strength

    @property
    def answering(self) -> bool:
        """Whether the rudder answers what rolls the ship, so that it is no instrument."""
        return self.unanswered < LEAST_UNANSWERED


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
        values = [*_sampled(problem, theta)]
    added: list[int] = []
    unseen_before: list[int] = []
    while True:
        parts = zip(problem.cases, instruments, values, strict=True)
        weighted = [weighted_equations(case, own, one) for case, own, one in parts]
        before, (theta, sensed, left) = theta, _solved(problem, weighted, theta, held)
        history.append(theta)
        settled = len(history) > 1 and _little(problem, theta - before, sensed)
        more, std = _more(problem, weighted, theta, sensed, left, added)
        settled = settled and bool((np.abs(more) <= 2 * SETTLED * std).all())
        if method == "iv" and values[0] is not None and len(history) >= LEAST_ROUNDS:
            unseen = _unseen(problem, added, std)
            problem, unseen_before = _without_effects(problem, unseen), [*unseen_before, *unseen]
            added = [place for place in added if place not in unseen]
            banned = [place for place in unseen_before if unseen_before.count(place) >= MOST_TRIES]
            new = [] if unseen else _missed(problem, weighted, theta, sensed, left, added, banned)
            added, settled = [*added, *new], settled and not new and not unseen
        if settled or len(history) == MOST_ROUNDS * (1 + bool(added)):
            break
        if added:
            more, _ = _more(problem, weighted, theta, sensed, left, added)
            problem = _with_effects(problem, added, more)
        values = [*_sampled(problem, theta)]
    _, std = _more(problem, weighted, theta, sensed, left, added)
    effects = dict(zip([EFFECT_NAMES[place] for place in added], zip(
        [problem.cases[0].runs[0].effects[place] for place in added], std.tolist(), strict=True
    ), strict=True))  # fmt: skip
    gone = np.linalg.qr(_by_effects(problem, weighted, theta)[:, added])[0]
    sensed, left = sensed - gone @ (gone.T @ sensed), left - gone @ (gone.T @ left)
    settled = settled and bool((np.abs(problem.cases[0].runs[0].effects) < 0.999 * _most_effects(problem)).all())
    surprise = _surprise(left, len(problem.free) - len(held) + len(added))
    covariance = _covariance(problem, weighted, theta, sensed, held, method)
    return RollEstimate(
        problem=problem,
        method=method,
        theta=theta,
        covariance=covariance,
        held=held,
        sensed=sensed,
        rounds=np.array(history),
        settled=settled,
        strength=_strength(problem, weighted, theta, sensed, covariance) if method == "iv" else float("nan"),
        surprise=surprise,
        unanswered=_unanswered(problem, weighted, theta, sensed, surprise) if method == "iv" else float("nan"),
        freedom=min(spectrum(residuals).freedom for residuals in _noise(problem, weighted, theta)),
        effects=effects,
        load_interval=_profile(problem, weighted, theta, sensed, covariance, held, gone),
    )


def _with_effects(problem: RollProblem, added: Sequence[int], more: Array) -> RollProblem:
    change, most = np.zeros(len(EFFECT_NAMES)), _most_effects(problem)
    change[list(added)] = more

    def changed(run: Run) -> Run:
        return replace(run, effects=tuple(np.clip(np.array(run.effects) + change, -most, most).tolist()))

    cases = [replace(case, runs=tuple(map(changed, case.runs))) for case in problem.cases]
    return replace(problem, cases=tuple(cases))


def _without_effects(problem: RollProblem, places: Sequence[int]) -> RollProblem:
    now = problem.cases[0].runs[0].effects
    return _with_effects(problem, places, np.array([-now[place] for place in places])) if places else problem


def _unseen(problem: RollProblem, added: Sequence[int], std: Array) -> list[int]:
    """Effects that better weights show to be none."""
    now = problem.cases[0].runs[0].effects
    small = [abs(now[place]) < STAYS * error for place, error in zip(added, std.tolist(), strict=True)]
    return [place for place, none in zip(added, small, strict=True) if none and now[place]]


def _most_effects(problem: RollProblem) -> Array:
    """(3,) beyond which no effect is sought."""
    rms = np.sqrt(np.mean(np.concatenate([run.signals[:, 0] for case in problem.cases for run in case.runs]) ** 2))
    length = float(problem.scale[PARAMETERS.index("z_m")])
    return np.array([MOST_BENT / max(float(rms), 1e-12), MOST_LENGTHS * length, MOST_TILT_RAD])


def _by_effects(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(q, 3) derivatives of the weighted residuals by the effects."""
    by = zip(weighted, _sampled(problem, theta), strict=True)
    return np.concatenate([part.effects[:, :, 0] - part.effects[:, :, 1:] @ values for part, values in by])


def _more(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, sensed: Array, left: Array, places: Sequence[int]
) -> tuple[Array, Array]:
    """By how much some effects are too small, and their standard deviations, beside all parameters."""
    by = _by_effects(problem, weighted, theta)[:, list(places)]
    across = by - _onto(sensed * problem.scale[problem.places], by)
    inverse = np.linalg.pinv(across, rcond=1e-10)
    return -inverse @ left, np.sqrt(np.diag(inverse @ inverse.T))


def _missed(
    problem: RollProblem,
    weighted: Sequence[Weighted],
    theta: Array,
    sensed: Array,
    left: Array,
    added: Sequence[int],
    banned: Sequence[int],
) -> list[int]:
    """The effect that data show most clearly of those not among the parameters yet; all where much is missed."""
    rest = [place for place in range(len(EFFECT_NAMES)) if place not in (*added, *banned)]
    if not added and not banned and _surprise(left, len(problem.free)) > TUNING.most_surprise:
        return rest  # which of them it is shows when none is missing
    scores = []
    for place in rest:
        more, std = _more(problem, weighted, theta, sensed, left, [*added, place])
        scores.append((abs(more[-1]) / max(std[-1], 1e-300), place))
    best = max(scores, default=(0.0, 0))
    return [best[1]] if best[0] > SEEN and best[0] ** 2 > EXPLAINED * float(left @ left) else []


def _onto(columns: Array, vector: Array) -> Array:
    """The part of vectors (q, n) in the span of columns (q, p)."""
    return np.asarray(columns @ (np.linalg.pinv(columns, rcond=1e-10) @ vector))


def _profile(
    problem: RollProblem,
    weighted: Sequence[Weighted],
    theta: Array,
    sensed: Array,
    covariance: Array,
    held: Sequence[str],
    gone: Array,
) -> tuple[float, float] | None:
    """95 % interval of the unknown load's mass by the profile of the sum of squares; None where it is not sought.

    A mass is positive, and what tells it, moments over the product of mass and height, is not linear in it. Far from
    the estimate the sum of squares grows slower than its curvature there says, on one side more than on the other.

    Source: D. M. Bates and D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), 6.1.
    """
    if "m" not in problem.free or "m" in held:
        return None
    place, own = PARAMETERS.index("m"), problem.free.index("m")
    std = math.sqrt(float(covariance[own, own]))
    plain = sensed * problem.scale[problem.places]
    least = math.sqrt(max(float(np.linalg.pinv(plain.T @ plain, rcond=1e-12)[own, own]), 0.0)) * problem.scale[place]
    if not (0 < std < math.inf and least > 0):
        return None
    others = [PARAMETERS.index(name) for name in problem.free if name not in (*held, "m")]
    low, high = problem.bounds
    enough = CHI2_95 * (std / least) ** 2
    best, found = _cost(problem, weighted, theta, gone), np.array(theta)

    def excess(mass: float) -> float:
        nonlocal found

        def full(values: Array) -> Array:
            result = np.array(found)
            result[others], result[place] = values, mass
            return result

        def apart(values: Array) -> Array:
            left = _residuals(problem, weighted, full(values))
            return np.asarray(left - gone @ (gone.T @ left))

        def slopes(values: Array) -> Array:
            rows = _slopes(problem, weighted, full(values))[:, others]
            return np.asarray(rows - gone @ (gone.T @ rows))

        begin = np.clip(found[others], low[others], high[others])
        one = scipy.optimize.least_squares(
            apart, begin, slopes, bounds=(low[others], high[others]), x_scale=problem.scale[others]
        )
        found = full(one.x)
        return float(2.0 * one.cost - best - enough)

    ends = []
    for side, bound in ((-1.0, float(low[place])), (1.0, float(high[place]))):
        found, near, far = np.array(theta), float(theta[place]), float(theta[place])
        for factor in (1.0, 2.0, 4.0, 8.0, 16.0):
            far = float(np.clip(theta[place] + side * factor * std, low[place], high[place]))
            if far == bound or excess(far) > 0:
                break
            near = far
        if (far == bound and excess(far) <= 0) or excess(far) <= 0:
            ends.append(0.0 if side < 0 else math.inf)
        else:
            ends.append(float(scipy.optimize.brentq(excess, near, far, rtol=1e-3)))
    return ends[0], ends[1]


def _cost(problem: RollProblem, weighted: Sequence[Weighted], theta: Array, gone: Array) -> float:
    left = _residuals(problem, weighted, theta)
    return float(left @ left - np.sum((gone.T @ left) ** 2))


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
    noise = _noise(problem, weighted, theta)
    return chance_of_answers(problem.cases, weighted, noise, slopes, sensed, periods, surprise)


def _surprise(left: Array, fitted: int) -> float:
    return float(left @ left) / (len(left) - fitted) if len(left) > fitted else float("nan")


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


def _sampled(problem: RollProblem, theta: Array) -> list[Array]:
    """Sampled coefficients (5,) of each case."""
    return [discrete(theta, problem.body, case.load, problem.step_s).values for case in problem.cases]


def _noise(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> list[list[Array]]:
    """Residuals (n,) of each run of each case."""
    by = zip(weighted, _sampled(problem, theta), strict=True)
    return [[rows.residuals(values) for rows in part.rows] for part, values in by]


def _solved(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, held: Sequence[str]
) -> tuple[Array, Array, Array]:
    """Parameters (9,), derivatives (q, p) of the weighted residuals by the free ones, and these residuals (q,)."""
    places = [PARAMETERS.index(name) for name in problem.free if name not in held]
    equations = sum(len(part.top) for part in weighted)
    if equations < len(places):
        raise NotInformative(
            f"the data give {equations} equations for {len(places)} roll parameters, expected a rudder that moves the "
            "ship, and more load cases or fewer parameters"
        )

    def full(values: Array) -> Array:
        result = np.array(theta)
        result[places] = values
        return result

    low, high = problem.bounds
    found = scipy.optimize.least_squares(
        lambda values: _residuals(problem, weighted, full(values)), np.clip(theta, low, high)[places],
        lambda values: _slopes(problem, weighted, full(values))[:, places], bounds=(low[places], high[places]),
        x_scale=problem.scale[places], xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip
    return full(found.x), _slopes(problem, weighted, full(found.x))[:, problem.places], np.asarray(found.fun)


def _residuals(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    return np.concatenate(
        [part.top - part.slope @ c for part, c in zip(weighted, _sampled(problem, theta), strict=True)]
    )


def _slopes(problem: RollProblem, weighted: Sequence[Weighted], theta: Array) -> Array:
    """(q, 9) derivatives of the residuals."""
    by = [discrete(theta, problem.body, case.load, problem.step_s).jacobian for case in problem.cases]
    return -np.concatenate([part.slope @ rows for part, rows in zip(weighted, by, strict=True)])


def _little(problem: RollProblem, change: Array, sensed: Array) -> bool:
    """Whether a change of the parameters moves no weighted residual by more than a small part of its deviation."""
    return bool(np.linalg.norm(sensed @ change[problem.places]) <= SETTLED * np.sqrt(len(problem.free)))


def _covariance(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, sensed: Array, held: Sequence[str], method: str
) -> Array:
    """(p, p) covariance from the spectra of the last residuals, flat ones for least squares; zero for what is held.

    The same residuals give the spectrum and are weighed by it. With 2 K degrees of freedom at each frequency the
    inverse of the curvature comes out too small by (K - 1) / K, and the variance is larger by K / (K - 1) than with the
    true spectrum: so it is for chi-square powers that count among the K they are divided by.
    """
    scale = problem.scale[problem.places] * [name not in held for name in problem.free]
    inverse = np.linalg.pinv(sensed * scale, rcond=1e-12)
    first, middle = 0, np.zeros((len(scale),) * 2)
    for part, residuals in zip(weighted, _noise(problem, weighted, theta), strict=True):
        last = first + len(part.top)
        change = inverse[:, first:last]
        noise = spectrum(residuals) if method == "iv" else flat_spectrum(residuals)
        middle += change @ noise.covariance(part.basis) @ change.T / (1.0 - 2.0 / noise.freedom) ** 2
        first = last
    return np.asarray(middle * np.outer(scale, scale))


def _strength(
    problem: RollProblem, weighted: Sequence[Weighted], theta: Array, sensed: Array, covariance: Array
) -> float:
    """Least ratio, over combinations of the free parameters, of what they move to what noise alone would seem to.

    That is the smallest F statistic of a regression of the regressors on the instruments. Noise is what their plain
    regression on the instruments leaves.

    Source: J. G. Cragg and S. G. Donald, Econometric Theory 9 (1993), 222-240, with spectra in place of variances;
    D. Staiger and J. H. Stock, Econometrica 65 (1997), 557-586, for what weak instruments do.
    """
    std = np.sqrt(np.diag(covariance))
    found = std > 0
    noise = np.zeros((len(std),) * 2)
    for case, part in zip(problem.cases, weighted, strict=True):
        columns = [[hidden[:, j] for hidden in part.hidden] for j in range(5)]
        power = flat_spectrum(columns[0]).power(part.basis)
        by = np.array([[cross_spectrum(one, other).real @ power for other in columns] for one in columns])
        jacobian = discrete(theta, problem.body, case.load, problem.step_s).jacobian[:, problem.places]
        noise += jacobian.T @ by @ jacobian
    size = np.outer(std[found], std[found])
    information, seeming = ((both[np.ix_(found, found)]) * size for both in (sensed.T @ sensed, noise))
    regular = seeming + 1e-12 * np.trace(seeming) * np.eye(len(seeming))
    return float(scipy.linalg.eigh(information, regular, eigvals_only=True)[0])


# An estimate as the roll pendulum of a vessel.


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
