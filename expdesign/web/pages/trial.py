"""The first page: the trials of the folder, what is wrong with them, and a new one."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

from nicegui import ui

from expdesign.requests import New
from expdesign.web import answers
from expdesign.web.jobs import Job
from expdesign.web.site import Site, framed, shown_job, told, wrong
from expdesign.workflows.commands.new import KINDS


def register(site: Site) -> None:
    """Give the page its address."""

    @site.page("/")
    async def trial(scenario: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/", scenario) as watched, ui.column().classes("sheet"):
            if scenario:
                await _present(site, scenario)
                watched.show(scenario)
            else:
                ui.label("This folder has no scenario yet.").classes("lead")
            _new(site)


async def _present(site: Site, scenario: str) -> None:
    ui.label(scenario).classes("lead")
    found = await site.answer(answers.problem_of, str(site.folder.path(scenario)))
    place = ui.column()
    if told(place, found):
        ui.label("The other pages show the files that can be read; Files edits them as text.").classes("quiet")
        return
    ui.label(f"Ship: {found['vessel']}. The files can be read; a plan can begin.")
    for line in (*found["remarks"], *found["notes"]):
        ui.label(line).classes("quiet")
    plans = list(site.folder.named("plan.json"))
    if plans:
        ui.label("Plans in this folder").classes("head2")
        for name in plans:
            ui.link(name, f"/plan?scenario={quote(scenario)}&plan={quote(name)}")


def _new(site: Site) -> None:
    ui.label("A new trial").classes("head2")
    with ui.row().classes("line"):
        name = ui.input(label="Name of the folder", value="mytrial")
        kind = ui.select(list(KINDS), value=next(iter(KINDS)), label="Kind of ship").classes("kind")
        start = ui.button("Make it")
    place = ui.column()

    def make() -> None:
        place.clear()
        with place:
            if "/" in name.value or name.value.startswith(("-", ".")) or not name.value:
                wrong(f"{name.value!r} is no name of a folder in this one")
                return
            shown_job(site, site.jobs.start(New(folder=Path(name.value), kind=kind.value)), ended=made)

    def made(job: Job) -> None:
        if job.status == 0 and isinstance(job.request, New):
            ui.navigate.to(f"/sea?scenario={quote(str(job.request.folder))}/scenario.toml")

    start.on_click(make)
