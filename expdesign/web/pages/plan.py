"""The plan: a draft in seconds, the whole trial with progress, played on the chart; refusals where they happen."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

from nicegui import ui

from expdesign.export import words
from expdesign.requests import Run
from expdesign.web import answers
from expdesign.web.jobs import Job
from expdesign.web.pages.sea import chart_element
from expdesign.web.site import Site, Watched, framed, shown_job, wrong

SPEEDS = (1, 2, 5, 10, 20, 50, 100)
ROUTES = ("route.rtz", "route.gpx", "route.kml", "route.geojson", "route.plan", "route.waypoints", "route.csv")


def register(site: Site) -> None:
    """Give the page its address."""

    @site.page("/plan")
    async def plan(scenario: str = "", plan: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/plan", scenario) as watched:
            if not scenario:
                ui.label("Make a trial first, on the page Trial.")
                return
            watched.show(scenario)
            await _Plan(site, scenario, plan, watched).draw()


class _Plan:
    """The page of one scenario."""

    def __init__(self, site: Site, scenario: str, asked: str, watched: Watched) -> None:
        self.site, self.scenario, self.watched = site, scenario, watched
        self.out = site.out_of(scenario)
        self.shown = asked or self._newest()
        self.area = site.file_of(scenario, "area")

    def _newest(self) -> str:
        """The newest plan or refusal of this scenario."""
        found = [
            f"{out}/{name}" for out in (self.out, f"{self.out}-draft") for name in ("plan.json", "refused.json")
            if self.site.folder.path(f"{out}/{name}").is_file()
        ]  # fmt: skip
        return max(found, key=lambda name: self.site.folder.path(name).stat().st_mtime, default="")

    async def draw(self) -> None:
        """Buttons, commands at work, the chart with the player, and the results."""
        with ui.row().classes("line"):
            ui.button("Draft", on_click=lambda: self._start(draft=True)).tooltip(
                "A quick look: nominal ship, no drawn trials, no route files"
            )
            ui.button("Plan the trial", on_click=lambda: self._start(draft=False))
        self.work = ui.column().classes("work")
        with self.work:
            for job in self.site.jobs.all:
                if isinstance(job.request, Run) and job.request.scenario == Path(self.scenario):
                    shown_job(self.site, job, ended=self._ended if job.status is None else None)
                    break
        with ui.row().classes("two"):
            with ui.column().classes("wide"):
                self.map = chart_element(("runs", "#c2410c"), ("legs between them", "#0b5a8a"))
                self._player()
            self.side = ui.column().classes("narrow")
        ui.on("played", self._at)
        await self.map.initialized()
        await self._fill()

    def _player(self) -> None:
        with ui.row().classes("line player") as self.player:
            self.button = ui.button("Play", on_click=lambda: self._script("toggle()"))
            ui.select(
                list(SPEEDS), value=10, label="Speed", on_change=lambda event: self._script(f"speed({event.value})")
            ).classes("speed")
            ui.html(
                f'<input type="range" min="0" max="1" step="any" value="0" id="when{self.map.id}" '
                'aria-label="Time of the plan">',
                sanitize=False,
            ).classes("slider")
        self.now = ui.html("", sanitize=False).classes("now")
        self.now.props(f'id="now{self.map.id}"')

    def _script(self, call: str) -> None:
        ui.run_javascript(f"expd.player({self.map.id}).{call}")

    def _at(self, event: Any) -> None:
        self.button.text = "Pause" if event.args["playing"] else "Play"

    def _start(self, *, draft: bool) -> None:
        request = Run(scenario=Path(self.scenario), draft=draft, out=Path(f"{self.out}-draft" if draft else self.out))
        self.work.clear()
        with self.work:
            shown_job(self.site, self.site.jobs.start(request), ended=self._ended)

    def _ended(self, job: Job) -> None:
        ui.timer(0.0, self._show_newest, once=True)

    async def _show_newest(self) -> None:
        self.shown = self._newest()
        await self._fill()

    async def _fill(self) -> None:
        ends = await self.site.answer(answers.ends_of, str(self.site.folder.path(self.scenario)))
        query = urlencode({"area": self.area, "draught_m": ends.get("draught_m", 0.0)})
        content = json.loads(self.site.folder.path(self.shown).read_text(encoding="utf-8")) if self.shown else {}
        refusal = content if content.get("refused") else None
        track = "" if refusal or not content else f"/track?{urlencode({'plan': self.shown})}"
        ui.run_javascript(
            f"expd.chart({self.map.id}, '/chart?{query}', {json.dumps(ends)}, false)"
            f".then(() => expd.trial({self.map.id}, {json.dumps(track)}, {json.dumps(_place_of(refusal))}))"
        )
        self.side.clear()
        with self.side:
            if "problem" in ends:
                wrong(ends["problem"])
            if not self.shown:
                ui.label("Nothing is planned yet.").classes("quiet")
            elif refusal:
                self._refused(refusal)
            else:
                self._planned(content)

    def _planned(self, content: dict[str, Any]) -> None:
        folder = self.site.folder
        draft, verified = content.get("draft", False), content["verified"]
        mark = "Draft" if draft else "Verified" if verified else "Not verified"
        ui.label(mark).classes("mark good" if verified else "mark doubt")
        if content["verdict"].lower() != mark.lower():
            ui.label(content["verdict"])
        for text in _booked(content):
            ui.label(text)
        beside = Path(self.shown).parent
        if draft:
            ui.label("A draft is drawn on the chart; nobody sails or plays it.").classes("quiet")
        for name, text in (("report.html", "Report"), ("cards.html", "Run cards")):
            if folder.path(beside / name).is_file():
                ui.link(text, f"/folder/{quote(str(beside / name))}", new_tab=True)
        routes = [name for name in ROUTES if folder.path(beside / name).is_file()]
        if routes:
            ui.label("Route files").classes("head2")
            with ui.row():
                for name in routes:
                    ui.link(name, f"/folder/{quote(str(beside / name))}").props(f'download="{name}"')
        ui.label("Runs").classes("head2")
        names = answers.said(folder.path(self.shown))
        for leg in content["legs"]:
            if leg["kind"] == "primitive":
                ui.label(f"{names.get(leg['name'], leg['name'])}, {words.duration(leg['duration_s'])}").classes("quiet")

    def _refused(self, refusal: dict[str, Any]) -> None:
        ui.label("Refused").classes("mark bad")
        wrong(refusal["obstacle"])
        if refusal["place"] is not None:
            ui.label("The red ring on the chart is where.").classes("quiet")
        ui.label("What helps").classes("head2")
        for remedy in refusal["remedies"]:
            self._remedy(remedy)
        if refusal["tried"]:
            ui.label("Tried before").classes("head2")
            for line in refusal["tried"]:
                ui.label(line).classes("quiet")

    def _remedy(self, remedy: str) -> None:
        """A remedy in words, and a button where it is a change of one key of the scenario."""
        with ui.row().classes("line"):
            ui.label(remedy)
            change = answers.change_in(remedy)
            if change is not None:
                (table, key), value = change
                ui.button(f"Set {table}.{key} = {value}", on_click=lambda: self._apply(table, key, value)).props(
                    "dense"
                )

    def _apply(self, table: str, key: str, value: Any) -> None:
        def change(content: Any) -> None:
            content.setdefault(table, {})[key] = value

        self.site.folder.change(self.scenario, change)
        self.watched.show(self.scenario)
        ui.notify(f"{self.scenario}: {table}.{key} = {value}; plan again")


def _booked(plan: dict[str, Any]) -> list[str]:
    """The time to book, what may go wrong in it, and the clearance."""
    runs, between, drawn = plan["informative_s"], plan["reposition_s"], plan["drawn_trials"]
    planned = (
        f"{words.duration(runs + between)} as planned: {words.duration(runs)} of runs, {words.duration(between)} "
        "between them."
    )
    clearance = f"Least clearance {words.distance(plan['clearance_min_m'])}."
    if drawn is None:
        return [planned, clearance]
    booked = [] if drawn["extra_time_95_s"] is None else [
        f"Book {words.duration(runs + between + max(0.0, drawn['extra_time_95_s']))}: enough in 95 % of "
        f"{drawn['trials']} simulated trials."
    ]  # fmt: skip
    risks = (
        f"{words.percent(drawn['leave_water_share'])} of them leave allowed water, "
        f"{words.percent(drawn['aborted_share'])} are aborted."
    )
    return [*booked, planned, risks, clearance]


def _place_of(refusal: dict[str, Any] | None) -> dict[str, Any] | None:
    return refusal and refusal["place"] and {key: refusal["place"][key] for key in ("lat_deg", "lon_deg")}
