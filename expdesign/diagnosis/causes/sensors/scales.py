"""A rate gyro with a wrong scale, by heading and motion; a log with a wrong scale, where no positions tell it."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel


def _of_gyro(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if "r" in windows.derived or "r" not in situation.ship.model.outputs:
        return ()
    return (Candidate(cause="gyro_scale", free={"gyro": 0.0}),)


def _explain_gyro(values: Values, _ship: ExtendedModel) -> str:
    _, value, std = first(values)
    return (
        f"The yaw rate sensor has a scale error. It shows {rounded(100 * (1 + value), 100 * std)} % of the yaw rate "
        "that heading and motion show."
    )


def _of_log(situation: Situation) -> tuple[Candidate, ...]:
    """None where positions are measured: these tell the scale before any model (`kinematics`)."""
    windows = situation.windows
    if windows.has_position or not {"u", "v"} <= set(situation.ship.model.outputs):
        return ()
    return (Candidate(cause="log_scale", free={"log": 0.0}),)


def _explain_log(values: Values, _ship: ExtendedModel) -> str:
    _, value, std = first(values)
    return (
        f"The log has a scale error. It shows {rounded(100 * (1 + value), 100 * std)} % of the speed that inputs and "
        "turns show."
    )


GYRO_SCALE = Cause(name="gyro_scale", candidates=_of_gyro, explain=_explain_gyro)
LOG_SCALE = Cause(name="log_scale", candidates=_of_log, explain=_explain_log)
