"""A term of the library that the model lacks: linear, a product or modulus of speeds, or cubic damping."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ADVANCE_LOSS, AIR, ExtendedModel


def absent_terms(situation: Situation, *, air: bool) -> list[str]:
    """Library terms not yet in the extended model: those of the air, or the others without the advance loss."""
    return [
        name
        for name in situation.ship.library
        if (name in AIR) == air and name not in ADVANCE_LOSS and not situation.has(f"term:{name}")
    ]


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    return tuple(
        Candidate(cause=f"missing_term:{name}", free={f"term:{name}": 0.0})
        for name in absent_terms(situation, air=False)
    )


def _explain(values: Values, ship: ExtendedModel) -> str:
    ((key, (value, std)),) = values.items()
    name = key[5:]
    term = f"the term {name} = {rounded(value, std)}, which multiplies {ship.library[name].expression}"
    return f"The error is correlated with a regressor that the model lacks: {term}."


MISSING_TERM = Cause(
    name="missing_term",
    summary="a term of the library that the model lacks: linear, a product or modulus of speeds, or cubic damping",
    candidates=_candidates,
    explain=_explain,
)
