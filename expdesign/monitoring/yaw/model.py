"""Yaw models: the fourth row of the ship's equations, with what cannot be told apart put together.

    I_r dr/dt = -M_v dv/dt + A u r + N_rr r|r| + N_rv r|v| + N_phiur phi u|r|
                + N_uv |u|v + N_phiuv phi|uv| + N_phiuu phi u|u| + tau

I_r is inertia with added inertia, M_v the coupling to sway, A holds damping |u|r and the Coriolis moment, which are one
where u >= 0; the model named separate has both, for voyages that go ahead and astern. The simplified model leaves out
roll and the sway acceleration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.values import Array, seal

INPUTS = ("sway_acceleration", "u", "v", "phi", "moment")


@dataclass(frozen=True, kw_only=True, eq=False)
class YawData:
    """Measured signals of n voyages, (n, k) each.

    Attributes:
        sample_time_s: time between samples [s].
        r: yaw rate [rad/s].
        sway_acceleration: dv/dt [m/s2].
        u, v: surge and sway speed [m/s].
        phi: roll [rad].
        moment: yaw moment of the drives [Nm].
    """

    sample_time_s: float
    r: Array
    sway_acceleration: Array
    u: Array
    v: Array
    phi: Array
    moment: Array

    def __post_init__(self) -> None:
        seal(self, **dict.fromkeys(("r", *INPUTS), "n k"))

    def part(self, samples: slice) -> YawData:
        """Consecutive samples."""
        return YawData(
            sample_time_s=self.sample_time_s, **{name: getattr(self, name)[:, samples] for name in ("r", *INPUTS)}
        )


@dataclass(frozen=True)
class YawModel:
    """A structure.

    Attributes:
        name: "full", "separate" or "simplified".
        parameters: names, the inertia first; SI.
        damping: those that cannot be positive.
    """

    name: str
    parameters: tuple[str, ...]
    damping: tuple[str, ...] = ("N_rr", "N_rv")

    def shapes(self, data: YawData) -> Array:
        """(4, k, n, p - 1): what every parameter but the inertia multiplies, as multiples of 1, r, |r| and r|r|."""
        u, v, phi = data.u, data.v, data.phi
        still, one = np.zeros_like(u), np.ones_like(u)
        table = {
            "M_v": (0, -data.sway_acceleration),
            "A": (1, u),
            "N_abs_u_r": (1, np.abs(u)),
            "m_xg": (1, -u),
            "N_rr": (3, one),
            "N_rv": (1, np.abs(v)),
            "N_phiur": (2, phi * u),
            "N_uv": (0, np.abs(u) * v),
            "N_phiuv": (0, phi * np.abs(u * v)),
            "N_phiuu": (0, phi * u * np.abs(u)),
        }
        known = [table[name] for name in self.parameters[1:]]
        columns = [[factor if power == place else still for place, factor in known] for power in range(4)]
        return np.ascontiguousarray(np.moveaxis(np.array(columns), (1, 2, 3), (3, 2, 1)))

    def terms(self, data: YawData) -> Array:
        """(n, k, p - 1): what every parameter but the inertia multiplies, along the measured motion."""
        constant, linear, even, odd = np.moveaxis(self.shapes(data), (1, 2), (2, 1))
        r = data.r[..., None]
        return np.asarray(constant + linear * r + (even + odd * r) * np.abs(r))


YAW_MODELS: Mapping[str, YawModel] = {
    model.name: model
    for model in (
        YawModel("full", ("I_r", "M_v", "A", "N_rr", "N_rv", "N_phiur", "N_uv", "N_phiuv", "N_phiuu")),
        YawModel("separate", ("I_r", "M_v", "N_abs_u_r", "m_xg", "N_rr", "N_rv", "N_uv")),
        YawModel("simplified", ("I_r", "A", "N_rr", "N_rv", "N_uv")),
    )
}
WORDS: Mapping[str, str] = {
    "I_r": "inertia in yaw", "M_v": "coupling to sway acceleration", "A": "damping and Coriolis moment",
    "N_rr": "damping by yaw", "N_rv": "damping by yaw and drift", "N_phiur": "moment of roll in turns",
    "N_uv": "moment of drift", "N_phiuv": "moment of roll and drift", "N_phiuu": "moment of roll at speed",
    "N_abs_u_r": "damping", "m_xg": "Coriolis moment",
}  # fmt: skip
"""Parameters in words."""


def term_budget(model: YawModel, data: YawData, parameters: Mapping[str, float]) -> dict[str, Array]:
    """Parameter -> (n, k) moment of its term [Nm] along the measured motion."""
    values = model.terms(data)
    return {name: parameters[name] * values[..., place] for place, name in enumerate(model.parameters[1:])}
