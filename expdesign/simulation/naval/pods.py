"""Podded drives: thrust along the pod, and drag and lift of its strut, in the water that flows past it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

WATER = 1025.0


@dataclass(frozen=True, kw_only=True)
class Pods:
    """Two equal pods; one does not disturb the other.

    Attributes:
        diameter_m, strut_m2: of propeller and strut.
        motive_x, motive_y: coefficients of thrust without advance and per advance ratio, along and across the ship.
        resistive_x: of the strut along the flow: one that turns with twice the angle, and a constant.
        resistive_y: of the strut across the flow.
        forward_m, starboard_m, down_m: places [m]; the pods lie on either side.
    """

    diameter_m: float = 0.42
    strut_m2: float = 2.5
    motive_x: tuple[float, float] = (0.484, -0.47)
    motive_y: tuple[float, float] = (0.484, 0.7)
    resistive_x: tuple[float, float] = (1.2, -1.2)
    resistive_y: float = 1.2
    forward_m: float = -23.5
    starboard_m: float = 1.0
    down_m: float = 1.2

    def forces(self, u: Any, v: Any, p: Any, r: Any, angle: Any, speed: Any) -> list[Any]:
        """Forces of both pods in (u, v, p, r) [N, N, Nm, Nm], for a pod angle [rad] and a propeller speed [1/s]."""
        ahead: Any = 0.0
        aside: Any = 0.0
        across = v + self.forward_m * r - self.down_m * p
        for side in (-self.starboard_m, self.starboard_m):
            along = u - side * r
            flow, inflow = np.hypot(along, across), np.arctan2(across, along)
            x, y = pod_force(self, flow, angle - inflow, speed)
            c, s = np.cos(inflow), np.sin(inflow)
            ahead, aside = ahead + x * c - y * s, aside + x * s + y * c
        return [ahead, aside, -self.down_m * aside, self.forward_m * aside]


def pod_force(pods: Pods, flow: Any, angle: Any, speed: Any) -> tuple[Any, Any]:
    """Forces of one pod along and across the flow [N].

    Args:
        pods: coefficients.
        flow: speed of the water past the pod [m/s], not negative.
        angle: of the pod to the flow [rad].
        speed: of the propeller [1/s], not negative; without it there is no thrust.
    """
    d = pods.diameter_m
    disc, strut = WATER * d**4, 0.5 * WATER * pods.strut_m2 * flow**2
    without, advance = speed**2, speed * flow / d
    (x1, x2), (y1, y2) = pods.motive_x, pods.motive_y
    along = disc * (x1 * np.cos(angle) * without + x2 * advance)
    across = disc * np.sin(angle) * (y1 * without + y2 * advance)
    c1, c2 = pods.resistive_x
    return along + strut * (c1 * np.cos(2 * angle) + c2), across + strut * pods.resistive_y * np.sin(2 * angle)
