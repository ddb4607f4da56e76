"""The trial of a scenario: the optimal durations in the time given, or the shortest day of the accuracy asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

from expdesign.durations import DurationDesign
from expdesign.information import PrimitiveInformation
from expdesign.memory import recalled
from expdesign.plan.values import Plan
from expdesign.progress import Progress, silent
from expdesign.scenario import Scenario
from expdesign.shortest_day import ShortestDay
from expdesign.workflows.outcome import TextTable
from expdesign.workflows.steps.design_tables import design_summary
from expdesign.workflows.steps.planned import plan_problem, planned


@dataclass(frozen=True, kw_only=True, eq=False)
class Day:
    """A planned trial.

    Attributes:
        design: with the runs that the plan does.
        plan: the trial.
        shortest: how it was found to be the shortest, or None where total_s decides.
    """

    design: DurationDesign
    plan: Plan
    shortest: ShortestDay | None = None


def planned_day(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Day:
    """The verified trial of a scenario.

    Args:
        case: the scenario.
        information: of its dictionary.
        design: the optimal durations in total_s.
        seed: of everything drawn.
        progress: of the planning.

    Raises:
        InputError: plans cannot be made for the vessel, or the accuracy cannot be counted.
        NoAnswer: the accuracy cannot be reached, or there is no plan.
    """
    if case.design.accuracy is None:
        return Day(design=design, plan=planned(case, information, design, seed=seed, progress=progress))
    from expdesign.shortest_day import day_bound, shortest_day, stated_accuracy

    problem = plan_problem(case, information, design, seed=seed)
    accuracy = stated_accuracy(case.design.accuracy, design, case.vessel)
    found = shortest_day(problem, accuracy, most_s=case.design.accuracy.most_s, progress=progress)
    found = replace(found, bound=recalled(day_bound, problem, accuracy, found.plan))
    return Day(design=found.design, plan=found.plan, shortest=found)


def day_files(day: Day) -> dict[str, str | bytes]:
    """The search for the shortest day, where there was one."""
    found = day.shortest
    if found is None:
        return {}
    content = {
        "day_s": found.plan.commands.duration_s,
        "information": found.information,
        **_bound(found),
        "cost_of_runs_s": found.cost_s,
        "cost_of_runs_bound_s": found.cost_bound_s,
        "tried": [
            {
                "runs": dict(item.runs),
                "day_s": item.day_s,
                "informative_s": item.informative_s,
                "information": item.information,
            }
            for item in found.tried
        ],
    }
    return {"day.json": json.dumps(content, indent=2) + "\n"}


def _bound(found: ShortestDay) -> dict[str, object]:
    """The bound on the day, the ratio, and the class that it holds for."""
    bound = found.bound
    if bound is None or bound.day_s <= 0:
        return {}
    return {
        "day_bound_s": bound.day_s,
        "day_over_bound": found.plan.commands.duration_s / bound.day_s,
        "bound": {
            "holds_for": "motions within these velocities through water and the actuators' limits, whether or not "
            "the model can follow them; regressors by the nominal model",
            "velocities": dict(zip(("u_mps", "v_mps", "r_radps"), bound.velocities.tolist(), strict=True)),
            "speed_mps": bound.speed_mps,
            "information_s": bound.information_s,
            "information_searched_s": bound.searched_s,
            "way_s": bound.way_s,
        },
    }


def day_summary(day: Day) -> dict[str, object]:
    """Key numbers of the durations and of the day."""
    found, summary = day.shortest, design_summary(day.design)
    if found is None:
        return summary
    return {
        **{key: value for key, value in summary.items() if key != "efficiency_of_whole_runs"},
        "day_s": found.plan.commands.duration_s,
        "information_of_what_was_asked": found.information,
        **{name: value for name, value in _bound(found).items() if name != "bound"},
        "days_tried": len(found.tried),
    }


def day_tables(day: Day) -> tuple[TextTable, ...]:
    """The days tried."""
    found = day.shortest
    if found is None:
        return ()
    rows = tuple(
        (
            str(number),
            f"{item.day_s:.0f}",
            f"{item.informative_s:.0f}",
            f"{item.information:.1%}",
            ", ".join(f"{count} {name}" for name, count in item.runs.items()),
        )
        for number, item in enumerate(found.tried, start=1)
    )
    header = ("day", "seconds", "of these in runs", "information of what is needed", "runs")
    return (TextTable(title="Days planned in search of the shortest", header=header, rows=rows),)
