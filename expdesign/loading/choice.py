"""From candidate loads and manoeuvres to load cases: D-optimal shares of time, with as few loads as nearly reach them.

Every pair of a load and a manoeuvre is one primitive of a duration problem, so that shares, certificate and whole runs
are those of `durations`. Changing a load costs time, which shares do not see: loads are left out one by one, the least
missed first, as long as the D-efficiency stays high.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import Aim, DurationDesign, DurationProblem, optimal_shares, solve_durations
from expdesign.errors import NoAnswer, NotInformative
from expdesign.loading.information import run_information
from expdesign.loading.question import Question
from expdesign.progress import Progress, silent
from expdesign.roll import Direction, cures, direction, open_directions
from expdesign.values import Array, seal

LEAST_EFFICIENCY = 0.9  # D-efficiency that a plan with fewer loads keeps, of the best with all candidates


BY_VOLUME = Aim()
"""D: the volume of the confidence region of all parameters."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """The best plan with so many loads."""

    options: tuple[int, ...]  # places of the loads among the candidates
    efficiency: float  # by the criterion, relative to all candidates
    smallest: float  # singular value of the relative sensitivity of their equations


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadPlan:
    """Load cases of a trial."""

    question: Question  # that it answers
    manoeuvres: dict[str, float]  # names of the manoeuvres, each with a duration of one run [s]
    steps: tuple[Step, ...]  # from all candidate loads to the fewest that still determine all parameters
    chosen: Step  # the step that is followed
    # time shares over pairs of its loads and all manoeuvres, loads first, with certificate and whole runs
    design: DurationDesign
    repeats: Array  # (l, q) whole runs at each load of the step
    # std_before, std_after: (p,) standard deviations of the free parameters, infinite where nothing is known
    std_before: Array
    std_after: Array
    faintest: Direction  # the combination with the least information, relative standard deviation 1 / size

    def __post_init__(self) -> None:
        seal(self, repeats="l q", std_before="p", std_after="p")


def choose_loads(
    question: Question,
    primitives: Sequence[Primitive],
    *,
    total_s: float,
    aim: Aim = BY_VOLUME,
    most_loads: int | None = None,
    progress: Progress = silent,
) -> LoadPlan:
    """Load cases, and the runs at each.

    Args:
        question: with the candidate loads.
        primitives: the manoeuvres.
        total_s: informative time, without changing loads.
        aim: the criterion.
        most_loads: at most so many load cases; None for the fewest that keep `LEAST_EFFICIENCY`.
        progress: of the calculation.

    Raises:
        NotInformative: no load of the candidates tells a combination of the parameters, which is named.
        NoAnswer: the runs do not fit, or none with so few loads determines all parameters.
    """
    everything = tuple(range(len(question.options)))
    _check_rank(question, everything)
    pieces: list[Array] = []
    for option in question.options:
        progress(f"simulating with {option.name}", 0.4 * len(pieces) / len(everything))
        pieces.append(run_information(question.vessel, question.theta, option, primitives))
    scale = np.outer(question.size, question.size)
    matrices = np.array(pieces)[:, :, question.places][..., question.places] * scale
    problems = _Problems(question, primitives, matrices, total_s, aim)
    steps = _fewer(question, problems, everything, progress)
    chosen = _followed(question, steps, most_loads)
    progress("choosing whole runs", 0.95)
    design = solve_durations(problems.of(chosen.options))
    repeats = np.array(design.repeats).reshape(len(chosen.options), len(primitives))
    _check_runs(question, chosen, repeats, total_s)
    information = question.prior + np.einsum("lq,lqij->ij", repeats, matrices[list(chosen.options)])
    sizes, vectors = np.linalg.eigh(information)
    return LoadPlan(
        question=question,
        manoeuvres={item.name: item.duration_s for item in primitives},
        steps=steps,
        chosen=chosen,
        design=design,
        repeats=repeats,
        std_before=_std(question.prior) * question.size,
        std_after=_std(information) * question.size,
        faintest=direction(question.free, question.generic, vectors[:, 0], float(np.sqrt(max(sizes[0], 0.0)))),
    )


def _check_runs(question: Question, chosen: Step, repeats: Array, total_s: float) -> None:
    """Raise where the time is too short for a run with every load that is needed."""
    idle = [question.options[place].name for place, runs in zip(chosen.options, repeats, strict=True) if not runs.any()]
    if idle:
        raise NoAnswer(
            f"{total_s:g} s hold no whole run with {', '.join(idle)}; expected a longer design.total_s, shorter "
            "manoeuvres or fewer loads"
        )


def _std(information: Array) -> Array:
    """(p,) standard deviations; infinite where nothing is known."""
    known = np.diag(information) > 0
    result = np.full(len(information), np.inf)
    result[known] = np.sqrt(np.diag(np.linalg.inv(information[np.ix_(known, known)])))
    return result


@dataclass(frozen=True, eq=False)
class _Problems:
    """Duration problems of some of the loads; `matrices` are (o, q, p, p) of one run each."""

    question: Question
    primitives: Sequence[Primitive]
    matrices: Array
    total_s: float
    aim: Aim

    def of(self, options: Sequence[int]) -> DurationProblem:
        run_s = np.array([item.duration_s for item in self.primitives])
        rate = self.matrices[list(options)] * (self.total_s / run_s)[:, None, None]
        rate = (rate + rate.swapaxes(-1, -2)) / 2
        names = [self.question.options[place].name for place in options]
        return DurationProblem(
            names=tuple(f"{item.name} with {name}" for name in names for item in self.primitives),
            parameters=self.question.free,
            mean_subtraction="none",
            matrices=rate.reshape(-1, *rate.shape[2:]),
            run_s=np.tile(run_s, len(names)),
            total_s=self.total_s,
            aim=self.aim,
            prior=self.question.prior,
        )


def _sensed(question: Question, options: Sequence[int]) -> tuple[Array, tuple[Direction, ...]]:
    assert question.vessel.pendulum is not None
    loads = [question.options[place].load for place in options]
    return open_directions(question.vessel.pendulum.body, question.generic, loads, question.free)


def _check_rank(question: Question, options: Sequence[int]) -> None:
    """Raise where the equations of all candidates together leave a combination open."""
    _, left = _sensed(question, options)
    if not left:
        return
    assert question.vessel.pendulum is not None
    loads = [question.options[place].load for place in options]
    better = cures(question.vessel.pendulum.body, question.generic, loads, question.free)
    helps = [one.what for one in better if one.rank == len(question.free)]
    advice = f"; what would: {'; or '.join(helps[:3])}" if helps else ""
    raise NotInformative(
        f"no candidate load determines {len(left)} combination{'s' * (len(left) > 1)} of the parameters: the data "
        f"would be the same if these changed together: {'; or: '.join(map(str, left))}{advice}",
        parameters=tuple(dict.fromkeys(name for one in left for name in one.change)),
    )


def _fewer(question: Question, problems: _Problems, options: tuple[int, ...], progress: Progress) -> tuple[Step, ...]:
    """Steps from all loads down, each without the load that is missed least."""
    best = optimal_shares(problems.of(options)).certificate
    steps = [Step(options=options, efficiency=1.0, smallest=float(_sensed(question, options)[0][-1]))]
    while len(options) > 1:
        progress(f"leaving loads out, {len(options)} left", 0.4 + 0.5 / len(options))
        found = []
        for gone in options:
            rest = tuple(place for place in options if place != gone)
            sizes, left = _sensed(question, rest)
            if not left:
                gained = (optimal_shares(problems.of(rest)).certificate.value - best.value) / best.degree
                found.append(Step(options=rest, efficiency=float(np.exp(gained)), smallest=float(sizes[-1])))
        if not found:
            break
        steps.append(max(found, key=lambda step: step.efficiency))
        options = steps[-1].options
    return tuple(steps)


def _followed(question: Question, steps: Sequence[Step], most_loads: int | None) -> Step:
    if most_loads is None:
        return [step for step in steps if step.efficiency >= LEAST_EFFICIENCY][-1]
    few = [step for step in steps if len(step.options) <= most_loads]
    if not few:
        raise NotInformative(
            f"{most_loads} loads do not determine {', '.join(question.free)}; expected {len(steps[-1].options)} or more"
        )
    return few[0]
