"""Dangers of GeoJSON charts by layer or property: rocks, wrecks, shoals, obstructions, unsurveyed areas, buoys.

Names of object classes of S-57 are understood as they are, other names word by word, in the languages of the table.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from expdesign.scenario.charts.geojson import UNNAMED, Feature, continuous_line, feature_polygons, positions_of
from expdesign.scenario.charts.zones import (
    BUOYS,
    CLEARANCES,
    DANGERS,
    OVERHEAD,
    SOLID,
    UNSURVEYED,
    ChartedObject,
    ChartTable,
)
from expdesign.scenario.tables import LARGEST, Entry

CLASSES = (*SOLID, *BUOYS, *DANGERS, *OVERHEAD, UNSURVEYED)
LANGUAGES = {
    "UWTROC": (
        "rock reef boulder skerry skerries pinnacle rocher roche recif ecueil fels felsen unterwasserfelsen klippe "
        "klippen riff riffe stein steine sten stenar skar revet undervattensskar skjaer undervannsskjaer bae baa "
        "baer grunne grunner kari karit kivi kivet vesikivi vesikivet vedenalainenkivi luoto rots rotsen rif riffen"
    ),
    "WRECKS": (
        "wreck shipwreck epave wrack wracks wracke schiffswrack vrak vraket vraken skeppsvrak skipsvrak hylky hylyt "
        "wrak wrakken scheepswrak"
    ),
    "OBSTRN": (
        "shoal obstruction obstructed foul snag danger dangerous hazard obstacle croche hautfond hautsfonds untiefe "
        "untiefen hindernis hindernisse unterwasserhindernis gefahr gefahrenstelle grund grundet grynna grynnor "
        "undervattensgrund hinder fara matala matalikko esteet vaara vedenalainen hinderomrade hindring "
        "fareomrade obstakel obstakels ondiepte ondiepten droogte gevaar"
    ),
    "SOUNDG": (
        "sounding sonde lotung lotungen tiefenpunkt tiefenpunkte lodning djuppunkt djupsiffra syvyyspiste "
        "syvyyspisteet dybdepunkt lodding loding lodingen dieptepunt peiling peilingen"
    ),
    UNSURVEYED: (
        "unsurveyed uncharted unsounded nonhydrographie nonleve nonleves unvermessen nichtvermessen osjomatt omatt "
        "ejsjomatt mittaamaton mittaamattomat ikkekartlagt ikkesjomalt ongekarteerd nietopgenomen"
    ),
    "BOYSPP": (
        "buoy bouee tonne tonnen boje bojen boj bojar prick prickar poiju poijut viitta viitat boye boyer boei boeien"
    ),
    "BCNSPP": "beacon balise bake baken bakens remmare reimari reimarit lysboye stake staker",
    "PILPNT": (
        "pile dolphin pylon pieu ducdalbe pfahl pfahle pfaehle dalben dykdalb paalu paalut pel peler "
        "duckdalbe paal palen dukdalf dukdalven meerpaal"
    ),
    "BRIDGE": "bridge pont ponts brucke brucken bruecke bruecken bro broar silta sillat bru bruer brug bruggen",
    "SLCONS": "breakwater groyne jetty pier briselames mole molen buhne buhnen vagbrytare aallonmurtaja molo moloer",
}
"""Words for dangers and obstacles by object class, without accents: English, French, German, Swedish, Norwegian and
Danish, Finnish, Dutch. Two words of a name that belong together are written as one."""
WORDS = {word: kind for kind, words in LANGUAGES.items() for word in words.split()}
LETTERS = str.maketrans({"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "œ": "oe", "Œ": "Oe", "ß": "ss"})
"""Letters that have no accent to be left out."""
SEAMARKS = {
    **{"cable_overhead": "CBLOHD", "pipeline_overhead": "PIPOHD", "conveyor": "CONVYR", "platform": "OFSPLF"},
    **{"fishing_facility": "FSHFAC", "marine_farm": "MARCUL", "mooring": "MORFAC", "hulk": "HULKES"},
    **{"pontoon": "PONTON", "floating_dock": "FLODOC", "dry_dock": "DRYDOC", "dyke": "DYKCON", "dam": "DAMCON"},
    **{"gate": "GATCON", "causeway": "CAUSWY", "log_pond": "LOGPON", "shoreline_construction": "SLCONS"},
    **{"light_vessel": "LITVES", "light_float": "LITFLT", "ice_area": "ICEARE", "weed": "WEDKLP"},
}
"""Values of seamark:type that no word tells, and their object class.

Source: OpenSeaMap, seamarks and their object classes in S-57 (wiki.openstreetmap.org/wiki/Seamarks).
"""
SEAMARK_KEYS = ("seamark:type", "seamark_type", "seamark-type")
"""The property as it is, and as file formats without colons in names write it."""
KIND_KEYS = (
    *("kind", "type", "class", "category", "object", "feature", "acronym", "natural", "hazard", "historic", "man_made"),
    *("objtype", "objekttype", "objektart", "objekttyp", "featuretype", "feature_type", "nature", "categorie", "art"),
    *("typ", "laji", "tyyppi", "kohdeluokka", "soort", "objectsoort", *SEAMARK_KEYS),
)
"""Properties that may say what a feature is, in the languages of the words."""
CLASS_OF_KEY = {"catwrk": "WRECKS", "catobs": "OBSTRN", "valsou": "OBSTRN"}  # attributes that only dangers have
NUMBERS = {86: "OBSTRN", 129: "SOUNDG", 153: "UWTROC", 154: UNSURVEYED, 159: "WRECKS"}
"""Numbers of object classes, attribute OBJL."""
DEPTH_KEYS = (
    *("depth_m", "depth", "least_depth_m", "least_depth", "valsou", "drval1"),
    *("profondeur", "tiefe", "djup", "dybde", "syvyys", "diepte"),
)


def kind_of(feature: Feature, table: ChartTable) -> str:
    """The object class of a danger or obstacle; "" for other features and for those that the file uses otherwise.

    Areas in land layers are land. Layers named in `danger_layers` hold dangers of whatever kind. Points and lines with
    a depth are soundings and depth contours.
    """
    area = feature.is_area
    land = feature.layer in table.land_layers or (feature.layer == UNNAMED and table.outlines == "land")
    if area and land:
        return ""
    if table.danger_layers is not None:
        return (_said(feature) or "OBSTRN") if feature.layer in table.danger_layers else ""
    named = land or feature.layer in (*table.water_layers, *(table.depth_layers or {}))
    spot = not area and table.depth_property is not None and feature.properties.get(table.depth_property) is not None
    return _said(feature) or ("" if named else _class(feature.layer)) or ("SOUNDG" if spot else "")


def dangers(features: tuple[Feature, ...], table: ChartTable, near_lon_deg: float) -> tuple[ChartedObject, ...]:
    """The dangers and obstacles among features.

    Args:
        table: of the area file.
        near_lon_deg: longitudes are counted within half a turn of it.

    Raises:
        FileError: naming the feature whose positions are wrong.
    """
    kinds = [(feature, kind_of(feature, table)) for feature in features]
    return tuple(
        ChartedObject(
            kind=kind,
            geometry=geometry,
            depth_m=_depth(feature, kind, table, geometry),
            clearance_m=_least(_numbers(feature, tuple(name.lower() for name in CLEARANCES))),
        )
        for feature, kind in kinds
        if kind
        for geometry in _geometries(feature.geometry, feature.entry, near_lon_deg)
    )


def taken_for(features: Iterable[Feature], table: ChartTable) -> tuple[str, ...]:
    """One line for each layer of features, and kind in it, that closes water, with the object class it is taken for."""
    counts = Counter(
        (kind, feature.layer, _kind_words(feature), feature.geometry["type"])
        for feature in features
        if (kind := kind_of(feature, table))
    )
    return tuple(
        f"taken for {kind}: {count} {geometry} in layer {layer!r}{words and f' of {words}'}"
        for (kind, layer, words, geometry), count in counts.items()
    )


def not_used(features: Iterable[Feature], used: Container[str]) -> tuple[str, ...]:
    """One line for each layer of features, and kind in it, that is not used.

    Args:
        features: that are no dangers.
        used: layers whose areas are used.
    """
    left = [item for item in features if not (item.layer in used and item.is_area)]
    counts = Counter((item.layer, _kind_words(item), item.geometry["type"]) for item in left)
    return tuple(
        f"not used: {count} {geometry} in layer {layer!r}{kind and f' of {kind}'}"
        for (layer, kind, geometry), count in counts.items()
    )


def _said(feature: Feature) -> str:
    """The object class that the properties of a feature state, or ""."""
    properties = {key.lower(): value for key, value in feature.properties.items() if value is not None}
    number = properties.get("objl")
    if type(number) in (int, float) and number in NUMBERS:
        return NUMBERS[int(number)]
    stated = [(key, value) for key in KIND_KEYS if isinstance(value := properties.get(key), str)]
    marked = (SEAMARKS.get(value.lower(), "") for key, value in stated if key in SEAMARK_KEYS)
    said = next(filter(None, (*marked, *(_class(value) for _, value in stated))), "")
    return said or next((CLASS_OF_KEY[key] for key in CLASS_OF_KEY if key in properties), "")


def _kind_words(feature: Feature) -> str:
    """What the properties say of a feature, e.g. "kind 'tree'", or ""."""
    for key, value in feature.properties.items():
        if key.lower() in KIND_KEYS and isinstance(value, str):
            return f"{key} {value[:40]!r}"
    return ""


def _class(name: str) -> str:
    """The object class of a name, or ""."""
    if name.upper() in CLASSES:
        return name.upper()
    words = _words(name)
    joined = (first + second for first, second in pairwise(words))
    return next((WORDS[found] for word in (*words, *joined) for found in _singular(word) if found in WORDS), "")


def _words(name: str) -> list[str]:
    """The words of a name in lower case and without accents."""
    plain = unicodedata.normalize("NFKD", name.translate(LETTERS))
    letters = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", letters)]


def _singular(word: str) -> tuple[str, str]:
    """A word, and without the plural's s."""
    return word, word.removesuffix("s")


def _depth(feature: Feature, kind: str, table: ChartTable, geometry: shapely.Geometry) -> float:
    """The least depth that is stated; nan for none. Soundings may state it as a third coordinate."""
    keys = (*DEPTH_KEYS, *([table.depth_property.lower()] if table.depth_property else []))
    stated = _least(map(table.below, _numbers(feature, keys)))
    if np.isnan(stated) and kind == "SOUNDG" and geometry.has_z:
        heights = shapely.get_coordinates(geometry, include_z=True)[:, 2]
        return _least(table.below(float(height)) for height in heights if height != 0)
    return stated


def _numbers(feature: Feature, keys: tuple[str, ...]) -> list[float]:
    """The numbers among properties; nan for one that is no number."""
    return [_number(value) for key, value in feature.properties.items() if key.lower() in keys and value is not None]


def _least(numbers: Iterable[float]) -> float:
    """The least number; nan where there is none, or where one of them is nan."""
    found = list(numbers)
    return float(np.min(found)) if found else np.nan


def _number(value: object) -> float:
    try:
        number = float(value) if isinstance(value, (int, float, str)) and not isinstance(value, bool) else np.nan
    except (ValueError, OverflowError):
        return np.nan
    return number if abs(number) < LARGEST else np.nan


def _geometries(geometry: Mapping[str, Any], entry: Entry, near_lon_deg: float) -> Iterator[shapely.Geometry]:
    """The parts of a geometry, checked; those that are not polygons with their third coordinate, if all have one."""
    kind, repairs = geometry.get("type"), Counter[tuple[str, str]]()
    if kind == "GeometryCollection":
        parts = geometry.get("geometries")
        for part in parts if isinstance(parts, list) else []:
            if isinstance(part, dict):
                yield from _geometries(part, entry, near_lon_deg)
    elif kind in ("Polygon", "MultiPolygon"):
        yield from feature_polygons(geometry, entry, near_lon_deg, repairs)
    else:
        content = geometry.get("coordinates")
        for part in [content] if kind in ("Point", "LineString") else content if isinstance(content, list) else [None]:
            points = positions_of([part] if kind in ("Point", "MultiPoint") else part, entry)
            points = continuous_line(points, near_lon_deg)
            yield shapely.Point(points[0]) if len(points) == 1 else shapely.LineString(points)
