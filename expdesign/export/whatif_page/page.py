"""The page that compares variants."""

from __future__ import annotations

import math

from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style
from expdesign.export.whatif_page.content import DAY, Case, WhatIfContent, explanations
from expdesign.export.whatif_page.figures import day_figure, ratio_figure, runs_figure, time_figure

DAY_COLUMNS = ("day [min]", "median [min]", "95 % [min]")


def whatif_html(content: WhatIfContent) -> str:
    """One HTML page without any outside reference."""
    with report_style():
        figures = {
            "times": time_figure(content),
            "days": day_figure(content),
            "ratios": ratio_figure(content),
            "runs": runs_figure(content),
        }
    return page_template("expdesign.export.whatif_page", "whatif.html").render(
        content=content,
        header=table_header(content),
        rows=[_row(content, case) for case in content.cases],
        explanations=explanations(content),
        figures=figures,
    )


def table_header(content: WhatIfContent) -> tuple[str, ...]:
    """Names of the columns of `table_row`; of the day where one was planned."""
    days, clearance = (DAY_COLUMNS, ("clearance [m]",)) if content.planned else ((), ())
    runs = ("time of runs [min]", "information", "same accuracy [min]", "short of optimum")
    return ("Case", "criterion", "runs", *days, *runs, *clearance)


def table_row(content: WhatIfContent, case: Case) -> tuple[str, ...]:
    """One case as a row; dashes where it has no result."""
    if case.problem:
        return (case.name, *("-",) * (len(table_header(content)) - 1))
    against = content.against(case)
    return (
        case.name,
        case.criterion,
        str(sum(case.runs.values())),
        *(_minutes(case.plan.get(key)) for key in DAY if content.planned),
        f"{case.informative_s / 60:.1f}",
        "-" if against is None else f"{against.accuracy:.2f} \N{MULTIPLICATION SIGN}",
        "-" if against is None else _minutes(against.same_accuracy_s),
        _short(case.gap_relative),
        *((_metres(case.plan),) if content.planned else ()),
    )


def _row(content: WhatIfContent, case: Case) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    return table_row(content, case), case.changes, case.problem


def _short(gap: float) -> str:
    """A proven distance from the optimum, with no more digits than anyone can use."""
    return "below 0.01 %" if gap < 1e-4 else f"{100 * gap:.2g} %"


def _minutes(value: object) -> str:
    return f"{value / 60:.1f}" if isinstance(value, float) and math.isfinite(value) else "-"


def _metres(plan: object) -> str:
    value = plan.get("least_clearance_m") if isinstance(plan, dict) else None
    return f"{value:.1f}" if isinstance(value, float) else "-"
