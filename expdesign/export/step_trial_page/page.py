"""The page of a step trial."""

from __future__ import annotations

from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style
from expdesign.export.step_trial_page.content import (
    REPEAT_HEADER,
    STEP_HEADER,
    StepTrialContent,
    nominal_rows,
    repeat_rows,
    sentences,
    step_rows,
)
from expdesign.export.step_trial_page.figures import coverage_figure, simulation_figure, surface_figure

MOST_SIMULATIONS = 4


def step_trial_html(content: StepTrialContent) -> str:
    """One HTML page without any outside reference."""
    parts = (*content.tests, *content.own)[:MOST_SIMULATIONS]
    with report_style():
        figures = {"coverage": coverage_figure(content), "surfaces": surface_figure(content)}
        simulations = [(part, simulation_figure(part, f"simulation{place}")) for place, part in enumerate(parts)]
    return page_template("expdesign.export.step_trial_page", "step_trial.html").render(
        content=content,
        sentences=sentences(content),
        repeat_header=[name.capitalize() for name in REPEAT_HEADER],
        repeat_rows=repeat_rows(content),
        step_header=[name if name[1] == " " else name.capitalize() for name in STEP_HEADER],
        step_rows=step_rows(content),
        nominal_rows=nominal_rows(content),
        figures=figures,
        simulations=simulations,
    )
