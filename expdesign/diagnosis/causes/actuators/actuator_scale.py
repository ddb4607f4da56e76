"""Rudders that turn by a share of the ordered angle: a wrong scale of the recorded orders or of the linkage."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel, group_columns, input_groups


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    """All rudders together, then each; other scales of inputs are gains of thrust."""
    ship, inputs = situation.ship, situation.ship.model.inputs
    if any(key.startswith("scale:") for key in ship.effects):
        return ()
    rudders = {*group_columns("rudder", inputs)}
    groups = [group for group in input_groups(inputs) if {*group_columns(group, inputs)} <= rudders]
    return tuple(Candidate(cause="actuator_scale", free={f"scale:{group}": 0.0}) for group in groups)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"The {key.split(':')[1]} angle that acts is {rounded(100 * (1 + value), 100 * std)} % of the recorded one: "
        "the ship answers as if every angle were that much larger or smaller."
    )


ACTUATOR_SCALE = Cause(
    name="actuator_scale",
    summary="rudders that turn by a share of the ordered angle: a wrong scale of the recorded orders or of the linkage",
    candidates=_candidates,
    explain=_explain,
)
