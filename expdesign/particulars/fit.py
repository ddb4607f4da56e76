"""The values of a card fitted, with the regressions as prior; what follows for her trials, and what contradicts.

The unknowns are the logarithms of `FACTORS` by their standard deviations, a priori independent and standard normal.
The most probable ones minimise

    sum over stated values of (log(simulated / stated) / scatter)^2 + sum of squared unknowns;

the inverse of half its curvature is their covariance. Intervals are quantiles of simulated trials of drawn ships.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from expdesign.particulars.card import SCATTER, Card, Stated, Trial
from expdesign.particulars.forces import EFFICIENCY, Propeller, design_speed, propellers
from expdesign.particulars.hull import BEYOND, FACTORS, factors, is_usual, resistance, scatter
from expdesign.particulars.intervals import DRAWS, Expected, interval
from expdesign.particulars.model import OWN_SCATTER, parameters, vessel_of, with_scatter
from expdesign.particulars.trials import Fleet
from expdesign.progress import Progress, silent
from expdesign.values import Array
from expdesign.vessel import Vessel

STEP = 0.05  # change of an unknown for its derivative
MOST_FITS = 25
DOUBTFUL = 3.0  # standard deviations from what all other values say, from which a value contradicts them
SAME_SPEED = 0.03  # share within which two speeds or orders count as one
NEAR_SPEED = 0.10  # share within which a standard trial is left out beside a stated one
KINDS = ("speed", "circle", "zigzag", "stop", "spin", "drift")
APPROACHED = ("circle", "zigzag", "stop")
PITCH = (0.45, 1.55)  # pitch ratios that propellers have


@dataclass(frozen=True, kw_only=True)
class Predicted(Expected):
    """An expected result beside what the card states."""

    prior: float  # from particulars alone
    stated: tuple[Stated, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Found:
    """A factor before and after the fit."""

    name: str
    source: str
    std_log: float  # before
    value: float  # after
    std_log_after: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Nominal:
    """A vessel out of a card."""

    card: Card
    driving: tuple[Propeller, ...]
    vessel: Vessel  # with standard deviations and correlations
    found: tuple[Found, ...]  # factors that act in this ship
    predicted: tuple[Predicted, ...]
    contradictions: tuple[str, ...]  # one sentence each


class Problem:
    """Simulated values of trials and their derivatives, for unknowns."""

    def __init__(self, card: Card) -> None:
        self.card, self.driving = card, propellers(card)
        self.ship = vessel_of(card, self.driving, np.zeros(len(FACTORS)))
        base = self.ship.model.parameters
        changed = [self.parameters(unknowns) != base for unknowns in np.eye(len(FACTORS))]
        self.active = [place for place, differs in enumerate(changed) if differs.any()]

    def parameters(self, unknowns: Array) -> Array:
        """(p,) for unknowns (f,)."""
        found = {term.name: value for term, value in parameters(self.card, self.driving, unknowns).items()}
        return np.array([found[name] for name in self.ship.model.names])

    def scatter_of(self, quantity: str) -> float:
        """Standard deviation of a result's logarithm beside what parameters explain."""
        return SCATTER[quantity] * (1.0 if is_usual(self.card.hull) else BEYOND)

    def slopes(self, unknowns: Array) -> Array:
        """(p, f) of parameters by active unknowns."""
        base = self.parameters(unknowns)
        steps = STEP * np.eye(len(FACTORS))[self.active]
        return np.array([(self.parameters(unknowns + step) - base) / STEP for step in steps]).T

    def drawn(self, unknowns: Array, covariance: Array, rng: np.random.Generator) -> Array:
        """(n, p) parameters of ships drawn around unknowns (f,), with scatter of their own."""
        draws = _full(unknowns, self.active) + np.stack(
            [_full(one, self.active) for one in rng.multivariate_normal(0 * unknowns, covariance, size=DRAWS)]
        )
        found = np.array([self.parameters(one) for one in draws])
        return np.asarray(found * np.exp(OWN_SCATTER * rng.standard_normal(found.shape)))

    def fleet(self, parameters: Array) -> Fleet:
        """Ships with these parameters (n, p)."""
        return Fleet(self.ship, parameters, fastest_mps=4 * design_speed(self.card))

    def simulated(self, unknowns: Array, trials: Iterable[Trial]) -> dict[tuple[Trial, str], tuple[float, Array]]:
        """Logarithm of each quantity, with its derivatives by active unknowns."""
        base = self.parameters(unknowns)
        steps = STEP * np.eye(len(FACTORS))[self.active]
        fleet = self.fleet(np.array([base, *(self.parameters(unknowns + step) for step in steps)]))
        found = {}
        for trial in trials:
            for quantity, values in fleet.results(trial).items():
                with np.errstate(divide="ignore", invalid="ignore"):
                    logs = np.log(values)
                slopes = (logs[1:] - logs[0]) / STEP
                found[trial, quantity] = float(logs[0]), np.where(np.isfinite(slopes), slopes, 0.0)
        return found


class _Residuals:
    """Residuals and their derivatives at the last unknowns asked for."""

    def __init__(self, problem: Problem, stated: tuple[Stated, ...]) -> None:
        self.problem, self.stated = problem, stated
        self._at: Array | None = None

    def _look(self, unknowns: Array) -> None:
        if self._at is not None and np.array_equal(self._at, unknowns):
            return
        full = _full(unknowns, self.problem.active)
        found = self.problem.simulated(full, dict.fromkeys(one.trial for one in self.stated))
        count = len(unknowns)
        self.values = np.array([found[one.trial, one.quantity][0] for one in self.stated]).reshape(-1)
        self.slopes = np.array([found[one.trial, one.quantity][1] for one in self.stated]).reshape(-1, count)
        self._at = unknowns.copy()

    @cached_property
    def std(self) -> Array:
        return np.array([self.problem.scatter_of(one.quantity) for one in self.stated])

    def errors(self, unknowns: Array) -> Array:
        """Of logarithms; a trial that is not completed counts as twice too large."""
        self._look(unknowns)
        logs = np.log([one.value for one in self.stated])
        return np.asarray(np.nan_to_num(self.values - logs, nan=math.log(2), posinf=math.log(2), neginf=-math.log(2)))

    def __call__(self, unknowns: Array) -> Array:
        return np.concatenate([self.errors(unknowns) / self.std, unknowns])

    def jacobian(self, unknowns: Array) -> Array:
        self._look(unknowns)
        return np.asarray(np.concatenate([self.slopes / self.std[:, None], np.eye(len(unknowns))]))


def _full(unknowns: Array, active: list[int]) -> Array:
    full = np.zeros(len(FACTORS))
    full[active] = unknowns
    return full


def fitted(problem: Problem, stated: tuple[Stated, ...]) -> tuple[Array, Array]:
    """The most probable unknowns (f,) and their covariance (f, f), of those factors that act in the ship."""
    residuals = _Residuals(problem, stated)
    count = len(problem.active)
    if not stated:
        return np.zeros(count), np.eye(count)
    best = scipy.optimize.least_squares(
        residuals, np.zeros(count), jac=residuals.jacobian, max_nfev=MOST_FITS, ftol=1e-5, xtol=1e-5, bounds=(-4.0, 4.0)
    ).x
    slopes = residuals.jacobian(best)
    return np.asarray(best), np.asarray(np.linalg.inv(slopes.T @ slopes))


def consistent(problem: Problem, stated: tuple[Stated, ...]) -> tuple[Array, Array, tuple[str, ...]]:
    """As `fitted`, without values that contradict all others and the particulars, worst first; a sentence on each."""
    kept, said = stated, list[str]()
    while True:
        unknowns, covariance = fitted(problem, kept)
        if not kept:
            return unknowns, covariance, tuple(said)
        residuals = _Residuals(problem, kept)
        errors, std = residuals.errors(unknowns), residuals.std
        # of a value that is fitted with the others, from what the others alone would say
        left = np.maximum(1.0 - np.einsum("if,fg,ig->i", residuals.slopes, covariance, residuals.slopes) / std**2, 1e-3)
        apart = np.abs(errors) / (std * np.sqrt(left))
        worst = int(np.argmax(apart))
        if apart[worst] <= DOUBTFUL:
            return unknowns, covariance, tuple(said)
        one, kept = kept[worst], (*kept[:worst], *kept[worst + 1 :])
        others = shown(one.quantity, one.value * math.exp(float(errors[worst] / left[worst])))
        said.append(
            f"{one.source} is {shown(one.quantity, one.value)}, where all else says about {others}: {apart[worst]:.1f} "
            "standard deviations apart, it is left out of the fit"
        )


def nominal(card: Card, *, also: tuple[Trial, ...] = (), seed: int = 0, progress: Progress = silent) -> Nominal:
    """The vessel of a card.

    Args:
        card: particulars and stated values.
        also: trials to predict beside those of the card and the standard ones.
        seed: of the ships that are drawn for intervals.

    Raises:
        InputError: nothing drives her.
    """
    problem, stated = Problem(card), _with_top_speed(card)
    progress("fitting the stated values", 0.1)
    unknowns, covariance, contradictions = consistent(problem, stated)
    progress("simulating her trials", 0.6)
    full = _full(unknowns, problem.active)
    rng = np.random.default_rng(seed)
    named = np.stack([problem.parameters(np.zeros(len(FACTORS))), problem.parameters(full)])
    fleet = problem.fleet(np.concatenate([named, problem.drawn(unknowns, covariance, rng)]))
    trials = _trials(card, stated, also)
    predicted = [one for trial in trials for one in _predicted(problem, trial, fleet, stated, rng)]
    return Nominal(
        card=card,
        driving=problem.driving,
        vessel=with_scatter(vessel_of(card, problem.driving, full), problem.slopes(full), covariance),
        found=_found(problem, full, covariance),
        predicted=tuple(predicted),
        contradictions=(*_impossible(card, problem.driving), *contradictions),
    )


def _with_top_speed(card: Card) -> tuple[Stated, ...]:
    """What is fitted: the stated values, and the top speed unless a speed at full order is among them."""
    known = any(one.trial.kind == "speed" and abs(one.trial.order - 1.0) < SAME_SPEED for one in card.stated)
    if card.top_speed_mps is None or known:
        return card.stated
    top = Stated(trial=Trial(kind="speed"), quantity="speed_mps", value=card.top_speed_mps, source="ship.top_speed_kn")
    return (top, *card.stated)


def _trials(card: Card, stated: tuple[Stated, ...], also: tuple[Trial, ...]) -> list[Trial]:
    """What is predicted, kind by kind: all stated trials, and the standard ones where none of these is like them."""
    known = list(dict.fromkeys([*(one.trial for one in stated), *also]))
    rest = [one for one in _standard(card) if not any(_alike(one, other) for other in known)]
    return sorted([*known, *rest], key=lambda one: (KINDS.index(one.kind), one.angle_rad, -one.speed_mps, -one.order))


def _standard(card: Card) -> Iterator[Trial]:
    top = design_speed(card)
    for order in (0.25, 0.5, 0.75, 1.0):
        yield Trial(kind="speed", order=order)
    if all(one.astern_share > 0 for one in card.drives):
        yield Trial(kind="stop", speed_mps=0.95 * top)
    if any(one.kind != "propeller" or one.starboard_m for one in card.thrusters):
        yield Trial(kind="spin")
    if card.windage is not None:
        yield Trial(kind="drift", speed_mps=20 * 1852 / 3600)
    if not _steers(card):
        return
    hard = min([math.radians(35.0), *(rudder.angle_max_rad for rudder in card.rudders)])
    for share in (0.95, 0.65, 0.35):
        yield Trial(kind="circle", speed_mps=share * top, angle_rad=hard)
    for degrees in (10.0, 20.0):
        yield Trial(kind="zigzag", speed_mps=0.95 * top, angle_rad=math.radians(degrees))


def _steers(card: Card) -> bool:
    """Whether she has rudders, azimuth thrusters, or propellers on both sides."""
    sides = {math.copysign(1.0, one.starboard_m) for one in card.drives if one.starboard_m}
    return bool(card.rudders) or any(one.kind != "propeller" for one in card.drives) or len(sides) == 2


def _alike(one: Trial, other: Trial) -> bool:
    near = abs(one.speed_mps - other.speed_mps) <= NEAR_SPEED * max(one.speed_mps, other.speed_mps)
    same = abs(one.angle_rad - other.angle_rad) < 0.01 and abs(one.order - other.order) < SAME_SPEED
    return one.kind == other.kind and near and same


def _predicted(
    problem: Problem, trial: Trial, fleet: Fleet, stated: tuple[Stated, ...], rng: np.random.Generator
) -> Iterator[Predicted]:
    """Of the ship from particulars alone, the fitted one, then drawn ones; a trial without end counts as endless."""
    for quantity, values in fleet.results(trial).items():
        before, value, *drawn = np.nan_to_num(values, nan=math.inf).tolist()
        scatter = problem.scatter_of(quantity) * rng.standard_normal(len(drawn))
        low, high = interval(value, np.array(drawn) * np.exp(scatter))
        yield Predicted(
            trial=trial, quantity=quantity, value=value, low=low, high=high, prior=before,
            stated=tuple(one for one in stated if one.trial == trial and one.quantity == quantity),
        )  # fmt: skip


def _found(problem: Problem, full: Array, covariance: Array) -> tuple[Found, ...]:
    hull = problem.card.hull
    given, before, spreads = factors(hull, full), scatter(hull).tolist(), np.sqrt(np.diag(covariance)).tolist()
    return tuple(
        Found(
            name=FACTORS[place].name, source=FACTORS[place].source, std_log=before[place],
            value=given[FACTORS[place].name], std_log_after=before[place] * spread,
        )
        for place, spread in zip(problem.active, spreads, strict=True)
    )  # fmt: skip


def _impossible(card: Card, driving: tuple[Propeller, ...]) -> Iterator[str]:
    """Particulars that no ship has together."""
    if not 0.3 <= card.hull.block <= 0.95:
        yield (
            f"ship.displacement_t and the dimensions give a block coefficient of {card.hull.block:.2f}, expected 0.3 "
            "to 0.95"
        )
    for one in driving:
        if one.thruster.max_rps is not None and one.thruster.diameter_m and not PITCH[0] < one.pitch_ratio < PITCH[1]:
            yield (
                f"thrusters[{one.number}]: {60 * one.max_rps:.0f} rpm with {one.diameter_m:g} m at "
                f"{shown('speed_mps', one.design_mps)} would take a pitch ratio of "
                f"{'more' if one.pitch_ratio > 1 else 'less'} than {PITCH[int(one.pitch_ratio > 1)]:g}"
            )
    top = card.top_speed_mps
    if top is None:
        return
    fastest = max(
        (one for one in card.stated if one.trial.kind in APPROACHED), key=lambda one: one.trial.speed_mps, default=None
    )
    if fastest is not None and fastest.trial.speed_mps > (1 + SAME_SPEED) * top:
        where = fastest.source.rpartition(".")[0]
        yield (
            f"{where}.speed_kn is {shown('speed_mps', fastest.trial.speed_mps)}, more than ship.top_speed_kn, "
            f"{shown('speed_mps', top)}"
        )
    power = sum(one.power_w for one in card.drives if one.power_w)
    needed = resistance(card.hull, top) * top**3 / EFFICIENCY
    if power and needed / power > math.exp(DOUBTFUL * float(scatter(card.hull)[0])):
        yield (
            f"ship.top_speed_kn is {shown('speed_mps', top)}, which takes about {needed / 1e3:.0f} kW "
            f"on the shafts, and the thrusters have {power / 1e3:.0f} kW"
        )


UNITS = {"mps": (3600 / 1852, "kn"), "m": (1.0, "m"), "s": (1.0, "s"), "rad": (180 / math.pi, "deg")}
"""Ending of a quantity -> factor and unit as mariners have it."""


def shown(quantity: str, value: float) -> str:
    """A value with its unit, as on a card."""
    scale, unit = UNITS[quantity.rpartition("_")[2]]
    number = scale * value
    decimals = max(2 - math.floor(math.log10(abs(number))), 0) if number else 0
    return f"{round(number, decimals):.{decimals}f} {unit}"
