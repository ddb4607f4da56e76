"""Hull of the naval vessel: inertia, and hydrodynamic forces as functions of velocity and roll."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from expdesign.values import Array

WATER, GRAVITY, DISPLACED_M3, GM_M = 1025.0, 9.82, 350.0, 0.776
WEIGHT = WATER * GRAVITY * DISPLACED_M3

ADDED = {
    ("u", "u"): -17400.0, ("v", "v"): -0.393e6, ("v", "p"): -0.296e6, ("v", "r"): -1.4e6, ("p", "v"): 0.296e6,
    ("p", "p"): -0.774e6, ("r", "v"): 0.538e6, ("r", "r"): -28.7e6,
}  # fmt: skip
"""Force in an equation per acceleration: X_udot and so on, SI."""
COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    "u": {"u|u|": -1960.0, "vr": 0.33 * 359e3},
    "v": {
        "|u|v": -11800.0, "ur": 0.131e6, "v|v|": -3700.0, "v|r|": -0.794e6, "r|v|": -0.182e6, "phi|uv|": 10800.0,
        "phi|ur|": 0.251e6, "phi uu": -74.0,
    },
    "p": {
        "|u|v": 9260.0, "ur": -0.102e6, "v|v|": 29300.0, "v|r|": 0.621e6, "r|v|": 0.142e6, "phi|uv|": -8400.0,
        "phi|ur|": -0.196e6, "phi uu": -1180.0, "|u|p": -15500.0, "p|p|": -0.416e6, "p": -0.5e6,
        "phi": -GM_M * WEIGHT, "phi^3": -0.325 * WEIGHT,
    },
    "r": {
        "|u|v": -92000.0, "|u|r": -4.71e6, "r|r|": -202e6, "r|v|": -15.6e6, "phi|uv|": -0.214e6, "phi u|r|": -4.98e6,
        "phi u|u|": -8000.0,
    },
}  # fmt: skip
"""Equation -> term -> coefficient, SI."""


def terms(u: Any, v: Any, p: Any, r: Any, phi: Any) -> dict[str, Any]:
    """Every product that a coefficient multiplies."""
    au, av, ar = np.abs(u), np.abs(v), np.abs(r)
    return {
        "u|u|": u * au, "vr": v * r, "|u|v": au * v, "ur": u * r, "v|v|": v * av, "v|r|": v * ar, "r|v|": r * av,
        "|u|r": au * r, "r|r|": r * ar, "phi|uv|": phi * au * av, "phi|ur|": phi * au * ar, "phi uu": phi * u * u,
        "phi u|r|": phi * u * ar, "phi u|u|": phi * u * au, "|u|p": au * p, "p|p|": p * np.abs(p), "p": p, "phi": phi,
        "phi^3": phi**3,
    }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Hull:
    """Inertia and coefficients.

    Attributes:
        mass_kg: m.
        roll_inertia_kgm2, yaw_inertia_kgm2: I_x, I_z.
        forward_m, down_m: centre of gravity x_g, z_g [m].
        coefficients: as `COEFFICIENTS`.
    """

    mass_kg: float = 359e3
    roll_inertia_kgm2: float = 3.4e6
    yaw_inertia_kgm2: float = 33.7e6
    forward_m: float = -3.38
    down_m: float = -1.75
    coefficients: Mapping[str, Mapping[str, float]] = field(default_factory=lambda: COEFFICIENTS)

    @property
    def inertia(self) -> Array:
        """(4, 4) rigid body and added, for (u, v, p, r)."""
        m, x, z = self.mass_kg, self.forward_m, self.down_m
        rigid = np.array(
            [
                [m, 0, 0, 0],
                [0, m, -m * z, m * x],
                [0, -m * z, self.roll_inertia_kgm2, 0],
                [0, m * x, 0, self.yaw_inertia_kgm2],
            ]
        )
        added = np.array([[ADDED.get((row, column), 0.0) for column in "uvpr"] for row in "uvpr"])
        return np.asarray(rigid - added)

    def forces(self, u: Any, v: Any, p: Any, r: Any, phi: Any) -> list[Any]:
        """Hydrodynamic, restoring and Coriolis forces in (u, v, p, r), all but those of the drives [N, N, Nm, Nm]."""
        values = terms(u, v, p, r, phi)
        m, x, z = self.mass_kg, self.forward_m, self.down_m
        coriolis = (m * r * (-v + z * p - x * r), m * r * u, -m * z * r * u, m * x * r * u)
        return [
            sum(coefficient * values[name] for name, coefficient in self.coefficients[equation].items()) - turning
            for equation, turning in zip("uvpr", coriolis, strict=True)
        ]


NOMINAL = Hull()
