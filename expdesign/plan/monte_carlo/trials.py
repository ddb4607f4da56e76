"""Whole trials of drawn ships in drawn weather, by the procedure of `expdesign.plan.monte_carlo.procedure`.

One draw is one trial: the same parameters, mean current and mean wind throughout; current and wind vary round these as
the forecast says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expdesign.plan.control import Helmsman
from expdesign.plan.legs import LegWater
from expdesign.plan.monte_carlo.guidance import Guidance, open_loop
from expdesign.plan.monte_carlo.procedure import Tolerances, tolerances
from expdesign.plan.monte_carlo.tuning import MONTE_CARLO
from expdesign.plan.runs import Fleet, draw_truths
from expdesign.plan.values import SailedTrial
from expdesign.plan.verify import hull_clearance
from expdesign.processes import in_order
from expdesign.progress import Progress, silent
from expdesign.sea_area import SeaArea
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.vessel.hull import hull_outlines

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
    within: tuple[Tolerances, ...]  # start tolerances of each leg

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
    """Sail drawn trials of a plan, `Tuning.trials_at_once` at a time, which bounds the memory that motion takes.

    Time and outcomes grow with the number of draws. Each part has a random stream of its own, so the processes that
    share them do not change their outcomes.

    Args:
        water: vessel, forecast, area, and the water that paths keep to.
        sailed: the plan.
        draws: number of trials.
        rng: of the first part; the streams of the others are spawned from it.
        progress: by the planned time of legs, or by parts where there are several.
    """
    within, most = start_tolerances(water, sailed), MONTE_CARLO.trials_at_once
    counts = [min(most, draws - first) for first in range(0, draws, most)]
    if len(counts) == 1:
        return _sail_part(water, sailed, within, draws, rng, progress)
    parts: list[Trials] = []
    streams = [rng, *rng.spawn(len(counts) - 1)]
    for part in in_order(_sail_part, (water, sailed, within), zip(counts, streams, strict=True)):
        progress("sailing drawn trials", len(parts) / len(counts))
        parts.append(part)
    outcomes = [name for name in vars(parts[0]) if name != "within"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts], axis=1) for name in outcomes}
    return Trials(**joined, within=within)


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
    samples = np.zeros(shape, dtype=np.int32)
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
                within=within[min(index + 1, len(legs) - 1)],
                sailing=sailing,
                inputs=values[-1],
                last=index == len(legs) - 1,
                longest=len(commands),
            )
            found = guidance.sail(fleet, unexplained)
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
    )


def start_tolerances(water: LegWater, sailed: SailedTrial) -> tuple[Tolerances, ...]:
    """Start tolerances of each leg; for runs by the room of the hull over all of the planned run."""
    clearance = hull_clearance(water.area, sailed.trajectory, water.vessel.hull_b)
    spare = [float(clearance[leg.first : leg.last + 1].min()) - water.clearance_m for leg in sailed.legs]
    runs = [leg.kind == "primitive" for leg in sailed.legs]
    return tuple(tolerances(water, room if run else 0.0) for room, run in zip(spare, runs, strict=True))
