"""Terms that may be missing in a model beyond the library: products, moduli and cubes of motion and inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.diagnosis.model import is_thrust
from expdesign.values import Array
from expdesign.vessel import NUMPY, Term, VesselModel
from expdesign.vessel.expressions import parse_expression
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS

LETTERS = {"u": "X", "v": "Y", "r": "N"}
AHEAD = ("u*u", "u*u*u", "v*v", "r*r", "v*r", "u*v*v", "u*r*r", "u*v*r", "v*v*abs(v)", "r*r*abs(r)")
ASIDE = (
    "v", "r", "u*v", "u*r", "v*abs(v)", "r*abs(r)", "abs(v)*r", "v*abs(r)", "v*v*v", "r*r*r", "v*v*r", "v*r*r",
    "u*u*v", "u*u*r", "u*v*abs(v)", "u*r*abs(r)",
)  # fmt: skip
"""Products of motion that keep their sign when port and starboard are exchanged, and those that change it."""
FACTORS = ("u", "abs(v)", "abs(r)", "u*u", "v*v", "r*r")
"""What may change the effect of an input."""
SAME = 1e-9


def term_dictionary(model: VesselModel, known: Mapping[str, Term]) -> dict[str, Term]:
    """Terms that the model does not have and `known` ones do not name, by name."""
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *model.inputs)))
    rng = np.random.default_rng(0)
    table = {name: rng.standard_normal(24) for name in names}

    def values(text: str) -> Array:
        column = np.asarray(parse_expression(text, signals=names).evaluate(table, NUMPY))
        return np.asarray(column / np.linalg.norm(column))

    taken = [(term.equation, values(term.expression)) for term in (*model.terms, *known.values())]
    found: dict[str, Term] = {}
    for equation in model.outputs:
        for text in (*(AHEAD if equation == "u" else ASIDE), *_of_inputs(model, equation)):
            column = values(text)
            if any(equation == other and abs(abs(column @ old) - 1.0) < SAME for other, old in taken):
                continue
            taken.append((equation, column))
            name = f"{LETTERS[equation]}_more_{len(found) + 1}"
            found[name] = Term(equation, name, text)
    return found


def _of_inputs(model: VesselModel, equation: str) -> list[str]:
    """The model's own terms of inputs with more factors."""
    own = [
        term.expression
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if term.equation == equation and is_thrust(expression, model)
    ]
    return [f"({text})*{factor}" for text in own for factor in (*FACTORS, f"abs({text})")]
