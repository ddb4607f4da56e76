"""The report as one self-contained page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from expdesign.export import words
from expdesign.export.document import Document, Figure, Mark
from expdesign.export.pages import page_template, shown
from expdesign.export.pages.figures import drawn, marked
from expdesign.export.report import tables
from expdesign.export.report.chart import chart, chart_legend
from expdesign.export.report.checks import aborted_words, day_sentence, left_words
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.export.report.design import equal_time_sentence, short_of_optimum
from expdesign.export.report.sections import report_sections
from expdesign.plan.legs import through_water
from expdesign.plan.values import LatticeProof, Plan
from expdesign.sea_area import UNKNOWN_DEPTH

SUBTRACTION = {
    "none": "no mean is subtracted from the instruments",
    "batch": "the mean of each run is subtracted from the instruments",
    "complete": "the mean over all data is subtracted from the instruments; this removes the effect of constant "
    "disturbances",
}
MORE_THAN_OPTIMAL = " It is more than 100 % because the legs between the runs inform, too."


@dataclass(frozen=True, kw_only=True)
class Fact:
    """A key number with its name and one remark."""

    name: str
    value: str
    remark: str


def _document(content: ReportContent) -> Document:
    """The trial for people, without the chart and what stands beside it."""
    plan, area = content.plan, content.plan.area
    return Document(
        kind="DRAFT, not to be sailed: manoeuvring trial" if plan.draft else "Manoeuvring trial",
        title=f"{content.scenario}{' (DRAFT)' if plan.draft else ''}",
        name=f"{'DRAFT: ' if plan.draft else ''}Manoeuvring trial {content.scenario}",
        about=f"{words.ship(content.vessel)} in {area.name}",
        sections=report_sections(content, summary(content), assumptions(content)),
        command=content.command,
    )


def report_html(content: ReportContent) -> str:
    """One HTML page without any outside reference: figures inside as SVG, readable on a phone and on paper."""
    plan = content.plan
    first = Figure(
        draw=partial(chart, content),
        caption="Runs are numbered in the order in which they are sailed. Hulls show the heading, not their size. The "
        "shaded area around a run is where the hull stays with the stated probability, for random ship, current and "
        f"wind. WGS84; metres in the files count from {_origin(content)}. Not for navigation.",
        legend=chart_legend(content),
    )
    return page_template("report.html").render(
        shown(_document(content), partial(_drawn, draft=plan.draft), first),
        chart=first,
        marks=_marks(plan),
        booking=booking(plan),
        risks=risks(content),
        key_facts=facts(content),
    )


def _drawn(figures: Sequence[Figure], *, draft: bool) -> dict[int, object]:
    """Every figure, by its identity; they share nothing."""
    results: list[object] = drawn([figure.draw for figure in figures])
    if draft:
        results = [marked(str(result), "DRAFT") for result in results]
    return dict(zip(map(id, figures), results, strict=True))


def _marks(plan: Plan) -> tuple[Mark, ...]:
    """Whether it may be sailed, and whether depths were checked."""
    if plan.verified:
        first = Mark(text="\N{CHECK MARK} verified", good=True)
    elif plan.verification.passed:
        first = Mark(text=f"{plan.verdict[0].upper()}{plan.verdict[1:]}", good=False)
    else:
        first = Mark(text="\N{BALLOT X} not verified: do not sail", good=False)
    return (first,) if plan.area.depths else (first, Mark(text="depths not checked"))


def _origin(content: ReportContent) -> str:
    frame = content.plan.area.frame
    return f"{words.latitude(frame.lat_deg)}, {words.longitude(frame.lon_deg)}"


def summary(content: ReportContent) -> list[str]:
    """The trial in a few sentences."""
    plan, check = content.plan, content.plan.verification
    total, runs = plan.commands.duration_s, len(primitive_runs(plan))
    bound = (
        f" At this transit speed these runs need at least {words.duration(plan.reposition_bound_s)} of repositioning, "
        "in any order and place."
    )
    verdict = (
        f"The plan is {plan.verdict}. An independent simulation of its commands keeps the hull at least "
        f"{words.distance(check.clearance_min_m)} from forbidden water ({words.distance(content.clearance_m)} "
        "required)."
        if check.passed
        else f"The plan is NOT verified and must not be sailed: {'; '.join(check.problems)}."
    )
    depths = [] if plan.area.depths else [UNKNOWN_DEPTH]
    return [
        f"The trial takes {words.duration(total)} and {words.distance(plan.trajectory.distance_m)} from start to goal: "
        f"{words.duration(plan.seconds('primitive'))} in {words.counted(runs, 'informative run')}, and "
        f"{words.duration(plan.seconds('reposition'))} of repositioning.{bound if plan.reposition_bound_s > 0 else ''}",
        *lattice_sentences(plan.lattice),
        *([day] if (day := day_sentence(plan)) else []),
        verdict,
        *depths,
        *([f"Worth knowing: {'; '.join(content.remarks)}."] if content.remarks else []),
        _design_sentence(content),
    ]


def lattice_sentences(proof: LatticeProof | None) -> list[str]:
    """How good the placement is among all on its lattice; nothing for other planners."""
    if proof is None:
        return []
    refused = (
        f" {words.counted(proof.refused, 'place')} could not be sailed; the remaining runs were placed again."
        if proof.refused
        else ""
    )
    return [
        f"The runs are placed on a lattice of {words.distance(proof.spacing_m)} and {proof.headings} headings. By the "
        f"rule of the lattice their repositioning takes {words.duration(proof.cost_s)}; no placement on this lattice "
        f"takes less than {words.duration(proof.lower_bound_s)} (gap {words.percent(proof.gap)}). Places between the "
        f"lattice's may take less.{refused}"
    ]


def _design_sentence(content: ReportContent) -> str:
    design, realised = content.design, content.plan.design_efficiency_realised
    if content.day is not None:
        return f"{tables.minutes_sentence(content.day)} {tables.found_sentence(content.day)}"
    text = (
        f"The durations are the best for estimating {words.counted(len(content.parameters), 'model parameter')}. "
        f"Rounded to whole runs they reach {words.percent(design.efficiency_repeats)} of the optimum. "
        f"{equal_time_sentence(design)}"
    )
    if realised is None:
        return text
    placed = content.plan.design_efficiency_placed
    runs = "" if placed is None else f" The runs as placed collect {words.percent(placed)} of it."
    return (
        f"{text} The whole track, repositioning included, collects {words.percent(realised)} of the information that "
        f"{words.duration(design.problem.total_s)} of the optimal design would."
        f"{MORE_THAN_OPTIMAL if realised > 1 else ''}{runs}"
    )


def facts(content: ReportContent) -> list[Fact]:
    """The key numbers."""
    plan, check, design = content.plan, content.plan.verification, content.design
    realised = plan.design_efficiency_realised
    return [
        Fact(
            name="Distance",
            value=words.distance(plan.trajectory.distance_m),
            remark=f"{words.counted(len(plan.legs), 'leg')}, {words.counted(len(primitive_runs(plan)), 'run')}",
        ),
        Fact(
            name="Least clearance",
            value=words.distance(check.clearance_min_m),
            remark=f"{words.distance(content.clearance_m)} required{'' if plan.area.depths else ', on this chart'}",
        ),
        _proof(content),
        Fact(
            name="Information realised",
            value="not computed" if realised is None else words.percent(realised),
            remark=f"of {words.duration(design.problem.total_s)} of the optimal design, repositioning included",
        ),
    ]


def booking(plan: Plan) -> Fact:
    """The time to book: enough in 95 % of the simulated trials, where there are any."""
    day, runs = plan.day, words.duration(plan.seconds("primitive"))
    planned = f"{words.duration(day.planned_s)} as planned, of it {runs} in runs"
    if math.isnan(day.median_s):
        return Fact(name="As planned", value=words.duration(day.planned_s), remark=f"{runs} in runs; add a reserve")
    return Fact(
        name="Book",
        value=words.duration(max(day.most_s, day.planned_s)),
        remark=f"enough in 95{words.NB}% of the simulated trials, {words.duration(day.median_s)} in the middle; "
        f"{planned}",
    )


def risks(content: ReportContent) -> list[Fact]:
    """What may go wrong, and how likely that is: hull and water, the procedure, and what no simulation knows."""
    plan, risk, check = content.plan, content.plan.risk, content.plan.verification
    clearance = words.distance(check.clearance_min_m)
    nearest = f"at {words.clock(check.clearance_time_s)}; {words.distance(content.clearance_m)} required"
    if risk is None:
        chances = [
            Fact(
                name="Leaving allowed water",
                value="unknown",
                remark="no trials with other ships and weather were simulated",
            )
        ]
    else:
        chances = [
            _chance("Leaving allowed water", left_words(risk), "; "),
            _chance("Trial aborted", aborted_words(risk), ": "),
        ]
    water = (
        Fact(name="Nearest forbidden water", value=clearance, remark=nearest)
        if plan.area.depths
        else Fact(
            name="Depth",
            value="not checked",
            remark=f"the chart names no depth areas; forbidden water is {clearance} away {nearest}",
        )
    )
    return [*chances, water]


def _chance(name: str, text: str, end: str) -> Fact:
    """A share of the simulated trials, and after the sign that ends it what else is known."""
    share, _, rest = text.partition(end)
    return Fact(name=name, value=f"{share};" if rest else share, remark=rest)


def _proof(content: ReportContent) -> Fact:
    """How far the trial is from the best: of the day where it was to be short, else of the durations."""
    day, reached = content.day, words.percent(content.design.efficiency_repeats)
    if day is None or day.most_s is not None or day.bound is None or day.bound.day_s <= 0:
        runs = f"; whole runs reach {reached}" if day is None else ""
        value = short_of_optimum(content)
        return Fact(name="Short of the optimum by", value=value, remark=f"at most, proven{runs}")
    share = words.percent(day.bound.day_s / day.plan.commands.duration_s)
    return Fact(
        name="No day is shorter than", value=words.duration(day.bound.day_s), remark=f"proven; {share} of this day"
    )


def _ends(content: ReportContent) -> str:
    """The motion at start and goal."""
    track = content.plan.trajectory
    begins = tables.motion(through_water(content.environment, np.r_[track.pose[0], track.velocity[0]]))
    if begins == "at rest":
        return "the ship is at rest relative to the water"
    return f"the ship starts under way, through the water {begins}; at the goal it is at rest relative to the water"


def assumptions(content: ReportContent) -> list[tuple[str, str]]:
    """The assumptions behind the numbers: (topic, sentence)."""
    area, environment, vessel, model = content.plan.area, content.environment, content.vessel, content.vessel.model
    fixed = ", ".join(content.fixed_parameters)
    return [
        ("Chart", area.source or "source not stated"),
        ("Depth", area.depth_rule),
        *(("Chart", note) for note in area.notes),
        ("Current", words.current(environment.current_to, environment.current_std_mps)),
        ("Wind", words.wind(environment.wind_to, environment.wind_std_mps)),
        (
            "Vessel model",
            f"{words.counted(len(model.terms), 'term')} with nominal parameters, in {model.form} form. The track is "
            "that of the nominal model; the stated uncertainties cover the difference from the real ship",
        ),
        (
            "Fixed parameters",
            f"{fixed}: fixed at the values of the vessel file" if fixed else "none, all are estimated",
        ),
        ("Mean subtraction", SUBTRACTION[content.design.problem.mean_subtraction]),
        ("Hull", f"a rectangle of {vessel.length_m:g} m by {vessel.beam_m:g} m that contains the waterline"),
        ("Start and goal", _ends(content)),
    ]
