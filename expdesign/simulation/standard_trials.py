"""Standard trials in calm water, carried out by a simulated helmsman: turning circle, zig-zag, pull-out, turn, stop.

Every trial starts at the origin, heading north, steady ahead (`steady_ahead`), and gives the commands, which obey all
limits and rates and can be run again by `simulate`, and the motion. Orders follow the motion and fall where their
moment falls, also between samples: the command of that sample is the mean over it of an order that moves with the
largest rate. So results vary continuously with the model's parameters.

Source: IMO MSC/Circ.1053 (2002), 2; ITTC Recommended Procedure 7.5-04-02-01 (2017).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.errors import Diverged, InputError, NoAnswer, UnknownName
from expdesign.signals import Commands, Trajectory
from expdesign.simulation.actuation import ActuatorState, moved, step_shares
from expdesign.simulation.helm import Approach, Helm, steady_ahead
from expdesign.simulation.motion import begun
from expdesign.simulation.run import LARGEST_SPEED, SUBSTEPS
from expdesign.values import Array
from expdesign.vessel import Vessel

Trial = tuple[Commands, Trajectory]
LONGEST = 300.0  # ship lengths at approach speed after which an unfinished trial ends
STILL = np.zeros((1, 4))  # calm water and air


@dataclass(frozen=True, kw_only=True)
class Conduct:
    """How a standard trial is run."""

    speed_mps: float | None = None  # approach speed through water, or None for `service_speed`
    approach_s: float = 0.0  # steady run before the first order
    duration_s: float | None = None  # length of the whole trial, or None to end it where the trial is complete
    sample_time_s: float | None = None  # time between commands, or None for the vessel's


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Orders that stand until `left`, a function of (time since its start, state), comes down to zero."""

    angle_rad: float
    drive: float
    left: Callable[[float, Array], float]


@dataclass(frozen=True, kw_only=True)
class _Orders:
    """Where engine order and helm stand; they move towards a stage's with their largest rates."""

    helm: Helm  # turns them into commands
    # lever, angle_rad: at the beginning of the sample; see `Helm.lever`
    lever: float
    angle_rad: float
    step_s: float  # time between samples

    def toward(self, old: Stage, new: Stage, share: float) -> tuple[list[float], _Orders]:
        """The mean command of a sample in which `new` follows `old` after a share of it, and the orders at its end."""
        levers, angles = [], []
        lever, angle = self.lever, self.angle_rad
        for stage, part in ((old, share), (new, 1 - share)):
            time_s = part * self.step_s
            if time_s > 0:
                most = self.helm.lever_rate * time_s
                mean, lever = map(float, moved(lever, self.helm.lever(stage.drive), most))
                levers.append(mean * part)
                mean, angle = map(float, moved(angle, stage.angle_rad, self.helm.angle_rate(stage.drive) * time_s))
                angles.append(mean * part)
        end = _Orders(helm=self.helm, lever=lever, angle_rad=angle, step_s=self.step_s)
        return self.helm.moved(sum(levers), sum(angles)), end


def sail(approach: Approach, stages: Iterable[Stage], conduct: Conduct, what: str) -> Trial:
    """Run the stages after the approach, sample by sample, each until nothing of it is left."""
    vessel = approach.helm.vessel
    step_s = conduct.sample_time_s or vessel.sample_time_s
    orders = _Orders(helm=approach.helm, lever=approach.drive, angle_rad=approach.angle_rad, step_s=step_s)
    lead_s = step_s * math.ceil(conduct.approach_s / step_s - 1e-9)
    ahead = Stage(angle_rad=approach.angle_rad, drive=approach.drive, left=lambda time, _: lead_s - time)
    waiting = [ahead, *stages] if lead_s else list(stages)
    end_s = LONGEST * vessel.length_m / approach.speed_mps if conduct.duration_s is None else conduct.duration_s
    state: Array = np.array(begun(vessel.model, (0.0, 0.0, 0.0, *approach.velocity.tolist())))
    rows: list[list[float]] = []
    states, began_s, finished = [state], 0.0, False
    motion = _Sample(vessel, step_s)
    actuators = ActuatorState.standing(
        vessel.responses, approach.inputs[:, None], sample_time_s=step_s, substeps=motion.shares
    )
    while not finished and len(rows) < round(end_s / step_s):
        stage, since_s = waiting[0], len(rows) * step_s - began_s
        row, moved = orders.toward(stage, stage, 1.0)
        given = _delivered(actuators, row)
        after = motion.end(state, given)
        share = motion.share_left(stage, since_s, (state, given, after))
        if share is not None and len(waiting) > 1:
            waiting, began_s = waiting[1:], len(rows) * step_s + share * step_s
            row, moved = orders.toward(stage, waiting[0], share)
            after = motion.end(state, _delivered(actuators, row))
        elif share is not None:
            finished = conduct.duration_s is None
        orders, state = moved, after
        actuators = actuators.after(np.array(row)[:, None])
        rows.append(row)
        states.append(state)
    if conduct.duration_s is None and not finished:
        raise NoAnswer(f"{what}: vessel {vessel.name!r} does not come to the end of it within {end_s:.4g} s")
    table: Array = np.array(states)
    commands = Commands(sample_time_s=step_s, names=vessel.model.inputs, values=np.array(rows))
    return commands, Trajectory(sample_time_s=step_s, pose=table[:, :3], velocity=table[:, 3:6])


def _delivered(actuators: ActuatorState, row: list[float]) -> Array:
    """(substeps, m) delivered values over the steps of a sample with these commands."""
    given = actuators.mean(np.array(row)[:, None])[..., 0]
    return np.broadcast_to(given, (actuators.substeps, len(row)))


class _Sample:
    """The motion within one sample, by the integrator steps of `simulate`."""

    def __init__(self, vessel: Vessel, step_s: float) -> None:
        from expdesign.simulation._casadi import compiled_integrator  # CasADi is loaded when a motion is integrated

        self.shares = step_shares(vessel.responses, sample_time_s=step_s, substeps=SUBSTEPS)
        self._vessel, self._step_s = vessel, step_s
        self._integrator = compiled_integrator(vessel.model, "rk4")

    def end(self, state: Array, given: Array) -> Array:
        """The state a sample later, with the delivered values (substeps, m) of each step."""
        return self._stepped(state, given, self._step_s, self.shares)

    def share_left(self, stage: Stage, since_s: float, sailed: tuple[Array, Array, Array]) -> float | None:
        """The share of a sample after which a stage is over, or None when it goes on.

        Args:
            stage: stands since `since_s` before the sample [s].
            since_s: see there.
            sailed: state before, delivered values (substeps, m) of each step, state a sample later.
        """
        before, given, after = sailed
        rest = stage.left(since_s + self._step_s, after)
        if rest > 1e-9:
            return None
        if rest > 0:
            return 1.0

        def left(share: float) -> float:
            time_s = share * self._step_s
            return stage.left(since_s + time_s, self._within(before, given, time_s))

        return 0.0 if left(0.0) <= 0 else float(scipy.optimize.brentq(left, 0.0, 1.0, xtol=1e-12))

    def _within(self, state: Array, given: Array, until_s: float) -> Array:
        """The state a time into the sample."""
        steps_s = self._step_s * self.shares
        for begin_s, each_s, held in zip(np.cumsum(steps_s) - steps_s, steps_s, given, strict=True):
            state = self._stepped(state, held[None], min(max(until_s - begin_s, 0.0), each_s), 1)
        return state

    def _stepped(self, state: Array, given: Array, time_s: float, substeps: int | Array) -> Array:
        state = self._integrator.states(state, given[None], sea=STILL, sample_time_s=time_s, substeps=substeps)[-1]
        if not (np.abs(state[3:]) < LARGEST_SPEED).all():
            raise Diverged(
                f"vessel {self._vessel.name!r}: the model is unstable: a speed passes {LARGEST_SPEED:g} m/s or rad/s"
            )
        return state


SIDES = {"starboard": 1, "port": -1}
MANY = 10_000  # orders of a zig-zag that is limited by its time alone
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
        drives = actuator.kind in ("propeller", "azimuth", "force") and actuator not in approach.helm.turning_round
        if astern and drives and not actuator.limits[0].low < 0:
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
