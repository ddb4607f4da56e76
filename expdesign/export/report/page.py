"""The report as one self-contained page."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.export import words
from expdesign.export.pages import page_templates
from expdesign.export.report import criteria, tables
from expdesign.export.report.admission import conditions
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.export.report.figures.chart import chart
from expdesign.export.report.figures.design import durations_figure, information_figure
from expdesign.export.report.figures.gallery import primitive_figure
from expdesign.export.report.figures.style import report_style
from expdesign.export.report.figures.timeline import timeline_figure
from expdesign.export.report.figures.uncertainty import uncertainty_figure
from expdesign.export.report.glossary import GLOSSARY
from expdesign.export.report.growth import growth_rows, growth_sentences
from expdesign.export.report.procedure import day_sentence, procedure_sentences
from expdesign.export.report.progress import known_rows, known_sentences
from expdesign.export.report.trust import chain
from expdesign.export.report.uncertainty import Expected, expected, measures_velocity

SUBTRACTION = {
    "none": "nothing is subtracted from the regressors before estimation",
    "batch": "each run's own mean is subtracted from the regressors before estimation",
    "complete": "the mean over the whole data is subtracted from the regressors before estimation, which takes out "
    "constant disturbances",
}


MORE_THAN_OPTIMAL = (
    ", because the legs between the runs take time of their own and do what no manoeuvre in the dictionary does"
)
UNKNOWN_DEPTH = "No depths were checked: the chart tells only land. Check the whole track against the official chart."


@dataclass(frozen=True, kw_only=True)
class Fact:
    """A key number with its name and one remark."""

    name: str
    value: str
    remark: str


def report_html(content: ReportContent) -> str:
    """One HTML page without any outside reference: figures inside as SVG, readable on a phone and on paper."""
    after = expected(content)
    rows = tables.parameter_rows(content, after)
    page = page_templates("expdesign.export.report").get_template("report.html")
    return page.render(
        content=content,
        plan=content.plan,
        design=content.design,
        verified=content.plan.verification.verified,
        runs=primitive_runs(content.plan),
        summary=summary(content),
        facts=facts(content),
        certificate=criteria.certificate(content),
        criterion=criteria.criterion_sentence(content),
        comparison=criteria.comparison(content),
        limits=criteria.limit_rows(content),
        assumptions=assumptions(content),
        agenda=tables.agenda(content),
        primitives=tables.primitive_rows(content),
        parameters=rows,
        known_rows=known_rows(content.known),
        known_sentences=known_sentences(content.known, content.plan.area.frame),
        noise=measures_velocity(content),
        chain=chain(content, short_of_optimum=criteria.short_of_optimum(content)),
        conditions=conditions(content),
        checks=tables.checks(content),
        procedure=procedure_sentences(content.plan),
        growth=[] if content.growth is None else growth_rows(content.growth),
        grown=("", "") if content.growth is None else growth_sentences(content.growth),
        glossary=GLOSSARY,
        figures=_figures(content, after),
        origin=_origin(content),
        percent=words.percent,
        equation=tables.equation_sentence(content),
        less=any(row.less for row in rows),
        told=tables.excitation_sentence(content),
    )


def _figures(content: ReportContent, after: Expected) -> dict[str, object]:
    hull = content.vessel.hull_b
    with report_style():
        return {
            "chart": chart(content),
            "durations": durations_figure(content),
            "information": information_figure(content),
            "timeline": timeline_figure(content.plan),
            "uncertainty": uncertainty_figure(content, after) if measures_velocity(content) else "",
            "primitives": [
                primitive_figure(item.primitive, hull, number=number) for number, item in enumerate(content.information)
            ],
        }


def _origin(content: ReportContent) -> str:
    frame = content.plan.area.frame
    return f"{words.latitude(frame.lat_deg)}, {words.longitude(frame.lon_deg)}"


def summary(content: ReportContent) -> list[str]:
    """The trial in a few sentences, key numbers first."""
    plan, check = content.plan, content.plan.verification
    total, runs = plan.commands.duration_s, len(primitive_runs(plan))
    bound = (
        f" (at this transit speed no plan with these runs needs less than {words.duration(plan.reposition_bound_s)}, "
        "as far as the fastest changes of speed are known)"
    )
    verdict = (
        f"The plan is verified: with its commands simulated again, the hull comes no nearer to forbidden water than "
        f"{words.distance(check.clearance_min_m)} ({words.distance(content.clearance_m)} asked for)."
        if check.verified
        else f"The plan is NOT verified and must not be sailed: {'; '.join(check.problems)}."
    )
    depths = [] if plan.area.depths else [UNKNOWN_DEPTH]
    return [
        f"{words.duration(total)} and {words.distance(plan.trajectory.distance_m)} from start to goal: "
        f"{words.counted(runs, 'informative run')} taking {words.duration(plan.seconds('primitive'))}, and "
        f"{words.duration(plan.seconds('reposition'))} of repositioning{bound if plan.reposition_bound_s > 0 else ''}.",
        *([day] if (day := day_sentence(plan.promise, total)) else []),
        verdict,
        *depths,
        _design_sentence(content),
    ]


def _design_sentence(content: ReportContent) -> str:
    design, realised = content.design, content.plan.design_efficiency_realised
    text = (
        f"The time is shared so that {words.counted(len(content.parameters), 'model parameter')} can be estimated "
        f"best: whole runs reach {words.percent(design.efficiency_repeats)} of the certified optimum, equal time on "
        f"every manoeuvre would reach {words.percent(design.efficiency_uniform)}"
    )
    if realised is None:
        return f"{text}."
    optimal = words.duration(design.problem.total_s)
    more = MORE_THAN_OPTIMAL if realised > 1 else ""
    placed = content.plan.design_efficiency_placed
    runs = "" if placed is None else f"The runs as placed collect {words.percent(placed)}, the"
    return (
        f"{text}. {runs or 'The'} whole track, repositioning included, {'' if runs else 'collects '}"
        f"{words.percent(realised)} of the information of an optimal {optimal}{more}."
    )


def facts(content: ReportContent) -> list[Fact]:
    """The key numbers, for a glance."""
    plan, check, design = content.plan, content.plan.verification, content.design
    realised = plan.design_efficiency_realised
    return [
        Fact(
            name="Time",
            value=words.duration(plan.commands.duration_s),
            remark=f"{words.duration(plan.seconds('primitive'))} informative",
        ),
        Fact(
            name="Distance",
            value=words.distance(plan.trajectory.distance_m),
            remark=f"{words.counted(len(plan.legs), 'leg')}, {words.counted(len(primitive_runs(plan)), 'run')}",
        ),
        Fact(
            name="Least clearance",
            value=words.distance(check.clearance_min_m),
            remark=f"{words.distance(content.clearance_m)} asked for{'' if plan.area.depths else '; to land only'}",
        ),
        Fact(
            name="Optimal to within",
            value=criteria.short_of_optimum(content),
            remark=f"certified; whole runs reach {words.percent(design.efficiency_repeats)}",
        ),
        Fact(
            name="Information realised",
            value="not computed" if realised is None else words.percent(realised),
            remark=f"of an optimal {words.duration(design.problem.total_s)}, repositioning included",
        ),
    ]


def assumptions(content: ReportContent) -> list[tuple[str, str]]:
    """What the numbers rest on, as topic and sentence."""
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
            f"{words.counted(len(model.terms), 'term')} with their nominal parameters, in {model.form} form; "
            "what the real ship does differently is not in the track, only in the stated uncertainties",
        ),
        ("Fixed parameters", f"{fixed}: held at the vessel file's values" if fixed else "none, all are estimated"),
        ("Mean subtraction", SUBTRACTION[content.design.problem.mean_subtraction]),
        ("Hull", f"a rectangle of {vessel.length_m:g} m by {vessel.beam_m:g} m, which contains the waterline"),
        ("Start and goal", "the ship starts and ends at rest through the water"),
    ]
