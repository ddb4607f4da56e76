"""Inputs that keep an experiment condition: smoothed pulses, drawn stretch by stretch.

A drawn stretch is kept when the ship without noise, in the mean current and wind, stays faster than a margin ahead and
to starboard through it and through one more stretch, which then stands by as the next one. Where no draw fits, the
stretch before is given up and drawn anew. Only the condition decides; no estimate is ever looked at.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.77), (6.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from expdesign.errors import NoAnswer
from expdesign.simulation import simulate_ensemble
from expdesign.values import Array
from expdesign.vessel import Environment, Sensors, Vessel

STRETCH = 100  # samples drawn at once
DRAWS = 24  # stretches drawn and simulated side by side
MOST_ATTEMPTS = 2000
WINDOW = np.hanning(9)[1:-1] / np.hanning(9).sum()


@dataclass(frozen=True, kw_only=True)
class Pulses:
    """Two thrusters at a common speed and independent angles, moved by pulses of varying width.

    Attributes:
        speed_rps, angle_rad: what the pulses move about.
        speed_share: largest change of speed, as a share of it.
        angle_spread_rad: largest change of an angle.
        shortest, longest: width of a pulse [samples].
    """

    speed_rps: float = 10.0
    angle_rad: float = float(np.pi / 5)
    speed_share: float = 0.7
    angle_spread_rad: float = 0.35
    shortest: int = 5
    longest: int = 50

    def levels(self, samples: int, draws: int, rng: np.random.Generator) -> Array:
        """(k, draws, 3) pulses of speed and both angles between -1 and 1, before smoothing."""
        levels = rng.uniform(-1.0, 1.0, (draws, 3, samples))
        widths = rng.integers(self.shortest, self.longest, levels.shape)
        rows = [
            np.repeat(a, w)[:samples]
            for a, w in zip(levels.reshape(-1, samples), widths.reshape(-1, samples), strict=True)
        ]
        return np.asarray(np.stack(rows, axis=1).reshape(samples, draws, 3))

    def commands(self, levels: Array) -> Array:
        """(k, draws, 4) n1, a1, n2, a2 of smoothed levels (k, draws, 3)."""
        speed = self.speed_rps * (1.0 + self.speed_share * levels[..., 0])
        first, second = (self.angle_rad + self.angle_spread_rad * levels[..., i] for i in (1, 2))
        return np.stack([speed, first, speed, second], axis=-1)


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch kept.

    Attributes:
        levels: (k, 3) before smoothing.
        commands: (k, 4).
        after: (6,) pose and velocity at its end.
        next_levels: (k, 3) of a stretch that would keep the condition too.
    """

    levels: Array
    commands: Array
    after: Array
    next_levels: Array


def draw_inputs(
    vessel: Vessel,
    pulses: Pulses,
    *,
    samples: int,
    environment: Environment,
    margin_mps: float,
    velocity: tuple[float, float, float],
    rng: np.random.Generator,
) -> Array:
    """(samples, 4) commands that keep the ship's u and v above a margin.

    Args:
        vessel: the ship; its sensors are not used.
        pulses: what is drawn.
        samples: how many.
        environment: its means act.
        margin_mps: least u and v over ground.
        velocity: at the start.
        rng: all chance.

    Raises:
        NoAnswer: no draw keeps the condition.
    """
    quiet = replace(vessel, sensors=Sensors())
    steady = Environment(current_to=environment.current_to, wind_to=environment.wind_to)
    kept: list[Stretch] = []
    for _ in range(MOST_ATTEMPTS):
        if len(kept) * STRETCH >= samples:
            return np.concatenate([part.commands for part in kept])[:samples]
        found = _extended(quiet, pulses, steady, margin_mps, np.array([0.0, 0.0, 0.0, *velocity]), kept, rng)
        if found is not None:
            kept.append(found)
        elif kept:
            kept.pop()
    raise NoAnswer(
        f"no pulses about {pulses.speed_rps:g} rps, {pulses.angle_rad:.2f} rad keep u and v above {margin_mps:.2f} m/s"
    )


def _extended(
    vessel: Vessel,
    pulses: Pulses,
    environment: Environment,
    margin_mps: float,
    start: Array,
    kept: list[Stretch],
    rng: np.random.Generator,
) -> Stretch | None:
    state = kept[-1].after if kept else start
    before = kept[-1].levels[-len(WINDOW) + 1 :] if kept else np.zeros((len(WINDOW) - 1, 3))
    levels = pulses.levels(2 * STRETCH, DRAWS, rng)
    if kept:
        levels[:STRETCH, 0] = kept[-1].next_levels
    whole = np.concatenate([np.repeat(before[:, None], DRAWS, axis=1), levels])
    commands = pulses.commands(lfilter(WINDOW, [1.0], whole, axis=0)[len(before) :])
    runs = simulate_ensemble(
        vessel,
        np.concatenate([commands, commands[-1:]]),
        runs=DRAWS,
        environment=environment,
        rng=rng,
        pose=state[:3],
        velocity=state[3:],
    )
    fits = np.flatnonzero((runs.velocity[..., :2] > margin_mps).all(axis=(0, 2)))
    if not len(fits):
        return None
    index = int(fits[-1])  # the one standing by comes first, and is taken last
    after = np.concatenate([runs.pose[STRETCH, index], runs.velocity[STRETCH, index]])
    return Stretch(levels[:STRETCH, index], commands[:STRETCH, index], after, levels[STRETCH:, index])
