"""A steady current."""

from __future__ import annotations

import math

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if not situation.windows.has_heading:
        return ()
    return (Candidate(cause="current", free={"current:north": 0.0, "current:east": 0.0}),)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    (north, _), (east, _) = values["current:north"], values["current:east"]
    toward = math.degrees(math.atan2(east, north)) % 360
    return (
        f"The error depends on the heading as in moving water. It corresponds to a steady current of "
        f"{math.hypot(north, east):.2f} m/s towards {toward:.0f} degrees "
        f"(north {rounded(*values['current:north'])}, east {rounded(*values['current:east'])} m/s)."
    )


CURRENT = Cause(name="current", summary="a steady current", candidates=_candidates, explain=_explain)
