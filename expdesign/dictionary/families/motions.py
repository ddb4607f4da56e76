"""Families that state a motion; commands follow from the inverse model.

In a multisine, surge, sway and yaw rate each swing with several frequencies at once. Phases follow Schroeder's rule, so
that the sum of equal sines stays low; each velocity has its own frequencies, so that they are uncorrelated over a
period.

Source: M. R. Schroeder, Synthesis of low-peak-factor signals, IEEE Trans. Inf. Theory 16 (1970), 85-89.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.spec import DURATION, WHOLE_PERIODS, Setting, motion_family, share_setting, velocity_setting
from expdesign.errors import InputError
from expdesign.values import Array

TONES = 4  # sines for each of the three velocities
LEAST_SWING = 0.5  # least amplitude to both sides of a wave before it is scaled to amplitude 1


# Smooth shapes of reference motions: without jumps, because actuators have rate limits.

RAMP_FRACTION = share_setting("ramp_fraction", "share of the run that the change takes", default=0.7, low=0.01)


def ramp(time_s: Array, *, start_s: float = 0.0, length_s: float) -> Array:
    """Half a cosine from 0 to 1 over `length_s`, flat outside."""
    x = np.clip((time_s - start_s) / max(length_s, 1e-12), 0.0, 1.0)
    return np.asarray((1.0 - np.cos(np.pi * x)) / 2.0)


def envelope(time_s: Array, *, length_s: float) -> Array:
    """1, brought in from zero at the start and taken back to zero at the end over `length_s`."""
    return ramp(time_s, length_s=length_s) * ramp(float(time_s[-1]) - time_s, length_s=length_s)


def flat_wave(time_s: Array, *, period_s: float) -> Array:
    """A rounded square wave of amplitude 1 that begins and ends at zero and has zero mean.

    It starts in the middle of a plateau, so that its integral (heading, sideways distance) swings evenly to both sides
    and returns.

    Raises:
        InputError: the samples hold no swing of that period.
    """
    sharpness = 3.0
    wave = np.tanh(sharpness * np.cos(2.0 * np.pi * time_s / period_s)) / np.tanh(sharpness)
    fade = envelope(time_s, length_s=period_s / 12)
    weights = np.r_[0.5, np.ones(len(time_s) - 2), 0.5]
    centred = fade * (wave - weights @ (fade * wave) / max(weights @ fade, 1e-300))
    if not (centred.max() > LEAST_SWING and centred.min() < -LEAST_SWING):
        raise InputError(
            f"period_s is {period_s:g}, expected a full swing within duration_s = {time_s[-1]:g} and several samples "
            f"of {time_s[1]:g} s within a swing"
        )
    return np.asarray(centred / np.abs(centred).max())


def speed_change(time_s: Array, *, first: float, last: float, share: float) -> Array:
    """(k, 3) u, v, r of a straight run whose surge speed changes over a share of it and then stays."""
    surge = first + (last - first) * ramp(time_s, length_s=share * float(time_s[-1]))
    return np.stack([surge, 0 * surge, 0 * surge], axis=1)


@motion_family(
    DURATION,
    velocity_setting("surge", "speed_mps", "surge speed reached"),
    velocity_setting("surge", "from_speed_mps", "surge speed at the start", default=0.0),
    RAMP_FRACTION,
)
def acceleration(settings: Mapping[str, float], time_s: Array) -> Array:
    """From a lower to a higher surge speed on a straight course."""
    first, last = settings["from_speed_mps"], settings["speed_mps"]
    return speed_change(time_s, first=first, last=last, share=settings["ramp_fraction"])


@motion_family(
    DURATION,
    velocity_setting("surge", "speed_mps", "surge speed at the start"),
    velocity_setting("surge", "to_speed_mps", "surge speed reached", default=0.0),
    RAMP_FRACTION,
)
def deceleration(settings: Mapping[str, float], time_s: Array) -> Array:
    """From a surge speed down to a lower one, or to rest, on a straight course."""
    first, last = settings["speed_mps"], settings["to_speed_mps"]
    return speed_change(time_s, first=first, last=last, share=settings["ramp_fraction"])


@motion_family(
    DURATION,
    velocity_setting("surge", "speed_mps", "surge speed"),
    velocity_setting("yaw", "yaw_rate_radps", "yaw rate at the end, positive to starboard"),
    velocity_setting("sway", "sway_mps", "sway speed, positive to starboard", default=0.0),
    Setting(name="entry_s", meaning="time in which the sway builds up", default=3.0, low=0, high=1e4, searched="time"),
)
def inward_spiral(settings: Mapping[str, float], time_s: Array) -> Array:
    """Steady surge and sway while the yaw rate grows from zero, so the turn tightens."""
    surge = np.full_like(time_s, settings["speed_mps"])
    sway = settings["sway_mps"] * ramp(time_s, length_s=settings["entry_s"])
    return np.stack([surge, sway, settings["yaw_rate_radps"] * time_s / float(time_s[-1])], axis=1)


def _sum_of_sines(time_s: Array, *, period_s: float, first: int) -> Array:
    """Largest modulus 1, harmonics first, first + 3, ... of a period."""
    place = np.arange(TONES)
    phase = -np.pi * place * (place + 1) / TONES
    angles = 2 * np.pi * (first + 3 * place)[:, None] * time_s / period_s + phase[:, None]
    wave = np.sin(angles).sum(axis=0) * envelope(time_s, length_s=period_s / 12)
    return np.asarray(wave / max(float(np.abs(wave).max()), 1e-12))


@motion_family(
    WHOLE_PERIODS,
    Setting(name="period_s", meaning="common period of all sines", low=1e-2, high=1e5, searched="time"),
    velocity_setting("surge", "speed_mps", "mean surge speed"),
    velocity_setting("surge", "speed_swing_mps", "amplitude of surge speed", default=0.0, signed=False),
    velocity_setting("sway", "sway_mps", "largest sway speed", default=0.0),
    velocity_setting("yaw", "yaw_rate_radps", "largest yaw rate", default=0.0),
)
def multisine(settings: Mapping[str, float], time_s: Array) -> Array:
    """Multisines in surge speed, sway speed and yaw rate, with four different frequencies each."""
    swing, side, turn = (_sum_of_sines(time_s, period_s=settings["period_s"], first=first) for first in (1, 2, 3))
    surge = settings["speed_mps"] + settings["speed_swing_mps"] * swing
    return np.stack([surge, settings["sway_mps"] * side, settings["yaw_rate_radps"] * turn], axis=1)


@motion_family(
    DURATION,
    velocity_setting("sway", "sway_mps", "sway speed, positive to starboard"),
    Setting(name="rise_s", meaning="time that a step takes", low=1e-2, high=1e4, searched="time"),
    velocity_setting("surge", "speed_mps", "surge speed", default=0.0),
    share_setting("held_fraction", "share of the run after which the sway returns to zero", default=0.6, low=0.05),
)
def sway_step(settings: Mapping[str, float], time_s: Array) -> Array:
    """A step of sway speed on a steady heading, and back."""
    rise_s, held_s = settings["rise_s"], settings["held_fraction"] * float(time_s[-1])
    sway = settings["sway_mps"] * (ramp(time_s, length_s=rise_s) - ramp(time_s, start_s=held_s, length_s=rise_s))
    return np.stack([np.full_like(time_s, settings["speed_mps"]), sway, 0 * sway], axis=1)


@motion_family(
    WHOLE_PERIODS,
    velocity_setting("sway", "sway_mps", "largest sway speed; the first push is to starboard"),
    Setting(name="period_s", meaning="time of one full swing", low=1e-2, high=1e5, searched="time"),
    velocity_setting("surge", "speed_mps", "surge speed", default=0.0),
)
def sway_zigzag(settings: Mapping[str, float], time_s: Array) -> Array:
    """Alternating sideways motion on a steady heading, with or without headway."""
    wave = flat_wave(time_s, period_s=settings["period_s"])
    surge = np.full_like(time_s, settings["speed_mps"])
    return np.stack([surge, settings["sway_mps"] * wave, 0 * wave], axis=1)


def _switching(rng: np.random.Generator, time_s: Array, *, hold_s: float, rise_s: float) -> Array:
    """A +-1 signal that changes sign after exponential times of mean `hold_s`, smoothed over `rise_s`."""
    end_s = float(time_s[-1])
    flips = np.cumsum(rng.exponential(hold_s, size=max(8, int(8 * end_s / hold_s))))
    flips = flips[flips < end_s + 10 * rise_s]  # later ones are not seen
    sign = 2.0 * rng.integers(0, 2) - 1.0
    level = sum((np.tanh(2.0 * (time_s - flip) / rise_s) + 1.0) * (-1.0) ** n for n, flip in enumerate(flips))
    return np.asarray(sign * (1.0 - level))


@motion_family(
    DURATION,
    velocity_setting("surge", "speed_mps", "mean surge speed"),
    velocity_setting("surge", "speed_swing_mps", "amplitude of surge speed", signed=False),
    velocity_setting("sway", "sway_mps", "sway speed to both sides", signed=False),
    velocity_setting("yaw", "yaw_rate_radps", "yaw rate to both sides", signed=False),
    Setting(name="hold_s", meaning="mean time between switches", low=1e-2, high=1e5, searched="time"),
    Setting(name="rise_s", meaning="time that a switch takes", low=1e-2, high=1e4, searched="time"),
    Setting(name="draw", meaning="seed of the random numbers", default=1.0, low=0, high=2**31, searched="draw"),
    velocity_setting("sway", "sway_offset_mps", "steady sway added to it", default=0.0),
    velocity_setting("yaw", "yaw_offset_radps", "steady yaw rate added to it", default=0.0),
)
def telegraph(settings: Mapping[str, float], time_s: Array) -> Array:
    """Random switching of surge speed, sway speed and yaw rate between two levels each."""
    rng = np.random.default_rng(int(settings["draw"]))
    hold_s, rise_s = settings["hold_s"], settings["rise_s"]
    swing, sway, yaw = (_switching(rng, time_s, hold_s=hold_s, rise_s=rise_s) for _ in range(3))
    fade = envelope(time_s, length_s=rise_s)
    surge = settings["speed_mps"] + settings["speed_swing_mps"] * fade * swing
    side = fade * (settings["sway_offset_mps"] + settings["sway_mps"] * sway)
    turn = fade * (settings["yaw_offset_radps"] + settings["yaw_rate_radps"] * yaw)
    return np.stack([surge, side, turn], axis=1)


@motion_family(
    DURATION,
    velocity_setting("surge", "speed_mps", "approach speed"),
    velocity_setting("surge", "turn_speed_mps", "surge speed in the turn"),
    velocity_setting("yaw", "yaw_rate_radps", "yaw rate in the turn, positive to starboard"),
    Setting(name="entry_s", meaning="time from straight to steady turn", low=0, high=1e4, searched="time"),
    velocity_setting("sway", "sway_mps", "outward sway, positive to port", default=0.0),
)
def turning_circle(settings: Mapping[str, float], time_s: Array) -> Array:
    """A turn to one side from a straight approach to a steady yaw rate, drifting outwards."""
    entered = ramp(time_s, length_s=settings["entry_s"])
    surge = settings["speed_mps"] + (settings["turn_speed_mps"] - settings["speed_mps"]) * entered
    return np.stack([surge, -settings["sway_mps"] * entered, settings["yaw_rate_radps"] * entered], axis=1)


@motion_family(
    WHOLE_PERIODS,
    velocity_setting("surge", "speed_mps", "surge speed"),
    velocity_setting("yaw", "yaw_rate_radps", "largest yaw rate; the first turn is to starboard"),
    Setting(name="period_s", meaning="time of one full swing", low=1e-2, high=1e5, searched="time"),
    velocity_setting("sway", "sway_mps", "largest outward sway speed", default=0.0),
    velocity_setting("sway", "sway_offset_mps", "steady sway added to it", default=0.0),
    velocity_setting("yaw", "yaw_offset_radps", "steady yaw rate added to it", default=0.0),
)
def zigzag(settings: Mapping[str, float], time_s: Array) -> Array:
    """Alternating turns at a steady surge speed, drifting outwards; without offsets the heading returns."""
    wave = flat_wave(time_s, period_s=settings["period_s"])
    surge = np.full_like(time_s, settings["speed_mps"])
    offset = envelope(time_s, length_s=settings["period_s"] / 4)
    sway = settings["sway_offset_mps"] * offset - settings["sway_mps"] * wave
    return np.stack([surge, sway, settings["yaw_offset_radps"] * offset + settings["yaw_rate_radps"] * wave], axis=1)
