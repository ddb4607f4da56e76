"""How fast a vessel can change its speed at most, and what that loses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.simulation import Environment
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, Vessel

BANDS = 16
"""Bands of speed with a largest acceleration each."""
STATES = 1500
"""Motions and commands drawn in each band."""
CLIMBS, BEST = 6, 60
"""Rounds in which the best of them are varied, and how many are."""
SPARE = 1.1
"""What the search may have missed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedChanges:
    """Largest rates of change of speed.

    Attributes:
        edges_mps: (k + 1,) speeds between bands, from 0 to that of the fastest leg.
        faster_mps2, slower_mps2: (k,) largest rates, both positive.
    """

    edges_mps: Array
    faster_mps2: Array
    slower_mps2: Array

    def __post_init__(self) -> None:
        seal(self, edges_mps="e", faster_mps2="k", slower_mps2="k")

    def least_s(self, first_mps: Array, last_mps: Array) -> Array:
        """(...,) least time of changes of speed [s]."""
        return self._change(first_mps, last_mps, np.diff(self.edges_mps))

    def lost_m(self, first_mps: Array, last_mps: Array) -> Array:
        """(...,) distance lost in them against the fastest leg [m]; no leg between these speeds loses less.

        Speeds on the way from one to the other are passed through, each for as long as its band takes at least.
        """
        short = self.edges_mps[-1] - (self.edges_mps[1:] + self.edges_mps[:-1]) / 2
        return self._change(first_mps, last_mps, np.diff(self.edges_mps) * short)

    def _change(self, first_mps: Array, last_mps: Array, worth: Array) -> Array:
        """Integral over the speeds passed of a quantity that amounts to `worth` (k,) in each band at unit rate."""
        passed = [np.r_[0.0, np.cumsum(worth / rate)] for rate in (self.faster_mps2, self.slower_mps2)]
        up, down = (
            np.interp(last_mps, self.edges_mps, sums) - np.interp(first_mps, self.edges_mps, sums) for sums in passed
        )
        return np.asarray(np.where(np.asarray(last_mps) >= first_mps, up, -down))


def speed_changes(vessel: Vessel, environment: Environment, *, speed_mps: float, yaw_rate_radps: float) -> SpeedChanges:
    """The fastest changes of speed through water found among motions and commands, a tenth added.

    They are looked for by drawing them, half of the commands at a limit, and by varying the best.

    Args:
        vessel, environment: who, in what air.
        speed_mps: of the fastest leg.
        yaw_rate_radps: no turn is faster.
    """
    edges = np.linspace(0.0, speed_mps, BANDS + 1)
    found = [_most(vessel, environment, edges, yaw_rate_radps, sign) for sign in (1.0, -1.0)]
    least = 1e-3 * max(rate.max() for rate in found)  # a band that nothing passes through costs much, but not all
    faster, slower = (SPARE * np.maximum(rate, least) for rate in found)
    return SpeedChanges(edges_mps=edges, faster_mps2=faster, slower_mps2=slower)


def _most(vessel: Vessel, environment: Environment, edges: Array, yaw_rate_radps: float, sign: float) -> Array:
    """(k,) largest rate of change of speed found in each band, faster or slower."""
    rng = np.random.default_rng(0)
    limits = [(x.low, x.high) if np.isfinite(x.high - x.low) else (-np.pi, np.pi) for x in vessel.limits]
    wind = float(np.hypot(*(environment.wind_to - environment.current_to)))
    size, bands = 4 + len(limits), len(edges) - 1
    shares = rng.uniform(-0.5, 1.5, (STATES, bands, size))
    shares[..., :4] = (shares[..., :4] + 0.5) / 2
    shares = shares.clip(0.0, 1.0)
    for spread in 0.3 * 0.5 ** np.arange(CLIMBS):
        rates = sign * _rates(vessel, shares, edges, np.array(limits), wind, yaw_rate_radps)
        best = np.take_along_axis(shares, np.argsort(-rates, axis=0)[:BEST, :, None], axis=0)
        varied = np.repeat(best, STATES // BEST, axis=0)
        shares = np.concatenate([best, varied + spread * rng.standard_normal(varied.shape)]).clip(0.0, 1.0)
    return np.asarray((sign * _rates(vessel, shares, edges, np.array(limits), wind, yaw_rate_radps)).max(axis=0))


def _rates(vessel: Vessel, shares: Array, edges: Array, limits: Array, wind_mps: float, yaw_rate_radps: float) -> Array:
    """(n, k) rates of change of speed through water, for speed, drift, wind, yaw rate and commands as shares."""
    speed = edges[:-1] + shares[..., 0] * np.diff(edges)
    drift, wind_from = 2 * np.pi * shares[..., 1], 2 * np.pi * shares[..., 2]
    r = yaw_rate_radps * (2 * shares[..., 3] - 1)
    inputs = tuple(np.moveaxis(limits[:, 0] + shares[..., 4:] * (limits[:, 1] - limits[:, 0]), -1, 0))
    u, v = speed * np.cos(drift), speed * np.sin(drift)
    air = (u - wind_mps * np.cos(wind_from), v - wind_mps * np.sin(wind_from))
    surge, sway, _ = vessel.model.accelerations((u, v, r), air, inputs, NUMPY)
    return np.asarray(surge * np.cos(drift) + sway * np.sin(drift))
