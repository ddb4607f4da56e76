"""Shallow water: damping and inertia grow with draught over depth, in a diagnosis and in the terms of a model.

Found, the growth becomes a factor of the model's terms: a term ``u`` turns into ``(u)*(1 + 0.8*h)``, where the signal
`h` is draught over depth. Parameters keep their names and values, which are those of deep water, and planning goes on
as before. Inertia divides, which the language of terms cannot; its factor 1 / (1 + b h) is a polynomial of third order
that is exact in deep water and nearly so down to the least depth in the data.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.parts import is_coriolis, is_damping
from expdesign.values import Array
from expdesign.vessel import Term, VesselModel
from expdesign.vessel.structures import SHOAL

LEAST_VARIATION = 0.01
DAMPING, INERTIA = "damping_growth", "inertia_growth"
"""Names of the estimates in results."""
ORDER = 3
WRITTEN = re.compile(rf"\((.+)\)\*\(1(?: \+ [-+.e\d]+(?:\*{SHOAL})+)+\)")
"""A term times a factor as it is written here."""


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if not windows.has_depth or any(key.startswith("shallow:") for key in situation.ship.effects):
        return ()
    shoal = situation.ship.draught_m / windows.depth_m
    if np.ptp(shoal) < LEAST_VARIATION:
        return ()
    groups = (("damping",), ("inertia",), ("damping", "inertia"))
    return tuple(Candidate(cause="shallow_water", free={f"shallow:{n}": 0.0 for n in group}) for group in groups)


def _explain(values: Values) -> str:
    half = ", ".join(
        f"{key.split(':')[1]} is {rounded(50 * value, 50 * std)} % larger" for key, (value, std) in values.items()
    )
    return f"The ship moves otherwise where the water is shallow: where it is twice as deep as the draught, {half}."


SHALLOW_WATER = Cause(name="shallow_water", candidates=_candidates, explain=_explain, suspect="depth")


def in_shallow_water(
    model: VesselModel, growth: Mapping[str, float], *, reach: float, known: VesselModel
) -> tuple[VesselModel, float]:
    """The model with its dependence on depth, and the largest relative error of the factors that say it.

    Args:
        model: for deep water.
        growth: "damping_growth" and "inertia_growth" per unit of draught over depth; what is left out is zero.
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


def in_deep_water(model: VesselModel) -> VesselModel:
    """The model with draught over depth zero in all its terms; factors as written here disappear from them."""
    terms = tuple(replace(term, expression=_deep(term.expression)) for term in model.terms)
    return replace(model, terms=terms)


def _deep(expression: str) -> str:
    written = WRITTEN.fullmatch(expression)
    return written.group(1) if written else re.sub(rf"\b{SHOAL}\b", "0", expression)


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
    """The term times a polynomial of draught over depth."""
    powers = [
        "*".join([f"{value:.9g}", *([SHOAL] * order)]) for order, value in enumerate(factor.coef.tolist()) if value
    ]
    text = term.expression if len(powers) == 1 else f"({term.expression})*({' + '.join(powers)})"
    return replace(term, expression=text)
