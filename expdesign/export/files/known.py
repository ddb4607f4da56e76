"""Knowledge when the rest of a trial is planned, and the gain from the rest; as replan.json."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from expdesign.conventions import POSE_COLUMNS, VELOCITY_COLUMNS
from expdesign.export.files.text import finite, strict_json
from expdesign.plan.values import UnderWay
from expdesign.simulation.environment import Environment
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True)
class Purchase:
    """The manoeuvre whose runs are most informative about a parameter."""

    primitive: str  # its name; "" where no single manoeuvre matters
    runs: int  # number of its runs in the plan
    # ratio of the standard deviations of the parameter without and with them; inf where it is not estimable without
    # them
    without: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """The state of a trial in progress."""

    data: tuple[str, ...]  # files so far
    sailed_s: float  # time in them [s]
    total_s: float  # informative time of the whole trial [s]
    remaining_s: float  # informative time left [s]; nan where it is as long as the accuracy asked for takes
    remaining_stated: bool  # whether the user stated it
    pose: Array  # (3,) of the ship at the end of the data, in the area's frame
    speed_mps: float  # over ground in the last sample
    model: str  # origin of the model for the rest
    environment: Environment  # current and wind of the rest
    weather: str  # their origin
    notes: tuple[str, ...]  # further remarks, one sentence each
    parameters: tuple[str, ...]  # p names
    before: Array  # (p,) values before the trial, nan for parameters that the model did not have
    now: Array  # (p,) values now
    stated: Array  # (p,) standard deviations stated before the trial, 0 where none was
    so_far: Array  # (p,) of estimates from the data so far, predicted; nan where it is not estimable
    after: Array  # (p,) likewise from these data and the rest together
    purchases: tuple[Purchase, ...]  # (p,) most informative runs
    under_way: UnderWay | None = None  # how the ship moves as the rest begins; None where it is assumed to be stopped

    def __post_init__(self) -> None:
        seal(self, pose="3", before="p", now="p", stated="p", so_far="p", after="p")

    @property
    def new(self) -> tuple[str, ...]:
        """Parameters that the model did not have before the trial."""
        return tuple(name for name, value in zip(self.parameters, self.before, strict=True) if math.isnan(value))


def replan_json(known: Known) -> str:
    """Content of replan.json; numbers that are not finite are null."""
    columns = zip(
        known.parameters,
        *(column.tolist() for column in (known.before, known.now, known.stated, known.so_far, known.after)),
        known.purchases,
        strict=True,
    )
    moves = known.under_way
    current, wind = known.environment.current_to.tolist(), known.environment.wind_to.tolist()
    return strict_json(
        {
            "data": list(known.data),
            "sailed_s": known.sailed_s,
            "whole_trial_s": known.total_s,
            "remaining_s": finite(known.remaining_s),
            "remaining_stated": known.remaining_stated,
            "start": dict(zip(POSE_COLUMNS, known.pose.tolist(), strict=True)),
            "measured_speed_mps": known.speed_mps,
            "begins_with": None if moves is None else dict(zip(VELOCITY_COLUMNS, moves.velocity.tolist(), strict=True)),
            "model": known.model,
            "environment": {
                "from": known.weather,
                "current_to": {"north_mps": current[0], "east_mps": current[1]},
                "wind_to": {"north_mps": wind[0], "east_mps": wind[1]},
            },
            "notes": list(known.notes),
            "parameters": {name: _entry(*row) for name, *row in columns},
        }
    )


def _entry(before: float, now: float, stated: float, so_far: float, after: float, purchase: Purchase) -> dict[str, Any]:
    return {
        "before": finite(before),
        "now": now,
        "std_before": stated or None,
        "std_so_far": finite(so_far),
        "std_after_rest": finite(after),
        "bought_by": purchase.primitive or None,
        "std_ratio_without_it": finite(purchase.without),
    }
