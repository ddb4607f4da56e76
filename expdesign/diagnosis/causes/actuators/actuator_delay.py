"""Actuators that follow their commands after a dead time."""

from __future__ import annotations

from expdesign.diagnosis.causes.actuators.actuator_lag import followers
from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    return followers(situation, "delay", "actuator_delay")


def _explain(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"The error occurs for a fixed time after each change of command. The dead time of {key.split(':')[1]} inputs "
        f"is {rounded(value, std)} s."
    )


ACTUATOR_DELAY = Cause(
    name="actuator_delay",
    summary="actuators that follow their commands after a dead time",
    candidates=_candidates,
    explain=_explain,
)
