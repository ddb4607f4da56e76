"""How long a level must be held: until drawn vessels are steady, and then for a circle.

A full circle at steady state averages the current out of mean speed and yaw rate. Where one takes too long, half of one
is turned, and where that takes too long as well, or the course is straight, the level is held for a given time.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.spec import Setting
from expdesign.errors import InputError
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel

SETTLED = 4.0
"""Time constants until a vessel counts as steady: 2 % of the step are left."""
DRAWN = 400
"""Vessels of the prior; the share that a level is long enough for is met to 2 %."""
NUDGE = 1e-4

HOLD_SETTINGS = (
    Setting(
        name="circle_s",
        meaning="most time for the circle, or else the half turn, that each level ends with",
        default=60.0,
        low=0.0,
        high=1e4,
    ),
    Setting(
        name="steady_s",
        meaning="steady time that each level ends with where a half turn takes longer than circle_s",
        default=10.0,
        low=0.0,
        high=1e4,
    ),
    Setting(
        name="sure",
        meaning="share of the vessels drawn from the prior for which each level is long enough",
        default=0.8,
        low=0.5,
        high=0.999,
    ),
)


def hold_times(vessel: Vessel, motions: Array, inputs: Array, settings: Mapping[str, float]) -> Array:
    """(n,) times [s] that levels are held, long enough for a share `sure` of the prior's vessels.

    Args:
        vessel: nominal, with its prior.
        motions: (n, 3) nominal steady u, v, r.
        inputs: (n, m) commands of the levels.
        settings: those of `HOLD_SETTINGS`.

    Raises:
        InputError: too few vessels of the prior become steady at a level.
    """
    drawn = vessel.model.drawn_parameters(DRAWN, np.random.default_rng(0))
    late_s = max(response.delay_s + SETTLED * response.lag_s for response in vessel.responses)
    times_s = np.empty(len(motions))
    for place, (motion, given) in enumerate(zip(motions, inputs, strict=True)):
        slopes, step = _linearised(vessel, drawn, motion, given)
        slowest = -np.linalg.eigvals(slopes).real.max(axis=1)
        settling_s = np.where(slowest > 0, SETTLED / np.where(slowest > 0, slowest, 1.0), np.inf)
        looking_s = _looking_times(np.abs(motion[2] + step), settings) if motion[2] else settings["steady_s"]
        times_s[place] = np.quantile(settling_s + looking_s, settings["sure"], method="higher") + late_s
    if not np.isfinite(times_s).all():
        speed = motions[~np.isfinite(times_s)][0, 0]
        raise InputError(
            f"fewer than {settings['sure']:.0%} of the vessels drawn from model.parameter_std become steady at "
            f"{speed:.3g} m/s, expected a duration_s, a smaller sure, or model.parameter_min and parameter_max"
        )
    return times_s


def _looking_times(rate: Array, settings: Mapping[str, float]) -> Array:
    """(n,) times [s] of a circle, or a half, or the given one, at yaw rates (n,)."""
    circle_s = 2.0 * np.pi / np.maximum(rate, 1e-9)
    half_s, most_s = circle_s / 2.0, settings["circle_s"]
    return np.where(circle_s <= most_s, circle_s, np.where(half_s <= most_s, half_s, settings["steady_s"]))


def _linearised(vessel: Vessel, drawn: Array, motion: Array, inputs: Array) -> tuple[Array, Array]:
    """(n, d, d) slopes of the drawn vessels' accelerations at a motion, and (n,) their steady yaw rates less its.

    The steady state follows from one Newton step. d are the velocities that the model has equations for.
    """
    has = ["uvr".index(name) for name in vessel.model.outputs]

    def rates(at: Array) -> Array:
        parts = vessel.model.accelerations(at, at[:2], inputs, NUMPY, parameters=drawn.T)
        return np.stack(np.broadcast_arrays(*parts, drawn[:, 0])[:3], axis=-1)[:, has]

    nudges = NUDGE * np.eye(3)[has]
    slopes = np.stack([(rates(motion + nudge) - rates(motion - nudge)) / (2 * NUDGE) for nudge in nudges], axis=-1)
    step = -np.einsum("nij,nj->ni", np.linalg.pinv(slopes), rates(motion))
    return slopes, step[:, has.index(2)] if 2 in has else np.zeros(len(drawn))
