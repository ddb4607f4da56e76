"""The first page: the trials of the folder and a new one; a trial's ship; its files as text, with earlier versions."""

from __future__ import annotations

import shlex
import tomllib
from pathlib import Path
from urllib.parse import quote

from nicegui import ui

from expdesign.errors import InputError
from expdesign.requests import New, Nominal
from expdesign.scenario.card_file import CardFile
from expdesign.scenario.vessels.vessel_file import vessel_of
from expdesign.scenario.vessels.vessel_tables import ACTUATOR_TABLES, VesselTable
from expdesign.web import answers
from expdesign.web.forms import Form
from expdesign.web.jobs import Job
from expdesign.web.site import Site, Watched, framed, page_of, shown_job, spelled, told, wrong
from expdesign.workflows.commands.new import KINDS

FIRST_CARD = """\
# What is known of the ship. Everything beyond the first seven lines may be left out.
[ship]
name = "my ship"
length_m = 45.0
beam_m = 10.0
draught_m = 3.5
displacement_t = 900.0
top_speed_kn = 12.0

[[thrusters]]
kind = "propeller"
forward_m = -20.0

[[rudders]]
forward_m = -21.5
area_percent = 2.0
"""


def register_ship(site: Site) -> None:
    """Give the page its address."""

    @site.page("/ship")
    def ship(scenario: str = "", card: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/ship", scenario) as watched, ui.column().classes("sheet"):
            _card(site, scenario, card)
            if scenario:
                vessel = site.file_of(scenario, "vessel")
                watched.show(vessel)
                ui.label(f"The vessel file {vessel}").classes("head2")
                Form(
                    site.folder, vessel, VesselTable, kinds={"actuators": ACTUATOR_TABLES}, check=vessel_of,
                    changed=lambda: watched.show(vessel),
                ).draw()  # fmt: skip
                spelled(f"expdesign run {shlex.quote(scenario)}", f"reads {vessel}")


def _card(site: Site, scenario: str, asked: str) -> None:
    ui.label("From particulars and the pilot card").classes("head2")
    cards = list(site.folder.of_kind("card"))
    card = asked if asked in cards else next(iter(cards), "")
    with ui.row().classes("line"):
        if cards:
            ui.select(cards, value=card, label="Card", on_change=lambda event: _go(scenario, event.value))
        ui.button("New card", on_click=lambda: _go(scenario, _first(site))).props("outline")
    if not card:
        ui.label("A card states what an owner knows: particulars, speeds, turning circles. It becomes a vessel file.")
        return
    with ui.expansion(f"{card} as numbers").classes("table"):
        Form(site.folder, card, CardFile).draw()
    out = f"runs/{Path(card).stem}"
    place = ui.column()

    def make() -> None:
        place.clear()
        with place:
            shown_job(site, site.jobs.start(Nominal(card=Path(card), out=Path(out))), ended=ended)

    def ended(job: Job) -> None:
        if job.status == 0:
            with place:
                page_of(f"{out}/nominal.html")
                if scenario:
                    ui.button(f"Use {out}/vessel.toml in {scenario}", on_click=use)

    def use() -> None:
        path = site.folder.path(scenario)
        named = Path(*[".."] * (len(path.relative_to(site.folder.root).parts) - 1), out, "vessel.toml").as_posix()
        site.folder.change(scenario, lambda content: content["scenario"].__setitem__("vessel", named))
        ui.navigate.to(f"/ship?scenario={quote(scenario)}")

    ui.button("Make the vessel file", on_click=make)


def _first(site: Site) -> str:
    name = "card.toml"
    if not site.folder.path(name).exists():  # else it is shown
        site.folder.write(name, FIRST_CARD)
    return name


def _go(scenario: str, card: str) -> None:
    ui.navigate.to(f"/ship?scenario={quote(scenario)}&card={quote(card)}")


EDITED = (".toml", ".md", ".csv", ".geojson")
LARGEST = 2**20  # bytes of a file that is edited as text


def register_files(site: Site) -> None:
    """Give the page its address."""

    @site.page("/files")
    def files(scenario: str = "", file: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/files", scenario) as watched, ui.column().classes("sheet"):
            names = [site.folder.name(path) for path in site.folder.files()]
            file = file if file in names else scenario
            if not names:
                ui.label("The folder is empty.")
                return
            ui.select(
                names, value=file or None, label="File", with_input=True,
                on_change=lambda event: ui.navigate.to(f"/files?scenario={quote(scenario)}&file={quote(event.value)}"),
            ).classes("field")  # fmt: skip
            if file:
                watched.show(file)
                _shown(site, scenario, file, watched)


def _shown(site: Site, scenario: str, file: str, watched: Watched) -> None:
    path = site.folder.path(file)
    if path.suffix not in EDITED or path.stat().st_size > LARGEST:
        page_of(file)
        return
    text = ui.codemirror(
        path.read_text(encoding="utf-8", errors="replace"),
        language="TOML" if path.suffix == ".toml" else None,
        theme="vscodeDark" if site.night else "vscodeLight",
    )
    text.props('aria-label="Text of the file"').classes("toml")
    place = ui.column().props('role="status"')

    async def write() -> None:
        place.clear()
        with place:
            if path.suffix == ".toml":
                try:
                    tomllib.loads(text.value)
                except tomllib.TOMLDecodeError as error:
                    wrong(f"{file}: {error}; not written")
                    return
            site.folder.write(file, text.value)
            watched.show(file)
            ui.label("Written.").classes("good")
        if scenario:
            found = await site.answer(answers.problem_of, str(site.folder.path(scenario)))
            with place:
                told(ui.column(), found)

    def undo() -> None:
        try:
            site.folder.undo(file)
        except InputError as error:
            ui.notify(str(error))
            return
        ui.navigate.reload()

    with ui.row():
        ui.button("Write", on_click=write)
        ui.button(f"Undo ({site.folder.versions(file)})", on_click=undo).props("outline")


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
