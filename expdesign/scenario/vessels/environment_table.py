"""`[environment]` of scenario and vessel files: expected current and wind."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from expdesign.scenario.tables import NonNegative, Table
from expdesign.vessel import Environment, Variation

WIND_LIMIT_MPS = 100.0
CURRENT_LIMIT_MPS = 15.0


class FlowTable(Table):
    """Uncertainty of a mean velocity, and its variation around the trial's mean."""

    std_mps: NonNegative = Field(
        default=0.0, description="the standard deviation of each component of a trial's mean [m/s]"
    )
    variation_std_mps: NonNegative = Field(
        default=0.0, description="the standard deviation of the variation around that mean [m/s]"
    )
    correlation_s: NonNegative = Field(
        default=0.0, description="the correlation time of the variation [s]; 0 for a new value at every sample"
    )

    @property
    def variation(self) -> Variation:
        """The variation as a value."""
        return Variation(std_mps=self.variation_std_mps, correlation_s=self.correlation_s)


class CurrentTable(FlowTable):
    """A velocity to which the water moves."""

    north_mps: float = Field(
        description="the velocity to north of the moving water [m/s]", ge=-CURRENT_LIMIT_MPS, le=CURRENT_LIMIT_MPS
    )
    east_mps: float = Field(
        description="the velocity to east of the moving water [m/s]", ge=-CURRENT_LIMIT_MPS, le=CURRENT_LIMIT_MPS
    )


class WindTable(FlowTable):
    """A velocity to which the air moves."""

    north_mps: float = Field(
        description="the velocity to north of the moving air [m/s]", ge=-WIND_LIMIT_MPS, le=WIND_LIMIT_MPS
    )
    east_mps: float = Field(
        description="the velocity to east of the moving air [m/s]", ge=-WIND_LIMIT_MPS, le=WIND_LIMIT_MPS
    )


class EnvironmentTable(Table):
    """`[environment]`."""

    current_to: CurrentTable = Field(
        default=CurrentTable(north_mps=0.0, east_mps=0.0), description="the current, by where the water moves to"
    )
    wind_to: WindTable = Field(
        default=WindTable(north_mps=0.0, east_mps=0.0), description="the wind, by where the air moves to"
    )
    sea_state: int | None = Field(
        default=None, ge=0, le=9, description="the WMO code of the sea state, which the report compares with limits"
    )


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
