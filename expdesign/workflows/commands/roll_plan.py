"""`expdesign roll-plan`: which known loads, and which manoeuvres at each, tell most about roll."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from expdesign import requests
from expdesign.durations import Aim, DurationDesign, with_repeats
from expdesign.errors import FileError, NoAnswer, NoPlan, UnknownName
from expdesign.export.folder import Content, write_files
from expdesign.export.load_page import LoadContent, load_document, load_plan_json, loads_toml, repeats_json
from expdesign.export.pages import document_html
from expdesign.information import PrimitiveInformation
from expdesign.loading import LoadPlan, Question, build_question, choose_loads
from expdesign.plan.values import Plan
from expdesign.progress import Progress, ending, silent, within
from expdesign.requests import command_text, repeating
from expdesign.scenario import Scenario, load_cases
from expdesign.vessel import ROLL_PARAMETERS, RollPendulum
from expdesign.workflows.outcome import Outcome, load_planner, results_folder, shared, workflow
from expdesign.workflows.steps.case import loaded
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import built_route, check_plannable, planned, report_content, trial_files
from expdesign.workflows.steps.scored import scored

Files = dict[str, Content]


@workflow
def roll_plan(request: requests.RollPlan, *, progress: Progress = silent) -> Outcome:
    """Load cases and runs, into `out` or runs/<scenario>; with `place` also a plan and run cards of each load case.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the candidates leave a combination of parameters open, a load case has no plan, or time is up.
    """
    limited = ending(
        progress,
        most_s=60.0 * request.minutes,
        refusal=lambda now: _too_long(request.minutes, now, cache=not request.no_cache),
    )
    case = loaded(request, limited)
    pendulum = case.vessel.pendulum
    if pendulum is None:
        raise FileError(
            request.scenario,
            "vessel",
            f"is {case.vessel.name!r}, whose file has no [roll], expected a vessel file with it",
        )
    if request.place:
        check_plannable(case)
    asked = load_cases(request.loads, case.vessel)
    question = build_question(case.vessel, asked.loads, known=asked.known, guess=asked.start)
    with shared(request, load=load_planner if request.place else None):
        information = scored(case, progress=within(limited, 0.05, 0.1))
        plan = choose_loads(
            question, [item.primitive for item in information], total_s=case.design.total_s,
            aim=_aim(question, request.interest), most_loads=request.most_loads,
            progress=within(limited, 0.1, 0.3 if request.place else 0.9),
        )  # fmt: skip
        folder = results_folder(request, case.name)
        command = repeating(request)
        content = LoadContent(
            scenario=case.name, plan=plan, known={**_known(pendulum, plan), **asked.known},
            commands=_commands(request.scenario, folder, plan),
            command=command,
        )  # fmt: skip
        placing = within(limited, 0.3, 1.0)
        placed = _placed(case, information, content, request.seed, placing) if request.place else ()
    document = load_document(content)
    names = {_runs_name(number): repeats_json(content, number) for number in range(len(plan.repeats))}
    files: dict[str, Content] = {
        "roll-plan.json": load_plan_json(content), "roll-plan.html": partial(document_html, document),
        "loads.toml": loads_toml(content), **names,
    }  # fmt: skip
    paths = write_files(folder, files)
    for number, own in enumerate(placed, start=1):
        paths += write_files(folder / f"case-{number}", own)
    progress("done", 1.0)
    return Outcome(files=paths, document=document)


def _too_long(minutes: float, activity: str, *, cache: bool) -> NoAnswer:
    """The refusal of work that takes longer than asked."""
    again = ", or the same command again, which goes on from the load cases that were planned" if cache else ""
    return NoAnswer(
        f"--minutes {minutes:g} are over, and {activity} is still to be done; expected more minutes, fewer load cases "
        f"(--most-loads), no --place{again}"
    )


def _aim(question: Question, interest: Sequence[str]) -> Aim:
    for name in interest:
        if name not in question.free:
            raise UnknownName("parameter of --interest", name, known=question.free)
    return Aim(criterion="D_s", interest=tuple(interest)) if interest else Aim()


def _known(pendulum: RollPendulum, plan: LoadPlan) -> dict[str, float]:
    """Parameters that the vessel file states without a standard deviation."""
    return {name: pendulum.parameters[name] for name in ROLL_PARAMETERS if name not in plan.question.free}


def _runs_name(case: int) -> str:
    return f"durations-{case + 1}.json"


def _commands(scenario: Path, folder: Path, plan: LoadPlan) -> tuple[str, ...]:
    """What to type for every load case, and for the data of all."""
    cases = range(len(plan.repeats))
    each = [
        command_text(
            requests.Plan(scenario=scenario, out=folder / f"case-{case + 1}", durations=folder / _runs_name(case))
        )
        for case in cases
    ]
    data = tuple(Path(f"case-{case + 1}.csv") for case in cases)
    roll = requests.Roll(data=data, loads=folder / "loads.toml", vessel=Path("VESSEL.toml"))
    return (*each, command_text(roll))


def _placed(
    case: Scenario, information: tuple[PrimitiveInformation, ...], loads: LoadContent, seed: int, progress: Progress
) -> list[Files]:
    """Files of every load case: a plan with routes, run cards and report.

    Loads do not change the ship's path: load cases with the same runs are sailed alike, and planned once.
    """
    design = designed(case, information, seed=seed, progress=within(progress, 0.0, 0.1))
    order = [list(loads.plan.manoeuvres).index(item.primitive.name) for item in information]
    rows = loads.plan.repeats.astype(int).tolist()
    trips: dict[tuple[int, ...], tuple[DurationDesign, Plan]] = {}
    found = []
    for number, row in enumerate(rows):
        part = within(progress, 0.1 + 0.9 * number / len(rows), 0.1 + 0.9 * (number + 1) / len(rows))
        name = f"load case {number + 1}: {loads.options[number].name}"
        repeats = tuple(row[place] for place in order)
        if repeats not in trips:
            runs = with_repeats(design, list(repeats))
            sailing = within(_of_case(name, part), 0.0, 0.8)
            trips[repeats] = runs, _trip(case, information, runs, name=name, seed=seed, progress=sailing)
        runs, trip = trips[repeats]
        loaded_case = replace(case, name=f"{case.name}, {name}")
        route = built_route(loaded_case, trip)
        content = report_content(loaded_case, information, runs, trip, loads.commands[number])
        content = replace(content, route=route)
        drawing = within(_of_case(name, part), 0.8, 1.0)
        found.append(trial_files(loaded_case, None, content, route, progress=drawing))
    return found


def _of_case(name: str, progress: Progress) -> Progress:
    return lambda activity, share: progress(f"{activity}, {name}", share)


def _trip(
    case: Scenario, information: Sequence[PrimitiveInformation], runs: DurationDesign, *, name: str, seed: int,
    progress: Progress,
) -> Plan:  # fmt: skip
    """The plan of a load case; a refusal names it."""
    try:
        return planned(case, information, runs, seed=seed, progress=progress)
    except NoPlan as error:
        error.obstacle = f"{name}: {error.obstacle}"
        raise
