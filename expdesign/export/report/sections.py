"""The sections of the report, below its chart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from markupsafe import Markup

from expdesign.export import words
from expdesign.export.document import Block, Figure, Gallery, Items, Section, Table, Terms, section, verdict
from expdesign.export.report import tables
from expdesign.export.report.checks import checks, conditions, procedure_sentences
from expdesign.export.report.content import ReportContent
from expdesign.export.report.design import (
    accuracy_table,
    certificate,
    chain,
    comparison,
    criterion_sentence,
    equal_time_sentence,
    equation_sentence,
    growth_rows,
    growth_sentences,
    known_rows,
    known_sentences,
    limit_rows,
    measures_velocity,
    parameter_rows,
    short_of_optimum,
    unknown_current_sentence,
)
from expdesign.export.report.figures import (
    durations_figure,
    information_figure,
    pareto_figure,
    primitive_figure,
    timeline_figure,
    uncertainty_figure,
)

AGENDA = ("Leg", "Run", "Start", "What", "Position", "Duration", "Heading", "Speed kn", "Speed m/s")
PARAMETERS = ("Parameter", "Term", "Nominal\nvalue", "Std. dev.\nbefore")
AFTER = ("Std. dev. after\nruns alone", "Std. dev. after\nwhole track", "Before /\nafter")
KNOWN = (
    "Parameter", "Most informative runs", "Value\nbefore the trial", "Value\nnow", "Std. dev.\nbefore",
    "Std. dev.\nfrom the data so far", "Std. dev.\nafter the rest", "Std. dev.\nwithout these runs",
)  # fmt: skip
INFORMATION = (
    "Manoeuvre", "Initial motion", "Excitation\ncondition", "Log det\nalone", "Sensitivity", "Share\nof time",
    "Optimal\ntime", "Duration\nof one run", "Runs",
)  # fmt: skip
GROWTH = (
    "Step", "Added", "Description", "Excitation\ncondition", "Sensitivity\nbefore", "Gain in\nlog det",
    "D-efficiency\nto the first dictionary",
)  # fmt: skip
NOT_DRAWN = "Not drawn in a draft, as no run of it is planned."
GLOSSARY = (
    ("Manoeuvre", "a primitive of the dictionary: a short motion with stated commands from a stated initial velocity"),
    ("Run", "one execution of a manoeuvre; numbered on the chart and in the time series"),
    (
        "Leg",
        "a part of the plan, either a run or a repositioning leg; numbered from 0 as in plan.json and the CSV files",
    ),
    ("Repositioning", "the transit from the end of one run to the start of the next, at its initial speed and heading"),
    (
        "Information matrix",
        "information of the data about all parameters; its inverse is the covariance of the estimates, up to the noise "
        "variance",
    ),
    ("Log det", "logarithm of the determinant of the information matrix; larger means a smaller confidence region"),
    (
        "D-efficiency",
        "ratio of two information determinants, to the power 1/p for p parameters; at 50 % the same accuracy takes "
        "twice the time",
    ),
    (
        "Sensitivity",
        "derivative of the log det with respect to the time of a manoeuvre; at the optimum equal for all used ones",
    ),
    (
        "Excitation condition",
        "no velocity inside an absolute value changes sign or comes close to zero; then noise does not bias "
        "instrumental-variable estimates",
    ),
    ("Clearance", "distance from the rectangular hull to the nearest forbidden water or land"),
    ("u, v, r", "surge speed ahead, sway speed to starboard, and yaw rate to starboard"),
)


def report_sections(
    content: ReportContent, summary: Sequence[str], assumptions: Sequence[tuple[str, str]]
) -> tuple[Section, ...]:
    """All of them, in order.

    Args:
        summary: the trial in a few sentences.
        assumptions: behind the numbers, each with its topic.
    """
    procedure = procedure_sentences(content.plan)
    return (
        *_known(content),
        section("In words", *summary),
        _agenda(content),
        *(
            [
                section(
                    "Procedure on board",
                    "The probability of leaving allowed water is estimated for a trial that follows this procedure:",
                    Items(tuple(procedure), ordered=True),
                )
            ]
            if procedure
            else []
        ),
        section("Time for each manoeuvre, and why", *_durations(content)),
        *_day(content),
        *_growth(content),
        _information(content),
        section("Expected accuracy of the parameters", *_accuracy(content)),
        _manoeuvres(content),
        section(
            "Time series",
            Figure(
                draw=partial(timeline_figure, content.plan),
                caption="Motion and commands of the plan. Informative runs are shaded and numbered as on the chart.",
            ),
        ),
        section(
            "From the optimum to the route file",
            "Each step from the optimal design to the exported route loses something. This table states how much, and "
            "how the number was found.",
            _page_table(
                ("Step", "Result", "Method"), chain(content, short_of_optimum=short_of_optimum(content)), texts=3
            ),
        ),
        _admissible(content),
        section("Verification", *_verification(content)),
        section("Assumptions", Terms(tuple(assumptions))),
        section("Glossary", Terms(GLOSSARY)),
    )


def _page_table(
    header: tuple[str, ...], rows: Sequence[tuple[str, ...]], *, texts: int = 1, marked: frozenset[int] = frozenset()
) -> Table:
    return Table(header=header, rows=rows, texts=texts, marked=marked, on="page")


def _known(content: ReportContent) -> Iterator[Section]:
    """What is known of a trial in progress, and what its rest adds."""
    known = content.known
    if known is None:
        return
    new = frozenset(place for place, name in enumerate(known.parameters) if name in known.new)
    yield section(
        "What is known, and what the rest of the trial adds",
        Items(tuple(known_sentences(known, content.plan.area.frame))),
        _page_table(KNOWN, known_rows(known), texts=2, marked=new),
        "The standard deviations from the data and after the rest are expected values for instrumental variables: "
        'first-order propagation of the sensor noise, with current and wind as stated above. "After the rest" combines '
        'the data so far with the whole new track. "Without these runs" leaves them out of the information of the data '
        "so far and the planned runs.",
    )


def _agenda(content: ReportContent) -> Section:
    rows = tables.agenda(content)
    orders = Markup(" The runs follow <code>commands.csv</code>; the waypoints of a route cannot describe a zig-zag.")
    return section(
        "Agenda",
        Markup(
            "Times count from the start of the trial. Position, heading and the first speed hold at the start of the "
            "leg.{}"
        ).format("" if content.plan.draft else orders),
        _page_table(
            AGENDA,
            [
                (
                    str(row.leg), str(row.run or ""), row.starts,
                    Markup("<b>{}</b>").format(row.what) if row.run else row.what,
                    f"{row.latitude} {row.longitude}", row.lasts, row.heading, row.knots, row.speed,
                )
                for row in rows
            ],
            texts=5,
            marked=frozenset(place for place, row in enumerate(rows) if row.run),
        ),
    )  # fmt: skip


def _durations(content: ReportContent) -> Iterator[Block]:
    """The optimal durations, their certificate, and the same runs by other criteria."""
    design, day = content.design, content.day
    runs = "the nearest whole runs" if day is None else "the runs of the day"
    yield Figure(
        draw=partial(durations_figure, content),
        caption=f"Left: the optimal allocation of {design.problem.total_s / 60:g} min of informative time (diamonds), "
        f"and {runs} (bars with their number). Right: the proof of optimality. No dot lies beyond the line, and all "
        "filled dots lie on it.",
    )
    yield certificate(content)
    whole = (
        f"Whole runs reach {words.percent(design.efficiency_repeats)} of the optimum."
        if day is None
        else "The runs are those of the shortest day, not these durations rounded, as the legs between them also give "
        "information."
    )
    yield f"{whole} {equal_time_sentence(design)} {criterion_sentence(content)}"
    header, rows = comparison(content.compared)
    if len(rows) > 1:
        yield _page_table(header, rows, texts=2)
    if missing := {item.criterion: item.missing for item in content.compared if item.missing}:
        names = ", ".join(missing)
        yield Items(tuple(missing.values()), folded=f"Criteria that are not computed for this scenario: {names}")
    if limits := limit_rows(content):
        yield _page_table(("Limit", "Required", "Optimal allocation", "Whole runs", "Price"), limits)


def _day(content: ReportContent) -> Iterator[Section]:
    """How the day was found."""
    day = content.day
    if day is None:
        return
    bound = " Grey: proved lower bound." if day.bound else ""
    header, told = accuracy_table(day)
    accuracy: tuple[Block, ...] = (
        "Expected standard deviation of each parameter from the whole track of every day planned, the shortest first, "
        f"and the half-width of the 95{words.NB}% interval of each outcome asked for:",
        _page_table(header, told),
    )
    yield section(
        "The shortest day" if day.most_s is None else "What the day tells",
        *tables.day_sentences(day),
        Figure(
            draw=partial(pareto_figure, day),
            caption="Length of the day against the information of its whole track. Numbers: the days planned, as in "
            f"the table; ring: the day of this plan. Line: estimated shortest days.{bound}",
        ),
        _page_table(
            ("Day", "Runs", "Takes", "Of it in\nruns", "Information\nof what is needed"),
            tables.day_rows(content, day),
            texts=2,
        ),
        *(accuracy if told else ()),
    )


def _growth(content: ReportContent) -> Iterator[Section]:
    """Manoeuvres that a search added."""
    growth = content.growth
    if growth is None:
        return
    before, after = growth_sentences(growth)
    rows = growth_rows(growth, content.shown)
    found = _page_table(GROWTH, rows, texts=4) if rows else "The search found no manoeuvre that improves the design."
    yield section("Manoeuvres added by the search", before, found, after)


def _information(content: ReportContent) -> Section:
    return section(
        "Information of each manoeuvre",
        Figure(
            draw=partial(information_figure, content),
            caption="Information per minute about each parameter alone, in per cent of the most informative manoeuvre. "
            "Two parameters can still be hard to separate; the log determinant accounts for that.",
        ),
        _page_table(INFORMATION, tables.primitive_rows(content), texts=3),
        '"Singular" means that this manoeuvre alone cannot '
        "determine all parameters, however long it is. Only differences of log determinants have a meaning: "
        f"{len(content.parameters)} more, one for each parameter, correspond to 2.7 times the time. "
        f"{tables.excitation_sentence(content)}",
    )


def _accuracy(content: ReportContent) -> Iterator[Block]:
    """How accurately the trial is expected to tell each parameter."""
    after, noise = content.accuracy, measures_velocity(content)
    if not noise:
        yield "The vessel file states no noise of the velocity sensors. The accuracy cannot be predicted without it."
    elif unknown := unknown_current_sentence(content):
        yield Markup("<strong>{}</strong>").format(unknown)
    if noise:
        yield Figure(
            draw=partial(uncertainty_figure, content, after),
            caption="Expected standard deviation of instrumental-variable estimates: first-order propagation of the "
            "sensor noise and of the varying current stated in the vessel and scenario files. Constant disturbances "
            "and errors of the model structure are not included. Where the excitation condition does not hold, noise "
            "also biases the terms with an absolute value; that bias is not included either.",
        )
    shown = PARAMETERS + AFTER if noise else PARAMETERS
    yield _page_table(
        shown,
        [
            (row[0], Markup("<code>{}</code>").format(row[1]), *row[2 : len(shown)])
            for row in parameter_rows(content, after)
        ],
        texts=2,
    )
    ratio = (
        " The last column divides the standard deviation before the trial by the one after the whole track, from the "
        "data of this trial alone."
    )
    less = bool(((after.before > 0) & (after.before < after.track)).any())
    kept = (
        " A value below 1 means that the trial alone is less accurate than the prior knowledge. The prior knowledge is "
        "not lost."
    )
    yield f"{equation_sentence(content)}{ratio * noise}{kept * (noise and less)}"


def _manoeuvres(content: ReportContent) -> Section:
    figures = []
    for number, (item, repeats) in enumerate(zip(content.information, content.design.repeats, strict=True)):
        one = item.primitive
        draw = partial(primitive_figure, one, content.vessel.hull_b, number=number)
        settings = tables.settings_sentence(item)
        figures.append(
            Figure(
                draw=draw if repeats or not content.plan.draft else partial(str, NOT_DRAWN),
                caption=Markup("<b>{}</b> \N{MIDDLE DOT} {}, {} \N{MIDDLE DOT} {}{}").format(
                    content.shown(one.name),
                    words.family(one.family),
                    words.duration(one.duration_s),
                    words.counted(repeats, "run") if repeats else "no runs",
                    Markup("<br><small>{}</small>").format(settings) if settings else "",
                ),
            )
        )
    return section(
        "The manoeuvres",
        "Simulated in calm water. Each path starts at the green dot and heads up the page; the hull is to scale. "
        "Dashed: the desired velocities, where the manoeuvre has any. The design uses the simulated motion, not the "
        "desired one.",
        Gallery(tuple(figures)),
    )


def _admissible(content: ReportContent) -> Section:
    met = {True: "\N{CHECK MARK} met", False: "\N{BALLOT X} not met", None: "? check on the day"}
    return section(
        "Would the results count as an official trial?",
        "Limits of IMO MSC/Circ.1053 on manoeuvring trials, as far as they can be judged in advance. They do "
        "not decide whether the plan is safe to sail. They decide whether its results represent deep water and calm "
        "weather.",
        _page_table(
            ("Condition", "Known in advance", "Required", "Met"),
            [(row.what, row.found, row.required, verdict(met[row.met], row.met)) for row in conditions(content)],
            texts=4,
        ),
    )


def _verification(content: ReportContent) -> Iterator[Block]:
    """The independent check and the simulated trials."""
    plan = content.plan
    passed = {True: verdict("\N{CHECK MARK} passed", True), False: verdict("\N{BALLOT X} failed", False), None: ""}
    all_passed = verdict("\N{CHECK MARK} verified" if plan.verified else "\N{BALLOT X} not verified", plan.verified)
    problems = "; ".join(plan.verification.problems) or ("no problems found" if plan.verified else plan.verdict)
    rows = [(row.what, row.found, row.required, passed[row.met]) for row in checks(content)]
    yield (
        "An independent check simulates the commands again from the start with a ten times smaller step, and sweeps "
        "the hull against the polygons of the chart. It shares the equations of motion and the chart with the planner, "
        "and no other code."
    )
    header = ("Check", "Result", "Required", "Passed")
    yield _page_table(header, [*rows, (Markup("<b>All checks</b>"), problems, "", all_passed)], texts=4)
    if plan.risk is not None:
        yield (
            "The rows on allowed water, aborted trials and added time come from a Monte Carlo simulation of "
            f"{plan.risk.trials} whole trials. Ship, current and wind of each trial are drawn from their stated "
            "uncertainties. Each trial follows the procedure on board, and its hull is checked against the chart at "
            "every step. A trial ends when it leaves allowed water or is aborted."
        )
    if plan.leave_water_probability is None:
        yield (
            "The probability of leaving allowed water with an uncertain ship, current and wind was not computed for "
            "this plan."
        )
