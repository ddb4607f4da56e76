"""The term library and the built-in model structures, each a list of terms.

A term is one row of the regressor matrix: an equation (u, v or r), a parameter name and an expression over
`u v r` (through water; r has no relative counterpart), `u_q v_q` (through air), `h` and the actuator signals. `h` is
draught over water depth: 0 in deep water, and wherever no depth is known.
Every structure is a second-order modulus model: linear in its parameters.

Source: F. Ljungberg, doctoral thesis, Linköping University, Definition 3.3, (3.58)-(3.65) and (9.1).
"""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.errors import InputError, UnknownName

SHOAL = "h"
"""Draught over water depth."""
MOTION_SIGNALS = ("u", "v", "r", "u_q", "v_q", SHOAL)
FORCE_SIGNALS = ("tau_x", "tau_y", "tau_psi")


@dataclass(frozen=True)
class Term:
    """One parameter and its regressor."""

    equation: str  # "u", "v" or "r"
    name: str  # parameter name, ASCII, e.g. "X_abs_u_u".
    expression: str  # the regressor, in the language of `expdesign.vessel.expressions`


TERMS = {
    term.name: term
    for term in (
        Term("u", "X_u", "u"),
        Term("u", "X_vr", "v*r"),
        Term("u", "X_abs_u_u", "abs(u)*u"),
        Term("u", "W_abs_u_u", "abs(u_q)*u_q"),
        Term("u", "X_mu", "tau_x"),
        Term("u", "X_kappa", "u*tau_x"),
        Term("v", "Y_v", "v"),
        Term("v", "Y_ur", "u*r"),
        Term("v", "Y_abs_v_v", "abs(v)*v"),
        Term("v", "Y_abs_v_r", "abs(v)*r"),
        Term("v", "W_abs_v_v", "abs(v_q)*v_q"),
        Term("v", "Y_mu", "tau_y"),
        Term("r", "N_r", "r"),
        Term("r", "N_uv", "u*v"),
        Term("r", "N_abs_v_v", "abs(v)*v"),
        Term("r", "N_abs_v_r", "abs(v)*r"),
        Term("r", "W_uv", "u_q*v_q"),
        Term("r", "N_mu", "tau_psi"),
    )
}


def _terms(*names: str) -> tuple[Term, ...]:
    return tuple(TERMS[name] for name in names)


STRUCTURES: dict[str, tuple[Term, ...]] = {
    "surge": _terms("X_u", "X_abs_u_u", "W_abs_u_u", "X_mu"),
    "manoeuvring-10": _terms("X_u", "X_abs_u_u", "X_vr", "X_mu", "Y_v", "Y_ur", "Y_mu", "N_r", "N_uv", "N_mu"),
    "manoeuvring-18": tuple(TERMS.values()),
}


def structure_terms(structure: str, custom: tuple[Term, ...] = ()) -> tuple[Term, ...]:
    """The terms of a named structure, or the given ones for ``custom``.

    Raises:
        UnknownName: no such structure.
        InputError: ``custom`` without terms, or terms beside a built-in structure.
    """
    if structure == "custom":
        if not custom:
            raise InputError("structure 'custom' needs [[model.terms]]")
        return custom
    if structure not in STRUCTURES:
        raise UnknownName("model structure", structure, known=(*STRUCTURES, "custom"))
    if custom:
        raise InputError(f"structure {structure!r} is built in and takes no [[model.terms]]; use structure = 'custom'")
    return STRUCTURES[structure]
