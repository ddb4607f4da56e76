"""The keys of scenario, vessel, dictionary and area files, from the descriptions of the tables that read them."""

from __future__ import annotations

import types
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from expdesign.scenario.card_file import CardFile
from expdesign.scenario.charts.zones import AreaTable
from expdesign.scenario.dictionaries import DictionaryTable, LoadsFile, PrimitiveTable
from expdesign.scenario.import_files import COLUMNS_BESIDE, InstrumentsFile, MappingFile
from expdesign.scenario.scenario_file import ScenarioFile
from expdesign.scenario.tables import LARGEST, Table, shown
from expdesign.scenario.vessels.vessel_tables import ACTUATOR_TABLES, ActuatorTable, VesselTable


@dataclass(frozen=True, kw_only=True)
class Explained:
    """One thing that may be written."""

    name: str  # as it is written; keys are dotted
    meaning: str  # what it is, with its unit
    default: str = ""  # what stands in for it; "required", "optional", or ""
    allowed: str = ""  # the values it may have, or ""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Entries that belong together."""

    name: str  # one word that asks for it
    title: str  # what it is
    entries: tuple[Explained, ...]  # what it explains


@dataclass(frozen=True, kw_only=True)
class Topic:
    """Output of one call of `expdesign explain`."""

    name: str  # the word that asks for it
    title: str  # one line
    text: str = ""  # a few sentences, or ""
    sections: tuple[Section, ...]  # what it explains


KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", dict: "a table"}
BOUNDS = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}
FILES = {"min_length": "at least", "max_length": "at most"}


def keys_of(model: type[Table], prefix: str = "") -> Iterator[Explained]:
    """All keys of a table and of the tables in it, in the order of the model."""
    for name, field in model.fields().items():
        inner, listed = table_in(field.annotation)
        yield Explained(
            name=f"{prefix}{name}",
            meaning=field.description or "",
            default=_default(field, inner),
            allowed=_allowed(field.annotation, field.metadata),
        )
        if inner is not None:
            yield from keys_of(inner, f"{prefix}{name}{'[]' if listed else ''}.")


def table_in(annotation: Any) -> tuple[type[Table] | None, bool]:
    """The table that a key holds, and whether it holds a list of them; None for a plain value."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation, False
    for part in get_args(annotation):
        inner, listed = table_in(part)
        if inner is not None:
            return inner, listed or get_origin(annotation) is list
    return None, False


def _default(field: FieldInfo, inner: type[Table] | None) -> str:
    if field.is_required():
        return "required"
    value = None if inner is not None else field.get_default(call_default_factory=True, validated_data={})
    if value is None or value in ({}, [], ""):
        return "optional"
    return f"[{', '.join(map(shown, value))}]" if isinstance(value, list) else shown(value)


def _allowed(annotation: Any, metadata: list[Any]) -> str:
    """A few words for a type and its limits."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _allowed(arguments[0], [*arguments[1:], *metadata])
    if origin in (Union, types.UnionType):
        return " or ".join(_allowed(part, metadata) for part in arguments if part is not type(None))
    if origin is Literal:
        return " or ".join(map(shown, arguments))
    limits = [part for item in metadata for part in getattr(item, "metadata", [item])]
    if origin is list:
        sizes = {getattr(item, name) for item in limits for name in FILES if getattr(item, name, None) is not None}
        count = f"{sizes.pop()} " if len(sizes) == 1 and len(limits) > 1 else ""
        item, *limits_of_item = _allowed(arguments[0], []).removeprefix("a ").split(", ")
        return ", ".join([f"a list of {count}{item if item == 'text' else _plural(item)}", *limits_of_item])
    if origin is dict:
        return f"a table of name = {_allowed(arguments[1], []).removeprefix('a ')}"
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return "a table"
    words = [
        f"{word} {getattr(item, bound):.5g}"
        for item in limits
        for bound, word in BOUNDS.items()
        if abs(getattr(item, bound, None) or 0 if hasattr(item, bound) else LARGEST) < LARGEST
    ]
    return ", ".join([KINDS.get(annotation, "any"), *words])


def _plural(kind: str) -> str:
    """`list of 2 numbers` -> `lists of 2 numbers`."""
    if kind.startswith("whole number"):
        return kind.replace("whole number", "whole numbers", 1)
    first, *rest = kind.split(" ", 1)
    return " ".join([f"{first}s", *rest])


VARIANTS = (
    "Paths are relative to their file. A variant for expdesign whatif is a file with only the keys that "
    "differ. Positions are given by lat_deg and lon_deg, or by north_m and east_m."
)
VESSELS = (
    "Forward, starboard and clockwise are positive, counted from amidships. What is left out is ideal: no lag, no "
    "noise. Signals are numbered by kind in the order of the file: n1, a1 of the first thruster, rudder1 of the first "
    "rudder. Simulations act on lags, dead times and sensor faults; estimates undo them in the data first."
)
AREAS = (
    "Allowed water is inside the bounds and deep enough, and is neither land, danger nor a no-go zone. The layer of an "
    "outline in a GeoJSON chart says whether it encloses land (land_layers) or water (water_layers, depth_layers), or "
    "outlines in [chart] does for those that name no layer; without either the chart is refused. Dangers in a "
    "GeoJSON chart are rocks, wrecks, shoals, obstructions, soundings, unsurveyed areas, buoys, beacons and bridges: "
    "points, lines or areas. They are known by their layer, or by a property kind, type, class, natural, objtype or "
    "seamark:type: an object class of S-57, as OpenSeaMap writes it, or a word in English, French, German, Swedish, "
    "Norwegian, Danish, Finnish or Dutch. A property depth_m, depth or VALSOU states their least depth [m]; without "
    "one they count as at the surface. Results name every layer that is not used; danger_layers in [chart] adds others."
)
LOADS = (
    "One table [[load]] for each data file of expdesign roll, in their order; one without keys is the ship alone, one "
    "with unknown = true has the load that is sought. Heights are upward from one origin in the ship, which may be "
    "anywhere. [ship] is left out where --vessel names a file with [roll], which says the same. expdesign roll-plan "
    "reads such a file as candidates; it needs m and z_m of an unknown load under [start], roughly."
)
CARDS = (
    "What a pilot card, a wheelhouse poster or an old trial sheet states, in their units; expdesign nominal makes a "
    "vessel file of it. Only [ship] and one of [[thrusters]] are required. Trial values are fitted; one turning circle "
    "tells more than all particulars. Forward and starboard are positive, counted from midships."
)
MAPPINGS = (
    "expdesign import writes one, mapping.toml, with what it guessed from names, units and readings; changed, it is "
    "given as --map. column = (readings in the unit) scale + offset. A channel that the file does not name is not "
    "used. Of percent, share and pwm (1000 to 2000 us, 1500 in the middle) scale is what the largest order is."
)
INSTRUMENTS_TEXT = (
    "expdesign import leaves it beside its runs, with what the logs tell. Every command that reads the runs "
    "uses it where the vessel file says nothing, and says so; what the vessel file states counts, and a "
    "difference is told. Change or delete what is wrong."
)
REFUSED = (
    "A plan that is refused ends with exit status 3 and leaves a draft, refused.html and refused.json: what stands in "
    "the way and where, what was tried, and a change of one key with which the test that failed passes. A draft is no "
    "plan and has no route. Remedies are checked with a part of the work of planning; what was not tried is named. "
    "Results of an earlier attempt in the same folder stay; the draft names them. A plan that is found takes "
    "the draft away, or a note says why it stays."
)
KEYS_ALONE: dict[str, tuple[str, str, type[Table]]] = {
    "scenario": ("Scenario files", f"{VARIANTS} {REFUSED}", ScenarioFile),
    "card": ("Pilot cards", CARDS, CardFile),
    "area": ("Area files", AREAS, AreaTable),
    "loads": ("Files of load cases", LOADS, LoadsFile),
    "instruments": ("instruments.toml", INSTRUMENTS_TEXT, InstrumentsFile),
}
"""Topic of a file that has nothing but its keys -> title, text and the table that reads it."""


def file_topic(name: str) -> Topic:
    """Keys of a file."""
    title, text, table = KEYS_ALONE[name]
    return Topic(name=name, title=title, text=text, sections=_by_table(table))


def vessel_topic() -> Topic:
    """Keys of a vessel file; those of actuators by kind."""
    sections = [
        _with_more(section, ActuatorTable) if section.name == "actuators" else section
        for section in _by_table(VesselTable)
    ]
    by_table: dict[type[Table], list[str]] = {}
    for kind, table in ACTUATOR_TABLES.items():
        by_table.setdefault(table, []).append(kind)
    kinds = [_kind(names, table) for table, names in by_table.items()]
    return Topic(name="vessel", title="Vessel files", text=VESSELS, sections=(*sections[:2], *kinds, *sections[2:]))


def mapping_topic() -> Topic:
    """Keys of a mapping file, and the columns that others are made from."""
    beside = tuple(
        Explained(name=name, meaning=meaning, default="optional") for name, meaning in COLUMNS_BESIDE.items()
    )
    more = Section(name="columns", title="columns beside those of expdesign explain data", entries=beside)
    return Topic(name="mapping", title="Mapping files", text=MAPPINGS, sections=(*_by_table(MappingFile), more))


def dictionary_topic() -> Topic:
    """Keys of a dictionary file; the settings of families are a topic of their own."""
    first, primitives = _by_table(DictionaryTable)
    text = (
        "An entry also gives the settings of its family: expdesign explain families. A list of values stands for one "
        "manoeuvre each; several lists for every combination, at most 10 000."
    )
    return Topic(
        name="dictionary", title="Dictionary files", text=text, sections=(first, _with_more(primitives, PrimitiveTable))
    )


def _with_more(section: Section, model: type[Table]) -> Section:
    """A list of tables with the keys that all of them have."""
    return replace(section, entries=(*section.entries, *keys_of(model, f"{section.name}[].")))


def _kind(names: Sequence[str], table: type[Table]) -> Section:
    own = [key for key in keys_of(table, "actuators[].") if key.name.split(".")[-1] not in ActuatorTable.model_fields]
    title = f"entries of [[actuators]] with kind = {' or '.join(repr(name) for name in names)}"
    return Section(name=names[0], title=title, entries=tuple(own))


def _by_table(model: type[Table]) -> tuple[Section, ...]:
    """One section for each table at the top of a file."""
    groups = groupby(keys_of(model), key=lambda key: key.name.split(".")[0].removesuffix("[]"))
    return tuple(Section(name=name, title=f"[{name}]", entries=tuple(group)) for name, group in groups)
