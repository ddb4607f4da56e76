"""The files as text, with their earlier versions."""

from __future__ import annotations

import tomllib
from urllib.parse import quote

from nicegui import ui

from expdesign.errors import InputError
from expdesign.web import answers
from expdesign.web.site import Site, Watched, framed, page_of, told, wrong

EDITED = (".toml", ".md", ".csv", ".geojson")
LARGEST = 2**20
"""Bytes of a file that is edited as text."""


def register(site: Site) -> None:
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
