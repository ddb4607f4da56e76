"""The duration problem of a scenario from covariances of simulated trials, (7.59)-(7.63)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import DurationProblem, build_fused
from expdesign.errors import InputError, NotInformative
from expdesign.export.files import strict_json
from expdesign.progress import Progress, silent
from expdesign.rehearsal import Alone, estimates_alone
from expdesign.scenario import Scenario
from expdesign.workflows.outcome import TextTable
from expdesign.workflows.steps.design_problem import aim_of, constraints_of
from expdesign.workflows.steps.scored import parameters_of


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


def covariance_table(tried: Sequence[Alone]) -> TextTable:
    """Trials of each primitive, and its largest bias beside the scatter."""
    return TextTable(
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
