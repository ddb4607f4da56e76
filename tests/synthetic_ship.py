"""A 50 m ship that slews its rudder, integrated by code of its own: an oracle that shares no line with the package.

du = -0.004 |u|u + 0.008 |n|n + 1.2 v r, dv = -0.02 |u|v - 0.3 u r, dr = -0.02 |u|r + 0.0005 |u|u sin(rudder), with
the rudder moving evenly towards its order.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from pathlib import Path

import numpy as np

TRUTH = {"X_uu": -0.004, "X_nn": 0.008, "X_vr": 1.2, "Y_uv": -0.02, "Y_ur": -0.3, "N_ur": -0.02, "N_ud": 0.0005}
NOISE = {"north_m": 0.3, "east_m": 0.3, "heading_rad": 0.003, "u_mps": 0.02, "v_mps": 0.02, "r_radps": 0.001}
TERMS = {
    "X_uu": ("u", "abs(u)*u"), "X_nn": ("u", "abs(n1)*n1"), "X_vr": ("u", "v*r"), "Y_uv": ("v", "abs(u)*v"),
    "Y_ur": ("v", "u*r"), "N_ur": ("r", "abs(u)*r"), "N_ud": ("r", "abs(u)*u*sin(rudder1)"),
}  # fmt: skip
SUBSTEPS = 20


def sail(orders: np.ndarray, *, sample_s: float = 1.0, rate: float = 0.05, **truth: float) -> dict[str, np.ndarray]:
    """Columns (k,) of time, rudder order and reached rudder, n, pose and velocity at the samples.

    Args:
        orders: (k, 2) propeller speed [rps] and rudder order [rad], held.
        sample_s: time between samples [s].
        rate: at which the rudder moves [rad/s].
        truth: other values than `TRUTH`.
    """
    p, step = TRUTH | truth, sample_s / SUBSTEPS

    def slope(x: list[float], n: float, rudder: float) -> list[float]:
        _, _, psi, u, v, r = x
        return [
            u * cos(psi) - v * sin(psi), u * sin(psi) + v * cos(psi), r,
            p["X_uu"] * abs(u) * u + p["X_nn"] * abs(n) * n + p["X_vr"] * v * r,
            p["Y_uv"] * abs(u) * v + p["Y_ur"] * u * r,
            p["N_ur"] * abs(u) * r + p["N_ud"] * abs(u) * u * sin(rudder),
        ]  # fmt: skip

    steady = sqrt(-p["X_nn"] / p["X_uu"]) * float(orders[0, 0])
    x, rudder, rows = [0.0, 0.0, 0.0, steady, 0.0, 0.0], float(orders[0, 1]), []
    for n, order in orders.tolist():
        rows.append([*x, rudder])
        for _ in range(SUBSTEPS):
            middle = rudder + min(max(order - rudder, -rate * step / 2), rate * step / 2)
            half = [a + step / 2 * b for a, b in zip(x, slope(x, n, rudder), strict=True)]
            x = [a + step * b for a, b in zip(x, slope(half, n, middle), strict=True)]
            rudder += min(max(order - rudder, -rate * step), rate * step)
    table = np.array(rows).T
    columns = dict(
        zip(("north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps", "reached"), table, strict=True)
    )
    return {"time_s": sample_s * np.arange(len(orders)), "n1_rps": orders[:, 0], "rudder1_rad": orders[:, 1]} | columns


def trial() -> np.ndarray:
    """(k, 2) orders at 1 Hz of a zig-zag by the clock and a turning circle, at 3 rps and less."""
    angles = np.repeat(
        [0.0, 0.35, -0.35, 0.35, -0.35, 0.0, 0.6, 0.0, -0.17, 0.17], [20, 30, 45, 45, 45, 40, 150, 60, 30, 40]
    )
    speeds = np.repeat([3.0, 2.0, 3.5], [225, 150, 130])
    return np.column_stack([speeds, angles])


def voyage(samples: int, *, seed: int) -> np.ndarray:
    """(samples, 2) orders at 1 Hz that change every half minute to two minutes."""
    rng, rows = np.random.default_rng(seed), list[list[float]]()
    while len(rows) < samples:
        now = [3.0 * rng.uniform(0.7, 1.1), rng.choice([-0.35, -0.17, 0.0, 0.0, 0.0, 0.17, 0.35])]
        rows += [now] * int(rng.integers(20, 120))
    return np.array(rows[:samples])


def write(path: Path, columns: dict[str, np.ndarray], *, seed: int | None = 0, **names: str) -> Path:
    """A file with noise of `NOISE`; None for none. Names give columns another name, or leave one out if it is empty."""
    rng = np.random.default_rng(seed)
    named = {"reached": ""} | names
    table = {
        named.get(name, name): values
        + (rng.normal(0, NOISE[name], len(values)) if seed is not None and name in NOISE else 0)
        for name, values in columns.items()
        if named.get(name, name)
    }
    rows = [",".join(table), *(",".join(f"{value:.9g}" for value in row) for row in np.column_stack([*table.values()]))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def vessel_file(path: Path, *, rate: float | None = 0.05, factor: float = 1.0, extra: str = "") -> Path:
    """Its vessel file; parameters times a factor, whose standard deviations are half of them."""
    terms = "".join(
        f'[[model.terms]]\nequation = "{equation}"\nname = "{name}"\nexpression = "{text}"\n'
        for name, (equation, text) in TERMS.items()
    )
    rows = "".join(f"{name} = {value * factor}\n" for name, value in TRUTH.items())
    std = "".join(f"{name} = {abs(value) / 2}\n" for name, value in TRUTH.items())
    stated = "" if rate is None else f"angle_rate_radps = {rate}\n"
    sensors = "position_m = 0.3\nheading_rad = 0.003\nvelocity_mps = 0.02\nyaw_rate_radps = 0.001\n"
    path.write_text(
        '[vessel]\nname = "synthetic"\nlength_m = 50.0\nbeam_m = 9.0\ndraught_m = 3.0\nsample_time_s = 1.0\n'
        '[[actuators]]\nkind = "propeller"\nforward_m = -23.0\nspeed_min_rps = -3.0\nspeed_max_rps = 4.0\n'
        f'[[actuators]]\nkind = "rudder"\nforward_m = -24.0\nangle_min_rad = -0.6109\nangle_max_rad = 0.6109\n{stated}'
        f'[model]\nstructure = "custom"\nform = "continuous"\n{terms}[model.parameters]\n{rows}'
        f"[model.parameter_std]\n{std}[sensors]\n{sensors}{extra}",
        encoding="utf-8",
    )
    return path
