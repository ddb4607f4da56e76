"""A misaligned compass or velocity sensor: surge speed leaks into measured sway."""

from __future__ import annotations

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if situation.has("heading_bias") or not {"u", "v"} <= set(situation.ship.model.outputs):
        return ()
    return (Candidate(cause="heading_bias", free={"heading_bias": 0.0}),)


def _explain(values: Values) -> str:
    _, value, std = first(values)
    degrees = 57.29578
    return (
        f"Measured sway contains surge speed: v_measured = v + u sin(bias) with a bias of "
        f"{rounded(degrees * value, degrees * std)} degrees. The sensor is misaligned, the ship is not."
    )


HEADING_BIAS = Cause(name="heading_bias", candidates=_candidates, explain=_explain, suspect="u")
