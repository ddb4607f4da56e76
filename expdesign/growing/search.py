"""Search for the candidate that is worth most: a quasi-random pool, then local random steps from the best ones.

Candidates are the settings of every family, as points of the unit cube, within velocity limits. A candidate's matrix
does not depend on the design, so every simulated candidate is kept and its worth for a new design costs one product. No
evaluated candidate is worth more than reported. This is not a bound over all members of the families.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np

from expdesign.conventions import rotated
from expdesign.dictionary import Family, PrimitiveSpec, Setting
from expdesign.dictionary.build import excite_many
from expdesign.errors import InputError
from expdesign.information import PrimitiveInformation
from expdesign.information.disturbed import bordered_runs
from expdesign.processes import in_order
from expdesign.progress import Progress, silent
from expdesign.simulation import Environment
from expdesign.simulation.helm import steady_ahead
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

DRAWS = 100_000  # random draws of a family among which the search chooses
HEADING_RAD = (0.05, 1.0)  # range of searched heading changes
HELM_DEG = 35.0  # largest searched helm angle


@dataclass(frozen=True, kw_only=True, eq=False)
class Axis:
    """One searched setting."""

    name: str  # of the setting
    # low, high: its range
    low: float
    high: float
    scale: str = "linear"  # "linear", "log" or "whole"

    def value(self, share: float) -> float:
        """The setting at a place from 0 to 1."""
        if self.scale == "log":
            return float(self.low * (self.high / self.low) ** share)
        value = self.low + (self.high - self.low) * share
        return float(np.floor(value)) if self.scale == "whole" else float(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilySpace:
    """All members of a family with one duration and within velocity limits."""

    family: Family  # the family
    axes: tuple[Axis, ...]  # its searched settings
    run_s: float  # duration of a run [s]

    def spec(self, point: Array) -> PrimitiveSpec:
        """The member at a point (a,) of the unit cube."""
        given = {axis.name: axis.value(float(share)) for axis, share in zip(self.axes, point, strict=True)}
        settings = {"duration_s": self.run_s, **given}
        for setting in self.family.settings:
            if setting.name not in settings:
                assert setting.default is not None  # every setting without a default is searched
                settings[setting.name] = setting.default
        return PrimitiveSpec(name=self.family.name, family=self.family.name, settings=settings)


def family_spaces(vessel: Vessel, families: tuple[Family, ...], limits: Array, run_s: float) -> tuple[FamilySpace, ...]:
    """The search spaces of the families that the vessel can run.

    Families of helm orders need a helm that turns the ship; recorded commands are not searched.

    Raises:
        InputError: no family is left.
    """
    steers = _steers(vessel, limits)
    chosen = [item for item in families if item.name != "recorded" and (item.reference is not None or steers)]
    if not chosen:
        raise InputError(f"vessel {vessel.name!r} can run no searched manoeuvre family within the limits")
    return tuple(_space(vessel, item, limits, run_s) for item in chosen)


def _steers(vessel: Vessel, limits: Array) -> bool:
    """Whether the vessel can hold a straight approach at half the largest speed and turn by its helm."""
    try:
        return limits[0, 1] > 0 and steady_ahead(vessel, float(limits[0, 1]) / 2).starboard != 0
    except InputError:
        return False


def _space(vessel: Vessel, family: Family, limits: Array, run_s: float) -> FamilySpace:
    axes = (_axis(vessel, setting, limits, run_s) for setting in family.settings if setting.searched)
    return FamilySpace(family=family, axes=tuple(axis for axis in axes if axis is not None), run_s=run_s)


def _axis(vessel: Vessel, setting: Setting, limits: Array, run_s: float) -> Axis:
    (u_low, u_high), sway, yaw = limits.tolist()
    widest = {"sway": max(map(abs, sway)), "yaw": max(map(abs, yaw))}
    low, high, scale, helm_rad = 0.0, 1.0, "linear", float(np.radians(HELM_DEG))
    if setting.searched == "surge":
        low, high = (0.0, (u_high - u_low) / 2) if "swing" in setting.name else (u_low, u_high)
    elif setting.searched in widest:
        low, high = -widest[setting.searched], widest[setting.searched]
    elif setting.searched == "time":
        low, high, scale = max(4 * vessel.sample_time_s, run_s / 40), run_s, "log"
    elif setting.searched == "helm":
        low, high = -helm_rad, helm_rad
    elif setting.searched == "heading":
        low, high, scale = (*HEADING_RAD, "log")
    elif setting.searched == "draw":
        low, high, scale = 0.0, float(DRAWS), "whole"
    low, high = max(low, setting.low), min(high, setting.high)
    if setting.searched == "share":
        low = max(low, 0.02)
    return Axis(name=setting.name, low=low, high=max(high, low + 1e-9), scale=scale)


@dataclass(frozen=True, kw_only=True)
class GrowSettings:
    """Settings of the search for manoeuvres that add information to a dictionary."""

    families: tuple[str, ...] = ()  # names of the searched families; () for all that the vessel can do
    rounds: int = 12  # most primitives to add
    # the search ends when no candidate found has a sensitivity above (1 + tolerance) x dimension
    tolerance: float = 0.01
    # key -> (low, high) of u [m/s], v [m/s] and r [rad/s] of an addition in calm water; without a key, the range of the
    # present dictionary
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    free_form: bool = False  # whether the commands of the best candidate are optimised
    run_s: float | None = None  # duration of an added run [s], or None for the median duration of the present runs
    pool: int = 256  # initial candidates of every family
    seed: int | None = None  # of the search; None for the command's

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise InputError(f"rounds is {self.rounds}, expected 1 or more")
        if not self.tolerance > 0:
            raise InputError(f"tolerance is {self.tolerance:g}, expected more than 0")
        if self.pool < 8:
            raise InputError(f"pool is {self.pool}, expected 8 or more")


@dataclass(frozen=True, kw_only=True)
class GrowRound:
    """One primitive that was added."""

    # name, family, settings: of the addition
    name: str
    family: str
    settings: Mapping[str, float]
    sensitivity: float  # its d = trace(B(w)^-1 B) at the optimum without it
    searched: float  # the largest d among candidates of the families, before commands were optimised
    log_det_gain: float  # increase of the optimal log det
    efficiency: float  # ratio of the new optimum to the first, determinant to the power 1/p
    excitation_condition: bool  # as in `PrimitiveInformation`


@sealed(limits="3 2")
class Growth:
    """A grown dictionary."""

    specs: tuple[PrimitiveSpec, ...]  # of the additions, in order
    information: tuple[PrimitiveInformation, ...]  # of the whole dictionary, additions last
    rounds: tuple[GrowRound, ...]  # one for each addition
    limits: Array  # (3, 2) low and high of u, v, r of all additions
    evaluated: int  # number of evaluated candidates
    dimension: int  # p, plus means with complete mean subtraction
    parameters: int  # p
    best_left: float  # largest sensitivity found at the end

    @property
    def efficiency_left(self) -> float:
        """Least efficiency against any design over the evaluated candidates: exp(-(d - dimension) / p).

        Other manoeuvres may be more informative.
        """
        return float(np.exp(-max(self.best_left - self.dimension, 0.0) / self.parameters))


EQUAL = 9  # decimals to which worths are compared, so that rounding does not choose between mirror images
LIMIT_ROUNDING = 1e-9  # excess over a limit that counts as rounding, as a share of its range
FEWEST_CLOSED_LOOP = 8  # least number of candidates of a closed-loop family
# closed-loop families, simulated one by one, get this many times fewer candidates and no local steps
CLOSED_LOOP_SHARE = 32
BATCH = 512  # runs simulated together
LEADERS = 4  # best candidates of each family from which local steps start
OFFSPRING = 6  # local steps from each leader in one generation
# size of the local steps of each generation, as a share of each setting's range
STRIDES = (0.25, 0.13, 0.065, 0.03, 0.012)
REDRAWN = 0.3  # share of local steps that take another random draw, where the family has one
LEAST_COST = 0.02  # least cost of a second of a run that makes way good, in seconds


@sealed(gradient="d d")
class Worth:
    """What a run's information is worth, per second that the run costs."""

    # (d, d) G; information B is worth trace(G B). For the D criterion B(w)^-1, which gives the sensitivity.
    gradient: Array
    leg_s: float = 0.0  # time of the leg that each run brings
    saved_s_per_m: float = 0.0  # time that a metre made good saves elsewhere

    def of(self, matrices: Array, made_good_m: Array, run_s: float) -> Array:
        """(n,) scores of runs with information B (n, d, d) and distances made good (n,)."""
        cost = 1.0 + (self.leg_s - self.saved_s_per_m * made_good_m) / run_s
        return np.asarray(np.einsum("ij,nji->n", self.gradient, matrices) / np.maximum(cost, LEAST_COST))


@sealed(matrices="n d d", excess="n", made_good_m="n")
class Runs:
    """Evaluated specifications."""

    matrices: Array  # (n, d, d) B of each; 0 for impossible runs
    excess: Array  # (n,) violations of the limits; infinite for impossible runs
    made_good_m: Array  # (n,) distance from begin to end through water

    def __getitem__(self, rows: slice | np.ndarray) -> Runs:
        return Runs(matrices=self.matrices[rows], excess=self.excess[rows], made_good_m=self.made_good_m[rows])

    @staticmethod
    def joined(parts: Sequence[Runs]) -> Runs:
        """All of them."""
        return Runs(
            matrices=np.concatenate([part.matrices for part in parts]),
            excess=np.concatenate([part.excess for part in parts]),
            made_good_m=np.concatenate([part.made_good_m for part in parts]),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Measure:
    """Information matrix, limit violation and way of a specification."""

    # vessel, names, environment, mean_subtraction: as in `information.many.bordered_runs`
    vessel: Vessel
    names: tuple[str, ...]
    environment: Environment
    mean_subtraction: str
    limits: Array  # (3, 2) low and high of u, v, r
    courses: Array | None = None  # (c,) that runs make good; None where they are unknown

    def __call__(self, specs: Sequence[PrimitiveSpec]) -> Runs:
        """The runs of specifications; those of one duration are simulated together, the longest first."""
        durations = np.array([spec.settings["duration_s"] for spec in specs])
        order = np.argsort(-durations, kind="stable")
        ends = np.flatnonzero(np.diff(durations[order])) + 1
        batches = [
            rows[first : first + BATCH] for rows in np.split(order, ends) for first in range(0, len(rows), BATCH)
        ]
        tasks = ([specs[index] for index in rows] for rows in batches)
        found = Runs.joined(list(in_order(Measure.of_one_duration, (self,), ((some,) for some in tasks))))
        return found[np.argsort(order, kind="stable")]

    def of_one_duration(self, specs: Sequence[PrimitiveSpec]) -> Runs:
        """The same of specifications of one duration, in one batch."""
        runs = excite_many(self.vessel, specs)
        matrices, motion = bordered_runs(
            self.vessel,
            runs.commands,
            runs.velocity,
            self.names,
            environment=self.environment,
            mean_subtraction=self.mean_subtraction,
            standing=runs.entry_inputs,
            courses=self.courses,
        )
        over = violation(motion, self.limits)
        sound = (runs.possible > 0) & np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(over)
        return Runs(
            matrices=np.where(sound[:, None, None], matrices, 0.0),
            excess=np.where(sound, over, np.inf),
            made_good_m=np.where(sound, made_good_m(motion, self.vessel.sample_time_s), 0.0),
        )


def made_good_m(motion: Array, sample_time_s: float) -> Array:
    """(n,) distance from begin to end of motions (n, k + 1, 3) through calm water, by the trapezoidal rule."""
    u, v, r = np.moveaxis((motion[:, 1:] + motion[:, :-1]) / 2, -1, 0)
    heading = (np.cumsum(r, axis=1) - r / 2) * sample_time_s
    along, across = rotated((u, v), heading)
    return np.asarray(np.hypot(along.sum(axis=1), across.sum(axis=1)) * sample_time_s)


def violation(motion: Array, limits: Array) -> Array:
    """(n,) largest excess of motions (n, k, 3) over limits (3, 2), in units of their ranges."""
    low, high = limits.T
    excess = np.maximum(motion - high, low - motion) / np.maximum(high - low, 1e-12)
    return np.asarray(np.maximum(excess.max(axis=(1, 2)), 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """An evaluated run."""

    spec: PrimitiveSpec  # of it
    merit: float  # its worth
    matrix: Array  # (d, d) B
    made_good_m: float  # distance from begin to end through water


@dataclass(frozen=True, kw_only=True, eq=False)
class Archive:
    """All evaluated candidates of one family."""

    space: FamilySpace  # the family's
    points: Array  # (n, a) places in the unit cube
    runs: Runs  # n of them

    def merits(self, worth: Worth) -> Array:
        """(n,) worth of those within limits, minus the violation of the others."""
        found = worth.of(self.runs.matrices, self.runs.made_good_m, self.space.run_s)
        return np.where(self.runs.excess <= LIMIT_ROUNDING, np.round(found, EQUAL), -self.runs.excess)

    def best(self, worth: Worth) -> Candidate | None:
        """The candidate within limits that is worth most, if any is within them."""
        merits = self.merits(worth)
        place = int(np.argmax(merits))
        if self.runs.excess[place] > LIMIT_ROUNDING:
            return None
        return Candidate(
            spec=self.space.spec(self.points[place]),
            merit=float(merits[place]),
            matrix=self.runs.matrices[place],
            made_good_m=float(self.runs.made_good_m[place]),
        )

    def with_more(self, other: Archive) -> Archive:
        """Both together."""
        return Archive(
            space=self.space,
            points=np.concatenate([self.points, other.points]),
            runs=Runs.joined([self.runs, other.runs]),
        )


def pool_of(spaces: Sequence[FamilySpace], measure: Measure, pool: int, seed: int) -> tuple[Archive, ...]:
    """Quasi-random candidates of every family, `pool` or the next power of two of each."""
    from scipy.stats import qmc  # slow to import

    points = []
    for space in spaces:
        count = max(FEWEST_CLOSED_LOOP, pool // CLOSED_LOOP_SHARE) if space.family.closed_loop else pool
        sobol = qmc.Sobol(len(space.axes), rng=_stream(seed, space))
        points.append(sobol.random_base2(int(np.ceil(np.log2(count)))))
    return _measured(spaces, points, measure)


def refined(
    archives: Sequence[Archive],
    worth: Worth,
    measure: Measure,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> tuple[Archive, ...]:
    """The archives with local steps from each family's best candidates.

    Those of one duration are simulated together, and the durations beside each other, the longest first.
    """
    progress("searching for runs that add more information", 0.0)
    seeds = [int(rng.integers(2**32)) for _ in STRIDES]
    durations_s = np.array([archive.space.run_s for archive in archives])
    groups = [np.flatnonzero(durations_s == run_s).tolist() for run_s in np.unique(durations_s)[::-1]]
    found = in_order(_stepped, (worth, measure, seeds), (([archives[k] for k in group],) for group in groups))
    grown = {
        k: archive for group, some in zip(groups, found, strict=True) for k, archive in zip(group, some, strict=True)
    }
    return tuple(grown[k] for k in range(len(archives)))


def _stepped(worth: Worth, measure: Measure, seeds: Sequence[int], archives: Sequence[Archive]) -> list[Archive]:
    """Archives of one duration with local steps, each generation with a seed of its own."""
    spaces, grown = [archive.space for archive in archives], list(archives)
    for stride, seed in zip(STRIDES, seeds, strict=True):
        points = [_steps(archive, worth, stride, _stream(seed, archive.space)) for archive in grown]
        more = _measured(spaces, points, measure)
        grown = [archive.with_more(other) for archive, other in zip(grown, more, strict=True)]
    return grown


def best_of(archives: Sequence[Archive], worth: Worth) -> Candidate | None:
    """The candidate within limits that is worth most, if any is within them."""
    found = [best for archive in archives if (best := archive.best(worth)) is not None]
    return max(found, key=lambda candidate: candidate.merit, default=None)


def _stream(seed: int, space: FamilySpace) -> np.random.Generator:
    """Random numbers of a family and duration, the same whichever others are searched."""
    return np.random.default_rng([seed, crc32(f"{space.family.name} {float(space.run_s)}".encode())])


def _steps(archive: Archive, worth: Worth, stride: float, rng: np.random.Generator) -> Array:
    """(n, a) points near the family's best ones."""
    if archive.space.family.closed_loop:
        return archive.points[:0]
    order = np.argsort(-archive.merits(worth), kind="stable")[:LEADERS]
    parents = np.repeat(archive.points[order], OFFSPRING, axis=0)
    steps = stride * rng.standard_normal(parents.shape)
    moved = rng.random(parents.shape) < max(0.4, 1.0 / parents.shape[1])
    for index, axis in enumerate(archive.space.axes):
        if axis.scale == "whole":
            redrawn = rng.random(len(parents)) < REDRAWN
            steps[:, index] = np.where(redrawn, rng.random(len(parents)) - parents[:, index], 0.0)
            moved[:, index] = True
    return np.clip(parents + np.where(moved, steps, 0.0), 0.0, 1.0 - 1e-12)


def _measured(spaces: Sequence[FamilySpace], points: Sequence[Array], measure: Measure) -> tuple[Archive, ...]:
    """Candidates of every family, simulated together."""
    runs = measure([space.spec(point) for space, rows in zip(spaces, points, strict=True) for point in rows])
    ends = np.cumsum([0, *map(len, points)]).tolist()
    return tuple(
        Archive(space=space, points=rows, runs=runs[first:last])
        for space, rows, first, last in zip(spaces, points, ends[:-1], ends[1:], strict=True)
    )
