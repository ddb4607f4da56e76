"""A ship that turns at zero angle: thrust off the centre line, or wrong angles."""

from __future__ import annotations

import math

from expdesign.diagnosis.causes.actuators.actuator_lag import open_groups
from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ANGLE_STEMS, ExtendedModel, ahead_force_text, group_columns, turns_by_force


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    ship = situation.ship
    if ship.has_found("offset:") or ship.has_found("asymmetry") or "r" not in ship.model.outputs:
        return ()
    angles = {column for stem in ANGLE_STEMS for column in group_columns(stem, ship.model.inputs)}
    groups = [
        group for group in open_groups(situation, "offset") if {*group_columns(group, ship.model.inputs)} <= angles
    ]
    lean = Candidate(cause="thruster_asymmetry", free={"asymmetry": 0.0})
    return (lean, *(Candidate(cause="thruster_asymmetry", free={f"offset:{group}": 0.0}) for group in groups))


def _explain(values: Values, ship: ExtendedModel) -> str:
    key, value, std = first(values)
    side = "port" if value > 0 else "starboard"
    if key == "asymmetry" and not turns_by_force(ship.model):
        turn = "starboard" if value > 0 else "port"
        return (
            f"Thrust turns the ship to {turn} at zero angle. The yaw acceleration is {rounded(value, std)} "
            f"rad/s\N{SUPERSCRIPT TWO} per {ahead_force_text(ship.model)}, as if thrust acted to {side} of the centre "
            "line."
        )
    if key == "asymmetry":
        return (
            f"A yaw moment is proportional to the ahead thrust: {rounded(abs(value), std)} m, as if thrust acted at "
            f"this distance to {side} of the centre line. The ship turns at zero angle."
        )
    size = rounded(math.degrees(value), math.degrees(std))
    return f"The angle of {key.split(':')[1]} is off by {size} degrees: the ship turns when it is commanded straight."


THRUSTER_ASYMMETRY = Cause(
    name="thruster_asymmetry",
    summary="a ship that turns at zero angle: thrust off the centre line, or wrong angles",
    candidates=_candidates,
    explain=_explain,
)
