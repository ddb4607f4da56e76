"""A scenario: everything a trial is planned from, typed and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from expdesign.dictionary.spec import PrimitiveSpec
from expdesign.growing import GrowSettings
from expdesign.plan.values import PlanSettings
from expdesign.sea_area import SeaArea
from expdesign.simulation.environment import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True)
class BudgetSettings:
    """Something that is used up.

    Attributes:
        name: for reports.
        limit: what there is for the whole informative time.
        cost_per_s: use per second by primitive, where the user says it.
        use: what the use is computed from otherwise: "cubed_propeller_speed", the mean over the run of the sum of
            |n|^3 of all propellers and thrusters [rps3], which grows like shaft power.
    """

    name: str
    limit: float
    cost_per_s: Mapping[str, float]
    use: str | None = None


@dataclass(frozen=True, kw_only=True)
class DesignSettings:
    """Settings of the design.

    Attributes:
        total_s: informative time to share out [s].
        criterion: name of a design criterion: "D", "D_s", "A", "E" or "V".
        mean_subtraction: "none", "batch" or "complete".
        fixed_parameters: parameters held at the vessel file's values and not estimated.
        interest: parameters that D_s, A and E are about; empty for all.
        relative_to: what errors of parameters are counted in for A and E: their "nominal" size or their prior
            standard deviation, "parameter_std".
        parameter_units: error of a parameter that counts as one, instead of that.
        outcomes: what V predicts, keys of `indices.OUTCOMES`.
        outcome_units: error of an outcome that counts as one; its nominal size where not given.
        outcome_speed_mps: approach speed of the predicted trials, or None for the nominal one.
        predictor: "model" for the model's terms, "augmented" or "wind" with nuisance regressors besides.
        robust: "nominal", "average" or "worst".
        prior_samples: models drawn from the prior.
        prior: "none" or "parameter_std", what is known before.
        prior_data: files of earlier trials, whose information is added.
        least_s, most_s, required, excluded, budgets, balance: see `durations.Constraints`.
        grow: how to add manoeuvres to the dictionary, or None to leave it as it is.
    """

    total_s: float
    criterion: str = "D"
    mean_subtraction: str = "complete"
    fixed_parameters: tuple[str, ...] = ()
    interest: tuple[str, ...] = ()
    relative_to: str = "nominal"
    parameter_units: Mapping[str, float] = field(default_factory=dict)
    outcomes: tuple[str, ...] = ()
    outcome_units: Mapping[str, float] = field(default_factory=dict)
    outcome_speed_mps: float | None = None
    predictor: str = "model"
    robust: str = "nominal"
    prior_samples: int = 0
    prior: str = "none"
    prior_data: tuple[Path, ...] = ()
    least_s: Mapping[str, float] = field(default_factory=dict)
    most_s: Mapping[str, float] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    budgets: tuple[BudgetSettings, ...] = ()
    balance: float = 0.0
    grow: GrowSettings | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """What the user wrote, as values.

    Attributes:
        name: of the scenario; also the default folder of its results.
        path: the scenario file.
        vessel: with its nominal model.
        dictionary: the primitives to choose from, not yet simulated.
        area: allowed water.
        design, plan: settings.
        start, goal: (3,) poses in the area's frame [north m, east m, heading rad]; the ship starts and ends at rest.
        environment: forecast.
    """

    name: str
    path: Path
    vessel: Vessel
    dictionary: tuple[PrimitiveSpec, ...]
    area: SeaArea
    design: DesignSettings
    plan: PlanSettings
    start: Array
    goal: Array
    environment: Environment

    def __post_init__(self) -> None:
        seal(self, start="3", goal="3")
