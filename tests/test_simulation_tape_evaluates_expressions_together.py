"""Expressions evaluated at once have the values that they have alone."""

import numpy as np
import pytest

from expdesign.simulation.program import evaluation
from expdesign.vessel import NUMPY
from expdesign.vessel.structures import parse_expression

SIGNALS = ("u", "v", "r", "n1", "a1")
TEXTS = ("u*abs(u)", "v*r - 2*u", "abs(n1)*n1*cos(a1)", "abs(n1)*n1*sin(a1)", "-u*abs(u)*v", "1 - 3", "u", "1*v + 0")


def test_together_they_are_what_they_are_alone():
    rng = np.random.default_rng(0)
    signals = {name: rng.normal(size=(3, 4)) for name in SIGNALS}
    expressions = [parse_expression(text, signals=SIGNALS) for text in TEXTS]
    found = evaluation(expressions).values(signals)
    for value, expression in zip(found, expressions, strict=True):
        np.testing.assert_array_equal(value, expression.evaluate(signals, NUMPY))


@pytest.mark.parametrize("texts", [("abs(n1)*n1*cos(a1)", "abs(n1)*n1*sin(a1)"), ("u*v", "v*u")])
def test_what_they_share_is_computed_once(texts):
    alone, other = (evaluation([parse_expression(text, signals=SIGNALS)]).operations for text in texts)
    together = evaluation([parse_expression(text, signals=SIGNALS) for text in texts]).operations
    assert len(together) < len(alone) + len(other)
