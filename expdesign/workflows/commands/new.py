"""`expdesign new`: a folder to start from, out of the templates that come with the program.

With a card the ship is her own: candidates, times, places and the bay of the template of her kind grow with her length
and speed, times by length over speed, and the prior of her vessel file counts in the design.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory
from typing import Any

from expdesign import requests
from expdesign.dictionary import PrimitiveSpec, build_primitive
from expdesign.errors import InputError, NoAnswer
from expdesign.export.document import Document
from expdesign.export.files import toml_comments, toml_value
from expdesign.export.folder import write_files
from expdesign.export.nominal_page import nominal_toml
from expdesign.particulars import Card, nominal
from expdesign.particulars.forces import design_speed
from expdesign.plan.control import capability
from expdesign.plan.values import PlanSettings
from expdesign.progress import Progress, silent, within
from expdesign.requests import repeating
from expdesign.scenario import NAME, NAME_RULE, load_card, load_scenario, load_vessel
from expdesign.scenario.dictionaries import load_dictionary
from expdesign.simulation.helm import HARD_OVER_RAD, Helm
from expdesign.vessel import Vessel
from expdesign.workflows.outcome import Outcome, folder_problem, workflow

TEMPLATES = files("expdesign") / "templates"
KINDS = {
    "azimuth": "an offshore vessel of 45 m with two azimuth thrusters and a tunnel thruster",
    "propeller-rudder": "a coaster of 80 m with one propeller and one rudder",
    "twin-screw": "a ship of 60 m with two propellers, two rudders and a tunnel thruster",
    "asv": "an unmanned craft of 2 m that steers by the difference of two propellers",
    "model-ship": "a model ship of 3.2 m with one propeller and one rudder",
}
"""Kind of ship -> what its template describes."""
USUAL = "azimuth"
MODEL_M = 8.0  # length below which a ship with one propeller and a rudder is taken for a free-running model
BLOCK = "[[primitives]]"
NUMBER = r"-?\d+\.\d+"
PRIOR = """\
[design]
# How well the card says that each parameter is known counts in the design; expdesign estimate --prior does the same.
prior = "parameter_std"
"""
OUTLINE_HULL_M = 20.0  # length of the ship for which the bay has its size; for others it is scaled

AREA = """\
# An invented bay, scaled to the ship. Replace it by your water: expdesign explain area lists the keys.
[area]
name = "{name}"

[chart]
geojson = "area.geojson"
land_layers = ["land"]
notice = "An invented outline, free to use. Not for navigation."
"""

README = """\
# {name}

{ship}. From this folder's parent:

1. `expdesign run {scenario} --draft` takes a quick look; without `--draft` the plan is verified.
2. `vessel.toml` is the ship: particulars, actuators with limits and rates, model, and how far parameters may be off.
3. `dictionary.toml` lists candidate manoeuvres, `area.toml` and `area.geojson` the water.
4. `scenario.toml` names the three and states time, start, goal, weather and what the plan must keep to.
5. After the runs: `expdesign estimate RECORD.csv --vessel {vessel}`, then `expdesign replan`.

`expdesign explain` lists what may stand in a file; `expdesign explain first-plan` goes through a plan step by step.
"""


@dataclass(frozen=True, kw_only=True)
class Start:
    """What a folder begins with."""

    texts: Mapping[str, str]  # of its files
    ship: str  # who she is
    notes: tuple[str, ...] = ()


@workflow
def new(request: requests.New, *, progress: Progress = silent) -> Outcome:
    """A folder with scenario, vessel, dictionary and area of a kind of ship, and a page that says what is where.

    Raises:
        InputError: the folder exists.
        FileError: something in the card is wrong.
    """
    if request.folder.exists():
        raise InputError(f"{request.folder} exists, expected the name of a folder to be made")
    if problem := folder_problem(request.folder):
        raise InputError(problem)
    name, kind = request.folder.resolve().name, request.kind or USUAL
    if not NAME.fullmatch(name):
        raise InputError(f"the folder's name is the scenario's and is {name!r}, expected {NAME_RULE}")
    if request.card is None:
        start = of_kind(name, kind)
    else:
        progress("reading the card", 0.0)
        card = load_card(request.card)
        kind = request.kind or kind_of(card)
        start = of_card(name, kind, card, command=repeating(request), progress=within(progress, 0.0, 0.9))
    paths = write_files(request.folder, start.texts)
    load_scenario(request.folder / "scenario.toml")
    progress("done", 1.0)
    facts = {
        "kind": kind,
        "ship": start.ship,
        "then": f"expdesign run {quote(str(request.folder / 'scenario.toml'))}",
    }
    return Outcome(files=paths, document=Document(facts=facts, notes=start.notes))


def of_kind(name: str, kind: str) -> Start:
    """The invented ship of a kind."""
    texts = {item: _text(f"{kind}/{item}.toml") for item in ("scenario", "vessel", "dictionary")}
    ship = KINDS[kind]
    said = f"{ship[0].upper()}{ship[1:]}, invented; every number is to be replaced by yours"
    return Start(texts=_files(name, texts, length_m=_template(kind).length_m, ship=said), ship=ship)


def _files(name: str, texts: Mapping[str, str], *, length_m: float, ship: str) -> dict[str, str]:
    lines = texts["scenario"].splitlines(keepends=True)
    renamed = [f"name = {toml_value(name)}\n" if line.startswith("name = ") else line for line in lines]
    return {
        "scenario.toml": "".join(renamed),
        "vessel.toml": texts["vessel"],
        "dictionary.toml": texts["dictionary"],
        "area.toml": AREA.format(name=f"bay of {length_m * 110 / 1000:.2g} km"),
        "area.geojson": _bay(length_m / OUTLINE_HULL_M),
        "README.md": README.format(
            name=name, ship=ship, scenario=quote(f"{name}/scenario.toml"), vessel=quote(f"{name}/vessel.toml")
        ),
    }


def kind_of(card: Card) -> str:
    """The kind of ship whose thrusters and rudders are most like those of a card."""
    if any(one.kind != "propeller" for one in card.drives):
        return "azimuth"
    if not card.rudders:
        return "asv"
    if len(card.drives) > 1:
        return "twin-screw"
    return "model-ship" if card.hull.length_m < MODEL_M else "propeller-rudder"


def of_card(name: str, kind: str, card: Card, *, command: str, progress: Progress = silent) -> Start:
    """The ship of a card, and what her kind's template has, scaled to her.

    Raises:
        InputError: nothing drives her, or she can sail no candidate.
    """
    template, found = _template(kind), nominal(card, progress=progress)
    vessel = replace(found.vessel, sensors=template.sensors)
    size = vessel.length_m / template.length_m
    swift = design_speed(card) / capability(template, PlanSettings()).top_speed_mps
    factors = {"_m": size, "_mps": swift, "_s": size / swift, "_radps": swift / size}
    helm = min(1.0, Helm(vessel=vessel).hardest(1.0) / HARD_OVER_RAD)
    scenario = _headed(_scaled(_text(f"{kind}/scenario.toml"), factors), f"Trials of {card.name} in an invented bay.")
    listed = _scaled(_text(f"{kind}/dictionary.toml"), factors | {"helm_rad": helm})
    named = f"name = {toml_value(card.name)}"
    listed = re.sub(r"^name = .*", lambda _: named, listed, count=1, flags=re.MULTILINE)
    candidates, notes = _sailable(_headed(listed, f"Candidates for {card.name}."), vessel)
    ship = f"{card.name}, {vessel.length_m:g} m"
    texts = {
        "scenario": scenario.replace("[design]\n", PRIOR),
        "vessel": nominal_toml(replace(found, vessel=vessel), command),
        "dictionary": candidates,
    }
    said = f"{ship}, from her card, in an invented bay; candidates are scaled to her length and speed"
    files = _files(name, texts, length_m=vessel.length_m, ship=said)
    return Start(texts=files, ship=ship, notes=(*found.contradictions, *notes))


def _headed(text: str, title: str) -> str:
    """A template's file, whose first line names another ship."""
    return "\n".join([*toml_comments([title]), *text.splitlines()[1:], ""])


def _scaled(text: str, factors: Mapping[str, float]) -> str:
    """A file in which numbers are times the factor of the longest ending of their key, to three digits."""
    endings = sorted(factors, key=len, reverse=True)

    def row(match: re.Match[str]) -> str:
        factor = next((factors[end] for end in endings if match[1].endswith(end)), 1.0)
        numbers = re.sub(NUMBER, lambda one: repr(float(f"{factor * float(one[0]):.3g}")), match[2])
        return match[0] if factor == 1.0 else f"{match[1]} = {numbers}"

    return re.sub(rf"^(\w+) = (\[.*\]|{NUMBER})", row, text, flags=re.MULTILINE)


def _sailable(dictionary: str, vessel: Vessel) -> tuple[str, tuple[str, ...]]:
    """A dictionary file without the candidates that a vessel cannot sail, and a note on each."""
    head, *blocks = dictionary.split(BLOCK)
    kept, notes = [], []
    for block in blocks:
        try:
            for spec in _specs(head + BLOCK + block):
                build_primitive(vessel, spec)
        except (InputError, NoAnswer) as error:
            notes.append(f"left out of dictionary.toml, as she cannot sail it: {error}")
        else:
            kept.append(block)
    if not kept:
        raise InputError(f"she can sail none of the template's candidates: {notes[0]}")
    return BLOCK.join([head, *kept]), tuple(notes)


def _specs(dictionary: str) -> tuple[PrimitiveSpec, ...]:
    with TemporaryDirectory() as folder:
        (path,) = write_files(Path(folder), {"dictionary.toml": dictionary})
        return load_dictionary(path)


def _template(kind: str) -> Vessel:
    with as_file(TEMPLATES / kind / "vessel.toml") as path:
        return load_vessel(path)


def _text(name: str) -> str:
    return TEMPLATES.joinpath(name).read_text(encoding="utf-8")


def _bay(share: float) -> str:
    """The invented bay, scaled about its middle."""
    outline: dict[str, Any] = json.loads(_text("bay.geojson"))
    rings = [ring for feature in outline["features"] for ring in feature["geometry"]["coordinates"]]
    middle = [11.0, 58.0]
    for ring in rings:
        ring[:] = [[round(m + share * (x - m), 9) for x, m in zip(place, middle, strict=True)] for place in ring]
    return json.dumps(outline) + "\n"
