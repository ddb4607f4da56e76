"""Steps of a fit: along what parameters amount to with all their factors, within the bounds of what can be."""

from __future__ import annotations

from collections.abc import Sequence

from expdesign.diagnosis.model import Extended, scales
from expdesign.values import Array

LITTLE = 1e-6


def moved(ship: Extended, keys: Sequence[str], move: Array) -> dict[str, float]:
    """Effects after a step of Gauss-Newton.

    A gain and uncertain parameters of thrust that make up for it lie in a narrow valley that bends, for only their
    product shows. So the products make the straight step, the gain makes its own, and the parameters follow from both.
    """
    change = dict(zip(keys, move.tolist(), strict=True))
    after = limited(ship, {key: ship.get(key) + step for key, step in change.items()})
    factors = [key for key in keys if key.split(":")[0] in ("gain", "inertia")]
    if not factors:
        return after
    nudged = {key: ship.get(key) + LITTLE * change[key] for key in factors}
    old, near, new = (scales(ship.model, {**ship.effects, **effects}) for effects in ({}, nudged, after))
    for name, value in zip(ship.model.names, ship.model.parameters.tolist(), strict=True):
        key = f"theta:{name}"
        if key in change:
            whole, slope = value + ship.get(key), (near[name] - old[name]) / LITTLE
            after[key] = (whole * (old[name] + slope) + old[name] * change[key]) / new[name] - value
    return after


def limited(ship: Extended, effects: dict[str, float]) -> dict[str, float]:
    """Times and widths stay positive and change threefold at most; factors of inertia, thrust, gyro stay above 0.2."""
    result = {}
    for key, value in effects.items():
        kind = key.split(":")[0]
        if kind in ("lag", "delay", "deadband") or key in ("roll:period", "roll:damping"):
            before = ship.get(key)
            value = min(max(value, before / 3, 1e-6), before * 3 + 1e-6)
        elif kind in ("inertia", "gain", "gyro"):
            value = max(value, -0.8)
        result[key] = value
    return result
