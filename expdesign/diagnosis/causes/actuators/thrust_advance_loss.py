"""Thrust that falls with the speed of advance."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ADVANCE_LOSS, ExtendedModel, own_advance_terms


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    ship = situation.ship
    if any(key in ship.effects for key in (f"term:{name}" for name in ADVANCE_LOSS)):
        return ()
    keys = [f"theta:{name}" for name in own_advance_terms(ship.model)]
    keys += [f"term:{name}" for name in ADVANCE_LOSS if name in ship.library]
    return tuple(Candidate(cause="thrust_advance_loss", free={key: 0.0}) for key in keys)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"Thrust depends on the surge speed in another way than in the model. Change of {key.split(':')[1]}: "
        f"{rounded(value, std)}."
    )


THRUST_ADVANCE_LOSS = Cause(
    name="thrust_advance_loss",
    summary="thrust that falls with the speed of advance",
    candidates=_candidates,
    explain=_explain,
)
