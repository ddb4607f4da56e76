"""A planned trial as one value for notebooks, shown as its report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

from expdesign import requests
from expdesign.durations import DurationDesign, efficiencies
from expdesign.export.cards import cards_html
from expdesign.export.folder import write_files
from expdesign.export.formats import STANDARD, route_files
from expdesign.export.report import ReportContent, report_html
from expdesign.export.routes import Route
from expdesign.information import PrimitiveInformation
from expdesign.plan.values import Plan
from expdesign.progress import Progress, silent, within
from expdesign.requests import command_text
from expdesign.scenario import Scenario, load_scenario
from expdesign.workflows.steps.day import planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import built_route, report_content
from expdesign.workflows.steps.scored import ready

FRAME_HEIGHT_PX = 700


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """A planned and verified trial."""

    content: ReportContent  # the values of the report
    route: Route  # waypoints

    @property
    def information(self) -> tuple[PrimitiveInformation, ...]:
        """Information of every primitive."""
        return self.content.information

    @property
    def design(self) -> DurationDesign:
        """How long to run each, with its certificate."""
        return self.content.design

    @property
    def plan(self) -> Plan:
        """Commands, motion, legs and their verification."""
        return self.content.plan

    def files(self) -> Mapping[str, str | bytes]:
        """File name -> content of the report, the run cards and the routes."""
        return {
            "report.html": report_html(self.content),
            "cards.html": cards_html(self.content),
            **route_files(self.route, STANDARD),
        }

    def write(self, folder: Path | str) -> tuple[Path, ...]:
        """Write these files, all or none.

        Raises:
            FileError: they cannot be written.
        """
        return write_files(Path(folder), self.files())

    def _repr_html_(self) -> str:
        """The report in a frame, for notebooks."""
        page = escape(report_html(self.content), quote=True)
        style = f"width: 100%; height: {FRAME_HEIGHT_PX}px; border: 1px solid #ccc"
        return f'<iframe srcdoc="{page}" style="{style}" title="report"></iframe>'


def plan_for(scenario: Scenario | Path | str, *, seed: int = 0, progress: Progress = silent) -> Trial:
    """Score, design durations, plan and verify as `expdesign run` does, without writing files.

    Args:
        scenario: a scenario, or its file.

    Raises:
        InputError: something in the files is wrong.
        NoAnswer: there is no informative design or no feasible plan.
    """
    case = scenario if isinstance(scenario, Scenario) else load_scenario(Path(scenario))
    information, growth = ready(case, seed=seed, progress=within(progress, 0.0, 0.1))
    design = designed(case, information, seed=seed, progress=within(progress, 0.1, 0.15))
    day = planned_day(case, information, design, seed=seed, progress=within(progress, 0.15, 1.0))
    route = built_route(case, day.plan)
    content = report_content(
        case, day.information, day.design, day.plan, command_text(requests.Run(scenario=case.path, seed=seed))
    )
    content = replace(content, compared=efficiencies(design), route=route, growth=growth, day=day.shortest)
    return Trial(content=content, route=route)
