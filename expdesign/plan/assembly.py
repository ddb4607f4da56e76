"""What planning begins with: the water that legs share, the runs with the room they need, optimised transitions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely

from expdesign.errors import InputError, NoPlan, NoRoom
from expdesign.plan.chart import (
    CORNERS,
    ClearanceField,
    GoalDistance,
    build_goal_distance,
    clearance_field,
    connects,
    narrowest_passage,
    reachable,
    resolved,
)
from expdesign.plan.control import Capability, HelmShip, capability
from expdesign.plan.feasibility import without_room, without_way_out
from expdesign.plan.legs import LegWater, through_water
from expdesign.plan.local_planner import (
    Departure,
    GoAroundTime,
    LocalPlanner,
    RunSpace,
    SearchSpace,
    TransitionTrials,
    local_planner,
    pairs_of,
)
from expdesign.plan.runs import Footprint, dispersion_m, footprint
from expdesign.plan.search import path_exceeds_displacement, place_runs
from expdesign.plan.values import PlanProblem, PlanSettings, WorkBudget
from expdesign.progress import Progress, in_phases
from expdesign.sea_area import SeaArea
from expdesign.simulation import Environment, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel
from expdesign.vessel.vessel import covering_discs

TRANSITION_BEAM = 100  # partial plans kept in the searches that choose the transitions to optimise

# how many times finer the clearance grid is where the usual one is too coarse for a passage or a place
FINER_GRID = 4.0
FASTEST_START = 1.5  # a plan may begin so many times faster than the ship's top speed, and turn so much faster
WIDER_REACH = 4.0  # factor on the part of the chart that is planned in where the one before had no room
TRANSITIONS_S = 30.0  # work budget of optimising transitions; the others keep the rule for leg times [s]
FEWER_TRIALS = 0.4  # time that trying the transitions of a plan takes, beside that of the plan before
# how long phases take beside each other, on average of the examples on two cores: measuring the water, trying
# transitions, placing runs, sailing them, verifying and sailing drawn trials
WORK = (1.0, 3.0, 1.0, 2.5, 4.0)
MORE_CORNERS = ((1.0, 700), (16.0, 12000))  # as `CORNERS` of charts, where these left no path


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanRoom:
    """What a plan is made in."""

    water: LegWater  # that legs keep to
    space: SearchSpace  # that runs are placed in


class Phases(NamedTuple):
    """Progress of each phase of planning."""

    water: Progress
    transitions: Progress
    placing: Progress
    sailing: Progress
    trials: Progress


def phases_of(problem: PlanProblem, planner: LocalPlanner, progress: Progress) -> Phases:
    """Phases of a plan by how long they take, where the planner has them."""
    water, transitions, *others = WORK
    return Phases(*in_phases(progress, water, transitions * (_most_trials(problem, planner) > 0), *others))


def plan_room(
    problem: PlanProblem, water: LegWater, progress: Progress, like: PlanRoom | None = None, *, strict: bool = False
) -> PlanRoom:
    """Water and search space of the first plan, with the transitions optimised that the search uses.

    Transitions known from the room of a like trial are not optimised again. With `strict`, runs that may have a place
    are refused, too, where none was found.

    Raises:
        NoPlan: no path leads from start to goal, or the ship cannot leave its start or reach its goal.
    """
    planner = local_planner(water, problem.used)
    planner.check_ends(problem.start, problem.goal, water)
    if (stuck := without_way_out(problem, water, planner)) is not None:
        raise stuck
    known = like.space.goal_distance if like is not None and like.water is water else None
    space = search_space(problem, water, planner, known, strict=strict)
    if _most_trials(problem, planner):
        if like is not None and like.water.ship == water.ship:
            space = replace(space, tried=like.space.tried)
        space = _with_transitions(problem, water, space, phases_of(problem, planner, progress).transitions)
    return PlanRoom(water=water, space=space)


def roomy_water(
    problem: PlanProblem, ship: Capability, progress: Progress, like: PlanRoom | None = None
) -> tuple[LegWater, PlanRoom]:
    """The water, and what the first plan is made in; on a finer grid and with more corners of the shore where need be.

    Water of a like trial of the same ship, in the same part of the chart, is not measured again.

    Raises:
        NoPlan: as `plan_room`.
    """
    same = like is not None and like.water.area is problem.area and like.water.ship == ship
    water = like.water if like is not None and same else leg_water(problem, ship)
    try:
        return water, plan_room(problem, water, progress, like, strict=True)
    except NoRoom:
        finer = leg_water(problem, ship, finer=FINER_GRID)
    if finer.field.cell_m >= 0.75 * water.field.cell_m:  # the area is too large for it
        finer = replace(finer, field=water.field)
    if finer.field is not water.field or shapely.get_num_coordinates(problem.area.water) > CORNERS[1][1]:
        water = finer
    return water, plan_room(problem, water, progress, like)


def waters(problem: PlanProblem, ship: Capability) -> Iterator[SeaArea]:
    """Parts of the chart to plan in, each larger than the one before, the last with all that can be reached.

    The first is what the ship reaches in the time of the runs at its top speed, or less, where the clearance grid would
    become too coarse: where empty or unreachable water surrounds a trial, its extent makes no difference.
    """
    ends = problem.ends
    whole = reachable(problem.area, ends, np.inf)
    runs_s = sum(problem.repeats[item.name] * item.duration_s for item in problem.used)
    area, reach_m = resolved(whole, ends, top_mps(problem, ship) * runs_s, hull_m=problem.vessel.length_m)
    while area is not whole:
        if connects(area, ends):
            yield area
        reach_m *= WIDER_REACH
        area = reachable(whole, ends, reach_m)
    yield whole


def top_mps(problem: PlanProblem, ship: Capability) -> float:
    """Largest speed over ground of runs, and of the ship ahead."""
    runs = [float(np.hypot(*item.trajectory.velocity[:, :2].T).max()) for item in problem.used]
    return max([ship.top_speed_mps, *runs]) + problem.current_mps


def ship_on_legs(problem: PlanProblem) -> Capability:
    """What the vessel can do on legs."""
    ship = capability(problem.vessel, problem.settings, current_mps=problem.current_mps)
    # the lateral acceleration that runs reach is accepted on legs
    turns = [item.trajectory.velocity[:, 0] * item.trajectory.velocity[:, 2] for item in problem.used]
    lateral = max([ship.lateral_mps2, *(float(np.abs(turn).max()) for turn in turns)])
    return replace(ship, lateral_mps2=lateral)


def leg_water(problem: PlanProblem, ship: Capability, *, finer: float = 1.0) -> LegWater:
    """Vessel, weather and water that all legs of the problem share, on a grid so many times finer than usual.

    A finer water also keeps passages between more islands.
    """
    return LegWater(
        vessel=problem.vessel,
        environment=problem.environment,
        ship=ship,
        area=problem.area,
        clearance_m=problem.settings.clearance_m,
        field=clearance_field(problem.area, resolution_m=problem.vessel.length_m / 8 / finer),
        corners=CORNERS if finer == 1.0 else MORE_CORNERS,
        start_tolerance=problem.settings.start_tolerance,
        paths=problem.settings.paths,
    )


def search_space(
    problem: PlanProblem,
    water: LegWater,
    planner: LocalPlanner,
    goal_distance: GoalDistance | None = None,
    *,
    strict: bool = False,
) -> SearchSpace:
    """What the search for places works on; distances to the goal may be known.

    Runs without room are told before paths are looked for, which takes longer, if the grid leaves a passage.

    Raises:
        NoPlan: no path leads from start to goal, or a run surely has no place; says where and how much is lacking.
    """
    runs = run_space(problem, water)
    ends, lacking = (problem.start[:2], problem.goal[:2]), without_room(runs, strict=strict)
    if lacking is not None and narrowest_passage(water.field, *ends)[0] > runs.leg_margin_m:
        raise lacking
    goal_distance = goal_distance or build_goal_distance(water.narrowest_graph, water.field, problem.goal[:2])
    if goal_distance is None or not water.joins(*ends):
        raise _no_path(problem, water.field, runs.leg_margin_m)
    if lacking is not None:
        raise lacking
    return SearchSpace(
        footprints=runs.footprints,
        frame=runs.frame,
        field=runs.field,
        goal_distance=goal_distance,
        goal=problem.goal,
        planner=planner,
        hull_m=problem.vessel.length_m,
        leg_margin_m=runs.leg_margin_m,
        current_to=runs.current_to,
        go_around=GoAroundTime.of(water.ship, problem.vessel) if problem.expected else None,
    )


def run_space(problem: PlanProblem, water: LegWater) -> RunSpace:
    """Where runs may be placed in a water."""
    return RunSpace(
        footprints=footprints(problem, water.field, dispersions(problem)),
        frame=problem.area.frame,
        field=water.field,
        leg_margin_m=water.leg_margin_m + water.field.cell_m / 2,
        current_to=problem.environment.current_to,
    )


def _with_transitions(problem: PlanProblem, water: LegWater, space: SearchSpace, progress: Progress) -> SearchSpace:
    """The space with the transitions optimised that its best plans would use."""
    counts, planner = [problem.repeats[item.name] for item in space.footprints], space.planner
    begin_mps = 0.0 if problem.under_way is None else float(problem.under_way.velocity[0])
    departure = Departure(pose=problem.start, exit_mps=begin_mps)
    trials = TransitionTrials(
        water=water,
        primitives={item.name: item for item in problem.used},
        start=problem.start,
        under_way=(through_water(problem.environment, problem.begin), problem.standing),
        made_good=path_exceeds_displacement(space, counts, problem.start),
        budget=WorkBudget(most_s=TRANSITIONS_S),
    )
    for part in in_phases(progress, *FEWER_TRIALS ** np.arange(_most_trials(problem, planner))):
        part("trying transitions between runs", 0.0)
        try:
            placements = place_runs(space, counts, departure, width=TRANSITION_BEAM, orders=0)
        except NoPlan:  # the main search keeps more, and says what is impossible
            break
        pairs = pairs_of(placements)
        if all(pair in space.tried for pair in pairs):
            break
        space = planner.with_transitions(space, pairs, replace(trials, progress=part))
        if trials.budget.exhausted:
            break
    return space


def _most_trials(problem: PlanProblem, planner: LocalPlanner) -> int:
    """Plans whose transitions are tried, at most.

    None in the draft of a day, which has other runs than the day, and none on a lattice: legs between runs are long
    enough there for the rule for leg times.
    """
    drafted = problem.settings.draft and problem.expected
    return 0 if drafted or problem.settings.planner == "lattice" else planner.transition_trials


def footprints(problem: PlanProblem, grid: ClearanceField, off_m: Sequence[Array]) -> tuple[Footprint, ...]:
    """The runs with the room they need: the clearance asked for, or the dispersion of drawn runs where that is more."""
    vessel = problem.vessel
    _, disc_m = covering_discs(vessel.length_m, vessel.beam_m)
    found = []
    for item, off in zip(problem.used, off_m, strict=True):
        room = disc_m + grid.cell_m / 2 + np.maximum(problem.settings.clearance_m, off)
        found.append(footprint(item, room, length_m=vessel.length_m, beam_m=vessel.beam_m))
    return tuple(found)


def dispersions(problem: PlanProblem) -> list[Array]:
    """(k + 1,) dispersion along each run that is used.

    The probability of leaving that room is shared evenly among all runs, so that together they keep the confidence.
    """
    vessel, rng = problem.vessel, np.random.default_rng(problem.seed)
    centres, _ = covering_discs(vessel.length_m, vessel.beam_m)
    confidence = confidence_of_run(problem)
    return [
        dispersion_m(vessel, item, problem.environment, centres_m=centres, confidence=confidence, rng=rng)
        for item in problem.used
    ]


def confidence_of_run(problem: PlanProblem) -> float:
    """Share of cases in which each run keeps to its room."""
    return 1.0 - (1.0 - problem.settings.confidence) / max(1, sum(problem.repeats.values()))


def check_current(vessel: Vessel, settings: PlanSettings, environment: Environment, goal: Array) -> None:
    """Raise NoPlan for a mean current that a vessel cannot stem, or in which a helm cannot stop her at a pose (3,).

    Where she lies still over the ground, she goes through the water as fast as it runs: ahead or astern by her engines,
    but sideways hardly faster than in her hardest turns.
    """
    if not environment.current_to.any():
        return
    try:
        ship = capability(vessel, settings, current_mps=float(np.hypot(*environment.current_to)))
    except NoPlan as error:
        if error.what == "speed" and settings.transit_speed_mps is None:
            raise
        return  # the planner says why, and what would help
    if not isinstance(ship, HelmShip) or ship.hovers:
        return
    across = abs(float(to_body(environment.current_to, goal[2], NUMPY)[1]))
    if across > ship.sideways_mps:
        north, east = environment.current_to
        against_deg = math.degrees(math.atan2(-east, -north)) % 360.0
        raise NoPlan(
            f"the mean current sets with {across:.2g} m/s across the heading at the goal, and vessel {vessel.name!r}, "
            f"which is steered by a helm, goes sideways through the water with {ship.sideways_mps:.2g} m/s at "
            "most, on the way into her hardest turns: she cannot stop there",
            what="current",
            which="goal",
            place=goal[:2],
            remedy=f"a heading of {against_deg:.0f} degrees at the goal meets the current ahead",
        )


def check_start(problem: PlanProblem, ship: Capability) -> None:
    """Raise InputError where the ship is to begin faster than it can ever be, or turning so."""
    if problem.under_way is None:
        return
    check_start_speed(problem.vessel, problem.environment, ship, problem.begin)
    turn = FASTEST_START * max(ship.spot_rate_radps, ship.yaw_rate_radps, _turn(problem))
    if abs(r := float(problem.under_way.velocity[2])) > turn:
        raise InputError(
            f"start.r_radps is {r:.3g}, expected at most {turn:.3g} to either side, {FASTEST_START:g} times what "
            f"vessel {problem.vessel.name!r} turns in its runs and on legs"
        )


def check_start_speed(vessel: Vessel, environment: Environment, ship: Capability, begin: Array) -> None:
    """Raise InputError where a state (6,) to begin with is faster through water than the ship can ever be."""
    speed_mps, most_mps = (
        float(np.hypot(*through_water(environment, begin)[:2])),
        FASTEST_START * ship.top_speed_mps,
    )
    if speed_mps > most_mps:
        raise InputError(
            f"start.u_mps and start.v_mps are {speed_mps:.3g} m/s through the water, expected at most {most_mps:.3g}, "
            f"{FASTEST_START:g} times the top speed of vessel {vessel.name!r}"
        )


def _turn(problem: PlanProblem) -> float:
    """Largest yaw rate of the dictionary's runs [rad/s], whichever of them a design takes."""
    return max((float(np.abs(item.trajectory.velocity[:, 2]).max()) for item in problem.primitives), default=0.0)


def check_connected(problem: PlanProblem) -> None:
    """Raise NoPlan where forbidden water parts start and goal."""
    if connects(problem.area, problem.ends):
        return
    lat, lon = problem.area.frame.to_degrees(problem.goal[:2])
    raise NoPlan(
        "the goal cannot be reached from the start: forbidden water lies between them on every path to the goal near "
        f"{lat:.5f}, {lon:.5f}",
        what="parted",
        which="goal",
        place=problem.goal[:2],
    )


def _no_path(problem: PlanProblem, grid: ClearanceField, needed_m: float) -> NoRoom:
    widest, place = narrowest_passage(grid, problem.start[:2], problem.goal[:2])
    lat, lon = problem.area.frame.to_degrees(place)
    if widest <= grid.error_m or widest > needed_m:  # below the grid's resolution, or lost in simplifying the shore
        obstacle = (
            f"the goal cannot be reached from the start in a chart grid of {grid.cell_m:.3g} m and by a simplified "
            f"shore, near {lat:.5f}, {lon:.5f}"
        )
    else:
        obstacle = (
            f"the goal cannot be reached from the start: the widest passage leaves {widest:.1f} m on each side near "
            f"{lat:.5f}, {lon:.5f}, while {needed_m:.1f} m are needed (plan.clearance_m = "
            f"{problem.settings.clearance_m:g}, the hull in a turn, and the chart grid)"
        )
    return NoRoom(obstacle, what="passage", place=place)
