"""The tables of an area file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from expdesign.scenario.tables import NonNegative, Number, Positive, Table, Text

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=360)]


class NameTable(Table):
    """`[area]`."""

    name: Text = Field(description="a name for the area")


class ChartTable(Table):
    """`[chart]`: a GeoJSON file with the layers to use, or an S-57 cell."""

    geojson: Text | None = None
    s57: Text | None = None
    land_layers: list[Text] = Field(default=["land"])
    layer_property: Text = "layer"
    depth_layers: dict[str, Number] | None = None
    depth_property: Text | None = None
    hazard_margin_m: Positive = 25.0
    air_draught_m: Positive | None = None
    notice: str = ""


class BoundsTable(Table):
    """`[bounds]`."""

    south_deg: Latitude = Field(description="the southern latitude [deg]")
    west_deg: Longitude = Field(description="the western longitude [deg]")
    north_deg: Latitude = Field(description="the northern latitude [deg]")
    east_deg: Longitude = Field(description="the eastern longitude [deg]")


class DepthTable(Table):
    """`[depth]`: charted depth plus the tide must exceed the draught by what is kept under the keel."""

    under_keel_m: NonNegative = 1.0
    tide_m: Number = 0.0


class NoGoTable(Table):
    """One of `[[no_go]]`."""

    name: Text = Field(description="a name for the zone")
    polygon: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] = Field(
        min_length=3, description="a list of [latitude, longitude]"
    )


class AreaTable(Table):
    """The whole file."""

    area: NameTable = Field(description="a table [area] with a name")
    chart: ChartTable = Field(description="a table [chart] with the chart file")
    bounds: BoundsTable | None = None
    depth: DepthTable = DepthTable()
    no_go: list[NoGoTable] = Field(default=[])
