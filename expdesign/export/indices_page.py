"""The form as one page that prints on paper."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

from expdesign.export import words
from expdesign.export.indices_form import IndicesContent, overshoots, shown, verdict_rows, verdict_word
from expdesign.export.pages import page_template
from expdesign.export.words import speed
from expdesign.indices import DEPTH_BY_DRAUGHT, HIGHEST_SEA, STRONGEST_WIND, Circle, Stop, Verdict, ZigZag, beaufort

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


@dataclass(frozen=True, kw_only=True)
class Result:
    """One result in a cell: the value, the same by length, the run it is from, and one of `VERDICT_WORDS`."""

    value: str
    by_length: str
    run: str
    verdict: str


@dataclass(frozen=True, kw_only=True)
class Line:
    """One line of the form; `both` holds results that have no side."""

    trial: str
    name: str
    port: tuple[Result, ...]
    starboard: tuple[Result, ...]
    both: tuple[Result, ...]
    criterion: str


def form_lines(content: IndicesContent, source: str) -> list[Line]:
    """The results of "measured" or "simulated" trials, those that were not run included."""
    verdicts = [verdict for origin, verdict in content.verdicts if origin == source]
    lines = []
    for trial, indices in GROUPS:
        for number, (key, name) in enumerate(indices):
            of_index = [verdict for verdict in verdicts if verdict.criterion.key == key]
            cells = {
                side: tuple(_result(content, verdict) for verdict in of_index if verdict.side == side)
                for side in ("port", "starboard", "")
            }
            lines.append(
                Line(
                    trial="" if number else trial,
                    name=name,
                    port=cells["port"],
                    starboard=cells["starboard"],
                    both=cells[""],
                    criterion=_criterion(content, of_index, key),
                )
            )
    return lines


def _result(content: IndicesContent, verdict: Verdict) -> Result:
    value = verdict.value
    metric = verdict.criterion.key.endswith("_m") and value is not None
    return Result(
        value=shown(verdict.criterion.key, value, verdict.tolerance),
        by_length=f"{value / content.vessel.length_m:.2f} L" if metric and value is not None else "",
        run=verdict.run,
        verdict=verdict_word(verdict),
    )


RULES = {
    "advance_m": 4.5,
    "tactical_diameter_m": 5.0,
    "initial_turning_m": 2.5,
    "track_reach_m": 15.0,
}


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


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A condition of the measured trials beside its limit; `met` is None where it was not stated."""

    name: str
    found: str
    limit: str
    met: bool | None


def condition_rows(content: IndicesContent) -> list[Shown]:
    """Water depth, wind and sea of the measured trials."""
    held, draught = content.held, content.vessel.draught_m
    ratio = None if held.depth_m is None else held.depth_m / draught
    force = None if held.wind_mps is None else beaufort(held.wind_mps)
    return [
        Shown(
            name="Water depth / mean draught",
            found="" if ratio is None else f"{held.depth_m:g} m / {draught:g} m = {ratio:.1f}",
            limit=f"more than {DEPTH_BY_DRAUGHT:g}",
            met=None if ratio is None else ratio > DEPTH_BY_DRAUGHT,
        ),
        Shown(
            name="Wind",
            found="" if force is None else f"{speed(held.wind_mps or 0.0)}, Beaufort {force}",
            limit=f"Beaufort {STRONGEST_WIND} at most",
            met=None if force is None else force <= STRONGEST_WIND,
        ),
        Shown(
            name="Sea state",
            found="" if held.sea_state is None else f"{held.sea_state}",
            limit=f"{HIGHEST_SEA} at most",
            met=None if held.sea_state is None else held.sea_state <= HIGHEST_SEA,
        ),
    ]


def indices_html(content: IndicesContent) -> str:
    """One HTML page without outside references."""
    sources = tuple(dict.fromkeys(source for source, _ in content.trials))
    page = page_template("indices.html")
    return page.render(
        content=content,
        rows=verdict_rows(content),
        sources=sources,
        forms={source: form_lines(content, source) for source in sources},
        ship=ship_rows(content),
        conditions=condition_rows(content),
        counts=[_counts(content, source) for source in sources],
        circles=[_circle(source, trial) for source, trial in content.trials if isinstance(trial, Circle)],
        zigzags=[_zigzag(source, trial) for source, trial in content.trials if isinstance(trial, ZigZag)],
        stops=[_stop(source, trial) for source, trial in content.trials if isinstance(trial, Stop)],
    )


def _counts(content: IndicesContent, source: str) -> str:
    """How many results there are and how they stand to their criteria."""
    counted = content.counted(source)
    parts = ", ".join(f"{number} {word}" for word, number in counted.items()) if any(counted.values()) else "none"
    return f"{source.capitalize()} results beside their criteria: {parts}."


def _degrees(angle_rad: float) -> str:
    return words.number(math.degrees(angle_rad), 1)


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
    head = (source, trial.name, trial.side, _degrees(trial.helm_rad), _speed(trial.speed_mps), advance)
    return (*head, *(_metres(length) for length in lengths), current)


def _zigzag(source: str, trial: ZigZag) -> tuple[str, ...]:
    executes = ", ".join(f"{order.time_s:.1f} s at {_degrees(order.heading_rad)}" for order in trial.executes)
    initial = _with_tolerance(trial.initial_turning_m, trial.tolerance_m)
    head = (source, trial.name, trial.side, f"{_degrees(trial.heading_rad)} / {_degrees(trial.helm_rad)}")
    return (*head, _speed(trial.speed_mps), overshoots(trial), initial, executes)


def _stop(source: str, trial: Stop) -> tuple[str, ...]:
    reach = [shown("_m", value, trial.tolerance_m) for value in (trial.track_reach_m, trial.head_reach_m)]
    times = (_degrees(trial.heading_change_rad), f"{trial.time_s:.0f}")
    return (source, trial.name, words.speed(trial.speed_mps), *reach, shown("_m", trial.lateral_m), *times)
