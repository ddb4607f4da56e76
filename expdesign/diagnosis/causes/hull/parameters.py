"""Parameter values that are wrong by more than their stated standard deviations."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel, asymmetry_terms, own_advance_terms, own_air_terms


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    """Single parameters, all of an equation, and all; not those alone whose change is another cause."""
    model = situation.ship.model
    named = {*own_advance_terms(model), *own_air_terms(model), *asymmetry_terms(model)}
    groups: list[tuple[str, ...]] = [(f"theta:{name}",) for name in model.names if name not in named]
    for equation in model.outputs:
        groups.append(tuple(f"theta:{term.name}" for term in model.terms if term.equation == equation))
    groups.append(tuple(f"theta:{name}" for name in model.names))
    return tuple(Candidate(cause="parameters", free=dict.fromkeys(group, 0.0)) for group in dict.fromkeys(groups))


def _explain(values: Values, _ship: ExtendedModel) -> str:
    changes = ", ".join(f"{key[6:]} by {rounded(value, std)}" for key, (value, std) in values.items())
    return f"The model structure explains the data with other parameter values. Changes: {changes}."


PARAMETERS = Cause(
    name="parameters",
    summary="parameter values that are wrong by more than their stated standard deviations",
    candidates=_candidates,
    explain=_explain,
)
