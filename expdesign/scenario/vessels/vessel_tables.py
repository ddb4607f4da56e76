"""The tables of a vessel file."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model

from expdesign.scenario.tables import NonNegative, Number, Positive, Table, Text
from expdesign.scenario.vessels.pendulum_table import PendulumTable
from expdesign.vessel import (
    KINDS,
    RATE_UNITS,
    STRUCTURES,
    UNSTATED_SHARE,
    Environment,
    Response,
    Sensors,
    Variation,
    limit_keys,
    response_keys,
)
from expdesign.vessel.quantities import ANGLE, NOT_NEGATIVE, NUMBER, POSITIVE, STD, WIND_SENSORS, Quantity, rows_of

# `[environment]` of scenario and vessel files: expected current and wind.

WIND_LIMIT_MPS = 100.0
CURRENT_LIMIT_MPS = 15.0
MOST_STD_MPS = 15.0  # of a current or wind: forecasts are not worse


class FlowTable(Table):
    """Uncertainty of a mean velocity, and its variation around the trial's mean."""

    std_mps: float = Field(
        default=0.0,
        ge=0,
        le=MOST_STD_MPS,
        description="the standard deviation of each component of a trial's mean [m/s]",
    )
    variation_std_mps: float = Field(
        default=0.0,
        ge=0,
        le=MOST_STD_MPS,
        description="the standard deviation of the variation around that mean [m/s]",
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
        default=CurrentTable(north_mps=0.0, east_mps=0.0),
        description="the current, by where the water moves to: one mean for the whole area and trial, so that a tidal "
        "stream that turns counts as its variation only",
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


TYPES: dict[str, Any] = {
    NUMBER: Number, ANGLE: HalfTurn, NOT_NEGATIVE: NonNegative, POSITIVE: Positive, STD: NonNegative,
}  # fmt: skip
"""What a quantity takes -> type of its key."""


def _key_of(row: Quantity, words: str) -> tuple[Any, Any]:
    """Type and field of the key of a quantity; one without a number when a file is silent has None."""
    kind, silent = TYPES[row.takes], row.default
    free = not math.isfinite(silent)
    return (kind | None if free else kind), Field(default=None if free else silent, description=words)


SIGNALS: dict[str, tuple[str, Any, str]] = {
    "n": ("the propeller speed", Number, " [rps], negative for astern"),
    "a": ("the angle", TwoTurns, " [rad], positive to starboard"),
    "rudder": ("the rudder angle", HalfTurn, " [rad], positive to starboard"),
    "tau_x": ("tau_x", Number, ", the surge force in the model's unit"),
    "tau_y": ("tau_y", Number, ", the sway force in the model's unit"),
    "tau_psi": ("tau_psi", Number, ", the yaw moment in the model's unit"),
}
"""Signal stem -> words, type and unit of its limits."""


def _signal_keys(stem: str, *, free: bool) -> dict[str, Any]:
    """Fields of the table of an actuator for one of its signals: limits, and what `Response` holds.

    Args:
        free: whether it may do without limits.
    """
    words, limit, unit = SIGNALS[stem]
    name, keys = words.removeprefix("the "), response_keys(stem)
    kind, default, or_free = (limit | None, None, "; it turns freely when not given") if free else (limit, ..., "")
    limits: dict[str, Any] = {
        key: (kind, Field(default=default, description=f"the {which} {name}{unit}{or_free}"))
        for key, which in zip(limit_keys(stem), ("lowest", "highest"), strict=True)
    }
    per = {"rps2": "rps per second", "radps": "rad/s", "": "per second"}[RATE_UNITS[stem]]
    said = {"the": words, "bare": name, "per": per, "in_unit": unit.split(",")[0]}
    rows = [row for row in rows_of(Response) if row.takes != ANGLE or stem in ("a", "rudder")]
    return limits | {keys[row.key]: _key_of(row, row.words.format(**said)) for row in rows}


def _actuator_table(name: str, words: str, stems: tuple[str, ...], *, free: bool = False) -> type[ActuatorTable]:
    """The table of a kind of actuator; its angle may be free."""
    keys = {key: field for stem in stems for key, field in _signal_keys(stem, free=free and stem == "a").items()}
    return create_model(name, __base__=ActuatorTable, __doc__=words, **keys)


_PROPELLER = _actuator_table("PropellerTable", "A tunnel thruster or a propeller on a fixed shaft.", KINDS["tunnel"])
ACTUATOR_TABLES: dict[str, type[ActuatorTable]] = {
    "azimuth": _actuator_table(
        "AzimuthTable",
        "An azimuth thruster; without angle limits it turns freely. Wide limits say how many turns it may wind.",
        KINDS["azimuth"],
        free=True,
    ),
    "tunnel": _PROPELLER,
    "propeller": _PROPELLER,
    "rudder": _actuator_table("RudderTable", "A rudder.", KINDS["rudder"]),
    "force": _actuator_table("ForceTable", "Generalised forces, in the model's own unit.", KINDS["force"]),
    "podded": _actuator_table("PoddedTable", "A podded drive: an azimuth thruster with limits.", KINDS["azimuth"]),
}
"""Kind of actuator -> its table."""

SAME_AS = {"podded": "azimuth"}  # kind in a file -> the kind it is a case of


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


class MissedTable(Table):
    """`model.missed`: what predictions as long as a standard trial miss of runs that they have not seen."""

    way_share: NonNegative = Field(description="the standard deviation, as a share of the way sailed")
    turn_share: NonNegative = Field(description="the standard deviation, as a share of the heading turned")


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
    missed: MissedTable | None = Field(
        default=None,
        description="a table { way_share = 0.02, turn_share = 0.05 } of what predictions miss of runs that were left "
        "out in turn, as estimate writes it: the intervals of indices count it, and without it what models of ships "
        "that nobody measured miss",
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


def _sensor_keys() -> dict[str, Any]:
    """Fields of `[sensors]`, in the order of those of `Sensors`."""
    rows = {row.key: row for row in rows_of(Sensors)}
    wind = Field(default="cartesian", description="the kind of wind sensor: components of the relative wind, or its "
                 "speed and angle")  # fmt: skip
    return {
        field.name: _key_of(rows[field.name], rows[field.name].words)
        if field.name in rows
        else (Literal[WIND_SENSORS], wind)
        for field in fields(Sensors)
    }


if TYPE_CHECKING:
    SensorsTable = Table
else:
    SensorsTable = create_model("SensorsTable", __base__=Table, __doc__="`[sensors]`.", **_sensor_keys())


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
        "by signal and quantity: heading_bias_rad, n1_lag_s, a1_delay_s, rudder1_rate; 0, for known, when not given. "
        "diagnose counts all of them, estimate those of dead times, lags and slew rates, and names the others",
    )
    roll: PendulumTable | None = Field(
        default=None,
        description="a table [roll]: roll as a pendulum that does not act back on the path. simulate measures it, "
        "diagnose and monitor judge it, plans keep to its heel_max_deg, expdesign roll and roll-plan read it",
    )
    environment: EnvironmentTable | None = Field(
        default=None, description="the weather that simulations of this vessel meet and a diagnosis found"
    )
