"""The risk of a plan: the probability that the hull leaves allowed water, where, and whether it is acceptable.

It is estimated by whole trials of drawn ships in drawn weather, by the procedure of
`expdesign.plan.monte_carlo.procedure`. One draw is one trial: the same parameters, mean current and mean wind
throughout; current and wind vary round these as the forecast says. Trials aborted because a run could not be begun
count apart: they end in allowed water, but not at the goal. The chance constraint holds where the share that leaves
allowed water plus its standard error is at most 1 - confidence. Besides, most trials must reach the goal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
import shapely

from expdesign.plan.control import Helmsman
from expdesign.plan.legs import LegWater, nearest_turns, through_water
from expdesign.plan.monte_carlo.guidance import GO_AROUNDS, Guidance
from expdesign.plan.monte_carlo.procedure import ABORT_CAUSES, Tolerances, goal_within_m, tolerances
from expdesign.plan.runs import Fleet, draw_truths
from expdesign.plan.values import Leg, LegOutcome, PlanSettings, RiskEstimate, SailedTrial
from expdesign.plan.verify import hull_clearance
from expdesign.processes import in_order
from expdesign.progress import Progress, silent
from expdesign.sea_area import SeaArea
from expdesign.signals import Trajectory
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.vessel.vessel import hull_outlines

TRIALS_AT_ONCE = 1000  # trials sailed together, so that memory does not grow with their number

# samples of all ships, and hulls near the shore, checked at a time
COLLISION_SAMPLES, COLLISION_CHUNK = 250_000, 20_000


# Collision check of many hulls with the chart at every step, without the planner's grids and margins.


@dataclass(frozen=True, kw_only=True)
class CollisionCheck:
    """Whether hulls stay in allowed water."""

    area: SeaArea  # the chart
    vessel: Vessel  # its outline

    def exits(self, poses: Array) -> Array:
        """(n, 2) where the hull, or what it sweeps between samples, first leaves the water; nan where never.

        Steps between positions at least a hull's radius from anything forbidden are skipped. Stretches of samples are
        checked in turn, which bounds the memory.

        Args:
            poses: (k, n, 3) sample by sample; ships that do not move are skipped.
        """
        place: Array = np.full((poses.shape[1], 2), np.nan)
        stretch = max(1, COLLISION_SAMPLES // max(1, poses.shape[1]))
        for begin in range(0, len(poses) - 1, stretch):
            some = poses[begin : begin + stretch + 1]
            steps, ships = self._close(some)
            for first in range(0, len(steps), COLLISION_CHUNK):
                chunk = slice(first, first + COLLISION_CHUNK)
                self._first_outside(some, steps[chunk], ships[chunk], place)
        return place

    def _close(self, poses: Array) -> tuple[np.ndarray, np.ndarray]:
        """Steps and ships (j,) that move, and perhaps not far from the shore."""
        moved, turned = np.diff(poses[..., :2], axis=0), np.diff(poses[..., 2], axis=0) != 0
        moved = np.sqrt(moved[..., 0] ** 2 + moved[..., 1] ** 2)
        sails = (moved > 0) | turned
        concerned = np.zeros(poses.shape[:2], dtype=bool)
        concerned[:-1] |= sails
        concerned[1:] |= sails
        far = np.ones(poses.shape[:2], dtype=bool)
        far[concerned] = self._far(poses[concerned, :2])
        steps, ships = np.nonzero(sails & ~(far[:-1] & far[1:] & (moved < self._radius / 2)))
        return steps, ships

    def _first_outside(self, poses: Array, steps: np.ndarray, ships: np.ndarray, place: Array) -> None:
        """Note in `place` where ships first are outside in some steps (j,), in order of time, if not noted before."""
        corners = [hull_outlines(poses[steps + later, ships], self.vessel.hull_b) for later in (0, 1)]
        spans = shapely.convex_hull(shapely.multipoints(np.concatenate(corners, axis=1)))
        outside = ~shapely.contains_properly(self._water, spans)
        gone, earliest = np.unique(ships[outside], return_index=True)
        fresh = np.isnan(place[gone, 0])
        place[gone[fresh]] = poses[steps[outside][earliest[fresh]], gone[fresh], :2]

    @cached_property
    def _water(self) -> shapely.MultiPolygon:
        shapely.prepare(self.area.water)
        return self.area.water

    def _far(self, places: Array) -> np.ndarray:
        """(k,) whether places (k, 2) are far from the shore: where a coarse table does not say so, one by one."""
        far = np.zeros(len(places), dtype=bool)
        cell_m, bounds = self._radius, np.reshape(self.area.water.bounds, (2, 2))[:, ::-1]
        inside = ((places >= bounds[0]) & (places <= bounds[1])).all(axis=1)
        if inside.any():
            first = places[inside].min(axis=0)
            cells = ((places[inside] - first) / cell_m).astype(int)
            shape = cells.max(axis=0) + 1
            if shape.prod() < len(cells):
                middles = first + cell_m * (np.moveaxis(np.indices(shape), 0, -1) + 0.5)
                deep = shapely.contains_xy(self._deeper, middles[..., 1], middles[..., 0])
                far[inside] = deep[cells[:, 0], cells[:, 1]]
        far[~far] = shapely.contains_xy(self._deep, places[~far, 1], places[~far, 0])
        return far

    @cached_property
    def _deeper(self) -> shapely.Geometry:
        """Water round whose places a square cell as wide as the hull's radius is deep."""
        inner = self.area.water_to_plan_in((1.05 + 0.75) * self._radius)
        shapely.prepare(inner)
        return inner

    @cached_property
    def _deep(self) -> shapely.Geometry:
        """Water in which the hull clears the shore at any heading, also in a step between two positions in it.

        From the middle of a step of half a radius a corner is sqrt(1.05**2 - 0.25**2) > 1 radii away.
        """
        inner = self.area.water_to_plan_in(1.05 * self._radius)
        shapely.prepare(inner)
        return inner

    @property
    def _radius(self) -> float:
        return float(np.hypot(*self.vessel.hull_b.T).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class Trials:
    """Outcomes of n trials, leg by leg.

    A trial ends where the hull leaves allowed water, or aborted where a run cannot be begun.
    """

    left: np.ndarray  # (legs, n) whether the hull left allowed water on a leg
    aborted: np.ndarray  # (legs, n) whether the trial was aborted on a leg
    go_arounds: np.ndarray  # (legs, n) on a leg
    samples: np.ndarray  # (legs, n) that legs took
    used: Array  # (legs, n) largest share of a tolerance used up where a run began; nan where none did
    abort_cause: np.ndarray  # (legs, n) index in `ABORT_CAUSES`, for aborted trials
    place: Array  # (legs, n, 2) where hulls left allowed water; nan where they did not
    # within, longest: start tolerances of each leg, and samples on it after which a trial is aborted; zero of runs
    within: tuple[Tolerances, ...]
    longest: tuple[float, ...]

    @property
    def completed(self) -> np.ndarray:
        """(n,) trials that reached the goal."""
        return np.asarray(~(self.left | self.aborted).any(axis=0))

    @property
    def samples_sailed(self) -> int:
        """Samples until the slowest ship of each leg has sailed it."""
        return int(self.samples.max(axis=1).sum())

    def shares(self, legs: Sequence[bool] = ()) -> tuple[float, float]:
        """Shares of trials that leave allowed water, and that are aborted, if these legs alone were sailed; all for ().

        As many fail on each of them as of those that begin it.
        """
        failed = np.stack([self.left, self.aborted]).sum(axis=2)  # (2, legs)
        begun = self.left.shape[1] - np.r_[0, failed.sum(axis=0).cumsum()[:-1]]
        kept = legs or [True] * len(begun)
        rates = np.where(kept, failed / np.maximum(begun, 1), 0.0)
        sailing = np.r_[1.0, np.cumprod(1.0 - rates.sum(axis=0))[:-1]]
        left, aborted = (rates @ sailing).tolist()
        return left, aborted


def sail_trials(
    water: LegWater,
    sailed: SailedTrial,
    *,
    draws: int,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> Trials:
    """Sail drawn trials of a plan, `TRIALS_AT_ONCE` at a time, which bounds the memory that motion takes.

    Time and outcomes grow with the number of draws. Each part has a random stream of its own, so the processes that
    share them do not change their outcomes.

    Args:
        water: vessel, forecast, area, and the water that paths keep to.
        rng: of the first part; the streams of the others are spawned from it.
        progress: by the planned time of legs, or by parts where there are several.
    """
    within, most = start_tolerances(water, sailed), TRIALS_AT_ONCE
    counts = [min(most, draws - first) for first in range(0, draws, most)]
    if len(counts) == 1:
        return _sail_part(water, sailed, within, draws, rng, progress)
    parts: list[Trials] = []
    streams = [rng, *rng.spawn(len(counts) - 1)]
    for part in in_order(_sail_part, (water, sailed, within), zip(counts, streams, strict=True)):
        progress("sailing drawn trials", len(parts) / len(counts))
        parts.append(part)
    outcomes = [name for name in vars(parts[0]) if name not in ("within", "longest")]
    joined = {name: np.concatenate([getattr(part, name) for part in parts], axis=1) for name in outcomes}
    return Trials(**joined, within=within, longest=parts[0].longest)


def _sail_part(
    water: LegWater,
    sailed: SailedTrial,
    within: tuple[Tolerances, ...],
    draws: int,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> Trials:
    """Sail drawn trials all at once, with the start tolerances of each leg."""
    vessel, track, legs, commands = water.vessel, sailed.states, sailed.legs, sailed.commands
    helm = Helmsman(vessel=vessel, environment=water.environment, ship=water.ship)
    truths = draw_truths(vessel, water.environment, draws, rng)
    standing = np.zeros(len(vessel.limits)) if sailed.standing is None else sailed.standing
    fleet = Fleet(vessel, water.environment, truths, state=track[0], standing=standing, rng=rng)
    collisions = CollisionCheck(area=water.area, vessel=vessel)
    sailing, unexplained = np.ones(draws, dtype=bool), np.zeros((draws, 3))
    shape = (len(legs), draws)
    left, aborted = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    go_arounds, abort_cause = np.zeros(shape, dtype=np.int8), np.zeros(shape, dtype=np.int8)
    samples, longest = np.zeros(shape, dtype=np.int32), [0.0] * len(legs)
    used, place = np.full(shape, np.nan), np.full((*shape, 2), np.nan)
    for index, leg in enumerate(legs):
        progress("sailing drawn trials", leg.first / len(commands))
        values = commands.values[leg.first : leg.last]
        if leg.kind == "primitive":
            used[index] = np.where(sailing, within[index].used(fleet.states, track[leg.first]).max(axis=1), np.nan)
            poses, begun = open_loop(helm, fleet, values, sailing), sailing & ~fleet.lost
            samples[index] = np.where(sailing, len(values), 0)
        else:
            guidance = Guidance(
                helm,
                water,
                track[leg.first : leg.last + 1],
                within=tolerances(water) if index == len(legs) - 1 else within[index + 1],
                sailing=sailing,
                inputs=values[-1],
                last=index == len(legs) - 1,
                longest=len(commands),
            )
            found, longest[index] = guidance.sail(fleet, unexplained), float(guidance.longest)
            unexplained, poses, begun = found.unexplained, found.poses, found.begun
            go_arounds[index], samples[index], abort_cause[index] = found.go_arounds, found.samples, found.abort_cause
        place[index] = np.where(fleet.lost[:, None] & sailing[:, None], poses[-1, :, :2], collisions.exits(poses))
        left[index] = sailing & ~np.isnan(place[index, :, 0])
        aborted[index] = sailing & ~begun & ~left[index]
        sailing = sailing & begun & ~left[index]
    return Trials(
        left=left,
        aborted=aborted,
        go_arounds=go_arounds,
        samples=samples,
        used=used,
        abort_cause=abort_cause,
        place=place,
        within=within,
        longest=tuple(longest),
    )


def start_tolerances(water: LegWater, sailed: SailedTrial) -> tuple[Tolerances, ...]:
    """Start tolerances of each leg; for runs by the room of the hull over all of the planned run, and its first speed.

    What is stated of the last leg is within what distance the goal is reached.
    """
    clearance = hull_clearance(water.area, sailed.trajectory, water.vessel.hull_b)
    spare = [float(clearance[leg.first : leg.last + 1].min()) - water.clearance_m for leg in sailed.legs]
    states = np.hstack([sailed.trajectory.pose, sailed.trajectory.velocity])
    within = [
        tolerances(water, room, float(np.hypot(*through_water(water.environment, states[leg.first])[:2])))
        if leg.kind == "primitive"
        else tolerances(water)
        for leg, room in zip(sailed.legs, spare, strict=True)
    ]
    return (*within[:-1], replace(within[-1], position_m=goal_within_m(water)))


TRIALS, MOST_TRIALS = 500, 2000  # drawn of a plan at least and at most
EXPECTED_CASES = 2.0  # trials are so many that this number may leave allowed water
UPPER_SHARE = 0.95  # percentile of times that is reported, and confidence of the upper limit of a probability
NO_PLAN_ABORTED = 0.5  # share of aborted trials from which a plan is rejected


REASONS = tuple(
    {"time": "not there in time", "no go-around path": "no go-around path"}.get(cause, f"{cause} out of tolerance")
    for cause in ABORT_CAUSES
)
"""Causes of aborted trials, in words."""


def estimate_risk(
    water: LegWater,
    sailed: SailedTrial,
    *,
    rng: np.random.Generator,
    draws: int = TRIALS,
    aborted_most: float = PlanSettings.aborted_most,
    progress: Progress = silent,
) -> tuple[RiskEstimate, Trials]:
    """Estimate the risk of a plan by drawn trials.

    The shares' standard errors are sqrt(p (1 - p) / draws).
    """
    trials = sail_trials(water, sailed, draws=draws, rng=rng, progress=progress)
    commands, trajectory, legs = sailed.commands, sailed.trajectory, sailed.legs
    within, sample_s = trials.within[0], commands.sample_time_s
    gone, done = int(trials.left.any(axis=0).sum()), trials.completed
    extra = (trials.samples.sum(axis=0)[done] - len(commands)) * sample_s
    found = RiskEstimate(
        trials=draws,
        left=gone / draws,
        left_most=upper_limit(gone, draws),
        aborted=float(trials.aborted.any(axis=0).mean()),
        reasons=_reasons(legs, trials, trajectory, water.area),
        extra_median_s=float(np.median(extra)) if len(extra) else float("nan"),
        extra_most_s=float(np.quantile(extra, UPPER_SHARE)) if len(extra) else float("nan"),
        go_arounds=GO_AROUNDS,
        heading_rad=within.heading_rad,
        yaw_rate_radps=within.yaw_rate_radps,
        legs=tuple(_leg_outcome(trials, index, sample_s) for index in range(len(legs))),
        aborted_most=aborted_most,
    )
    return found, trials


def trials_needed(confidence: float) -> int:
    """How many trials distinguish a share of 1 - confidence from none."""
    needed = np.ceil(EXPECTED_CASES / max(1.0 - confidence, 1e-9))
    return int(np.clip(needed, TRIALS, MOST_TRIALS))


def upper_limit(count: int, trials: int) -> float:
    """Upper limit, at 95 % confidence, of a probability of which `count` cases were seen among trials.

    Source: C. J. Clopper and E. S. Pearson, Biometrika 26 (1934), 404-413.
    """
    return 1.0 if count >= trials else float(scipy.special.betaincinv(count + 1, trials - count, UPPER_SHARE))


def failed_chance_constraint(
    found: RiskEstimate, trials: Trials, legs: Sequence[Leg], area: SeaArea, *, confidence: float
) -> str:
    """Why a plan is too risky, with the worst leg and place; "" where it is acceptable."""
    if violates_chance_constraint(found, confidence):
        worst = worst_leg(trials)
        lat, lon = area.frame.to_degrees(np.nanmedian(trials.place[worst], axis=0))
        return (
            f"{found.left:.1%} of {found.trials} drawn trials (standard error {found.error:.1%}) leave allowed water, "
            f"more than plan.confidence = {confidence:g} allows, most of them ({trials.left[worst].mean():.1%}) "
            f"{described(legs, worst)} near {lat:.5f}, {lon:.5f}"
        )
    return "" if found.aborted < NO_PLAN_ABORTED else found.aborted_note


def violates_chance_constraint(found: RiskEstimate, confidence: float) -> bool:
    """Whether the share that leaves allowed water, plus its standard error, exceeds 1 - confidence."""
    return found.left > 0.0 and found.left + found.error > 1.0 - confidence + 1e-12


def shares_allowed(shares: tuple[float, float], confidence: float) -> bool:
    """Whether shares of trials that leave allowed water, and that are aborted, are acceptable if they are exact."""
    left, aborted = shares
    return left <= 1.0 - confidence and aborted < NO_PLAN_ABORTED


def worst_leg(trials: Trials) -> int:
    """Index of the leg on which most trials leave allowed water."""
    return int(trials.left.mean(axis=1).argmax())


def described(legs: Sequence[Leg], index: int) -> str:
    """Which run or leg, numbered as on the run cards."""
    number = sum(leg.kind == "primitive" for leg in legs[: index + 1])
    leg = legs[index]
    if leg.kind == "primitive":
        return f"in run {number}, {leg.name!r},"
    return "on the leg to the goal" if index == len(legs) - 1 else f"on the way to run {number + 1}, {leg.name!r},"


def _reasons(legs: Sequence[Leg], trials: Trials, trajectory: Trajectory, area: SeaArea) -> tuple[str, ...]:
    """Where trials were aborted, and why; most first."""
    rows = []
    for index in np.argsort(-trials.aborted.mean(axis=1), kind="stable").tolist():
        aborted = trials.aborted[index]
        if aborted.any():
            causes = Counter(trials.abort_cause[index][aborted].tolist())
            why = ", ".join(f"{REASONS[cause]} {count / len(aborted):.1%}" for cause, count in causes.most_common())
            lat, lon = area.frame.to_degrees(trajectory.pose[legs[index].last, :2])
            rows.append(f"{described(legs, index)} {aborted.mean():.1%} near {lat:.5f}, {lon:.5f} ({why})")
    return tuple(rows)


def _leg_outcome(trials: Trials, index: int, sample_s: float) -> LegOutcome:
    sailed = trials.samples[index] > 0
    times: Array = trials.samples[index][sailed] * sample_s if sailed.any() else np.zeros(1)
    return LegOutcome(
        position_m=trials.within[index].position_m,
        speed_mps=trials.within[index].speed_mps,
        left=float(trials.left[index].mean()),
        aborted=float(trials.aborted[index].mean()),
        go_arounds=float(trials.go_arounds[index][sailed].mean()) if sailed.any() else 0.0,
        median_s=float(np.median(times)),
        most_s=float(np.quantile(times, UPPER_SHARE)),
        longest_s=trials.longest[index] * sample_s,
    )


def open_loop(helm: Helmsman, fleet: Fleet, values: Array, sailing: np.ndarray) -> Array:
    """(k + 1, n, 3) poses of ships under commands (k, m), limited by the rates from the standing ones on."""
    ships = np.flatnonzero(sailing & ~fleet.lost)
    part, poses = fleet.part(ships), np.repeat(fleet.states[None, :, :3], len(values) + 1, axis=0)
    turns = nearest_turns(helm.vessel, values[0], part.given) - values[0]
    reach = helm.vessel.rates * helm.vessel.sample_time_s
    for sample, row in enumerate(values, start=1):
        part.advance(np.minimum(np.maximum(row + turns, part.given - reach), part.given + reach))
        poses[sample, ships] = part.states[:, :3]
    fleet.rejoin(part, ships)
    return poses
