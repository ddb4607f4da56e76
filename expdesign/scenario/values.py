"""A scenario as typed and checked values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from expdesign.dictionary.spec import PrimitiveSpec
from expdesign.durations import Constraints
from expdesign.errors import NoPlan
from expdesign.growing import GrowSettings
from expdesign.plan.values import PlanSettings, UnderWay
from expdesign.sea_area import SeaArea
from expdesign.shortest_day import AccuracySettings
from expdesign.simulation.environment import Environment
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel, column_name


@dataclass(frozen=True, kw_only=True)
class DesignSettings:
    """Settings of the durations."""

    total_s: float  # total informative time of all primitives [s]
    criterion: str = "D"  # name of a design criterion: "D", "D_s", "A", "E", "V" or "T"
    mean_subtraction: str = "complete"  # "none", "batch" or "complete"
    fixed_parameters: tuple[str, ...] = ()  # parameters held at the vessel file's values and not estimated
    interest: tuple[str, ...] = ()  # parameters of interest in D_s, A and E; empty for all
    # unit of parameter errors in A and E: their "nominal" size or their prior standard deviation, "parameter_std"
    relative_to: str = "nominal"
    # unit of error of single parameters, instead of that
    parameter_units: Mapping[str, float] = field(default_factory=dict)
    outcomes: tuple[str, ...] = ()  # predicted outcomes in V, keys of `indices.OUTCOMES`
    # unit of error of an outcome; its nominal size where not given
    outcome_units: Mapping[str, float] = field(default_factory=dict)
    outcome_speed_mps: float | None = None  # approach speed of the predicted trials, or None for the nominal one
    # "model" for the model's terms; with nuisance regressors, too, "augmented", "wind", "no-current" or "no-wind"
    predictor: str = "model"
    excitation: str = "free"  # which samples count in each equation: "free", "rewarded" or "required"
    robust: str = "nominal"  # "nominal", "average" or "worst"
    prior_samples: int = 0  # models drawn from the prior
    prior: str = "none"  # prior information, "none" or "parameter_std"
    prior_data: tuple[Path, ...] = ()  # files of earlier trials, whose information is added to the prior
    # on durations; a budget without costs is of the mean over the run of the sum of |n|^3 of all propellers and
    # thrusters [rps3], which grows like shaft power
    limits: Constraints = field(default_factory=Constraints)
    # causes that a diagnosis of the trial must reveal; tell_apart: pairs that it must tell apart
    reveal: tuple[str, ...] = ()
    tell_apart: tuple[tuple[str, str], ...] = ()
    # of causes, in the unit of their effects, instead of those that matter
    reveal_sizes: Mapping[str, float] = field(default_factory=dict)
    grow: GrowSettings | None = None  # settings of the dictionary growth, or None for no growth
    # what the shortest day must reach, or None for the most information in total_s of runs
    accuracy: AccuracySettings | None = None


@sealed(start="3", goal="3")
class Scenario:
    """A scenario file and the files that it names, as values."""

    name: str  # of the scenario; also the default folder of its results
    path: Path  # the scenario file
    vessel: Vessel  # with its nominal model
    dictionary: tuple[PrimitiveSpec, ...]  # specifications of the primitives, not yet simulated
    area: SeaArea  # allowed water
    # design, plan: settings
    design: DesignSettings
    plan: PlanSettings
    # start, goal: (3,) poses in the area's frame [north m, east m, heading rad]; the ship ends at rest
    start: Array
    goal: Array
    environment: Environment  # forecast
    under_way: UnderWay | None = None  # how the ship moves at the start; None where it is at rest through the water
    told: tuple[str, ...] = ()  # notes on what imports of measured data tell of the vessel

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the files state and the trial does not use, or what it takes as certain; one line each."""
        model, weather = self.vessel.model, self.environment
        unread = [column_name(name) for name in model.unread_inputs]
        wind = weather.wind_to.any() or weather.wind_std_mps or weather.wind_variation.std_mps
        current = weather.current_to.any() or weather.current_std_mps or weather.current_variation.std_mps
        still = [name for name in ("u", "v") if name not in model.read_signals(name)] if current else []
        certain = [name for name, std in zip(model.names, model.drawn_std.tolist(), strict=True) if not std]
        unstated = [
            name
            for name, std in zip(model.names, model.parameter_std.tolist(), strict=True)
            if not std and name not in certain
        ]
        value_of = dict(zip(model.names, model.parameters.tolist(), strict=True))
        known = ", ".join(certain)
        if len(certain) == len(model.names):
            known = f"every parameter of the model: {known}"
        return (
            *self.told,
            *(["environment.wind_to moves no ship here: no term of the vessel's model reads the wind"]
              if wind and not {"u_q", "v_q"} & model.read_signals() else []),
            *(f"environment.current_to does not act on {name}: no term of {name} in the vessel's model reads {name}"
              for name in still),
            *([f"no term of the vessel's model reads {', '.join(unread)}, so that these commands and their limits move "
               "no ship"] if unread else []),
            *([f"exactly known in drawn trials: {known}"] if certain else []),
            *([f"no model.parameter_std of {', '.join(unstated)}: ships of drawn trials differ in them by "
               f"{100 * model.unstated_std[unstated[0]] / abs(value_of[unstated[0]]):.3g} % of their values "
               "(model.parameter_std_unstated)"] if unstated else []),
            *(["plan.paths does not act: it is of ships that turn on the spot, and this one does not"]
              if self.plan.paths != PlanSettings.paths and not self._turns_on_the_spot else []),
            *(f"{key} does not act: {because}" for key, because in self._beside_others),
        )  # fmt: skip

    @property
    def _beside_others(self) -> list[tuple[str, str]]:
        """Keys that are stated, and act only beside others that are not; and which these are."""
        design, weather, plan = self.design, self.environment, self.plan
        predicted = design.outcomes or (design.accuracy is not None and design.accuracy.outcomes_95)
        cases = [
            ("plan.lattice_spacing_m", plan.lattice_spacing_m is not None, plan.planner == "lattice",
             "plan.planner is not 'lattice'"),
            ("design.outcome_speed_mps", design.outcome_speed_mps is not None, bool(predicted),
             "neither design.outcomes nor design.accuracy.outcomes_95 is given"),
            *((f"environment.{name}_to.correlation_s", varies.correlation_s > 0, varies.std_mps > 0,
               f"environment.{name}_to.variation_std_mps is 0")
              for name, varies in (("current", weather.current_variation), ("wind", weather.wind_variation))),
        ]  # fmt: skip
        return [(key, because) for key, stated, acts, because in cases if stated and not acts]

    @property
    def _turns_on_the_spot(self) -> bool:
        """Whether legs are those of a ship that does, or no legs are possible."""
        from expdesign.plan.control import AgileShip, capability

        try:
            return isinstance(capability(self.vessel, self.plan), AgileShip)
        except NoPlan:  # told where a trial is planned
            return True
