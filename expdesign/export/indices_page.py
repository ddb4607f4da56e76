"""The circular's form as a document, which prints on paper."""

from __future__ import annotations

import math
from collections import Counter
from itertools import zip_longest

from markupsafe import Markup

from expdesign.export import words
from expdesign.export.document import Document, Items, Section, Table, filled, notes_of, section, verdict
from expdesign.export.files import entry
from expdesign.export.indices_form import (
    IndicesContent,
    degrees,
    intervals,
    overshoots,
    shown,
    verdict_rows,
    verdict_word,
)
from expdesign.export.nominal_page import RESULTS
from expdesign.export.words import speed
from expdesign.indices import (
    DEPTH_BY_DRAUGHT,
    HIGHEST_SEA,
    STRONGEST_WIND,
    Circle,
    NotStandard,
    Stop,
    Verdict,
    ZigZag,
    beaufort,
)
from expdesign.particulars import shown as in_mariners_units
from expdesign.vessel import Vessel

# The reporting form: ship, conditions, and results to port and to starboard beside the criterion.
#
# Source: IMO MSC/Circ.1053 (2002), appendix 6, form for reporting manoeuvring data to IMO.

GROUPS = (
    ("Turning circle", (("advance_m", "Advance"), ("tactical_diameter_m", "Tactical diameter"))),
    (
        "Zig-zag 10\N{DEGREE SIGN}/10\N{DEGREE SIGN}",
        (("overshoot_10_10_rad", "First overshoot"), ("second_overshoot_10_10_rad", "Second overshoot")),
    ),
    ("Zig-zag 20\N{DEGREE SIGN}/20\N{DEGREE SIGN}", (("overshoot_20_20_rad", "First overshoot"),)),
    (
        "Initial turning",
        (("initial_turning_m", "Distance to 10\N{DEGREE SIGN} of heading at 10\N{DEGREE SIGN} of helm"),),
    ),
    ("Stopping", (("track_reach_m", "Track reach, full astern"),)),
)
"""Trial -> (index, name) in the order of the form."""
KIND_NAMES = {"azimuth": "azimuth thruster", "tunnel": "tunnel thruster"}
NO_RESULT = "no\N{NO-BREAK SPACE}result"
MARKS = {
    "met": verdict("\N{CHECK MARK}", True),
    "not met": verdict("\N{BALLOT X} exceeds", False),
    "open": verdict("open", None),
    "no result": "",
}
"""Word of `VERDICT_WORDS` -> what stands beside the result."""
HEADER = ("From", "Run", "Index", "Result", "", "Limit", "Rule", "Verdict")
FORM = ("Trial", "Index", "To port", "To starboard", "Criterion, at most")
SHIP = ("Particular", "Value")
CONDITIONS = ("Condition", "Value", "Limit", "Verdict")
CIRCLES = (
    "From", "Run", "To", "Approach", "Helm [°]", "Advance [m]", "Transfer [m]", "Tactical diameter [m]",
    "Steady diameter [m]", "Current removed, north, east [m/s]",
)  # fmt: skip
ZIGZAGS = (
    "From", "Run", "First to", "Approach", "Overshoots [°]\nbeyond the heading at the order",
    "Orders: time, and heading [°]", "Heading / helm [°]", "Distance to 10° of heading [m]",
)  # fmt: skip
STOPS = (
    "From", "Run", "Approach", "Track reach", "Head reach", "To starboard", "Change of heading [°]", "Time [s]",
)  # fmt: skip
SURE = ("Simulated run", "Result", "Simulated", "95 % from", "To")
SURENESS = "Of 100 trials of ships that the vessel file's standard deviations allow, 95 lie within."
ASSUMED = (
    "Repeated trials scatter, and a model of second order misses them. The file does not say by how much, as estimate "
    "writes it (model.missed): 6 % of an advance or tactical diameter and a fifth of an overshoot count as standard "
    "deviations."
)
MISSED = (
    "Repeated trials scatter, and the model misses them: predictions of runs that were left out in turn, by {way:.2g} "
    "% of the way sailed and {turn:.2g} % of the heading turned (model.missed), which count as standard deviations."
)
ENDLESS = "\u201cNo end\u201d: some of these ships do not come to the end of the trial."
DEFINITIONS = (
    "Advance, transfer and tactical diameter refer to the midship point. They are measured from the rudder order, "
    "along and across the approach heading.",
    "An order starts when the rudder begins to move. An overshoot is the largest heading less the heading at the "
    "order, not less the nominal heading (MSC.137(76)); in simulations the two are the same.",
    'The time of an order is known to one sample of the record. "±" is how far the ship goes or turns in one sample '
    'at the order; noise of the sensors is not in it. A result is "open" where its limit lies within this tolerance.',
    "A run that begins with the helm over has no approach and no first order. Overshoots are given from its second "
    "reversal on, and have no criterion.",
    "A zig-zag is listed under the side of its first turn. L/V uses the approach speed of the full-scale ship.",
    "A uniform current is estimated and removed from measured turns of 540 degrees or more. Shorter turns are not "
    "corrected. No result is corrected for wind, loading or depth.",
    "Simulations are in calm, deep water. The stop is full astern with the helm unchanged.",
)


def indices_document(content: IndicesContent) -> Document:
    """The results beside their criteria, for people."""
    sources = _sources(content)
    refused = sum(isinstance(item, NotStandard) for item in content.measured)
    measured = {"measured_runs": len(content.measured), "measured_runs_without_result": refused}
    found = content.simulated
    circles = [_circle(source, trial) for source, trial in content.trials if isinstance(trial, Circle)]
    zigzags = [_zigzag(source, trial) for source, trial in content.trials if isinstance(trial, ZigZag)]
    stops = [_stop(source, trial) for source, trial in content.trials if isinstance(trial, Stop)]
    return Document(
        kind="Manoeuvring indices of IMO resolution MSC.137(76), in the form of MSC/Circ.1053, appendix 6",
        title=content.vessel.name,
        name=f"Manoeuvring indices of {content.vessel.name}",
        findings=(*(_counts(content, source) for source in sources), content.applies),
        facts={
            **({} if found is None else {"simulated_at_mps": found.speed_mps, "simulated_helm": found.helm}),
            **(measured if content.measured else {}),
        },
        values=_values(content),
        sections=filled(
            section("Ship", Table(header=SHIP, rows=ship_rows(content), texts=2, on="page", form=True), beside=True),
            section(
                "Conditions of the measured trials",
                Table(header=CONDITIONS, rows=condition_rows(content), texts=4, on="page", form=True),
                beside=True,
            ),
            _verdicts(content),
            *(
                section(f"Results, {source}", Table(header=FORM, rows=form_rows(content, source), texts=5, on="page"))
                for source in sources
            ),
            section("Turning circles", Table(header=CIRCLES, rows=circles, texts=4, on="page")),
            section("Zig-zags", Table(header=ZIGZAGS, rows=zigzags, texts=6)),
            section("Stopping", Table(header=STOPS, rows=stops, texts=3, on="page")),
            section(
                "How sure the simulated results are",
                Table(header=SURE, rows=sure_rows(content), texts=2),
                _sureness(content.vessel),
            ),
            *(
                [section("Missing results and remarks", *notes_of(content.notes_in_words))]
                if content.notes_in_words
                else []
            ),
            section("Definitions", Items(DEFINITIONS)),
        ),
    )


def _sureness(vessel: Vessel) -> str:
    """What intervals count, in words."""
    missed = vessel.model.missed
    trials = ASSUMED if missed is None else MISSED.format(way=100 * missed.way_share, turn=100 * missed.turn_share)
    return f"{SURENESS} {trials} {ENDLESS}"


def sure_rows(content: IndicesContent) -> list[tuple[str, ...]]:
    """Simulated results with their intervals."""

    def told(quantity: str, value: float) -> str:
        return in_mariners_units(quantity, value) if math.isfinite(value) else "no end"

    return [
        (one.run, RESULTS[one.quantity], *(told(one.quantity, end) for end in (one.value, one.low, one.high)))
        for one in intervals(content)
    ]


def _verdicts(content: IndicesContent) -> Section:
    tolerance = any(verdict.tolerance for _, verdict in content.verdicts)
    return section(
        f"MSC.137(76): {content.vessel.name}{' (± is one sample of the record at the order)' * tolerance}",
        Table(header=HEADER, rows=verdict_rows(content), texts=8, on="terminal"),
    )


def _values(content: IndicesContent) -> dict[str, object]:
    """More numbers, for JSON."""
    return {
        "vessel": content.vessel.name,
        **{
            f"{source}_criteria_{word.replace(' ', '_')}": number
            for source in _sources(content)
            for word, number in content.counted(source).items()
        },
        "results": {
            f"{source} {v.run}: {v.criterion.key}": {
                **entry(v, "value", "tolerance", "met"), "limit": v.criterion.limit
            }
            for source, v in content.verdicts
        },
    }  # fmt: skip


def _sources(content: IndicesContent) -> list[str]:
    """Where the trials are from, whether or not they give a result."""
    return ["measured"] * bool(content.measured) + ["simulated"] * (content.simulated is not None)


def _counts(content: IndicesContent, source: str) -> str:
    """How many results there are and how they stand to their criteria."""
    counted = content.counted(source)
    parts = ", ".join(f"{number} {word}" for word, number in counted.items()) if any(counted.values()) else "none"
    return f"{source.capitalize()} results beside their criteria: {parts}."


def form_rows(content: IndicesContent, source: str) -> list[tuple[str, ...]]:
    """Trial, index, to port, to starboard, criterion of "measured" or "simulated" trials, those not run included.

    An index that several runs to a side show has as many rows; a result without a side stands to port, and says so.
    """
    verdicts = [verdict for origin, verdict in content.verdicts if origin == source]
    rows: list[tuple[str, ...]] = []
    for trial, indices in GROUPS:
        for number, (key, name) in enumerate(indices):
            found = [verdict for verdict in verdicts if verdict.criterion.key == key]
            sides = [[one for one in found if one.side in at] for at in (("port", ""), ("starboard",))]
            missing = [NO_RESULT] * all(one.side for one in found)
            cells = [[_cell(content, one, of=len(side)) for one in side] or missing for side in sides]
            named = ("" if number else trial, name)
            for place, both in enumerate(zip_longest(*cells, fillvalue="")):
                rows.append(("", "", *both, "") if place else (*named, *both, _criterion(content, found, key)))
    return rows


def _cell(content: IndicesContent, verdict: Verdict, *, of: int) -> str:
    """A result, the same by length, and its verdict; where others stand beside it, its run in a second line."""
    limit, value = verdict.criterion, verdict.value
    length = f" = {value / content.vessel.length_m:.2f} L" if limit.key.endswith("_m") and value is not None else ""
    below = verdict.run if of > 1 else "" if verdict.side else "no side"
    text = f"{shown(limit.key, value, verdict.tolerance)}{length}".replace(" ", words.NB)
    return Markup("{} {}\n{}").format(text.replace(f"{words.NB}±", " ±"), MARKS[verdict_word(verdict)], below).strip()


RULES = {
    "advance_m": 4.5,
    "tactical_diameter_m": 5.0,
    "initial_turning_m": 2.5,
    "track_reach_m": 15.0,
}
"""Index -> its limit in ship lengths."""


def _criterion(content: IndicesContent, verdicts: list[Verdict], key: str) -> str:
    """The limit; overshoots of the 10/10 zig-zag have one for every approach speed."""
    if key in RULES:
        factor = RULES[key]
        more = "; the Administration may allow 20 L" if key == "track_reach_m" else ""
        return f"{factor:g} L = {shown(key, factor * content.vessel.length_m)}{more}"
    if key == "overshoot_20_20_rad":
        return "25.0 deg"
    limits = dict.fromkeys((shown(key, verdict.criterion.limit), verdict.criterion.rule) for verdict in verdicts)
    return "; ".join(f"{limit} {rule}" for limit, rule in limits) or "depends on L/V"


def ship_rows(content: IndicesContent) -> list[tuple[str, str]]:
    """Ship data; blanks for data that are not in the vessel file."""
    vessel = content.vessel
    size = ", ".join(
        f"{letter} {value:.4g} m"
        for letter, value in (("L", vessel.length_m), ("B", vessel.beam_m), ("T", vessel.draught_m))
    )
    kinds = Counter(KIND_NAMES.get(actuator.kind, actuator.kind) for actuator in vessel.actuators)
    rows = [
        ("Length, beam, mean draught", size + (f" (model 1:{content.scale:g})" if content.scale != 1 else "")),
        ("L/V", _length_by_speed(content)),
        ("L/B", f"{vessel.length_m / vessel.beam_m:.2f}"),
        ("B/T", f"{vessel.beam_m / vessel.draught_m:.2f}"),
        (
            "Propulsion and steering",
            ", ".join(f"{count} {name}{'s' if count > 1 else ''}" for name, count in kinds.items()),
        ),
    ]
    blanks = ("Type of ship", "Block coefficient", "Trim, loading (full load)", "Rudder type, area / (L T)", "Engine")
    return [*rows, *((name, "") for name in blanks)]


def _length_by_speed(content: IndicesContent) -> str:
    found = dict.fromkeys(
        f"{content.vessel.length_m / trial.speed_mps * content.scale**0.5:.1f} s at {speed(trial.speed_mps)}"
        for _, trial in content.trials
        if trial.speed_mps is not None
    )
    return ", ".join(found)


def condition_rows(content: IndicesContent) -> list[tuple[str, ...]]:
    """Condition, value, limit and verdict of the measured trials; what was not stated stays open."""
    draught, depth_m, wind_mps, sea = content.vessel.draught_m, content.depth_m, content.wind_mps, content.sea_state
    ratio = None if depth_m is None else depth_m / draught
    force = None if wind_mps is None else beaufort(wind_mps)
    return [
        (
            "Water depth / mean draught",
            "" if ratio is None else f"{depth_m:g} m / {draught:g} m = {ratio:.1f}",
            f"more than {DEPTH_BY_DRAUGHT:g}",
            "" if ratio is None else _kept(ratio > DEPTH_BY_DRAUGHT),
        ),
        (
            "Wind",
            "" if force is None else f"{speed(wind_mps or 0.0)}, Beaufort {force}",
            f"Beaufort {STRONGEST_WIND} at most",
            "" if force is None else _kept(force <= STRONGEST_WIND),
        ),
        (
            "Sea state",
            "" if sea is None else f"{sea}",
            f"{HIGHEST_SEA} at most",
            "" if sea is None else _kept(sea <= HIGHEST_SEA),
        ),
        ("Place and date", "", "", ""),
    ]


def _kept(kept: bool) -> str:
    return MARKS["met" if kept else "not met"]


def _metres(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _speed(value: float | None) -> str:
    return "" if value is None else words.speed(value)


def _with_tolerance(value: float | None, tolerance_m: float) -> str:
    return shown("_m", value, tolerance_m).removesuffix(" m") if value is not None else ""


def _circle(source: str, trial: Circle) -> tuple[str, ...]:
    advance = _with_tolerance(trial.advance_m, trial.tolerance_m)
    lengths = (trial.transfer_m, trial.tactical_diameter_m, trial.steady_diameter_m)
    current = ""
    if trial.current_north_mps is not None and trial.current_east_mps is not None:
        current = f"{trial.current_north_mps:.3f}, {trial.current_east_mps:.3f}"
    head = (source, trial.name, trial.side, _speed(trial.speed_mps), degrees(trial.helm_rad), advance)
    return (*head, *(_metres(length) for length in lengths), current)


def _zigzag(source: str, trial: ZigZag) -> tuple[str, ...]:
    executes = ", ".join(f"{order.time_s:.1f} s at {degrees(order.heading_rad)}" for order in trial.executes)
    initial = _with_tolerance(trial.initial_turning_m, trial.tolerance_m)
    head = (source, trial.name, trial.side, _speed(trial.speed_mps), overshoots(trial), executes)
    return (*head, f"{degrees(trial.heading_rad)} / {degrees(trial.helm_rad)}", initial)


def _stop(source: str, trial: Stop) -> tuple[str, ...]:
    reach = [shown("_m", value, trial.tolerance_m) for value in (trial.track_reach_m, trial.head_reach_m)]
    times = (degrees(trial.heading_change_rad), f"{trial.time_s:.0f}")
    return (source, trial.name, words.speed(trial.speed_mps), *reach, shown("_m", trial.lateral_m), *times)
