"""Dependence on depth as factors of a model's terms.

The growth becomes a factor of the terms: a term ``u`` turns into ``(u)*(1 + 0.8*h)``, where the signal `h` is draught
over depth. Parameters keep their names and their values, which are those of deep water. Inertia divides, which the
language of terms cannot express. So its factor 1 / (1 + b h) is written as a polynomial of third order, exact in deep
water and nearly exact down to the least depth in the data. A dependence on depth that the model already has counts as
known, and the growth that is found multiplies it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from expdesign.diagnosis.model import is_coriolis, is_damping
from expdesign.values import Array
from expdesign.vessel import Term, VesselModel
from expdesign.vessel.structures import SHOAL

DAMPING, INERTIA = "damping", "inertia"
ORDER = 3
WRITTEN = re.compile(rf"\((.+)\)\*\(1((?: \+ [-+.e\d]+(?:\*{SHOAL})+)+)\)")
POWER = re.compile(rf" \+ ([-+.e\d]+)((?:\*{SHOAL})+)")
"""A term times a factor as it is written here, and one power in that factor."""


def in_shallow_water(
    model: VesselModel, growth: Mapping[str, float], *, reach: float, known: VesselModel
) -> tuple[VesselModel, float]:
    """The model with more dependence on depth, and the largest relative error of its factors.

    Args:
        model: with the terms that were found.
        growth: "damping" and "inertia" per unit of draught over depth; zero by default.
        reach: largest draught over depth in the data.
        known: the model diagnosed, without the terms that were found; only its own terms are damping that grows.
    """
    damping = Polynomial([1.0, growth.get(DAMPING, 0.0)])
    lighter, error = _inverse(growth.get(INERTIA, 0.0), reach)
    terms = []
    for term, expression in zip(model.terms, model.expressions, strict=True):
        grows = term.name in known.names and is_damping(term, expression, known)
        factor = lighter * damping if grows else lighter
        terms.append(term if is_coriolis(term) else _times(term, factor))
    return replace(model, terms=tuple(terms)), error


def _inverse(growth: float, reach: float) -> tuple[Polynomial, float]:
    """1 / (1 + growth h) for h from 0 to reach as a polynomial, exact at 0, and its largest relative error."""
    if growth == 0.0 or reach <= 0.0:
        return Polynomial([1.0]), 0.0

    def exact(h: Array) -> Array:
        return np.asarray(1.0 / (1.0 + growth * h))

    h = np.linspace(0.0, reach, 200)[1:]
    slopes = np.linalg.lstsq(h[:, None] ** np.arange(1, ORDER + 1), exact(h) - 1.0, rcond=None)[0]
    found = Polynomial([1.0, *slopes])
    return found, float(np.abs(found(h) / exact(h) - 1.0).max())


def _times(term: Term, factor: Polynomial) -> Term:
    """The term times a polynomial of draught over depth; a factor that it has already is multiplied."""
    plain, known = _taken_apart(term.expression)
    powers = [
        "*".join([f"{value:.9g}", *([SHOAL] * order)])
        for order, value in enumerate((known * factor).coef.tolist())
        if value
    ]
    text = plain if len(powers) == 1 else f"({plain})*({' + '.join(powers)})"
    return replace(term, expression=text)


def _taken_apart(expression: str) -> tuple[str, Polynomial]:
    """An expression without its factor as written here, and that factor; one where there is none."""
    written = WRITTEN.fullmatch(expression)
    if not written:
        return expression, Polynomial([1.0])
    powers = {len(match[2]) // (1 + len(SHOAL)): float(match[1]) for match in POWER.finditer(written[2])}
    return written[1], Polynomial([1.0, *(powers.get(order, 0.0) for order in range(1, max(powers) + 1))])
