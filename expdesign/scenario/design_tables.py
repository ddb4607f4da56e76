"""Tables of the design in a scenario file: `[design]`, `[design.accuracy]` and `[[design.budgets]]`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from expdesign.dictionary import FAMILIES
from expdesign.growing import GrowSettings
from expdesign.scenario.tables import (
    Entry,
    NonNegative,
    Positive,
    PositiveSpeed,
    Speed,
    Table,
    Text,
    YawRate,
    shown,
)

# `[design.grow]`: the search for manoeuvres that add information to the dictionary.

Speeds = Annotated[list[Speed], Field(min_length=2, max_length=2)]
YawRates = Annotated[list[YawRate], Field(min_length=2, max_length=2)]


class LimitsTable(Table):
    """Velocity limits of additions in calm water; the dictionary's range where not given."""

    u_mps: Speeds | None = Field(
        default=None, description="the lowest and highest surge speed [m/s]; the dictionary's range when not given"
    )
    v_mps: Speeds | None = Field(
        default=None, description="the lowest and highest sway speed [m/s]; the dictionary's range when not given"
    )
    r_radps: YawRates | None = Field(
        default=None, description="the lowest and highest yaw rate [rad/s]; the dictionary's range when not given"
    )


class GrowTable(Table):
    """`[design.grow]`."""

    families: list[Text] = Field(
        default=[], description="the manoeuvre families to search; all that the vessel can do if empty"
    )
    rounds: int = Field(default=GrowSettings.rounds, ge=1, le=200, description="the largest number of additions")
    tolerance: Positive = Field(
        default=GrowSettings.tolerance,
        description="the relative gain at which the search ends: when no candidate has a sensitivity "
        "above (1 + tolerance) times the number of parameters",
    )
    limits: LimitsTable = Field(
        default=LimitsTable(), description="the limits on the velocities of added manoeuvres in calm water"
    )
    free_form: bool = Field(
        default=GrowSettings.free_form, description="whether the commands of the best candidate are optimised, too"
    )
    run_s: Positive | None = Field(
        default=GrowSettings.run_s,
        description="the duration of an added run [s]; the median of the present runs when not given",
    )
    pool: int = Field(
        default=GrowSettings.pool,
        ge=8,
        le=65536,
        description="the number of initial candidates of each family",
    )
    seed: Annotated[int, Field(ge=0)] | None = Field(
        default=GrowSettings.seed, description="the seed of the search; that of the command when not given"
    )


def build_grow(table: GrowTable, entry: Entry) -> GrowSettings:
    """The settings of a checked table.

    Raises:
        FileError: an unknown family, or a limit whose low is not below its high.
    """
    known = [item.name for item in FAMILIES if item.name != "recorded"]
    for number, name in enumerate(table.families, start=1):
        if name not in known:
            raise entry.at("families").item(number).unknown(name, known)
    limits = {key: (pair[0], pair[1]) for key, pair in table.limits.model_dump(exclude_none=True).items()}
    for key, (low, high) in limits.items():
        if not low < high:
            raise entry.at("limits").at(key).error(f"is [{shown(low)}, {shown(high)}], expected low below high")
    given = table.model_dump(exclude={"limits", "families"})
    return GrowSettings(families=tuple(table.families), limits=limits, **given)


MOST_SAMPLES = 500


class BudgetTable(Table):
    """One of `[[design.budgets]]`."""

    name: Text = Field(description="a name for reports, e.g. 'energy'")
    limit: NonNegative = Field(description="the amount available for the whole informative time")
    cost_per_s: dict[str, NonNegative] = Field(default={}, description="the use per second of each primitive, by name")
    use: Literal["cubed_propeller_speed"] | None = Field(
        default=None,
        description="the use computed instead of stated: the mean over a run of the sum of the propellers' speeds "
        "cubed [rps3], which grows like shaft power",
    )


LONGEST_TOTAL_S = 1e6
MOST_STARTS = 100


class AccuracyTable(Table):
    """`[design.accuracy]`."""

    as_: Literal["durations"] | None = Field(
        default=None,
        alias="as",
        description="'durations': as accurate by the design criterion as the optimal durations are in total_s",
    )
    std: dict[str, Positive] = Field(
        default={}, description="the largest standard deviation of parameters, in their units, e.g. {X_u = 0.01}"
    )
    relative_std: dict[str, Positive] = Field(
        default={}, description="the largest standard deviation as a share of the nominal value, e.g. {X_u = 0.05}"
    )
    outcomes_95: dict[str, Positive] = Field(
        default={},
        description="the largest half-width of the 95 % interval of predicted results of standard trials, e.g. "
        "{advance_m = 5.0}, see expdesign explain outcomes; design.outcome_speed_mps is their approach speed",
    )
    most_s: Positive | None = Field(default=None, description="the longest day allowed [s]; no limit when not given")
    grow: bool = Field(
        default=True,
        description="whether manoeuvres are searched for, and added, that shorten the day; [design.grow] limits them",
    )
    starts: int = Field(
        default=1,
        ge=1,
        le=MOST_STARTS,
        description="how many independent searches for manoeuvres and day are made, side by side where there are "
        "processes; the day whose drawn trials end soonest is taken. More take longer and depend less on luck",
    )


class DesignTable(Table):
    """`[design]`."""

    total_s: Positive = Field(description="the total informative time of all primitives [s]")
    criterion: Literal["D", "D_s", "A", "E", "V", "T"] = Field(
        default="D", description="the design criterion, see expdesign explain criteria"
    )
    mean_subtraction: Literal["none", "batch", "complete"] = Field(
        default="complete",
        description="the mean that the estimator subtracts from its instruments, against constant disturbances: of "
        "each batch, of the complete data, or none",
    )
    fixed_parameters: list[Text] = Field(
        default=[], description="the parameters that stay at the vessel file's values and are not estimated"
    )
    interest: list[Text] = Field(
        default=[],
        description="the parameters of interest in criteria D_s, A and E; the others are estimated, too; all if empty",
    )
    relative_to: Literal["nominal", "parameter_std"] = Field(
        default="nominal",
        description="the unit of parameter errors in criteria A and E: nominal value or prior standard deviation",
    )
    parameter_units: dict[str, Positive] = Field(
        default={}, description="the unit of error of single parameters, e.g. {X_u = 0.01}, instead of relative_to"
    )
    outcomes: list[Text] = Field(
        default=[],
        description="the results of standard trials that criterion V predicts, see expdesign explain outcomes",
    )
    outcome_units: dict[str, Positive] = Field(
        default={}, description="the unit of error of an outcome; its nominal size when not given"
    )
    outcome_speed_mps: PositiveSpeed | None = Field(
        default=None,
        description="the approach speed of the predicted standard trials [m/s]; at 85 % of power when not given",
    )
    predictor: Literal["model", "augmented", "wind", "no-current", "no-wind"] = Field(
        default="model",
        description="the terms that are estimated: the model's; 'augmented' with those of an unknown current and wind; "
        "'no-current' with those of the wind alone, 'no-wind' with those of the current alone; 'wind' with measured "
        "wind and those of an unknown current; use all but the first with criterion D_s",
    )
    excitation: Literal["free", "rewarded", "required"] = Field(
        default="free",
        description="the samples whose information counts: 'free', all; 'rewarded', for each equation those at which "
        "what stands inside its absolute values is farther from zero than three standard deviations of the sensors, "
        "and the current, as in expdesign estimate --samples equation-wise; 'required', the same of manoeuvres only "
        "that, once clear, stay so, for at least half of their time. Where velocities are noisy, only such samples "
        "leave no bias, given a mean_subtraction; expdesign validate estimates from them, too",
    )
    robust: Literal["nominal", "average", "worst"] = Field(
        default="nominal",
        description="the models in the criterion: the nominal one, or the average or the worst over models drawn from "
        "[model.parameter_std]",
    )
    prior_samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] | None = Field(
        default=None, description="the number of models drawn where robust is not 'nominal'; 20 when not given"
    )
    prior: Literal["none", "parameter_std"] = Field(
        default="none",
        description="the prior information: none, or that of the vessel's [model.parameter_std] and "
        "[model.parameter_correlation]",
    )
    prior_data: list[Text] = Field(
        default=[], description="the CSV files of earlier trials, whose information is prior information"
    )
    least_s: dict[str, NonNegative] = Field(
        default={}, description="the least time of a primitive [s], e.g. {acceleration = 120.0}"
    )
    most_s: dict[str, NonNegative] = Field(default={}, description="the most time of a primitive [s]")
    required: list[Text] = Field(default=[], description="the primitives that get at least one run")
    excluded: list[Text] = Field(default=[], description="the primitives that get no time")
    budgets: list[BudgetTable] = Field(
        default=[], description="the tables [[design.budgets]] of limited resources; time may then stay unused"
    )
    balance: Annotated[float, Field(ge=0, lt=1)] = Field(
        default=0.0,
        description="the least D-efficiency for each of surge, sway and yaw, relative to the optimum for it alone",
    )
    reveal: list[Text] = Field(
        default=[],
        description="the causes that a diagnosis of the trial must reveal with a probability of 90 % each, at sizes "
        "that matter, however they act, e.g. ['wind', 'gyro_scale']; see expdesign explain causes and expdesign "
        "foresee",
    )
    tell_apart: list[list[Text]] = Field(
        default=[],
        description="the pairs of causes that it must tell apart with that probability, e.g. [['actuator_lag', "
        "'actuator_delay']]",
    )
    reveal_sizes: dict[str, Positive] = Field(
        default={},
        description="the size of a cause in reveal or tell_apart, in the unit of its effects in foresee.json, instead "
        "of one that matters, e.g. {actuator_lag = 0.5}",
    )
    grow: GrowTable | None = Field(
        default=None, description="a table [design.grow]: search for manoeuvres to add to the dictionary"
    )
    accuracy: AccuracyTable | None = Field(
        default=None,
        description="a table [design.accuracy]: plan the shortest day whose whole track, legs included, is this "
        "accurate; total_s is then only the time that 'durations' means",
    )
    day_s: Positive | None = Field(
        default=None,
        description="plan the day of this length [s], everything between start and goal included, whose whole track "
        "has the most information by the criterion; total_s then serves for comparison only; instead of "
        "[design.accuracy]",
    )
