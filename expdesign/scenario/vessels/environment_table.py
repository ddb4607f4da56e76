"""`[environment]` of scenario and vessel files: the current and wind to expect."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from expdesign.scenario.tables import NonNegative, Table
from expdesign.vessel import Environment, Variation

WIND_LIMIT_MPS = 100.0
CURRENT_LIMIT_MPS = 15.0


class FlowTable(Table):
    """How well a mean velocity is known and how it varies around the trial's mean."""

    std_mps: NonNegative = 0.0
    variation_std_mps: NonNegative = 0.0
    correlation_s: NonNegative = 0.0

    @property
    def variation(self) -> Variation:
        """As a value."""
        return Variation(std_mps=self.variation_std_mps, correlation_s=self.correlation_s)


class CurrentTable(FlowTable):
    """A velocity to which the water moves."""

    north_mps: float = Field(description="the velocity to north [m/s]", ge=-CURRENT_LIMIT_MPS, le=CURRENT_LIMIT_MPS)
    east_mps: float = Field(description="the velocity to east [m/s]", ge=-CURRENT_LIMIT_MPS, le=CURRENT_LIMIT_MPS)


class WindTable(FlowTable):
    """A velocity to which the air moves."""

    north_mps: float = Field(description="the velocity to north [m/s]", ge=-WIND_LIMIT_MPS, le=WIND_LIMIT_MPS)
    east_mps: float = Field(description="the velocity to east [m/s]", ge=-WIND_LIMIT_MPS, le=WIND_LIMIT_MPS)


class EnvironmentTable(Table):
    """`[environment]`."""

    current_to: CurrentTable = CurrentTable(north_mps=0.0, east_mps=0.0)
    wind_to: WindTable = WindTable(north_mps=0.0, east_mps=0.0)
    sea_state: int | None = Field(default=None, ge=0, le=9, description="the WMO code of the sea, 0 to 9")


def build_environment(table: EnvironmentTable) -> Environment:
    """The value of a checked table."""
    current, wind = table.current_to, table.wind_to
    return Environment(
        current_to=np.array([current.north_mps, current.east_mps]),
        wind_to=np.array([wind.north_mps, wind.east_mps]),
        current_std_mps=current.std_mps,
        wind_std_mps=wind.std_mps,
        current_variation=current.variation,
        wind_variation=wind.variation,
        sea_state=table.sea_state,
    )
