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

    # sigma_U and sigma_r [unit of throttle, unit of rudder], m_U and m_r [unit of throttle per m/s2, unit of rudder per
    # rad/s2]; None, both of a state, where too few steps of its command count
    damping: tuple[Surface | None, Surface | None]
    inertia: tuple[Surface | None, Surface | None]
    delay_s: tuple[float, float]  # dead times of throttle and rudder [s]
    region: ValidityRegion  # where the model holds; outside, surfaces keep their value at its edge and damping grows

    def rates(self, state: Array, commands: Array) -> Array:
        """(2,) dU/dt [m/s2] and dr/dt [rad/s2] at a state (2,) under delayed commands (2,).

        Outside the region the state is drawn to its edge with the time constant m / k there, so that nothing runs away.
        """
        inside = self.region.nearest(state)
        u, r = inside.tolist()
        beyond = state - inside
        found = np.zeros(2)
        for channel, damping, inertia in self.halves:
            slope = (damping.most - damping.least) / self.region.scale[channel]
            mass = min(max(inertia.at(u, r), LEAST_INERTIA_SHARE * inertia.least), inertia.most)
            found[channel] = (commands[channel] - damping.at(u, r) - slope * beyond[channel]) / mass
        return found

    @property
    def halves(self) -> list[tuple[int, Surface, Surface]]:
        """Place, damping and inertia of each state that the trial gives."""
        pairs = zip(self.damping, self.inertia, strict=True)
        return [
            (place, one, other) for place, (one, other) in enumerate(pairs) if one is not None and other is not None
        ]

    @property
    def quickest_s(self) -> float:
        """A short time constant of the model [s]."""
        return min(
            float(inertia.least * self.region.scale[place] / max(damping.most - damping.least, 1e-12))
            for place, damping, inertia in self.halves
        )

    def simulated(self, measured: Array, commands: Array, *, sample_time_s: float) -> Array:
        """(k, 2) U and r at every sample, under commands (k, 2) as given, held between samples.

        They begin as measured, (k, 2) or the first (2,); a state that is no half of the model stays as measured.
        """
        measured = np.broadcast_to(measured, (len(commands), 2))
        outside = [place for place in range(2) if place not in {one for one, *_ in self.halves}]
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
        states[0] = state = np.asarray(measured[0], float)
        for k, given in enumerate(acting[:-1]):
            for _ in range(parts):
                state = self._step(state, given, sample_time_s / parts)
            if outside:
                state[outside] = measured[k + 1, outside]
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
