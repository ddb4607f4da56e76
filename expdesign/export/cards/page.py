"""The cards as one page that prints on A4: a chart, an agenda, and the sheets in time order."""

from __future__ import annotations

from functools import partial

from expdesign.export import words
from expdesign.export.cards.card import BLANKS, build_card, card_groups
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import drawn
from expdesign.export.report import tables
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.export.report.figures.chart import chart, chart_legend
from expdesign.export.report.procedure import day_sentence, day_words, procedure_sentences
from expdesign.export.routes import require_verified


def cards_html(content: ReportContent) -> str:
    """One HTML page without outside references; consecutive runs of one manoeuvre share a sheet.

    Raises:
        NoPlan: the plan is not verified and must not be sailed.
    """
    require_verified(content.plan)
    runs = primitive_runs(content.plan)
    cards = drawn([partial(build_card, content, group) for group in card_groups(content, runs)])
    overview = drawn([partial(chart, content)])[0]
    page = page_template("expdesign.export.cards", "cards.html")
    return page.render(
        content=content,
        cards=cards,
        runs=len(runs),
        blanks=BLANKS,
        depths=bool(content.plan.area.depths),
        chart=overview,
        legend=chart_legend(content),
        agenda=tables.agenda(content),
        procedure=procedure_sentences(content.plan),
        day=day_sentence(content.plan),
        total=day_words(content.plan.day),
        current=words.current(content.environment.current_to, content.environment.current_std_mps),
        wind=words.wind(content.environment.wind_to, content.environment.wind_std_mps),
        clearance=words.distance(content.clearance_m),
    )
