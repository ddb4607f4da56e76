"""What legs are made from: the task, the water that all legs share, and whether commands, or a helmsman, fulfil a task.

The escape check says, before anything is placed, whether a ship that sails arcs can leave its start and reach its goal.
A berth in a basin narrower than the ship's turns has no such path, so the search for legs would be in vain.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from expdesign.conventions import whole_turns
from expdesign.errors import NoPlan
from expdesign.plan.chart import (
    CORNERS,
    ClearanceField,
    Corners,
    VisibilityGraph,
    polyline_length,
    visibility_graph_of,
)
from expdesign.plan.control import Capability, HelmShip, Helmsman, Reference, lengths
from expdesign.plan.legs._ompl import PLANE, roadmap_of, shortened
from expdesign.plan.values import PathsName, PlanSettings, WorkBudget
from expdesign.sea_area import ARC_SEGMENTS, SeaArea
from expdesign.signals import Trajectory
from expdesign.simulation import Environment, deliver, delivered_at_samples, integrate_motion, step_shares, to_body
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, Vessel
from expdesign.vessel.vessel import swept_hulls

BEYOND_ENDS = 1.02  # largest speed and yaw rate of legs whose ends are faster than legs need be, in those of their ends

CORRIDOR_HULLS = 3.0  # width of corridors to either side at most, in hull lengths
MEMORY_TIME_CONSTANTS = 20.0  # after which a lagging actuator has forgotten: two parts in a thousand million are left
ARRIVAL = 1e-3  # largest miss of a leg's end state, in hull lengths, and in transit speeds


ROUND = 1.0 / float(np.cos(np.pi / (4 * ARC_SEGMENTS)))
"""Factor on a margin by which no rounded corner is nearer than required: arcs are drawn inside their circles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LegTask:
    """A leg to be found."""

    # start, end: (6,) states, pose in the n-frame and velocity over ground
    start: Array
    end: Array
    # start_inputs, end_inputs: (m,) commands standing at its ends
    start_inputs: Array
    end_inputs: Array
    seed: int  # of the path search
    # (h, m) commands given before the leg, the standing one last; None when it has stood for long. Only lagging and
    # late actuators remember them.
    before: Array | None = None
    budget: WorkBudget = field(default_factory=WorkBudget)  # work budget of the search

    def __post_init__(self) -> None:
        seal(self, start="6", end="6", start_inputs="m", end_inputs="m")
        if self.before is not None:
            seal(self, start_inputs="m", before="h m")

    @property
    def past(self) -> Array:
        """(h, m) commands before the leg."""
        return self.start_inputs[None] if self.before is None else self.before


@dataclass(frozen=True, kw_only=True, eq=False)
class LegPath:
    """The path of a leg."""

    points: Array  # (k, 2) north/east, or (k, 3) with courses
    source: str  # what found it, in words for plan.json: "straight", "visibility graph", "ompl PRMstar in R2", ..

    @property
    def length_m(self) -> float:
        """Length [m]."""
        return polyline_length(self.points[:, :2])


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundLeg:
    """A leg, and what found its path."""

    commands: Array  # (k, m); the last azimuths without angle limits may differ from the task's by whole turns
    source: str  # as `LegPath`


@dataclass(frozen=True, kw_only=True)
class LegWater:
    """Vessel, weather and water that all legs of a plan share."""

    # vessel, environment, ship: vessel, weather, and speeds on legs
    vessel: Vessel
    environment: Environment
    ship: Capability
    area: SeaArea  # allowed water
    clearance_m: float  # least distance of the hull from anything forbidden
    field: ClearanceField  # the same water on a grid
    corners: Corners = CORNERS  # that paths may bend at, as `CORNERS` of charts
    start_tolerance: float = PlanSettings.start_tolerance  # of runs and goal, as `PlanSettings.start_tolerance`
    paths: PathsName = PlanSettings.paths  # what finds paths that bend, as `PlanSettings.paths`

    @cached_property
    def safe(self) -> shapely.MultiPolygon:
        """Water that the hulls at both ends of a sample must keep to, so that those in between keep the clearance."""
        safe = self.area.water_to_plan_in(self._safe_margin_m)
        shapely.prepare(safe)
        return safe

    def __setstate__(self, state: dict[str, object]) -> None:
        """Prepare the shapes again, which is lost between processes."""
        self.__dict__.update(state)
        for name in ("safe", "_open"):
            if name in state:
                shapely.prepare(state[name])

    @property
    def _safe_margin_m(self) -> float:
        turned = 2.0 * self.ship.yaw_rate_radps * self.vessel.sample_time_s  # runs turn faster than legs
        swing_m = np.hypot(*self.vessel.hull_b.T).max() * (1 - np.cos(min(turned, np.pi) / 2))
        return (self.clearance_m + float(swing_m)) * ROUND

    @cached_property
    def centre_waters(self) -> tuple[shapely.MultiPolygon, ...]:
        """For the centre lines of hulls that point along their path, from wide to narrow margins."""
        spares = self.ship.path_spares_m(self.vessel)
        return tuple(self.area.water_to_plan_in(self.clearance_m + spare) for spare in spares)

    @cached_property
    def narrowest_graph(self) -> VisibilityGraph:
        """Of all the water that centre lines may use."""
        return self._graph(self.centre_waters[-1])

    def _graph(self, water: shapely.MultiPolygon) -> VisibilityGraph:
        return visibility_graph_of(water, self.tolerance_m, self.corners)

    @property
    def tolerance_m(self) -> float:
        """By which shores are moved, at first, so that they have fewer corners."""
        return self.vessel.length_m / 60

    @property
    def straight_margin_m(self) -> float:
        """Clearance of the centre line of a hull that goes straight."""
        return self.clearance_m + self.vessel.beam_m / 2

    @property
    def leg_margin_m(self) -> float:
        """Clearance that the centre lines of legs need."""
        return self.clearance_m + self.ship.path_spares_m(self.vessel)[-1]

    def joins(self, start: Array, end: Array) -> bool:
        """Whether a path leads from one point (2,) to another."""
        return self._straight(start, end) or any(
            self._graph(water).shortest(start, end) is not None for water in reversed(self.centre_waters)
        )

    def candidate_paths(self, start: Array, end: Array) -> Iterator[LegPath]:
        """Paths between two points (2,), shortest first; of similar lengths the one farther from the shore first.

        Only the straight line where a hull may go straight; none where the points are not connected.
        """
        if self._straight(start, end):
            yield LegPath(points=np.stack([start, end]), source="straight")
            return
        shortest = self.narrowest_graph.shortest(start, end)
        least = 0.0 if shortest is None else self._rank(polyline_length(shortest))
        longer: list[LegPath] = []
        for path in filter(None, (self._path(water, start, end) for water in self.centre_waters)):
            if self._rank(path.length_m) <= least:  # no other is shorter, so that those need not be found
                yield path
            else:
                longer.append(path)
        yield from sorted(longer, key=lambda path: self._rank(path.length_m))

    def _rank(self, length_m: float) -> float:
        """Equal for paths of similar lengths."""
        return float(np.ceil(length_m / (2 * self.vessel.length_m)))

    def _path(self, water: shapely.MultiPolygon, start: Array, end: Array) -> LegPath | None:
        """A short path through a water; by the visibility graph where the roadmap has none."""
        if self.paths == "ompl":
            roadmap = roadmap_of(water, self.tolerance_m, self.corners)
            if (points := roadmap.shortest(start, end)) is not None:
                return LegPath(points=shortened(points, roadmap.water), source=PLANE)
        points = self._graph(water).shortest(start, end)
        return None if points is None else LegPath(points=points, source="visibility graph")

    def _straight(self, start: Array, end: Array) -> bool:
        """Whether a hull may go straight from one point (2,) to another."""
        return bool(shapely.contains_properly(self._open, shapely.LineString(np.stack([start, end])[:, ::-1])))

    @cached_property
    def _open(self) -> shapely.MultiPolygon:
        water = self.area.water_to_plan_in(self.straight_margin_m)
        shapely.prepare(water)
        return water

    def parted(self, start: Array, end: Array) -> bool:
        """Whether no path of a hull, however small, connects two positions (2,)."""
        ends = shapely.points(np.stack([start[1::-1], end[1::-1]]))
        return not any(shapely.contains(part, ends).all() for part in self.safe.geoms)

    def holds(self, pose: Array) -> bool:
        """Whether the hull stays in safe water between consecutive poses (k, 3)."""
        lowest, highest = self._surely_clear_m
        clearance = self.field.at(pose[:, :2])
        if clearance.min() < lowest:
            return False
        spacing_m = float(np.hypot(*np.diff(pose[:, :2], axis=0).T).max(initial=0.0))
        close = clearance < highest + spacing_m / 2
        spans = close[:-1] | close[1:] if len(pose) > 1 else close
        return bool(shapely.contains_properly(self.safe, swept_hulls(pose, self.vessel.hull_b)[spans]).all())

    @cached_property
    def _surely_clear_m(self) -> tuple[float, float]:
        """Clearances on the grid below which no hull is in safe water at any heading, and above which every one is."""
        outline, middle, grid_m = shapely.Polygon(self.vessel.hull_b), shapely.Point(0.0, 0.0), self.field.error_m
        inner_m = outline.exterior.distance(middle) if outline.contains(middle) else 0.0
        outer_m = float(np.hypot(*self.vessel.hull_b.T).max())
        return self.clearance_m + inner_m - grid_m, self._safe_margin_m + outer_m + grid_m

    def sail(self, start: Array, values: Array, before: Array | None = None) -> Trajectory:
        """The motion that commands (k, m) give from a state (6,), after commands `before` (h, m).

        Earlier commands matter for lagging and late actuators only; the first of them has stood for long.
        """
        states = self.states(start, values, before)
        return Trajectory(sample_time_s=self.vessel.sample_time_s, pose=states[:, :3], velocity=states[:, 3:])

    def states(self, start: Array, values: Array, before: Array | None = None) -> Array:
        """(k + 1, 6) states of `sail`, the start first."""
        sample_s, earlier = self.vessel.sample_time_s, 0
        if self.prompt:
            delivered = values[:, None]
        else:
            if before is not None:
                earlier, values = len(before), np.concatenate([before, values])
            given = deliver(self.vessel.responses, values, sample_time_s=sample_s, substeps=self._shares)
            delivered = given[earlier:]
        return integrate_motion(
            self.vessel, delivered, start, sea=self._sea, sample_time_s=sample_s, substeps=self._shares
        )

    @cached_property
    def _shares(self) -> Array:
        """(s,) shares of a sample that integrator steps take."""
        vessel = self.vessel
        return step_shares(vessel.responses, sample_time_s=vessel.sample_time_s, substeps=SUBSTEPS)

    @cached_property
    def prompt(self) -> bool:
        """Whether every actuator delivers its commands at once."""
        return all(response.follows for response in self.vessel.responses)

    @cached_property
    def _sea(self) -> Array:
        """(1, 4) mean current and wind."""
        return np.concatenate([self.environment.current_to, self.environment.wind_to])[None]

    def remembered(self, commands: Array) -> Array:
        """The last of given commands (k, m), as many as still act through any actuator."""
        memory = MEMORY_TIME_CONSTANTS
        longest_s = max(memory * response.lag_s + response.delay_s for response in self.vessel.responses)
        return commands[-int(np.ceil(longest_s / self.vessel.sample_time_s)) - 2 :]

    def delivered(self, before: Array) -> Array:
        """(m,) what the actuators deliver after commands (h, m) of which the first stood for long."""
        sample_s = self.vessel.sample_time_s
        values = delivered_at_samples(self.vessel.responses, before, sample_time_s=sample_s, standing=before[0])
        return np.asarray(values[-1])


def last_state(track: Trajectory) -> Array:
    """(6,) the state at a trajectory's end."""
    return np.asarray(np.r_[track.pose[-1], track.velocity[-1]])


def through_water(environment: Environment, state: Array) -> Array:
    """(..., 3) velocity through water of states (..., 6), whose velocity is over ground."""
    u_c, v_c = to_body(environment.current_to, state[..., 2], NUMPY)
    return np.asarray(state[..., 3:] - np.stack([u_c, v_c, np.zeros_like(u_c)], axis=-1))


def acceptable(start: Array, end: Array, water: LegWater, values: Array, before: Array) -> bool:
    """Whether commands, simulated from a state after others, arrive at another state and stay in safe water."""
    states = water.states(start, values, before)
    scale = np.r_[[water.vessel.length_m] * 2, 1.0, [water.ship.transit_speed_mps] * 2, water.ship.yaw_rate_radps]
    return bool((np.abs(states[-1] - end) <= ARRIVAL * scale).all()) and water.holds(states[:, :3])


def nearest_turns(vessel: Vessel, inputs: Array, near: Array) -> Array:
    """The same commands (..., m) with unlimited azimuth angles shifted by whole turns towards `near` (..., m)."""
    return np.asarray(inputs + np.where(vessel.turns_freely, whole_turns(near - inputs), 0.0))


def room_beside(water: LegWater, centre: Array, side: Array, margin_m: float) -> Array:
    """(j,) how far each centre may move to one side while its discs keep clear; bounded by `CORRIDOR_HULLS`."""
    steps = np.arange(0.0, CORRIDOR_HULLS * water.vessel.length_m, water.field.cell_m)
    points = centre[:, None] + steps[:, None] * side[:, None, :]
    free = water.field.at(points) >= margin_m
    free[:, 0] = True
    return np.asarray(steps[np.cumprod(free, axis=1).sum(axis=1).astype(int) - 1])


def leg_speed_mps(transit_mps: float, ends: Iterable[Array]) -> float:
    """Largest speed on a leg: transit speed, or `BEYOND_ENDS` of its ends' (3,), where they are faster.

    All through water.
    """
    steady = 1.001 * transit_mps
    fastest = max((float(np.hypot(*velocity[:2])) for velocity in ends), default=0.0)
    return BEYOND_ENDS * fastest if fastest > steady else steady


ESCAPED_RADII = 2.5  # turning radii from a place at which a ship has escaped from it
ESCAPE_ARC_RAD = 0.35  # turn of one arc of the escape check; straights are as long
ESCAPE_CELL, ESCAPE_COURSES = 0.25, 12  # cells of its search: their size in turning radii, and courses to half a circle
ESCAPE_ARCS = 6000  # checked at most


def escapes(pose: Array, water: LegWater, *, backwards: bool = False) -> bool:
    """Whether arcs of the ship's turning radius and straights lead from a pose (3,) out of its surroundings.

    Best-first search over arcs, farthest from the pose first, with one arc to each cell of position and course. It ends
    with "no" after finitely many arcs, which a sampling planner does not; too coarse cells may miss a path.

    Args:
        pose: where the ship is.
        water: what the hull keeps to, and who sails.
        backwards: the path leads to the pose.
    """
    radius, start = water.ship.turning_radius_m, np.add(pose, (0.0, 0.0, np.pi * backwards))
    queue: list[tuple[float, int, Array]] = [(0.0, 0, start)]
    seen, count = set[tuple[int, ...]](), 0
    while queue and count < ESCAPE_ARCS:
        _, _, place = heapq.heappop(queue)
        for bend in (0.0, 1.0, -1.0):
            arc = _arc(place, bend / radius, ESCAPE_ARC_RAD * radius, water.vessel.length_m)
            key = _cell(arc[-1], radius)
            if key in seen:
                continue
            seen.add(key)
            count += 1
            if not water.holds(arc):
                continue
            away = float(np.hypot(*(arc[-1] - start)[:2]))
            if away > ESCAPED_RADII * radius:
                return True
            heapq.heappush(queue, (-away, count, arc[-1]))
    return False


def _arc(pose: Array, curvature: float, length_m: float, hull_m: float) -> Array:
    """(k, 3) poses along an arc or a straight from a pose (3,)."""
    along = np.linspace(0.0, length_m, int(np.ceil(3 * length_m / hull_m)) + 1)
    half = curvature * along / 2
    chord = along * np.sinc(half / np.pi)
    course = pose[2] + half
    return np.column_stack([pose[0] + chord * np.cos(course), pose[1] + chord * np.sin(course), pose[2] + 2 * half])


def _cell(pose: Array, radius: float) -> tuple[int, ...]:
    share, courses = ESCAPE_CELL, ESCAPE_COURSES
    course = round(float(pose[2]) / np.pi * courses) % (2 * courses)
    return round(float(pose[0]) / (share * radius)), round(float(pose[1]) / (share * radius)), course


def check_ends(start: Array, goal: Array, water: LegWater) -> None:
    """Raise NoPlan where a ship that sails arcs cannot depart from its start, or reach its goal.

    Args:
        start, goal: (3,) poses.
        water: as of the plan.
    """
    for name, pose, backwards, to in (("start", start, False, "from"), ("goal", goal, True, "to")):
        if not escapes(pose, water, backwards=backwards):
            lat, lon = water.area.frame.to_degrees(pose[:2])
            raise NoPlan(
                f"no path was found {to} the {name}, near {lat:.5f}, {lon:.5f} and heading "
                f"{np.degrees(pose[2]) % 360.0:.0f} degrees, on turns of {water.ship.turning_radius_m:.3g} m radius, "
                f"which vessel {water.vessel.name!r} sails at {water.ship.transit_speed_mps:.3g} m/s, with "
                f"{water.clearance_m:g} m of clearance",
                what="berth",
                which=name,
                place=pose[:2],
            )


SLOW_SHARE = 0.05  # of the speed at its end, by which a ship may be slower there
LONGER = 1.6  # times as long as guessed that she may take
LEAST_STEP = 0.2  # movement of a slow guess per sample, in that at transit speed


def gathers_speed(states: Array, duration_s: float, task: LegTask, water: LegWater, ship: HelmShip) -> bool:
    """Whether the ship is fast enough at the end of a guess (j + 1, 6) at even times, steered along it.

    A ship that has lost way in turns needs room to gather it again. Where the guess leaves her too little, there is
    hardly ever a leg, and IPOPT goes to and fro at length before it gives up: simulating the leg once takes a hundredth
    of that.
    """
    vessel, helm = water.vessel, Helmsman(vessel=water.vessel, environment=water.environment, ship=ship)
    count = max(2, round(duration_s / vessel.sample_time_s))
    shares = np.linspace(0.0, len(states) - 1.0, count + 1)
    guess = Reference(states=np.stack([np.interp(shares, np.arange(len(states)), x) for x in states.T], axis=1))
    least_m = LEAST_STEP * ship.transit_speed_mps * vessel.sample_time_s
    ahead = helm.answer_s / vessel.sample_time_s
    state, given, at = task.start[None], task.past, np.zeros(1)
    for _ in range(round(LONGER * count)):
        at = np.minimum(at + guess.abreast(at, state, step_m=least_m), count)
        desired = guess.at(at)
        desired[:, 3:] = guess.velocity_at(np.minimum(at + ahead, count))  # velocities respond with a lag
        row = helm.commands(desired, state, given[-1:])
        state = water.states(state[0], row, given)[-1:]
        given = water.remembered(np.concatenate([given, row]))
        if at[0] >= count:
            break
    return bool(lengths(state[:, 3:5])[0] >= (1.0 - SLOW_SHARE) * lengths(task.end[None, 3:5])[0])
