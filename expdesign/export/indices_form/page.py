"""The form as one page that prints on paper."""

from __future__ import annotations

import math

from expdesign.export import words
from expdesign.export.indices_form.appendix import condition_rows, form_lines, ship_rows
from expdesign.export.indices_form.form import IndicesContent, overshoots, shown, verdict_rows
from expdesign.export.pages import page_template
from expdesign.indices import Circle, Stop, ZigZag


def indices_html(content: IndicesContent) -> str:
    """One HTML page without outside references."""
    sources = tuple(dict.fromkeys(source for source, _ in content.trials))
    page = page_template("expdesign.export.indices_form", "indices.html")
    return page.render(
        content=content,
        rows=verdict_rows(content),
        sources=sources,
        forms={source: form_lines(content, source) for source in sources},
        ship=ship_rows(content),
        conditions=condition_rows(content),
        counts=[_counts(content, source) for source in sources],
        circles=[_circle(source, trial) for source, trial in content.trials if isinstance(trial, Circle)],
        zigzags=[_zigzag(source, trial) for source, trial in content.trials if isinstance(trial, ZigZag)],
        stops=[_stop(source, trial) for source, trial in content.trials if isinstance(trial, Stop)],
    )


def _counts(content: IndicesContent, source: str) -> str:
    """How many results there are and how they stand to their criteria."""
    counted = content.counted(source)
    parts = ", ".join(f"{number} {word}" for word, number in counted.items()) if any(counted.values()) else "none"
    return f"{source.capitalize()} results beside their criteria: {parts}."


def _degrees(angle_rad: float) -> str:
    return words.number(math.degrees(angle_rad), 1)


def _metres(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _speed(value: float | None) -> str:
    return "" if value is None else words.speed(value)


def _with_tolerance(value: float | None, tolerance_m: float) -> str:
    return shown("_m", value, tolerance_m).removesuffix(" m") if value is not None else ""


def _circle(source: str, trial: Circle) -> tuple[str, ...]:
    advance = _with_tolerance(trial.advance_m, trial.tolerance_m)
    lengths = (trial.transfer_m, trial.tactical_diameter_m, trial.steady_diameter_m)
    current = ""
    if trial.current_north_mps is not None and trial.current_east_mps is not None:
        current = f"{trial.current_north_mps:.3f}, {trial.current_east_mps:.3f}"
    head = (source, trial.name, trial.side, _degrees(trial.helm_rad), _speed(trial.speed_mps), advance)
    return (*head, *(_metres(length) for length in lengths), current)


def _zigzag(source: str, trial: ZigZag) -> tuple[str, ...]:
    executes = ", ".join(f"{order.time_s:.1f} s at {_degrees(order.heading_rad)}" for order in trial.executes)
    initial = _with_tolerance(trial.initial_turning_m, trial.tolerance_m)
    head = (source, trial.name, trial.side, f"{_degrees(trial.heading_rad)} / {_degrees(trial.helm_rad)}")
    return (*head, _speed(trial.speed_mps), overshoots(trial), initial, executes)


def _stop(source: str, trial: Stop) -> tuple[str, ...]:
    reach = [shown("_m", value, trial.tolerance_m) for value in (trial.track_reach_m, trial.head_reach_m)]
    times = (_degrees(trial.heading_change_rad), f"{trial.time_s:.0f}")
    return (source, trial.name, words.speed(trial.speed_mps), *reach, shown("_m", trial.lateral_m), *times)
