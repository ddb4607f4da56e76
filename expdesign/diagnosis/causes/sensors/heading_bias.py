"""A misaligned compass or velocity sensor: surge speed leaks into measured sway."""

from __future__ import annotations

import math

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if not {"u", "v"} <= set(situation.ship.model.outputs):
        return ()
    return (Candidate(cause="heading_bias", free={"heading_bias": 0.0}),)


def _explain(values: Values, ship: ExtendedModel) -> str:
    _, value, std = first(values)
    size, less = rounded(math.degrees(abs(value)), math.degrees(std)), value > 0
    leak = "Measured sway contains surge speed, v_measured = v + u sin(bias)"
    if "u" in ship.derived:
        return f"{leak}: velocities come from positions and heading, and the compass shows {size} degrees too " + (
            "little." if less else "much."
        )
    return (
        f"{leak}: the axes of the velocity sensor lie {size} degrees to {'port' if less else 'starboard'} of the "
        f"ship's. Where velocities were turned with the compass before they were recorded, the compass shows that much "
        f"too {'little' if less else 'much'} instead."
    )


HEADING_BIAS = Cause(
    name="heading_bias",
    summary="a misaligned compass or velocity sensor: surge speed leaks into measured sway",
    candidates=_candidates,
    explain=_explain,
)
