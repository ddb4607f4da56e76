"""`expdesign score` and `expdesign durations`: what each manoeuvre tells, and how long to run it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign import requests
from expdesign.dictionary import Primitive, build_dictionary
from expdesign.dictionary.build import deviating
from expdesign.durations import DurationProblem, build_fused, efficiencies, solve_durations
from expdesign.errors import InputError, NotInformative
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import durations_json, strict_json
from expdesign.progress import Progress, silent, within
from expdesign.rehearsal import Alone, estimates_alone
from expdesign.scenario import Scenario
from expdesign.workflows.outcome import Outcome, shared, workflow
from expdesign.workflows.steps.case import loaded, written
from expdesign.workflows.steps.design_problem import aim_of, constraints_of, design_document, designed
from expdesign.workflows.steps.scored import (
    actuation_remarks,
    growth_document,
    growth_files,
    parameters_of,
    ranking,
    ready,
    score_files,
    scored,
    speed_remarks,
)


@workflow
def score(request: requests.Score, *, progress: Progress = silent) -> Outcome:
    """Information of every primitive of a scenario's dictionary; `vessel` stands in for the vessel file it names."""
    case = loaded(request, progress)
    information = scored(case, progress=within(progress, 0.05, 0.95))
    table, strayed = ranking(case, information), deviating([item.primitive for item in information])
    facts = {
        "primitives": len(information),
        "parameters": len(parameters_of(case)),
        "meet_excitation_condition": sum(item.excitation_condition for item in information),
        "informative_alone": sum(item.log_det_alone is not None for item in information),
        "most_beside_the_others": table.rows[0][1],
        **({"stray_from_their_wish": [item.name for item in strayed]} if strayed else {}),
    }
    told = actuation_remarks(case.vessel, [item.primitive.commands for item in information], "candidate")
    told += speed_remarks(case.vessel, [item.primitive.trajectory for item in information], "candidate")
    document = Document(facts=facts, findings=(*case.remarks, *told), sections=tabled(table))
    return written(request, case, score_files(case, information), document, progress)


# The duration problem of a scenario from covariances of simulated trials, (7.59)-(7.63).


def tried_alone(
    case: Scenario, primitives: Sequence[Primitive], *, trials: int, seed: int = 0, progress: Progress = silent
) -> tuple[Alone, ...]:
    """Estimates from simulated trials of each primitive alone, by the scenario's ship in its weather.

    Raises:
        InputError: settings of [design] that only information can serve, or too few trials.
    """
    settings = case.design
    for key, value, usual in (
        ("predictor", settings.predictor, "model"),
        ("robust", settings.robust, "nominal"),
        ("prior", settings.prior, "none"),
        ("prior_data", ", ".join(map(str, settings.prior_data)), ""),
    ):
        if value != usual:
            raise InputError(f"design.{key} is {value!r}, which --monte-carlo does not take, expected {usual!r}")
    return estimates_alone(
        case.vessel,
        primitives,
        parameters=parameters_of(case),
        total_s=settings.total_s,
        trials=trials,
        environment=case.environment,
        mean_subtraction=settings.mean_subtraction,
        seed=seed,
        progress=progress,
    )


def fused_problem(case: Scenario, tried: Sequence[Alone]) -> DurationProblem:
    """Shares by the fused covariance of the primitives that are informative on their own.

    Raises:
        NotInformative: none is.
    """
    parameters = parameters_of(case)
    kept = [item for item in tried if item.informative]
    if not kept:
        raise NotInformative(
            "no manoeuvre gives an estimate of every parameter on its own, so none has a covariance; leave out "
            "--monte-carlo, or fix parameters",
            parameters=parameters,
        )
    aim = aim_of(case, parameters, case.design.interest)
    return build_fused(
        [item.primitive.name for item in kept],
        parameters,
        np.array([item.covariance for item in kept]),
        seconds=np.array([item.seconds for item in kept]),
        run_s=np.array([item.primitive.duration_s for item in kept]),
        total_s=case.design.total_s,
        aim=replace(aim, noise=np.ones(len(parameters))),
        constraints=constraints_of(case, [item.primitive for item in kept]),
    )


def covariances_json(tried: Sequence[Alone]) -> str:
    """`covariances.json`: covariance and bias of the estimates from each primitive alone; null where it has none."""
    return strict_json(
        {
            "parameters": list(tried[0].parameters),
            "nominal": tried[0].nominal.tolist(),
            "primitives": [
                {
                    "name": item.primitive.name,
                    "seconds": item.seconds,
                    "trials": len(item.estimates) + item.failed,
                    "without_estimate": item.failed,
                    "bias": (item.estimates.mean(axis=0) - item.nominal).tolist() if item.informative else None,
                    "covariance": item.covariance.tolist() if item.informative else None,
                }
                for item in tried
            ],
        }
    )


def covariance_table(tried: Sequence[Alone]) -> Table:
    """Trials of each primitive, and its largest bias beside the scatter."""
    return Table(
        title="Simulated trials of each manoeuvre alone; bias is counted in the covariance",
        header=("primitive", "seconds", "trials", "without estimate", "largest bias over scatter"),
        rows=tuple(
            (
                item.primitive.name,
                f"{item.seconds:.1f}",
                str(len(item.estimates) + item.failed),
                str(item.failed),
                _largest_bias(item) if item.informative else "not informative on its own",
            )
            for item in tried
        ),
    )


def _largest_bias(item: Alone) -> str:
    bias = np.abs(item.estimates.mean(axis=0) - item.nominal)
    share = bias / item.estimates.std(axis=0, ddof=1)
    worst = int(np.argmax(share))
    return f"{share[worst]:.2f} ({item.parameters[worst]})"


@workflow
def durations(request: requests.Durations, *, progress: Progress = silent) -> Outcome:
    """How long to run each primitive, with its certificate; with `grow` also of manoeuvres found to add most.

    With `monte_carlo` trials of each primitive alone, shares are by the fused covariance of its estimates instead.
    `vessel` stands in for the vessel file that the scenario names.
    """
    case = loaded(request, progress)
    if request.monte_carlo:
        if request.grow or case.design.grow is not None:
            raise InputError("--monte-carlo takes the dictionary as it is, expected neither --grow nor [design.grow]")
        with shared(request, load=None):
            return _from_covariances(request, case, progress)
    information, growth = ready(case, grow=request.grow, seed=request.seed, progress=within(progress, 0.05, 0.6))
    design = designed(case, information, seed=request.seed, progress=within(progress, 0.6, 0.9))
    progress("comparing criteria", 0.9)
    compared = efficiencies(design)
    files = {
        "durations.json": durations_json(design, compared=compared),
        **growth_files(case, growth),
    }
    document = growth_document(growth, case) + design_document(design, compared)
    return written(request, case, files, document, progress)


def _from_covariances(request: requests.Durations, case: Scenario, progress: Progress) -> Outcome:
    trials = request.monte_carlo
    primitives = build_dictionary(case.vessel, case.dictionary)
    tried = tried_alone(case, primitives, trials=trials, seed=request.seed, progress=within(progress, 0.05, 0.9))
    design = solve_durations(fused_problem(case, tried))
    compared = efficiencies(design)
    files = {"durations.json": durations_json(design, compared=compared), "covariances.json": covariances_json(tried)}
    alone = [item.primitive.name for item in tried if not item.informative]
    facts = {"trials_of_each": trials, **({"not_informative_on_their_own": alone} if alone else {})}
    document = Document(facts=facts, sections=tabled(covariance_table(tried))) + design_document(design, compared)
    return written(request, case, files, document, progress)
