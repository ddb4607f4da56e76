"""The keys of scenario, vessel, dictionary and area files, from the models that read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from expdesign.scenario.card_file import CardFile
from expdesign.scenario.charts.area_tables import AreaTable
from expdesign.scenario.dictionaries import DictionaryTable, PrimitiveTable
from expdesign.scenario.instruments_file import InstrumentsFile
from expdesign.scenario.keys import Key, keys_of
from expdesign.scenario.loads_file import LoadsFile
from expdesign.scenario.mapping_file import COLUMNS_BESIDE, MappingFile
from expdesign.scenario.scenario_file import ScenarioFile
from expdesign.scenario.tables import Table
from expdesign.scenario.vessels.vessel_tables import ACTUATOR_TABLES, ActuatorTable, VesselTable
from expdesign.workflows.explanations.values import Explained, Section, Topic

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


def scenario_topic() -> Topic:
    """Keys of a scenario file."""
    return Topic(
        name="scenario", title="Scenario files", text=f"{VARIANTS} {REFUSED}", sections=_by_table(ScenarioFile)
    )


def vessel_topic() -> Topic:
    """Keys of a vessel file; those of actuators by kind."""
    sections = [
        _with_more(section, ActuatorTable) if section.name == "actuators" else section
        for section in _by_table(VesselTable)
    ]
    kinds = [_kind(names, table) for table, names in _kinds().items()]
    return Topic(name="vessel", title="Vessel files", text=VESSELS, sections=(*sections[:2], *kinds, *sections[2:]))


def card_topic() -> Topic:
    """Keys of a pilot card."""
    return Topic(name="card", title="Pilot cards", text=CARDS, sections=_by_table(CardFile))


def loads_topic() -> Topic:
    """Keys of a file of load cases."""
    return Topic(name="loads", title="Files of load cases", text=LOADS, sections=_by_table(LoadsFile))


def mapping_topic() -> Topic:
    """Keys of a mapping file, and the columns that others are made from."""
    beside = tuple(
        Explained(name=name, meaning=meaning, default="optional") for name, meaning in COLUMNS_BESIDE.items()
    )
    more = Section(name="columns", title="columns beside those of expdesign explain data", entries=beside)
    return Topic(name="mapping", title="Mapping files", text=MAPPINGS, sections=(*_by_table(MappingFile), more))


def instruments_topic() -> Topic:
    """Keys of what an import leaves beside its runs."""
    return Topic(
        name="instruments", title="instruments.toml", text=INSTRUMENTS_TEXT, sections=_by_table(InstrumentsFile)
    )


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


def area_topic() -> Topic:
    """Keys of an area file."""
    return Topic(name="area", title="Area files", text=AREAS, sections=_by_table(AreaTable))


def _with_more(section: Section, model: type[Table]) -> Section:
    """A list of tables with the keys that all of them have."""
    return replace(section, entries=(*section.entries, *_entries(keys_of(model, f"{section.name}[]."))))


def _kinds() -> dict[type[Table], list[str]]:
    """Kinds of actuators by the table that reads them."""
    kinds: dict[type[Table], list[str]] = {}
    for kind, table in ACTUATOR_TABLES.items():
        kinds.setdefault(table, []).append(kind)
    return kinds


def _kind(names: Sequence[str], table: type[Table]) -> Section:
    own = [key for key in keys_of(table, "actuators[].") if key.name.split(".")[-1] not in ActuatorTable.model_fields]
    title = f"entries of [[actuators]] with kind = {' or '.join(repr(name) for name in names)}"
    return Section(name=names[0], title=title, entries=_entries(own))


def _by_table(model: type[Table]) -> tuple[Section, ...]:
    """One section for each table at the top of a file."""
    groups = groupby(keys_of(model), key=lambda key: key.name.split(".")[0].removesuffix("[]"))
    sections = []
    for name, group in groups:
        first, *rest = group
        sections.append(Section(name=name, title=f"[{name}]", entries=_entries([first, *rest])))
    return tuple(sections)


def _entries(keys: Sequence[Key]) -> tuple[Explained, ...]:
    return tuple(
        Explained(name=key.name, meaning=key.meaning, default=key.default, allowed=key.allowed) for key in keys
    )
