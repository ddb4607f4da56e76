"""The dictionary of a scenario, scored."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.dictionary import PrimitiveSpec, build_dictionary
from expdesign.durations import bordered, pool_gains
from expdesign.export import (
    dictionary_json,
)
from expdesign.information import PrimitiveInformation, estimated_parameters, score_primitives
from expdesign.memory import recalled
from expdesign.progress import Progress, silent
from expdesign.scenario import Scenario
from expdesign.vessel import Environment, Vessel
from expdesign.workflows.outcome import TextTable


def scored(case: Scenario, *, progress: Progress = silent) -> tuple[PrimitiveInformation, ...]:
    """Information of every primitive of a scenario."""
    return recalled(
        _scored,
        case.vessel,
        case.dictionary,
        case.environment,
        case.design.fixed_parameters,
        case.design.mean_subtraction,
        case.design.excitation,
        progress=progress,
    )


def _scored(
    vessel: Vessel,
    dictionary: Sequence[PrimitiveSpec],
    environment: Environment,
    fixed_parameters: tuple[str, ...],
    mean_subtraction: str,
    excitation: str,
    *,
    progress: Progress,
) -> tuple[PrimitiveInformation, ...]:
    progress("simulating the dictionary", 0.0)
    primitives = build_dictionary(vessel, dictionary)
    progress("scoring the dictionary", 0.5)
    return score_primitives(
        vessel,
        primitives,
        environment=environment,
        fixed_parameters=fixed_parameters,
        mean_subtraction=mean_subtraction,
        excitation=excitation,
    )


def score_files(case: Scenario, information: Sequence[PrimitiveInformation]) -> dict[str, str | bytes]:
    """`dictionary.json`."""
    text = dictionary_json(
        information, parameters_of(case), vessel=case.vessel, mean_subtraction=case.design.mean_subtraction
    )
    return {"dictionary.json": text}


def ranking(case: Scenario, information: Sequence[PrimitiveInformation]) -> TextTable:
    """Primitives by what they add beside all others, which also ranks those that do not inform alone."""
    gains = pool_gains(np.array([bordered(item, case.design.mean_subtraction) for item in information]))
    order = np.argsort(np.where(np.isnan(gains), np.inf, -gains), kind="stable")
    return TextTable(
        title="Primitives by what they add to log det beside all others, and alone",
        header=("rank", "primitive", "gain beside the pool", "log det alone"),
        rows=tuple(
            (
                str(rank),
                information[q].primitive.name,
                "-" if np.isnan(gains[q]) else f"{gains[q]:.3g}",
                "singular" if (alone := information[q].log_det_alone) is None else f"{alone:.4g}",
            )
            for rank, q in enumerate(order, start=1)
        ),
    )


def parameters_of(case: Scenario) -> tuple[str, ...]:
    """Parameters that a scenario estimates, in order."""
    return estimated_parameters(case.vessel.model, case.design.fixed_parameters)
