"""The cards as one page that prints on A4, an agenda with the chart first."""

from __future__ import annotations

from expdesign.export.cards.card import build_card
from expdesign.export.pages import page_templates
from expdesign.export.planned import require_verified
from expdesign.export.report import tables, words
from expdesign.export.report.content import ReportContent, primitive_runs
from expdesign.export.report.figures.chart import chart
from expdesign.export.report.figures.style import report_style


def cards_html(content: ReportContent) -> str:
    """One HTML page without outside references, a sheet of paper for each run.

    Raises:
        NoPlan: the plan is not verified: nobody shall sail it.
    """
    require_verified(content.plan)
    runs = primitive_runs(content.plan)
    with report_style():
        cards = [build_card(content, run) for run in runs]
        overview = chart(content)
    page = page_templates("cards").get_template("cards.html")
    return page.render(
        content=content,
        cards=cards,
        chart=overview,
        agenda=tables.agenda(content),
        total=words.duration(content.plan.commands.duration_s),
        current=words.current(content.environment.current_to, content.environment.current_std_mps),
        wind=words.wind(content.environment.wind_to, content.environment.wind_std_mps),
        clearance=words.distance(content.clearance_m),
    )
