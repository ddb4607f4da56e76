"""`expdesign whatif`: a scenario and variants of it, designed and optionally planned, side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from expdesign import requests
from expdesign.dictionary import Primitive
from expdesign.durations import DurationDesign, efficiencies, optimal_shares
from expdesign.durations.rounding import whole_runs
from expdesign.errors import FileError, InputError, NoAnswer
from expdesign.export.folder import Content
from expdesign.export.whatif_content import Case, WhatIfContent, whatif_json
from expdesign.export.whatif_page import whatif_document
from expdesign.information import PrimitiveInformation, estimated_parameters
from expdesign.information.expected import covariance_of_repeats
from expdesign.memory import Memory, recalled, remembering, user_memory
from expdesign.plan.verify import track_covariance
from expdesign.processes import as_finished, reported_together
from expdesign.progress import Progress, in_phases, silent, within
from expdesign.rehearsal import trial_parts
from expdesign.scenario import Scenario, load_scenario, load_variant
from expdesign.values import Array
from expdesign.workflows.outcome import Outcome, finished, load_plans, results_folder, shared, workflow
from expdesign.workflows.steps.day import checked_day, planned_day, search_additions
from expdesign.workflows.steps.design_problem import designed, duration_problem
from expdesign.workflows.steps.planned import check_plannable, plan_document
from expdesign.workflows.steps.scored import ready, scored

WHOLE_RUNS = "repeats"
SEARCHED = 0.1  # share of the work that is done once for all cases, where trials are planned
WORKED = 0.95  # share of the work that the cases are
SHARES = (0.25, 0.5, 2.0, 4.0)  # of the time of all runs, for which the accuracy is shown as well
WORK = (0.5, 0.5, 10.0, 0.5)
"""Relative times of the parts of a case: scoring, sharing out time, planning, comparing criteria."""


@workflow
def whatif(request: requests.WhatIf, *, progress: Progress = silent) -> Outcome:
    """The scenario and its variants side by side, into `out` or runs/<scenario>-whatif.

    Every file is read before anything is computed, and every case's dictionary and durations are checked before
    anything is planned. A variant without an answer is listed as such beside the others.
    Before trials are planned, manoeuvres are searched for that shorten the scenario's day: variants that leave that
    search as it is take over what it found, others the candidates simulated in it.
    """
    progress("reading the scenario", 0.0)
    base = load_scenario(request.scenario)
    out = results_folder(request, f"{base.name}-whatif")
    cases = [(base, ()), *(load_variant(request.scenario, variant) for variant in request.variants)]
    names = [case.name for case, _ in cases]
    paths = (request.scenario, *request.variants)
    for place, name in enumerate(names):
        if (first := names.index(name)) < place:
            problem = f"is {name!r} as in {paths[first].name}, expected another name for each case"
            raise FileError(paths[place], "scenario.name", problem)
    done: dict[str, Case] = {}
    searched = SEARCHED if request.with_plan and base.design.accuracy else 0.0
    with (
        TemporaryDirectory(prefix="expdesign-") as folder,
        remembering((user_memory() if not request.no_cache else None) or Memory(Path(folder))) as memory,
        shared(request, load=load_plans),
    ):
        for (case, _), path in (
            zip(cases, (request.scenario, *request.variants), strict=True) if request.with_plan else ()
        ):
            with suppress(NoAnswer):
                _check(case, path, request.seed)
        if searched:
            with suppress(NoAnswer):  # the case itself says so
                _search(base, request.seed, within(progress, 0.0, searched))
        with reported_together(within(progress, searched, WORKED), len(cases)) as together:
            tasks = [(*case, reporter) for case, reporter in zip(cases, together.reporters, strict=True)]
            for found in as_finished(_case, (request.with_plan, request.seed, memory), tasks):
                done[found.name] = found
                together.finished(names.index(found.name), f"{found.name} is done")
    content = WhatIfContent(
        cases=tuple(done[name] for name in names),
        planned=request.with_plan,
    )
    if all(case.problem for case in content.cases):
        raise NoAnswer(f"no case has an answer; {content.cases[0].name}: {content.cases[0].problem}")
    document = whatif_document(content)
    files: dict[str, Content] = {"whatif.json": whatif_json(content)}
    return finished(request, out, files, document, progress, page="whatif.html")


def _check(case: Scenario, path: Path, seed: int) -> None:
    """Raise FileError for what is wrong with a case and would else be found once others have been planned for long."""
    try:
        check_plannable(case)
        information = scored(case)
        design = designed(case, information, seed=seed)
        if case.design.accuracy is not None:
            checked_day(case, information, design)
    except FileError:
        raise
    except InputError as error:
        raise FileError(path, "", str(error)) from None


def _search(case: Scenario, seed: int, progress: Progress) -> None:
    """Search for manoeuvres that shorten the day, to be remembered for all cases."""
    scoring, sharing, searching = in_phases(progress, *WORK[:2], WORK[2] / 4)
    information, _ = ready(case, seed=seed, progress=scoring)
    design = designed(case, information, seed=seed, progress=sharing)
    search_additions(case, information, design, seed=seed, progress=searching)


def _case(
    with_plan: bool,
    seed: int,
    memory: Memory | None,
    case: Scenario,
    changes: tuple[str, ...],
    progress: Progress,
) -> Case:
    """One case, perhaps in another process."""
    with remembering(memory):
        return _computed(case, changes, with_plan, seed, progress)


def _computed(case: Scenario, changes: tuple[str, ...], with_plan: bool, seed: int, progress: Progress) -> Case:
    def report(activity: str, share: float) -> None:
        progress(f"{case.name}: {activity}", share)

    scoring, sharing, planning, comparing = in_phases(report, *WORK)
    try:
        information, _ = ready(case, seed=seed, progress=scoring)
        design = designed(case, information, seed=seed, progress=sharing)
        plan: dict[str, object] = {}
        track: Array | None = None
        if with_plan:
            day = planned_day(case, information, design, seed=seed, progress=planning)
            information, design, length = day.information, day.design, day.plan.day
            told = plan_document(case, day.plan)
            plan = {**told.facts, "remarks": list(told.findings), "notes": list(told.notes)}
            track = track_covariance(case.vessel, design, case.environment, day.plan.sailed)
            plan |= {"trial_s": length.planned_s, "day_s": length.planned_s}
            plan |= {"day_median_s": length.median_s, "day_95_s": length.most_s}
        comparing("comparing criteria", 0.0)
        return replace(_described(case, changes, information, design, plan, seed), track=track)
    except FileError:
        raise
    except InputError as error:
        raise InputError(f"{case.name}: {error}") from None
    except NoAnswer as error:
        empty = np.zeros((0, 0))
        return Case(
            name=case.name, changes=changes, problem=str(error), runs={}, efficiencies={}, plan={}, covariance=empty
        )


def _described(
    case: Scenario,
    changes: tuple[str, ...],
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    plan: dict[str, object],
    seed: int,
) -> Case:
    parameters = estimated_parameters(case.vessel.model, case.design.fixed_parameters)
    run_s = design.problem.run_s
    others = _in_other_times(case, information, design, seed)
    used = [place for place, runs in enumerate(zip(design.repeats, *others, strict=True)) if any(runs)]
    of_runs = _covariance(case, [information[place].primitive for place in used], parameters)
    times = []
    for repeats in others:
        with suppress(NoAnswer):
            times.append((float(np.dot(repeats, run_s)), of_runs(np.array(repeats, dtype=float)[used])))
    compared = {item.criterion: item.of[WHOLE_RUNS] for item in recalled(efficiencies, design) if WHOLE_RUNS in item.of}
    return Case(
        name=case.name,
        changes=changes,
        criterion=case.design.criterion,
        runs={name: count for name, count in zip(design.problem.names, design.repeats, strict=True) if count},
        informative_s=float(np.dot(design.repeats, run_s)),
        gap_relative=design.gap_relative,
        efficiencies=compared,
        parameters=parameters,
        covariance=of_runs(np.array(design.repeats, dtype=float)[used]),
        plan=plan,
        times=tuple(times),
        legs_count=case.design.accuracy is not None,
        remarks=case.remarks,
    )


def _in_other_times(
    case: Scenario, information: Sequence[PrimitiveInformation], design: DurationDesign, seed: int
) -> list[tuple[int, ...]]:
    """The optimal whole runs in shorter and longer times, those that tell every parameter."""
    found = []
    for share in SHARES:
        settings = replace(case.design, total_s=share * design.problem.total_s, accuracy=None)
        with suppress(NoAnswer):
            problem = duration_problem(replace(case, design=settings), information, seed=seed)
            found.append(whole_runs(problem, optimal_shares(problem).fractions))
    return found


def _covariance(case: Scenario, primitives: Sequence[Primitive], parameters: Sequence[str]) -> Callable[[Array], Array]:
    """(p, p) covariance expected of estimates from whole runs alone, as a function of how often each is run."""
    parts = trial_parts(primitives, np.ones(len(primitives)).tolist(), environment=case.environment)
    headings = len(parts) // len(primitives)
    of_parts = covariance_of_repeats(
        case.vessel,
        parts,
        parameters,
        environment=case.environment,
        mean_subtraction=case.design.mean_subtraction,
    )
    return lambda repeats: of_parts(np.repeat(repeats / headings, headings))
