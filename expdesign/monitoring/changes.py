"""Changes of a ship or its sensors that are watched for, with the sizes that matter."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from expdesign.diagnosis.model import ExtendedModel, own_air_terms
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.signals import Record
from expdesign.vessel import Term, Vessel, stem
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, GYRO

RELATIVE_SIZE = 0.1  # change of a parameter, a gain or an inertia that matters, as a share

ANGLE_RAD = 0.03  # misalignment that matters [rad]
GYRO_SCALE = 0.03  # scale that matters: gyros are better, and a compass tells less within hours
# kinds of effects that a load may change, each with the standard deviation of its change in a port call, in sizes that
# matter
LOADS = (("inertia", 2.0), ("hull", 1.0))


EQUATIONS = {"u": "surge", "v": "sway", "r": "yaw"}
INERTIA = "inertia:"  # of the effects that another mass changes alike, one for each equation

AIR_TERMS = (
    Term("u", "W_abs_u_u", "abs(u_q)*u_q"),
    Term("u", "W_abs_v_u", "abs(v_q)*u_q"),
    Term("v", "W_abs_v_v", "abs(v_q)*v_q"),
    Term("v", "W_abs_u_v", "abs(u_q)*v_q"),
    Term("r", "W_uv", "u_q*v_q"),
    Term("r", "W_N_abs_v_v", "abs(v_q)*v_q"),
    Term("r", "W_N_abs_u_v", "abs(u_q)*v_q"),
)
"""Air drag: forces that grow with the square of the wind, of a hull that is alike to both sides.

They span what is usual: a force by the cosine and the sine of the wind's angle, and a moment by the side force, which
acts before or abaft midships and moves with the angle. Source: W. Blendermann, Journal of Wind Engineering and
Industrial Aerodynamics 51 (1994), 339-351.
"""
BOX = 1e-3
"""Half the density of air over that of water, over a block coefficient of 0.6: air drag per mass of a box on the hull,
as high as the beam and with a drag coefficient of one, times the draught."""
TOLD_MPS = 10.0  # wind for which air drag is told [m/s]


@dataclass(frozen=True, kw_only=True)
class Change:
    """One way in which the ship may differ from its model."""

    effect: str  # key of an effect of the extended model, e.g. "theta:N_r".
    size: float  # change that matters, in the effect's unit; sums are tuned to a share of it in both directions
    unit: tuple[float, str]  # of sizes in words: a divisor and what it gives, e.g. (0.01, "%").
    words: str  # e.g. "parameter N_r".
    whole: float = 0.0  # value of the effect that is the whole term: of a parameter itself; zero where there is no term
    load: float = 0.0  # standard deviation of what another load changes, in sizes; zero where it changes nothing
    air: bool = False  # it acts by the wind that is measured

    @property
    def watched(self) -> bool:
        """Whether it is watched for; air drag that the model lacks is learnt only."""
        return not (self.air and self.effect.startswith("term:"))

    def in_words(self, value: float, std: float | None = None) -> str:
        """A value in words, e.g. "+12.1 ± 3.2 %", with no digits beyond those of its error."""
        divisor, name = self.unit
        size, spread = value / divisor + 0.0, 0.0 if std is None else abs(std / divisor)
        if not 0.0 < spread < math.inf:
            return f"{size:+.3g} {name}"
        decimals = max(0, 1 - math.floor(math.log10(spread)))
        return f"{round(size, decimals) + 0.0:+.{decimals}f} ± {spread:.{decimals}f} {name}"


def watched_ship(vessel: Vessel, record: Record) -> ExtendedModel:
    """The model of a vessel file for a record, to which the watch may add air drag."""
    ship = extended_model(vessel, record)
    air = {term.name: term for term in AIR_TERMS if term.equation in ship.model.outputs}
    return replace(ship, library={**ship.library, **air})


def watched_changes(ship: ExtendedModel, *, size: float = RELATIVE_SIZE, wind: bool = False) -> tuple[Change, ...]:
    """Parameters of the model, inertia by equation, thrust, angles of rudders and azimuths, and the yaw-rate sensor.

    Where the wind is measured and the model knows no air drag, that is learnt from the reference, too, so that a wind
    that rises is no change of the ship.

    Args:
        ship: the model with what its file states; of `watched_ship` where the wind is measured.
        size: relative change of parameters, thrust and inertia that matters; of angles and the yaw-rate sensor in
            proportion.
        wind: whether it is measured.
    """
    share = size / RELATIVE_SIZE
    model = ship.model
    own = own_air_terms(model) if wind else []
    loads = {kind: std / share for kind, std in LOADS}
    hull = {name for name, part in zip(model.names, ship.scaled_terms, strict=False) if part.damping}
    values = dict(zip(model.names, model.parameters.tolist(), strict=True))
    changes = [
        Change(
            effect=f"theta:{name}", size=size * abs(value), unit=(0.01 * value, "%"), words=f"parameter {name}",
            whole=value, load=loads["hull"] if name in hull else 0.0, air=name in own,
        )
        for name, value in values.items()
        if value
    ]  # fmt: skip
    changes += [
        Change(
            effect=f"{INERTIA}{name}", size=size, unit=(0.01, "%"), words=f"inertia in {EQUATIONS[name]}", whole=1.0,
            load=loads["inertia"],
        )
        for name in model.outputs
    ]  # fmt: skip
    words = "thrust, or force of all actuators"
    changes.append(Change(effect="gain", size=size, unit=(0.01, "%"), words=words, whole=1.0))
    stems = dict.fromkeys(stem(name) for name in model.inputs)
    changes += [
        Change(
            effect=f"offset:{name}",
            size=share * ANGLE_RAD,
            unit=(math.radians(1.0), "degrees"),
            words=f"offset of {what} angles",
        )
        for name, what in (("a", "azimuth"), ("rudder", "rudder"))
        if name in stems
    ]
    changes += [
        Change(effect=row.effects[0], size=share * GYRO_SCALE, unit=(0.01, "%"), words=f"scale of {row.what}")
        for row in GAINS_AND_OFFSETS
        if row.is_gain and row.shown_by == GYRO and row.is_shown(ship.derived) and "r" in model.outputs
    ]
    return (*changes, *(_air_drag(ship, share, loads["hull"]) if wind and not own else ()))


def _air_drag(ship: ExtendedModel, share: float, load: float) -> tuple[Change, ...]:
    """In sizes of a `BOX`, whose moments have an arm of a tenth of the length."""
    aside = BOX / ship.draught_m
    turning = aside * 1.6 / ship.length_m  # with a radius of gyration of a quarter of the length
    sizes = {"u": aside * ship.beam_m / ship.length_m, "v": aside, "r": turning}
    units = {"u": (1.0, "m/s2"), "v": (1.0, "m/s2"), "r": (math.radians(1.0), "degrees/s2")}
    return tuple(
        Change(
            effect=f"term:{name}",
            size=share * sizes[equation := ship.library[name].equation],
            unit=(units[equation][0] / TOLD_MPS**2, f"{units[equation][1]} in {TOLD_MPS:g} m/s"),
            words=f"air drag in {EQUATIONS[equation]}",
            load=load,
            air=True,
        )
        for name in (term.name for term in AIR_TERMS)
        if name in ship.library
    )
