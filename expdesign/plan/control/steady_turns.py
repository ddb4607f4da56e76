"""Steady turns of a ship that is steered by a helm: what is left when the helm stays over, by simulation.

The engines keep the order of the straight approach, so the ship loses speed in the turn, as in the standard trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS
from expdesign.plan.control.tuning import CONTROL
from expdesign.simulation import simulate_many
from expdesign.simulation.helm import Approach
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class SteadyTurn:
    """A turn in which nothing accelerates, in calm water and air.

    Attributes:
        helm_rad: change of helm from the approach's, positive to starboard.
        surge_mps, sway_mps, yaw_rate_radps: motion through water.
    """

    helm_rad: float
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
    shares = np.arange(1, CONTROL.helm_angles + 1) / CONTROL.helm_angles
    angles = hardest * np.r_[-shares[::-1], shares]
    count = max(2, math.ceil(CONTROL.steady_hulls * vessel.length_m / approach.speed_mps / vessel.sample_time_s))
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
        or np.abs(excess(share)).max() > CONTROL.steady_share
        or np.abs(share - motion[used] / scale).max() > CONTROL.steady_offset
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
