"""An antenna or velocity sensor away from the point that the model describes."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import listed
from expdesign.diagnosis.model import ExtendedModel


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    outputs = set(situation.ship.model.outputs)
    if situation.ship.has_found("lever:") or not {"v", "r"} <= outputs:
        return ()
    found = [Candidate(cause="lever_arm", free={"lever:forward": 0.0})]
    if "u" in outputs:
        found += [
            Candidate(cause="lever_arm", free={"lever:starboard": 0.0}),
            Candidate(cause="lever_arm", free={"lever:forward": 0.0, "lever:starboard": 0.0}),
        ]
    return tuple(found)


def _explain(values: Values, ship: ExtendedModel) -> str:
    sensor = "the antenna of the positions" if "u" in ship.derived else "the velocity sensor"
    return (
        f"Measured velocities contain the yaw rate times a lever arm. Position of {sensor} relative to the origin of "
        f"the model: {listed(values, ' m')}."
    )


LEVER_ARM = Cause(
    name="lever_arm",
    summary="an antenna or velocity sensor away from the point that the model describes",
    candidates=_candidates,
    explain=_explain,
)
