"""The tables of an area file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from expdesign.scenario.tables import NonNegative, Number, Positive, Table, Text

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=360)]


class NameTable(Table):
    """`[area]`."""

    name: Text = Field(description="a name for the area")


class ChartTable(Table):
    """`[chart]`: a GeoJSON file with the layers to use, or an S-57 cell."""

    geojson: Text | None = Field(default=None, description="the path of a GeoJSON chart, from this file")
    s57: Text | None = Field(
        default=None,
        description="the path of an S-57 cell, *.000, instead of geojson; update files in the same folder are applied",
    )
    outlines: Literal["water", "land"] | None = Field(
        default=None,
        description="what the polygons of a GeoJSON chart enclose that name no layer; with 'water', those inside "
        "others are islands, and everything outside is land",
    )
    land_layers: list[Text] = Field(default=["land"], description="the layers of the GeoJSON chart that are land")
    water_layers: list[Text] = Field(
        default=[],
        description="the layers of the GeoJSON chart that are water of unknown depth; everything outside is land",
    )
    layer_property: Text = Field(default="layer", description="the property that names the layer of a GeoJSON feature")
    depth_layers: dict[str, Number] | None = Field(
        default=None, description="the GeoJSON layers of water with their least depth [m], e.g. {seabed5m = 5.0}"
    )
    depth_property: Text | None = Field(
        default=None, description="the property that holds the depth of a GeoJSON area [m], instead of depth_layers"
    )
    depth_positive: Literal["down", "up"] | None = Field(
        default=None,
        description="how depths in a GeoJSON chart count: 'down' for depths, 'up' for heights, which are negative "
        "below the surface; needed where most are negative",
    )
    skip_features: list[int | Text] = Field(
        default=[],
        description="the features of the GeoJSON chart to leave out, by number from 1 or by type of geometry, e.g. "
        "[3, 'LineString']; the report names them",
    )
    danger_layers: list[Text] | None = Field(
        default=None,
        description="the GeoJSON layers of dangers; when not given, features whose layer or type is a word for one; "
        "the report says what each is taken for",
    )
    hazard_margin_m: Positive = Field(default=25.0, description="the distance kept from points of danger [m]")
    air_draught_m: Positive | None = Field(
        default=None, description="the ship's height above water [m]; when not given, bridges and cables are closed"
    )
    notice: str = Field(default="", description="a notice of copyright for the report")

    def below(self, stated_m: float) -> float:
        """The depth below the surface of a depth or height that the GeoJSON chart states [m]."""
        return -stated_m if self.depth_positive == "up" else stated_m


class BoundsTable(Table):
    """`[bounds]`."""

    south_deg: Latitude = Field(description="the southern latitude [deg]")
    west_deg: Longitude = Field(description="the western longitude [deg]")
    north_deg: Latitude = Field(description="the northern latitude [deg]")
    east_deg: Longitude = Field(description="the eastern longitude [deg]")


class DepthTable(Table):
    """`[depth]`: charted depth plus tide must be at least draught plus depth under the keel."""

    under_keel_m: NonNegative = Field(default=1.0, description="the least depth under the keel [m]")
    tide_m: Number = Field(
        default=0.0, description="the height of tide above chart datum [m], one number for the trial"
    )


class NoGoTable(Table):
    """One of `[[no_go]]`."""

    name: Text = Field(description="a name for the zone")
    polygon: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] = Field(
        min_length=3, description="a list of corners [latitude, longitude] in degrees"
    )


class AreaTable(Table):
    """The whole file."""

    topic = "area"

    area: NameTable = Field(description="a table [area] with a name")
    chart: ChartTable = Field(description="a table [chart] with the chart file")
    bounds: BoundsTable | None = Field(
        default=None, description="the table [bounds] of the sea area; the extent of the chart when not given"
    )
    depth: DepthTable = Field(default=DepthTable(), description="the depth under the keel and the tide")
    no_go: list[NoGoTable] = Field(default=[], description="the tables [[no_go]] of zones to keep out of")
