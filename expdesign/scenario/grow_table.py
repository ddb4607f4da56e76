"""`[design.grow]`: the search for manoeuvres that add information to the dictionary."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from expdesign.dictionary import FAMILIES
from expdesign.growing import GrowSettings
from expdesign.scenario.tables import Entry, Number, Positive, Table, Text, shown

Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class LimitsTable(Table):
    """Velocity limits of additions in calm water; the dictionary's range where not given."""

    u_mps: Pair | None = Field(
        default=None, description="the lowest and highest surge speed [m/s]; the dictionary's range when not given"
    )
    v_mps: Pair | None = Field(
        default=None, description="the lowest and highest sway speed [m/s]; the dictionary's range when not given"
    )
    r_radps: Pair | None = Field(
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
