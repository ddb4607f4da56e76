"""Sailing a trial run by run, stretch after stretch; where a leg or a run fails, the rest is placed again."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import NoPlan
from expdesign.plan.assembly import PlanRoom, phases_of
from expdesign.plan.feasibility import LEG_S
from expdesign.plan.legs import FoundLeg, LegTask, LegWater, last_state, nearest_turns
from expdesign.plan.legs_ahead import KnownLegs, LegAhead, leg_found, legs_ahead, remember
from expdesign.plan.local_planner import Departure, LocalPlanner, SearchSpace
from expdesign.plan.search import placed_runs
from expdesign.plan.values import Leg, Placement, Placements, PlanProblem, PlanSettings, SailedTrial, WorkBudget
from expdesign.progress import Progress, silent
from expdesign.signals import Commands, Trajectory
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SailedStretch:
    """A leg with its commands (k, m) and states (k + 1, 6), and what found its path."""

    kind: str
    name: str
    commands: Array
    states: Array
    path: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Timeline:
    """The trial so far."""

    begin: Array  # (6,) state before the first stretch
    begin_inputs: Array  # (m,) commands standing then
    stretches: list[SailedStretch] = field(default_factory=list)  # in time order; the only part that grows

    @property
    def state(self) -> Array:
        """(6,) where the ship is now."""
        return np.asarray(self.stretches[-1].states[-1] if self.stretches else self.begin)

    @property
    def inputs(self) -> Array:
        """(m,) commands standing now."""
        return np.asarray(self.stretches[-1].commands[-1] if self.stretches else self.begin_inputs)

    @property
    def given(self) -> Array:
        """(h, m) all commands so far, what stood before them first."""
        return np.concatenate([self.begin_inputs[None], *(stretch.commands for stretch in self.stretches)])

    @property
    def last(self) -> str:
        """Name of the stretch sailed last, or ""."""
        return self.stretches[-1].name if self.stretches else ""

    def sail(self, kind: str, name: str, commands: Array, track: Trajectory, path: str = "") -> None:
        """Add a stretch."""
        states = np.hstack([track.pose, track.velocity])
        self.stretches.append(SailedStretch(kind=kind, name=name, commands=commands, states=states, path=path))

    def undo_run(self) -> Placement:
        """Remove the last run and the leg to it; where the run began."""
        run = self.stretches.pop()
        self.stretches.pop()
        return Placement(primitive=run.name, pose=run.states[0, :3])

    def joined(self, *, sample_time_s: float, names: tuple[str, ...]) -> SailedTrial:
        """Everything as one command series, one trajectory and the legs in it."""
        values = np.concatenate([stretch.commands for stretch in self.stretches])
        states = np.concatenate([self.begin[None], *(stretch.states[1:] for stretch in self.stretches)])
        ends = np.cumsum([len(stretch.commands) for stretch in self.stretches]).tolist()
        legs = tuple(
            Leg(
                kind=stretch.kind,
                name=stretch.name,
                first=end - len(stretch.commands),
                last=end,
                path=stretch.path,
            )
            for stretch, end in zip(self.stretches, ends, strict=True)
        )
        commands = Commands(sample_time_s=sample_time_s, names=names, values=values)
        track = Trajectory(sample_time_s=sample_time_s, pose=states[:, :3], velocity=states[:, 3:])
        return SailedTrial(commands=commands, trajectory=track, legs=legs, standing=self.begin_inputs)


TRIES_FROM_A_RUN = 2  # runs tried after one before it is placed elsewhere itself
RUN_LEG_S = 12.0  # work budget of a leg to a run [s]: another place is worth more than a long search for it
FAILURE_S = 2.0  # least cost of a failed placement [s]
CLOCK_BUDGETS = 5.0  # time budgets by the clock after which a search that is stuck ends, whatever its counted work


GOAL = "goal"


def sail_all(
    problem: PlanProblem,
    room: PlanRoom,
    progress: Progress,
    *,
    stated: LegWater,
    budget: WorkBudget,
    known: KnownLegs | None = None,
) -> SailedTrial:
    """Every run and leg from start to goal.

    Args:
        room: that legs and runs are planned in.
        stated: the water that runs keep to, with the clearance asked for.
        budget: counts what places and legs cost.
        known: takes the legs that are found, for `sail_placed`.

    Raises:
        NoPlan: there is no place for a run, or none was found within the budget; the message says what failed.
    """
    voyage = _Voyage(
        problem=problem,
        water=room.water,
        stated=stated,
        planner=room.space.planner,
        budget=budget,
        known={} if known is None else known,
    )
    try:
        return _sailed(voyage, room.space, progress)
    except NoPlan as error:
        error.poses = voyage.sailed.trajectory.pose if voyage.line.stretches else None
        error.spent_s = budget.spent_s
        raise


def sail_placed(
    problem: PlanProblem,
    room: PlanRoom,
    placements: Sequence[Placement],
    *,
    stated: LegWater,
    budget: WorkBudget,
    known: KnownLegs,
) -> SailedTrial | None:
    """Runs at given places, in this order, with the legs between them; None where one of them is not found.

    Args:
        problem, room, stated, budget: as of `sail_all`.
        placements: of all runs.
        known: legs that are not sought again; grows.
    """
    voyage = _Voyage(
        problem=problem, water=room.water, stated=stated, planner=room.space.planner, budget=budget, known=known
    )
    legs = voyage.legs_ahead(placements, known)
    for placement in placements:
        if voyage.sail_run(placement, next(legs)):
            return None
    return voyage.sailed if voyage.sail_home(next(legs)) else None


def know_legs(
    problem: PlanProblem,
    room: PlanRoom,
    choices: Iterable[Sequence[Placement]],
    *,
    stated: LegWater,
    known: KnownLegs,
) -> None:
    """Make the legs known that `sail_placed` would seek for each of several choices of placements.

    Args:
        problem, room, stated, known: as of `sail_placed`.
        choices: of placements.
    """
    planner, budget = room.space.planner, WorkBudget()
    voyage = _Voyage(problem=problem, water=room.water, stated=stated, planner=planner, budget=budget, known=known)
    tasks = [task for placements in choices for task in voyage.tasks_ahead(placements)]
    legs_ahead(planner, room.water, tasks, known)


def _sailed(voyage: _Voyage, space: SearchSpace, progress: Progress) -> SailedTrial:
    """Every run and leg; what failed is avoided in the placements that follow."""
    problem, budget = voyage.problem, voyage.budget
    left, stuck, proof = problem.repeats, "", None
    phases, stretches = phases_of(problem, space.planner, progress), sum(left.values()) + 1
    failures, tried_here = _Failures(problem.settings.time_budget_s), 0
    while True:
        phases.placing(*failures.placing())
        told = silent if failures.tries else phases.placing  # how long another try takes is not known
        placed = _placed(problem.settings, space, left, voyage.line, stuck, told)
        budget.spent_s += placed.work_s
        proof, spent_s = proof or placed.lattice, budget.spent_s
        legs = voyage.legs_ahead(placed.runs)
        for placement in placed.runs:
            phases.sailing(f"sailing {placement.primitive}", 1.0 - (sum(left.values()) + 1) / stretches)
            spent_s = budget.spent_s
            if stuck := voyage.sail_run(placement, next(legs)):
                space, failed, tried_here = space.refusing(voyage.line.last, placement), placement, tried_here + 1
                break
            left[placement.primitive], tried_here = left[placement.primitive] - 1, 0
        else:
            phases.sailing("sailing to the goal", 1.0 - 1 / stretches)
            if voyage.sail_home(next(legs)):
                return replace(voyage.sailed, lattice=proof and replace(proof, refused=failures.tries))
            stuck, failed = "no leg leads from the last run to the goal", None
        if failed is None or (tried_here == TRIES_FROM_A_RUN and voyage.placed):  # the run before leaves no way on
            failed, tried_here = voyage.undo_run(), 0
            space = space.refusing(voyage.line.last, failed)
            left[failed.primitive] += 1
        failures.count(placed.work_s + budget.spent_s - spent_s, stuck, failed)


def _placed(
    settings: PlanSettings, space: SearchSpace, left: dict[str, int], line: Timeline, stuck: str, progress: Progress
) -> Placements:
    names = [item.name for item in space.footprints]
    last = names.index(line.last) if line.last in names else -1
    departure = Departure(pose=line.state[:3], exit_mps=float(line.state[3]), last=last)
    try:
        return placed_runs(settings, space, [left[name] for name in names], departure, progress)
    except NoPlan as error:
        if not stuck:
            raise
        error.obstacle, error.what = f"{error.obstacle}; before that, {stuck}", "sailing"
        raise


class _Failures:
    """Failed placements, counted against the time budget."""

    def __init__(self, budget_s: float) -> None:
        self._budget_s, self._deadline = budget_s, time.monotonic() + CLOCK_BUDGETS * budget_s
        self.tries, self._lost_s = 0, 0.0

    def placing(self) -> tuple[str, float]:
        """What is done next, and its share; that of another try is not known."""
        if not self.tries:
            return "placing runs", 0.0
        return f"placing runs anew, {self._lost_s:.0f} s of plan.time_budget_s = {self._budget_s:g} used up", math.nan

    def count(self, cost_s: float, stuck: str, failed: Placement) -> None:
        """Count one failure, and raise NoPlan where it was one too many."""
        self.tries += 1
        self._lost_s += max(FAILURE_S, cost_s)
        if self._lost_s > self._budget_s or time.monotonic() > self._deadline:
            raise NoPlan(
                f"no plan within plan.time_budget_s = {self._budget_s:g}, {self.tries} places were tried: {stuck}",
                what="sailing",
                which=failed.primitive,
                place=failed.pose[:2],
                remedy="not tried: more plan.time_budget_s, less design.total_s",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Voyage:
    """Legs and runs sailed one after the other."""

    # problem, water, stated, budget: as `sail_all` takes them
    problem: PlanProblem
    water: LegWater
    stated: LegWater
    planner: LocalPlanner  # finds legs
    budget: WorkBudget
    known: KnownLegs  # legs found so far; grows
    placed: list[Placement] = field(default_factory=list)  # where runs sailed so far were placed; grows
    line: Timeline = field(init=False)  # what has been sailed; grows

    def __post_init__(self) -> None:
        problem = self.problem
        object.__setattr__(self, "line", Timeline(begin=problem.begin, begin_inputs=problem.standing))

    @property
    def sailed(self) -> SailedTrial:
        """Everything so far."""
        vessel = self.problem.vessel
        joined = self.line.joined(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs)
        return replace(joined, placements=tuple(self.placed))

    def legs_ahead(self, placements: Sequence[Placement], known: KnownLegs | None = None) -> Iterator[LegAhead]:
        """Legs to runs, in this order, and on to the goal, as far as can be known now."""
        return legs_ahead(self.planner, self.water, self.tasks_ahead(placements), known)

    def tasks_ahead(self, placements: Sequence[Placement]) -> list[LegTask]:
        """What these legs have to do."""
        runs = [self._primitive(placement) for placement in placements]
        entries = [self._entry(placement, run) for placement, run in zip(placements, runs, strict=True)]
        ends = [*zip(entries, (run.entry_inputs for run in runs), strict=True), self._stop]
        tasks = [self._task(*self._now, *ends[0], stretches=0)]
        for number, (entry, run, end) in enumerate(zip(entries, runs, ends[1:], strict=True), start=1):
            values = run.commands.values
            left = self.water.states(entry, values, run.entry_inputs[None])[-1]
            tasks.append(self._task(left, values[-1], values, *end, stretches=2 * number))
        return tasks

    def sail_run(self, placement: Placement, ahead: LegAhead) -> str:
        """Sail to a placement and do its run; "" on success, else what failed."""
        water, line, primitive = self.water, self.line, self._primitive(placement)
        lat, lon = self.problem.area.frame.to_degrees(placement.pose[:2])
        where = f"{primitive.name!r} near {lat:.5f}, {lon:.5f}"
        found = self._leg(self._entry(placement, primitive), primitive.entry_inputs, ahead)
        if found is None:
            return f"no leg leads to {where}"
        leg = found.commands
        track = water.sail(line.state, leg, line.given)
        turned = nearest_turns(self.problem.vessel, primitive.entry_inputs, leg[-1]) - primitive.entry_inputs
        values = primitive.commands.values + turned
        run = water.sail(last_state(track), values, water.remembered(np.concatenate([line.given, leg])))
        if not self.stated.holds(run.pose):
            return f"the run {where} leaves safe water"
        line.sail("reposition", primitive.name, leg, track, found.source)
        line.sail("primitive", primitive.name, values, run)
        self.placed.append(placement)
        return ""

    def sail_home(self, ahead: LegAhead) -> bool:
        """Sail the last leg; False where none is found."""
        found = self._leg(*self._stop, ahead)
        if found is None:
            return False
        track = self.water.sail(self.line.state, found.commands, self.line.given)
        self.line.sail("reposition", GOAL, found.commands, track, found.source)
        return True

    def undo_run(self) -> Placement:
        """Remove the last run and the leg to it; where the run began."""
        if not self.line.stretches:
            raise NoPlan("no leg leads from the start to the goal")
        self.placed.pop()
        return self.line.undo_run()

    def _leg(self, end: Array, end_inputs: Array, ahead: LegAhead) -> FoundLeg | None:
        """From where the timeline ends, or None: that found ahead, where it arrives from there."""
        self.budget.spent_s += ahead.spent_s
        remember(self.known, ahead)
        if ahead.commands is None:
            return None
        task = self._task(*self._now, end, end_inputs, stretches=0)
        leg = ahead.fitted(task, self.water)
        if leg is None:
            ahead = leg_found(self.planner, self.water, task)
            leg = ahead.commands
            self.budget.spent_s += ahead.spent_s
        return FoundLeg(commands=np.concatenate([self._wait, leg]), source=ahead.source) if leg is not None else None

    def _task(
        self, start: Array, start_inputs: Array, given: Array, end: Array, end_inputs: Array, *, stretches: int
    ) -> LegTask:
        """A leg to be found so many stretches after those sailed."""
        home = np.array_equal(end, self._stop[0])
        return LegTask(
            start=start,
            end=end,
            start_inputs=start_inputs,
            end_inputs=end_inputs,
            seed=self.problem.seed + len(self.line.stretches) + stretches + 1,
            before=self.water.remembered(given),
            budget=WorkBudget(most_s=LEG_S if home else RUN_LEG_S),
        )

    @property
    def _now(self) -> tuple[Array, Array, Array]:
        """State and commands standing as the next leg begins, and all commands before it."""
        wait, line = self._wait, self.line
        start = last_state(self.water.sail(line.state, wait, wait)) if len(wait) else line.state
        return start, line.inputs, line.given

    @property
    def _wait(self) -> Array:
        """(0 or 1, m) commands before the first leg of a ship with slow actuators.

        What they deliver before the first sample depends on the commands before it.
        """
        late_start = not self.line.stretches and not self.water.prompt
        return self.line.begin_inputs[None] if late_start else np.zeros((0, len(self._rest)))

    @property
    def _stop(self) -> tuple[Array, Array]:
        """State at the goal and the commands there."""
        return self.problem.at_rest(self.problem.goal), self._rest

    def _primitive(self, placement: Placement) -> Primitive:
        return next(item for item in self.problem.used if item.name == placement.primitive)

    def _entry(self, placement: Placement, primitive: Primitive) -> Array:
        return self.problem.moving(placement.pose, primitive.entry_velocity)

    @property
    def _rest(self) -> Array:
        return np.zeros(len(self.problem.vessel.limits))
