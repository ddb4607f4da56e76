"""An antenna or velocity sensor away from the point that the model describes."""

from __future__ import annotations

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import listed


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    outputs = set(situation.ship.model.outputs)
    if any(key.startswith("lever:") for key in situation.ship.effects) or not {"v", "r"} <= outputs:
        return ()
    found = [Candidate(cause="lever_arm", free={"lever:forward": 0.0})]
    if "u" in outputs:
        found += [
            Candidate(cause="lever_arm", free={"lever:starboard": 0.0}),
            Candidate(cause="lever_arm", free={"lever:forward": 0.0, "lever:starboard": 0.0}),
        ]
    return tuple(found)


def _explain(values: Values) -> str:
    return (
        f"Measured velocities contain yaw rate times a length: the sensor is {listed(values, ' m')} of the point that "
        f"the model describes."
    )


LEVER_ARM = Cause(name="lever_arm", candidates=_candidates, explain=_explain, suspect="r")
