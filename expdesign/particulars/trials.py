"""Standard trials of many variants of one vessel at once: what a fit needs of their results, as arrays.

The trials are those of `expdesign.simulation.standard_trials`, with one time step for all variants; a helm order that
falls within a step goes on in the next one for the time that is left of it, so that results are smooth in parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from expdesign.errors import NoAnswer
from expdesign.particulars.card import Trial
from expdesign.simulation import Helm
from expdesign.simulation.program import RatesProgram
from expdesign.values import Array
from expdesign.vessel import Actuator, Vessel

STEPS_PER_LENGTH = 16  # steps in the time in which she sails her length
LONGEST = 60.0  # ship lengths at approach speed after which a trial is given up

Results = dict[str, Array]


class Fleet:
    """Variants of a vessel that sail side by side.

    Attributes:
        vessel: structure and actuators.
        count: number of variants.
    """

    def __init__(self, vessel: Vessel, parameters: Array, *, fastest_mps: float) -> None:
        """Take variants.

        Args:
            parameters: (n, p) of the variants.
            fastest_mps: above which no steady speed is looked for.
        """
        self.vessel, self.count = vessel, len(parameters)
        self._fastest = fastest_mps
        self._helm = Helm(vessel=vessel)
        self._program = RatesProgram(vessel.model, runs=self.count, parameters=parameters)
        self._zero = np.zeros(self.count)

    def results(self, trial: Trial) -> Results:
        """Quantity -> (n,) of a trial, nan where a variant does not come to its end."""
        return {
            "speed": self._speed, "circle": self._circle, "zigzag": self._zigzag, "stop": self._stop,
            "spin": self._spin, "drift": self._drift,
        }[trial.kind](trial)  # fmt: skip

    def _rates(self, velocity: tuple[Array, Array, Array], inputs: Array, wind_mps: float = 0.0) -> Array:
        """(3, n) accelerations, heading north, in a wind from port."""
        self._program.sea[...] = 0.0
        self._program.sea[3] = wind_mps
        self._program.hold(inputs.T[None])
        self._program.select(0)
        state = np.concatenate([np.zeros((3, self.count)), np.stack(velocity)])
        return np.array(self._program.rates((state,))[0][3:6])

    def _gain(self, speed: Array, drive: Array) -> Array:
        return np.asarray(self._rates((speed, self._zero, self._zero), self._helm.rows(drive, self._zero))[0])

    def _speed(self, trial: Trial) -> Results:
        """Steady speed at an engine order."""
        drive = np.full(self.count, trial.order)
        return {"speed_mps": _root(lambda speed: -self._gain(speed, drive), self._zero, self._zero + self._fastest)}

    def _approach(self, trial: Trial) -> tuple[Array, Array]:
        """Engine order and surge speed (n,) of an approach; beyond full order where only that would hold it."""
        speed = np.full(self.count, trial.speed_mps)
        return _root(lambda drive: self._gain(speed, drive), self._zero, self._zero + 3.0), speed

    def _turn(self, drive: Array, angle: float) -> int:
        """Side to which a helm turns the nominal variant, +1 to starboard."""
        speed = np.full(self.count, 1.0)
        yaw = self._rates((speed, self._zero, self._zero), self._helm.rows(drive, self._zero + angle))[2]
        if not self._helm.means or not yaw[0]:
            raise NoAnswer(f"vessel {self.vessel.name!r} has nothing to steer with")
        return 1 if yaw[0] > 0 else -1

    def _circle(self, trial: Trial) -> Results:
        drive, speed = self._approach(trial)
        hard = min(trial.angle_rad, self._helm.hardest(float(drive[0])))
        helm = self._turn(drive, hard) * hard
        rate = self._helm.angle_rate(1.0)
        angle = self._zero.copy()

        def orders(_state: Array, step_s: float) -> Array:
            nonlocal angle
            before, angle = angle, _toward(angle, helm, rate * step_s)
            return self._helm.rows(drive, (before + angle) / 2)

        times, states = self._sail(
            speed, orders, trial.speed_mps, lambda state: bool(np.all(state[2] > math.radians(183)))
        )
        turned, swift = states[:, 2], np.hypot(states[:, 3], states[:, 4])
        quarter, half = (_first(turned, math.radians(degrees)) for degrees in (90.0, 180.0))
        clock = np.broadcast_to(times[:, None], turned.shape)
        return {
            "advance_m": _at(states[:, 0], quarter), "transfer_m": _at(states[:, 1], quarter),
            "tactical_diameter_m": _at(states[:, 1], half),
            "time_90_s": _at(clock, quarter), "time_180_s": _at(clock, half),
            "speed_90_mps": _at(swift, quarter), "speed_180_mps": _at(swift, half),
        }  # fmt: skip

    def _zigzag(self, trial: Trial) -> Results:
        drive, speed = self._approach(trial)
        hard = min(trial.angle_rad, self._helm.hardest(float(drive[0])))
        side = self._turn(drive, hard)
        rate, limit = self._helm.angle_rate(1.0), trial.angle_rad
        angle, stage = self._zero.copy(), np.zeros(self.count, dtype=int)
        heading, late = self._zero.copy(), self._zero.copy()
        highest, lowest = self._zero.copy(), self._zero.copy()
        rate_before = self._zero.copy()

        def orders(state: Array, step_s: float) -> Array:
            nonlocal angle, heading, late, rate_before
            sign = np.where(stage == 1, -1.0, 1.0)
            ahead = sign * state[2] - limit
            passed = (ahead >= 0) & (stage < 2)
            late = np.where(passed, step_s * ahead / np.maximum(np.abs(state[2] - heading), 1e-12), 0.0)
            late = np.clip(late, 0.0, step_s)
            stage[passed] += 1
            turning = (state[5] * rate_before < 0) & (stage > 0)
            peak = state[2] - state[5] ** 2 * step_s / (2 * np.where(turning, state[5] - rate_before, 1.0))
            highest[...] = np.where(turning & (stage == 1), np.maximum(highest, peak), highest)
            lowest[...] = np.where(turning & (stage == 2), np.minimum(lowest, peak), lowest)
            stage[turning & (stage == 2) & (lowest < -limit)] = 3
            heading, rate_before = state[2].copy(), state[5].copy()
            order = side * hard * np.where(stage == 1, -1.0, 1.0)
            before = _toward(angle, order, rate * late)
            angle = _toward(before, order, rate * step_s)
            return self._helm.rows(drive, (before + angle) / 2)

        self._sail(speed, orders, trial.speed_mps, lambda _state: bool(np.all(stage == 3)))
        return {
            "overshoot_1_rad": np.where(highest > limit, highest - limit, np.nan),
            "overshoot_2_rad": np.where(lowest < -limit, -lowest - limit, np.nan),
        }

    def _stop(self, trial: Trial) -> Results:
        lever, speed = self._approach(trial)
        rate, goal = self._helm.lever_rate, self._helm.lever(-trial.order)

        def orders(_state: Array, step_s: float) -> Array:
            nonlocal lever
            before, lever = lever, _toward(lever, goal, rate * step_s)
            return self._helm.moved_rows((before + lever) / 2, self._zero)

        rest = 0.0 if trial.order else 0.2 * trial.speed_mps
        times, states = self._sail(
            speed, orders, trial.speed_mps, lambda state: bool(np.all(state[3] <= rest)), LONGEST * 3
        )
        stopped = _first(-states[:, 3], -rest)
        way = np.concatenate(
            [[self._zero], np.cumsum(np.hypot(*np.diff(states[:, :2], axis=0).swapaxes(0, 1)), axis=0)]
        )
        return {"reach_m": _at(way, stopped), "time_s": _at(np.broadcast_to(times[:, None], way.shape), stopped)}

    def _spin(self, _trial: Trial) -> Results:
        """From rest to starboard, all that turns her at full order."""
        rows = np.array([value for one in self.vessel.actuators for value in _turning(one)])
        orders = np.broadcast_to(rows, (self.count, len(rows)))
        yaw = np.maximum(self._rates((self._zero, self._zero, self._zero), orders)[2], 1e-9)
        slow = math.sqrt(math.pi / float(yaw[0]))  # time to turn by 90 degrees without damping
        rise = max(one.limits[0].high / one.responses[0].rate for one in self.vessel.actuators if one.kind != "rudder")
        shafts, age = [name.startswith("n") for name in self.vessel.model.inputs], 0.0

        def started(_state: Array, step_s: float) -> Array:
            nonlocal age
            share, age = min((age + step_s / 2) / rise, 1.0), age + step_s
            return np.asarray(np.where(shafts, share, 1.0) * orders)

        speed = self.vessel.length_m / (slow + rise)
        times, states = self._sail(
            self._zero, started, speed, lambda state: bool(np.all(state[2] > math.radians(91))), LONGEST / 3
        )
        quarter = _first(states[:, 2], math.radians(90))
        return {"turn_90_s": _at(np.broadcast_to(times[:, None], states[:, 2].shape), quarter)}

    def _drift(self, trial: Trial) -> Results:
        """Sway in a wind on the beam, engines stopped, heading held."""
        inputs = np.zeros((self.count, len(self.vessel.model.inputs)))

        def slowing(sway: Array) -> Array:
            return np.asarray(-self._rates((self._zero, sway, self._zero), inputs, trial.speed_mps)[1])

        return {"drift_mps": _root(slowing, self._zero, np.full(self.count, trial.speed_mps))}

    def _sail(
        self,
        speed: Array,
        orders: Callable[[Array, float], Array],
        scale_mps: float,
        over: Callable[[Array], bool],
        longest: float = LONGEST,
    ) -> tuple[Array, Array]:
        """Times (k,) and states (k, 6, n) from a steady course to north."""
        program = self._program
        program.sea[...] = 0.0
        step_s = self.vessel.length_m / scale_mps / STEPS_PER_LENGTH
        state = np.zeros((6, self.count))
        state[3] = speed
        states = [state]
        with np.errstate(over="ignore", invalid="ignore"):
            while not over(state) and len(states) < longest * STEPS_PER_LENGTH:
                program.hold(orders(state, step_s).T[None])
                program.select(0)
                state = program.rk4(state, step_s)
                states.append(state)
        return np.asarray(step_s * np.arange(len(states)), dtype=float), np.array(states)


def _turning(actuator: Actuator) -> Iterable[float]:
    """Commands with which an actuator turns a ship at rest to starboard."""
    high, low = actuator.limits[0].high, actuator.limits[0].low
    if actuator.kind == "tunnel":
        return [high if actuator.forward_m > 0 else low]
    if actuator.kind == "propeller":
        return [0.0 if not actuator.starboard_m else high if actuator.starboard_m < 0 else low]
    if actuator.kind == "azimuth":  # across the line to midships
        across = math.atan2(actuator.forward_m, -actuator.starboard_m)
        return [high, min(max(across, actuator.limits[1].low), actuator.limits[1].high)]
    return [actuator.limits[0].high]


def _toward(value: Array, target: float | Array, most: float | Array) -> Array:
    """Values moved towards a target by so much at most."""
    return np.asarray(value + np.clip(target - value, -np.asarray(most), most))


def _root(curve: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """(n,) where rising functions cross zero, by bisection."""
    for _ in range(45):
        middle = (low + high) / 2
        above = curve(middle) > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray((low + high) / 2)


def _first(curves: Array, level: float) -> tuple[Array, Array]:
    """Sample and share of the next at which curves (k, n) first reach a level; nan shares where they never do."""
    beyond = curves >= level
    index = np.maximum(beyond.argmax(axis=0), 1)
    runs = np.arange(curves.shape[1])
    before, after = curves[index - 1, runs], curves[index, runs]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (level - before) / (after - before)
    return index - 1, np.where(beyond.any(axis=0), share, np.nan)


def _at(curves: Array, when: tuple[Array, Array]) -> Array:
    """(n,) values of curves (k, n) there."""
    index, share = when
    runs = np.arange(curves.shape[1])
    return np.asarray(curves[index, runs] * (1 - share) + curves[index + 1, runs] * share)
