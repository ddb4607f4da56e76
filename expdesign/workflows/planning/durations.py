"""`expdesign durations`: how long to run each manoeuvre."""

from __future__ import annotations

from pathlib import Path

from expdesign.durations import efficiencies
from expdesign.export import (
    durations_json,
)
from expdesign.progress import Progress, silent, within
from expdesign.workflows.outcome import Outcome
from expdesign.workflows.steps.case import loaded, written
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.design_tables import design_summary, design_tables
from expdesign.workflows.steps.grown import growth_files, growth_summary, growth_tables, ready


def durations(
    scenario: Path, out: Path | None, *, grow: bool = False, seed: int = 0, progress: Progress = silent
) -> Outcome:
    """How long to run each primitive, with its certificate; with `grow` also of manoeuvres found to add most."""
    case = loaded(scenario, progress)
    information, growth = ready(case, grow=grow, seed=seed, progress=within(progress, 0.05, 0.6))
    design = designed(case, information, seed=seed, progress=within(progress, 0.6, 0.9))
    progress("comparing criteria", 0.9)
    compared = efficiencies(design)
    files = {
        "durations.json": durations_json(design, compared=compared),
        **growth_files(case, growth),
    }
    summary = {**growth_summary(growth, case), **design_summary(design)}
    tables = (*growth_tables(growth), *design_tables(design, compared))
    return written(case, out, files, summary, progress, tables)
