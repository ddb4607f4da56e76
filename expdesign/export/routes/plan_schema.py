"""The entries of plan.json that routes and simulated trials need, with their types and ranges."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from expdesign.conventions import POSE_COLUMNS, VELOCITY_COLUMNS
from expdesign.simulation.environment import Environment
from expdesign.values import Array
from expdesign.vessel import Variation


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False, extra="ignore")


class _Vessel(_Entry):
    name: str
    length_m: float = Field(gt=0)
    beam_m: float = Field(gt=0)


class _Origin(_Entry):
    lat_deg: float = Field(ge=-90, le=90)
    lon_deg: float = Field(ge=-180, le=180)


class _Frame(_Entry):
    projection: str
    origin: _Origin


class _Medium(_Entry):
    north_mps: float
    east_mps: float
    std_mps: float = Field(ge=0)
    variation_std_mps: float = Field(default=0.0, ge=0)
    correlation_s: float = Field(default=0.0, ge=0)


class _Environment(_Entry):
    current_to: _Medium
    wind_to: _Medium
    sea_state: int | None = Field(default=None, ge=0, le=9)


class _State(_Entry):
    time_s: float
    north_m: float
    east_m: float
    heading_rad: float
    u_mps: float
    v_mps: float
    r_radps: float

    @property
    def motion(self) -> Array:
        return np.array([getattr(self, name) for name in (*POSE_COLUMNS, *VELOCITY_COLUMNS)])


class _Leg(_Entry):
    index: int
    kind: Literal["primitive", "reposition"]
    name: str
    path: str = ""
    start: _State
    end: _State


class _Fence(_Entry):
    inside: tuple[tuple[float, float], ...] = Field(min_length=3)
    outside: tuple[tuple[tuple[float, float], ...], ...] = ()


class _DrawnTrials(_Entry):
    aborted_share: float = Field(default=0.0, ge=0, le=1)
    aborted_most: float = Field(default=1.0, ge=0, le=1)


class PlanFile(_Entry):
    """The entries of plan.json."""

    scenario: str
    vessel: _Vessel
    sample_time_s: float = Field(gt=0)
    inputs: list[str] = Field(min_length=1)
    frame: _Frame
    environment: _Environment
    legs: list[_Leg] = Field(min_length=1)
    clearance_required_m: float = Field(ge=0)
    fence: _Fence | None = None
    verified: bool
    draft: bool = False
    drawn_trials: _DrawnTrials | None = None

    @property
    def passed(self) -> bool:
        """Whether the plan passed its checks, though perhaps more drawn trials were aborted than may be."""
        drawn = self.drawn_trials
        return self.verified or (drawn is not None and drawn.aborted_share > drawn.aborted_most)


def environment_of(file: _Environment) -> Environment:
    """Current and wind as the package uses them."""
    current, wind = file.current_to, file.wind_to
    return Environment(
        current_to=np.array([current.north_mps, current.east_mps]),
        wind_to=np.array([wind.north_mps, wind.east_mps]),
        current_std_mps=current.std_mps,
        wind_std_mps=wind.std_mps,
        current_variation=Variation(std_mps=current.variation_std_mps, correlation_s=current.correlation_s),
        wind_variation=Variation(std_mps=wind.variation_std_mps, correlation_s=wind.correlation_s),
        sea_state=file.sea_state,
    )
