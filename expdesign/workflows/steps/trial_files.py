"""Every file of a planned trial."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from expdesign import __version__
from expdesign.durations import DurationDesign
from expdesign.errors import InputError
from expdesign.export import (
    STANDARD,
    Content,
    Route,
    build_bridge_route,
    durations_json,
    planned_track,
    route_files,
)
from expdesign.export.cards import cards_html
from expdesign.export.report import ReportContent, report_html
from expdesign.growing import Growth
from expdesign.information import PrimitiveInformation
from expdesign.plan.values import Plan
from expdesign.progress import Progress, silent
from expdesign.scenario import Scenario
from expdesign.workflows.steps.grown import growth_files
from expdesign.workflows.steps.planned import plan_files, trial_remarks
from expdesign.workflows.steps.scored import score_files

SAILED_BY = ("route.*", "cards.html", "commands.csv")
"""Names of files by which a trial is sailed."""


def trial_files(
    case: Scenario, growth: Growth | None, content: ReportContent, route: Route | None, *, progress: Progress = silent
) -> dict[str, Content]:
    """Every file of a planned trial, by name; without a route, as of a draft, none that could be sailed."""
    content = replace(content, growth=growth)
    files: dict[str, Content] = {
        **score_files(case, content.information),
        **growth_files(case, growth),
        "durations.json": durations_json(content.design, compared=content.compared),
        **plan_files(case, content.plan),
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
    case: Scenario, information: tuple[PrimitiveInformation, ...], design: DurationDesign, plan: Plan, seed: int
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
        command=f"expdesign run {case.path}{' --draft' if plan.draft else ''} --seed {seed}",
        version=__version__,
        remarks=trial_remarks(case, plan),
    )
