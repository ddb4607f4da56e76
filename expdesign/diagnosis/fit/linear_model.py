"""The joint linear model of a fit: how effects, a random current and initial states change the simulated channels.

Rows are errors, columns are sensitivities. Initial states have a flat prior, uncertain parameters their Gaussian prior,
and the random current is a random effect with piecewise linear basis functions of time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.data import linear_basis
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import (
    Disturbance,
    LinearisedMotion,
    channels_apart,
    disturbance_of,
    responses,
    start_responses,
    term_disturbances,
)
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivities:
    """Derivatives of the simulated channels, before whitening.

    Attributes:
        values: (c, w, s, 4) by the estimated effects, then by the random current at its knots, north before east.
        starts: (3, w, s, 4) by the initial velocities of every window.
        error: (w, s, 4) measured less simulated.
        numbers: how many of `values` are by estimated effects.
        spacing_s: time between knots of the random current [s].
    """

    values: Array
    starts: Array
    error: Array
    numbers: int
    spacing_s: float

    @property
    def knot_count(self) -> int:
        """Knots of the random current in a window; 0 without one."""
        return (len(self.values) - self.numbers) // 2

    def selected(self, keep: NDArray[np.bool_]) -> Sensitivities:
        """Only some of the windows, by a mask (w,)."""
        return replace(self, values=self.values[:, keep], starts=self.starts[:, keep], error=self.error[keep])

    @property
    def unbounded(self) -> bool:
        """The linearised motion has diverged."""
        sizes = (float(np.abs(item).max(initial=0.0)) for item in (self.values, self.starts))
        return not all(size < TUNING.largest_sensitivity for size in sizes)


def build_sensitivities(
    linear: LinearisedMotion, disturbances: list[Disturbance], *, random_current: bool
) -> Sensitivities:
    """Sensitivities to disturbances, to the initial states and perhaps to a random current."""
    motion = linear.motion
    spacing = max(TUNING.knot_spacing_s, motion.windows.steps * motion.windows.step_s / TUNING.most_knots)
    extra: list[Disturbance] = []
    if random_current:
        basis = linear_basis(motion.windows.steps - 1, motion.windows.step_s, spacing)
        for key in ("current:north", "current:east"):
            force = disturbance_of(linear, motion.ship.with_effects({key: motion.ship.get(key) + 1e-3}), 1e-3).force
            extra += [Disturbance(force=None if force is None else force * row[:, None], sensor=None) for row in basis]
    return Sensitivities(
        values=responses(linear, [*disturbances, *extra]),
        starts=start_responses(linear.motion, linear.transition),
        error=motion.error,
        numbers=len(disturbances),
        spacing_s=spacing,
    )


def in_groups(linear: LinearisedMotion, count: int) -> Iterator[tuple[NDArray[np.bool_], LinearisedMotion]]:
    """The same motion a few windows at a time, so that sensitivities to `count` disturbances take little memory.

    Beside each group its windows, as a mask (w,).
    """
    windows, samples = linear.motion.predicted.shape[:2]
    columns = count + 2 * TUNING.most_knots
    each = columns * (4 * samples + columns)  # sensitivities and their inner products
    groups = min(windows, -(-windows * each // TUNING.sensitivities_at_once))
    if groups < 2:
        yield np.ones(windows, dtype=bool), linear
        return
    group = np.arange(windows) * groups // windows
    for number in range(groups):
        yield group == number, linear.selected(group == number)


def effect_disturbances(linear: LinearisedMotion, keys: Sequence[str]) -> list[Disturbance]:
    """Disturbances per unit of each effect: regressors of those that act linearly, finite differences by others."""
    exact = term_disturbances(linear, keys)
    return [exact[key] if key in exact else _by_difference(linear, key) for key in keys]


def _by_difference(linear: LinearisedMotion, key: str) -> Disturbance:
    ship = linear.motion.ship
    step = difference_step(ship, key)
    return disturbance_of(linear, ship.with_effects({key: ship.get(key) + step}), step)


def sensitivities_to(linear: LinearisedMotion, keys: Sequence[str]) -> Sensitivities:
    """Sensitivities to effects, with a random current where a heading is measured and noise is not white."""
    disturbances, windows = effect_disturbances(linear, keys), linear.motion.windows
    return build_sensitivities(linear, disturbances, random_current=windows.has_heading and not windows.white_noise)


def sensitivities_beside(
    linear: LinearisedMotion, keys: Sequence[str], known: Mapping[str, Array], same: Sensitivities
) -> Sensitivities:
    """The same, of which some are known along this motion.

    Args:
        linear: the motion.
        keys: effects.
        known: effect -> (w, s, 4) response.
        same: sensitivities along the same motion: of the random current and of initial states.
    """
    new = [key for key in keys if key not in known]
    more = build_sensitivities(linear, effect_disturbances(linear, new), random_current=False)
    of_effects = {**known, **dict(zip(new, more.values, strict=True))}
    rows = [of_effects[key] for key in keys]
    values = channels_apart(len(rows) + 2 * same.knot_count, more.error.shape[:2])
    for place, row in enumerate((*rows, *same.values[same.numbers :])):
        values[place] = row
    return replace(same, values=values, error=more.error, numbers=len(keys))


def difference_step(ship: ExtendedModel, key: str) -> float:
    """A step for finite differences: small, but large enough that thresholds and times change something."""
    value = abs(ship.get(key))
    kind = key.split(":")[0]
    if kind in ("theta", "term"):
        return 1e-4 * max(1e-4, _parameter_scale(ship, key))
    if kind in ("lag", "delay", "slew", "deadband"):
        return max(0.05 * value, 1e-6)
    if kind == "roll":
        return max(1e-3 * value, 1e-6)
    return 1e-6 if kind == "asymmetry" else 1e-4


def _parameter_scale(ship: ExtendedModel, key: str) -> float:
    name = key.split(":")[1]
    if name in ship.model.names:
        return abs(float(ship.model.parameters[ship.model.names.index(name)])) + 1e-6
    return 1e-2
