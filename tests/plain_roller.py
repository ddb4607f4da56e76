"""A coaster that rolls, written without the project's simulation: every truth is known.

    A1 phi'' = -(k + g S1) phi - d phi' - d2 abs(phi') phi' + (K_vd + S1) a_y + K_r r + K_delta delta + waves
    T r' = K delta - r          v' = -v / T_v - 0.7 U r          a_y = v' + U r

at a constant speed U, by Runge and Kutta's fourth order. The sensor reads a_s = z_s phi'' + g phi - a_y - x_s r' to
port, and a sensor whose bow end is tilted up by an angle takes yaw for roll and roll for yaw. The rudder is set
beforehand: random steps. Heights are above the rotation axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.roll import (
    Body,
    Case,
    Load,
    RollEstimate,
    Run,
    build_problem,
    estimate_roll,
    low_pass,
    metacentric_height,
    prepared,
)

G = 9.81
MASS_KG, MASS_HEIGHT_M, SENSOR_HEIGHT_M, BEAM_M, SPEED_MPS = 300e3, 0.4, 4.0, 8.0, 5.0
GM_M, PERIOD_S = 0.7, 7.5
S0 = -MASS_KG * MASS_HEIGHT_M
K = MASS_KG * G * GM_M - G * S0
A1 = MASS_KG * G * GM_M * (PERIOD_S / (2 * np.pi)) ** 2
D = 2 * 0.05 * np.sqrt(MASS_KG * G * GM_M * A1)
K_VD, K_R, K_DELTA = 0.25e6, -0.6e6, 0.35e6
KNOWN, UNKNOWN = (5000.0, 5.0), (5000.0, 6.0)  # mass [kg] and height [m] of the known and of the unknown load
STEP_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Sea:
    """What a trial is like; calm, and a ship that the model is, where nothing is said."""

    roll_deg: float = 0.0  # rms of roll by waves
    wave_s: float = 6.0  # their period
    quadratic: float = 0.0  # damping moment at 0.1 rad/s by abs(phi') phi', over the linear one there
    forward_m: float = 0.0  # place of the sensor before the axis of yaw
    tilt_deg: float = 0.0  # of the sensor, bow end up
    run_s: float = 900.0
    feedback: float = 0.0  # of roll rate to the rudder [s]
    load: tuple[float, float] = UNKNOWN
    ordered: bool = False  # the record has the orders, which the rudder follows at 5 degrees a second
    zigzag_s: float = 0.0  # the rudder goes from side to side by the clock, so often; at random where it is 0


def _waves(rng: np.random.Generator, count: int, period_s: float) -> np.ndarray:
    """Narrow-band noise of unit size at half samples."""
    w, h = 2 * np.pi / period_s, STEP_S / 2
    pole = np.exp((-0.06 + 1j) * w * h)
    white = rng.standard_normal(count + 4000)
    found = scipy.signal.lfilter([1.0, 0.0, -1.0], [1.0, -2 * pole.real, abs(pole) ** 2], white)[4000:]
    return np.asarray(found / found.std())


def _orders(rng: np.random.Generator, count: int, zigzag_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Orders and rudder at half samples: steps of random size and length, at 5 degrees a second."""
    h = STEP_S / 2
    holds = [(rng.uniform(4.0, 16.0), rng.choice([-0.3, -0.15, 0.0, 0.15, 0.3])) for _ in range(count // 80 + 1)]
    if zigzag_s:
        holds = [(zigzag_s, 0.2 * (-1) ** place) for place in range(count)]
    wished = np.concatenate([np.full(round(length / h), angle) for length, angle in holds])[:count]
    rudder, most = np.zeros(count), np.radians(5.0) * h
    for k in range(1, count):
        rudder[k] = rudder[k - 1] + min(max(wished[k] - rudder[k - 1], -most), most)
    return wished, rudder


def run(seed: int, load: tuple[float, float], sea: Sea) -> np.ndarray:
    """(k, 4) roll rate, reading to port, yaw rate and rudder, as measured."""
    rng = np.random.default_rng(seed)
    count = round(sea.run_s / STEP_S)
    halves = 2 * count + 2
    (wished, rudder), wave = _orders(rng, halves, sea.zigzag_s), _waves(rng, halves, sea.wave_s)
    m, z = load[0], -load[1]
    s1, inertia = S0 + m * z, A1 + m * z * z
    right = K + G * s1
    # the moment that gives roll of this size, by the response at the waves' own period
    w = 2 * np.pi / sea.wave_s
    moment = np.radians(sea.roll_deg) * abs(right - inertia * w * w + 1j * D * w) * wave
    sway = 0.4 * G * np.radians(sea.roll_deg) * np.roll(wave, 7)
    yaw = 0.15 * np.radians(sea.roll_deg) * np.roll(wave, 15)
    d2, h = sea.quadratic * D / 0.1, STEP_S
    state, found = np.zeros(4), np.empty((count, 4))  # roll, its rate, yaw rate, v

    def rates(x: np.ndarray, k: int, delta: float) -> tuple[np.ndarray, float]:
        phi, p, r, v = x
        turn = (0.09 * delta - r) / 3.0
        dv = -v / 4.0 - 0.7 * SPEED_MPS * r
        side = dv + SPEED_MPS * r + sway[k]
        push = (K_VD + s1) * side + K_R * (r + yaw[k]) + K_DELTA * delta + moment[k]
        return np.array([p, (push - right * phi - D * p - d2 * abs(p) * p) / inertia, turn, dv]), side

    for k in range(count):
        delta = rudder[2 * k] + sea.feedback * state[1]
        one, side = rates(state, 2 * k, delta)
        yawing = (yaw[2 * k + 1] - yaw[2 * k - 1]) / h if k else 0.0
        reading = -SENSOR_HEIGHT_M * one[1] + G * state[0] - side - sea.forward_m * (one[2] + yawing)
        found[k] = state[1], reading, state[2] + yaw[2 * k], wished[2 * k] if sea.ordered else delta
        deltas = [rudder[2 * k + j] + sea.feedback * state[1] for j in (1, 2)]
        two, _ = rates(state + h / 2 * one, 2 * k + 1, deltas[0])
        three, _ = rates(state + h / 2 * two, 2 * k + 1, deltas[0])
        four, _ = rates(state + h * three, 2 * k + 2, deltas[1])
        state = state + h / 6 * (one + 2 * two + 2 * three + four)
    tilt = np.radians(sea.tilt_deg)
    rate, turn = found[:, 0].copy(), found[:, 2].copy()
    found[:, 0], found[:, 2] = np.cos(tilt) * rate - np.sin(tilt) * turn, np.cos(tilt) * turn + np.sin(tilt) * rate
    return found + rng.standard_normal(found.shape) * [0.0005, 0.01, 0.0005, 0.0]


def estimated(seed: int, sea: Sea, **told: float) -> RollEstimate:
    """From no load, the known one and the unknown one, with k known."""
    loads = (None, KNOWN, sea.load)
    own = [run(10 * seed + place, load or (0.0, 0.0), sea) for place, load in enumerate(loads)]
    body = Body(mass_kg=MASS_KG, z_g=-MASS_HEIGHT_M, z_s=-SENSOR_HEIGHT_M, **told)
    named = (("empty", Load(mass_kg=0.0, z_m=0.0)), ("known", Load(mass_kg=KNOWN[0], z_m=-KNOWN[1])), ("unknown", None))
    cases = tuple(
        Case(name=name, load=load, runs=(Run(step_s=STEP_S, signals=signals),))
        for (name, load), signals in zip(named, own, strict=True)
    )
    ready = prepared(cases, low_pass(cases, roll_hz=1.0 / PERIOD_S))
    problem = build_problem(body, ready, beam_m=BEAM_M, roll_hz=1.0 / PERIOD_S, known={"k": K}, start={})
    return estimate_roll(problem)


def deviations(one: RollEstimate) -> list[float]:
    """Errors of the estimated parameters but the load's, and those that are not trusted, in standard deviations."""
    truth = {"A_x": A1 - MASS_KG * MASS_HEIGHT_M**2, "d": D, "K_r": K_R, "K_vd": K_VD, "K_delta": K_DELTA, "z_f": 0.0}
    return [(one.values[name] - truth[name]) / one.std[name] for name in truth if name not in one.by_tilt]


def height_deviations(one: RollEstimate, sea: Sea) -> list[float]:
    """Errors of the metacentric heights of the three load cases in their standard deviations."""
    found = []
    for case, (mass, height) in zip(one.problem.cases, ((0.0, 0.0), KNOWN, sea.load), strict=True):
        truth = (K + G * (S0 - mass * height)) / (G * (MASS_KG + mass))
        value, std = metacentric_height(one, case.load)
        found.append((value - truth) / std)
    return found
