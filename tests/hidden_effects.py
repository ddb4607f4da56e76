"""Trials with an effect hidden in them, from a simulator of its own: nothing of the package makes this data.

Ships are written out as equations, integrated by Runge-Kutta at a fifth of the sample time, in current and wind that
vary as Gauss-Markov processes, and measured with white noise. All trials of a call are sailed side by side in the same
weather, from the same state, and measured with the same noise; every effect is neutral unless a trial sets it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import casadi as ca
import numpy as np
from scipy.signal import lfilter

TUG = {
    "X_u": -0.05, "X_vr": 1.0, "X_abs_u_u": -0.05, "W_abs_u_u": -0.0005, "X_mu": 0.02, "X_kappa": -0.0025,
    "Y_v": -0.2, "Y_ur": -0.65, "Y_abs_v_v": -0.2, "Y_abs_v_r": -0.1, "W_abs_v_v": -0.0015, "Y_mu": 0.02,
    "N_r": -0.1, "N_uv": -0.0015, "N_abs_v_v": -0.001, "N_abs_v_r": -0.04, "W_uv": -0.00003, "N_mu": 0.0003,
}  # fmt: skip
"""Continuous coefficients of a 30 m ship with azimuths 9 m fore and aft (Ljungberg, Table 6.1, sampled at 1 s)."""
BARGE = {
    "X_u": -0.08, "X_abs_u_u": -0.03, "X_vr": 0.9, "X_mu": 0.02, "Y_v": -0.15, "Y_ur": -0.6, "Y_mu": 0.02,
    "N_r": -0.12, "N_uv": -0.004, "N_mu": 0.0004,
}  # fmt: skip
"""A ship of the ten-parameter structure, driven by generalised forces."""
COASTER = {
    "X_u": -0.004, "X_abs_u_u": -0.003, "X_vr": 0.9, "X_nn": 0.0035, "X_dd": -0.004, "Y_v": -0.06, "Y_ur": -0.35,
    "Y_rud": 0.006, "N_r": -0.09, "N_uv": -0.0012, "N_rud": -0.0009,
}  # fmt: skip
"""A ship with one propeller and one rudder: thrust goes with n |n|, rudder forces with u |u| delta."""
SHIPS = {"tug": TUG, "barge": BARGE, "coaster": COASTER}
INPUTS = {"tug": ("n1", "a1", "n2", "a2"), "barge": ("tau_x", "tau_y", "tau_psi"), "coaster": ("n1", "rudder1")}
TERMS = {
    "X_vr": lambda u, v, r: v * r, "X_abs_u_u": lambda u, v, r: abs(u) * u, "Y_abs_v_v": lambda u, v, r: abs(v) * v,
    "Y_abs_v_r": lambda u, v, r: abs(v) * r, "N_uv": lambda u, v, r: u * v, "N_abs_v_v": lambda u, v, r: abs(v) * v,
    "N_abs_v_r": lambda u, v, r: abs(v) * r, "Y_ur": lambda u, v, r: u * r, "Y_vvv": lambda u, v, r: v * v * v,
    "N_rrr": lambda u, v, r: r * r * r, "N_ur_abs_r": lambda u, v, r: u * r * abs(r),
}  # fmt: skip
"""Terms that may be hidden: regressors by name; the first letter tells the equation."""
SUBSTEPS = 5
MOST = 100.0


@dataclass
class Weather:
    """Means are those of every trial; the varying part has these standard deviations and correlation times."""

    current_std: float = 0.03
    current_time_s: float = 200.0
    wind_std: float = 0.5
    wind_time_s: float = 60.0


@dataclass
class Sensors:
    position: float = 0.5
    heading: float = 0.01
    velocity: float = 0.014
    yaw_rate: float = 0.003
    wind: float = 0.05


@dataclass
class Trial:
    """One trial to sail: which ship, how, with what hidden in it; effects are listed in `sail`."""

    ship: str
    parameters: dict[str, float]
    effects: dict[str, float] = field(default_factory=dict)
    current: tuple[float, float] = (0.0, 0.0)
    wind: tuple[float, float] = (0.0, 0.0)


def commands(ship: str, batches: int, samples: int, step_s: float, rng: np.random.Generator) -> np.ndarray:
    """(batches, samples, m) a helmsman's orders: levels held for 10 to 90 s, now and then a pause."""

    def held(low: float, high: float) -> np.ndarray:
        rows = []
        for _ in range(batches):
            count = samples
            lengths = rng.integers(max(1, round(10 / step_s)), max(3, round(90 / step_s)), count)
            rows.append(np.repeat(rng.uniform(low, high, count), lengths)[:count])
        return np.array(rows)

    if ship == "tug":
        speed = held(4, 12)
        one, two = held(-0.9, 0.9), held(-0.9, 0.9)
        return np.stack([speed, one, np.clip(speed + held(-2, 2), 1, 14), two], axis=-1)
    if ship == "barge":
        return np.stack([held(6, 20), held(-6, 6), held(-60, 60)], axis=-1)
    return np.stack([held(2.5, 6.0), held(-0.6, 0.6)], axis=-1)


def zigzags(ship: str, batches: int, samples: int, step_s: float, rng: np.random.Generator) -> np.ndarray:
    """(batches, samples, m) square waves of the steering inputs; the driving ones change two or three times a run."""
    time = np.arange(samples) * step_s
    period, phase = rng.uniform(30, 90, (3, batches, 1)), rng.uniform(0, 1, (3, batches, 1))
    swing = np.sign(np.sin(2 * np.pi * (time / period + phase))) * rng.uniform(0.4, 1.0, (3, batches, 1))
    levels = rng.uniform(0, 1, (batches, 3))
    drive = levels[np.arange(batches)[:, None], np.minimum((3 * np.arange(samples)) // samples, 2)[None]]
    if ship == "tug":
        return np.stack([5 + 6 * drive, 0.8 * swing[0], 5 + 6 * drive + swing[2], 0.8 * swing[1]], axis=-1)
    if ship == "barge":
        return np.stack([7 + 12 * drive, 6 * swing[0], 60 * swing[1]], axis=-1)
    return np.stack([3 + 2.8 * drive, 0.55 * swing[0]], axis=-1)


MANOEUVRES = {"helmsman": commands, "zigzag": zigzags}


def depths(batches: int, samples: int, step_s: float, rng: np.random.Generator) -> np.ndarray:
    """(batches, samples) water depth along the tracks [m]: a bottom that undulates between 4 and 15 m or so."""
    time = np.arange(samples) * step_s
    waves = np.sin(2 * np.pi * (time / rng.uniform(150, 600, (batches, 1)) + rng.uniform(0, 1, (batches, 1))))
    return np.exp(np.log(8.0) + 0.65 * waves)


def sail(trials: list[Trial], orders: np.ndarray, step_s: float, weather: Weather, rng: np.random.Generator,
         depth: np.ndarray | None = None) -> dict[str, np.ndarray]:  # fmt: skip
    """True motion of every trial and batch.

    Args:
        trials: n, all of one ship.
        orders: (n, b, k, m).
        depth: (n, b, k) water depth, or None for deep water.

    Effects: gain, kappa, asymmetry (yaw moment per ahead force), angle_offset (all azimuths or the rudder),
    rudder_scale, lag_s, delay_s, deadband, load_u load_v load_r, shallow_damping shallow_inertia
    (times draught/depth, draught 2.5 m), bank_sway bank_yaw (accelerations at a bank 100 m to the east, half as much
    every 70 m before it), roll_period_s roll_damping roll_sway roll_yaw, change_s (batches laid end to
    end) with change_gain change_damping, and any name of TERMS. lag and delay act on the inputs named by `acts_on`,
    the dead band on those named by `dead_on` (bit masks).
    """
    ship = trials[0].ship
    n, b, k, m = orders.shape
    e = {name: np.array([t.effects.get(name, 0.0) for t in trials])[:, None] for name in EFFECTS}
    th = {name: np.array([t.parameters[name] for t in trials])[:, None] for name in SHIPS[ship]}
    present = frozenset(name for name, values in e.items() if values.any())
    mask, small = (  # (n, 1, m)
        np.stack([(e[name].astype(int) >> j) & 1 for j in range(m)], axis=-1).astype(bool)
        for name in ("acts_on", "dead_on")
    )
    h = step_s / SUBSTEPS
    delay = np.where(mask, e["delay_s"][..., None], 0.0) * np.ones((n, b, 1))
    delayed = delay.any()
    lag = np.where(mask, e["lag_s"][..., None], 0.0)
    fade = np.where(lag > 0, np.exp(-h / np.maximum(lag, 1e-9)), 0.0)
    mean_c = np.array([t.current for t in trials]).T[:, :, None]
    mean_w = np.array([t.wind for t in trials]).T[:, :, None]
    vary_c, vary_w = (rng.standard_normal((2, 1, b)) * s for s in (weather.current_std, weather.wind_std))
    psi0 = rng.uniform(-np.pi, np.pi, (1, b)) * np.ones((n, 1))
    u0 = {"tug": 1.8, "barge": 1.9, "coaster": 3.0}[ship] * rng.uniform(0.7, 1.1, (1, b)) * np.ones((n, 1))
    x = np.zeros((8, n, b))
    x[2:4] = psi0, u0
    steps = k * SUBSTEPS
    white = np.moveaxis(rng.standard_normal((steps, 2, 2, 1, b)), 1, 0)
    current, wind = (
        mean + _gauss_markov(first, std, np.exp(-h / time_s), noise)
        for mean, first, std, time_s, noise in (
            (mean_c, vary_c, weather.current_std, weather.current_time_s, white[0]),
            (mean_w, vary_w, weather.wind_std, weather.wind_time_s, white[1]),
        )
    )  # (t, 2, n, b)
    of_sample, of_part = np.divmod(np.arange(steps), SUBSTEPS)
    time_s = of_sample * step_s + of_part * h
    if delayed:
        index = np.floor((time_s[:, None, None, None] - delay + 1e-9) / step_s).astype(int)
        rows = np.arange(n)[:, None, None], np.arange(b)[None, :, None], np.arange(m)[None, None, :]
        order = orders[rows[0], rows[1], np.clip(index, 0, k - 1), rows[2]]
    else:
        order = np.moveaxis(orders, 2, 0)[of_sample]
    order = np.where(small & (np.abs(order) < e["deadband"][..., None]), 0.0, order)  # (t, n, b, m)
    held, acting = orders[:, :, 0], np.empty_like(order)
    for number, one in enumerate(order if lag.any() else ()):
        acting[number] = one + (held - one) * (lag / h) * (1 - fade)  # mean over the step
        held = one + (held - one) * fade
    if not lag.any():
        acting = order
    shoal = np.zeros((steps, n, b)) if depth is None else 2.5 / np.moveaxis(depth, 2, 0)[of_sample]
    after = (time_s[:, None, None] + k * step_s * np.arange(b) >= e["change_s"]) & (e["change_s"] > 0)
    constants = np.stack([np.broadcast_to(v, (n, b)) for v in (*th.values(), *e.values())])
    given = (
        np.moveaxis(acting, -1, 1),
        shoal[:, None],
        np.broadcast_to(after[:, None], (steps, 1, n, b)),
        current,
        wind,
    )
    whole = runge_kutta(ship, present, h).map(n * b).mapaccum(steps)
    acting, *sea = (np.moveaxis(values, 1, 0).reshape(values.shape[1], -1) for values in given)
    moved = whole(x.reshape(8, -1), acting, np.tile(constants.reshape(len(constants), -1), steps), *sea)
    moved = np.concatenate([x[:, None], np.array(moved).reshape(8, steps, n, b)[:, :-1]], axis=1)
    at = np.moveaxis(moved[:, ::SUBSTEPS], 1, -1)  # (8, n, b, k)
    c, s, wind = np.cos(at[2]), np.sin(at[2]), np.moveaxis(wind[::SUBSTEPS], 0, -1)
    return dict(zip(("north", "east", "heading", "u", "v", "r"), at, strict=False)) | {
        "u_q": at[3] - (c * wind[0] + s * wind[1]),
        "v_q": at[4] - (c * wind[1] - s * wind[0]),
    }


EFFECTS = (
    "gain", "kappa", "asymmetry", "angle_offset", "rudder_scale", "lag_s", "delay_s", "deadband", "acts_on", "dead_on",
    "load_u", "load_v", "load_r", "shallow_damping", "shallow_inertia", "bank_sway",
    "bank_yaw", "roll_period_s", "roll_damping", "roll_sway",
    "roll_yaw", "change_s", "change_gain", "change_damping", *(name for name in TERMS),
)  # fmt: skip


def _gauss_markov(first: np.ndarray, std: float, fade: float, white: np.ndarray) -> np.ndarray:
    """(t, ...) of the first value and of white noise (t, ...), the last of which is left."""
    driven = np.concatenate([first[None], std * np.sqrt(1 - fade**2) * white[:-1]])
    return lfilter([1.0], [1.0, -fade], driven, axis=0)


@cache
def runge_kutta(ship: str, present: frozenset[str], h: float) -> ca.Function:
    """A step of one trial and batch, compiled: (x, acting, constants, shoal, after, current, wind) to the next x."""
    names = ("x", "acting", "constants", "shoal", "after", "current", "wind")
    sizes = (8, len(INPUTS[ship]), len(SHIPS[ship]) + len(EFFECTS), 1, 1, 2, 2)
    given = [ca.SX.sym(name, size) for name, size in zip(names, sizes, strict=True)]
    x, acting, constants, *sea = given
    values = ca.vertsplit(constants)
    th, e = dict(zip(SHIPS[ship], values, strict=False)), dict(zip(EFFECTS, values[len(SHIPS[ship]) :], strict=True))

    def rates(state: ca.SX) -> ca.SX:
        return ca.vertcat(*_rates(ship, ca.vertsplit(state), ca.vertsplit(acting), th, e, present, *sea))

    k1 = rates(x)
    k2 = rates(x + h / 2 * k1)
    k3 = rates(x + h / 2 * k2)
    after = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3))
    kept = ca.fmax(ca.fmin(after[3:], MOST), -MOST)  # ships made unstable, which nobody looks at any further
    return ca.Function("step", given, [ca.vertcat(after[:3], kept)])


def _rates(ship, x, acting, th, e, present, shoal, after, current, wind):
    _, _, psi, u, v, r, phi, p = x
    c, s = ca.cos(psi), ca.sin(psi)
    ur, vr = u - (c * current[0] + s * current[1]), v - (c * current[1] - s * current[0])
    gain, damp, heavy = 1 + e["gain"], 1 + e["shallow_damping"] * shoal, 1 + e["shallow_inertia"] * shoal
    if "change_s" in present:
        gain = gain * (1 + after * e["change_gain"])
        damp = (1 + after * e["change_damping"]) * damp
    if ship == "coaster":
        n, rudder = acting[0], (1 + e["rudder_scale"]) * acting[1] + e["angle_offset"]
        push, side, turn = ca.fabs(n) * n, ur * ca.fabs(ur) * rudder, ur * ca.fabs(ur) * rudder
        fx = th["X_nn"] * push + th["X_dd"] * ur * ca.fabs(ur) * rudder * rudder
        fy, fn = th["Y_rud"] * side, th["N_rud"] * turn
        kx = e["kappa"] * ur * push
        fn = fn + e["asymmetry"] * push
    else:
        if ship == "tug":
            n1, a1, n2, a2 = acting
            a1, a2 = a1 + e["angle_offset"], a2 + e["angle_offset"]
            tx, ty = n1 * ca.cos(a1) + n2 * ca.cos(a2), n1 * ca.sin(a1) + n2 * ca.sin(a2)
            tn = 9 * n1 * ca.sin(a1) - 9 * n2 * ca.sin(a2)
        else:
            tx, ty, tn = acting
        tn = tn + e["asymmetry"] * tx
        fx, fy, fn = th["X_mu"] * tx, th["Y_mu"] * ty, th["N_mu"] * tn
        kx = (th.get("X_kappa", 0.0) + e["kappa"]) * ur * tx
    if ship == "tug":
        uq, vq = u - (c * wind[0] + s * wind[1]), v - (c * wind[1] - s * wind[0])
        fx = fx + th["W_abs_u_u"] * ca.fabs(uq) * uq
        fy = fy + th["W_abs_v_v"] * ca.fabs(vq) * vq
        fn = fn + th["W_uv"] * uq * vq
    dx = th["X_u"] * ur + th["X_abs_u_u"] * ca.fabs(ur) * ur
    dy = th["Y_v"] * vr + th.get("Y_abs_v_v", 0.0) * ca.fabs(vr) * vr + th.get("Y_abs_v_r", 0.0) * ca.fabs(vr) * r
    dn = th["N_r"] * r + th.get("N_abs_v_v", 0.0) * ca.fabs(vr) * vr + th.get("N_abs_v_r", 0.0) * ca.fabs(vr) * r
    dn = dn + th["N_uv"] * ur * vr
    extra = {"X": 0.0, "Y": 0.0, "N": 0.0}
    for name, term in TERMS.items():
        if name in present:
            extra[name[0]] = extra[name[0]] + e[name] * term(ur, vr, r)
    if present & {"bank_sway", "bank_yaw"}:
        near = ca.exp(-ca.fmax(100.0 - x[1], 0.0) / 100.0)
        extra["Y"], extra["N"] = extra["Y"] + e["bank_sway"] * near, extra["N"] + e["bank_yaw"] * near
    du = th["X_vr"] * vr * r + (damp * dx + gain * (fx + kx) + extra["X"]) / (1 + e["load_u"]) / heavy
    dv = th["Y_ur"] * ur * r + (damp * dy + gain * fy + extra["Y"]) / (1 + e["load_v"]) / heavy
    dr = (damp * dn + gain * fn + extra["N"]) / (1 + e["load_r"]) / heavy
    du, dv = du + r * (v - vr), dv - r * (u - ur)  # velocities over ground: the water's turn in the ship's axes
    if "roll_period_s" not in present:
        return u * c - v * s, u * s + v * c, r, du, dv, dr, p, 0.0
    on = e["roll_period_s"] > 0
    w0 = 2 * np.pi / ca.if_else(on, e["roll_period_s"], 1.0)
    side = dv + u * r  # the hull leans against the acceleration of the water it pushes
    dp = on * (-2 * e["roll_damping"] * w0 * p - w0**2 * phi + w0**2 * side)
    dv, dr = dv + e["roll_sway"] * phi, dr + e["roll_yaw"] * phi
    return u * c - v * s, u * s + v * c, r, du, dv, dr, p, dp


def measure(true: dict[str, np.ndarray], step_s: float, sensors: Sensors, rng: np.random.Generator,
            faults: list[dict[str, float]]) -> dict[str, np.ndarray]:  # fmt: skip
    """What the instruments record, (n, b, k) by column name.

    Faults: heading_bias (v_meas = v + u sin(bias)), lever_m (antenna and velocity sensor this far forward of the
    origin: v_meas = v + lever r), gyro and gyro_bias (r_meas = (1 + gyro) r + gyro_bias), late_u,
    late_v, late_r (seconds).
    """

    def of(name: str) -> np.ndarray:
        return np.array([fault.get(name, 0.0) for fault in faults])[:, None, None]

    def noisy(values: np.ndarray, std: float) -> np.ndarray:
        return values + std * rng.standard_normal((1, *values.shape[1:]))

    lever = of("lever_m")
    u, v, r = true["u"], true["v"] + lever * true["r"], true["r"]
    bias = of("heading_bias")
    u, v = u * np.cos(bias) - v * np.sin(bias), v * np.cos(bias) + u * np.sin(bias)
    u, v = (late(values, of(f"late_{name}"), step_s) for name, values in (("u", u), ("v", v)))
    heading = true["heading"] - bias
    return {
        "north_m": noisy(true["north"] + lever * np.cos(true["heading"]), sensors.position),
        "east_m": noisy(true["east"] + lever * np.sin(true["heading"]), sensors.position),
        "heading_rad": noisy(heading, sensors.heading),
        "u_mps": noisy(u, sensors.velocity),
        "v_mps": noisy(v, sensors.velocity),
        "r_radps": noisy(late((1 + of("gyro")) * r + of("gyro_bias"), of("late_r"), step_s), sensors.yaw_rate),
        "wind_u_mps": noisy(true["u_q"], sensors.wind),
        "wind_v_mps": noisy(true["v_q"], sensors.wind),
    }


def late(values: np.ndarray, delay_s: np.ndarray, step_s: float) -> np.ndarray:
    """(n, b, k) the same, late by (n, 1, 1) seconds, straight between samples."""
    k = values.shape[-1]
    place = np.clip(np.arange(k) - delay_s / step_s, 0, k - 1) * np.ones_like(values)
    low = np.floor(place).astype(int)
    high = np.minimum(low + 1, k - 1)
    share = place - low
    return np.take_along_axis(values, low, -1) * (1 - share) + np.take_along_axis(values, high, -1) * share
