"""A scenario: everything a trial is planned from, typed and checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from expdesign.dictionary.spec import PrimitiveSpec
from expdesign.durations.growing_values import GrowSettings
from expdesign.plan.area import SeaArea
from expdesign.plan.values import PlanSettings
from expdesign.simulation.environment import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True)
class DesignSettings:
    """Wishes for the durations.

    Attributes:
        total_s: informative time to share out [s].
        criterion: name of a design criterion; "D".
        mean_subtraction: "none", "batch" or "complete".
        fixed_parameters: parameters held at the vessel file's values and not estimated.
        grow: how to add manoeuvres to the dictionary, or None to leave it as it is.
    """

    total_s: float
    criterion: str = "D"
    mean_subtraction: str = "complete"
    fixed_parameters: tuple[str, ...] = ()
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
