"""Terms that may be added to a model, and its own terms of air drag and advance loss."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.diagnosis.model.terms import AIR_SIGNALS
from expdesign.vessel import NUMPY, TERMS, Term, VesselModel, stem
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
    Term("u", "X_uuu", "u*u*u"),
    Term("v", "Y_vvv", "v*v*v"),
    Term("r", "N_rrr", "r*r*r"),
)
"""Second-order modulus terms that manoeuvring models often have beside the built-in ones, and cubic damping.

Source: M. A. Abkowitz, Lectures on ship hydrodynamics (1964), for the cubic terms.
"""
ADVANCE_LOSS = ("X_kappa", "X_un", "X_unn")
"""Terms of the thrust loss with advance speed."""
AIR = ("W_abs_u_u", "W_abs_v_v", "W_uv")
"""Library terms of the air."""


def term_library(model: VesselModel) -> Mapping[str, Term]:
    """Every term that may be added to a model: those of its equations whose regressor it does not have."""
    rng = np.random.default_rng(0)
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    table = {name: rng.standard_normal(12) for name in names}
    own = [
        (term.equation, expression.evaluate(table, NUMPY))
        for term, expression in zip(model.terms, model.expressions, strict=True)
    ]
    found = {}
    for term in (*TERMS.values(), *MORE_TERMS, *_advance(model)):
        if term.name in model.names or term.equation not in model.outputs:
            continue
        if not _readable(term, model):
            continue
        values = parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
        if not any(term.equation == equation and _parallel(values, other) for equation, other in own):
            found[term.name] = term
    return found


def _advance(model: VesselModel) -> tuple[Term, ...]:
    """Advance loss of propellers that drive the model by their speeds, not through tau_x.

    Thrust rho n^2 D^4 K_T(J) with K_T linear in J = u / (n D) has a term in u |n|; if the wake slows with
    the thrust, it is u n |n|.

    Source: A. F. Molland, S. R. Turnock, D. A. Hudson, Ship Resistance and Propulsion (2011), ch. 12, for K_T(J).
    """
    read = {name for term, e in zip(model.terms, model.expressions, strict=True) if term.equation == "u"
            for name in e.signals}  # fmt: skip
    speeds = [name for name in model.inputs if stem(name) == "n" and name in read]
    if not speeds:
        return ()
    return (
        Term("u", "X_un", " + ".join(f"u*abs({name})" for name in speeds)),
        Term("u", "X_unn", " + ".join(f"u*abs({name})*{name}" for name in speeds)),
    )


def own_advance_terms(model: VesselModel) -> list[str]:
    """Names of the model's terms that are an advance loss."""
    rng = np.random.default_rng(0)
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    table = {name: rng.standard_normal(12) for name in names}
    losses = [
        parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
        for term in (TERMS["X_kappa"], *_advance(model))
    ]
    return [
        term.name
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if term.equation == "u" and any(_parallel(expression.evaluate(table, NUMPY), loss) for loss in losses)
    ]


def own_air_terms(model: VesselModel) -> list[str]:
    """Names of the model's terms that read the relative wind."""
    return [
        term.name
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if AIR_SIGNALS & set(expression.signals)
    ]


def _readable(term: Term, model: VesselModel) -> bool:
    """Whether the model is driven by the generalised forces that a term reads."""
    through_force = any(set(expression.signals) & set(FORCE_SIGNALS) for expression in model.expressions)
    return through_force or not any(name in term.expression for name in FORCE_SIGNALS)


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(abs(abs(a @ b) - np.linalg.norm(a) * np.linalg.norm(b)) < 1e-9 * np.linalg.norm(a) * np.linalg.norm(b))
