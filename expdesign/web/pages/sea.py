"""The sea area: chart, no-go zones, start and goal, drawn and moved on the map."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from shlex import quote
from typing import Any
from urllib.parse import urlencode

from nicegui import events, ui

from expdesign.errors import InputError
from expdesign.scenario.charts.zones import AreaTable
from expdesign.scenario.scenario_file import ScenarioFile
from expdesign.scenario.tables import Entry, check_table, read_toml
from expdesign.web import answers
from expdesign.web.forms import Form
from expdesign.web.site import Site, Watched, dropped, framed, spelled, told, wrong

DEGREES = 7  # decimals of positions that are written, about a centimetre
LEGEND = (
    ("water to plan in", "#dcebf5"),
    ("water too shallow or closed", "#d9a5a0"),
    ("land", "#e3d7bd"),
    ("outside the area", "#b9c0c6"),
)
"""Words and colours of every chart, as in `static/chart.js`."""
CHARTS = (".geojson", ".json", ".000")


def register(site: Site) -> None:
    """Give the page its address."""

    @site.page("/sea")
    async def sea(scenario: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/sea", scenario) as watched:
            if not scenario:
                ui.label("Make a trial first, on the page Trial.")
                return
            await _Sea(site, scenario, watched).draw()


class _Sea:
    """The page of one scenario."""

    def __init__(self, site: Site, scenario: str, watched: Watched) -> None:
        self.site, self.scenario, self.watched = site, scenario, watched
        self.area = site.file_of(scenario, "area")
        self.ends: answers.Answer = {}

    async def draw(self) -> None:
        """The map on the left, what is on it on the right."""
        with ui.row().classes("two"):
            with ui.column().classes("wide"):
                self.map = chart_element(("start", "#0a7d4b"), ("goal", "#7a3ea1"), ("drag to turn", "#f5a400"))
                with ui.row().classes("line"):
                    ui.button("Draw a no-go zone", on_click=self._pen).tooltip("Click corners; end on the first one")
                    ui.button("Undo", on_click=self._undo).props("outline").tooltip(
                        "Take the last change of area or scenario back"
                    )
                    self.clear = ui.label().classes("clear").props('role="status"')
            self.side = ui.column().classes("narrow")
        ui.on("zone_drawn", self._drawn)
        ui.on("zone_changed", self._changed)
        ui.on("end_moving", self._moving)
        ui.on("end_moved", self._moved)
        await self.map.initialized()
        await self._fill()

    async def _fill(self) -> None:
        """Read the files anew and show them."""
        self.ends = await self.site.answer(answers.ends_of, str(self.site.folder.path(self.scenario)))
        draught = self.ends.get("draught_m", 0.0)
        query = urlencode({"area": self.area, "draught_m": draught})
        self.map.run_map_method("invalidateSize")
        ui.run_javascript(f"expd.chart({self.map.id}, '/chart?{query}', {json.dumps(self.ends)}, true)")
        self.watched.show(self.scenario, self.area)
        self.side.clear()
        with self.side:
            self._sides()
        await self._check()

    def _sides(self) -> None:
        problems = ui.column()
        if told(problems, self.ends) and self.ends.get("key", "").endswith("outlines"):
            self._ask_outlines()
        self.state = ui.column().props('role="status"')
        ui.label("No-go zones").classes("head2")
        zones = read_toml(self.site.folder.path(self.area)).get("no_go", [])
        for number, zone in enumerate(zones):
            with ui.row().classes("line"):
                name = ui.input(value=zone.get("name", ""), label=f"Zone {number + 1}").props("dense")
                name.on(
                    "blur",
                    lambda number=number, name=name: self._edit(lambda rows: rows[number].update(name=name.value)),
                )
                ui.button("Remove", on_click=lambda number=number: self._edit(lambda rows: rows.pop(number))).props(
                    "flat dense"
                )
        if not zones:
            ui.label("None yet. Draw one on the chart.").classes("quiet")
        ui.label("Another chart").classes("head2")
        ui.label("GeoJSON in longitude and latitude, or an S-57 cell (*.000).").classes("quiet")
        dropped("Open a chart", self._open, beside=self.site.folder.path(self.area).parent)
        with ui.expansion("Start, goal and plan as numbers").classes("table"):
            Form(self.site.folder, self.scenario, ScenarioFile, changed=self._fill_later).draw(
                "start", "goal", "plan", "environment"
            )
        with ui.expansion("The area file as numbers").classes("table"):
            Form(self.site.folder, self.area, AreaTable, changed=self._fill_later).draw(skip=("no_go",))
        spelled(f"expdesign run {quote(self.scenario)}", f"reads {self.scenario} and {self.area}")

    def _ask_outlines(self) -> None:
        """What the outlines of a chart without layers enclose."""
        ui.label("What is inside the outlines of this chart?").classes("head2")
        with ui.row():
            for inside in ("water", "land"):
                ui.button(inside.capitalize(), on_click=lambda inside=inside: self._set_chart({"outlines": inside}))

    async def _check(self) -> None:
        """What would be refused, at once."""
        found = await self.site.answer(answers.problem_of, str(self.site.folder.path(self.scenario)))
        self.state.clear()
        with self.state:
            if "problem" in found:
                if found["problem"] != self.ends.get("problem"):
                    wrong(found["problem"])
            else:
                ui.label("Start, goal and area can be planned in.").classes("good")
                for note in (*found["remarks"], *found["notes"]):
                    ui.label(note).classes("quiet")

    def _pen(self) -> None:
        ui.run_javascript(f"expd.pen({self.map.id})")

    def _undo(self) -> None:
        name = self.site.folder.last_changed(self.area, self.scenario)
        if not name:
            ui.notify("There is nothing to undo.")
            return
        self.site.folder.undo(name)
        self._fill_later()

    def _fill_later(self) -> None:
        self.watched.show(self.scenario, self.area)
        ui.timer(0.0, self._fill, once=True)

    def _drawn(self, event: events.GenericEventArguments) -> None:
        corners = _corners(event.args)
        number = len(read_toml(self.site.folder.path(self.area)).get("no_go", [])) + 1
        self._edit(lambda rows: rows.append({"name": f"zone {number}", "polygon": corners}))

    def _changed(self, event: events.GenericEventArguments) -> None:
        number, corners = int(event.args["number"]), _corners(event.args["corners"])
        self._edit(lambda rows: rows[number].update(polygon=corners))

    def _edit(self, change: Callable[[list[dict[str, Any]]], object]) -> None:
        """Change the zones of the area file, if the file can be read then."""
        path = self.site.folder.path(self.area)
        tables = read_toml(path)
        zones = [dict(zone) for zone in tables.get("no_go", [])]
        change(zones)
        try:
            check_table(AreaTable, {**tables, "no_go": zones}, Entry(path))
        except InputError as error:
            ui.notify(str(error), type="negative")
            return
        self.site.folder.change(self.area, lambda content: content.__setitem__("no_go", zones))
        self._fill_later()

    async def _moving(self, event: events.GenericEventArguments) -> None:
        """Clearance while a place is moved."""
        place = event.args
        found = await self.site.answer(
            answers.clearance_of,
            str(self.site.folder.path(self.scenario)),
            place["lat"],
            place["lng"],
            place["heading"],
        )
        if "problem" in found:
            return
        least = self.ends.get("clearance_m", 0.0)
        room = f"{found['clearance_m']:.0f} m clear" if found["inside"] else "in forbidden water"
        good = found["inside"] and found["clearance_m"] >= least
        self.clear.text = f"{place['which']}: {room}" + ("" if good else f", needs {least:g} m")
        self.clear.classes(add="good" if good else "wrong", remove="wrong" if good else "good")

    async def _moved(self, event: events.GenericEventArguments) -> None:
        place = event.args

        def change(content: Any) -> None:
            table = content[place["which"]]
            for key in ("north_m", "east_m"):
                table.pop(key, None)
            table["lat_deg"], table["lon_deg"] = round(place["lat"], DEGREES), round(place["lng"], DEGREES)
            table["heading_deg"] = round(place["heading"] % 360.0, 1)

        self.site.folder.change(self.scenario, change)
        self.watched.show(self.scenario)
        await self._moving(event)
        await self._check()

    async def _open(self, event: events.UploadEventArguments) -> None:
        """Take a chart in and name it in the area file."""
        name = event.file.name
        if not name.lower().endswith(CHARTS):
            ui.notify(f"{name} is no chart that is read, expected {', '.join(CHARTS)}", type="negative")
            return
        try:
            beside = self.site.folder.path(self.area).parent.relative_to(self.site.folder.root)
            taken = self.site.folder.take_in(name, await event.file.read(), beside=beside)
        except InputError as error:
            ui.notify(str(error), type="negative")
            return
        key = "s57" if name.lower().endswith(".000") else "geojson"
        self._set_chart({key: Path(taken).name}, new=True)

    def _set_chart(self, entries: dict[str, Any], *, new: bool = False) -> None:
        """Entries of [chart]; with another chart nothing of the old one is kept."""

        def change(content: Any) -> None:
            if new:
                content["chart"] = {}
                content.pop("bounds", None)
            content["chart"].update(entries)

        self.site.folder.change(self.area, change)
        self._fill_later()


def chart_element(*marks: tuple[str, str]) -> ui.leaflet:
    """A map without any picture from outside, and what its colours mean; `marks` are words and colours of the page."""
    options = {"preferCanvas": True, "attributionControl": False, "zoomSnap": 0.25, "maxZoom": 22}
    nothing = dict.fromkeys(("polyline", "polygon", "rectangle", "circle", "circlemarker", "marker"), False)
    leaflet = ui.leaflet(
        center=(0.0, 0.0), zoom=3, options=options, hide_drawn_items=True,
        draw_control={"draw": nothing, "edit": {"edit": False, "remove": False}},
    )  # fmt: skip
    leaflet.clear_layers()
    with ui.element("div").classes("legend"):
        for words, colour in (*LEGEND, *marks):
            ui.html(f'<span style="--mark: {colour}">{words}</span>', sanitize=False)
    return leaflet.classes("chart").props('tabindex="0" aria-label="Chart"')


def _corners(points: list[dict[str, float]]) -> list[list[float]]:
    return [[round(point["lat"], DEGREES), round(point["lng"], DEGREES)] for point in points]
