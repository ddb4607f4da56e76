"""What a ship with a helm can do on legs, by simulating it: steady turns, full ahead from rest, stopping.

In a turn the engines keep the order of the straight approach, so the ship loses speed, as in the standard trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NoAnswer, NoPlan
from expdesign.plan.values import PlanSettings
from expdesign.signals import Trajectory
from expdesign.simulation import Conduct, simulate_many, steady_ahead, stopping
from expdesign.simulation.helm import Approach
from expdesign.values import Array
from expdesign.vessel import Vessel

LATERAL_MPS2 = 0.03 * 9.81  # lateral acceleration of turns on legs: small enough not to heel the ship
HELM_SHARE = 0.65  # of the hardest helm at which ships turn on legs: the rest is for getting into turns and out of them
HELM_SLOW_SHARE = 0.5  # slowest speed, in transit speeds, at which a ship must still turn as tightly as legs ask
FULL_AHEAD_HULLS = 200.0  # hull lengths at transit speed in whose time full ahead from rest is simulated
HELM_ANGLES = 8  # to each side, whose steady turns are simulated
STEADY_HULLS = 30.0  # hull lengths at approach speed after which a turn counts as steady
STEADY_SHARE = 1e-6  # of the approach speed, per time of a hull length, that a steady turn may still gain or lose
STEADY_OFFSET = 0.3  # shares of the approach's scales between the exact turn and the end of its simulation


@dataclass(frozen=True, kw_only=True)
class SteadyTurn:
    """A turn in which nothing accelerates, in calm water and air."""

    helm_rad: float  # change of helm from the approach's, positive to starboard
    # surge_mps, sway_mps, yaw_rate_radps: motion through water
    surge_mps: float
    sway_mps: float
    yaw_rate_radps: float

    @property
    def speed_mps(self) -> float:
        """Speed along the circle [m/s]."""
        return math.hypot(self.surge_mps, self.sway_mps)

    @property
    def radius_m(self) -> float:
        """Radius of the circle that the origin goes round [m]."""
        return self.speed_mps / max(abs(self.yaw_rate_radps), 1e-300)

    @property
    def drift_rad(self) -> float:
        """Course less heading [rad]: negative in a turn to starboard, as the bow points into the circle."""
        return math.atan2(self.sway_mps, self.surge_mps)


def steady_turns(approach: Approach) -> tuple[SteadyTurn, ...]:
    """Turns by helm angles from hard over to port to hard over to starboard, those that settle.

    Each is simulated with the helm put over and held, then solved for exactly from there.
    """
    helm, vessel = approach.helm, approach.helm.vessel
    hardest = helm.hardest(approach.drive) - abs(approach.angle_rad)
    shares = np.arange(1, HELM_ANGLES + 1) / HELM_ANGLES
    angles = hardest * np.r_[-shares[::-1], shares]
    count = max(2, math.ceil(STEADY_HULLS * vessel.length_m / approach.speed_mps / vessel.sample_time_s))
    rows = helm.rows(np.array(approach.drive), approach.angle_rad + approach.starboard * angles)
    runs, still = len(rows), np.zeros((len(rows), 2))
    states = simulate_many(
        vessel,
        np.repeat(rows[:, None], count, axis=1),
        pose=np.zeros((runs, 3)),
        velocity=np.tile(approach.velocity, (runs, 1)),
        current_to=still,
        wind_to=still,
        parameters=np.tile(vessel.model.parameters, (runs, 1)),
    )
    found = (_solved(approach, angle, motion) for angle, motion in zip(angles.tolist(), states[-1, :, 3:], strict=True))
    return tuple(turn for turn in found if turn is not None)


def _solved(approach: Approach, angle: float, motion: Array) -> SteadyTurn | None:
    """The equilibrium next to a motion (3,), or None where the ship does not turn ahead in one to the helm's side."""
    if not np.isfinite(motion).all():
        return None
    used = [OUTPUTS.index(name) for name in approach.helm.vessel.model.outputs]
    helm_rad = approach.angle_rad + approach.starboard * angle
    scale = np.array([approach.speed_mps] * 2 + [approach.speed_mps / approach.helm.vessel.length_m])[used]
    pace_s = approach.helm.vessel.length_m / approach.speed_mps

    def excess(share: Array) -> Array:
        whole = np.zeros(3)
        whole[used] = share * scale
        rates = approach.helm.acceleration((whole[0], whole[1], whole[2]), approach.drive, helm_rad)
        return np.asarray(np.array(rates)[used] * pace_s / scale)

    share = scipy.optimize.root(excess, motion[used] / scale, tol=1e-12).x
    whole = np.zeros(3)
    whole[used] = share * scale
    turns = whole[0] > 0 and whole[2] * angle > 0
    if (
        not turns
        or np.abs(excess(share)).max() > STEADY_SHARE
        or np.abs(share - motion[used] / scale).max() > STEADY_OFFSET
    ):
        return None
    return SteadyTurn(
        helm_rad=angle, surge_mps=float(whole[0]), sway_mps=float(whole[1]), yaw_rate_radps=float(whole[2])
    )


def side_by_side(turns: tuple[SteadyTurn, ...]) -> list[tuple[SteadyTurn, SteadyTurn]]:
    """(port, starboard) turns with helms of one size, from the smallest helm on."""
    port = {round(-turn.helm_rad, 9): turn for turn in turns if turn.helm_rad < 0}
    pairs = ((port.get(round(turn.helm_rad, 9)), turn) for turn in turns if turn.helm_rad > 0)
    return sorted(((left, right) for left, right in pairs if left is not None), key=lambda pair: pair[1].helm_rad)


def why_not_ahead(vessel: Vessel, speed: float) -> str:
    """What keeps a vessel from going straight ahead at a speed; "" for nothing."""
    try:
        steady_ahead(vessel, speed)
    except InputError as error:
        return str(error)
    return ""


def _slower(approach: Approach) -> Approach:
    return steady_ahead(approach.helm.vessel, HELM_SLOW_SHARE * approach.speed_mps)


def leg_radius_m(approach: Approach, settings: PlanSettings, pairs: list[tuple[SteadyTurn, SteadyTurn]]) -> float:
    """The radius asked for, or what the ship turns on to both sides, at transit speed and slower, with helm to spare.

    Args:
        approach: at transit speed.
        settings: may ask for a radius.
        pairs: steady turns to both sides from there, by `side_by_side`.

    Raises:
        NoPlan: the radius asked for is too small.
    """
    vessel, transit = approach.helm.vessel, approach.speed_mps
    at_speeds = pairs, side_by_side(steady_turns(_slower(approach)))
    tightest = max(max(turn.radius_m for turn in some[-1]) for some in at_speeds if some)
    asked_m = settings.turning_radius_m
    if asked_m is not None and asked_m < tightest:
        raise NoPlan(
            f"plan.turning_radius_m is {asked_m:g}, at {transit:.3g} m/s vessel {vessel.name!r} needs {tightest:.3g} m "
            "or more with its helm hard over",
            what="radius",
        )
    found = [tightest, 1.5 * vessel.length_m]
    for some in at_speeds:
        most = max((pair[1].helm_rad for pair in some), default=0.0)
        eased = [pair for pair in some if pair[1].helm_rad <= HELM_SHARE * most and _gentle(pair)]
        found.append(max(turn.radius_m for turn in eased[-1]) if eased else transit**2 / LATERAL_MPS2)
    return asked_m or max(found)


def _gentle(pair: tuple[SteadyTurn, SteadyTurn]) -> bool:
    return all(abs(turn.surge_mps * turn.yaw_rate_radps) <= LATERAL_MPS2 for turn in pair)


def full_ahead(approach: Approach) -> Array:
    """(k, 6) pose and velocity from rest with the engines full ahead, as fast as they answer, at every sample."""
    helm, vessel = approach.helm, approach.helm.vessel
    step_s = vessel.sample_time_s
    count = int(np.ceil(FULL_AHEAD_HULLS * vessel.length_m / approach.speed_mps / step_s))
    orders = np.minimum(1.0, np.arange(1, count + 1) * step_s * helm.drive_rate)
    rows = np.array([helm.inputs(order, approach.angle_rad) for order in orders.tolist()])
    states = simulate_many(
        vessel,
        rows[None],
        pose=np.zeros((1, 3)),
        velocity=np.zeros((1, 3)),
        current_to=np.zeros((1, 2)),
        wind_to=np.zeros((1, 2)),
        parameters=vessel.model.parameters[None],
        standing=np.array([helm.inputs(0.0, approach.angle_rad)]),
    )
    return np.asarray(states[:, 0])


def simulated_acceleration(approach: Approach) -> float:
    """The constant acceleration that loses as much time as full ahead from rest to the approach's speed [m/s2]."""
    speed, step_s, surge = approach.speed_mps, approach.helm.vessel.sample_time_s, full_ahead(approach)[:, 3]
    there = int(np.argmax(surge >= 0.98 * speed)) or len(surge) - 1
    lost_s = there * step_s - float(np.abs(surge[:there]).sum()) * step_s / speed
    return speed / (2 * max(lost_s, step_s))


def stopped(vessel: Vessel, speed: float) -> Trajectory:
    """A stop from a steady speed, the engines full astern, or stopped where they do not go astern.

    Raises:
        NoPlan: the ship does not stop, so it cannot come to rest at a goal.
    """
    reason = ""
    for astern in (1.0, 0.0):
        try:
            return stopping(vessel, astern=astern, conduct=Conduct(speed_mps=speed))[1]
        except InputError as error:  # the engines do not go astern
            reason = str(error)
        except NoAnswer as error:
            raise NoPlan(f"vessel {vessel.name!r} cannot be stopped at the goal: {error}") from None
    raise NoPlan(f"vessel {vessel.name!r} cannot be stopped at the goal: {reason}")


def stopping_distance_m(vessel: Vessel, speed: float) -> float:
    """Distance of a stop from a steady speed [m].

    Raises:
        NoPlan: as `stopped`.
    """
    return float(np.hypot(*np.diff(stopped(vessel, speed).pose[:, :2], axis=0).T).sum())
