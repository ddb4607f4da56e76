"""`expdesign durations`: how long to run each manoeuvre."""

from __future__ import annotations

from pathlib import Path

from expdesign.dictionary import build_dictionary
from expdesign.durations import efficiencies, solve_durations
from expdesign.errors import InputError
from expdesign.export import (
    durations_json,
)
from expdesign.progress import Progress, silent, within
from expdesign.scenario import Scenario
from expdesign.workflows.outcome import Outcome
from expdesign.workflows.planning.fused import covariance_table, covariances_json, fused_problem, tried_alone
from expdesign.workflows.steps.case import loaded, written
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.design_tables import design_summary, design_tables
from expdesign.workflows.steps.grown import growth_files, growth_summary, growth_tables, ready
from expdesign.workflows.steps.workers import workers


def durations(
    scenario: Path,
    out: Path | None,
    *,
    vessel: Path | None = None,
    grow: bool = False,
    monte_carlo: int = 0,
    jobs: int = 0,
    seed: int = 0,
    progress: Progress = silent,
) -> Outcome:
    """How long to run each primitive, with its certificate; with `grow` also of manoeuvres found to add most.

    With `monte_carlo` trials of each primitive alone, shares are by the fused covariance of its estimates instead.
    `vessel` stands in for the vessel file that the scenario names.
    """
    case = loaded(scenario, progress, vessel=vessel)
    if monte_carlo:
        if grow or case.design.grow is not None:
            raise InputError("--monte-carlo takes the dictionary as it is, expected neither --grow nor [design.grow]")
        with workers(jobs, load=None):
            return _from_covariances(case, out, monte_carlo, seed, progress)
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


def _from_covariances(case: Scenario, out: Path | None, trials: int, seed: int, progress: Progress) -> Outcome:
    primitives = build_dictionary(case.vessel, case.dictionary)
    tried = tried_alone(case, primitives, trials=trials, seed=seed, progress=within(progress, 0.05, 0.9))
    design = solve_durations(fused_problem(case, tried))
    compared = efficiencies(design)
    files = {"durations.json": durations_json(design, compared=compared), "covariances.json": covariances_json(tried)}
    summary = {
        "trials_of_each": trials,
        "not_informative_on_their_own": [item.primitive.name for item in tried if not item.informative],
        **design_summary(design),
    }
    return written(case, out, files, summary, progress, (covariance_table(tried), *design_tables(design, compared)))
