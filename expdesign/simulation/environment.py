"""Current and wind: constant means in the n-frame with a stated standard deviation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Environment:
    """Forecast for the trial.

    Attributes:
        current_to: (2,) mean current, velocity to north/east [m/s].
        current_std_mps: standard deviation of each component [m/s].
        wind_to: (2,) mean wind, velocity to north/east [m/s].
        wind_std_mps: standard deviation of each component [m/s].
    """

    current_to: Array = field(default_factory=lambda: np.zeros(2))
    wind_to: Array = field(default_factory=lambda: np.zeros(2))
    current_std_mps: float = 0.0
    wind_std_mps: float = 0.0

    def __post_init__(self) -> None:
        seal(self, current_to="2", wind_to="2")

    @property
    def isotropic(self) -> bool:
        """True when no mean current or wind singles out a heading."""
        return not (self.current_to.any() or self.wind_to.any())


CALM = Environment()
