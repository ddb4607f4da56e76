"""One measured signal late against the others."""

from __future__ import annotations

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded

NAMES = {"psi": "the heading", "position": "the position"}


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if any(key.startswith("late:") for key in situation.ship.effects):
        return ()
    outputs = situation.ship.model.outputs
    signals = ["psi", "position"] if situation.windows.derived else list(outputs)
    found = [Candidate(cause="sensor_delay", free={f"late:{name}": 0.0}) for name in signals]
    if not situation.windows.derived and {"u", "v"} <= set(outputs):
        found.append(Candidate(cause="sensor_delay", free={"late:u": 0.0, "late:v": 0.0}))
    return tuple(found)


def _explain(values: Values) -> str:
    parts = " and ".join(
        f"{NAMES.get(key[5:], key[5:])} is recorded {rounded(value, std)} s late"
        for key, (value, std) in values.items()
    )
    _ = first(values)
    return f"One signal trails the others: {parts}."


SENSOR_DELAY = Cause(name="sensor_delay", candidates=_candidates, explain=_explain, suspect="rate of change")
