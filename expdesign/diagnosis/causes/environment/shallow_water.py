"""Shallow water: damping and inertia grow with draught over depth, in a diagnosis and in the terms of a model.

Found, the growth becomes a factor of the model's terms: a term ``u`` turns into ``(u)*(1 + 0.8*h)``, where the signal
`h` is draught over depth. Parameters keep their names and values, which are those of deep water, and planning goes on
as before. Inertia divides, which the language of terms cannot; its factor 1 / (1 + b h) is a polynomial of third order
that is exact in deep water and nearly so down to the least depth in the data. A dependence on depth that the model has
already counts as known: what is looked for is growth beyond it, and what is found multiplies it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import Extended, is_coriolis, is_damping
from expdesign.values import Array
from expdesign.vessel import Term, VesselModel
from expdesign.vessel.structures import SHOAL

LEAST_VARIATION = 0.01
DAMPING, INERTIA = "damping", "inertia"
ORDER = 3
WRITTEN = re.compile(rf"\((.+)\)\*\(1((?: \+ [-+.e\d]+(?:\*{SHOAL})+)+)\)")
POWER = re.compile(rf" \+ ([-+.e\d]+)((?:\*{SHOAL})+)")
"""A term times a factor as it is written here, and one power in that factor."""


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if not windows.has_depth or any(key.startswith("shallow:") for key in situation.ship.effects):
        return ()
    shoal = situation.ship.draught_m / windows.depth_m
    if np.ptp(shoal) < LEAST_VARIATION:
        return ()
    groups = (("damping",), ("inertia",), ("damping", "inertia"))
    return tuple(Candidate(cause="shallow_water", free={f"shallow:{n}": 0.0 for n in group}) for group in groups)


def _explain(values: Values, _ship: Extended) -> str:
    half = ", ".join(
        f"{key.split(':')[1]} is {rounded(50 * value, 50 * std)} % larger" for key, (value, std) in values.items()
    )
    return f"The ship moves otherwise where the water is shallow: where it is twice as deep as the draught, {half}."


SHALLOW_WATER = Cause(name="shallow_water", candidates=_candidates, explain=_explain)


def in_shallow_water(
    model: VesselModel, growth: Mapping[str, float], *, reach: float, known: VesselModel
) -> tuple[VesselModel, float]:
    """The model with more dependence on depth, and the largest relative error of the factors that say it.

    Args:
        model: with the terms that were found.
        growth: "damping" and "inertia" per unit of draught over depth; what is left out is zero.
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
