"""Thrust too weak or too strong by one factor in every regime."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel, is_thrust, reads_rudder


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if situation.has("gain") or situation.has("gain:propeller"):
        return ()
    model = situation.ship.model
    thrust = [e for e in model.expressions if is_thrust(e, model)]
    found = [Candidate(cause="thrust_gain", free={"gain": 0.0})] if thrust else []
    if any(reads_rudder(e) for e in thrust) and not all(reads_rudder(e) for e in thrust):
        found.append(Candidate(cause="thrust_gain", free={"gain:propeller": 0.0}))
    return tuple(found)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    _, value, std = first(values)
    relation = "larger" if value > 0 else "smaller"
    return (
        f"Thrust is {rounded(100 * abs(value), 100 * std)} % {relation} than in the model, by the same factor in all "
        "directions. The damping is correct."
    )


THRUST_GAIN = Cause(
    name="thrust_gain",
    summary="thrust too weak or too strong by one factor in every regime",
    candidates=_candidates,
    explain=_explain,
)
