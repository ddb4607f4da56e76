"""The content of a report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.durations import DurationDesign, Efficiencies
from expdesign.export import words
from expdesign.export.files import Known, PlannedAccuracy, planned_accuracy
from expdesign.export.routes import Route
from expdesign.growing import Growth
from expdesign.information.moments import PrimitiveInformation, over_shares
from expdesign.plan.values import Plan
from expdesign.shortest_day import AccuracySettings, ShortestDay
from expdesign.simulation.environment import Environment
from expdesign.values import Array, readonly, sealed
from expdesign.vessel import Vessel


@sealed(start="3", goal="3")
class ReportContent:
    """The values that the report shows."""

    scenario: str  # name
    vessel: Vessel  # with its nominal model
    environment: Environment  # the forecast
    # start, goal: (3,) poses asked for [north m, east m, heading rad]
    start: Array
    goal: Array
    criterion: str  # of the design, e.g. "D".
    fixed_parameters: tuple[str, ...]  # parameters that are not estimated
    clearance_m: float  # least distance from the hull to forbidden water that is required [m]
    confidence: float  # share of sampled truths that must stay in safe water
    information: tuple[PrimitiveInformation, ...]  # of every primitive in the dictionary, in the order of the design
    design: DurationDesign  # the durations with their certificate
    plan: Plan  # the trial; a plan that failed its checks is shown as such
    command: str  # the command line that reproduces the result
    compared: tuple[Efficiencies, ...] = ()  # the design under every criterion
    route: Route | None = None  # the waypoints as exported, or None when there are none
    known: Known | None = None  # the state of a trial in progress, or None for a new trial
    growth: Growth | None = None  # additions to the dictionary, or None without a search
    day: ShortestDay | None = None  # how the day was found to be the shortest, or None where total_s decides
    asked: AccuracySettings | None = None  # the accuracy that the scenario asks for
    remarks: tuple[str, ...] = ()  # what the files state and the trial does not use, or takes as certain; one line each

    @cached_property
    def _names(self) -> dict[str, str]:
        made = (item.primitive for item in self.information)
        return words.names((one.name, one.family, one.settings) for one in made)

    def shown(self, name: str) -> str:
        """The name of a manoeuvre as people say it."""
        return self._names.get(name, name)

    @cached_property
    def accuracy(self) -> PlannedAccuracy:
        """How accurately the trial is expected to tell each parameter."""
        return planned_accuracy(
            self.plan, self.design.problem, vessel=self.vessel, environment=self.environment, asked=self.asked
        )

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters to be estimated."""
        return self.design.problem.parameters

    @property
    def parameter_std(self) -> Array:
        """(p,) prior standard deviations of the parameters to be estimated, zero where none was stated."""
        model = self.vessel.model
        known = dict(zip(model.names, model.parameter_std.tolist(), strict=True))
        return np.array([known[name] for name in self.parameters])


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run of a primitive in the plan."""

    number: int  # as on the chart, from 1
    leg: int  # index of its leg, from 0, as in the files


def primitive_runs(plan: Plan) -> tuple[Run, ...]:
    """The runs of primitives in time order, numbered from 1."""
    legs = [index for index, leg in enumerate(plan.legs) if leg.kind == "primitive"]
    return tuple(Run(number=number, leg=leg) for number, leg in enumerate(legs, start=1))


def information_rate(content: ReportContent) -> Array:
    """(q, p) information per sample of each primitive about each parameter alone.

    With complete mean subtraction the design's means are taken off, so that the rows weighted by the time fractions
    add up to the diagonal of the design's information matrix; with batchwise subtraction each run's own means.
    """
    names = ("X", "Y", "Z", "used")
    X, Y, Z, used = (np.array([getattr(item, name) for item in content.information]) for name in names)
    subtraction = content.design.problem.mean_subtraction
    if subtraction == "none":
        matrices = X
    elif subtraction == "batch":
        matrices = X - np.array([item.YZ for item in content.information])
    else:
        weights = content.design.fractions
        share = weights @ used
        mean_y, mean_z = (over_shares(np.tensordot(weights, part, axes=1), share) for part in (Y, Z))
        taken = (mean_y * used[:, None, :]) @ mean_z.T
        matrices = X - Y @ mean_z.T - mean_y @ Z.transpose(0, 2, 1) + taken
    return readonly(np.diagonal(matrices, axis1=1, axis2=2))


def relative_information(content: ReportContent) -> Array:
    """(q, p) information rate relative to the most informative primitive for the parameter: 0 to 1."""
    rate = information_rate(content)
    best = rate.max(axis=0)
    return readonly(np.divide(rate, best, out=np.zeros_like(rate), where=best > 0))
