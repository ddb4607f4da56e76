"""Voyages of a ship under a heading autopilot in a slight sea, for the tests of monitoring.

The motion is integrated here, by no code of the project, for many voyages at once. Waves move the ship about her slow
motion (T. I. Fossen, Handbook of Marine Craft Hydrodynamics (2021), chapter 10), sensors feel both, and the autopilot
answers what the sensors feel, so that the rudder is correlated with waves and noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

HOUR = 3600
BRAKED_S = 600
INSIDE = 2  # steps of the integration in a second
VALUES = {
    "X_uu": -0.004, "X_nn": 0.008, "X_vr": 1.2, "Y_uv": -0.02, "Y_ur": -0.3, "N_ur": -0.02, "N_ud": 0.0005,
}  # fmt: skip
EXPRESSIONS = {
    "X_uu": "abs(u)*u", "X_nn": "abs(n1)*n1", "X_vr": "v*r", "Y_uv": "abs(u)*v", "Y_ur": "u*r", "N_ur": "abs(u)*r",
    "N_ud": "abs(u)*u*sin(rudder1)",
}  # fmt: skip
NAMES = ("time_s", "north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps", "n1_rps", "rudder1_rad")
VANE = ("wind_speed_mps", "wind_angle_rad")


@dataclass(frozen=True, kw_only=True)
class Ship:
    """In what a ship and her sensors differ from the file of `vessel_file`."""

    thrust: float = 1.0
    drag: float = 1.0
    mass: float = 1.0  # and inertia in yaw
    rudder_rad: float = 0.0  # by which the rudder stands beside what is measured
    gyro: float = 1.0  # scale of the yaw rate
    push_radps2: float = 0.0  # of the weather and not of the ship: a force in yaw that grows to this within an hour


@dataclass(frozen=True, kw_only=True)
class Wind:
    """A wind over a ship of 50 m, which few measure: in a beam wind of 10 m/s she carries 5 degrees of rudder."""

    mean_mps: float = 0.0
    gust_mps: float = 0.0  # standard deviation of gusts, which last `gust_s`
    gust_s: float = 60.0
    later_mps: float = 0.0  # by which the mean rises in `over_s` from `since_s` of a voyage on
    turn_rad: float = 0.0  # by which it turns meanwhile
    over_s: float = HOUR
    squall_mps: float = 0.0  # by which it rises at once then, for ten minutes
    measured: bool = False  # on board, by a vane that stands askew in air that the ship makes faster

    def drawn(self, seconds: int, rng: np.random.Generator, hz: int, since_s: int) -> np.ndarray:
        """(s, 2) towards north and east [m/s], from a direction of chance."""
        after_s = np.arange(seconds * hz) / hz - since_s
        share = np.clip(after_s / self.over_s, 0.0, 1.0)
        speed = self.mean_mps + self.later_mps * share + self.squall_mps * ((after_s >= 0) & (after_s < 600))
        gusts = self.gust_mps * np.stack([_slow(seconds * hz, rng, hz, self.gust_s) for _ in range(2)], axis=-1)
        angle = rng.uniform(-np.pi, np.pi) + self.turn_rad * share
        return np.asarray(speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1) + gusts)


WIND_FORCES = np.array([1e-4, 4.5e-4, 7e-6])
"""Accelerations of surge, sway and yaw by the square of a wind on the bow, and from abeam [1/m, 1/m, rad/m2]."""
VANE_GAIN, VANE_RAD, VANE_STD = 1.05, np.deg2rad(3.0), (0.5, np.deg2rad(3.0))
"""Of the vane: what it tells of the wind's speed, by how much it is askew, and its noise [m/s, rad]."""
FRESH = Wind(mean_mps=4.0, gust_mps=0.7)
WINDS = {
    "as in the reference": FRESH,
    "twice as strong": Wind(mean_mps=8.0, gust_mps=1.4),
    "rising by 5 m/s in an hour": Wind(mean_mps=4.0, gust_mps=0.7, later_mps=5.0),
    "turning by 120 degrees in 20 min": Wind(mean_mps=4.0, gust_mps=0.7, turn_rad=2.1, over_s=1200),
    "a squall of 8 m/s more": Wind(mean_mps=4.0, gust_mps=0.7, squall_mps=8.0),
    "gusts three times as strong": Wind(mean_mps=4.0, gust_mps=2.1),
}
"""Of voyages whose reference was sailed in `FRESH`."""


@dataclass(frozen=True, kw_only=True)
class Sea:
    """Waves, slow forces and noise, as standard deviations."""

    wave_radps: float = np.deg2rad(0.1)  # yaw rate by waves; those of sway and surge go with it
    wave_mps: float = 0.08
    period_s: float = 7.0
    gyro_radps: float = np.deg2rad(0.046)
    surge_mps2: float = 2e-3  # slow forces, with a correlation time of ten minutes
    yaw_radps2: float = 2e-5
    pushed_s: float = 0.0  # correlation time of a force in yaw that moves her by `wave_radps`; zero for waves as above
    broad: bool = False  # waves of a Pierson-Moskowitz spectrum, whose peak is at `period_s`, in place of a narrow one
    together: bool = False  # one wave moves surge, sway and yaw, a quarter of a period apart, as a quartering sea does
    helm: tuple[float, float] = (0.8, 5.0)  # rudder per heading error, and per yaw rate [s]
    hz: int = 1  # samples in a second
    wind: Wind = Wind()


WINDY_SEAS = {
    "fresh wind": Sea(wind=FRESH),
    "fresh wind, measured": Sea(wind=replace(FRESH, measured=True)),
}
OTHER_SEAS = {
    "broad spectrum": Sea(broad=True, period_s=8.0),
    "quartering": Sea(together=True, period_s=18.0, wave_radps=np.deg2rad(0.3), wave_mps=0.15),
    "stiff helm": Sea(pushed_s=5.0, helm=(2.0, 12.0)),
    "soft helm": Sea(pushed_s=20.0, helm=(0.4, 1.0)),
    "5 Hz": Sea(broad=True, hz=5),
}
CALM = Sea(wave_radps=0.0, wave_mps=0.0)
CASES = {
    "unchanged": Ship(),
    "thrust - 8 %": Ship(thrust=0.92),
    "drag + 15 %": Ship(drag=1.15),
    "rudder + 2 degrees": Ship(rudder_rad=np.deg2rad(2.0)),
    "yaw rate times 0.97": Ship(gyro=0.97),
    "mass + 12 %": Ship(mass=1.12),
    "wind in yaw over an hour": Ship(push_radps2=1e-4),
}


def sailed(
    ships: Sequence[Ship],
    seconds: int,
    *,
    seeds: Sequence[int],
    sea: Sea = Sea(),
    since_s: int = 0,
    over_s: int = 0,
    moored_s: tuple[int, int] = (0, 0),
) -> np.ndarray:
    """(voyages, samples, 9) measured columns `NAMES` of voyages, and two of `VANE` where the wind is measured.

    Args:
        ships: of each voyage, as they are from `since_s` on.
        seconds: of a voyage.
        seeds: of each voyage.
        sea: of all.
        since_s: until then each is as in the file [s].
        over_s: time that the change then takes [s].
        moored_s: from when until when she lies at rest, with `BRAKED_S` before of no propeller and no helm.
    """
    drawn = [_drawn(seconds, np.random.default_rng(seed), sea) for seed in seeds]
    wanted, speed, waves, slow, noise = (np.stack(part, axis=-1) for part in zip(*drawn, strict=True))
    air = np.zeros((seconds * sea.hz, 2, len(seeds)))
    if sea.wind != Wind():
        for place, seed in enumerate(seeds):
            air[..., place] = sea.wind.drawn(seconds, np.random.default_rng([seed, 1]), sea.hz, since_s)
    later = {name: np.array([getattr(ship, name) for ship in ships]) for name in vars(ships[0])}
    before = {name: np.full(len(ships), value) for name, value in vars(Ship()).items()}
    v, step_s, samples = len(ships), 1.0 / sea.hz, seconds * sea.hz
    slow[:, 2] += np.clip(np.arange(samples) * step_s - since_s, 0, HOUR)[:, None] / HOUR * later["push_radps2"]
    columns = len(NAMES) + len(VANE) * sea.wind.measured
    table = np.empty((samples, columns, v))
    vane = np.stack([np.random.default_rng([seed, 2]).standard_normal((samples, 2)) for seed in seeds], axis=-1)
    state = np.zeros((6, v))  # u, v, r, north, east, heading
    state[0] = 4.0
    rudder, felt, n = np.zeros(v), np.zeros((2, v)), speed[0]
    for sample in range(samples):
        time_s = sample * step_s
        share = float(np.clip((time_s - since_s) / over_s, 0.0, 1.0)) if over_s else float(time_s >= since_s)
        ship = {name: (1.0 - share) * before[name] + share * later[name] for name in later}
        moored, braked = (moored_s[0] - ahead_s <= time_s < moored_s[1] for ahead_s in (0, BRAKED_S))
        moved = waves[sample] * (not moored)  # of surge, sway, yaw rate and heading
        told = state[[3, 4, 5, 0, 1, 2]].copy()
        told[2:] += moved[[3, 0, 1, 2]]
        told[5] *= ship["gyro"]
        told += noise[sample]
        felt = told[[2, 5]]
        turn = np.clip(wanted[sample] - felt[0], -0.5, 0.5)
        order = np.clip(sea.helm[0] * turn - sea.helm[1] * felt[1], -0.5, 0.5) * (not braked)
        begun = rudder
        rudder = rudder + np.clip(order - rudder, -0.05 * step_s, 0.05 * step_s)
        n = n + np.clip(speed[sample] * (not braked) - n, -0.05 * step_s, 0.05 * step_s)
        felt_air = _vane(state, air[sample], vane[sample]) if sea.wind.measured else ()
        table[sample] = np.stack([np.full(v, sample * step_s), *told, n, (begun + rudder) / 2, *felt_air])
        for part in range(INSIDE):
            angle = begun + (rudder - begun) * (part + 0.5) / INSIDE + ship["rudder_rad"]
            push = slow[sample] + _blown(state, air[sample])
            state = _stepped(state, angle, n, push, ship, step_s / INSIDE)
            state[:3] *= not moored
    return np.moveaxis(table, 2, 0)


def _drawn(seconds: int, rng: np.random.Generator, sea: Sea) -> tuple[np.ndarray, ...]:
    """Set points of heading (s,) and speed of the propeller (s,), waves (s, 4), slow forces (s, 3), noise (s, 6)."""
    samples = seconds * sea.hz
    wanted, speed = np.zeros(samples), np.zeros(samples)
    heading = rng.uniform(-np.pi, np.pi)
    for points in (wanted, speed):
        sample = 0
        while sample < samples:
            held = int(rng.uniform(300, 1200) * sea.hz)
            if points is wanted:
                heading = heading + rng.choice([-1, 1]) * rng.uniform(0.2, 1.0)
            points[sample : sample + held] = heading if points is wanted else rng.choice([2.4, 2.7, 3.0, 3.2])
            sample += held
    wanted -= wanted[0]
    moved = [_wave(samples, rng, sea)] * 3 if sea.together else [_wave(samples, rng, sea) for _ in range(3)]
    (surge, _), (sway, _), (yaw, turned) = moved
    waves = np.stack([surge.real, sway.imag, yaw.real, turned.real], axis=-1)
    waves *= np.array([0.5 * sea.wave_mps, sea.wave_mps, *[sea.wave_radps * (not sea.pushed_s)] * 2])
    slow = np.stack([_slow(samples, rng, sea.hz) for _ in range(3)], axis=-1)
    slow *= np.array([sea.surge_mps2, 0.5 * sea.surge_mps2, sea.yaw_radps2])
    if sea.pushed_s:
        # acceleration for which a ship with damping N_ur u has this yaw rate, were there no autopilot
        damping = -VALUES["N_ur"] * 4.0
        push = _slow(samples, rng, sea.hz, sea.pushed_s) * np.sqrt(damping * (damping + 1.0 / sea.pushed_s))
        slow[:, 2] += sea.wave_radps * push
    noise = rng.standard_normal((samples, 6)) * np.array([0.3, 0.3, 0.003, 0.02, 0.02, sea.gyro_radps])
    return wanted, speed, waves, slow, noise


def _wave(samples: int, rng: np.random.Generator, sea: Sea) -> tuple[np.ndarray, np.ndarray]:
    """(s,) a rate of standard deviation one, of many waves, and its integral; as real and as imaginary part.

    Source: W. J. Pierson and L. Moskowitz, Journal of Geophysical Research 69 (1964), 5181-5190, for the broad one.
    """
    time, peak = np.arange(samples) / sea.hz, 2 * np.pi / sea.period_s
    phases = rng.uniform(0, 2 * np.pi, 60)
    if sea.broad:
        rates = peak * rng.uniform(0.6, 3.0, 60)
        sizes = np.sqrt(rates**-5.0 * np.exp(-1.25 * (peak / rates) ** 4))
    else:
        rates, sizes = peak * rng.normal(1.0, 0.12, 60), rng.rayleigh(1.0, 60)
    each = sizes[:, None] * np.exp(1j * (rates[:, None] * time + phases[:, None])) / np.sqrt((sizes**2).sum() / 2)
    return each.sum(axis=0), (each / (1j * rates[:, None])).sum(axis=0)


def _slow(samples: int, rng: np.random.Generator, hz: int, time_s: float = 600.0) -> np.ndarray:
    """(s,) a first-order process of standard deviation one."""
    keep, value, values = np.exp(-1.0 / time_s / hz), rng.standard_normal(), np.empty(samples)
    for sample, fresh in enumerate(np.sqrt(1 - keep**2) * rng.standard_normal(samples)):
        values[sample] = value = keep * value + fresh
    return values


def _blown(state: np.ndarray, air: np.ndarray) -> np.ndarray:
    """(3, v) accelerations by a wind (2, v)."""
    if not air.any():
        return np.zeros((3, state.shape[1]))
    ahead, beside = _past(state, air)
    size = np.hypot(ahead, beside)
    return WIND_FORCES[:, None] * np.stack([size * ahead, size * beside, size * beside])


def _past(state: np.ndarray, air: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(v,) velocities of the air past the ship along her axes [m/s]."""
    c, s = np.cos(state[5]), np.sin(state[5])
    return c * air[0] + s * air[1] - state[0], -s * air[0] + c * air[1] - state[1]


def _vane(state: np.ndarray, air: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(v,) `VANE` of a wind (2, v): its speed, and where it comes from, clockwise from the bow."""
    ahead, beside = _past(state, air)
    speed = np.abs(VANE_GAIN * np.hypot(ahead, beside) + VANE_STD[0] * noise[0])
    angle = np.arctan2(-beside, -ahead) + VANE_RAD + VANE_STD[1] * noise[1]
    return speed, np.mod(angle + np.pi, 2 * np.pi) - np.pi


def _stepped(
    state: np.ndarray, angle: np.ndarray, n: np.ndarray, slow: np.ndarray, ship: dict[str, np.ndarray], h: float
) -> np.ndarray:
    """The state after a step, by Heun's method."""
    first = _rates(state, angle, n, slow, ship)
    return np.asarray(state + h / 2 * (first + _rates(state + h * first, angle, n, slow, ship)))


def _rates(
    state: np.ndarray, angle: np.ndarray, n: np.ndarray, slow: np.ndarray, ship: dict[str, np.ndarray]
) -> np.ndarray:
    u, v, r, _, _, heading = state
    k = VALUES
    push = k["X_nn"] * ship["thrust"] * np.abs(n) * n
    return np.stack(
        [
            (k["X_uu"] * ship["drag"] * np.abs(u) * u + push) / ship["mass"] + k["X_vr"] * v * r + slow[0],
            k["Y_uv"] * np.abs(u) * v / ship["mass"] + k["Y_ur"] * u * r + slow[1],
            (k["N_ur"] * np.abs(u) * r + k["N_ud"] * np.abs(u) * u * np.sin(angle)) / ship["mass"] + slow[2],
            u * np.cos(heading) - v * np.sin(heading),
            u * np.sin(heading) + v * np.cos(heading),
            r,
        ]
    )


def written(path: Path, table: np.ndarray, *, begin_s: float = 0.0) -> Path:
    """A voyage of `sailed` as a file."""
    told = table.copy()
    told[:, 0] += begin_s
    told[:, 3] = np.mod(told[:, 3] + np.pi, 2 * np.pi) - np.pi
    names = ",".join((*NAMES, *VANE)[: told.shape[1]])
    np.savetxt(path, told, delimiter=",", header=names, comments="", fmt="%.6g")
    return path


def relative_wind(table: np.ndarray) -> np.ndarray | None:
    """(s, 2) velocity of the ship through the air along her axes [m/s], as the vane of a voyage tells it."""
    if table.shape[1] == len(NAMES):
        return None
    speed, angle = table[:, len(NAMES) :].T
    return np.stack([speed * np.cos(angle), speed * np.sin(angle)], axis=-1)


def vessel_file(path: Path) -> Path:
    """The ship as known, 50 m long."""
    text = """[vessel]
name = "patrol-50m"
length_m = 50.0
beam_m = 9.0
draught_m = 3.0
sample_time_s = 1.0
[[actuators]]
kind = "propeller"
forward_m = -23.0
speed_min_rps = -3.0
speed_max_rps = 4.0
speed_rate_rps2 = 0.5
[[actuators]]
kind = "rudder"
forward_m = -24.0
angle_min_rad = -0.6109
angle_max_rad = 0.6109
angle_rate_radps = 0.05
[model]
structure = "custom"
form = "continuous"
"""
    for name, expression in EXPRESSIONS.items():
        equation = {"X": "u", "Y": "v", "N": "r"}[name[0]]
        text += f'[[model.terms]]\nequation = "{equation}"\nname = "{name}"\nexpression = "{expression}"\n'
    text += "[model.parameters]\n" + "".join(f"{name} = {value}\n" for name, value in VALUES.items())
    text += "[model.parameter_std]\n" + "".join(f"{name} = {0.1 * abs(value)}\n" for name, value in VALUES.items())
    text += "[sensors]\nposition_m = 0.3\nheading_rad = 0.003\nvelocity_mps = 0.02\nyaw_rate_radps = 0.0008\n"
    path.write_text(text, encoding="utf-8")
    return path
