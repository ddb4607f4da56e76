"""How accurately a planned trial is expected to tell each parameter, for plan.json and the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from expdesign.durations import DurationProblem
from expdesign.errors import NoAnswer
from expdesign.export.files.text import finite
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.plan.values import Plan
from expdesign.plan.verify import part_of_track
from expdesign.shortest_day import AccuracySettings
from expdesign.simulation.environment import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedAccuracy:
    """Standard deviations (p,) in the order and the units of the parameters to be estimated."""

    parameters: tuple[str, ...]
    nominal: Array  # their values in the vessel file
    before: Array  # prior, zero where none was stated
    runs: Array  # of estimates from the informative runs alone; nan where they cannot be estimated
    track: Array  # of estimates from the whole track
    asked: Array  # largest that the scenario asks for, nan where it asks for none

    def __post_init__(self) -> None:
        seal(self, nominal="p", before="p", runs="p", track="p", asked="p")


def planned_accuracy(
    plan: Plan,
    problem: DurationProblem,
    *,
    vessel: Vessel,
    environment: Environment,
    asked: AccuracySettings | None = None,
) -> PlannedAccuracy:
    """Standard deviations expected of instrumental variables, to first order in the vessel file's sensor noise."""
    model, sailed, names = vessel.model, plan.sailed, problem.parameters

    def deviations(parts: Sequence[TrialPart]) -> Array:
        try:
            covariance = expected_covariance(
                vessel,
                parts,
                names,
                environment=environment,
                mean_subtraction=problem.mean_subtraction,
                unknown_current=environment.current_std_mps > 0,
            )
        except NoAnswer:
            return np.full(len(names), np.nan)
        return np.sqrt(np.maximum(np.diag(covariance), 0.0))

    place = [model.names.index(name) for name in names]
    nominal = model.parameters[place]
    return PlannedAccuracy(
        parameters=names,
        nominal=nominal,
        before=model.parameter_std[place],
        runs=deviations([part_of_track(sailed, leg.first, leg.last) for leg in sailed.legs if leg.kind == "primitive"]),
        track=deviations([part_of_track(sailed)]),
        asked=np.array([_asked(asked, *pair) for pair in zip(names, nominal.tolist(), strict=True)]),
    )


def _asked(settings: AccuracySettings | None, name: str, nominal: float) -> float:
    """The least of the standard deviations that settings allow a parameter."""
    if settings is None:
        return np.nan
    relative = settings.relative_std.get(name, np.inf) * abs(nominal)
    least = min(settings.std.get(name, np.inf), relative)
    return least if np.isfinite(least) else np.nan


def accuracy_entries(found: PlannedAccuracy) -> dict[str, dict[str, Any]]:
    """The entry `parameters` of plan.json; null where a value is not known."""
    rows = zip(found.parameters, found.nominal, found.before, found.runs, found.track, found.asked, strict=True)
    return {
        name: {
            "nominal": float(nominal),
            "std_before": float(before) or None,
            "std_after_runs": finite(float(runs)),
            "std_after": finite(float(track)),
            "std_asked": finite(float(asked)),
        }
        for name, nominal, before, runs, track, asked in rows
    }
