"""Variants of the scenario side by side."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from nicegui import ui

from expdesign.requests import WhatIf
from expdesign.scenario.tables import read_toml
from expdesign.scenario.variants import changed_entries
from expdesign.web.jobs import Job
from expdesign.web.site import Site, framed, page_of, shown_job, wrong

OF_ANOTHER = ("scenario.vessel =", "scenario.area =")  # changes; a scenario with both is no variant of this trial
FIRST = "[design]\ntotal_s = 1800.0\n"


def register(site: Site) -> None:
    """Give the page its address."""

    @site.page("/whatif")
    def whatif(scenario: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/whatif", scenario) as watched, ui.column().classes("sheet"):
            if not scenario:
                ui.label("Make a trial first, on the page Trial.")
                return
            watched.show(scenario)
            _Variants(site, scenario).draw()


class _Variants:
    """The page of one scenario."""

    def __init__(self, site: Site, scenario: str) -> None:
        self.site, self.scenario = site, scenario
        self.out = f"{site.out_of(scenario)}-whatif"
        self.chosen: set[str] = set()

    def draw(self) -> None:
        """Variants to choose among, a new one, and the comparison."""
        ui.label("Variants").classes("head2")
        ui.label("A variant is a file with only the keys that differ from the scenario, or a whole scenario.").classes(
            "quiet"
        )
        differences = {name: self._differences(name) for name in self._names()}
        others = [
            name
            for name, found in differences.items()
            if all(any(line.startswith(key) for line in found) for key in OF_ANOTHER)
        ]
        self._cards({name: found for name, found in differences.items() if name not in others})
        self._new()
        if others:
            with ui.expansion(f"Scenarios of another ship in other waters: {len(others)}").classes("table"):
                self._cards({name: differences[name] for name in others})
        with ui.row().classes("line"):
            ui.button("Compare", on_click=lambda: self._start(False))
            ui.button("Compare with plans", on_click=lambda: self._start(True)).props("outline").tooltip(
                "Takes minutes each"
            )
        self.place = ui.column().classes("work")
        with self.place:
            for job in self.site.jobs.all:
                if isinstance(job.request, WhatIf) and job.request.scenario == Path(self.scenario):
                    shown_job(self.site, job, ended=self._ended)
                    return
            self._results()

    def _cards(self, variants: Mapping[str, Sequence[str]]) -> None:
        """A card for each variant, what it changes below its name."""
        with ui.element("div").classes("runs"):
            for name, found in variants.items():
                with ui.card().classes("run"):
                    ui.checkbox(name, on_change=lambda event, name=name: self._choose(name, event.value))
                    for line in found or ["No entry differs."]:
                        ui.label(line).classes("quiet")

    def _names(self) -> list[str]:
        """TOML files of the folder that have tables of a scenario."""
        known = {"scenario", "design", "start", "goal", "environment", "plan"}
        found = []
        for path in self.site.folder.files():
            if path.suffix == ".toml" and "runs" not in path.relative_to(self.site.folder.root).parts:
                try:
                    tables = tomllib.loads(path.read_text(encoding="utf-8"))
                except (OSError, ValueError):
                    continue
                name = self.site.folder.name(path)
                if tables and set(tables) <= known and name != self.scenario:
                    found.append(name)
        return found

    def _differences(self, name: str) -> tuple[str, ...]:
        own, other = (read_toml(self.site.folder.path(file)) for file in (self.scenario, name))
        return changed_entries(own, other)

    def _choose(self, name: str, is_on: bool) -> None:
        (self.chosen.add if is_on else self.chosen.discard)(name)

    def _new(self) -> None:
        with ui.expansion("A new variant").classes("table"):
            name = ui.input(label="Name of the file", value="variant.toml")
            text = (
                ui.textarea(label="Only the keys that differ, in TOML", value=FIRST).classes("toml").props("autogrow")
            )
            place = ui.column()

            def write() -> None:
                place.clear()
                with place:
                    try:
                        tomllib.loads(text.value)
                        path = self.site.folder.path(name.value)
                    except ValueError as error:
                        wrong(str(error))
                        return
                    if path.exists() or path.suffix != ".toml":
                        wrong(f"{name.value} exists, or does not end in .toml")
                        return
                    self.site.folder.write(name.value, text.value)
                    ui.navigate.reload()

            ui.button("Write it", on_click=write)

    def _start(self, with_plan: bool) -> None:
        self.place.clear()
        with self.place:
            if not self.chosen:
                wrong("no variant is ticked")
                return
            request = WhatIf(
                scenario=Path(self.scenario), variants=tuple(map(Path, sorted(self.chosen))), with_plan=with_plan,
                out=Path(self.out),
            )  # fmt: skip
            shown_job(self.site, self.site.jobs.start(request), ended=self._ended)

    def _ended(self, job: Job) -> None:
        if job.status == 0:
            with self.place:
                self._results()

    def _results(self) -> None:
        path = self.site.folder.path(f"{self.out}/whatif.json")
        if path.is_file():
            cases = json.loads(path.read_text(encoding="utf-8")).get("cases", [])
            ui.label(f"{len(cases)} cases compared").classes("head2")
            page_of(f"{self.out}/whatif.html")
