"""Expected uncertainty of the parameters: before the trial, after its runs, and after the whole track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import NoAnswer
from expdesign.export.report.content import ReportContent
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.signals import Commands
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Expected:
    """Standard deviations (p,) in the order of the parameters.

    Attributes:
        before: prior, zero where none was stated.
        runs: of estimates from the informative runs alone; nan where they cannot be estimated.
        track: of estimates from the whole track.
    """

    before: Array
    runs: Array
    track: Array

    def __post_init__(self) -> None:
        seal(self, before="p", runs="p", track="p")


def expected(content: ReportContent) -> Expected:
    """By first-order propagation of the vessel file's sensor noise through instrumental-variable estimation."""
    plan = content.plan
    runs = [leg for leg in plan.legs if leg.kind == "primitive"]
    whole = [_part(content, 0, len(plan.commands))]
    return Expected(
        before=content.parameter_std,
        runs=_std(content, [_part(content, leg.first, leg.last) for leg in runs]),
        track=_std(content, whole),
    )


def _part(content: ReportContent, first: int, last: int) -> TrialPart:
    commands, motion = content.plan.commands, content.plan.trajectory
    return TrialPart(
        commands=Commands(
            sample_time_s=commands.sample_time_s, names=commands.names, values=commands.values[first:last]
        ),
        velocity=motion.velocity[first],
        heading_rad=float(motion.pose[first, 2]),
        standing=commands.values[first - 1] if first else None,
    )


def _std(content: ReportContent, parts: list[TrialPart]) -> Array:
    try:
        covariance = expected_covariance(
            content.vessel,
            parts,
            content.parameters,
            environment=content.environment,
            mean_subtraction=content.design.problem.mean_subtraction,
        )
    except NoAnswer:
        return np.full(len(content.parameters), np.nan)
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


def measures_velocity(content: ReportContent) -> bool:
    """Whether the vessel file states noise to propagate."""
    sensors = content.vessel.sensors
    return sensors.velocity_mps > 0 or sensors.yaw_rate_radps > 0
