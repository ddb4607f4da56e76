"""`expdesign replan`: the rest of a trial, from the present position, with a model updated from the data.

The rest begins with the motion and the commands of the data's last rows, or with the ship stopped there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign import requests
from expdesign.durations import DurationDesign
from expdesign.errors import NoAnswer
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import Known, replan_json, vessel_toml
from expdesign.export.report.tables import AT_REST, motion
from expdesign.export.words import place
from expdesign.information import PrimitiveInformation, estimated_parameters
from expdesign.plan.values import Plan
from expdesign.progress import Progress, silent, within
from expdesign.requests import repeating
from expdesign.scenario import Scenario, load_scenario
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.workflows.outcome import Outcome, finished, results_folder, shared, workflow
from expdesign.workflows.steps.case import drafted
from expdesign.workflows.steps.day import compared_criteria, day_document, day_files, planned_day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.known import data_parts, expected_std, in_recorded_depth, plan_part, purchases
from expdesign.workflows.steps.measured import data_files
from expdesign.workflows.steps.planned import built_route, plan_document, report_content, trial_files
from expdesign.workflows.steps.present import PresentState, present_state, rest_of, weather_for_rest
from expdesign.workflows.steps.scored import growth_document, ready

VESSEL_FILE = "vessel-used.toml"


@workflow
def replan(request: requests.Replan, *, progress: Progress = silent) -> Outcome:
    """Plan the rest of a trial from the ship's present position, with the results of `run`.

    Raises:
        InputError: something in the files is wrong, the ship is not in safe water, or no time is left.
        NoAnswer: there is no informative design or no feasible plan.
    """
    progress("reading scenario and data", 0.0)
    first = load_scenario(request.scenario, data=data_files(request.data))
    results_folder(request, first.name)
    state = present_state(
        first,
        request.data,
        vessel=request.vessel,
        remaining_s=request.remaining_s,
        stopped=request.stopped,
        progress=within(progress, 0.0, 0.02),
    )
    with shared(request), drafted(request, replace(state.first, start=state.pose, vessel=state.ship)):
        return _replanned(state, request, progress)


def _replanned(state: PresentState, request: requests.Replan, progress: Progress) -> Outcome:
    """Plan the rest and write it."""
    seed = request.seed
    case, notes = rest_of(state, interest=request.interest)
    information, growth = ready(case, seed=seed, progress=within(progress, 0.02, 0.05))
    design = designed(
        case, information, stated=state.first.vessel.model, seed=seed, progress=within(progress, 0.05, 0.12)
    )
    compared = compared_criteria(case, design)
    reference = _stated_before(state, case, information, seed)
    if reference is None:
        _check_runs(design)
    day = planned_day(
        case, information, design, reference=reference, stated=state.first.vessel.model, seed=seed,
        progress=within(progress, 0.13, 0.74),
    )  # fmt: skip
    writing = within(progress, 0.74, 1.0)
    writing("writing routes, run cards and report", 0.0)
    known = known_of(replace(state, notes=(*state.notes, *notes)), case, day.design, day.plan)
    route = built_route(case, day.plan)
    content = replace(
        report_content(case, day.information, day.design, day.plan, repeating(request)),
        compared=compared,
        route=route,
        known=known,
        day=day.shortest,
    )
    files = {**trial_files(case, growth, content, route, progress=writing), **day_files(case, day)}
    files |= {
        VESSEL_FILE: vessel_toml(state.ship, comments=[f"The rest of trial {case.name!r} is planned with it.",
                                                       f"Its model is {state.origin}."]),
        "replan.json": replan_json(known),
    }  # fmt: skip
    document = _known_document(case.name, known) + growth_document(growth, case) + day_document(day)
    document += plan_document(case, day.plan) + Document(notes=day.plan.area.notes)
    return finished(request, results_folder(request, case.name), files, document, progress)


def _stated_before(
    state: PresentState, case: Scenario, information: Sequence[PrimitiveInformation], seed: int
) -> DurationDesign | None:
    """The durations whose accuracy the whole trial was to have, without its data; None where none is asked for."""
    if case.design.accuracy is None:
        return None
    before = replace(case, design=replace(case.design, prior_data=state.first.design.prior_data))
    return designed(before, information, stated=state.first.vessel.model, seed=seed)


def _check_runs(design: DurationDesign) -> None:
    """Refuse a design without runs, which prior information allows."""
    if not any(design.repeats):
        shortest = float(design.problem.run_s.min())
        raise NoAnswer(f"no whole run fits in the {design.problem.total_s:g} s left; the shortest takes {shortest:g} s")


def known_of(state: PresentState, case: Scenario, design: DurationDesign, plan: Plan) -> Known:
    """Parameters and standard deviations before the trial, now, and after the rest."""
    first, ship, subtraction = state.first.vessel, state.ship, case.design.mean_subtraction
    names = estimated_parameters(ship.model, case.design.fixed_parameters)
    so_far, rest = data_parts(state.record, ship), plan_part(plan, ship)
    sailing = in_recorded_depth(ship)
    weather, words = weather_for_rest(state.first.environment, ship.environment)

    def deviations(*parts: object) -> Array:
        return expected_std(sailing, parts, names, environment=weather, mean_subtraction=subtraction)  # type: ignore[arg-type]

    values = {item: dict(zip(item.names, item.parameters.tolist(), strict=True)) for item in (first.model, ship.model)}
    return Known(
        data=tuple(str(path) for path in state.data),
        sailed_s=state.sailed_s,
        total_s=state.first.design.total_s,
        remaining_s=state.left_s,
        remaining_stated=state.left_stated,
        pose=state.pose,
        speed_mps=float(np.hypot(*np.nan_to_num(state.record.batches[-1].velocity[-1, :2]))),
        under_way=state.under_way,
        model=state.origin,
        environment=weather,
        weather=words,
        notes=state.notes,
        parameters=names,
        before=np.array([values[first.model].get(name, np.nan) for name in names]),
        now=np.array([values[ship.model][name] for name in names]),
        stated=np.array([_stated(first).get(name, 0.0) for name in names]),
        so_far=deviations(*so_far),
        after=deviations(*so_far, rest),
        purchases=purchases(design, names),
    )


def _stated(vessel: Vessel) -> dict[str, float]:
    return dict(zip(vessel.model.names, vessel.model.parameter_std.tolist(), strict=True))


def _known_document(scenario: str, known: Known) -> Document:
    """What the document says of the trial so far."""
    asked = math.isnan(known.remaining_s)
    facts = {
        "scenario": scenario,
        "data_s": known.sailed_s,
        **({} if asked else {"remaining_s": known.remaining_s}),
        "model": known.model,
        "weather": known.weather,
        "current_to_north_mps": float(known.environment.current_to[0]),
        "current_to_east_mps": float(known.environment.current_to[1]),
        "start": f"{place(known.pose)}, {_motion(known)}",
        **({"new_parameters": list(known.new)} if known.new else {}),
    }
    left = () if asked or known.remaining_stated else ("remaining_s is design.total_s less the time of the data",)
    return Document(facts=facts, sections=tabled(_table(known)), notes=(*left, *known.notes))


def _motion(known: Known) -> str:
    if known.under_way is None:
        return "assumed to be stopped"
    moves = motion(known.under_way.velocity)
    return "at rest over ground" if moves == AT_REST else f"under way at {moves}"


def _table(known: Known) -> Table:
    columns = zip(known.parameters, known.now, known.stated, known.so_far, known.after, known.purchases, strict=True)
    return Table(
        title="Parameters, and their standard deviations",
        header=("parameter", "value now", "std before", "from the data so far", "after the rest", "bought by"),
        rows=tuple(
            (name, f"{now:.4g}", _shown(stated or np.nan), _shown(so_far), _shown(after), item.primitive or "-")
            for name, now, stated, so_far, after, item in columns
        ),
    )


def _shown(std: float) -> str:
    return f"{std:.2g}" if np.isfinite(std) else "-"
