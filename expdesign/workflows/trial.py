"""From a scenario to a trial: score, durations, plan, and all of it in one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from expdesign import __version__
from expdesign.dictionary import build_dictionary
from expdesign.dictionary.desired import deviating
from expdesign.durations import DurationDesign, efficiencies, with_repeats
from expdesign.errors import InputError
from expdesign.export import (
    STANDARD,
    Route,
    build_route,
    commands_csv,
    dictionary_json,
    durations_json,
    plan_json,
    planned_track,
    route_files,
    track_csv,
    write_files,
)
from expdesign.export.cards import cards_html
from expdesign.export.report import ReportContent, report_html
from expdesign.growing import Growth
from expdesign.information import PrimitiveInformation, estimated_parameters, score_primitives
from expdesign.plan.problem import PlanProblem
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import Plan, Promise
from expdesign.scenario import Scenario, load_repeats, load_scenario
from expdesign.workflows.design import design_summary, design_tables, designed
from expdesign.workflows.grown import grown, growth_files, growth_summary, growth_tables
from expdesign.workflows.outcome import Outcome, Progress, TextTable, silent, within


def run(scenario: Path, out: Path | None, *, seed: int = 0, progress: Progress = silent) -> Outcome:
    """The main job: score, durations, plan, verification, route files and report, into `out` or runs/<scenario>."""
    case = _load(scenario, progress)
    check_plannable(case)
    information, growth = ready(case, seed=seed, progress=within(progress, 0.02, 0.1))
    design = designed(case, information, seed=seed, progress=within(progress, 0.1, 0.13))
    compared = efficiencies(design)
    plan = planned(case, information, design, seed=seed, progress=within(progress, 0.14, 0.85))
    progress("writing routes, run cards and report", 0.85)
    route = built_route(case, plan)
    content = replace(report_content(case, information, design, plan, seed), compared=compared, route=route)
    files = trial_files(case, growth, content, route)
    summary = {**growth_summary(growth, case), **design_summary(design), **plan_summary(plan)}
    return _written(case, out, files, summary, progress)


def trial_files(case: Scenario, growth: Growth | None, content: ReportContent, route: Route) -> dict[str, str | bytes]:
    """Every file of a planned trial, by name."""
    content = replace(content, growth=growth)
    return {
        **_dictionary_files(case, content.information),
        **growth_files(case, growth),
        "durations.json": durations_json(content.design, compared=content.compared),
        **_plan_files(case, content.plan),
        **route_files(route, STANDARD),
        "report.html": report_html(content),
        "cards.html": cards_html(content),
    }


def score(scenario: Path, out: Path | None, *, seed: int = 0, progress: Progress = silent) -> Outcome:
    """Information of every primitive of a scenario's dictionary."""
    case = _load(scenario, progress)
    information = scored(case, progress=within(progress, 0.05, 0.95))
    summary = {
        "primitives": len(information),
        "parameters": len(_parameters(case)),
        "meet_excitation_condition": sum(item.excitation_condition for item in information),
        "informative_alone": sum(item.log_det_alone is not None for item in information),
        "stray_from_their_wish": [item.name for item in deviating([item.primitive for item in information])],
    }
    return _written(case, out, _dictionary_files(case, information), summary, progress)


def durations(
    scenario: Path, out: Path | None, *, grow: bool = False, seed: int = 0, progress: Progress = silent
) -> Outcome:
    """How long to run each primitive, with its certificate; with `grow` also of manoeuvres found to add most."""
    case = _load(scenario, progress)
    information, growth = ready(case, grow=grow, seed=seed, progress=within(progress, 0.05, 0.6))
    design = designed(case, information, seed=seed, progress=within(progress, 0.6, 0.9))
    progress("comparing criteria", 0.9)
    compared = efficiencies(design)
    files = {
        "durations.json": durations_json(design, compared=compared),
        **growth_files(case, growth),
    }
    summary = {**growth_summary(growth, case), **design_summary(design)}
    tables = (*growth_tables(growth), *design_tables(design, compared))
    return _written(case, out, files, summary, progress, tables)


def plan(
    scenario: Path, out: Path | None, *, durations: Path | None = None, seed: int = 0, progress: Progress = silent
) -> Outcome:
    """One verified trajectory with the runs of a durations file, or of the optimal durations."""
    case = _load(scenario, progress)
    check_plannable(case)
    information, _ = ready(case, seed=seed, progress=within(progress, 0.02, 0.1))
    design = designed(case, information, seed=seed)
    if durations is not None:
        design = with_repeats(design, load_repeats(durations, names=design.problem.names))
    result = planned(case, information, design, seed=seed, progress=within(progress, 0.1, 0.95))
    return _written(case, out, _plan_files(case, result), plan_summary(result), progress)


def scored(case: Scenario, *, progress: Progress = silent) -> tuple[PrimitiveInformation, ...]:
    """Information of every primitive of a scenario."""
    progress("simulating the dictionary", 0.0)
    primitives = build_dictionary(case.vessel, case.dictionary)
    progress("scoring the dictionary", 0.5)
    return score_primitives(
        case.vessel,
        primitives,
        environment=case.environment,
        fixed_parameters=case.design.fixed_parameters,
        mean_subtraction=case.design.mean_subtraction,
    )


def ready(
    case: Scenario, *, grow: bool = False, seed: int, progress: Progress = silent
) -> tuple[tuple[PrimitiveInformation, ...], Growth | None]:
    """The scored dictionary, grown where that is wished."""
    information = scored(case, progress=within(progress, 0.0, 0.2 if grow or case.design.grow else 1.0))
    growth = grown(case, information, always=grow, seed=seed, progress=within(progress, 0.2, 1.0))
    return (information if growth is None else growth.information), growth


def planned(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Plan:
    """The verified trial of a scenario."""
    return plan_trial(plan_problem(case, information, design, seed=seed), progress=progress)


def plan_problem(
    case: Scenario, information: Sequence[PrimitiveInformation], design: DurationDesign, *, seed: int = 0
) -> PlanProblem:
    """What a scenario asks the planner for, with a dictionary and its durations.

    Raises:
        InputError: plans cannot be made for the vessel.
    """
    check_plannable(case)
    return PlanProblem(
        vessel=case.vessel,
        area=case.area,
        environment=case.environment,
        settings=case.plan,
        primitives=tuple(item.primitive for item in information),
        design=design,
        start=case.start,
        goal=case.goal,
        seed=seed,
    )


def check_plannable(case: Scenario) -> None:
    """Raise InputError for a vessel that plans cannot be made for."""
    if case.vessel.model.roll is not None:
        raise InputError(
            f"vessel {case.vessel.name!r} has a roll mode, [model.roll], which plans do not follow; expected a vessel "
            "file without that table for planning, and the one with it as the truth of a simulation"
        )


def _load(scenario: Path, progress: Progress) -> Scenario:
    progress("reading the scenario", 0.0)
    return load_scenario(scenario)


def _parameters(case: Scenario) -> tuple[str, ...]:
    return estimated_parameters(case.vessel.model, case.design.fixed_parameters)


def _written(
    case: Scenario,
    out: Path | None,
    files: Mapping[str, str | bytes],
    summary: Mapping[str, object],
    progress: Progress,
    tables: tuple[TextTable, ...] = (),
) -> Outcome:
    written = write_files(out or Path("runs") / case.name, files)
    progress("done", 1.0)
    return Outcome(files=written, summary={"scenario": case.name, **summary}, tables=tables)


def _dictionary_files(case: Scenario, information: Sequence[PrimitiveInformation]) -> dict[str, str | bytes]:
    return {"dictionary.json": dictionary_json(information, _parameters(case), vessel=case.vessel)}


def _plan_files(case: Scenario, plan: Plan) -> dict[str, str | bytes]:
    return {
        "plan.json": plan_json(
            plan,
            scenario=case.name,
            vessel=case.vessel,
            environment=case.environment,
            clearance_m=case.plan.clearance_m,
        ),
        "track.csv": track_csv(plan),
        "commands.csv": commands_csv(plan),
    }


def built_route(case: Scenario, plan: Plan) -> Route:
    """The plan as waypoints, its legs measured against the track and the chart."""
    track = planned_track(
        plan,
        scenario=case.name,
        vessel=case.vessel,
        environment=case.environment,
        clearance_m=case.plan.clearance_m,
    )
    return build_route(track, safe_water=case.area.water)


def report_content(
    case: Scenario, information: tuple[PrimitiveInformation, ...], design: DurationDesign, plan: Plan, seed: int
) -> ReportContent:
    """What the report and the run cards are made from."""
    return ReportContent(
        scenario=case.name,
        vessel=case.vessel,
        environment=case.environment,
        start=case.start,
        goal=case.goal,
        criterion=case.design.criterion,
        fixed_parameters=case.design.fixed_parameters,
        clearance_m=case.plan.clearance_m,
        confidence=case.plan.confidence,
        information=information,
        design=design,
        plan=plan,
        command=f"expdesign run {case.path} --seed {seed}",
        version=__version__,
    )


def plan_summary(plan: Plan) -> dict[str, object]:
    """Key numbers of a plan, units in the names."""
    return {
        "verified": plan.verification.verified,
        "informative_s": plan.seconds("primitive"),
        "repositioning_s": plan.seconds("reposition"),
        "repositioning_bound_s": plan.reposition_bound_s,
        "distance_m": plan.trajectory.distance_m,
        "least_clearance_m": plan.verification.clearance_min_m,
        "leave_water_probability": plan.leave_water_probability,
        **_promise_summary(plan.promise),
        "design_efficiency_realised": plan.design_efficiency_realised,
    }


def _promise_summary(promise: Promise | None) -> dict[str, object]:
    """What drawn trials came to besides leaving allowed water; nothing where none were sailed."""
    if promise is None:
        return {}
    return {
        "drawn_trials": promise.trials,
        "aborted_share": promise.aborted,
        **({"note_on_broken_off": promise.note} if promise.note else {}),
        "extra_time_median_s": promise.extra_median_s,
        "extra_time_95_s": promise.extra_most_s,
    }
