"""What all pages share: the folder, the commands at work, a worker for answers, and the frame of a page."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from inspect import isawaitable
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import events, ui

from expdesign.errors import InputError
from expdesign.web import answers
from expdesign.web.folder import MOST_UPLOAD_BYTES, Folder
from expdesign.web.jobs import Job, Jobs

PAGES = (
    ("/", "Trial"),
    ("/sea", "Sea area"),
    ("/ship", "Ship"),
    ("/manoeuvres", "Manoeuvres"),
    ("/plan", "Plan"),
    ("/whatif", "What if"),
    ("/data", "Data"),
    ("/files", "Files"),
)
"""Address and name of each page, in the order of the work."""
PRIMARY, NEGATIVE = "#0b5a8a", "#a3261c"
"""Colours of buttons and of errors, dark enough for white text."""
LOOK_S = 2.0  # time between two looks at the files that a page shows
REFRESH_S = 0.5  # time between two looks at a command that runs


@dataclass
class Site:
    """Of one server."""

    folder: Folder
    jobs: Jobs
    workers: ProcessPoolExecutor = field(
        default_factory=lambda: ProcessPoolExecutor(1, mp_context=get_context("spawn"))
    )
    night: bool = False  # whether pages are dark

    async def answer(self, function: Callable[..., answers.Answer], *arguments: Any) -> answers.Answer:
        """An answer while others are served; one that computes comes from the worker."""
        if function is answers.durations_of:
            return await asyncio.get_running_loop().run_in_executor(self.workers, function, *arguments)
        return await asyncio.to_thread(function, *arguments)

    def scenario(self, asked: str) -> str:
        """The scenario that is asked for, or the first one; "" where there is none."""
        names = self.folder.of_kind("scenario")
        return asked if asked in names else next(iter(names), "")

    def out_of(self, scenario: str) -> str:
        """The folder of a scenario's results, as the commands choose it."""
        from expdesign.scenario.tables import read_toml

        path = self.folder.path(scenario)
        return f"runs/{read_toml(path).get('scenario', {}).get('name', path.stem)}"

    def file_of(self, scenario: str, key: str) -> str:
        """The vessel, dictionary or area file that a scenario names, as it is called in the folder.

        Raises:
            InputError: it names none, or none in the folder.
        """
        from expdesign.scenario.tables import Entry, read_toml

        entry = Entry(self.folder.path(scenario), f"scenario.{key}")
        named = read_toml(entry.path).get("scenario", {}).get(key)
        if not isinstance(named, str):
            raise entry.error("is missing, expected the path of a file in quotes")
        return self.folder.name(self.folder.named_in(entry.path, named))

    def page(self, address: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        """Give a function that draws a page its address; what is wrong in a file is said in the page."""

        def register(draw: Callable[..., Any]) -> Callable[..., Any]:
            @wraps(draw)
            async def drawn(*arguments: Any, **options: Any) -> None:
                try:
                    found = draw(*arguments, **options)
                    if isawaitable(found):
                        await found
                except (InputError, OSError) as error:
                    wrong(str(error))
                    ui.label("The page Files shows it as text.").classes("quiet")

            return ui.page(address)(drawn)

        return register


class Watched:
    """The files that a page shows; it says when one has changed elsewhere since."""

    def __init__(self, site: Site) -> None:
        """None yet."""
        self._site, self._seen = site, dict[str, str]()
        with ui.row().classes("stale").props('role="alert"') as self._bar:
            self._text = ui.label()
            ui.button("Load again", on_click=lambda: ui.navigate.reload()).props("flat dense")
        with ui.element("div").classes("spelled last").props('role="status"') as self._changed:
            self._change = ui.label().classes("printed")
        self._bar.visible = self._changed.visible = False
        ui.timer(LOOK_S, self._look)

    def show(self, *names: str) -> None:
        """Take note of files as they are now, because the page shows them; spell out what it has changed in one."""
        for name in filter(None, names):
            digest = self._site.folder.digest(name)
            if self._seen.get(name, digest) != digest and (change := self._site.folder.last_change(name)):
                self._change.text, self._changed.visible = f"{name}\n{change}", True
            self._seen[name] = digest

    def _look(self) -> None:
        changed = [name for name, digest in self._seen.items() if self._site.folder.digest(name) != digest]
        self._bar.visible = bool(changed)
        self._text.text = f"{', '.join(changed)} changed elsewhere since this page was drawn." if changed else ""


def warmed() -> None:
    """Load in the worker what answers need, before anybody asks."""
    import expdesign.workflows.steps.design_problem
    import expdesign.workflows.steps.scored  # noqa: F401


@contextmanager
def framed(site: Site, here: str, scenario: str) -> Iterator[Watched]:
    """The frame of a page: the way to the others, the scenario, and what has changed elsewhere."""
    address, title = next(item for item in PAGES if item[0] == here)
    ui.page_title(f"{title}: {scenario or site.folder.root.name} - expdesign")
    ui.add_head_html(
        '<link rel="stylesheet" href="/static/page.css"><script src="/static/chart.js"></script>', shared=False
    )
    ui.colors(primary=PRIMARY, negative=NEGATIVE)
    ui.on_exception(failed)
    dark = ui.dark_mode(site.night)

    def switch() -> None:
        site.night = not site.night
        dark.set_value(site.night)

    with ui.header().classes("head"), ui.element("nav").props('aria-label="Pages"'):
        for path, name in PAGES:
            link = ui.link(name, f"{path}?scenario={quote(scenario)}").classes("tab")
            if path == address:
                link.classes("here").props('aria-current="page"')
    with ui.row().classes("case"):
        names = list(site.folder.of_kind("scenario"))
        if names:
            ui.select(
                names,
                value=scenario,
                label="Scenario",
                on_change=lambda event: ui.navigate.to(f"{here}?scenario={quote(event.value)}"),
            )
        ui.label(str(site.folder.root)).classes("quiet")
        ui.space()
        ui.button("Night", on_click=switch).props("flat dense").tooltip("Change between bright and dark")
    if warning := site.folder.too_many:
        wrong(warning)
    yield Watched(site)


def told(place: ui.element, answer: answers.Answer) -> bool:
    """Show what is wrong in an answer, if anything; whether something is."""
    place.clear()
    if "problem" in answer:
        with place:
            wrong(answer["problem"])
    return "problem" in answer


def wrong(text: str) -> None:
    """One line on what is wrong, which a screen reader says at once."""
    ui.label(text).classes("wrong").props('role="alert"')


def failed(error: Exception) -> None:
    """Say what an action came to nothing by, until it is closed; it would seem done."""
    text = str(error) if isinstance(error, InputError | OSError) else f"failed, a defect: {error!r}"
    ui.notify(text, type="negative", timeout=0, close_button="Close", multi_line=True)


def dropped(
    label: str, take: Callable[[events.UploadEventArguments], Awaitable[None]], *, beside: Path, multiple: bool = False
) -> None:
    """A place to drop files on, or to choose them; of those that are too large it says where to copy them to."""

    def refused() -> None:
        most = MOST_UPLOAD_BYTES // 2**20
        failed(InputError(f"not taken, more than {most} MiB: copy it into {beside} and load this page again"))

    ui.upload(
        label=f"{label}, or press +", multiple=multiple, auto_upload=True, max_file_size=MOST_UPLOAD_BYTES,
        on_upload=take, on_rejected=refused,
    ).classes("upload")  # fmt: skip


def spelled(command: str, note: str = "") -> None:
    """The command that does the same, ready to be copied."""
    with ui.row().classes("spelled"):
        ui.label(command).classes("command")
        ui.button("Copy", on_click=lambda: ui.clipboard.write(command)).props("flat dense")
        if note:
            ui.label(note).classes("quiet")


def shown_job(site: Site, job: Job, *, ended: Callable[[Job], None] | None = None) -> None:
    """Command, progress, output and the button that stops it; goes on when the page is loaded again."""
    with ui.card().classes("job"):
        spelled(job.command)
        with ui.row().classes("line"):
            bar = ui.linear_progress(value=job.share, show_value=False).props('aria-label="Progress"').classes("bar")
            stop = ui.button("Stop", on_click=lambda: site.jobs.stop(job)).props("outline dense")
        activity = ui.label().props('role="status"')
        errors = ui.column()
        with ui.expansion("Output", value=False).classes("output") as output:
            text = ui.label().classes("printed")

    def refresh() -> None:
        bar.value = job.share
        activity.text = f"{job.share:.0%} {job.activity}" if job.status is None else job.state
        stop.visible = job.status is None
        text.text = "\n".join(job.lines)
        output.visible = bool(job.lines)
        if job.status is not None:
            timer.deactivate()
            with errors:
                for line in job.errors:
                    wrong(line.removeprefix("error: "))
            if ended is not None:
                ended(job)

    timer = ui.timer(REFRESH_S, refresh)


def page_of(name: str) -> None:
    """A page of results inside this one, and alone."""
    address = f"/folder/{quote(name)}"
    ui.link(f"Open {name} alone", address, new_tab=True)
    ui.element("iframe").props(f'src="{address}" title="{name}"').classes("inside")
