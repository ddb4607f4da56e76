"""Steps of a fit: linear in the products of parameters and factors, and within physical bounds."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.model import ExtendedModel, term_factors
from expdesign.values import Array

LITTLE = 1e-6
"""Share of a step from which slopes of factors are taken."""


def after_step(ship: ExtendedModel, keys: Sequence[str], step: Array) -> dict[str, float]:
    """Effects after a Gauss-Newton step.

    Data determine only the product of a gain and the uncertain thrust parameters, so the cost has a narrow curved
    valley. The products and the gain therefore take linear steps, and the parameters follow from both.
    """
    change = dict(zip(keys, step.tolist(), strict=True))
    after = within_bounds(ship, {key: ship.get(key) + size for key, size in change.items()})
    factors = [key for key in keys if key.split(":")[0] in ("gain", "inertia")]
    if not factors:
        return after
    nudged = {key: ship.get(key) + LITTLE * change[key] for key in factors}
    old, close, new = (term_factors(ship.model, {**ship.effects, **effects}) for effects in ({}, nudged, after))
    for name, value in zip(ship.model.names, ship.model.parameters.tolist(), strict=True):
        key = f"theta:{name}"
        if key in change:
            whole, slope = value + ship.get(key), (close[name] - old[name]) / LITTLE
            after[key] = (whole * (old[name] + slope) + old[name] * change[key]) / new[name] - value
    return after


def within_bounds(ship: ExtendedModel, effects: dict[str, float]) -> dict[str, float]:
    """Times and widths stay positive and change by a limited ratio, but lags and dead times may vanish at once."""
    result = {}
    for key, value in effects.items():
        kind = key.split(":")[0]
        if kind in ("lag", "delay", "deadband") or key in ("roll:period", "roll:damping"):
            before, ratio = ship.get(key), TUNING.largest_ratio
            least = 0.0 if kind in ("lag", "delay") else before / ratio
            value = min(max(value, least, 1e-6), max(before, 1e-3) * ratio)
        elif kind in ("inertia", "gain", "gyro", "scale"):
            value = max(value, TUNING.smallest_factor_change)
        result[key] = value
    return result
