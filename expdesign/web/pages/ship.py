"""The ship: from her particulars to a vessel file, and the vessel file itself."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

from nicegui import ui

from expdesign.requests import Nominal
from expdesign.scenario.card_file import CardFile
from expdesign.scenario.vessels.vessel_file import vessel_of
from expdesign.scenario.vessels.vessel_tables import ACTUATOR_TABLES, VesselTable
from expdesign.web.forms import Form
from expdesign.web.jobs import Job
from expdesign.web.site import Site, framed, page_of, shown_job, spelled

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


def register(site: Site) -> None:
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
                spelled(f"expdesign run {scenario}", f"reads {vessel}")


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
