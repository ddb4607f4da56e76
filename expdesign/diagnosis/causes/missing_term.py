"""A term of the library that the model lacks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.vessel import NUMPY, TERMS, Term, VesselModel
from expdesign.vessel.expressions import parse_expression
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS

MORE_TERMS = (
    Term("u", "X_vv", "v*v"),
    Term("u", "X_rr", "r*r"),
    Term("v", "Y_r", "r"),
    Term("v", "Y_uv", "u*v"),
    Term("v", "Y_abs_r_r", "abs(r)*r"),
    Term("r", "N_v", "v"),
    Term("r", "N_ur", "u*r"),
    Term("r", "N_abs_r_r", "abs(r)*r"),
)
"""Second-order modulus terms that manoeuvring models often have beside the built-in ones."""
ADVANCE_LOSS = "X_kappa"
AIR = ("W_abs_u_u", "W_abs_v_v", "W_uv")


def library(model: VesselModel) -> Mapping[str, Term]:
    """Every term that may be added to a model: those of its equations whose regressor it does not have."""
    rng = np.random.default_rng(0)
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    table = {name: rng.standard_normal(12) for name in names}
    own = [
        (term.equation, expression.evaluate(table, NUMPY))
        for term, expression in zip(model.terms, model.expressions, strict=True)
    ]
    found = {}
    for term in (*TERMS.values(), *MORE_TERMS):
        if term.name in model.names or term.equation not in model.outputs:
            continue
        if not _readable(term, model):
            continue
        values = parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
        if not any(term.equation == equation and _parallel(values, other) for equation, other in own):
            found[term.name] = term
    return found


def _readable(term: Term, model: VesselModel) -> bool:
    """Generalised forces mean something only to models that are driven through them."""
    through_force = any(set(expression.signals) & set(FORCE_SIGNALS) for expression in model.expressions)
    return through_force or not any(name in term.expression for name in FORCE_SIGNALS)


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(abs(abs(a @ b) - np.linalg.norm(a) * np.linalg.norm(b)) < 1e-9 * np.linalg.norm(a) * np.linalg.norm(b))


def lacking(situation: Situation, *, air: bool) -> list[str]:
    """Library terms not yet in the extended model: those of the air, or the others without the advance loss."""
    return [
        name
        for name in situation.ship.library
        if (name in AIR) == air and name != ADVANCE_LOSS and not situation.has(f"term:{name}")
    ]


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    return tuple(
        Candidate(cause=f"missing_term:{name}", free={f"term:{name}": 0.0}) for name in lacking(situation, air=False)
    )


def _explain(values: Values) -> str:
    ((key, (value, std)),) = values.items()
    return f"The error follows a regressor that the model does not have: the term {key[5:]}, {rounded(value, std)}."


MISSING_TERM = Cause(name="missing_term", candidates=_candidates, explain=_explain, suspect="term")
