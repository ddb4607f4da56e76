"""Manoeuvres that a search added to the dictionary, and the gain of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.export import words
from expdesign.export.report.tables import setting
from expdesign.growing import GrowRound, Growth


@dataclass(frozen=True, kw_only=True)
class GrowthRow:
    """One manoeuvre that was added."""

    number: int
    name: str
    what: str
    sensitivity: str
    gain: str
    efficiency: str
    excites: bool


def growth_rows(growth: Growth) -> list[GrowthRow]:
    """Additions in order."""
    return [_row(number, found) for number, found in enumerate(growth.rounds, start=1)]


def _row(number: int, found: GrowRound) -> GrowthRow:
    settings = ", ".join(setting(name, value) for name, value in found.settings.items())
    return GrowthRow(
        number=number,
        name=found.name,
        what=found.family.replace("_", " ") + (f"; {settings}" if settings else ""),
        sensitivity=words.number(found.sensitivity),
        gain=f"+{words.number(found.log_det_gain, 3)}" if found.log_det_gain >= 0 else words.number(found.log_det_gain),
        efficiency=words.percent(found.efficiency),
        excites=found.excitation_condition,
    )


def growth_sentences(growth: Growth) -> tuple[str, str]:
    """Sentences before and after the table: the search space, and the guarantee."""
    (u, v, r) = growth.limits.tolist()
    turning = [words.number(float(np.degrees(rate)), 1) for rate in r]
    before = (
        f"The search evaluated {words.counted(growth.evaluated, 'candidate')}, with u from {words.number(u[0])} to "
        f"{words.number(u[1])} m/s, v from {words.number(v[0])} to {words.number(v[1])} m/s and r from {turning[0]} to "
        f"{turning[1]} \N{DEGREE SIGN}/s. A manoeuvre improves the design if its sensitivity exceeds "
        f"{growth.dimension}. Each step adds the most sensitive one and optimises the durations again."
    )
    after = (
        f"The most sensitive remaining candidate has {words.number(growth.best_left)}. The final design therefore has "
        f"an efficiency of at least {words.percent(growth.efficiency_left)} among all evaluated candidates. There is "
        "no guarantee about manoeuvres that were not evaluated."
    )
    return before, after
