"""A term that no cause of the catalogue is: found by regression on products of motion and inputs."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Cause, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel


def _explain(values: Values, ship: ExtendedModel) -> str:
    key, value, std = first(values)
    term = ship.library[key.split(":", 1)[1]]
    axis = {"u": "surge", "v": "sway", "r": "yaw"}[term.equation]
    return (
        f"No cause of the catalogue matches. Of many products of motion and inputs, a term like {term.expression} in "
        f"{axis} explains most, {rounded(value, std)}. Its form is a fit to these data, not physics: look for an "
        "effect of that form."
    )


UNLISTED_TERM = Cause(
    name="unlisted_term",
    summary="a term that no cause of the catalogue is: found by regression on products of motion and inputs",
    candidates=lambda _situation: (),
    explain=_explain,
)
