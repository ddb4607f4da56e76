"""A craft of two first-order equations for step trials, written without the project's simulation: every truth is known.

    T_U dU/dt = S n(t - t_d) - U          T_r dr/dt = K rudder(t - t_d) - r

through water that moves with a current, at n astern as ahead. Speed and yaw rate are those of a GPS and a gyro, with
correlated noise. A throttle with play follows its command that much late in value, so that speeds after steps up are
lower than after steps down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.signals import Batch, Record

STEP_S = 0.2
SPEED_PER_RPS = 0.4  # s [m/s per rps]
RATE_PER_RAD = 0.6  # k [rad/s per rad]
CONSTANTS_S = (4.0, 1.5)  # T_U and T_r
ROUND = tuple((n, 0.2) for n in (4.0, 7.0, 10.0, 13.0, 10.0, 7.0, 4.0)) + tuple(
    (10.0, angle) for angle in (0.1, 0.2, 0.3, 0.4, 0.3, 0.2, 0.1)
)
"""Throttle [rps] and rudder [rad] of a trial, up and down."""


@dataclass(frozen=True, kw_only=True)
class Craft:
    """What a trial is like; the sea is calm and the sensors are quiet where nothing is said."""

    steps: tuple[tuple[float, float], ...] = ROUND
    hold_s: float = 50.0
    step_s: float = STEP_S
    delay_s: float = 0.4  # of both commands
    play_rps: float = 0.0  # half the width
    # the speed rises by 2 m/s more about 10 rps, where the hull begins to plane, and turns take some of it
    hump: bool = False
    # the hull begins to plane at so much more throttle, and goes on planing down to so much less
    planing_play_rps: float = 0.0
    current_mps: float = 0.0  # to the north
    waves_mps: float = 0.06  # of the speed, with a correlation time of 1.5 s
    gusts_mps: float = 0.0  # that the hull follows with its own time constant
    speed_noise_mps: float = 0.03
    yaw_noise_radps: float = 0.003


def _reddened(rng: np.random.Generator, count: int, std: float, samples: float) -> np.ndarray:
    """First-order noise of a correlation time, settled."""
    keep, ahead = np.exp(-1.0 / samples), round(10 * samples)
    white = rng.standard_normal(count + ahead) * std * np.sqrt(1.0 - keep**2)
    return scipy.signal.lfilter([1.0], [1.0, -keep], white)[ahead:]


def _played(commands: np.ndarray, half: float) -> np.ndarray:
    """What a lever with play passes on."""
    found, now = np.empty(len(commands)), float(commands[0]) - half
    for place, value in enumerate(commands.tolist()):
        now = min(max(now, value - half), value + half)
        found[place] = now
    return found


def _followed(target: np.ndarray, share: float) -> np.ndarray:
    """First-order response, settled before it begins."""
    keep = np.exp(-share)
    start = [keep * target[0]]
    moved = scipy.signal.lfilter([0.0, 1.0 - keep], [1.0, -keep], target, zi=start)[0]
    return np.asarray(moved)


def steady_speed(throttle: np.ndarray, rudder: np.ndarray, craft: Craft, shift: np.ndarray | float = 0.0) -> np.ndarray:
    """Speed through the water [m/s] of a throttle [rps] and a rudder [rad]."""
    if not craft.hump:
        return SPEED_PER_RPS * throttle
    rises = 2.0 / (1.0 + np.exp(-(np.abs(throttle) - 10.0 - shift) / 0.8)) * np.sign(throttle)
    return (SPEED_PER_RPS * throttle + rises) * (1.0 - 0.8 * np.abs(rudder))


def sailed(seed: int, craft: Craft) -> dict[str, np.ndarray]:
    """Measured columns."""
    rng, h = np.random.default_rng(seed), craft.step_s
    held = round(craft.hold_s / h)
    n, rudder = np.repeat(np.array(craft.steps), held, axis=0).T
    count, late = len(n), round(craft.delay_s / h)
    acting = [np.concatenate([np.repeat(column[:1], late), column])[:count] for column in (n, rudder)]
    gusts = _reddened(rng, count, craft.gusts_mps, CONSTANTS_S[0] / h) if craft.gusts_mps else np.zeros(count)
    shift = acting[0] - _played(acting[0], craft.planing_play_rps)
    speed = (
        _followed(steady_speed(_played(acting[0], craft.play_rps), acting[1], craft, shift), h / CONSTANTS_S[0]) + gusts
    )
    speed += _reddened(rng, count, craft.waves_mps, 1.5 / h)
    rate = _followed(RATE_PER_RAD * acting[1] * np.sign(acting[0]), h / CONSTANTS_S[1])
    rate += _reddened(rng, count, 0.1 * craft.waves_mps, 1.5 / h)
    heading = rng.uniform(0.0, 2 * np.pi) + np.cumsum(rate) * h
    noise = craft.speed_noise_mps * rng.standard_normal((2, count))
    return {
        "time_s": np.arange(count) * h,
        "heading_rad": heading,
        "u_mps": speed + craft.current_mps * np.cos(heading) + noise[0],
        "v_mps": -craft.current_mps * np.sin(heading) + noise[1],
        "r_radps": rate + rng.standard_normal(count) * craft.yaw_noise_radps,
        "n1_rps": n,
        "rudder1_rad": rudder,
    }


def record(seed: int, craft: Craft) -> Record:
    """The same as a record."""
    told = sailed(seed, craft)
    zeros = np.zeros_like(told["heading_rad"])
    batch = Batch(
        name="steps", sample_time_s=craft.step_s, input_names=("n1", "rudder1"),
        inputs=np.column_stack([told["n1_rps"], told["rudder1_rad"]]),
        velocity=np.column_stack([told["u_mps"], told["v_mps"], told["r_radps"]]),
        pose=np.column_stack([zeros, zeros, told["heading_rad"]]),
    )  # fmt: skip
    return Record(batches=(batch,))
