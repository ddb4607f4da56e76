"""The verified trial of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import DurationDesign
from expdesign.errors import InputError, NoPlan
from expdesign.export.cards import cards_html
from expdesign.export.document import Document
from expdesign.export.files import PlannedAccuracy, commands_csv, durations_json, plan_json, track_csv
from expdesign.export.folder import Content
from expdesign.export.formats import STANDARD, route_files
from expdesign.export.report import ReportContent, report_html
from expdesign.export.routes import Route, build_bridge_route, planned_track
from expdesign.growing import Growth
from expdesign.information import PrimitiveInformation
from expdesign.memory import recalled
from expdesign.plan.assembly import check_current, check_start_speed
from expdesign.plan.control import capability, needs_helm
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import LatticeProof, Plan, PlanProblem, RiskEstimate
from expdesign.progress import Progress, silent
from expdesign.scenario import Scenario
from expdesign.sea_area import UNKNOWN_DEPTH
from expdesign.signals import AUXILIARY
from expdesign.vessel import NOT_SUPPORTED
from expdesign.workflows.steps.scored import actuation_remarks, growth_files, score_files, speed_remarks

MOST_RUNS = 1000  # runs in one plan


def planned(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Plan:
    """The verified trial of a scenario."""
    return recalled(plan_trial, plan_problem(case, information, design, seed=seed), progress=progress)


def plan_problem(
    case: Scenario, information: Sequence[PrimitiveInformation], design: DurationDesign, *, seed: int = 0
) -> PlanProblem:
    """The planning problem of a scenario, with a dictionary and its durations.

    Raises:
        InputError: plans cannot be made for the vessel, or the design has more runs than a plan can have.
        NoPlan: a run heels the ship more than her file allows.
    """
    check_plannable(case)
    runs = sum(design.repeats)
    if runs > MOST_RUNS:
        raise InputError(
            f"the design has {runs} runs, expected at most {MOST_RUNS} in one plan: shorten design.total_s or "
            "lengthen the manoeuvres"
        )
    primitives = tuple(item.primitive for item in information)
    _check_heel(case, [item for item, times in zip(primitives, design.repeats, strict=True) if times])
    return PlanProblem(
        vessel=case.vessel,
        area=case.area,
        environment=case.environment,
        settings=case.plan,
        primitives=primitives,
        design=design,
        start=case.start,
        goal=case.goal,
        seed=seed,
        under_way=case.under_way,
    )


def check_plannable(case: Scenario) -> None:
    """Refuse at once what no plan can be made for.

    Raises:
        InputError: the vessel is none that plans are made for, or is to begin faster than it can ever be.
        NoPlan: the vessel cannot stem the current, or not stop in it at the goal.
    """
    if case.vessel.model.roll is not None:
        raise InputError(
            f"vessel {case.vessel.name!r} has a roll mode, [model.roll], which plans do not follow; expected a vessel "
            "file without that table for planning, and the one with it as the truth of a simulation"
        )
    if case.vessel.model.inertia is not None:
        raise InputError(NOT_SUPPORTED.format(what="a plan"))
    check_current(case.vessel, case.plan, case.environment, case.goal)
    if case.under_way is None:
        return
    try:
        ship = capability(case.vessel, case.plan, current_mps=float(np.hypot(*case.environment.current_to)))
    except NoPlan:  # the planner says why, and what would help
        return
    check_start_speed(case.vessel, case.environment, ship, np.r_[case.start, case.under_way.velocity])


def plan_files(case: Scenario, plan: Plan, accuracy: PlannedAccuracy) -> dict[str, str | bytes]:
    """The plan, its track and its commands; of a draft, which cannot be sailed, the plan alone."""
    files: dict[str, str | bytes] = {
        "plan.json": plan_json(
            plan,
            scenario=case.name,
            vessel=case.vessel,
            environment=case.environment,
            clearance_m=case.plan.clearance_m,
            accuracy=accuracy,
        )
    }
    return files if plan.draft else {**files, "track.csv": track_csv(plan), "commands.csv": commands_csv(plan)}


def trial_remarks(case: Scenario, plan: Plan) -> tuple[str, ...]:
    """What the files state and the trial does not use, or takes as certain; one line each."""
    values, runs = plan.commands.values, [leg for leg in plan.legs if leg.kind == "primitive"]
    sailed = [replace(plan.commands, values=values[leg.first : leg.last]) for leg in runs]
    return (
        *case.remarks,
        *leg_remarks(case),
        *(actuation_remarks(case.vessel, sailed, "run of this plan") if sailed else ()),
        *speed_remarks(case.vessel, [plan.trajectory], "run or leg of this plan"),
        *_unstable_remarks(plan),
    )


def _unstable_remarks(plan: Plan) -> tuple[str, ...]:
    """What a ship whose commands alone do not lead along the track asks for."""
    stretch_s = plan.verification.stretch_s
    if stretch_s is None:
        return ()
    return (
        "the ship is unstable on her course, so that small errors grow: commands of legs alone do not lead along the "
        f"track, she has to be steered; they are verified over stretches of {stretch_s:.0f} s, each begun on the track",
    )


def leg_remarks(case: Scenario) -> tuple[str, ...]:
    """How the ship is steered on legs, where her thrusters suggest another way."""
    if needs_helm(case.vessel):
        return ()
    note = capability(case.vessel, case.plan, current_mps=float(np.hypot(*case.environment.current_to))).note
    return (note,) if note else ()


def plan_document(case: Scenario, plan: Plan) -> Document:
    """What a document says of a plan: key numbers, what its files state in vain, and doubts."""
    facts = {
        **({"draft": True} if plan.draft else {}),
        "verified": plan.verified,
        **({} if plan.verified else {"verdict": plan.verdict}),
        "informative_s": plan.seconds("primitive"),
        "repositioning_s": plan.seconds("reposition"),
        **({} if plan.draft else {"repositioning_bound_s": plan.reposition_bound_s}),
        **_lattice_summary(plan.lattice),
        "distance_m": plan.trajectory.distance_m,
        "least_clearance_m": plan.verification.clearance_min_m,
        **_heel_summary(plan),
        "leave_water_probability": plan.leave_water_probability,
        **_risk_summary(plan.risk),
        "information_of_whole_track_over_optimum": plan.design_efficiency_realised,
    }
    broken_off = (f"Drawn trials: {plan.risk.note}.",) if plan.risk is not None and plan.risk.note else ()
    depths = () if plan.area.depths else (UNKNOWN_DEPTH,)
    return Document(facts=facts, findings=trial_remarks(case, plan), notes=(*broken_off, *depths))


def _heel_summary(plan: Plan) -> dict[str, object]:
    """The largest roll angle of a ship with [roll]."""
    heel = plan.verification.heel_max_rad
    return {} if heel is None else {"heel_max_deg": float(np.degrees(heel))}


def _check_heel(case: Scenario, used: Sequence[Primitive]) -> None:
    """Raise NoPlan for runs that heel the ship more than her file allows."""
    most = np.inf if case.vessel.pendulum is None else case.vessel.pendulum.heel_max_rad
    for item in used:
        auxiliary = item.trajectory.auxiliary
        heel = 0.0 if auxiliary is None else float(np.abs(auxiliary[:, AUXILIARY.index("roll_rad")]).max())
        if heel > most:
            raise NoPlan(
                f"{item.name} heels the ship by {np.degrees(heel):.1f} deg, more than heel_max_deg of [roll] in the "
                f"vessel file, {np.degrees(most):.3g} deg",
                which=item.name,
                remedy="leave it out of the dictionary, or lower its angles or its speed",
            )


def _lattice_summary(proof: LatticeProof | None) -> dict[str, object]:
    """The lattice plan and its bound; nothing for other planners."""
    if proof is None:
        return {}
    return {
        "lattice_spacing_m": proof.spacing_m,
        "lattice_cost_s": proof.cost_s,
        "lattice_bound_s": proof.lower_bound_s,
        "lattice_gap": proof.gap,
        "lattice_places_refused": proof.refused,
    }


def _risk_summary(risk: RiskEstimate | None) -> dict[str, object]:
    """Results of drawn trials beside the share that leaves allowed water; empty without such trials."""
    if risk is None:
        return {}
    return {
        "leave_water_probability_below": risk.left_most,  # with 95 % confidence: none of 500 is not never
        "drawn_trials": risk.trials,
        "aborted_share": risk.aborted,
        "extra_time_median_s": risk.extra_median_s,
        "extra_time_95_s": risk.extra_most_s,
    }


SAILED_BY = ("route.*", "cards.html", "commands.csv")  # names of files by which a trial is sailed


def trial_files(
    case: Scenario, growth: Growth | None, content: ReportContent, route: Route | None, *, progress: Progress = silent
) -> dict[str, Content]:
    """Every file of a planned trial, by name; without a route, as of a draft, none that could be sailed."""
    content = replace(content, growth=growth)
    files: dict[str, Content] = {
        **score_files(case, content.information),
        **growth_files(case, growth),
        "durations.json": durations_json(content.design, compared=content.compared),
        **plan_files(case, content.plan, content.accuracy),
        **({} if route is None else route_files(route, STANDARD)),
    }
    return {**files, **trial_pages(content, progress)}


def check_no_trial(folder: Path) -> None:
    """Raise InputError where a folder holds files by which a trial is sailed: a draft would seem to belong to them."""
    there = [path for name in SAILED_BY for path in sorted(folder.glob(name))]
    if there:
        raise InputError(
            f"--draft: {there[0]} is part of a trial that may be sailed, expected another folder for a draft (--out)"
        )


def trial_pages(content: ReportContent, progress: Progress) -> dict[str, Content]:
    """The pages of a planned trial, drawn when they are written."""

    def report() -> str:
        progress("drawing the report", 0.02)
        return report_html(content)

    def cards() -> str:
        progress("drawing the run cards", 0.7)
        return cards_html(content)

    return {"report.html": report} if content.plan.draft else {"report.html": report, "cards.html": cards}


def built_route(case: Scenario, plan: Plan) -> Route:
    """The plan as few waypoints, its legs measured against the track and the chart."""
    track = planned_track(
        plan,
        scenario=case.name,
        vessel=case.vessel,
        environment=case.environment,
        clearance_m=case.plan.clearance_m,
    )
    return build_bridge_route(track, safe_water=case.area.water)


def report_content(
    case: Scenario, information: tuple[PrimitiveInformation, ...], design: DurationDesign, plan: Plan, command: str
) -> ReportContent:
    """Content of the report and the run cards."""
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
        command=command,
        asked=case.design.accuracy,
        remarks=trial_remarks(case, plan),
    )
