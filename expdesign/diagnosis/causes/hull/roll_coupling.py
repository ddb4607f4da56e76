"""Roll that shows in sway and yaw: a lightly damped mode driven by the side acceleration."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ROLL, ExtendedModel

COUNT = 14
DAMPING = 0.08
SLOWER = 1.01
"""Than the fastest oscillation that the data show: a fit that ends there has found no roll."""


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    outputs = set(situation.ship.model.outputs)
    if situation.ship.has_found("roll:") or not {"v", "r"} <= outputs:
        return ()
    if situation.ship.has_roll:  # the vessel file has a mode, which may be another
        return (Candidate(cause="roll_coupling", free=dict.fromkeys(ROLL, 0.0)),)
    shortest = 4.0 * situation.windows.sample_s
    periods = np.geomspace(shortest, max(30.0 * shortest / 4, 2 * shortest), COUNT)
    return tuple(
        Candidate(
            cause="roll_coupling",
            free={"roll:sway": 0.0, "roll:yaw": 0.0},
            fixed={"roll:period": float(period), "roll:damping": DAMPING},
            above={"roll:period": SLOWER * situation.windows.shortest_period_s},
        )
        for period in periods
    )


def _explain(values: Values, _ship: ExtendedModel) -> str:
    period, std = values["roll:period"]
    return (
        f"Sway or yaw oscillates with a period of {rounded(period, std)} s, as roll can cause. Roll is not measured. "
        "Compare the period with the ship's roll period: waves or a steering loop can cause the same oscillation."
    )


ROLL_COUPLING = Cause(name="roll_coupling", candidates=_candidates, explain=_explain)
