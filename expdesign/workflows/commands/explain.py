"""`expdesign explain`: a topic, a section of one, or a single name.

Topics are files, whose keys are in `workflows.steps.file_keys`, and what can be chosen by name: families, causes,
methods, criteria, formats, outcomes, structures, columns of data.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from importlib.resources import files as files_of

from expdesign.errors import InputError, nearest
from expdesign.workflows.steps.file_keys import (
    Explained,
    Section,
    Topic,
    dictionary_topic,
    file_topic,
    mapping_topic,
    vessel_topic,
)


def families_topic() -> Topic:
    """Manoeuvre families with their settings."""
    from expdesign.dictionary import FAMILIES, Family, Setting

    def entry(family: Family, setting: Setting) -> Explained:
        low, high = setting.low, setting.high
        allowed = f"{low:g} to {high:g}" if math.isfinite(low) and math.isfinite(high) else "a number"
        default = "required" if setting.default is None else f"{setting.default:g}"
        return Explained(
            name=f"{family.name}.{setting.name}", meaning=setting.meaning, default=default, allowed=allowed
        )

    sections = tuple(
        Section(
            name=family.name,
            title=f"{family.name}: {family.summary}",
            entries=tuple(entry(family, setting) for setting in family.settings),
        )
        for family in FAMILIES
    )
    text = "Units are in the names of the settings: s, m, mps (m/s), rad, radps (rad/s)."
    return Topic(name="families", title="Manoeuvre families of dictionary files", text=text, sections=sections)


def causes_topic() -> Topic:
    """Causes that a diagnosis looks for."""
    from expdesign.diagnosis.causes import CAUSES

    meanings = {cause.name: cause.summary for cause in CAUSES}
    return _list("causes", "Causes that expdesign diagnose can name", meanings)


def methods_topic() -> Topic:
    """Estimators."""
    from expdesign.estimation.methods import METHODS

    text = (
        "ls, least squares, suits quiet sensors and is biased by noise in the velocities. iv, instrumental variables "
        "from a simulation, stays right with noisy velocities as long as nothing inside a modulus changes its sign. "
        "oe, output error, makes the simulation error least, and is the most accurate where only sensors disturb. "
        "The second word of a method says what it knows of the weather; expdesign estimate --unknown chooses it for "
        "all estimators. A current that is taken for steady adds two parameters instead of many, and is several times "
        "more accurate where it is. All use data from which stated lags and sensor faults are undone."
    )
    meanings = {method.name: method.title for method in METHODS}
    return _list("methods", "Estimators of expdesign estimate and validate", meanings, text)


def criteria_topic() -> Topic:
    """Design criteria."""
    from expdesign.durations import CRITERIA

    meanings = {item.name: f"minimises the {item.title}" for item in CRITERIA}
    text = (
        "D_s, A and E are about the parameters in design.interest; V is about design.outcomes, "
        "T about design.reveal and design.tell_apart. A, E and V weigh "
        "equations against each other and need the sensors' noise in the vessel file."
    )
    return _list("criteria", "Design criteria, design.criterion", meanings, text)


def formats_topic() -> Topic:
    """Route formats."""
    from expdesign.export.formats import FORMATS

    meanings = {item.name: f"{item.summary}; writes {item.file_name}" for item in FORMATS}
    return _list("formats", "Route formats of expdesign export", meanings)


def outcomes_topic() -> Topic:
    """Results of standard trials that criterion V predicts."""
    from expdesign.indices import OUTCOMES

    return _list("outcomes", "Results of standard trials, design.outcomes", OUTCOMES)


def structures_topic() -> Topic:
    """Built-in model structures with their terms."""
    from expdesign.vessel import STRUCTURES

    sections = tuple(
        Section(
            name=name,
            title=f"structure {name!r}",
            entries=_entries(
                {term.name: f"multiplies {term.expression} in the equation of {term.equation}" for term in terms}
            ),
        )
        for name, terms in STRUCTURES.items()
    )
    text = (
        "Each parameter multiplies one expression in the equation of surge (u), sway (v) or yaw (r) acceleration; u_q "
        "and v_q are velocities through air. 'custom' takes its terms from [[model.terms]]."
    )
    return Topic(name="structures", title="Model structures of vessel files", text=text, sections=sections)


def data_topic() -> Topic:
    """Columns of measured data."""
    from expdesign.records import COLUMNS

    meanings = {item.names: item.meaning for item in COLUMNS}
    units = {item.names: f"units {', '.join(item.units)}" for item in COLUMNS if item.units}
    text = (
        "A CSV file with one header row; the unit is the end of a column's name. Needed are time, the inputs of the "
        "vessel's model, and velocities or a pose to derive them from (--velocity). A gap of more than 1.5 sample "
        "times starts a new batch. Unusual data are reported; wrong data are refused with their rows. Inputs are "
        "commands, but for reached positions, and the rest is as the sensors measured it: slew rates, lags, delays, "
        "places and faults that the vessel file states are undone, and notes say so. Before any fit, inputs are held "
        "against the limits of the vessel file, and instruments against each other: gyro, compass, log and positions, "
        "each with an estimate and its standard error; signals that are held or interpolated between readings are read "
        "in time; and the ship must answer her inputs in the sense of the vessel file."
    )
    return _list("data", "Columns of measured data", meanings, text, units)


def import_topic() -> Topic:
    """Formats of logs."""
    from expdesign.importing import READERS

    meanings = {item.name: item.meaning for item in READERS}
    needs = {item.name: f"needs expdesign[{item.extra}]" for item in READERS if item.extra}
    text = (
        "A file is known by how it begins, not by its name. All channels are read; the mapping says which become "
        "columns (expdesign explain mapping). Several logs are put on one time scale: satellite time first, then "
        "computers' clocks, then clocks of their own, set by what both logs saw."
    )
    return _list("import", "Formats of expdesign import", meanings, text, needs)


NOTHING: Mapping[str, str] = {}


def _list(
    name: str, title: str, meanings: Mapping[str, str], text: str = "", allowed: Mapping[str, str] = NOTHING
) -> Topic:
    """A topic of names with their meanings, and of some what they allow."""
    section = Section(name=name, title="", entries=_entries(meanings, allowed))
    return Topic(name=name, title=title, text=text, sections=(section,))


def _entries(meanings: Mapping[str, str], allowed: Mapping[str, str] = NOTHING) -> tuple[Explained, ...]:
    return tuple(
        Explained(name=name, meaning=meaning, allowed=allowed.get(name, "")) for name, meaning in meanings.items()
    )


TOPICS: dict[str, tuple[str, Callable[[], Topic]]] = {
    "scenario": (
        "keys of a scenario file: design, start, goal, environment, plan",
        partial(file_topic, "scenario"),
    ),
    "vessel": ("keys of a vessel file: particulars, actuators, model, sensors", vessel_topic),
    "card": (
        "keys of a pilot card, from which expdesign nominal makes a vessel file",
        partial(file_topic, "card"),
    ),
    "dictionary": ("keys of a dictionary file", dictionary_topic),
    "families": ("manoeuvre families and their settings", families_topic),
    "area": ("keys of an area file: chart, bounds, depth, no-go zones", partial(file_topic, "area")),
    "loads": ("keys of a file of load cases, which expdesign roll reads", partial(file_topic, "loads")),
    "data": ("columns of measured data", data_topic),
    "import": ("formats of logs that expdesign import reads", import_topic),
    "instruments": (
        "keys of instruments.toml, in which an import says what logs tell",
        partial(file_topic, "instruments"),
    ),
    "mapping": ("keys of a mapping file, which says what the channels of logs are", mapping_topic),
    "structures": ("built-in model structures and their parameters", structures_topic),
    "criteria": ("design criteria", criteria_topic),
    "outcomes": ("results of standard trials that a design can be optimised for", outcomes_topic),
    "methods": ("estimators", methods_topic),
    "causes": ("causes that a diagnosis tests", causes_topic),
    "formats": ("route formats", formats_topic),
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
        lines = {name: line for name, (line, _) in TOPICS.items()}
        text = "expdesign explain TOPIC shows one, expdesign explain NAME a single key, family or other name."
        manual = Section(name="manual", title="Manual", entries=_entries(MANUAL))
        keys = Section(name="topics", title="Keys of files, and names", entries=_entries(lines))
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
