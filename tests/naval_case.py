"""Voyages of the naval vessel and noisy measurements of them, for tests and benchmarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy

from expdesign.monitoring.yaw import YawData
from naval_ship import NOMINAL, Hull, Voyage, sail, sail_many

NOISE = {"r": 0.0025, "sway_acceleration": 0.015, "u": 0.15, "v": 0.15, "phi": 0.025, "moment": 5e4}
STEP_S = 0.1


def low_passed(values: np.ndarray, time_s: float, step_s: float = STEP_S) -> np.ndarray:
    """A first-order lag of orders."""
    keep = float(np.exp(-step_s / time_s))
    return np.asarray(scipy.signal.lfilter([1.0 - keep], [1.0, -keep], values))


def turn(hull: Hull = NOMINAL) -> Voyage:
    """Full ahead from rest, then pods at -10 degrees for 50 s."""
    time_s = STEP_S * np.arange(1501)
    angle = np.where((time_s >= 50.0) & (time_s < 100.0), -np.deg2rad(10.0), 0.0)
    return sail(hull, low_passed(angle, 2.0), np.full(len(time_s), 80.0), sample_time_s=STEP_S)


def rotation(hull: Hull = NOMINAL, *, ahead: float = 0.0) -> Voyage:
    """On the spot: pods across, thrust from 10 to 50 s; perhaps with some speed ahead at first [m/s]."""
    time_s = STEP_S * np.arange(1001)
    speed = np.where((time_s >= 10.0) & (time_s < 50.0), 80.0, 0.0)
    start = np.array([ahead, 0.0, 0.0, 0.0, 0.0, 0.0])
    return sail(hull, np.full(len(time_s), np.deg2rad(90.0)), speed, sample_time_s=STEP_S, start=start)


@dataclass(frozen=True)
class Orders:
    """How a voyage is ordered: angles within a bound, speeds between two, both held for a while, with a lag."""

    angle_deg: float = 35.0
    speed_rps: tuple[float, float] = (30.0, 80.0)
    held_s: tuple[float, float] = (12.0, 40.0)
    lag_s: float = 3.0


CALM, BRISK = Orders(), Orders(angle_deg=60.0, speed_rps=(20.0, 80.0), held_s=(5.0, 20.0), lag_s=1.0)


def harbour_orders(
    seconds: float, seed: int, step_s: float = STEP_S, how: Orders = CALM
) -> tuple[np.ndarray, np.ndarray]:
    """Pod angles [rad] and speeds [1/s] of a voyage."""
    rng = np.random.default_rng(seed)
    count = round(seconds / step_s)
    angle, speed, row = np.zeros(count), np.zeros(count), 0
    while row < count:
        held = round(rng.uniform(*how.held_s) / step_s)
        angle[row : row + held] = np.deg2rad(rng.uniform(-how.angle_deg, how.angle_deg))
        speed[row : row + held] = rng.uniform(*how.speed_rps)
        row += held
    return low_passed(angle, how.lag_s, step_s), low_passed(speed, how.lag_s, step_s)


def fleet(
    hull: Hull, how: Orders, *, count: int, seed: int, seconds: float = 500.0, step_s: float = STEP_S
) -> tuple[Voyage, ...]:
    """Voyages with orders of their own, side by side."""
    rows = [harbour_orders(seconds, seed + number, step_s, how) for number in range(count)]
    angle, speed = (np.stack(column) for column in zip(*rows, strict=True))
    return sail_many(hull, angle, speed, sample_time_s=step_s)


def harbour(hull: Hull = NOMINAL, *, seconds: float = 600.0, seed: int = 0, step_s: float = STEP_S) -> Voyage:
    """A voyage by such orders."""
    return sail(hull, *harbour_orders(seconds, seed, step_s), sample_time_s=step_s)


def heavier(*, inertia: float = 1.0, mass: float = 1.0) -> Hull:
    """More moment of inertia or mass."""
    return replace(NOMINAL, yaw_inertia_kgm2=inertia * NOMINAL.yaw_inertia_kgm2, mass_kg=mass * NOMINAL.mass_kg)


def exact(voyage: Voyage) -> YawData:
    """Measured without noise."""
    return measured(voyage, count=1, seed=0, noise=0.0)


def measured(
    voyage: Voyage, *, count: int, seed: int, noise: float = 1.0, averaged: int = 5, every: int = 1
) -> YawData:
    """The same voyage measured so often, with the noise of the thesis averaged over some samples, every so manieth."""
    rng = np.random.default_rng(seed)
    true = {
        "r": voyage.column("r"), "sway_acceleration": voyage.sway_acceleration, "u": voyage.column("u"),
        "v": voyage.column("v"), "phi": voyage.column("phi"), "moment": voyage.moment,
    }  # fmt: skip
    told = {}
    for name, values in true.items():
        drawn = NOISE[name] * rng.standard_normal((count, len(values) + averaged - 1))
        mean = np.lib.stride_tricks.sliding_window_view(drawn, averaged, axis=1).mean(axis=2)
        told[name] = (values + noise * mean)[:, ::every]
    return YawData(sample_time_s=every * voyage.sample_time_s, **told)


def measured_fleet(voyages: Sequence[Voyage], *, seed: int, averaged: int, every: int = 1) -> YawData:
    """Each voyage measured once, with noise of its own."""
    parts = [
        measured(one, count=1, seed=seed + number, averaged=averaged, every=every) for number, one in enumerate(voyages)
    ]
    return YawData(
        sample_time_s=parts[0].sample_time_s,
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in NOISE},
    )


COLUMNS = {
    "r": "r_radps", "sway_acceleration": "sway_acceleration_mps2", "u": "u_mps", "v": "v_mps", "phi": "roll_rad",
    "moment": "actuator_psi_nm",
}  # fmt: skip
SHIP = """[vessel]
name = "naval"
length_m = 51.5
beam_m = 8.6
draught_m = 2.3
sample_time_s = 0.5

[[actuators]]
kind = "podded"
forward_m = -23.5
speed_min_rps = 0.0
speed_max_rps = 80.0
angle_min_rad = -1.6
angle_max_rad = 1.6

[model]
structure = "manoeuvring-10"
form = "continuous"

[model.parameters]
X_u = -0.01
X_abs_u_u = -0.005
X_vr = 1.3
X_mu = 8e-5
Y_v = -0.15
Y_ur = -0.4
Y_mu = 4e-5
N_r = -0.5
N_uv = -0.002
N_mu = 5e-7
"""


def naval_csvs(paths: Sequence[Path], hull: Hull = NOMINAL, *, seconds: float, seed: int) -> None:
    """Harbour manoeuvring as measured data at 2 Hz, with the noise of the thesis averaged over 0.5 s."""
    step_s = 0.5
    orders = [harbour_orders(seconds, seed + number, step_s) for number in range(len(paths))]
    angle, speed = (np.stack(rows) for rows in zip(*orders, strict=True))
    for number, voyage in enumerate(sail_many(hull, angle, speed, sample_time_s=step_s)):
        data = measured(voyage, count=1, seed=seed + number, noise=(STEP_S / step_s) ** 0.5, averaged=1)
        table = {"time_s": step_s * np.arange(angle.shape[1]), "n1_rps": speed[number], "a1_rad": angle[number]}
        table |= {column: getattr(data, name)[0] for name, column in COLUMNS.items()}
        rows = np.column_stack(list(table.values()))
        np.savetxt(paths[number], rows, delimiter=",", header=",".join(table), comments="", fmt="%.7g")
