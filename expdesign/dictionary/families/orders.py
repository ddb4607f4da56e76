"""Families that state helm and engine orders: spiral, pull-out, turning circle, zig-zag, crash stop, recorded runs.

Source: ITTC Recommended Procedure 7.5-04-02-01 (2017); IMO MSC.137(76), 6.1 and 6.2, for turning circle and zig-zag;
J. Dieudonne, Collected French papers on the stability of route of ships at sea, 1949-1950, DTMB Translation 246 (1953),
for the spiral.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps

import numpy as np

from expdesign.dictionary.spec import DURATION, Excitation, Family, PrimitiveSpec, Setting, order_family, share_setting
from expdesign.dictionary.trim import hold
from expdesign.errors import InputError
from expdesign.signals import Commands
from expdesign.simulation import Conduct, simulate_many, zigzag
from expdesign.simulation.helm import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel, within_limits

# Engine and helm orders from a steady straight approach, for families defined by commands.

APPROACH = Setting(name="speed_mps", meaning="approach speed, more than 0", low=1e-6, high=50, searched="surge")
HELM_OFFSET = Setting(
    name="helm_offset_rad", meaning="steady helm added to it", default=0.0, low=-1.5, high=1.5, searched="helm"
)
HALF_TURN = np.pi / 2
Helm = Callable[[PrimitiveSpec, Array], Array]
"""(request, time_s (k,)) -> (k,) helm [rad], positive to starboard."""


def helm_setting(meaning: str, *, default: float | None = None) -> Setting:
    """A helm angle; positive turns to starboard, independent of the sign of the actuator's angle."""
    return Setting(name="helm_rad", meaning=meaning, default=default, low=-HALF_TURN, high=HALF_TURN, searched="helm")


def run_times(vessel: Vessel, request: PrimitiveSpec) -> Array:
    """(k,) times at which commands are given."""
    count = round(request.settings["duration_s"] / vessel.sample_time_s)
    return np.asarray(np.arange(count) * vessel.sample_time_s, dtype=float)


def steered(approach: Approach) -> Approach:
    """The approach, if its helm turns the vessel.

    Raises:
        InputError: the helm does not turn the vessel.
    """
    if not approach.starboard:
        raise InputError(
            f"the helm of vessel {approach.helm.vessel.name!r}, {approach.helm.description or 'none'}, does not turn it"
        )
    return approach


def ordered(approach: Approach, drive: Array, helm_rad: Array) -> Excitation:
    """Engine orders (k,) and helm (k,), counted from the approach's and positive to starboard, as commands.

    Raises:
        InputError: an actuator cannot give the largest helm at the approach's engine order.
    """
    angles = approach.angle_rad + approach.starboard * helm_rad
    for angle in (float(angles.min()), float(angles.max())):
        approach.helm.check(approach.drive, angle)
    if approach.helm.turning_round and (drive < 0.0).any():
        steps_s = np.full(len(drive), approach.helm.vessel.sample_time_s)
        rows = approach.helm.followed(drive, angles, steps_s, before=approach.drive)
        return Excitation(velocity=approach.velocity, inputs=approach.inputs, commands=rows)
    pairs, place = np.unique(np.stack([drive, angles], axis=1), axis=0, return_inverse=True)
    rows = np.array([approach.helm.inputs(*pair) for pair in pairs.tolist()])
    return Excitation(velocity=approach.velocity, inputs=approach.inputs, commands=rows[place.ravel()])


def helm_family(*settings: Setting) -> Callable[[Helm], Family]:
    """Makes a family of the function that states its helm; the engine order is the approach's."""

    def family(helm: Helm) -> Family:
        @wraps(helm)
        def orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
            approach = steered(steady_ahead(vessel, request.settings["speed_mps"]))
            time_s = run_times(vessel, request)
            return ordered(approach, np.full_like(time_s, approach.drive), helm(request, time_s))

        return order_family(*settings)(orders)

    return family


# Crash stop: engines astern until she lies still. Where the file states no time, slower ships of the prior do, too.

STOPPED_SHARE = 0.95  # of the ships of the prior that lie still at the end of a stop of their own length
STOPPED_DRAWS = 200
LONGEST_STOP = 3.0  # times that of the nominal ship, however long the rest take
WATCHED_LENGTHS = 40.0  # ship lengths at the approach's speed in which a ship is seen to stop


def _still(vessel: Vessel, run: Excitation, parameters: list[Array]) -> Array:
    """(n,) samples after which ships of these parameters have no headway in a run; its length where they keep some."""
    commands = within_limits(vessel.actuators, run.commands, sample_time_s=vessel.sample_time_s, before=run.inputs)
    pose = np.zeros((len(parameters), 3))
    states = simulate_many(
        vessel, Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=commands), pose=pose,
        velocity=pose + run.velocity, standing=run.inputs, current_to=pose[:, :2], wind_to=pose[:, :2],
        parameters=np.array(parameters),
    )  # fmt: skip
    ahead = np.nan_to_num(states[:-1, :, 3], nan=1.0) > 0.0
    return np.asarray(np.cumprod(ahead, axis=0).sum(axis=0))


@order_family(
    replace(
        DURATION,
        meaning="duration of one run; 0 for engines astern until 95 % of the ships of the prior lie still",
        default=0.0,
        low=0.0,
    ),
    APPROACH,
    share_setting("astern", "engine order, 1 for full astern", default=1.0),
    share_setting(
        "astern_fraction",
        "share of a stated duration that engines go astern; 0 for until the nominal ship lies still",
        default=0.0,
    ),
)
def crash_stop(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Engines astern from a straight approach until the ship lies still or for a share of the run, then stopped."""
    approach, given = steady_ahead(vessel, request.settings["speed_mps"]), request.settings
    astern, step_s = -given["astern"], vessel.sample_time_s
    length_s = given["duration_s"] or WATCHED_LENGTHS * vessel.length_m / float(approach.velocity[0])
    time_s = np.asarray(step_s * np.arange(round(length_s / step_s)), dtype=float)
    if given["duration_s"] and (share := given["astern_fraction"]):
        return ordered(approach, np.where(time_s < share * length_s, astern, 0.0), 0.0 * time_s)
    whole = ordered(approach, np.full_like(time_s, astern), 0.0 * time_s)
    drawn = vessel.model.drawn_parameters(STOPPED_DRAWS, np.random.default_rng(0)) if not given["duration_s"] else ()
    still = _still(vessel, whole, [vessel.model.parameters, *drawn])
    if given["duration_s"]:
        return ordered(approach, np.where(time_s < step_s * still[0], astern, 0.0), 0.0 * time_s)
    if still[0] == len(time_s):
        raise InputError(
            f"the nominal ship does not lie still {length_s:.4g} s after engines are ordered to {given['astern']:g} of "
            "full astern, expected a duration_s"
        )
    samples = 1 + int(min(np.quantile(still, STOPPED_SHARE, method="higher"), LONGEST_STOP * still[0]))
    return Excitation(velocity=whole.velocity, inputs=whole.inputs, commands=whole.commands[:samples])


@helm_family(
    DURATION,
    APPROACH,
    helm_setting("largest helm, where it begins; positive to starboard", default=float(np.radians(15.0))),
    Setting(name="steps", meaning="steps of helm to each side, a whole number", default=3.0, low=1, high=50),
)
def dieudonne_spiral(request: PrimitiveSpec, time_s: Array) -> Array:
    """Helm in equal steps from one side to the other and back, each held for the same time."""
    steps = round(request.settings["steps"])
    down = np.linspace(1.0, -1.0, 2 * steps + 1)
    levels = np.concatenate([down, down[-2::-1]])  # to the other side and back
    place = (time_s / request.settings["duration_s"] * len(levels)).astype(int)
    return np.asarray(request.settings["helm_rad"] * levels[np.minimum(place, len(levels) - 1)])


# Pull-out: a turn, then helm amidships; the decay of the yaw rate shows whether the ship is stable on course.


@helm_family(
    DURATION,
    APPROACH,
    helm_setting("helm in the turn, positive to starboard", default=float(np.radians(20.0))),
    share_setting("turn_fraction", "share of the run with the helm over", default=0.5, low=0.05, high=0.95),
)
def pull_out(request: PrimitiveSpec, time_s: Array) -> Array:
    """Helm over for a share of the run, then back to the course-keeping angle."""
    turning = time_s < request.settings["turn_fraction"] * request.settings["duration_s"]
    return np.where(turning, request.settings["helm_rad"], 0.0)


@order_family(
    Setting(name="duration_s", meaning="duration of one run, that of the file", low=1e-3, high=1e5),
    Setting(name="speed_mps", meaning="surge speed at the start", default=0.0, low=-50, high=50),
    Setting(name="sway_mps", meaning="sway speed at the start", default=0.0, low=-20, high=20),
    Setting(name="yaw_rate_radps", meaning="yaw rate at the start", default=0.0, low=-5, high=5),
)
def recorded(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Commands read from a CSV file, recorded or made by hand."""
    recorded, settings = request.commands, request.settings
    if recorded is None:
        raise InputError("family 'recorded' needs commands, which a dictionary file gives by the key file")
    if set(recorded.names) != set(vessel.model.inputs):
        raise InputError(
            f"its file commands {', '.join(recorded.names)}, vessel {vessel.name!r} takes "
            f"{', '.join(vessel.model.inputs)}"
        )
    if abs(recorded.sample_time_s - vessel.sample_time_s) > 1e-6 * vessel.sample_time_s:
        raise InputError(
            f"its file has a sample every {recorded.sample_time_s:g} s, vessel {vessel.name!r} takes one every "
            f"{vessel.sample_time_s:g} s"
        )
    values = np.stack([recorded.column(name) for name in vessel.model.inputs], axis=1)
    velocity = np.array([settings["speed_mps"], settings["sway_mps"], settings["yaw_rate_radps"]])
    return Excitation(velocity=velocity, inputs=hold(vessel, velocity), commands=values)


def _levels(rng: np.random.Generator, time_s: Array, hold_s: float, count: int) -> Array:
    """(k,) levels between -1 and 1, each held for an exponential time of mean `hold_s`; `count` of them, 0 for any."""
    many = 8 + int(8 * (time_s[-1] + 1.0) / hold_s)
    changes = np.cumsum(rng.exponential(hold_s, size=many))
    drawn = rng.uniform(-1.0, 1.0, size=many + 1)
    if count:
        drawn = np.floor((drawn + 1.0) / 2.0 * count) * 2.0 / (count - 1) - 1.0
    return np.asarray(drawn[np.searchsorted(changes, time_s)])


@order_family(
    DURATION,
    APPROACH,
    helm_setting("largest helm to both sides"),
    Setting(name="hold_s", meaning="mean time between steps", low=1e-2, high=1e5, searched="time"),
    share_setting("engine_swing", "largest change of the engine order, as a share of full ahead", default=0.0, high=2),
    HELM_OFFSET,
    Setting(
        name="levels",
        meaning="number of even levels from one side to the other, a whole number: 2 for hard to hard; 0 for any",
        default=0.0,
        low=0,
        high=100,
    ),
    Setting(name="draw", meaning="seed of the random numbers", default=1.0, low=0, high=2**31, searched="draw"),
)
def steps(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Engine order and helm step to random levels about the approach's, held for random times."""
    settings, time_s = request.settings, run_times(vessel, request)
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    rng = np.random.default_rng(int(settings["draw"]))
    count = round(settings["levels"])
    if count == 1:
        raise InputError("levels is 1, expected 0 for any, or at least 2")
    engine, helm = (_levels(rng, time_s, settings["hold_s"], count) for _ in range(2))
    drive = np.clip(approach.drive + settings["engine_swing"] * engine, -1.0, 1.0)
    return ordered(approach, drive, settings["helm_offset_rad"] + settings["helm_rad"] * helm)


@helm_family(
    DURATION,
    APPROACH,
    helm_setting("helm, positive to starboard", default=float(np.radians(35.0))),
)
def turning_circle_helm(request: PrimitiveSpec, time_s: Array) -> Array:
    """Helm over from a straight approach and held; engines as on the approach."""
    return np.full_like(time_s, request.settings["helm_rad"])


@order_family(
    DURATION,
    APPROACH,
    helm_setting("helm; positive turns to starboard first", default=float(np.radians(10.0))),
    Setting(
        name="heading_rad",
        meaning="change of heading at which the helm is reversed",
        default=float(np.radians(10.0)),
        low=1e-3,
        high=np.pi,
        searched="heading",
    ),
    closed_loop=True,
)
def zigzag_heading(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    """Helm to one side until the heading has changed by a given angle, then to the other, and so on."""
    settings = request.settings
    approach = steady_ahead(vessel, settings["speed_mps"])
    commands, _ = zigzag(
        vessel,
        heading_rad=settings["heading_rad"],
        helm_rad=abs(settings["helm_rad"]),
        side="starboard" if settings["helm_rad"] > 0 else "port",
        conduct=Conduct(speed_mps=settings["speed_mps"], duration_s=settings["duration_s"]),
    )
    return Excitation(velocity=approach.velocity, inputs=approach.inputs, commands=commands.values)
