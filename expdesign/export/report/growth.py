"""What a search added to the dictionary, and what each addition brought."""

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
    """Additions in the order in which they came."""
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
    """What the search looked for before its table, and what it promises after it."""
    (u, v, r) = growth.limits.tolist()
    turning = [words.number(float(np.degrees(rate)), 1) for rate in r]
    before = (
        f"{words.counted(growth.evaluated, 'candidate')} were looked at, with u from {words.number(u[0])} to "
        f"{words.number(u[1])} m/s, v from {words.number(v[0])} to {words.number(v[1])} m/s and r from {turning[0]} to "
        f"{turning[1]} \N{DEGREE SIGN}/s. A manoeuvre helps where its sensitivity is above {growth.dimension}; each "
        "round adds the one with the largest, and shares the time out again."
    )
    after = (
        f"In the end the most sensitive candidate found has {words.number(growth.best_left)}, so that the optimum has "
        f"an efficiency of at least {words.percent(growth.efficiency_left)} among all candidates that were looked at. "
        "Of manoeuvres that the search did not come across it says nothing."
    )
    return before, after
