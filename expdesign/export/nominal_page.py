"""A vessel out of a card, in a mariner's units: JSON, vessel file, and a document with her trials and the sources."""

from __future__ import annotations

import math

from expdesign import __version__
from expdesign.export.document import Document, Table, notes_of, section
from expdesign.export.files import finite, strict_json, vessel_toml
from expdesign.export.words import ship
from expdesign.particulars import Assumed, Nominal, Predicted, Trial, assumed, is_usual, shown
from expdesign.simulation import Helm

TRIAL_HEADER = ("Trial", "Result", "Predicted", "95 % from", "To", "Stated", "From particulars alone")
FACTOR_HEADER = ("Part of the forces", "Source", "Scatter before", "Times", "Scatter after")
ASSUMED_HEADER = ("Not in the card", "Assumed", "Because")
TAKEN_HEADER = ("Thruster", "Diameter", "Full order", "Pitch ratio", "Wake", "Thrust deduction")
RESULTS = {
    "speed_mps": "speed",
    "advance_m": "advance",
    "transfer_m": "transfer",
    "tactical_diameter_m": "tactical diameter",
    "time_90_s": "time to 90 deg",
    "time_180_s": "time to 180 deg",
    "speed_90_mps": "speed at 90 deg",
    "speed_180_mps": "speed at 180 deg",
    "overshoot_1_rad": "first overshoot",
    "overshoot_2_rad": "second overshoot",
    "reach_m": "track reach",
    "time_s": "time",
    "turn_90_s": "time to 90 deg",
    "drift_mps": "drift",
}
"""Quantity -> its words."""
NO_TRIAL = (
    "Nothing of a trial is stated: intervals are those of the regressions alone. One turning circle, with the speed of "
    "its approach, narrows them most."
)
SIDES = (
    "Circles and zig-zags are the same to both sides: the model is symmetric, and values of both sides are fitted "
    "together. A wind of the beam meets a ship whose heading is held."
)
SPEEDS = (
    "Second-order terms hold from rest to the stated top speed; wave resistance beyond it, planing, and shallow water "
    "are not in them."
)

UNUSUAL = (
    "The regressions were made from single hulls with a block coefficient of 0.48 to 0.88 and a length of 3.5 to 8.5 "
    "beams. Hers is another, so the scatter of her hull's forces and of her trials is doubled."
)
PLANING = "wave-making and planing are not in the regressions, state speeds at several orders."
HUMP = 0.45
BY_PROPELLERS = (
    "She steers by her propellers: a helm of 35 deg stands for an order of 57 % of full more on one side and less on "
    "the other, whatever her speed, so that she may gather speed in a circle that begins slowly."
)
ASSUMED = (
    "The card does not state these, so that they are the program's, not the ship's. State what is known: plans ask of "
    "her what limits and rates allow."
)


def _given(one: Assumed) -> str:
    """A value in the unit of its key."""
    return f"{one.value:.4g}" if math.isfinite(one.value) else "no limit"


def nominal_notes(found: Nominal) -> tuple[str, ...]:
    """What contradicts, and what to bear in mind."""
    measured = any(one.trial.kind != "speed" for one in found.card.stated)
    calm = "Without [windage] no term reads the wind: simulated wind does not move her."
    froude = found.driving[0].design_mps / math.sqrt(9.81 * found.card.hull.length_m)
    forms = () if is_usual(found.card.hull) else (UNUSUAL,)
    planes = (f"At full order her Froude number is {froude:.2f}: {PLANING}",) if froude > HUMP else ()
    windless = () if found.card.windage else (calm,)
    helmless = (BY_PROPELLERS,) if Helm(vessel=found.vessel).means == "propeller" else ()
    untried = () if measured else (NO_TRIAL,)
    return (*found.contradictions, *untried, *forms, *planes, *helmless, SIDES, SPEEDS, *windless)


def trial_words(trial: Trial) -> str:
    """A trial as a mariner names it."""
    speed, angle = shown("speed_mps", trial.speed_mps), f"{math.degrees(trial.angle_rad):.3g}"
    match trial.kind:
        case "speed":
            return f"ahead at {100 * trial.order:.3g} %"
        case "circle":
            return f"circle from {speed}, helm {angle} deg"
        case "zigzag":
            return f"zig-zag {angle}/{angle} at {speed}"
        case "stop":
            how = f"{100 * trial.order:.3g} % astern" if trial.order else "engines stopped, to a fifth of the speed"
            return f"stop from {speed}, {how}"
        case "spin":
            return "turn on the spot"
    return f"drift in {speed} of wind on the beam"


def _trial_row(one: Predicted) -> tuple[str, ...]:
    def text(value: float) -> str:
        return shown(one.quantity, value) if math.isfinite(value) else "no end"

    stated = ", ".join(f"{shown(one.quantity, item.value)} {item.side}".rstrip() for item in one.stated)
    return (
        trial_words(one.trial), RESULTS[one.quantity], text(one.value), text(one.low), text(one.high), stated or "-",
        text(one.prior),
    )  # fmt: skip


def nominal_json(found: Nominal, command: str) -> str:
    """All results as JSON, SI."""
    return strict_json(
        {
            "command": command,
            "version": __version__,
            "vessel": found.vessel.name,
            "trials": [
                {
                    "trial": one.trial.kind, "words": trial_words(one.trial), "speed_mps": one.trial.speed_mps,
                    "angle_rad": one.trial.angle_rad, "order": one.trial.order, "quantity": one.quantity,
                    "value": finite(one.value), "low_95": finite(one.low), "high_95": finite(one.high),
                    "from_particulars_alone": finite(one.prior), "stated": [item.value for item in one.stated],
                }
                for one in found.predicted
            ],
            "factors": {
                one.name: {
                    "source": one.source, "std_log_before": one.std_log, "value": one.value,
                    "std_log_after": one.std_log_after,
                }
                for one in found.found
            },
            "contradictions": list(found.contradictions),
            "assumed": {one.key: finite(one.value) for one in assumed(found.card, found.driving)},
            "notes": list(nominal_notes(found)),
        }
    )  # fmt: skip


def nominal_toml(found: Nominal, command: str) -> str:
    """The vessel file; its head says where the numbers come from."""
    head = (
        f"{found.vessel.name}, made by: {command}",
        "Forces from particulars by published formulas; each part times what the card's trial values make of it:",
        *(f"  {one.name}: times {one.value:.3f}, {100 * one.std_log_after:.0f} %; {one.source}" for one in found.found),
    )
    taken = [f"  {one.key} = {_given(one)}: {one.source}" for one in assumed(found.card, found.driving)]
    told = ("Assumed, as the card does not state it:", *taken) if taken else ()
    return vessel_toml(found.vessel, comments=(*head, *told, *nominal_notes(found)))


def nominal_document(found: Nominal) -> Document:
    """The vessel for people."""
    factors = [
        (one.name, one.source, f"{100 * one.std_log:.0f} %", f"{one.value:.2f}", f"{100 * one.std_log_after:.0f} %")
        for one in found.found
    ]
    taken = [
        (
            f"n{one.number}, {one.thruster.kind}", f"{one.diameter_m:.3g} m", f"{60 * one.max_rps:.4g} rpm",
            f"{one.pitch_ratio:.2f}", f"{one.wake:.2f}", f"{one.deduction:.2f}",
        )
        for one in found.driving
    ]  # fmt: skip
    rows = [(one.key, _given(one), one.source) for one in assumed(found.card, found.driving)]
    return Document(
        kind="Nominal vessel, from particulars and stated trials",
        title=found.vessel.name,
        name=f"{found.vessel.name}: nominal vessel",
        about=ship(found.vessel),
        facts={
            "parameters": len(found.vessel.model.names),
            "stated_values": sum(len(one.stated) for one in found.predicted),
        },
        values={"vessel": found.vessel.name, "contradictions": list(found.contradictions)},
        sections=(
            section("To bear in mind", *notes_of(nominal_notes(found))),
            section(
                "Where the numbers come from",
                Table(header=FACTOR_HEADER, rows=factors, texts=2),
                "Each part of the forces has the value of its source, times the number in the table. The scatter "
                "is one standard deviation.",
            ),
            section("Thrusters that drive her", Table(header=TAKEN_HEADER, rows=taken, texts=1)),
            *([section("What is assumed", Table(header=ASSUMED_HEADER, rows=rows, texts=3), ASSUMED)] if rows else []),
            section(
                "Her trials",
                Table(header=TRIAL_HEADER, rows=[_trial_row(one) for one in found.predicted], texts=2),
                "Intervals hold 95 of 100 trials of ships that the particulars and the stated values allow. "
                "\u201cNo end\u201d: some of these ships do not come to the end of the trial.",
            ),
        ),
    )
