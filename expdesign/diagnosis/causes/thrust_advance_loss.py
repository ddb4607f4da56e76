"""Thrust that falls with the speed of advance."""

from __future__ import annotations

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.missing_term import ADVANCE_LOSS
from expdesign.diagnosis.causes.words import first, rounded


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    ship = situation.ship
    keys = [f"theta:{ADVANCE_LOSS}"] if ADVANCE_LOSS in ship.model.names else []
    keys += [f"term:{name}" for name in ship.library if name == ADVANCE_LOSS or name.startswith("X_un")]
    return tuple(Candidate(cause="thrust_advance_loss", free={key: 0.0}) for key in keys if key not in ship.effects)


def _explain(values: Values) -> str:
    key, value, std = first(values)
    way = "falls" if value < 0 else "grows"
    return f"The thrust error {way} with surge speed times thrust: {key.split(':')[1]} is off by {rounded(value, std)}."


THRUST_ADVANCE_LOSS = Cause(name="thrust_advance_loss", candidates=_candidates, explain=_explain, suspect="advance")
