"""Roll that shows in sway and yaw: a lightly damped mode driven by the side acceleration."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ROLL, ExtendedModel

COUNT = 14
DAMPING = 0.08
INSIDE = 1.01
"""Of the shortest period that the data show and of the longest that the ship can have: a fit that ends there has found
no roll."""


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    outputs = set(situation.ship.model.outputs)
    if situation.ship.has_found("roll:") or not {"v", "r"} <= outputs:
        return ()
    if situation.ship.has_roll:  # the vessel file has a mode, which may be another
        return (Candidate(cause="roll_coupling", free=dict.fromkeys(ROLL, 0.0)),)
    shortest, longest = 4.0 * situation.windows.sample_s, situation.ship.longest_roll_s / INSIDE
    if shortest > longest:
        return ()
    periods = np.geomspace(shortest, min(7.5 * shortest, longest), COUNT)
    return tuple(
        Candidate(
            cause="roll_coupling",
            free={"roll:sway": 0.0, "roll:yaw": 0.0},
            fixed={"roll:period": float(period), "roll:damping": DAMPING},
            above={"roll:period": INSIDE * situation.windows.shortest_period_s},
            below={"roll:period": longest},
        )
        for period in periods
    )


def _explain(values: Values, _ship: ExtendedModel) -> str:
    period, std = values["roll:period"]
    return (
        f"Sway or yaw oscillates with a period of {rounded(period, std)} s, as roll can cause. Roll is not measured. "
        "Compare the period with the ship's roll period: waves or a steering loop can cause the same oscillation."
    )


ROLL_COUPLING = Cause(
    name="roll_coupling",
    summary="roll that shows in sway and yaw: a lightly damped mode driven by the side acceleration",
    candidates=_candidates,
    explain=_explain,
)
