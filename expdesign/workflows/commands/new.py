"""`expdesign new`: a folder to start from, out of the templates that come with the program."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from expdesign import requests
from expdesign.errors import InputError
from expdesign.export.document import Document
from expdesign.export.folder import write_files
from expdesign.progress import Progress, silent
from expdesign.scenario import load_scenario
from expdesign.workflows.outcome import Outcome, workflow

TEMPLATES = files("expdesign") / "templates"
KINDS = {
    "azimuth": "an offshore vessel of 45 m with two azimuth thrusters and a tunnel thruster",
    "propeller-rudder": "a coaster of 80 m with one propeller and one rudder",
    "twin-screw": "a ship of 60 m with two propellers, two rudders and a tunnel thruster",
    "asv": "an unmanned craft of 2 m that steers by the difference of two propellers",
}
"""Kind of ship -> what its template describes."""
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

{ship}, invented; every number is to be replaced by yours. From this folder's parent:

1. `expdesign run {name}/scenario.toml --draft` takes a quick look; without `--draft` the plan is verified.
2. `vessel.toml` is the ship: particulars, actuators with limits and rates, model, and how far parameters may be off.
3. `dictionary.toml` lists candidate manoeuvres, `area.toml` and `area.geojson` the water.
4. `scenario.toml` names the three and states time, start, goal, weather and what the plan must keep to.
5. After the runs: `expdesign estimate RECORD.csv --vessel {name}/vessel.toml`, then `expdesign replan`.

`expdesign explain` lists what may stand in a file; `expdesign explain first-plan` goes through a plan step by step.
"""


@workflow
def new(request: requests.New, *, progress: Progress = silent) -> Outcome:
    """A folder with scenario, vessel, dictionary and area of a kind of ship, and a page that says what is where.

    Raises:
        InputError: the folder exists.
    """
    if request.folder.exists():
        raise InputError(f"{request.folder} exists, expected the name of a folder to be made")
    name = request.folder.resolve().name
    texts = {item: _text(f"{request.kind}/{item}.toml") for item in ("scenario", "vessel", "dictionary")}
    lines = texts["scenario"].splitlines(keepends=True)
    renamed = [f"name = {json.dumps(name)}\n" if line.startswith("name = ") else line for line in lines]
    length_m = next(float(line.split()[2]) for line in texts["vessel"].splitlines() if line.startswith("length_m"))
    ship = KINDS[request.kind]
    paths = write_files(
        request.folder,
        {
            "scenario.toml": "".join(renamed),
            "vessel.toml": texts["vessel"],
            "dictionary.toml": texts["dictionary"],
            "area.toml": AREA.format(name=f"bay of {length_m * 110 / 1000:.2g} km"),
            "area.geojson": _bay(length_m / OUTLINE_HULL_M),
            "README.md": README.format(name=name, ship=f"{ship[0].upper()}{ship[1:]}"),
        },
    )
    load_scenario(request.folder / "scenario.toml")
    progress("done", 1.0)
    then = f"expdesign run {request.folder / 'scenario.toml'}"
    return Outcome(files=paths, document=Document(facts={"kind": request.kind, "ship": ship, "then": then}))


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
