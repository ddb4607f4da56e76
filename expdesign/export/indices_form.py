"""The content of the form, its rows, and indices.json."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

from expdesign.export import words
from expdesign.export.files import entry, finite, strict_json
from expdesign.indices import Circle, NotStandard, StandardResults, Stop, Verdict, ZigZag, judge
from expdesign.indices.criteria import LEAST_LENGTH_M
from expdesign.particulars import Expected
from expdesign.vessel import Vessel

KINDS = {Circle: "turning circle", ZigZag: "zig-zag", Stop: "stopping", NotStandard: "no standard trial"}
Found = Circle | ZigZag | Stop | NotStandard
VERDICT_WORDS = ("met", "not met", "open", "no result")
OTHER_SPEED = 0.05
"""Difference of approach speeds, by the simulation's, above which measured and simulated results are no comparison."""


@dataclass(frozen=True, kw_only=True, eq=False)
class IndicesContent:
    """The content of the form."""

    vessel: Vessel  # particulars
    scale: float  # ship length by model length; 1 for a ship
    simulated: StandardResults | None  # results of the vessel model, or None where it cannot be simulated
    simulated_why_not: str  # why it cannot, or ""
    measured: tuple[Found, ...]  # results of measured runs
    notes: tuple[str, ...]  # remarks on the files, one sentence each
    # of the measured trials, where it is stated: depth of the water, mean speed of the true wind, sea state by its code
    depth_m: float | None = None
    wind_mps: float | None = None
    sea_state: int | None = None
    # results of ships that the vessel file's standard deviations allow, of the model's trials; none where it has none
    expected: tuple[Expected, ...] = ()

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
    def remarks(self) -> tuple[tuple[str, str], ...]:
        """(of what, remark): what gave no result and why, then remarks on runs, on the simulation and on the files."""
        refused = [(item.name, f"no result: {item.reason}") for item in self.measured if isinstance(item, NotStandard)]
        runs = [(trial.name, remark) for _, trial in self.trials for remark in trial.remarks]
        found = self.simulated
        model = [("simulation", reason) for reason in (found.not_run if found else (self.simulated_why_not,)) if reason]
        speeds = [trial.speed_mps for source, trial in self.trials if source == "measured" and trial.speed_mps]
        if found and any(abs(speed / found.speed_mps - 1) > OTHER_SPEED for speed in speeds):
            measured = " to ".join(dict.fromkeys(f"{end(speeds):.3g}" for end in (min, max)))
            model.append(
                (
                    "simulation",
                    f"is at {found.speed_mps:.3g} m/s, the runs at {measured} m/s: --speed-mps makes them alike",
                )
            )
        return (*refused, *runs, *model, *(("file", note) for note in self.notes))

    @property
    def notes_in_words(self) -> tuple[str, ...]:
        """The remarks as sentences, each after what it is of; those on files name them already."""
        return tuple(remark if what == "file" else f"{what}: {remark}" for what, remark in self.remarks)

    def counted(self, source: str) -> dict[str, int]:
        """Number of results of "measured" or "simulated" trials with each of `VERDICT_WORDS`, the last two if any."""
        counted = Counter(verdict_word(verdict) for origin, verdict in self.verdicts if origin == source)
        return {word: counted[word] for word in VERDICT_WORDS if counted[word] or word in ("met", "not met")}

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


def shown(key: str, value: float | None, tolerance: float = 0.0) -> str:
    """A value of an index in metres or degrees, with its tolerance where it has one."""
    if value is None:
        return "no result"
    if key.endswith("_rad"):
        return f"{math.degrees(value):.1f}{f' ± {math.degrees(tolerance):.1f}' if tolerance else ''} deg"
    return f"{value:.4g}{f' ± {tolerance:.2g}' if tolerance else ''} m"


def verdict_word(verdict: Verdict) -> str:
    """One of `VERDICT_WORDS`; open where the limit is within the tolerance."""
    if verdict.value is None:
        return "no result"
    return {True: "met", False: "not met", None: "open"}[verdict.met]


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
                shown(limit.key, value, verdict.tolerance),
                f"{value / length:.2f} L" if metric and value is not None else "",
                shown(limit.key, limit.limit),
                limit.rule,
                verdict_word(verdict).replace("not", "NOT"),
            )
        )
    return rows


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A simulated result with its 95 % interval."""

    run: str
    quantity: str
    value: float
    low: float
    high: float  # infinite where some ships do not come to the end of the trial


def intervals(content: IndicesContent) -> tuple[Interval, ...]:
    """Of the simulated results: as wide, in shares of the result, as those of the ships that the file allows."""
    found = []
    for trial in content.simulated.trials if content.simulated else ():
        for one in content.expected:
            value = _result(trial, one)
            if value is None or value <= 0 or not math.isfinite(one.value):
                continue
            low, high = (value / one.value * end for end in (one.low, one.high))
            found.append(Interval(run=trial.name, quantity=one.quantity, value=value, low=low, high=high))
    return tuple(found)


def _result(trial: Circle | ZigZag | Stop, one: Expected) -> float | None:
    """What a trial shows of an expected result, None where that is of another trial."""
    results: dict[str, float | None] = {}
    if isinstance(trial, Circle) and one.trial.kind == "circle":
        results = {name: getattr(trial, name) for name in ("advance_m", "transfer_m", "tactical_diameter_m")}
    elif isinstance(trial, ZigZag) and math.isclose(trial.heading_rad, one.trial.angle_rad):
        results = {f"overshoot_{number}_rad": value for number, value in enumerate(trial.overshoots_rad, start=1)}
    elif isinstance(trial, Stop) and one.trial.kind == "stop":
        results = {"reach_m": trial.track_reach_m, "time_s": trial.time_s}
    return results.get(one.quantity)


def overshoots(trial: ZigZag) -> str:
    """All of them, and the largest tolerance [deg]."""
    reversals = trial.executes[1 : len(trial.overshoots_rad) + 1]
    tolerance = max((order.tolerance_rad for order in reversals), default=0.0)
    return ", ".join(map(degrees, trial.overshoots_rad)) + (f" ± {degrees(tolerance)}" if tolerance else "")


def degrees(angle_rad: float) -> str:
    """With one decimal."""
    return words.number(math.degrees(angle_rad), 1)


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
                    **entry(verdict, "run", "side", "value", "tolerance", "met"),
                    "index": verdict.criterion.key,
                    **entry(verdict.criterion, "name", "limit", "rule"),
                }
                for source, verdict in content.verdicts
            ],
            "held": entry(content, "depth_m", "wind_mps", "sea_state"),
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
        "intervals_95": [asdict(one) | {"high": finite(one.high)} for one in intervals(content)],
        "not_run": list(found.not_run),
    }


def _trial(trial: Found) -> dict[str, Any]:
    return {"kind": KINDS[type(trial)], **asdict(trial)}
