"""Families of step trials: steps of throttle and rudder up and down, and waves of both to validate with.

Rudder steps hold the approach's engine order, throttle steps a helm. Levels are those of equally spaced steady yaw
rates and speeds by the nominal model: equal steps of an order would crowd the speeds where an engine does little, and
leave a gap where it does most. Waves of both orders about the approach's are unlike steps.

A level is held until drawn vessels are steady, and then for a circle, which averages the current out of mean speed and
yaw rate. Where one takes too long, half of one is turned, and where that takes too long as well, or the course is
straight, the level is held for a given time.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from expdesign.dictionary.families.orders import (
    APPROACH,
    HALF_TURN,
    HELM_OFFSET,
    helm_setting,
    ordered,
    run_times,
    steered,
)
from expdesign.dictionary.spec import DURATION, Excitation, PrimitiveSpec, Setting, order_family, share_setting
from expdesign.errors import InputError
from expdesign.simulation.helm import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel

# Waves of helm and engine order about the approach's: inputs unlike steps, to validate with what steps gave.


@order_family(
    DURATION,
    APPROACH,
    helm_setting("amplitude of the helm; positive begins to starboard"),
    Setting(name="helm_period_s", meaning="period of the helm", low=1e-2, high=1e4, searched="time"),
    share_setting("engine_swing", "amplitude of the engine order, as a share of full ahead", default=0.0, high=0.5),
    Setting(name="engine_period_s", meaning="period of the engine order", low=1e-2, high=1e4, searched="time"),
    HELM_OFFSET,
)
def helm_and_engine_waves(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Helm and engine order go up and down in sine waves about the approach's."""
    settings, time_s = request.settings, run_times(vessel, request)
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    swing = settings["engine_swing"]
    if not swing <= approach.drive <= 1.0 - swing:
        raise InputError(
            f"engine_swing is {swing:g}, expected at most {min(approach.drive, 1.0 - approach.drive):.3g}, so that the "
            f"engine order of the approach, {approach.drive:.3g}, stays between 0 and 1"
        )
    helm = settings["helm_rad"] * np.sin(2 * np.pi * time_s / settings["helm_period_s"])
    drive = approach.drive + swing * np.sin(2 * np.pi * time_s / settings["engine_period_s"])
    return ordered(approach, drive, settings["helm_offset_rad"] + helm)


# How long a level must be held: until drawn vessels are steady, and then for a circle.

SETTLED = 4.0  # time constants until a vessel counts as steady: 2 % of the step are left
DRAWN = 400  # vessels of the prior; the share that a level is long enough for is met to 2 %
NUDGE = 1e-4

HOLD_SETTINGS = (
    Setting(
        name="circle_s",
        meaning="most time for the circle, or else the half turn, that each level ends with",
        default=60.0,
        low=0.0,
        high=1e4,
    ),
    Setting(
        name="steady_s",
        meaning="steady time that each level ends with where a half turn takes longer than circle_s",
        default=10.0,
        low=0.0,
        high=1e4,
    ),
    Setting(
        name="sure",
        meaning="share of the vessels drawn from the prior for which each level is long enough",
        default=0.8,
        low=0.5,
        high=0.999,
    ),
)


def hold_times(vessel: Vessel, motions: Array, inputs: Array, settings: Mapping[str, float]) -> Array:
    """(n,) times [s] that levels are held, long enough for a share `sure` of the prior's vessels.

    Args:
        motions: (n, 3) nominal steady u, v, r.
        inputs: (n, m) commands of the levels.
        settings: those of `HOLD_SETTINGS`.

    Raises:
        InputError: too few vessels of the prior become steady at a level.
    """
    drawn = vessel.model.drawn_parameters(DRAWN, np.random.default_rng(0))
    late_s = max(response.delay_s + SETTLED * response.lag_s for response in vessel.responses)
    times_s = np.empty(len(motions))
    for place, (motion, given) in enumerate(zip(motions, inputs, strict=True)):
        slopes, step = _linearised(vessel, drawn, motion, given)
        slowest = -np.linalg.eigvals(slopes).real.max(axis=1)
        settling_s = np.where(slowest > 0, SETTLED / np.where(slowest > 0, slowest, 1.0), np.inf)
        looking_s = _looking_times(np.abs(motion[2] + step), settings) if motion[2] else settings["steady_s"]
        times_s[place] = np.quantile(settling_s + looking_s, settings["sure"], method="higher") + late_s
    if not np.isfinite(times_s).all():
        speed = motions[~np.isfinite(times_s)][0, 0]
        raise InputError(
            f"fewer than {settings['sure']:.0%} of the vessels drawn from model.parameter_std become steady at "
            f"{speed:.3g} m/s, expected a duration_s, a smaller sure, or model.parameter_min and parameter_max"
        )
    return times_s


def _looking_times(rate: Array, settings: Mapping[str, float]) -> Array:
    """(n,) times [s] of a circle, or a half, or the given one, at yaw rates (n,)."""
    circle_s = 2.0 * np.pi / np.maximum(rate, 1e-9)
    half_s, most_s = circle_s / 2.0, settings["circle_s"]
    return np.where(circle_s <= most_s, circle_s, np.where(half_s <= most_s, half_s, settings["steady_s"]))


def _linearised(vessel: Vessel, drawn: Array, motion: Array, inputs: Array) -> tuple[Array, Array]:
    """(n, d, d) slopes of the drawn vessels' accelerations at a motion, and (n,) their steady yaw rates less its.

    The steady state follows from one Newton step. d are the velocities that the model has equations for.
    """
    has = ["uvr".index(name) for name in vessel.model.outputs]

    def rates(at: Array) -> Array:
        parts = vessel.model.accelerations(at, at[:2], inputs, NUMPY, parameters=drawn.T)
        return np.stack(np.broadcast_arrays(*parts, drawn[:, 0])[:3], axis=-1)[:, has]

    nudges = NUDGE * np.eye(3)[has]
    slopes = np.stack([(rates(motion + nudge) - rates(motion - nudge)) / (2 * NUDGE) for nudge in nudges], axis=-1)
    step = -np.einsum("nij,nj->ni", np.linalg.pinv(slopes), rates(motion))
    return slopes, step[:, has.index(2)] if 2 in has else np.zeros(len(drawn))


# Levels of engine order and helm that are gone through up and down, each for as long as it takes.

STEADY_MPS2 = 1e-6
PARTS = 4  # steps of helm from the straight course to a steady turn

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

Level = tuple[Approach, float]
"""Of a staircase: the straight run at its engine order, and its helm [rad] from that, positive to starboard."""


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
        motions = np.array([steady_turn(*level) for level in levels])
        inputs = np.array([one.helm.inputs(one.drive, _angle(begin, helm_rad)) for one, helm_rad in levels])
        times_s = np.ceil(hold_times(begin.helm.vessel, motions, inputs, request.settings) / step_s) * step_s
    stairs = [*range(len(levels)), *range(len(levels) - 2, -1, -1)]
    ends_s = np.cumsum(times_s[stairs])
    samples = round((given_s or float(ends_s[-1])) / step_s)
    place = np.searchsorted(ends_s - step_s / 2, np.arange(samples) * step_s, side="right")
    now = np.array(stairs)[np.minimum(place, len(stairs) - 1)]
    drive, helm = (
        np.array(values)[now] for values in zip(*((one.drive, helm_rad) for one, helm_rad in levels), strict=False)
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


TRIED = 13  # helm angles whose steady turns are computed


def _evenly_turning(approach: Approach, least: float, most: float, shares: Array) -> Array:
    """(n,) helm angles whose steady yaw rates are at shares (n,) of the way from that of `least` to that of `most`.

    Raises:
        InputError: more helm does not turn the vessel faster everywhere.
    """
    angles = np.linspace(0.0, most, TRIED)
    motion, rates = approach.velocity, [0.0]
    for angle in angles[1:].tolist():
        motion = turn_near(approach, angle, motion)
        rates.append(float(motion[2]))
    size = np.abs(rates)
    if np.any(np.diff(size) <= 0):
        raise InputError(f"helm_rad is {most:g}, expected one up to which more helm turns the vessel faster")
    slowest = float(np.interp(abs(least), np.abs(angles), size))
    return np.asarray(np.interp(slowest + (size[-1] - slowest) * shares, size, angles))


@order_family(
    STAIR_DURATION,
    APPROACH,
    helm_setting("largest helm, positive to starboard", default=float(np.radians(15.0))),
    Setting(
        name="least_helm_rad",
        meaning="smallest helm, to the same side: 0 for straight ahead, more to turn all the time in little room",
        default=0.0,
        low=0.0,
        high=HALF_TURN,
    ),
    *STAIRCASE_SETTINGS,
)
def rudder_steps(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Helm over in steps and back again, each held until steady; engine order held."""
    settings = request.settings
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    most = eased(request, approach.drive, settings["helm_rad"])
    approach.helm.check(approach.drive, approach.angle_rad + approach.starboard * most)
    least = float(np.copysign(settings["least_helm_rad"], most))
    if abs(least) >= abs(most):
        raise InputError(f"least_helm_rad is {abs(least):g}, expected less than the largest helm, {abs(most):g}")
    angles = _evenly_turning(approach, least, most, rises(request))
    return staircase(request, approach, [(approach, angle) for angle in angles.tolist()])


@order_family(
    STAIR_DURATION,
    APPROACH,
    helm_setting("helm held throughout, positive to starboard", default=0.0),
    Setting(name="rise", meaning="highest steady speed over the approach speed", default=1.5, low=1.01, high=50),
    *STAIRCASE_SETTINGS,
)
def throttle_steps(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Engine order in steps up to the highest speed and down again, each held until steady; helm held."""
    settings = request.settings
    speeds = settings["speed_mps"] * (1.0 + (settings["rise"] - 1.0) * rises(request))
    approaches = [steady_ahead(vessel, speed) for speed in speeds.tolist()]
    levels = [(one, eased(request, one.drive, settings["helm_rad"])) for one in approaches]
    return staircase(request, steady_ahead(vessel, settings["speed_mps"]), levels)
