"""Inertia that differs from the model's: other accelerations, the same steady speeds."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel

WORDS = {"u": "surge", "v": "sway", "r": "yaw"}


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if any(key.startswith("inertia:") for key in situation.ship.effects):
        return ()
    outputs = situation.ship.model.outputs
    groups: list[tuple[str, ...]] = [(name,) for name in outputs]
    if len(outputs) == 3:
        groups += [("u", "v"), ("v", "r"), ("u", "v", "r")]
    return tuple(Candidate(cause="load_change", free={f"inertia:{n}": 0.0 for n in group}) for group in groups)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    parts = ", ".join(
        f"{WORDS[key[-1]]} by {rounded(100 * value, 100 * std)} %" for key, (value, std) in values.items()
    )
    return f"Damping and thrust are wrong by the same factor, so the inertia differs from the model's: {parts}."


LOAD_CHANGE = Cause(
    name="load_change",
    summary="inertia that differs from the model's: other accelerations, the same steady speeds",
    candidates=_candidates,
    explain=_explain,
)
