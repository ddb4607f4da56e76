"""Levels of engine order and helm that are gone through up and down, each for as long as it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.dictionary.families.orders.orders import ordered, steered
from expdesign.dictionary.families.step_trials.hold_times import HOLD_SETTINGS, hold_times
from expdesign.dictionary.spec import Excitation, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.simulation.helm import Approach
from expdesign.values import Array

STEADY_MPS2 = 1e-6
PARTS = 4
"""Steps of helm from the straight course to a steady turn."""

STAIR_DURATION = Setting(
    name="duration_s",
    meaning="duration of one run, shared evenly among its levels; 0 for as long as vessels of the prior take to "
    "become steady at each, and to turn a circle",
    default=0.0,
    low=0.0,
    high=1e5,
)
STAIRCASE_SETTINGS = (
    Setting(name="steps", meaning="steps up, and as many down, a whole number", default=3.0, low=1, high=50),
    Setting(
        name="shift",
        meaning="share of a step by which all levels are higher, and one fewer: 0.5 for a second run between the "
        "levels of a first",
        default=0.0,
        low=0.0,
        high=0.99,
    ),
    *HOLD_SETTINGS,
    Setting(
        name="fast_order",
        meaning="engine order, as a share of full ahead, above which the helm is at most fast_helm_rad",
        default=1.0,
        low=0.0,
        high=1.0,
    ),
    Setting(
        name="fast_helm_rad",
        meaning="largest helm at engine orders above fast_order, for safety and comfort at speed",
        default=np.pi / 2,
        low=0.0,
        high=np.pi / 2,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Level:
    """One level of a staircase.

    Attributes:
        approach: straight run at the level's engine order.
        helm_rad: counted from the approach's, positive to starboard.
    """

    approach: Approach
    helm_rad: float


def rises(request: PrimitiveSpec) -> Array:
    """(n,) shares of the way from the first level to the last at which the levels are; one fewer where shifted."""
    steps, shift = round(request.settings["steps"]), request.settings["shift"]
    places = (np.arange(steps + 1) + shift) / steps
    return np.asarray(places[places <= 1.0])


def eased(request: PrimitiveSpec, drive: float, helm_rad: float) -> float:
    """The helm, no more than is allowed at the engine order."""
    settings = request.settings
    most = settings["fast_helm_rad"] if drive > settings["fast_order"] else np.pi / 2
    return float(np.clip(helm_rad, -most, most))


def staircase(request: PrimitiveSpec, begin: Approach, levels: Sequence[Level]) -> Excitation:
    """Commands of the levels from first to last and back to the first.

    Raises:
        InputError: an actuator cannot give a level; or a level has no steady turn, or one that too many vessels of the
            prior do not keep, where its time follows from that.
    """
    step_s, given_s = begin.helm.vessel.sample_time_s, request.settings["duration_s"]
    if given_s:
        times_s = np.full(len(levels), given_s / (2 * len(levels) - 1))
    else:
        motions = np.array([steady_turn(level.approach, level.helm_rad) for level in levels])
        inputs = np.array(
            [level.approach.helm.inputs(level.approach.drive, _angle(begin, level.helm_rad)) for level in levels]
        )
        times_s = np.ceil(hold_times(begin.helm.vessel, motions, inputs, request.settings) / step_s) * step_s
    stairs = [*range(len(levels)), *range(len(levels) - 2, -1, -1)]
    ends_s = np.cumsum(times_s[stairs])
    samples = round((given_s or float(ends_s[-1])) / step_s)
    place = np.searchsorted(ends_s - step_s / 2, np.arange(samples) * step_s, side="right")
    now = np.array(stairs)[np.minimum(place, len(stairs) - 1)]
    drive, helm = (
        np.array(values)[now] for values in zip(*((x.approach.drive, x.helm_rad) for x in levels), strict=False)
    )
    return ordered(begin, drive, helm)


def _angle(begin: Approach, helm_rad: float) -> float:
    return begin.angle_rad + begin.starboard * helm_rad


def steady_turn(approach: Approach, helm_rad: float) -> Array:
    """(3,) u, v, r that a helm, positive to starboard, and the approach's engine order hold.

    Found from the straight course by helm that grows in `PARTS` steps.

    Raises:
        InputError: there is none.
    """
    if helm_rad == 0.0:
        return approach.velocity
    motion = approach.velocity
    for share in np.linspace(1.0 / PARTS, 1.0, PARTS).tolist():
        motion = turn_near(approach, share * helm_rad, motion)
    return motion


def turn_near(approach: Approach, helm_rad: float, near: Array) -> Array:
    """(3,) the steady u, v, r of a helm that is found near a motion.

    Raises:
        InputError: none is.
    """
    angle = _angle(steered(approach), helm_rad)
    places = ["uvr".index(name) for name in approach.helm.vessel.model.outputs]

    def excess(x: Array) -> list[float]:
        motion = np.zeros(3)
        motion[places] = x
        rates = approach.helm.acceleration((motion[0], motion[1], motion[2]), approach.drive, angle)
        return [rates[place] for place in places]

    found = scipy.optimize.root(excess, near[places], tol=1e-12)
    if max(map(abs, excess(found.x))) > STEADY_MPS2:
        raise InputError(f"the vessel has no steady turn with a helm of {helm_rad:g} rad, expected less helm")
    motion = np.zeros(3)
    motion[places] = found.x
    return motion
