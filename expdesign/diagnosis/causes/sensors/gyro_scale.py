"""A rate gyro with a wrong scale: yaw rate against differences of the heading."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if "r" in windows.derived or "r" not in situation.ship.model.outputs:
        return ()
    return (Candidate(cause="gyro_scale", free={"gyro": 0.0}),)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    _, value, std = first(values)
    return (
        f"The yaw rate sensor has a scale error. It shows {rounded(100 * (1 + value), 100 * std)} % of the yaw rate "
        "that heading and motion show."
    )


GYRO_SCALE = Cause(name="gyro_scale", candidates=_candidates, explain=_explain)
