"""`expdesign explain`: a topic, a section of one, or a single name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.resources import files as files_of

from expdesign.errors import InputError, nearest
from expdesign.workflows.explanations import files, plug_ins
from expdesign.workflows.explanations.values import Explained, Section, Topic

TOPICS: dict[str, tuple[str, Callable[[], Topic]]] = {
    "scenario": ("keys of a scenario file: design, start, goal, environment, plan", files.scenario_topic),
    "vessel": ("keys of a vessel file: particulars, actuators, model, sensors", files.vessel_topic),
    "card": ("keys of a pilot card, from which expdesign nominal makes a vessel file", files.card_topic),
    "dictionary": ("keys of a dictionary file", files.dictionary_topic),
    "families": ("manoeuvre families and their settings", plug_ins.families_topic),
    "area": ("keys of an area file: chart, bounds, depth, no-go zones", files.area_topic),
    "loads": ("keys of a file of load cases, which expdesign roll reads", files.loads_topic),
    "data": ("columns of measured data", plug_ins.data_topic),
    "import": ("formats of logs that expdesign import reads", plug_ins.import_topic),
    "instruments": ("keys of instruments.toml, in which an import says what logs tell", files.instruments_topic),
    "mapping": ("keys of a mapping file, which says what the channels of logs are", files.mapping_topic),
    "structures": ("built-in model structures and their parameters", plug_ins.structures_topic),
    "criteria": ("design criteria", plug_ins.criteria_topic),
    "outcomes": ("results of standard trials that a design can be optimised for", plug_ins.outcomes_topic),
    "methods": ("estimators", plug_ins.methods_topic),
    "causes": ("causes that a diagnosis tests", plug_ins.causes_topic),
    "formats": ("route formats", plug_ins.formats_topic),
}
"""Topic -> its summary and the function that explains it."""
MANUAL = {
    "conventions": "frames, signs, units, models: read this first",
    "commands": "which command, which method, when",
    "pilot-card": "from particulars and a pilot card to a vessel file",
    "first-plan": "your first plan, in half an hour",
    "your-log": "any log, as ships and craft record it, to an estimate",
    "first-estimate": "from your data to a model, in ten minutes",
    "information": "how long to run what: information, durations, certificates",
    "planning": "one trajectory through the water: places, legs, verification, drawn trials",
    "estimation": "from data to parameters and their standard errors",
    "diagnosis": "what the simulation gets wrong, and why",
    "operation": "watching a ship in service, indices, step trials, roll",
}
"""Page of the manual -> its summary. The pages are the Markdown files in `expdesign/manual`."""


def page(name: str) -> Topic:
    """A page of the manual: its heading is the title, the rest Markdown."""
    text = (files_of("expdesign") / "manual" / f"{name}.md").read_text(encoding="utf-8")
    title, _, rest = text.removeprefix("# ").partition("\n")
    return Topic(name=name, title=title, text=rest.strip(), sections=())


def explain(subject: str = "") -> Topic:
    """Explain a subject.

    Args:
        subject: a page of the manual; a topic; a table, a manoeuvre family or another section of one; or a name, such
            as design.total_s or actuators[2].kind. Without it, the list of topics.

    Raises:
        InputError: nothing has that name; the message offers the nearest.
    """
    wanted = re.sub(r"\[\d*\]", "", subject)
    if not wanted:
        pages = tuple(Explained(name=name, meaning=line) for name, line in MANUAL.items())
        entries = tuple(Explained(name=name, meaning=line) for name, (line, _) in TOPICS.items())
        text = "expdesign explain TOPIC shows one, expdesign explain NAME a single key, family or other name."
        manual = Section(name="manual", title="Manual", entries=pages)
        keys = Section(name="topics", title="Keys of files, and names", entries=entries)
        return Topic(name="topics", title="Topics", text=text, sections=(manual, keys))
    if wanted in MANUAL:
        return page(wanted)
    if wanted in TOPICS:
        return TOPICS[wanted][1]()
    known: list[str] = [*TOPICS, *MANUAL]
    found: dict[str, Section] = {}
    for _, build in TOPICS.values():
        topic = build()
        for section in topic.sections:
            names = [_plain(entry.name) for entry in section.entries]
            known += [section.name, *names, *(name.rpartition(".")[2] for name in names)]
            entries = tuple(_matching(section, wanted))
            if entries:
                found[f"{topic.title}: {section.title}"] = replace(section, entries=entries)
    if not found:
        near = nearest(wanted, known)
        hint = f"did you mean {near!r}?" if near else f"expected a key, or one of {', '.join(TOPICS)}"
        raise InputError(f"{subject!r} is not explained, {hint} (expdesign explain lists the topics)")
    sections = tuple(replace(section, title=title.rstrip(": ")) for title, section in found.items())
    return Topic(name=subject, title=subject, sections=sections)


def _matching(section: Section, wanted: str) -> Iterator[Explained]:
    """All of a section that is asked for by name, else entries of that name, below it or ending in it."""
    for entry in section.entries:
        names = [_plain(name) for name in entry.name.split(", ")]
        if section.name == wanted or any(
            f".{name}".endswith(f".{wanted}") or name.startswith(f"{wanted}.") for name in names
        ):
            yield entry


def _plain(name: str) -> str:
    return name.replace("[]", "")
