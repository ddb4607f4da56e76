"""The control-oriented model with two degrees of freedom, and its simulation.

    m_U(x) dU/dt + sigma_U(x) = throttle(t - d_1)
    m_r(x) dr/dt + sigma_r(x) = rudder(t - d_2),     x = (U, r)

Source: Eriksen and Breivik (2017), with a dead time for each command.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.step_trials.surfaces import Surface, ValidityRegion
from expdesign.values import Array

LEAST_INERTIA_SHARE = 0.5  # of the smallest measured inertia, below which a surface is cut off
SUBSTEP_SHARE = 0.2  # of the shortest time constant, one step of the simulated model


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoDofModel:
    """Damping and inertia of speed and yaw rate."""

    damping: tuple[Surface, Surface]  # sigma_U and sigma_r [unit of throttle, unit of rudder]
    inertia: tuple[Surface, Surface]  # m_U and m_r [unit of throttle per m/s2, unit of rudder per rad/s2]
    delay_s: tuple[float, float]  # dead times of throttle and rudder [s]
    region: ValidityRegion  # where the model holds; outside, surfaces keep their value at its edge and damping grows

    def rates(self, state: Array, commands: Array) -> Array:
        """(2,) dU/dt [m/s2] and dr/dt [rad/s2] at a state (2,) under delayed commands (2,).

        Outside the region the state is drawn to its edge with the time constant m / k there, so that nothing runs away.
        """
        inside = self.region.nearest(state)
        u, r = inside.tolist()
        mass = np.array([self._mass(channel, u, r) for channel in range(2)])
        sigma = np.array([surface.at(u, r) for surface in self.damping])
        beyond = state - inside
        slope = np.array([surface.most - surface.least for surface in self.damping]) / self.region.scale
        return np.asarray((commands - sigma - slope * beyond) / mass)

    def _mass(self, channel: int, u: float, r: float) -> float:
        surface = self.inertia[channel]
        return min(max(surface.at(u, r), LEAST_INERTIA_SHARE * surface.least), surface.most)

    @property
    def quickest_s(self) -> float:
        """A short time constant of the model [s]."""
        ranges = [surface.most - surface.least for surface in self.damping]
        return min(
            float(surface.least * scale / max(width, 1e-12))
            for surface, scale, width in zip(self.inertia, self.region.scale.tolist(), ranges, strict=True)
        )

    def simulated(self, start: Array, commands: Array, *, sample_time_s: float) -> Array:
        """(k, 2) U and r at every sample, from `start` (2,), under commands (k, 2) as given, held between samples."""
        delays = [round(delay / sample_time_s) for delay in self.delay_s]
        acting = np.stack(
            [
                np.concatenate([np.repeat(column[:1], d), column])[: len(column)]
                for column, d in zip(commands.T, delays, strict=True)
            ],
            axis=1,
        )
        parts = max(1, int(np.ceil(sample_time_s / max(SUBSTEP_SHARE * self.quickest_s, 1e-3))))
        states = np.empty((len(commands), 2))
        states[0] = state = np.asarray(start, float)
        for k, given in enumerate(acting[:-1]):
            for _ in range(parts):
                state = self._step(state, given, sample_time_s / parts)
            states[k + 1] = state
        return states

    def _step(self, state: Array, commands: Array, step_s: float) -> Array:
        """Heun's method; the speed stays at zero or above."""
        first = self.rates(state, commands)
        second = self.rates(state + step_s * first, commands)
        moved = state + step_s / 2 * (first + second)
        return np.array([max(moved[0], 0.0), moved[1]])


def fit_percent(measured: Array, simulated: Array) -> Array:
    """(2,) 100 (1 - |error| / |measured - mean|) of U and r, as `expdesign estimate` counts it."""
    error = np.linalg.norm(measured - simulated, axis=0)
    size = np.linalg.norm(measured - measured.mean(axis=0), axis=0)
    return np.asarray(100.0 * (1.0 - error / np.maximum(size, 1e-12)))
