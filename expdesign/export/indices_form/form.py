"""The content of the form, its rows, and indices.json."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from expdesign.errors import InputError
from expdesign.export.files import strict_json
from expdesign.indices import Circle, NotStandard, StandardResults, Stop, Verdict, ZigZag, judge
from expdesign.indices.criteria import LEAST_LENGTH_M
from expdesign.vessel import Vessel
from expdesign.vessel.environment import SEA_STATES

KINDS = {Circle: "turning circle", ZigZag: "zig-zag", Stop: "stopping", NotStandard: "no standard trial"}
Found = Circle | ZigZag | Stop | NotStandard


@dataclass(frozen=True, kw_only=True)
class Held:
    """Depth and weather of the measured trials; None where it is not stated.

    Attributes:
        depth_m: of the water.
        wind_mps: mean speed of the true wind.
        sea_state: code of the World Meteorological Organization, 0 to 9.

    Raises:
        InputError: a depth that is not positive, a negative wind, a code that there is not.
    """

    depth_m: float | None = None
    wind_mps: float | None = None
    sea_state: int | None = None

    def __post_init__(self) -> None:
        if self.depth_m is not None and not 0 < self.depth_m < math.inf:
            raise InputError(f"depth is {self.depth_m:g} m, expected more than 0")
        if self.wind_mps is not None and not 0 <= self.wind_mps < math.inf:
            raise InputError(f"wind is {self.wind_mps:g} m/s, expected 0 or more")
        if self.sea_state is not None and self.sea_state not in SEA_STATES:
            raise InputError(f"sea state is {self.sea_state}, expected a whole number from 0 to 9")


@dataclass(frozen=True, kw_only=True, eq=False)
class IndicesContent:
    """The content of the form.

    Attributes:
        vessel: particulars.
        scale: ship length by model length; 1 for a ship.
        simulated: results of the vessel model, or None where it cannot be simulated.
        simulated_why_not: why it cannot, or "".
        measured: results of measured runs.
        notes: remarks on the files, one sentence each.
        command: the command line.
        version: of the program.
        held: depth and weather of the measured trials.
    """

    vessel: Vessel
    scale: float
    simulated: StandardResults | None
    simulated_why_not: str
    measured: tuple[Found, ...]
    notes: tuple[str, ...]
    command: str
    version: str
    held: Held = field(default_factory=Held)

    @property
    def trials(self) -> tuple[tuple[str, Circle | ZigZag | Stop], ...]:
        """(source, trial) of every standard trial, measured ones first."""
        seen = [("measured", item) for item in self.measured if not isinstance(item, NotStandard)]
        return (*seen, *(("simulated", item) for item in (self.simulated.trials if self.simulated else ())))

    @property
    def verdicts(self) -> tuple[tuple[str, Verdict], ...]:
        """(source, verdict) of every index that has a criterion."""
        length = self.vessel.length_m
        return tuple(
            (source, verdict)
            for source, trial in self.trials
            for verdict in judge((trial,), length_m=length, scale=self.scale)
        )

    @property
    def applies(self) -> str:
        """Whether the resolution applies to this ship, as a sentence."""
        full = self.vessel.length_m * self.scale
        if full >= LEAST_LENGTH_M:
            return f"The resolution applies to ships of 100 m and over. This ship is {full:.0f} m long."
        return (
            "The resolution applies to ships of 100 m and over, and to chemical tankers and gas carriers of any "
            f"length. For this ship of {full:.4g} m its limits are for comparison only."
        )


def shown(key: str, value: float | None) -> str:
    """A value of an index in metres or degrees."""
    if value is None:
        return "no result"
    return f"{math.degrees(value):.1f} deg" if key.endswith("_rad") else f"{value:.4g} m"


def verdict_rows(content: IndicesContent) -> list[tuple[str, ...]]:
    """Source, run, index, value, value by length, limit, rule, verdict."""
    length = content.vessel.length_m
    rows: list[tuple[str, ...]] = []
    for source, verdict in content.verdicts:
        limit, value = verdict.criterion, verdict.value
        metric = limit.key.endswith("_m")
        rows.append(
            (
                source,
                verdict.run,
                limit.name,
                shown(limit.key, value),
                f"{value / length:.2f} L" if metric and value is not None else "",
                shown(limit.key, limit.limit),
                limit.rule,
                {True: "met", False: "NOT met", None: "-"}[verdict.met],
            )
        )
    return rows


def indices_json(content: IndicesContent) -> str:
    """indices.json: SI units and radians, units in the names."""
    return strict_json(
        {
            "vessel": content.vessel.name,
            "length_m": content.vessel.length_m,
            "scale": content.scale,
            "applies": content.applies,
            "simulated": _simulated(content),
            "measured": [_trial(item) for item in content.measured],
            "verdicts": [
                {
                    "source": source,
                    "run": verdict.run,
                    "side": verdict.side,
                    "index": verdict.criterion.key,
                    "value": verdict.value,
                    "limit": verdict.criterion.limit,
                    "rule": verdict.criterion.rule,
                    "met": verdict.met,
                }
                for source, verdict in content.verdicts
            ],
            "held": asdict(content.held),
            "notes": list(content.notes),
        }
    )


def _simulated(content: IndicesContent) -> dict[str, Any]:
    found = content.simulated
    if found is None:
        return {"not_run": [content.simulated_why_not]}
    return {
        "speed_mps": found.speed_mps,
        "helm": found.helm,
        "trials": [_trial(trial) for trial in found.trials],
        "not_run": list(found.not_run),
    }


def _trial(trial: Found) -> dict[str, Any]:
    return {"kind": KINDS[type(trial)], **asdict(trial)}
