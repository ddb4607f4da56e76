"""Names of channels in words, and units as people write them."""

from __future__ import annotations

import math
import re
import unicodedata

from expdesign.importing.translations import in_english, without_eastern
from expdesign.records.file import ANGLE, REVOLUTIONS, SPEED, YAW_RATE

DEGREE, KNOT = math.pi / 180.0, 1852.0 / 3600.0
FACTORS: dict[str, dict[str, float]] = {
    "angle": {**ANGLE, "°": DEGREE, "degree": DEGREE, "grad": DEGREE, "cdeg": 0.01 * DEGREE, "ddeg": 0.1 * DEGREE},
    "speed": {**SPEED, "m/sec": 1.0, "mm/s": 1e-3, "km/hr": 1.0 / 3.6, "mph": 0.44704,
              **dict.fromkeys(("nds", "noeuds", "knop", "knob", "knoop", "knopen", "knoten", "nudos", "nodi"), KNOT)},
    "rate": {**YAW_RATE, "°/s": DEGREE, "°/min": DEGREE / 60.0, "deg/sec": DEGREE, "degrees/s": DEGREE,
             "deg/m": DEGREE / 60.0, "rad/sec": 1.0, "mrad/s": 1e-3, "r/s": 1.0},
    "place": {"deg": 1.0, "°": 1.0, "degrees": 1.0, "degree": 1.0, "rad": 1.0 / DEGREE, "1e-7 deg": 1e-7, "ddmm": 1.0},
    "length": {"m": 1.0, "km": 1e3, "cm": 0.01, "mm": 1e-3, "ft": 0.3048, "meters": 1.0, "metres": 1.0, "nm": 1852.0},
    "revolutions": {**REVOLUTIONS, "1/s": 1.0, "r/min": 1.0 / 60.0,
                    **dict.fromkeys(("u/min", "tr/min", "rev/min", "min-1"), 1.0 / 60.0)},
    "acceleration": {"mps2": 1.0, "m/s2": 1.0, "m/s^2": 1.0, "m/s/s": 1.0, "g": 9.80665, "mg": 9.80665e-3},
    "force": {"": 1.0},
}  # fmt: skip
"""Dimension -> unit -> factor to the unit of our columns (rad, m/s, rad/s, deg, m, rps, m/s2)."""
SHARES = {**dict.fromkeys(("percent", "%", "pct", "perc", "prozent"), 0.01), "pwm": 1.0 / 500.0, "share": 1.0}
"""Units of an order that is a share of the largest, and their factor; of pulse widths the middle, 1500 us, is zero."""
KNOWN = {unit for table in FACTORS.values() for unit in table if unit} | set(SHARES)
ALIASES = {"kt": "kn", "kts": "kn", "knots": "kn", "knot": "kn", "degrees": "deg", "degree": "deg", "°": "deg",
           "m/s": "mps", "m/sec": "mps", "deg/s": "degps", "°/s": "degps", "deg/sec": "degps", "deg/min": "degpmin",
           "°/min": "degpmin", "rad/s": "radps",
           **dict.fromkeys(("%", "pct", "perc", "prozent"), "percent"),
           "1/min": "rpm", "km/h": "kmph"}  # fmt: skip
"""Units as people write them -> one word for each."""
LETTERS = str.maketrans({"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "ß": "ss", "œ": "oe"})
RATES = re.compile(r"_(deg|rad|km|m|cm|rev|r)_(s|min|h)(?:_1)?$")
"""Units of two parts at the end of a name, as rate_deg_min."""


def words(name: str) -> str:
    """A name in lower case words of English: `RPM_P` -> "rpm p", `ATT.DesYaw` -> "att des yaw"."""
    name = without_eastern(name).translate(LETTERS)
    name = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return in_english(" ".join(re.findall(r"[a-z]+|\d+", apart.lower().replace("²", "2"))))


def split_unit(name: str) -> tuple[str, str]:
    """A name without its unit, and the unit: `Speed (kn)`, `SOG [kts]`, `rudder_deg`; "" where there is none."""
    if (ending := RATES.search(name)) and f"{ending[1]}/{ending[2]}" in KNOWN:
        return name[: ending.start()], unit_word(f"{ending[1]}/{ending[2]}")
    bracket = re.search(r"[\[({]\s*([^\])}]*?)\s*[\])}]\s*$", name)
    if bracket and bracket[1].lower() in KNOWN:
        return name[: bracket.start()].strip(), unit_word(bracket[1])
    ending = re.search(r"[_\s,/]+([A-Za-z%°/0-9]+)$", name)
    if ending and len(ending[1]) > 1 and ending[1].lower() in KNOWN and ending[1].lower() != "nm":
        return name[: ending.start()].strip(), unit_word(ending[1])
    return name, ""


def counted(count: int, what: str) -> str:
    """`1 line`, `2 lines`."""
    return f"{count} {what}{'s' if count != 1 else ''}"


def unit_word(text: str) -> str:
    """The one word for a unit."""
    unit = text.strip().lower()
    return ALIASES.get(unit, unit)
