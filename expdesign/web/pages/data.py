"""Measured data: logs dropped in, runs cut from them, and what the commands on data find."""

from __future__ import annotations

from pathlib import Path

from nicegui import events, ui

from expdesign import requests
from expdesign.errors import InputError
from expdesign.web.jobs import Job
from expdesign.web.site import Site, dropped, framed, page_of, shown_job, wrong

LOGS = "logs"  # folder of logs that were dropped in
PAGES = {
    requests.Import: "import.html",
    requests.Estimate: "estimate.html",
    requests.Diagnose: "diagnosis.html",
    requests.Monitor: "monitor.html",
    requests.Indices: "indices.html",
    requests.Replan: "report.html",
    requests.TrialResult: "result.html",
}
"""Command -> its page."""
OnRuns = type[requests.Estimate | requests.Diagnose | requests.Indices | requests.Monitor]
"""Commands on runs and a vessel file."""


def register(site: Site) -> None:
    """Give the page its address."""

    @site.page("/data")
    def data(scenario: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/data", scenario), ui.column().classes("sheet"):
            _Data(site, scenario).draw()


class _Data:
    """The page of one scenario."""

    def __init__(self, site: Site, scenario: str) -> None:
        self.site, self.scenario = site, scenario
        self.vessel = site.file_of(scenario, "vessel") if scenario else ""

    def draw(self) -> None:
        """Logs, runs, commands, results."""
        ui.label("1. Logs").classes("head2")
        ui.label("Drop logs of any format here; together they are one trial.").classes("quiet")
        dropped("Drop logs", self._take, beside=self.site.folder.root / LOGS, multiple=True)
        self.logs = ui.select(list(self._logs()), multiple=True, label="Logs to import", value=[]).classes("field")
        ui.button("Import", on_click=self._import)
        ui.label("2. Runs").classes("head2")
        self.runs = ui.select(list(self._runs()), multiple=True, label="Runs, or folders of runs", value=[]).classes(
            "field"
        )
        vessels = list(self.site.folder.of_kind("vessel"))
        self.ship = ui.select(
            vessels, value=self.vessel if self.vessel in vessels else None, label="Vessel file"
        ).classes("field")
        ui.label("3. What they tell").classes("head2")
        with ui.row().classes("line"):
            ui.button("Estimate", on_click=lambda: self._on_runs(requests.Estimate))
            ui.button("Diagnose", on_click=lambda: self._on_runs(requests.Diagnose))
            ui.button("Indices", on_click=lambda: self._on_runs(requests.Indices)).props("outline")
            ui.button("Monitor", on_click=lambda: self._on_runs(requests.Monitor)).props("outline")
            if self.scenario:
                ui.button("Plan the rest of the trial", on_click=self._replan).props("outline")
                ui.button("Trial result", on_click=self._result).props("outline")
        self.place = ui.column().classes("work").props('aria-live="polite"')
        with self.place:
            for job in self.site.jobs.all:
                if type(job.request) in PAGES:
                    shown_job(self.site, job, ended=self._ended)
                    break

    def _logs(self) -> tuple[str, ...]:
        folder = self.site.folder
        return tuple(name for path in folder.files() if (name := folder.name(path)).startswith(f"{LOGS}/"))

    def _runs(self) -> tuple[str, ...]:
        """Folders of imported runs, and single CSV files."""
        folder = self.site.folder
        imported = tuple(str(Path(name).parent) for name in folder.named("import.json"))
        single = tuple(name for name in folder.named("*.csv") if str(Path(name).parent) not in imported)
        return (*imported, *single)

    async def _take(self, event: events.UploadEventArguments) -> None:
        try:
            name = self.site.folder.take_in(event.file.name, await event.file.read(), beside=Path(LOGS))
        except InputError as error:
            ui.notify(str(error), type="negative")
            return
        self.logs.set_options(list(self._logs()), value=sorted({*self.logs.value, name}))

    def _import(self) -> None:
        if not self.logs.value:
            self._refuse("drop or choose a log first")
            return
        logs, out = tuple(map(Path, self.logs.value)), Path(f"runs/{Path(self.logs.value[0]).stem}-runs")
        self._start(requests.Import(logs=logs, vessel=Path(self.ship.value) if self.ship.value else None, out=out))

    def _on_runs(self, command: OnRuns) -> None:
        if not self.runs.value or not self.ship.value:
            self._refuse("choose runs and a vessel file first")
            return
        out = Path(self._out(command.__name__.lower()))
        self._start(command(data=tuple(map(Path, self.runs.value)), vessel=Path(self.ship.value), out=out))

    def _out(self, command: str) -> str:
        """The folder of what a command finds in the runs that are chosen."""
        return f"runs/{Path(self.runs.value[0]).stem}-{command}"

    def _result(self) -> None:
        """From the scenario's plan and what was estimated, and perhaps judged, before."""
        plan, found = f"{self.site.out_of(self.scenario)}/plan.json", ""
        if self.runs.value:
            found = f"{self._out('estimate')}/estimate.json"
        if not found or not all(self.site.folder.path(name).is_file() for name in (plan, found)):
            self._refuse("plan the scenario's trial, choose its runs and estimate from them first")
            return
        judged = f"{self._out('indices')}/indices.json"
        indices = Path(judged) if self.site.folder.path(judged).is_file() else None
        out = Path(self._out("result"))
        self._start(requests.TrialResult(plan=Path(plan), estimate=Path(found), indices=indices, out=out))

    def _replan(self) -> None:
        if not self.runs.value:
            self._refuse("choose the runs that were measured so far")
            return
        data, out = tuple(map(Path, self.runs.value)), Path(f"{self.site.out_of(self.scenario)}-replanned")
        self._start(requests.Replan(scenario=Path(self.scenario), data=data, out=out))

    def _refuse(self, text: str) -> None:
        self.place.clear()
        with self.place:
            wrong(text)

    def _start(self, request: requests.Request) -> None:
        self.place.clear()
        with self.place:
            shown_job(self.site, self.site.jobs.start(request), ended=self._ended)

    def _ended(self, job: Job) -> None:
        page = f"{job.out}/{PAGES[type(job.request)]}"
        if job.wrote(page):  # else it is of an earlier command
            with self.place:
                page_of(page)
        if isinstance(job.request, requests.Import) and job.status == 0:
            self.runs.set_options(list(self._runs()), value=[job.out])
