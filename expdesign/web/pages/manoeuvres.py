"""The dictionary: each manoeuvre drawn with what it tells, switched on and off, and the convex durations at once."""

from __future__ import annotations

from shlex import quote
from typing import Any

from nicegui import ui

from expdesign.export import words
from expdesign.scenario.scenario_file import ScenarioFile
from expdesign.web import answers
from expdesign.web.forms import Form
from expdesign.web.site import Site, Watched, framed, spelled, told

SIZE_PX = 120  # of a drawn manoeuvre


def register(site: Site) -> None:
    """Give the page its address."""

    @site.page("/manoeuvres")
    async def manoeuvres(scenario: str = "") -> None:
        scenario = site.scenario(scenario)
        with framed(site, "/manoeuvres", scenario) as watched, ui.column().classes("sheet"):
            if not scenario:
                ui.label("Make a trial first, on the page Trial.")
                return
            page = _Manoeuvres(site, scenario, watched)
            page.draw()
            ui.timer(0.05, page.fill, once=True)


class _Manoeuvres:
    """The page of one scenario."""

    def __init__(self, site: Site, scenario: str, watched: Watched) -> None:
        self.site, self.scenario, self.watched = site, scenario, watched

    def draw(self) -> None:
        """Settings, and places for the answer and the manoeuvres."""
        with ui.expansion("Criterion, accuracy or time").classes("table"):
            Form(self.site.folder, self.scenario, ScenarioFile, changed=self._later).draw("design")
        with ui.row():
            ui.button("Undo", on_click=self._undo).props("outline").tooltip("Take the last change of the scenario back")
        self.answer = ui.column().props('role="status" aria-live="polite"')
        self.runs = ui.element("div").classes("runs")
        with self.answer:
            ui.label("Simulating the dictionary…").classes("quiet")
        out = self.site.out_of(self.scenario)
        spelled(
            f"expdesign durations {quote(self.scenario)}", f"writes {out}/durations.json; {self.scenario} has [design]"
        )

    def _later(self) -> None:
        self.watched.show(self.scenario)
        ui.timer(0.0, self.fill, once=True)

    def _undo(self) -> None:
        if self.site.folder.versions(self.scenario):
            self.site.folder.undo(self.scenario)
            ui.navigate.reload()

    async def fill(self) -> None:
        """Ask for the durations and show them."""
        self.watched.show(self.scenario)
        found = await self.site.answer(answers.durations_of, str(self.site.folder.path(self.scenario)))
        if told(self.answer, found):
            return
        used = [run for run in found["runs"] if run["repeats"]]
        with self.answer:
            ui.label(
                f"{len(used)} of {len(found['runs'])} manoeuvres share {words.duration(found['total_s'])} by criterion "
                f"{found['criterion']}."
            ).classes("lead")
            ui.label(
                f"Certificate ({found['theorem']}): no other sharing needs less than "
                f"{words.percent(found['efficiency_at_least'])} of this time for as much information. Whole runs reach "
                f"{words.percent(found['efficiency_repeats'])}, equal times "
                f"{words.percent(found['efficiency_uniform'])}."
            )
            for key in found["aside"]:
                ui.label(f"[design.{key}] is left aside here: `expdesign run` follows it, and may choose other runs.")
            if found["note"]:
                ui.label(found["note"]).classes("quiet")
        self.runs.clear()
        order = sorted(found["runs"], key=lambda run: (-run["duration_s"], -(run["of_average"] or 0.0)))
        with self.runs:
            for run in order:
                self._run(run, run["name"] not in found["excluded"])

    def _run(self, run: dict[str, Any], is_on: bool) -> None:
        with ui.card().classes("run" if run["repeats"] else "run unused"):
            ui.checkbox(run["words"], value=is_on, on_change=lambda event: self._switch(run["name"], event.value))
            ui.html(_drawn(run["track"], run["words"]), sanitize=False)
            tells = (
                "not ranked: all manoeuvres together leave a parameter undetermined"
                if run["of_average"] is None
                else f"tells {run['of_average']:.2g} times the average, per second"
            )
            ui.label(f"{words.times(run['repeats'])} {words.duration(run['run_s'])}" if run["repeats"] else "not run")
            ui.label(tells).classes("quiet")

    def _switch(self, name: str, is_on: bool) -> None:
        """Take a manoeuvre out of the design, or back."""

        def change(content: Any) -> None:
            out = [other for other in content["design"].get("excluded", []) if other != name]
            content["design"]["excluded"] = out if is_on else [*out, name]
            if not content["design"]["excluded"]:
                del content["design"]["excluded"]

        self.site.folder.change(self.scenario, change)
        self._later()


def _drawn(track: list[list[float]], title: str) -> str:
    """The track of a manoeuvre as SVG, north up, with its start."""
    xs, ys = [x for x, _ in track], [y for _, y in track]
    span = max(max(xs) - min(xs), max(ys) - min(ys), 1e-6)
    margin = 0.08 * span
    west = (min(xs) + max(xs)) / 2 - span / 2 - margin
    top = (min(ys) + max(ys)) / 2 - span / 2 - margin
    size = span + 2 * margin
    points = " ".join(f"{x:.3f},{y:.3f}" for x, y in track)
    return (
        f'<svg width="{SIZE_PX}" height="{SIZE_PX}" viewBox="{west:.3f} {top:.3f} {size:.3f} {size:.3f}" role="img" '
        f'aria-label="Track of {title}"><polyline points="{points}" fill="none" stroke="currentColor" '
        f'stroke-width="{size / 60:.3f}"/><circle cx="{track[0][0]}" cy="{track[0][1]}" r="{size / 30:.3f}" '
        f'fill="currentColor"/></svg>'
    )
