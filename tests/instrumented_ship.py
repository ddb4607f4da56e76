"""A ship of 50 m by plain NumPy, many voyages at once, as her instruments show them: nothing of the package is used.

    du = -0.004 |u|u + 0.008 |n|n + 1.2 v r      dv = -0.02 |u|v - 0.3 u r      dr = -0.02 |u|r + 0.0005 |u|u sin(d)

through water that flows steadily, with gusts that push and turn her; d is the rudder angle reached. White noise:
position 0.3 m, heading 0.003 rad, velocity over ground 0.02 m/s, yaw rate 0.001 rad/s.
"""

from functools import cache
from pathlib import Path

import numpy as np

LENGTH_M, STEP_S = 50.0, 0.2
NAMES = ("time_s", "north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps", "n1_rps", "rudder1_rad")
POSE = (*NAMES[:4], *NAMES[7:])
NOISE = np.array([0.3, 0.3, 0.003, 0.02, 0.02, 0.001])
KINDS = ("zigzag", "circle", "random", "straight", "courses")

Log = dict[str, np.ndarray]

HEAD = f"""[vessel]
name = "fifty"
length_m = {LENGTH_M}
beam_m = 9.0
draught_m = 3.0
sample_time_s = 1.0
[[actuators]]
kind = "propeller"
forward_m = -23.0
speed_min_rps = -3.0
speed_max_rps = 4.0
[[actuators]]
kind = "rudder"
forward_m = -24.0
angle_min_rad = -0.6109
angle_max_rad = 0.6109
[model]
structure = "custom"
form = "continuous"
"""
TERMS = {
    "X_uu": ("u", "abs(u)*u", -0.004),
    "X_nn": ("u", "abs(n1)*n1", 0.008),
    "X_vr": ("u", "v*r", 1.2),
    "Y_uv": ("v", "abs(u)*v", -0.02),
    "Y_ur": ("v", "u*r", -0.3),
    "N_ur": ("r", "abs(u)*r", -0.02),
    "N_ud": ("r", "abs(u)*u*sin(rudder1)", 0.0005),
}
SENSORS = "[sensors]\nposition_m = 0.3\nheading_rad = 0.003\nvelocity_mps = 0.02\nyaw_rate_radps = 0.001\n"


def write_vessel(path: Path, *, off: float = 1.0, more: str = "") -> Path:
    """The vessel file, with parameters that are off by a factor and more sensor keys."""
    terms = "".join(
        f'[[model.terms]]\nequation = "{equation}"\nname = "{name}"\nexpression = "{expression}"\n'
        for name, (equation, expression, _) in TERMS.items()
    )
    values = "".join(f"{name} = {off * value:.8g}\n" for name, (_, _, value) in TERMS.items())
    std = "".join(f"{name} = {abs(0.4 * value):.8g}\n" for name, (_, _, value) in TERMS.items())
    path.write_text(f"{HEAD}{terms}[model.parameters]\n{values}[model.parameter_std]\n{std}{SENSORS}{more}")
    return path


def voyages(
    count: int, kind: str, *, seed: int = 0, sample_s: float = 1.0, last_s: float = 400.0, gust: float = 1.0,
    current_mps: float = 0.3, noise: float = 1.0,
) -> list[Log]:  # fmt: skip
    """Voyages of one kind, each with its own heading, current, gusts, helm and noise."""
    table = _sailed(count, kind, seed, sample_s, last_s, gust, current_mps, noise)
    return [dict(zip(NAMES, table[:, :, i].T, strict=True)) for i in range(count)]


@cache
def _sailed(
    count: int, kind: str, seed: int, sample_s: float, last_s: float, gust: float, current_mps: float, noise: float
) -> np.ndarray:
    """(k, channels, count) of all voyages: many tests spoil the same."""
    rng = np.random.default_rng(seed)
    x = np.zeros((6, count))
    x[2], x[3] = rng.uniform(-3.0, 3.0, count), 4.2
    course, side, helm = x[2].copy(), rng.choice([-1.0, 1.0], count), np.radians(rng.uniform(8, 22, count))
    stream = current_mps * rng.standard_normal((2, count)) / np.sqrt(2.0)
    push, order, rudder, due = np.zeros((3, count)), np.zeros(count), np.zeros(count), np.full(count, 30.0)
    sizes = gust * np.sqrt(2.0 / 20.0) * np.array([[0.02], [0.02], [0.0008]])
    every, rows = round(sample_s / STEP_S), []
    for k in range(round(last_s / STEP_S)):
        if kind == "zigzag" and k * STEP_S >= 30:
            order = np.where(order == 0, side * helm, order)
            order = np.where(np.abs(x[2] - course) > helm, -np.sign(x[2] - course) * helm, order)
        elif kind == "circle" and k * STEP_S >= 30:
            order = side * 0.44
        elif kind in ("random", "courses"):
            over = k * STEP_S >= due
            due = due + over * rng.uniform(*((8, 40) if kind == "random" else (80, 100)), count)
            drawn = rng.uniform(-0.5, 0.5, count)
            order = np.where(over, drawn, order) if kind == "random" else order
            course = course + over * 1.6 * drawn
            if kind == "courses":
                order = np.clip(course - x[2] - 8.0 * x[5], -0.6, 0.6)
        rudder = rudder + np.clip(order - rudder, -0.05 * STEP_S, 0.05 * STEP_S)
        push = push * (1.0 - STEP_S / 20.0) + np.sqrt(STEP_S) * sizes * rng.standard_normal((3, count))
        if k % every == 0:
            c, s = np.cos(x[2]), np.sin(x[2])
            ground = np.stack([x[3] + c * stream[0] + s * stream[1], x[4] - s * stream[0] + c * stream[1], x[5]])
            seen = np.concatenate([x[:3], ground]) + noise * NOISE[:, None] * rng.standard_normal((6, count))
            rows.append(np.concatenate([np.full((1, count), k * STEP_S), seen, np.full((1, count), 3.0), rudder[None]]))
        x = _later(x, stream, push, rudder)
    table = np.array(rows)
    table.setflags(write=False)
    return table


def _later(x: np.ndarray, stream: np.ndarray, push: np.ndarray, rudder: np.ndarray) -> np.ndarray:
    """One Runge-Kutta step."""

    def rates(x: np.ndarray) -> np.ndarray:
        u, v, r = x[3:]
        c, s = np.cos(x[2]), np.sin(x[2])
        return np.stack(
            [
                c * u - s * v + stream[0],
                s * u + c * v + stream[1],
                r,
                -0.004 * np.abs(u) * u + 0.008 * 9.0 + 1.2 * v * r + push[0],
                -0.02 * np.abs(u) * v - 0.3 * u * r + push[1],
                -0.02 * np.abs(u) * r + 0.0005 * np.abs(u) * u * np.sin(rudder) + push[2],
            ]
        )

    a = rates(x)
    b = rates(x + STEP_S / 2 * a)
    c = rates(x + STEP_S / 2 * b)
    return x + STEP_S / 6 * (a + 2 * b + 2 * c + rates(x + STEP_S * c))


def write_log(path: Path, log: Log, names: tuple[str, ...] = NAMES) -> Path:
    """Some columns as a file, with nine digits."""
    values = np.column_stack([log[name] for name in names])
    np.savetxt(path, values, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path
