"""A rate gyro with a wrong scale, by heading and motion; a log with a wrong scale, where no positions tell it."""

from __future__ import annotations

from collections.abc import Callable

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel


def _of_gyro(situation: Situation) -> tuple[Candidate, ...]:
    if "r" in situation.windows.derived or "r" not in situation.ship.model.outputs:
        return ()
    return (Candidate(cause="gyro_scale", free={"gyro": 0.0}),)


def _of_log(situation: Situation) -> tuple[Candidate, ...]:
    """None where positions are measured: these tell the scale before any model (`kinematics`)."""
    if situation.windows.has_position or not {"u", "v"} <= set(situation.ship.model.outputs):
        return ()
    return (Candidate(cause="log_scale", free={"log": 0.0}),)


def _shows(sensor: str, motion: str) -> Callable[[Values, ExtendedModel], str]:
    """An explanation: what share of a motion a sensor shows."""

    def explain(values: Values, _ship: ExtendedModel) -> str:
        _, value, std = first(values)
        return f"{sensor} has a scale error. It shows {rounded(100 * (1 + value), 100 * std)} % of the {motion} show."

    return explain


GYRO_SCALE = Cause(
    name="gyro_scale",
    summary="a rate gyro with a wrong scale, by heading and motion",
    candidates=_of_gyro,
    explain=_shows("The yaw rate sensor", "yaw rate that heading and motion"),
)
LOG_SCALE = Cause(
    name="log_scale",
    summary="a log with a wrong scale, where no positions tell it",
    candidates=_of_log,
    explain=_shows("The log", "speed that inputs and turns"),
)
