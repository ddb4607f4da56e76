"""The criteria of IMO MSC.137(76) (2002), 5.3, and whether results meet them.

They apply to ships of 100 m and over, and to chemical tankers and gas carriers of any length; for others they are a
reference. Limits on overshoots depend on L/V, length over approach speed, of the full-scale ship.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from expdesign.indices.tuning import TUNING
from expdesign.indices.values import Circle, Stop, ZigZag

LEAST_LENGTH_M = 100.0
DEGREE = math.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One limit.

    Attributes:
        key: of the index, unit in the name.
        name: for people.
        limit: largest value allowed [m or rad].
        rule: the limit in words.
    """

    key: str
    name: str
    limit: float
    rule: str


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """One index compared with its limit.

    Attributes:
        criterion: the limit.
        run: name of the run that shows the index.
        side: "starboard", "port", or "" where there is none.
        value: of the index [m or rad], or None where the run does not show it.
    """

    criterion: Criterion
    run: str
    side: str
    value: float | None

    @property
    def met(self) -> bool | None:
        """Whether the criterion is met; None where the run does not show the index."""
        return None if self.value is None else self.value <= self.criterion.limit


def criteria(length_m: float, speed_mps: float, *, scale: float = 1.0) -> tuple[Criterion, ...]:
    """All limits of a ship.

    Args:
        length_m: between perpendiculars, of the hull the results are from [m].
        speed_mps: approach speed of the trial.
        scale: of a model: ship length over model length; L/V of the ship is its root times the model's.
    """
    ratio_s = length_m / speed_mps * math.sqrt(scale)
    first = min(max(5.0 + ratio_s / 2.0, 10.0), 20.0)
    second = min(max(17.5 + 0.75 * ratio_s, 25.0), 40.0)
    rows = (
        ("advance_m", "advance", 4.5 * length_m, "4.5 L"),
        ("tactical_diameter_m", "tactical diameter", 5.0 * length_m, "5 L"),
        ("initial_turning_m", "initial turning, 10 deg of heading at 10 deg of helm", 2.5 * length_m, "2.5 L"),
        ("overshoot_10_10_rad", "10/10 zig-zag, first overshoot", first * DEGREE, f"at L/V = {ratio_s:.1f} s"),
        ("second_overshoot_10_10_rad", "10/10 zig-zag, second overshoot", second * DEGREE, f"at L/V = {ratio_s:.1f} s"),
        ("overshoot_20_20_rad", "20/20 zig-zag, first overshoot", 25.0 * DEGREE, "25 deg"),
        ("track_reach_m", "track reach, full astern", 15.0 * length_m, "15 L; the Administration may allow 20 L"),
    )
    return tuple(Criterion(key=key, name=name, limit=limit, rule=rule) for key, name, limit, rule in rows)


def judge(found: Iterable[Circle | ZigZag | Stop], *, length_m: float, scale: float = 1.0) -> tuple[Verdict, ...]:
    """Every index with a criterion, run by run; zig-zags other than 10/10 and 20/20 have none."""
    verdicts: list[Verdict] = []
    for trial in found:
        limits = {limit.key: limit for limit in criteria(length_m, trial.speed_mps, scale=scale)}
        for key, value in indices_of(trial).items():
            if key in limits:
                side = getattr(trial, "side", "")
                verdicts.append(Verdict(criterion=limits[key], run=trial.name, side=side, value=value))
    return tuple(verdicts)


def indices_of(trial: Circle | ZigZag | Stop) -> dict[str, float | None]:
    """Key -> value of the indices that have criteria."""
    if isinstance(trial, Circle):
        return {"advance_m": trial.advance_m, "tactical_diameter_m": trial.tactical_diameter_m}
    if isinstance(trial, Stop):
        return {"track_reach_m": trial.track_reach_m}
    first, second = (*trial.overshoots_rad, None, None)[:2]
    if _is(trial, 10.0):
        return {
            "initial_turning_m": trial.initial_turning_m,
            "overshoot_10_10_rad": first,
            "second_overshoot_10_10_rad": second,
        }
    return {"overshoot_20_20_rad": first} if _is(trial, 20.0) else {}


def _is(trial: ZigZag, degrees: float) -> bool:
    near_heading = abs(trial.heading_rad - degrees * DEGREE) < TUNING.zigzag_deviation_rad
    return near_heading and abs(trial.helm_rad - degrees * DEGREE) < TUNING.zigzag_deviation_rad
