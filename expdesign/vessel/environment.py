"""Current and wind: means in the n-frame, how well they are known, and how they vary during a trial."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True)
class Variation:
    """A stationary first-order Gauss-Markov process, one for each n-frame component, around the trial's mean.

    Its autocorrelation is std_mps**2 exp(-|lag| / correlation_s); a correlation time of zero is white noise from sample
    to sample.


    Source: A. Gelb (ed.), Applied Optimal Estimation (1974), section 3.8 (exponentially correlated processes).
    """

    std_mps: float = 0.0  # standard deviation of each component [m/s]
    correlation_s: float = 0.0  # correlation time [s]

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < math.inf:
                raise InputError(f"variation.{name} is {value:g}, expected 0 or more")

    def memory(self, time_s: float) -> float:
        """Correlation of values that lie a time apart."""
        return math.exp(-time_s / self.correlation_s) if self.correlation_s > 0 else 0.0


STEADY = Variation()
"""No variation."""
SEA_STATES = range(10)
"""Codes of the World Meteorological Organization, table 3700."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Environment:
    """Forecast for a trial: its mean current and wind, and how they vary while it lasts."""

    current_to: Array = field(default_factory=lambda: np.zeros(2))  # (2,) mean current, velocity to north/east [m/s]
    wind_to: Array = field(default_factory=lambda: np.zeros(2))  # (2,) mean wind, velocity to north/east [m/s]
    current_std_mps: float = 0.0  # standard deviation with which the trial's mean of each component is known [m/s]
    wind_std_mps: float = 0.0  # standard deviation with which the trial's mean of each component is known [m/s]
    # current_variation, wind_variation: what happens around the trial's mean from sample to sample
    current_variation: Variation = STEADY
    wind_variation: Variation = STEADY
    # WMO code 0 (calm) to 9 (phenomenal) of table 3700, or None when not given; it is stated beside the limits on
    # trials and moves no ship here
    sea_state: int | None = None

    def __post_init__(self) -> None:
        seal(self, current_to="2", wind_to="2")
        if self.sea_state is not None and self.sea_state not in SEA_STATES:
            raise InputError(f"sea_state is {self.sea_state}, expected a whole number from 0 to 9")

    @property
    def isotropic(self) -> bool:
        """True when no mean current or wind singles out a heading."""
        return not (self.current_to.any() or self.wind_to.any())

    @property
    def steady(self) -> bool:
        """True when current and wind keep their means through the trial."""
        return not (self.current_variation.std_mps or self.wind_variation.std_mps)


CALM = Environment()
