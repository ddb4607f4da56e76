"""The trial of a scenario: the optimal durations in the time given, or the shortest day of the accuracy asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from expdesign.dictionary import PrimitiveSpec
from expdesign.durations import DurationDesign, Efficiencies, efficiencies
from expdesign.errors import InputError, NoAnswer, NoPlan
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import dictionary_files, entry, finite
from expdesign.growing import GrowSettings
from expdesign.information import PrimitiveInformation
from expdesign.memory import Memory, memory_in_use, recalled, remembering
from expdesign.plan.assembly import check_start, ship_on_legs
from expdesign.plan.control import capability
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import Plan, PlanProblem, PlanSettings
from expdesign.processes import begin, in_order, reported_together
from expdesign.progress import Progress, in_phases, silent
from expdesign.scenario import Scenario
from expdesign.shortest_day import Accuracy, ShortestDay
from expdesign.vessel import VesselModel
from expdesign.workflows.steps.design_problem import design_document, designed
from expdesign.workflows.steps.first_trial import calibration, first_note, half_as_wide, is_wide, whole_trial
from expdesign.workflows.steps.planned import plan_problem, planned
from expdesign.workflows.steps.scored import STEM, scored

FEW_CANDIDATES = 64
"""Candidates of every family at first, where [design.grow] does not say how many; each round's prices lead to better
ones."""
LEG_SPEED = 0.97
"""Speed of legs as a share of the top speed, where [plan] states none: faster legs save more than steering then
loses."""
WORK = (0.2, 0.8)  # share of the work: the search for manoeuvres, and for the shortest day


@dataclass(frozen=True, kw_only=True, eq=False)
class Day:
    """A planned trial."""

    information: tuple[PrimitiveInformation, ...]  # of the dictionary that the plan takes its runs from
    design: DurationDesign  # with the runs that the plan does
    plan: Plan  # the trial
    shortest: ShortestDay | None = None  # how it was found to be the shortest, or None where total_s decides
    added: tuple[PrimitiveSpec, ...] = ()  # manoeuvres of it that the scenario's dictionary has not
    note: str = ""  # why it is another trial than the one asked for


def planned_day(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    *,
    reference: DurationDesign | None = None,
    stated: VesselModel | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> Day:
    """The verified trial of a scenario.

    Args:
        design: the optimal durations in total_s, beside what is known.
        reference: those whose accuracy is asked for, where less was known when it was stated; `design` when None.
        stated: as of `duration_problem`.
        seed: of everything drawn.

    Raises:
        InputError: plans cannot be made for the vessel, or the accuracy cannot be counted.
        NoAnswer: the accuracy cannot be reached, or there is no plan.
    """
    asked, information = case.design.accuracy, tuple(information)
    if asked is None and is_wide(case.vessel.model):
        return _first_day(case, information, design, stated=stated, seed=seed, progress=progress)
    if asked is None:
        plan = planned(case, information, design, seed=seed, progress=progress)
        return Day(information=information, design=design, plan=plan)
    case, accuracy = checked_day(case, information, design)
    if reference is not None:
        accuracy = replace(accuracy, level=_accuracy(case, information, reference).level)
    if asked.starts == 1 or case.plan.draft:
        return _searched(case, information, design, accuracy, stated, seed, 0, progress)
    return _shortest_of(asked.starts, (case, information, design, accuracy, stated, seed), progress)


def _first_day(
    case: Scenario,
    information: tuple[PrimitiveInformation, ...],
    design: DurationDesign,
    *,
    stated: VesselModel | None,
    seed: int,
    progress: Progress,
) -> Day:
    """The trial of a ship with a wide prior: as asked for where that is verified, or else a first one of shorter runs.

    Where neither is verified, a first trial of ships that differ half as much is tried, and what came of it is told.
    """
    trying, first, advising = in_phases(progress, 0.4, 0.5, 0.1)
    whole = whole_trial(plan_problem(case, information, design, seed=seed), trying)
    if whole is not None and (whole.verified or whole.draft):
        return Day(information=information, design=design, plan=whole)
    try:
        day = _calibrated(case, stated, seed, first)
    except NoAnswer as error:
        refused = error if isinstance(error, NoPlan) else NoPlan(str(error))
        refused.remedies += (_with_narrower_prior(case, stated, seed, advising),)
        raise refused from None
    if day.plan.verified or day.plan.draft:
        return day
    return replace(day, note=f"{day.note}; {_with_narrower_prior(case, stated, seed, advising)}")


def _calibrated(case: Scenario, stated: VesselModel | None, seed: int, progress: Progress) -> Day:
    """The first trial of a ship with a wide prior."""
    progress("cutting runs to what is safe for all ships of the prior", 0.0)
    first = calibration(case, seed=seed)
    told = scored(first)
    shared = designed(first, told, stated=stated, seed=seed)
    plan = recalled(plan_trial, plan_problem(first, told, shared, seed=seed), advise=False, progress=progress)
    note = first_note([item.primitive for item in told], case.dictionary)
    return Day(information=told, design=shared, plan=plan, note=note)


def _with_narrower_prior(case: Scenario, stated: VesselModel | None, seed: int, progress: Progress) -> str:
    """Whether a first trial of ships that differ half as much is verified, or drafted for a draft, in words."""
    try:
        plan = _calibrated(half_as_wide(case), stated, seed, progress).plan
    except NoAnswer:
        plan = None
    if plan is not None and (plan.verified or plan.draft):
        how = "drafted" if plan.draft else "verified"
        return f"with half the standard deviations of parameters (model.parameter_std) a first trial is {how}"
    return "half the standard deviations of parameters (model.parameter_std), tried as a remedy, do not help either"


def checked_day(
    case: Scenario, information: Sequence[PrimitiveInformation], design: DurationDesign
) -> tuple[Scenario, Accuracy]:
    """The scenario with a speed of legs, and the accuracy that it asks for.

    Raises:
        InputError, NoAnswer: what can be told beforehand of those of `planned_day`.
    """
    from expdesign.shortest_day import check_way_fits

    accuracy, case = _accuracy(case, information, design), replace(case, plan=with_leg_speed(case))
    problem = plan_problem(case, information, design)
    check_start(problem, ship_on_legs(problem))
    if case.design.accuracy is not None and case.design.accuracy.day_s is not None:
        check_way_fits(problem, case.design.accuracy.day_s)
    return case, accuracy


def search_additions(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> None:
    """Search for the manoeuvres that `planned_day` adds, so that they are remembered for it and for like scenarios.

    Nothing is done where no accuracy is asked for.

    Raises:
        InputError, NoAnswer: as of `planned_day`.
    """
    if case.design.accuracy is not None:
        accuracy, case = _accuracy(case, information, design), replace(case, plan=with_leg_speed(case))
        _added(case, plan_problem(case, information, design, seed=seed), accuracy, (seed, 0), progress)


def _accuracy(case: Scenario, information: Sequence[PrimitiveInformation], design: DurationDesign) -> Accuracy:
    """The accuracy that a scenario asks for, with durations by which it is stated."""
    from expdesign.shortest_day import stated_accuracy

    asked, runs = case.design.accuracy, tuple(item.primitive for item in information)
    assert asked is not None  # there is an accuracy
    return stated_accuracy(asked, design, case.vessel, runs, case.environment)


def _shortest_of(
    starts: int,
    shared: tuple[Scenario, tuple[PrimitiveInformation, ...], DurationDesign, Accuracy, VesselModel | None, int],
    progress: Progress,
) -> Day:
    """The day of several searches whose drawn trials end soonest, by their median; that of the first of equal ones."""
    begin()
    with reported_together(progress, starts) as together:
        tasks = list(enumerate(together.reporters))
        found = list(in_order(_answered, (memory_in_use(), *shared), tasks))
    days = [item for item in found if isinstance(item, Day)]
    if not days:
        raise next(item for item in found if isinstance(item, NoAnswer))
    return min(days, key=lambda day: np.nan_to_num(day.plan.day.median_s, nan=np.inf))


def _answered(memory: Memory | None, *asked: Any) -> Day | NoAnswer:
    """The outcome of one search, of what `_searched` is asked, perhaps in another process."""
    with remembering(memory):
        try:
            return _searched(*asked)
        except NoAnswer as error:
            return error


def _searched(
    case: Scenario,
    information: tuple[PrimitiveInformation, ...],
    design: DurationDesign,
    accuracy: Accuracy,
    stated: VesselModel | None,
    seed: int,
    start: int,
    progress: Progress,
) -> Day:
    """The day of one search; each start searches for manoeuvres from other candidates."""
    from expdesign.shortest_day import fullest_day, shortest_day

    asked = case.design.accuracy
    assert asked is not None  # there is an accuracy
    searching, planning = in_phases(progress, *WORK)
    added = _added(case, plan_problem(case, information, design, seed=seed), accuracy, (seed, start), searching)
    if added:
        case = _with_additions(case, added)
        information = scored(case)
        design = designed(case, information, stated=stated, seed=seed)
    problem = replace(plan_problem(case, information, design, seed=seed), expected=True)
    names = tuple(spec.name for spec in added)
    search = (
        partial(shortest_day, added=names, most_s=asked.most_s)
        if asked.day_s is None
        else partial(fullest_day, day_s=asked.day_s, added=names)
    )
    found = recalled(search, problem, accuracy, progress=planning)
    return Day(information=information, design=found.design, plan=found.plan, shortest=found, added=added)


def with_leg_speed(case: Scenario) -> PlanSettings:
    """The settings with a speed of legs that suits a short day; unchanged where the scenario states one.

    Raises:
        NoPlan: the vessel makes no headway.
    """
    if case.plan.transit_speed_mps is not None:
        return case.plan
    current_mps = float(np.hypot(*case.environment.current_to))
    top_mps = capability(case.vessel, case.plan, current_mps=current_mps).top_speed_mps
    return replace(case.plan, transit_speed_mps=LEG_SPEED * top_mps)


def _added(
    case: Scenario, problem: PlanProblem, accuracy: Accuracy, seed_start: tuple[int, int], progress: Progress
) -> tuple[PrimitiveSpec, ...]:
    """Manoeuvres that would shorten the day; none where the scenario wants none, or the vessel can do none.

    The first start takes the seed itself, the others seeds drawn from it. Only the speed and the turns of legs matter
    of the plan's settings, so that scenarios with others share what is remembered. Drafts search less.
    """
    from expdesign.shortest_day import manoeuvres_worth_adding

    if case.design.accuracy is None or not case.design.accuracy.grow:
        return ()
    settings = case.design.grow or GrowSettings(pool=FEW_CANDIDATES)
    seed, start = seed_start
    seed = seed if settings.seed is None else settings.seed
    settings = replace(settings, seed=int(np.random.default_rng([seed, start]).integers(2**31)) if start else seed)
    plan = case.plan
    speed_mps, radius_m = plan.transit_speed_mps, plan.turning_radius_m
    legs = PlanSettings(transit_speed_mps=speed_mps, turning_radius_m=radius_m, draft=plan.draft)
    problem = replace(problem, settings=legs, seed=0)
    try:
        day_s = case.design.accuracy.day_s
        return recalled(manoeuvres_worth_adding, problem, accuracy, settings, day_s, progress=progress)
    except InputError:
        if case.design.grow is None:  # not asked for, so no fault of the scenario
            return ()
        raise


def _with_additions(case: Scenario, added: Sequence[PrimitiveSpec]) -> Scenario:
    """The scenario with more manoeuvres, which the optimal durations that state the accuracy go without."""
    without = case.design.limits
    without = replace(without, excluded=(*without.excluded, *(spec.name for spec in added)))
    return replace(case, dictionary=(*case.dictionary, *added), design=replace(case.design, limits=without))


def day_files(case: Scenario, day: Day) -> dict[str, str | bytes]:
    """The search for the shortest day, where there was one, and the dictionary with what it added."""
    found = day.shortest
    if found is None:
        return {}
    content = {
        **({"draft": True, "note_on_draft": found.note} if found.plan.draft else {}),
        "day_s": found.plan.commands.duration_s,
        "day_median_s": finite(found.plan.day.median_s),
        "day_95_s": finite(found.plan.day.most_s),
        "goes_to": asdict(found.parts),
        "information": found.information,
        **({} if found.most_s is None else {"most_s": found.most_s, **_information_bound(found)}),
        **_bound(found),
        "added": {spec.name: {"family": spec.family, **spec.settings} for spec in day.added},
        "cost_of_runs_s": found.cost_s,
        "cost_of_runs_bound_s": found.cost_bound_s,
        "curve": [{"day_s": day_s, "information": share} for day_s, share in found.curve.tolist()],
        "tried": [
            entry(item, "runs", "day_s", "expected_s", "informative_s", "information", "told") for item in found.tried
        ],
    }
    return {"day.json": json.dumps(content, indent=2) + "\n", **_dictionary(case, day.added)}


def _dictionary(case: Scenario, added: Sequence[PrimitiveSpec]) -> dict[str, str | bytes]:
    """The dictionary with additions as a file for every command; nothing without any."""
    if not added:
        return {}
    comments = (
        f"The dictionary of scenario {case.name!r} and {len(added)} manoeuvres that shorten its day.",
        f"They were found for vessel {case.vessel.name!r}.",
    )
    return dictionary_files([*case.dictionary, *added], name=f"{case.name}-grown", stem=STEM, comments=comments)


def _bound(found: ShortestDay) -> dict[str, object]:
    """The bound on the day, the ratio, and the class that it holds for."""
    bound = found.bound
    if bound is None or bound.day_s <= 0:
        return {}
    return {
        "day_bound_s": bound.day_s,
        "day_over_bound": found.plan.commands.duration_s / bound.day_s,
        "bound": {
            "holds_for": "motions within these velocities through water and the actuators' limits, whether or not "
            "the model can follow them; regressors, and how fast speed is gained and lost, by the nominal model",
            "velocities": dict(zip(("u_mps", "v_mps", "r_radps"), bound.velocities.tolist(), strict=True)),
            "speed_mps": bound.speed_mps,
            "information_s": bound.information_s,
            "information_searched_s": bound.searched_s,
            "way_s": bound.way_s,
            "required_runs_s": bound.required_s,
        },
    }


def _information_bound(found: ShortestDay) -> dict[str, object]:
    """No day of the class and of this length holds more; nothing where that is not known."""
    bound = found.bound
    if bound is None or not bound.information_s > 0 or found.most_s is None or found.design.problem.prior.any():
        return {}
    return {"information_bound": found.most_s / bound.information_s}


def compared_criteria(case: Scenario, design: DurationDesign) -> tuple[Efficiencies, ...]:
    """The design under every criterion; without its whole runs where a day chooses others."""
    return tuple(recalled(efficiencies, replace(design, repeats=()) if case.design.accuracy else design))


def day_document(day: Day) -> Document:
    """What a document says of the durations and of the day: key numbers, and the days tried."""
    found, durations = day.shortest, design_document(day.design)
    if day.note:
        durations += Document(notes=(f"This trial: {day.note}.",))
    if found is None:
        return durations
    rows = tuple(
        (
            str(number),
            f"{item.day_s:.0f}",
            f"{item.expected_s:.0f}",
            f"{item.informative_s:.0f}",
            f"{item.information:.1%}",
            ", ".join(f"{count} {name}" for name, count in item.runs.items()),
        )
        for number, item in enumerate(found.tried, start=1)
    )
    header = ("day", "seconds", "with go-arounds", "of these in runs", "information of what is needed", "runs")
    own = Document(
        facts={
            "day_s": found.plan.commands.duration_s,
            "day_median_s": found.plan.day.median_s,
            "day_95_s": found.plan.day.most_s,
            "information_of_what_was_asked": found.information,
            **{name: value for name, value in _bound(found).items() if name != "bound"},
            **_information_bound(found),
            "manoeuvres_added": len(day.added),
            "days_tried": len(found.tried),
        },
        sections=tabled(Table(title="Days planned in search of the shortest", header=header, rows=rows)),
        notes=(f"Draft: {found.note}.",) if found.plan.draft else (),
    )
    facts = {name: value for name, value in durations.facts.items() if name not in OF_GIVEN_TIME}
    return replace(durations, facts=facts) + own


OF_GIVEN_TIME = ("runs", "efficiency_of_whole_runs")
"""What is told of durations but not of a day, whose runs are others."""
