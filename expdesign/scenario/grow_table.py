"""`[design.grow]`: how to search for manoeuvres that add to the dictionary."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from expdesign.dictionary import FAMILIES
from expdesign.growing import GrowSettings
from expdesign.scenario.tables import Entry, Number, Positive, Table, Text, shown

Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class LimitsTable(Table):
    """Velocities through calm water that additions keep to; what is not given, the dictionary's own."""

    u_mps: Pair | None = None
    v_mps: Pair | None = None
    r_radps: Pair | None = None


class GrowTable(Table):
    """The whole table; what is not given stays as in `GrowSettings`."""

    families: list[Text] | None = None
    rounds: Annotated[int, Field(ge=1, le=200)] | None = None
    tolerance: Positive | None = None
    limits: LimitsTable = LimitsTable()
    free_form: bool | None = None
    run_s: Positive | None = None
    pool: Annotated[int, Field(ge=8, le=65536)] | None = None
    seed: Annotated[int, Field(ge=0)] | None = None


def build_grow(table: GrowTable, entry: Entry) -> GrowSettings:
    """The wishes of a checked table.

    Raises:
        FileError: a family that there is not, or a limit whose low is not below its high.
    """
    known = [item.name for item in FAMILIES if item.name != "recorded"]
    for number, name in enumerate(table.families or [], start=1):
        if name not in known:
            raise entry.at("families").item(number).unknown(name, known)
    limits = {key: (pair[0], pair[1]) for key, pair in table.limits.model_dump(exclude_none=True).items()}
    for key, (low, high) in limits.items():
        if not low < high:
            raise entry.at("limits").at(key).error(f"is [{shown(low)}, {shown(high)}], expected low below high")
    given = table.model_dump(exclude_none=True, exclude={"limits", "families"})
    return GrowSettings(families=tuple(table.families or ()), limits=limits, **given)
