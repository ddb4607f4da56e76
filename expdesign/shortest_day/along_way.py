"""What runs tell that make way good from start to goal: their headings follow from the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.information.many import bordered_runs
from expdesign.plan.problem import PlanProblem
from expdesign.shortest_day.tuning import TUNING
from expdesign.signals import Trajectory
from expdesign.values import Array


def runs_along(problem: PlanProblem, courses: Array) -> Array:
    """(q, d, d) information of one whole run of each primitive, on average over courses (c,) that it makes good [rad].

    Sums over samples. (q, d + 2, d + 2) where the forecast leaves a steady current unknown.
    """
    durations, runs = problem.design.problem, problem.primitives
    lengths, found = np.array([len(run.commands) for run in runs]), dict[int, Array]()
    for length in np.unique(lengths):
        some: Sequence[int] = np.flatnonzero(lengths == length).tolist()
        matrices, _ = bordered_runs(
            problem.vessel,
            np.array([runs[index].commands.values for index in some]),
            np.array([runs[index].entry_velocity for index in some]),
            durations.parameters,
            environment=problem.environment,
            mean_subtraction=durations.mean_subtraction,
            standing=np.array([runs[index].entry_inputs for index in some]),
            courses=courses,
        )
        found |= dict(zip(some, length * matrices, strict=True))
    return np.array([found[index] for index in range(len(runs))])


def straight_courses(problem: PlanProblem) -> Array:
    """(c,) near the straight line to the goal [rad]; of all directions where runs last longer than the way."""
    away = problem.goal[:2] - problem.start[:2]
    longest_m = max(float(np.hypot(*item.displacement[:2])) for item in problem.primitives)
    if np.hypot(*away) <= longest_m:
        return np.asarray(2 * np.pi * np.arange(TUNING.courses) / TUNING.courses)
    spread = np.linspace(-1.0, 1.0, TUNING.courses)
    return np.asarray(np.arctan2(away[1], away[0]) + TUNING.course_spread_rad * spread)


def courses_of(track: Trajectory) -> Array:
    """(c,) of equally long parts of a track [rad]."""
    places = track.pose[np.linspace(0, len(track) - 1, TUNING.courses + 1).round().astype(int), :2]
    away = np.diff(places, axis=0)
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))
