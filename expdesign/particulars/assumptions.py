"""What acts in the vessel of a card although the card does not state it, and where it comes from.

A mate reads a vessel file as his ship's. What stands there in place of something unknown has to say so, as limits and
rates decide what plans may ask of her.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from expdesign.particulars.card import Card, Thruster
from expdesign.particulars.forces import Propeller, tunnel


@dataclass(frozen=True)
class Assumed:
    """A value in place of a key that the card leaves out."""

    key: str
    value: float  # in the unit of the key; infinite where nothing limits it
    source: str


def assumed(card: Card, driving: tuple[Propeller, ...]) -> tuple[Assumed, ...]:
    """What acts in place of keys that the card leaves out."""
    acting = [
        *(
            row
            for number, one in enumerate(card.thrusters, start=1)
            for row in _of_thruster(card, one, number, driving)
        ),
        *(row for number in range(1, len(card.rudders) + 1) for row in _of_rudder(card, number)),
    ]
    return tuple(row for row in acting if row.key in card.silent)


def _of_thruster(card: Card, one: Thruster, number: int, driving: tuple[Propeller, ...]) -> Iterator[Assumed]:
    key = f"thrusters[{number}]"
    yield Assumed(f"{key}.full_order_s", one.full_order_s, "a quarter of the length in metres")
    if not one.drives:
        diameter_m, power_w, rps = tunnel(one, card)
        yield Assumed(f"{key}.diameter_m", diameter_m, "a usual share of the draught")
        yield Assumed(f"{key}.power_kw", power_w / 1e3, "usual for the diameter")
        yield Assumed(f"{key}.max_rpm", 60 * rps, "usual for the diameter; only its ratio to an order matters")
        return
    propeller = next(found for found in driving if found.number == str(number))
    yield Assumed(f"{key}.diameter_m", propeller.diameter_m, "a usual share of the draught")
    yield Assumed(f"{key}.max_rpm", 60 * propeller.max_rps, "what power or top speed ask for")
    yield Assumed(f"{key}.pitch_ratio", propeller.pitch_ratio, "what the top speed asks for")
    yield Assumed(f"{key}.astern_percent", 100 * one.astern_share, "usual")
    if one.kind != "propeller":
        most = math.inf if one.angle_max_rad is None else math.degrees(one.angle_max_rad)
        yield Assumed(f"{key}.turn_max_deg", most, "it turns freely")
        yield Assumed(f"{key}.turn_degps", math.degrees(one.angle_rate_radps), "usual")


def _of_rudder(card: Card, number: int) -> Iterator[Assumed]:
    key, one = f"rudders[{number}]", card.rudders[number - 1]
    yield Assumed(f"{key}.aspect_ratio", one.aspect_ratio, "usual")
    yield Assumed(f"{key}.max_deg", math.degrees(one.angle_max_rad), "usual")
    yield Assumed(f"{key}.rate_degps", math.degrees(one.angle_rate_radps), "the least by SOLAS; below 20 m, usual")
