"""Changes of a ship or its sensors that are watched for, with the sizes that matter."""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.diagnosis.model import ExtendedModel
from expdesign.vessel import stem
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, GYRO

RELATIVE_SIZE = 0.1  # change of a parameter, a gain or an inertia that matters, as a share

ANGLE_RAD = 0.03  # misalignment that matters [rad]
GYRO_SCALE = 0.03  # scale that matters: gyros are better, and a compass tells less within hours
# kinds of effects that a load may change, each with the standard deviation of its change in a port call, in sizes that
# matter
LOADS = (("inertia", 2.0), ("hull", 1.0))


EQUATIONS = {"u": "surge", "v": "sway", "r": "yaw"}


@dataclass(frozen=True, kw_only=True)
class Change:
    """One way in which the ship may differ from its model."""

    effect: str  # key of an effect of the extended model, e.g. "theta:N_r".
    size: float  # change that matters, in the effect's unit; sums are tuned to a share of it in both directions
    unit: tuple[float, str]  # of sizes in words: a divisor and what it gives, e.g. (0.01, "%").
    words: str  # e.g. "parameter N_r".
    whole: float = 0.0  # value of the effect that is the whole term: of a parameter itself; zero where there is no term
    load: float = 0.0  # standard deviation of what another load changes, in sizes; zero where it changes nothing

    def in_words(self, value: float, std: float | None = None) -> str:
        """A value in words, e.g. "+12.1 ± 3.2 %", with no digits beyond those of its error."""
        divisor, name = self.unit
        size, spread = value / divisor + 0.0, 0.0 if std is None else abs(std / divisor)
        if not 0.0 < spread < math.inf:
            return f"{size:+.3g} {name}"
        decimals = max(0, 1 - math.floor(math.log10(spread)))
        return f"{round(size, decimals) + 0.0:+.{decimals}f} ± {spread:.{decimals}f} {name}"


def watched_changes(ship: ExtendedModel, *, size: float = RELATIVE_SIZE) -> tuple[Change, ...]:
    """Parameters of the model, inertia by equation, thrust, angles of rudders and azimuths, and the yaw-rate sensor.

    Args:
        ship: the model with what its file states.
        size: relative change of parameters, thrust and inertia that matters; of angles and the yaw-rate sensor in
            proportion.
    """
    share = size / RELATIVE_SIZE
    model = ship.model
    loads = {kind: std / share for kind, std in LOADS}
    hull = {name for name, part in zip(model.names, ship.scaled_terms, strict=False) if part.damping}
    values = dict(zip(model.names, model.parameters.tolist(), strict=True))
    changes = [
        Change(
            effect=f"theta:{name}", size=size * abs(value), unit=(0.01 * value, "%"), words=f"parameter {name}",
            whole=value, load=loads["hull"] if name in hull else 0.0,
        )
        for name, value in values.items()
        if value
    ]  # fmt: skip
    changes += [
        Change(
            effect=f"inertia:{name}", size=size, unit=(0.01, "%"), words=f"inertia in {EQUATIONS[name]}", whole=1.0,
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
    return tuple(changes)
