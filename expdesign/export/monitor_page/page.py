"""The page of a watch over a ship in operation."""

from __future__ import annotations

from expdesign.export.monitor_page.budget import budget_figure, budget_header, budget_tables
from expdesign.export.monitor_page.content import HEADER, MonitorContent, monitor_tables, sentences
from expdesign.export.monitor_page.figures import estimate_figure, statistic_figure
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style


def monitor_html(content: MonitorContent) -> str:
    """One HTML page without any outside reference."""
    with report_style():
        figures = {"statistic": statistic_figure(content), "estimate": estimate_figure(content)}
        figures["budget"] = budget_figure(content)
    return page_template("expdesign.export.monitor_page", "monitor.html").render(
        content=content,
        sentences=sentences(content),
        header=tuple(name.capitalize() for name in HEADER),
        rows=monitor_tables(content),
        budget_header=tuple(name.capitalize() for name in budget_header()),
        budget_rows=budget_tables(content),
        figures=figures,
    )
