"""Standard trials in calm water: turning circle, zig-zag, pull-out, initial turn, stop. The helmsman is simulated.

Every trial starts at the origin, heading north, steady ahead (`steady_ahead`), and gives the commands, which obey all
limits and rates and can be run again by `simulate`, and the motion. Orders fall between samples as they would at sea,
so results vary continuously with the model's parameters.

Source: IMO MSC/Circ.1053 (2002), 2; ITTC Recommended Procedure 7.5-04-02-01 (2017).
"""

from __future__ import annotations

import math

from expdesign.errors import InputError, UnknownName
from expdesign.simulation.helm import Approach, steady_ahead
from expdesign.simulation.standard_trials.helmsman import Conduct, Stage, Trial, sail
from expdesign.vessel import Vessel

SIDES = {"starboard": 1, "port": -1}
MANY = 10_000
"""Orders of a zig-zag that is limited by its time alone."""


AT_SERVICE_SPEED = Conduct()


def turning_circle(
    vessel: Vessel,
    *,
    helm_rad: float | None = None,
    side: str = "starboard",
    turn_rad: float = 3 * math.pi,
    conduct: Conduct = AT_SERVICE_SPEED,
) -> Trial:
    """Helm over from a straight approach, held until the heading has changed by `turn_rad`.

    Args:
        vessel: nominal model.
        helm_rad: size of the change of helm, or None for 35 degrees or what the actuators can give.
        side: "starboard" or "port", to which the ship turns; the sign of the helm follows from the model.
        turn_rad: change of heading that ends the trial, positive.
        conduct: speed, approach, duration, sampling.

    Raises:
        InputError: helm, speed or side that the vessel cannot do.
        NoAnswer: the ship does not turn so far.
    """
    approach, sign, angle = _steered(vessel, helm_rad, side, conduct)
    turn = Stage(angle_rad=angle, drive=approach.drive, left=lambda _, state: turn_rad - sign * state[2])
    return sail(approach, [turn], conduct, "turning circle")


def zigzag(
    vessel: Vessel,
    *,
    heading_rad: float,
    helm_rad: float,
    side: str = "starboard",
    executes: int = 3,
    conduct: Conduct = AT_SERVICE_SPEED,
) -> Trial:
    """Helm to one side until the heading has changed by `heading_rad`, then to the other, and so on.

    Args:
        vessel: nominal model.
        heading_rad: change of heading at which the helm is reversed, positive.
        helm_rad: size of the helm, positive.
        side: to which the ship turns first.
        executes: helm orders, the first included; the trial ends when the heading is back on the approach course after
            the last, so 3 show two overshoots.
        conduct: as in `turning_circle`; with `duration_s` the helmsman goes on as long.

    Raises:
        InputError: helm, speed or side that the vessel cannot do.
        NoAnswer: the heading does not reach the required change.
    """
    approach, sign, angle = _steered(vessel, helm_rad, side, conduct)
    if not heading_rad > 0 or executes < 2:
        raise InputError(
            f"zigzag: heading_rad is {heading_rad:g}, executes is {executes}, expected more than 0 and at least 2"
        )
    change = angle - approach.angle_rad

    def swing(number: int, past_rad: float) -> Stage:
        """Helm to one side until the heading is `past_rad` beyond the approach course on that side."""
        direction = (-1) ** number
        helm = approach.angle_rad + direction * change
        return Stage(angle_rad=helm, drive=approach.drive, left=lambda _, state: past_rad - sign * direction * state[2])

    if conduct.duration_s is None:  # the last helm stays until the ship has swung out and is back on the course
        stages = [*(swing(n, heading_rad) for n in range(executes - 1)), swing(executes - 1, 0.0)]
    else:
        stages = [swing(n, heading_rad) for n in range(MANY)]
    return sail(approach, stages, conduct, f"zig-zag {math.degrees(heading_rad):g}/{math.degrees(helm_rad):g}")


def pull_out(
    vessel: Vessel,
    *,
    helm_rad: float = math.radians(20.0),
    side: str = "starboard",
    turn_rad: float = math.pi,
    after_s: float | None = None,
    conduct: Conduct = AT_SERVICE_SPEED,
) -> Trial:
    """A turn, then helm back to its approach value; a stable ship's yaw rate then dies out.

    Args:
        vessel, helm_rad, side, conduct: as in `turning_circle`.
        turn_rad: change of heading at which the helm is put back.
        after_s: time recorded from there, or None for the time of 20 ship lengths at approach speed.

    Raises:
        InputError: helm, speed or side that the vessel cannot do.
        NoAnswer: the ship does not turn so far.
    """
    approach, sign, angle = _steered(vessel, helm_rad, side, conduct)
    rest_s = 20 * vessel.length_m / approach.speed_mps if after_s is None else after_s
    stages = [
        Stage(angle_rad=angle, drive=approach.drive, left=lambda _, state: turn_rad - sign * state[2]),
        Stage(angle_rad=approach.angle_rad, drive=approach.drive, left=lambda time, _: rest_s - time),
    ]
    return sail(approach, stages, conduct, "pull-out")


def stopping(vessel: Vessel, *, astern: float = 1.0, conduct: Conduct = AT_SERVICE_SPEED) -> Trial:
    """Full astern from a straight approach, helm unchanged, until the ship has no headway.

    Args:
        vessel: nominal model.
        astern: engine order, 1 for full astern, 0 for stopped engines.
        conduct: as in `turning_circle`.

    Raises:
        InputError: the engines cannot go astern, or the vessel cannot hold the approach.
        NoAnswer: the ship does not stop.
    """
    if not 0 <= astern <= 1:
        raise InputError(f"stopping: astern is {astern:g}, expected 0 to 1")
    approach = steady_ahead(vessel, conduct.speed_mps)
    for actuator in vessel.actuators:
        if astern and actuator.kind in ("propeller", "azimuth", "force") and not actuator.limits[0].low < 0:
            raise InputError(
                f"stopping: {actuator.signals[0]} of vessel {vessel.name!r} cannot go astern: its lower limit is "
                f"{actuator.limits[0].low:g}, expected less than 0"
            )
    stop = Stage(angle_rad=approach.angle_rad, drive=-astern, left=lambda _, state: state[3])
    return sail(approach, [stop], conduct, "stopping")


def _steered(vessel: Vessel, helm_rad: float | None, side: str, conduct: Conduct) -> tuple[Approach, int, float]:
    """The approach, +1 or -1 for the side, and the helm angle that turns the ship there."""
    if side not in SIDES:
        raise UnknownName("side", side, known=SIDES)
    approach = steady_ahead(vessel, conduct.speed_mps)
    if not approach.starboard:
        raise InputError(f"vessel {vessel.name!r}: its helm, {approach.helm.description}, does not turn it")
    size = approach.helm.hardest(approach.drive) if helm_rad is None else helm_rad
    if not 0 < size <= math.pi / 2:
        raise InputError(f"helm_rad is {size:g}, expected more than 0 and a quarter turn at most")
    angle = approach.angle_rad + SIDES[side] * approach.starboard * size
    if helm_rad is None:
        angle = min(max(angle, -size), size)
    approach.helm.check(approach.drive, angle)
    return approach, SIDES[side], angle
