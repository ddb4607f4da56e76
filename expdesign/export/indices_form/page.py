"""The form as one page that prints on paper."""

from __future__ import annotations

import math

from expdesign.export import words
from expdesign.export.indices_form.appendix import condition_rows, form_lines, ship_rows
from expdesign.export.indices_form.form import IndicesContent, shown, verdict_rows
from expdesign.export.pages import page_template
from expdesign.indices import Circle, NotStandard, Stop, ZigZag


def indices_html(content: IndicesContent) -> str:
    """One HTML page without outside references."""
    sources = tuple(dict.fromkeys(source for source, _ in content.trials))
    unmet = sum(verdict.met is False for _, verdict in content.verdicts)
    page = page_template("expdesign.export.indices_form", "indices.html")
    return page.render(
        content=content,
        rows=verdict_rows(content),
        sources=sources,
        forms={source: form_lines(content, source) for source in sources},
        ship=ship_rows(content),
        conditions=condition_rows(content),
        unmet=unmet,
        circles=[_circle(source, trial) for source, trial in content.trials if isinstance(trial, Circle)],
        zigzags=[_zigzag(source, trial) for source, trial in content.trials if isinstance(trial, ZigZag)],
        stops=[_stop(source, trial) for source, trial in content.trials if isinstance(trial, Stop)],
        notes=indices_notes(content),
    )


def indices_notes(content: IndicesContent) -> tuple[str, ...]:
    """The notes of the form: on the files, and why results are missing."""
    why_not = [f"The model was not simulated: {content.simulated_why_not}"] if content.simulated_why_not else []
    not_run = content.simulated.not_run if content.simulated else ()
    others = (f"{item.name}: {item.reason}" for item in content.measured if isinstance(item, NotStandard))
    return (*why_not, *not_run, *others, *content.notes)


def _degrees(angle_rad: float) -> str:
    return words.number(math.degrees(angle_rad), 1)


def _metres(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _circle(source: str, trial: Circle) -> tuple[str, ...]:
    lengths = (trial.advance_m, trial.transfer_m, trial.tactical_diameter_m, trial.steady_diameter_m)
    current = ""
    if trial.current_north_mps is not None and trial.current_east_mps is not None:
        current = f"{trial.current_north_mps:.3f}, {trial.current_east_mps:.3f}"
    head = (source, trial.name, trial.side, _degrees(trial.helm_rad), words.speed(trial.speed_mps))
    return (*head, *(_metres(length) for length in lengths), current)


def _zigzag(source: str, trial: ZigZag) -> tuple[str, ...]:
    overshoots = ", ".join(_degrees(angle) for angle in trial.overshoots_rad)
    executes = ", ".join(f"{order.time_s:.1f} s at {_degrees(order.heading_rad)}" for order in trial.executes[:4])
    more = ", ..." if len(trial.executes) > 4 else ""
    head = (source, trial.name, trial.side, f"{_degrees(trial.heading_rad)} / {_degrees(trial.helm_rad)}")
    return (*head, words.speed(trial.speed_mps), overshoots, _metres(trial.initial_turning_m), executes + more)


def _stop(source: str, trial: Stop) -> tuple[str, ...]:
    lengths = (trial.track_reach_m, trial.head_reach_m, trial.lateral_m)
    times = (_degrees(trial.heading_change_rad), f"{trial.time_s:.0f}")
    return (source, trial.name, words.speed(trial.speed_mps), *(shown("_m", length) for length in lengths), *times)
