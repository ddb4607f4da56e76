"""One measured signal late against the others."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel

NAMES = {
    "u": "the speed ahead",
    "v": "the speed to starboard",
    "r": "the yaw rate",
    "psi": "the heading",
    "position": "the position",
}


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if situation.ship.has_found("late:"):
        return ()
    outputs = situation.ship.model.outputs
    derived = set(situation.windows.derived)
    signals = [name for name in outputs if name not in derived]
    signals += ["psi"] if derived or (situation.windows.has_heading and "r" in outputs) else []
    signals += ["position"] if derived & {"u", "v"} else []
    found = [Candidate(cause="sensor_delay", free={f"late:{name}": 0.0}) for name in signals]
    if {"u", "v"} <= set(signals):
        found.append(Candidate(cause="sensor_delay", free={"late:u": 0.0, "late:v": 0.0}))
    return tuple(found)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    parts = " and ".join(
        f"{NAMES.get(key[5:], key[5:])} is recorded {rounded(abs(value), std)} s {'late' if value >= 0 else 'early'}"
        for key, (value, std) in values.items()
    )
    if any(value < 0 for value, _ in values.values()):
        return f"Signals are not synchronous: {parts}. An early signal means that the others are late or filtered."
    return f"Signals are not synchronous: {parts}."


SENSOR_DELAY = Cause(
    name="sensor_delay", summary="one measured signal late against the others", candidates=_candidates, explain=_explain
)
