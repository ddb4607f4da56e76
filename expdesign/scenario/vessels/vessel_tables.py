"""The tables of a vessel file."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from expdesign.scenario.tables import NonNegative, Number, Positive, Table, Text
from expdesign.scenario.vessels.pendulum_table import PendulumTable
from expdesign.vessel import STRUCTURES, UNSTATED_SHARE, Environment, Variation

# `[environment]` of scenario and vessel files: expected current and wind.

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
    """Keys of every entry of `[[actuators]]`."""

    topic = "vessel"

    kind: str = Field(description="the kind of actuator: azimuth, podded, tunnel, propeller, rudder or force")
    forward_m: Number = Field(
        default=0.0, description="the distance forward of amidships [m], at most the hull's length"
    )
    starboard_m: Number = Field(
        default=0.0, description="the distance to starboard of the centre line [m], at most the beam"
    )


class PropellerTable(ActuatorTable):
    """A tunnel thruster or a propeller on a fixed shaft."""

    speed_min_rps: Number = Field(description="the lowest propeller speed [rps], negative for astern")
    speed_max_rps: Number = Field(description="the highest propeller speed [rps]")
    speed_rate_rps2: Positive | None = Field(
        default=None,
        description="the slew rate at which the speed follows orders [rps per second]; no limit when not given",
    )
    speed_lag_s: NonNegative = Field(
        default=0.0, description="the time constant with which the propeller speed follows [s]"
    )
    speed_delay_s: NonNegative = Field(default=0.0, description="the dead time of the propeller speed [s]")
    speed_deadband_rps: NonNegative = Field(
        default=0.0, description="the dead band: smaller commanded speeds have no effect [rps]"
    )


class AzimuthTable(PropellerTable):
    """An azimuth thruster; without angle limits it turns freely."""

    angle_min_rad: TwoTurns | None = Field(
        default=None, description="the lowest angle [rad], positive to starboard; it turns freely when not given"
    )
    angle_max_rad: TwoTurns | None = Field(default=None, description="the highest angle [rad]; free when not given")
    angle_rate_radps: Positive | None = Field(
        default=None, description="the slew rate at which the angle follows orders [rad/s]; no limit when not given"
    )
    angle_lag_s: NonNegative = Field(default=0.0, description="the time constant with which the angle follows [s]")
    angle_delay_s: NonNegative = Field(default=0.0, description="the dead time of the angle [s]")
    angle_deadband_rad: NonNegative = Field(
        default=0.0, description="the dead band: smaller commanded angles have no effect [rad]"
    )
    angle_offset_rad: HalfTurn = Field(
        default=0.0, description="the misalignment [rad]: the true angle less the commanded one"
    )


class PoddedTable(AzimuthTable):
    """A podded drive: an azimuth thruster with angle limits."""

    angle_min_rad: TwoTurns = Field(description="the lowest angle [rad]")
    angle_max_rad: TwoTurns = Field(description="the highest angle [rad]")


class RudderTable(ActuatorTable):
    """A rudder."""

    angle_min_rad: HalfTurn = Field(description="the lowest rudder angle [rad]")
    angle_max_rad: HalfTurn = Field(description="the highest rudder angle [rad]")
    angle_rate_radps: Positive | None = Field(
        default=None, description="the slew rate at which the angle follows orders [rad/s]; no limit when not given"
    )
    angle_lag_s: NonNegative = Field(default=0.0, description="the time constant with which the angle follows [s]")
    angle_delay_s: NonNegative = Field(default=0.0, description="the dead time of the angle [s]")
    angle_deadband_rad: NonNegative = Field(
        default=0.0, description="the dead band: smaller commanded angles have no effect [rad]"
    )
    angle_offset_rad: HalfTurn = Field(
        default=0.0, description="the misalignment [rad]: the true angle less the commanded one"
    )


class ForceTable(ActuatorTable):
    """Generalised forces, in the model's own unit."""

    x_min: Number = Field(description="the lowest tau_x, the surge force in the model's unit")
    x_max: Number = Field(description="the highest tau_x")
    x_rate: Positive | None = Field(
        default=None, description="the slew rate of tau_x [per second]; no limit when not given"
    )
    x_lag_s: NonNegative = Field(default=0.0, description="the time constant with which tau_x follows [s]")
    x_delay_s: NonNegative = Field(default=0.0, description="the dead time of tau_x [s]")
    x_deadband: NonNegative = Field(default=0.0, description="the dead band: smaller tau_x have no effect")
    y_min: Number = Field(description="the lowest tau_y, the sway force in the model's unit")
    y_max: Number = Field(description="the highest tau_y")
    y_rate: Positive | None = Field(
        default=None, description="the slew rate of tau_y [per second]; no limit when not given"
    )
    y_lag_s: NonNegative = Field(default=0.0, description="the time constant with which tau_y follows [s]")
    y_delay_s: NonNegative = Field(default=0.0, description="the dead time of tau_y [s]")
    y_deadband: NonNegative = Field(default=0.0, description="the dead band: smaller tau_y have no effect")
    psi_min: Number = Field(description="the lowest tau_psi, the yaw moment in the model's unit")
    psi_max: Number = Field(description="the highest tau_psi")
    psi_rate: Positive | None = Field(
        default=None, description="the slew rate of tau_psi [per second]; no limit when not given"
    )
    psi_lag_s: NonNegative = Field(default=0.0, description="the time constant with which tau_psi follows [s]")
    psi_delay_s: NonNegative = Field(default=0.0, description="the dead time of tau_psi [s]")
    psi_deadband: NonNegative = Field(default=0.0, description="the dead band: smaller tau_psi have no effect")


class TermTable(Table):
    """One of `[[model.terms]]`."""

    equation: Literal["u", "v", "r"] = Field(description="the equation: u (surge), v (sway) or r (yaw)")
    name: Text = Field(description="a parameter name")
    expression: Text = Field(
        description="what the parameter multiplies, e.g. 'u*abs(u)': products, abs, sin, cos of u v r (through water), "
        "u_q v_q (through air), h (draught over depth) and actuator signals such as n1, a1, rudder1, tau_x"
    )


class RollTable(Table):
    """`[model.roll]`: an oscillation in sway and yaw in addition to the terms."""

    period_s: Positive = Field(description="the period of roll [s]")
    damping_ratio: NonNegative = Field(description="the damping ratio of roll")
    Y_phi: Number = Field(description="the sway acceleration per unit of roll")
    N_phi: Number = Field(description="the yaw acceleration per unit of roll")
    heel_rad_per_mps2: Number = Field(
        default=0.0,
        description="the roll angle that a lasting side acceleration of 1 m/s2 to starboard holds [rad], positive to "
        "starboard, negative for a ship that heels outwards; with it, simulate measures roll",
    )


class InertiaTable(Table):
    """`[model.inertia]`: sway and yaw that accelerate each other, as where the centre of gravity is not amidships."""

    sway_kg: Positive = Field(description="the mass with added mass in sway [kg]")
    yaw_kgm2: Positive = Field(description="the moment of inertia with added inertia in yaw, about midships [kg m2]")
    sway_yaw_kgm: Number = Field(
        description="the sway force per yaw acceleration [kg m]: the mass times the distance of the centre of gravity "
        "ahead of midships, with added mass"
    )
    yaw_sway_kgm: Number | None = Field(
        default=None, description="the yaw moment per sway acceleration [kg m]; the same when not given"
    )


class ModelTable(Table):
    """`[model]`."""

    structure: str = Field(description=f"the terms of the model, one of {', '.join((*STRUCTURES, 'custom'))}")
    form: Literal["discrete", "continuous"] = Field(
        description="the meaning of the parameters: 'discrete', of Euler's map at the sample time, or 'continuous', of "
        "the continuous motion"
    )
    parameters: dict[str, Number] = Field(description="a table [model.parameters] with a value for each parameter")
    parameter_std: dict[str, NonNegative] = Field(
        default={},
        description="the standard deviation of each parameter, 0 for exactly known; of those not given see "
        "parameter_std_unstated",
    )
    parameter_std_unstated: NonNegative = Field(
        default=UNSTATED_SHARE,
        description="the standard deviation, as a share of the value, with which ships of drawn trials differ in the "
        "parameters that parameter_std does not name; 0 for exactly known. Estimates take nothing from it",
    )
    parameter_correlation: dict[str, dict[str, Number]] = Field(
        default={},
        description="the correlation of the errors of two parameters, by the names of both, each pair once, e.g. "
        "Y_v = { X_u = 0.3 }; 0 when not given",
    )
    parameter_min: dict[str, Number] = Field(
        default={},
        description="the least value that a parameter is known to have, whatever its standard deviation: vessels drawn "
        "with less are drawn again. 0 for thrust that drives ahead; any when not given",
    )
    parameter_max: dict[str, Number] = Field(
        default={},
        description="the most value that a parameter is known to have, likewise: 0 for damping, without which drawn "
        "vessels run away; any when not given",
    )
    speeds_mps: list[Number] | None = Field(
        default=None,
        min_length=2,
        max_length=2,
        description="the least and the most surge speed of the data that determined the parameters, as estimate writes "
        "them: a dictionary or a plan that goes beyond is told of",
    )
    terms: list[TermTable] = Field(default=[], description="the tables [[model.terms]] of structure 'custom'")
    roll: RollTable | None = Field(
        default=None, description="a table [model.roll]; simulations follow it, estimates and plans do not"
    )
    inertia: InertiaTable | None = Field(
        default=None,
        description="a table [model.inertia]; the terms then give accelerations before coupling. Simulations, "
        "diagnoses and watches follow it, scores, estimates and plans do not",
    )


class SensorsTable(Table):
    """`[sensors]`: standard deviations per sample, faults, and by sensor its place, delay and interval."""

    position_m: NonNegative = Field(default=0.0, description="the standard deviation of positions [m]")
    heading_rad: NonNegative = Field(default=0.0, description="the standard deviation of headings [rad]")
    velocity_mps: NonNegative = Field(default=0.0, description="the standard deviation of surge and sway speed [m/s]")
    yaw_rate_radps: NonNegative = Field(default=0.0, description="the standard deviation of yaw rate [rad/s]")
    wind_mps: NonNegative = Field(
        default=0.0, description="the standard deviation of wind speed, or of each component [m/s]"
    )
    wind_angle_rad: NonNegative = Field(default=0.0, description="the standard deviation of a vane's angle [rad]")
    roll_rad: NonNegative = Field(default=0.0, description="the standard deviation of roll angles [rad]")
    roll_rate_radps: NonNegative = Field(default=0.0, description="the standard deviation of roll rates [rad/s]")
    acceleration_mps2: NonNegative = Field(
        default=0.0, description="the standard deviation of sway and lateral accelerations [m/s2]"
    )
    heading_bias_rad: HalfTurn = Field(default=0.0, description="the measured heading less the true one [rad]")
    velocity_angle_rad: HalfTurn = Field(
        default=0.0, description="the angle from the bow to the velocity sensor's forward axis [rad], clockwise"
    )
    velocity_scale: Positive = Field(default=1.0, description="the measured surge and sway speed over the true ones")
    yaw_rate_scale: Positive = Field(default=1.0, description="the measured yaw rate over the true one")
    wind_sensor: Literal["cartesian", "vane"] = Field(
        default="cartesian",
        description="the kind of wind sensor: components of the relative wind, or its speed and angle",
    )
    position_forward_m: Number = Field(
        default=0.0, description="the place of the sensor of the positions forward of amidships [m]"
    )
    position_starboard_m: Number = Field(
        default=0.0, description="the place of the sensor of the positions to starboard of the centre line [m]"
    )
    position_delay_s: NonNegative = Field(default=0.0, description="the delay of the positions [s]")
    position_interval_s: NonNegative = Field(
        default=0.0,
        description="the time between new readings of the positions [s], or 0 for every sample",
    )
    heading_delay_s: NonNegative = Field(default=0.0, description="the delay of the headings [s]")
    heading_interval_s: NonNegative = Field(
        default=0.0,
        description="the time between new readings of the headings [s], or 0 for every sample",
    )
    velocity_forward_m: Number = Field(
        default=0.0, description="the place of the sensor of surge and sway speed forward of amidships [m]"
    )
    velocity_starboard_m: Number = Field(
        default=0.0, description="the place of the sensor of surge and sway speed to starboard of the centre line [m]"
    )
    velocity_delay_s: NonNegative = Field(default=0.0, description="the delay of surge and sway speed [s]")
    velocity_interval_s: NonNegative = Field(
        default=0.0,
        description="the time between new readings of surge and sway speed [s], or 0 for every sample",
    )
    yaw_rate_delay_s: NonNegative = Field(default=0.0, description="the delay of the yaw rate [s]")
    yaw_rate_interval_s: NonNegative = Field(
        default=0.0,
        description="the time between new readings of the yaw rate [s], or 0 for every sample",
    )
    wind_forward_m: Number = Field(
        default=0.0, description="the place of the sensor of the wind forward of amidships [m]"
    )
    wind_starboard_m: Number = Field(
        default=0.0, description="the place of the sensor of the wind to starboard of the centre line [m]"
    )
    wind_delay_s: NonNegative = Field(default=0.0, description="the delay of the wind [s]")
    wind_interval_s: NonNegative = Field(
        default=0.0,
        description="the time between new readings of the wind [s], or 0 for every sample",
    )


class VesselTable(Table):
    """The whole file."""

    topic = "vessel"

    vessel: ParticularsTable = Field(description="a table [vessel] with the particulars")
    actuators: list[dict[str, Any]] = Field(min_length=1, description="at least one table [[actuators]]")
    model: ModelTable = Field(description="a table [model]")
    sensors: SensorsTable = Field(
        default=SensorsTable(), description="the noise and faults of the sensors; without the table they are exact"
    )
    std: dict[str, NonNegative] = Field(
        default={},
        description="the standard deviations of what [sensors] and [[actuators]] state, by the key of the sensor, or "
        "by signal and quantity: heading_bias_rad, n1_lag_s, a1_delay_s, rudder1_rate; 0, for known, when not given",
    )
    roll: PendulumTable | None = Field(
        default=None,
        description="a table [roll]: roll as a pendulum that does not act back on the path. simulate measures it, "
        "diagnose and monitor judge it, plans keep to its heel_max_deg, expdesign roll and roll-plan read it",
    )
    environment: EnvironmentTable | None = Field(
        default=None, description="the weather that simulations of this vessel meet and a diagnosis found"
    )


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
