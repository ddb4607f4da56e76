"""The tables of a vessel file."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from expdesign.scenario.tables import NonNegative, Number, Positive, Table, Text
from expdesign.scenario.vessels.environment_table import EnvironmentTable
from expdesign.vessel import STRUCTURES

TwoTurns = Annotated[float, Field(ge=-4 * math.pi, le=4 * math.pi)]
HalfTurn = Annotated[float, Field(ge=-math.pi, le=math.pi)]


class ParticularsTable(Table):
    """`[vessel]`."""

    name: Text = Field(description="a name for reports")
    length_m: Positive = Field(description="the length of the hull [m]")
    beam_m: Positive = Field(description="the beam of the hull [m]")
    draught_m: Positive = Field(description="the draught [m]")
    sample_time_s: Positive = Field(description="the time between commands [s]")


class ActuatorTable(Table):
    """What every entry of `[[actuators]]` has."""

    kind: str
    forward_m: Number = 0.0
    starboard_m: Number = 0.0


class PropellerTable(ActuatorTable):
    """A tunnel thruster or a propeller on a fixed shaft."""

    speed_min_rps: Number = Field(description="the lowest propeller speed [rps], negative for astern")
    speed_max_rps: Number = Field(description="the highest propeller speed [rps]")
    speed_rate_rps2: Positive | None = None
    speed_lag_s: NonNegative = 0.0
    speed_delay_s: NonNegative = 0.0
    speed_deadband_rps: NonNegative = 0.0


class AzimuthTable(PropellerTable):
    """An azimuth thruster; without angle limits it turns freely."""

    angle_min_rad: TwoTurns | None = None
    angle_max_rad: TwoTurns | None = None
    angle_rate_radps: Positive | None = None
    angle_lag_s: NonNegative = 0.0
    angle_delay_s: NonNegative = 0.0
    angle_deadband_rad: NonNegative = 0.0
    angle_offset_rad: HalfTurn = 0.0


class PoddedTable(AzimuthTable):
    """A podded drive: an azimuth thruster that turns only so far."""

    angle_min_rad: TwoTurns = Field(description="the lowest angle [rad]")
    angle_max_rad: TwoTurns = Field(description="the highest angle [rad]")


class RudderTable(ActuatorTable):
    """A rudder."""

    angle_min_rad: HalfTurn = Field(description="the lowest rudder angle [rad]")
    angle_max_rad: HalfTurn = Field(description="the highest rudder angle [rad]")
    angle_rate_radps: Positive | None = None
    angle_lag_s: NonNegative = 0.0
    angle_delay_s: NonNegative = 0.0
    angle_deadband_rad: NonNegative = 0.0
    angle_offset_rad: HalfTurn = 0.0


class ForceTable(ActuatorTable):
    """Generalised forces, in the model's own unit."""

    x_min: Number = Field(description="the lowest tau_x")
    x_max: Number = Field(description="the highest tau_x")
    x_rate: Positive | None = None
    x_lag_s: NonNegative = 0.0
    x_delay_s: NonNegative = 0.0
    x_deadband: NonNegative = 0.0
    y_min: Number = Field(description="the lowest tau_y")
    y_max: Number = Field(description="the highest tau_y")
    y_rate: Positive | None = None
    y_lag_s: NonNegative = 0.0
    y_delay_s: NonNegative = 0.0
    y_deadband: NonNegative = 0.0
    psi_min: Number = Field(description="the lowest tau_psi")
    psi_max: Number = Field(description="the highest tau_psi")
    psi_rate: Positive | None = None
    psi_lag_s: NonNegative = 0.0
    psi_delay_s: NonNegative = 0.0
    psi_deadband: NonNegative = 0.0


class TermTable(Table):
    """One of `[[model.terms]]`."""

    equation: Literal["u", "v", "r"] = Field(description="'u', 'v' or 'r'")
    name: Text = Field(description="a parameter name")
    expression: Text = Field(description="what the parameter multiplies, e.g. 'u*abs(u)'")


class RollTable(Table):
    """`[model.roll]`: an oscillation in sway and yaw beside what the terms say."""

    period_s: Positive = Field(description="the period of roll [s]")
    damping_ratio: NonNegative = Field(description="its damping ratio")
    Y_phi: Number = Field(description="sway acceleration per unit of roll")
    N_phi: Number = Field(description="yaw acceleration per unit of roll")


class ModelTable(Table):
    """`[model]`."""

    structure: str = Field(description=f"one of {', '.join((*STRUCTURES, 'custom'))}")
    form: Literal["discrete", "continuous"] = Field(description="'discrete' or 'continuous'")
    parameters: dict[str, Number] = Field(description="a table [model.parameters] with a value for each parameter")
    parameter_std: dict[str, NonNegative] = Field(default={})
    terms: list[TermTable] = Field(default=[])
    roll: RollTable | None = None


class SensorsTable(Table):
    """`[sensors]`: standard deviations per sample, faults, and by sensor its place, delay and interval."""

    position_m: NonNegative = 0.0
    heading_rad: NonNegative = 0.0
    velocity_mps: NonNegative = 0.0
    yaw_rate_radps: NonNegative = 0.0
    wind_mps: NonNegative = 0.0
    wind_angle_rad: NonNegative = 0.0
    heading_bias_rad: HalfTurn = 0.0
    velocity_angle_rad: HalfTurn = 0.0
    yaw_rate_scale: Positive = 1.0
    wind_sensor: Literal["cartesian", "vane"] = "cartesian"
    position_forward_m: Number = 0.0
    position_starboard_m: Number = 0.0
    position_delay_s: NonNegative = 0.0
    position_interval_s: NonNegative = 0.0
    heading_delay_s: NonNegative = 0.0
    heading_interval_s: NonNegative = 0.0
    velocity_forward_m: Number = 0.0
    velocity_starboard_m: Number = 0.0
    velocity_delay_s: NonNegative = 0.0
    velocity_interval_s: NonNegative = 0.0
    yaw_rate_delay_s: NonNegative = 0.0
    yaw_rate_interval_s: NonNegative = 0.0
    wind_forward_m: Number = 0.0
    wind_starboard_m: Number = 0.0
    wind_delay_s: NonNegative = 0.0
    wind_interval_s: NonNegative = 0.0


class VesselTable(Table):
    """The whole file."""

    vessel: ParticularsTable = Field(description="a table [vessel] with the particulars")
    actuators: list[dict[str, Any]] = Field(min_length=1, description="at least one table [[actuators]]")
    model: ModelTable = Field(description="a table [model]")
    sensors: SensorsTable = SensorsTable()
    environment: EnvironmentTable | None = None


ACTUATOR_TABLES: dict[str, type[ActuatorTable]] = {
    "azimuth": AzimuthTable,
    "tunnel": PropellerTable,
    "propeller": PropellerTable,
    "rudder": RudderTable,
    "force": ForceTable,
    "podded": PoddedTable,
}
"""Kind of actuator -> its table."""

SAME_AS = {"podded": "azimuth"}
"""Kind in a file -> the kind it is a case of."""
