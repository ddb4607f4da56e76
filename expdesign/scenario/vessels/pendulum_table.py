"""`[roll]` of a vessel file: roll as a pendulum, from masses, heights and parameters, or what a yard states of her."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from pydantic import Field

from expdesign.errors import InputError
from expdesign.scenario.tables import Entry, NonNegative, Number, Positive, Table, offer, shown
from expdesign.vessel import NOMINAL, ROLL_PARAMETERS, Body, Load, RollPendulum
from expdesign.vessel.roll import G_MPS2
from expdesign.waves import Waves


def checked_correlation(
    given: Mapping[str, Mapping[str, float]], names: Sequence[str], entry: Entry
) -> dict[tuple[str, str], float]:
    """Correlations of pairs of parameters.

    Raises:
        FileError: an unknown parameter, a pair given twice, or a correlation beyond -1 and 1.
    """
    check_names(given, names, entry)
    found: dict[tuple[str, str], float] = {}
    for one, row in given.items():
        check_names(row, names, entry.at(one))
        for other, value in row.items():
            if one == other or (other, one) in found:
                raise entry.at(one).at(other).error("is given already, expected each pair of parameters once")
            if not -1.0 <= value <= 1.0:
                raise entry.at(one).at(other).error(f"is {value:g}, expected -1 to 1")
            found[one, other] = value
    return found


def check_names(given: Iterable[str], names: Sequence[str], entry: Entry) -> None:
    """Raise FileError for a name that is no parameter of the structure."""
    for name in given:
        if name not in names:
            problem = f"{shown(name)} is not a parameter of the structure, {offer(name, tuple(names))}"
            raise entry.error(problem)


STATED = {"k": "metacentric_height_m", "A_x": "period_s", "d": "damping_ratio"}
"""Parameter -> key that may stand for it."""


class LoadTable(Table):
    """A load."""

    mass_kg: NonNegative = Field(default=0.0, description="the mass of the known load [kg]")
    height_m: Number = Field(default=0.0, description="the height of its centre above the origin [m]")
    inertia_kgm2: NonNegative = Field(default=0.0, description="its inertia about its own centre [kg m2]")

    @property
    def load(self) -> Load:
        """On board."""
        there = Load(mass_kg=self.mass_kg, z_m=-self.height_m, inertia_kgm2=self.inertia_kgm2)
        return there if self.mass_kg else NOMINAL


class WavesTable(Table):
    """`[roll.waves]`."""

    height_m: Positive = Field(description="the significant wave height [m]")
    period_s: Positive = Field(description="the period of the peak of their JONSWAP spectrum [s]")
    from_deg: Number = Field(description="whence they come, clockwise from north [deg]")
    gamma: Number = Field(default=3.3, description="the sharpness of the peak, 1 to 7")
    slope_share: Positive = Field(default=1.0, description="the share of their slope that acts on the hull, at most 1")


class BodyTable(Table):
    """What is known of the masses of a ship without load, and of where her accelerometer is."""

    mass_kg: Positive = Field(description="the mass of the ship without load [kg]")
    mass_height_m: Number = Field(description="the height of her centre of mass above the origin [m]")
    sensor_height_m: Number = Field(
        description="the height of the accelerometer [m] above the origin, or above the rotation axis"
    )
    sensor_above_axis: bool = Field(
        default=False, description="whether sensor_height_m is counted from the rotation axis, which has been located"
    )
    sensor_forward_m: Number = Field(
        default=0.0, description="the place of the sensor before midships, about which she turns [m]"
    )
    sensor_tilt_deg: Number | None = Field(
        default=None, description="the tilt of the sensor, its bow end up, where it was measured [deg]"
    )

    @property
    def body(self) -> Body:
        """As a value, downward from the origin."""
        return Body(
            mass_kg=self.mass_kg, z_g=-self.mass_height_m, z_s=-self.sensor_height_m,
            sensor_from_axis=self.sensor_above_axis, forward_m=self.sensor_forward_m,
            tilt_rad=None if self.sensor_tilt_deg is None else math.radians(self.sensor_tilt_deg),
        )  # fmt: skip


class PendulumTable(BodyTable):
    """`[roll]`: a pendulum that the motion drives, and that does not act back on it."""

    heel_max_deg: Positive | None = Field(
        default=None, description="the largest roll angle of a plan, in still water [deg]; none when not given"
    )
    metacentric_height_m: Positive | None = Field(
        default=None, description="the metacentric height of the ship without load [m], in place of parameters.k"
    )
    period_s: Positive | None = Field(
        default=None, description="her roll period without load [s], in place of parameters.A_x"
    )
    damping_ratio: NonNegative | None = Field(
        default=None, description="her damping ratio in roll without load, in place of parameters.d"
    )
    parameters: dict[str, Number] = Field(
        default={}, description=f"a table [roll.parameters]: {', '.join(ROLL_PARAMETERS)}; see expdesign roll"
    )
    parameter_std: dict[str, NonNegative] = Field(
        default={}, description="the standard deviation of each parameter; 0, for known, when not given"
    )
    parameter_correlation: dict[str, dict[str, Number]] = Field(
        default={}, description="the correlation of the errors of two parameters, each pair once; 0 when not given"
    )
    load: LoadTable = Field(default=LoadTable(), description="a table [roll.load]: what lies on board")
    waves: WavesTable | None = Field(
        default=None,
        description="a table [roll.waves]: waves that roll the ship by their slope, in simulate, incline and roll-plan",
    )


def build_pendulum(table: PendulumTable, entry: Entry) -> RollPendulum:
    """The pendulum of a table.

    Raises:
        FileError: a parameter is missing, unknown or stated twice, or no pendulum is like that.
    """
    for key in ("parameters", "parameter_std"):
        for name in getattr(table, key):
            if name not in ROLL_PARAMETERS:
                raise entry.at(key).unknown(name, ROLL_PARAMETERS)
    for name, key in STATED.items():
        if (name in table.parameters) == (getattr(table, key) is not None):
            both = "both are given" if name in table.parameters else "neither is given"
            raise entry.error(f"{key} and parameters.{name}: {both}, expected one of them")
    try:
        return RollPendulum(
            body=table.body, load=table.load.load, parameters=_parameters(table, table.body),
            parameter_std=dict(table.parameter_std),
            parameter_correlation=checked_correlation(
                table.parameter_correlation, ROLL_PARAMETERS, entry.at("parameter_correlation")
            ),
            waves=_waves(table.waves),
            heel_max_rad=math.inf if table.heel_max_deg is None else math.radians(table.heel_max_deg),
        )  # fmt: skip
    except InputError as error:
        raise entry.error(str(error)) from None


def _waves(table: WavesTable | None) -> Waves | None:
    if table is None:
        return None
    stated = table.model_dump()
    return Waves(from_rad=math.radians(stated.pop("from_deg")), **stated)


def _parameters(table: PendulumTable, body: Body) -> Mapping[str, float]:
    """All of them, those that the yard's numbers stand for from the ship without load."""
    given = dict.fromkeys(ROLL_PARAMETERS, 0.0) | table.parameters
    z_g = body.z_g + given["z_f"]
    if table.metacentric_height_m is not None:
        given["k"] = body.mass_kg * G_MPS2 * (table.metacentric_height_m - z_g)
    righting = given["k"] + G_MPS2 * body.mass_kg * z_g
    if not righting > 0 and (table.period_s is not None or table.damping_ratio is not None):
        raise InputError(
            f"has a righting moment of {righting:.4g} N m/rad without load, expected more than 0 for a ship with a "
            "roll period or damping ratio"
        )
    if table.period_s is not None:
        given["A_x"] = righting * (table.period_s / (2.0 * math.pi)) ** 2 - body.mass_kg * z_g**2
    if not given["A_x"] > 0:
        raise InputError(f"has a roll inertia A_x of {given['A_x']:.4g} kg m2, expected more than 0: a longer period_s")
    if table.damping_ratio is not None:
        given["d"] = 2.0 * table.damping_ratio * math.sqrt(righting * (given["A_x"] + body.mass_kg * z_g**2))
    return given
