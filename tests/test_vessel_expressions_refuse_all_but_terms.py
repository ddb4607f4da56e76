"""The language of model terms computes what it says and refuses everything else in one line."""

import math

import numpy as np
import pytest

from design_case import one_line
from expdesign.errors import InputError
from expdesign.vessel import NUMPY, SCALAR
from expdesign.vessel.structures import parse_expression

SIGNALS = ("u", "v", "r", "n1", "rudder1")
VALUES = {"u": 1.5, "v": -0.25, "r": 0.125, "n1": -3.0, "rudder1": 0.3}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("u*abs(v)", 1.5 * 0.25),
        ("abs(n1)*n1*sin(rudder1)", -9.0 * math.sin(0.3)),
        ("-u*-v + 2", 1.5 * -0.25 + 2),
        ("u - v - r", 1.5 + 0.25 - 0.125),
        ("u - (v - r)", 1.5 + 0.25 + 0.125),
        ("cos(rudder1 - 2.5e-1)", math.cos(0.3 - 0.25)),
        ("u*abs(u)*sin(rudder1)", 2.25 * math.sin(0.3)),
        ("abs(u - abs(v))", 1.25),
        ("1", 1.0),
        (" u ", 1.5),
    ],
)
def test_expressions_mean_what_arithmetic_says(text: str, value: float):
    expression = parse_expression(text, signals=SIGNALS)
    assert expression.evaluate(VALUES, SCALAR) == pytest.approx(value, rel=1e-15)
    arrays = {name: np.full(3, number) for name, number in VALUES.items()}
    np.testing.assert_allclose(expression.evaluate(arrays, NUMPY), value, rtol=1e-15)
    assert expression.text == text


def test_expressions_know_what_they_read_and_what_their_moduli_hold():
    expression = parse_expression("n1*abs(u - abs(v))*sin(rudder1)", signals=SIGNALS)
    assert expression.signals == ("n1", "rudder1", "u", "v")
    assert [(m.text, m.signals) for m in expression.moduli] == [("v", ("v",)), ("u - abs(v)", ("u", "v"))]
    assert [m.evaluate(VALUES, SCALAR) for m in expression.moduli] == [-0.25, 1.25]


REFUSED = {
    "call": ["sqrt(u)", "__import__('os')", "eval('u')", "abs(u, v)", "abs()", "abs(x=u)", "abs(*u)", "abs(u)(v)"],
    "attribute": ["u.real", "(u).__class__", "abs.real(u)"],
    "power and division": ["u**2", "u/v", "u//v", "u%v", "u@v", "u<<2"],
    "comparison and choice": ["u<v", "u==v", "u if v else r", "u and v", "not u"],
    "name": ["x", "abs", "U", "tau_x", "u1", "None"],
    "number": ["1e999", "-1e999", "1" + "0" * 400, "1" + "0" * 5000, "5" + "0" * 308, "1j", "True", "nan", "inf"],
    "other syntax": ["", " ", "u +", "u v", "u, v", "[u]", "{u}", "u[0]", "lambda: u", "u := v", "u = v", "+u", "1(2)",
                     "*u", "~u", "f'{u}'", "'u'", "...", "u\x00", "u; v", "import os", "1and u", "(yield u)",
                     "[u for u in v]", "await u", "\\", "\ud800"],
    "nesting": ["(" * 300 + "u" + ")" * 300, "-" * 60 + "u", "-" * 3000 + "u", "+".join(["u"] * 60),
                "+".join(["u"] * 3000), "abs(" * 60 + "u" + ")" * 60, "(lambda:" * 90 + "u" + ")" * 90],
}  # fmt: skip


@pytest.mark.parametrize(("kind", "text"), [(kind, text) for kind, texts in REFUSED.items() for text in texts])
def test_everything_else_is_refused_in_one_line(kind: str, text: str):
    with pytest.raises(InputError) as caught:
        parse_expression(text, signals=SIGNALS)
    assert one_line(caught.value)
    assert "expression" in str(caught.value)


def test_a_mistyped_signal_is_answered_with_the_nearest():
    with pytest.raises(InputError, match="'ruder1', did you mean 'rudder1'"):
        parse_expression("u*sin(ruder1)", signals=SIGNALS)
