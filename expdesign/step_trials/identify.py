"""A step trial from its record to the model: holds, steady states, samples, surfaces, dead times.

The control-oriented model has two degrees of freedom:

    m_U(x) dU/dt + sigma_U(x) = throttle(t - d_1)
    m_r(x) dr/dt + sigma_r(x) = rudder(t - d_2),     x = (U, r)

Source: Eriksen and Breivik (2017), with a dead time for each command.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.errors import NotInformative
from expdesign.progress import Progress, silent, within
from expdesign.signals import Record
from expdesign.step_trials.holds import CHANNELS, Controls, Hold, Sailed, holds_of, sailed, throttle_sign
from expdesign.step_trials.noise import Current, current_of, through_water
from expdesign.step_trials.responses import Transient, shared_delay
from expdesign.step_trials.samples import LEAST_GROUP, Delays, StepSample, step_samples, without_outliers
from expdesign.step_trials.steady_state import MOST_DELAY_S, RatioTest, calibrated_tests, hold_advice, steady_from
from expdesign.step_trials.surfaces import (
    EVEN,
    ODD,
    WITH_BIAS,
    Comparison,
    Surface,
    ValidityRegion,
    comparisons,
    fitted_surface,
    validity_region,
)
from expdesign.values import Array

# beginning of a response to the rudder, from which its dead time is found, in time constants, and the least of it
ENTRY_CONSTANTS, LEAST_ENTRY_SAMPLES = 2.0, 10


MEDIAN_OVER_MEAN = math.sqrt(math.pi / 2.0)  # standard error of a median by that of a mean, of normal values
SPEED_DEGREE = 3  # degree of the polynomial in time that the speed follows during a response


def samples_and_delays(
    batches: Sequence[Sailed], holds: Sequence[Hold], steady: Sequence[int | None], *, progress: Progress = silent
) -> tuple[tuple[StepSample, ...], Delays]:
    """A sample of every hold, and the dead times of both commands.

    A dead time belongs to an actuator, not to a step: it is found in each step first, and all responses are fitted anew
    with that of all. Throttle responses are of first order; rudder responses share a shape of second order.
    """
    free = (0.0, MOST_DELAY_S)
    samples = step_samples(batches, holds, steady, delay_s=(free, free), progress=within(progress, 0.0, 0.5))
    delays = dead_time(samples, 0), _rudder_delay(batches, samples)
    bounds = tuple((value, value) for value, _ in delays)
    again = within(progress, 0.5, 1.0)
    fitted = step_samples(batches, holds, steady, delay_s=(bounds[0], bounds[1]), progress=again)
    return without_outliers(fitted), delays


def dead_time(samples: Sequence[StepSample], channel: int) -> tuple[float, float]:
    """Median of the dead times of first order responses, weighted by their information, and its standard error.

    That is of how they scatter. A few may agree by chance: it is their own errors, where these lie between the scatter
    and Student's multiple of it.
    """
    own = [one.first_order for one in samples if one.counts and one.hold.channel == channel]
    found = np.array([max(0.0, part.delay_s) for part in own if part is not None])
    if not len(found):
        return 0.0, math.inf
    weights = np.array([max(part.delay_std_s, 1e-3) ** -2.0 for part in own if part is not None])
    order = np.argsort(found)
    share = np.cumsum(weights[order]) / weights.sum()
    middle = float(found[order][np.searchsorted(share, 0.5)])
    whole, squares = float(weights.sum()), float(np.sum(weights**2))
    scatter = float(np.sum(weights * (found - middle) ** 2)) / whole
    effective = whole**2 / squares
    by_own, by_scatter, most = math.sqrt(1.0 / whole), 0.0, math.inf
    if effective > 1.0 + 1e-9:
        by_scatter = math.sqrt(scatter / (effective - 1.0))
        most = by_scatter * float(scipy.special.stdtrit(effective - 1.0, 0.975)) / 1.96
    return middle, MEDIAN_OVER_MEAN * min(max(by_own, by_scatter), most)


def _rudder_delay(batches: Sequence[Sailed], samples: Sequence[StepSample]) -> tuple[float, float]:
    """Dead time of the rudder from responses of one shape, where there are enough of them."""
    own = [one for one in samples if one.counts and one.hold.channel == 1]
    if len(own) < LEAST_GROUP:
        return dead_time(samples, 1)
    return shared_delay([turn_entry(batches[one.hold.batch], one) for one in own], most_s=MOST_DELAY_S)


def turn_entry(batch: Sailed, step: StepSample) -> Transient:
    """Beginning of the response of the yaw rate to a rudder step, as if the speed stayed that before it.

    A turn takes speed off long after the yaw rate began to follow, and with it yaw rate. The curvature r/U changes
    little then: the yaw rate is scaled by the ratio of the speeds, the end is left out, and the plateau is uncertain by
    as much as the loss of speed changes it. A vessel that loses more than half its speed, or has none, is not scaled.
    """
    data, before, after = step.transient, step.before, step.plateau
    assert data is not None
    assert before is not None
    assert after is not None
    assert step.first_order is not None
    until = max(LEAST_ENTRY_SAMPLES, int(np.searchsorted(
        data.time_s, ENTRY_CONSTANTS * step.first_order.time_constant_s
    )))  # fmt: skip
    speed = batch.state[step.hold.begin : step.hold.begin + len(data.time_s), 0]
    speed = np.polynomial.Polynomial.fit(data.time_s, speed, SPEED_DEGREE)(data.time_s)
    first, last = float(before.state[0]), float(after.state[0])
    if min(first, last, float(speed.min())) < 0.5 * max(first, last, float(speed.max())):
        return replace(data, time_s=data.time_s[:until], values=data.values[:until])
    return replace(
        data,
        time_s=data.time_s[:until],
        values=(data.values * first / speed)[:until],
        after=data.after * first / last,
        after_std=math.hypot(data.after_std, data.after * (1 - last / first)),
    )


LEAST_INERTIA_SHARE = 0.5  # of the smallest measured inertia, below which a surface is cut off
SUBSTEP_SHARE = 0.2  # of the shortest time constant, one step of the simulated model


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoDofModel:
    """Damping and inertia of speed and yaw rate."""

    # sigma_U and sigma_r [unit of throttle, unit of rudder], m_U and m_r [unit of throttle per m/s2, unit of rudder per
    # rad/s2]; None, both of a state, where too few steps of its command count
    damping: tuple[Surface | None, Surface | None]
    inertia: tuple[Surface | None, Surface | None]
    delay_s: tuple[float, float]  # dead times of throttle and rudder [s]
    region: ValidityRegion  # where the model holds; outside, surfaces keep their value at its edge and damping grows

    def rates(self, state: Array, commands: Array) -> Array:
        """(2,) dU/dt [m/s2] and dr/dt [rad/s2] at a state (2,) under delayed commands (2,).

        Outside the region the state is drawn to its edge with the time constant m / k there, so that nothing runs away.
        """
        inside = self.region.nearest(state)
        u, r = inside.tolist()
        beyond = state - inside
        found = np.zeros(2)
        for channel, damping, inertia in self.halves:
            slope = (damping.most - damping.least) / self.region.scale[channel]
            mass = min(max(inertia.at(u, r), LEAST_INERTIA_SHARE * inertia.least), inertia.most)
            found[channel] = (commands[channel] - damping.at(u, r) - slope * beyond[channel]) / mass
        return found

    @property
    def halves(self) -> list[tuple[int, Surface, Surface]]:
        """Place, damping and inertia of each state that the trial gives."""
        pairs = zip(self.damping, self.inertia, strict=True)
        return [
            (place, one, other) for place, (one, other) in enumerate(pairs) if one is not None and other is not None
        ]

    @property
    def quickest_s(self) -> float:
        """A short time constant of the model [s]."""
        return min(
            float(inertia.least * self.region.scale[place] / max(damping.most - damping.least, 1e-12))
            for place, damping, inertia in self.halves
        )

    def simulated(self, measured: Array, commands: Array, *, sample_time_s: float) -> Array:
        """(k, 2) U and r at every sample, under commands (k, 2) as given, held between samples.

        They begin as measured, (k, 2) or the first (2,); a state that is no half of the model stays as measured.
        """
        measured = np.broadcast_to(measured, (len(commands), 2))
        outside = [place for place in range(2) if place not in {one for one, *_ in self.halves}]
        delays = [round(delay / sample_time_s) for delay in self.delay_s]
        acting = np.stack(
            [
                np.concatenate([np.repeat(column[:1], d), column])[: len(column)]
                for column, d in zip(commands.T, delays, strict=True)
            ],
            axis=1,
        )
        parts = max(1, int(np.ceil(sample_time_s / max(SUBSTEP_SHARE * self.quickest_s, 1e-3))))
        states = np.empty((len(commands), 2))
        states[0] = state = np.asarray(measured[0], float)
        for k, given in enumerate(acting[:-1]):
            for _ in range(parts):
                state = self._step(state, given, sample_time_s / parts)
            if outside:
                state[outside] = measured[k + 1, outside]
            states[k + 1] = state
        return states

    def _step(self, state: Array, commands: Array, step_s: float) -> Array:
        """Heun's method; the speed stays at zero or above."""
        first = self.rates(state, commands)
        second = self.rates(state + step_s * first, commands)
        moved = state + step_s / 2 * (first + second)
        return np.array([max(moved[0], 0.0), moved[1]])


LEAST_SAMPLES = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class StepTrial:
    """All that a record of steps gives."""

    # batches, holds: the record
    batches: tuple[Sailed, ...]
    holds: tuple[Hold, ...]
    controls: Controls  # which signals are throttle and rudder
    rudder_sign: int  # +1, or -1 where the rudder signal is negative for turns to starboard; the model's is positive
    tests: tuple[RatioTest, RatioTest]  # of steady state, for U and r
    samples: tuple[StepSample, ...]  # one for each hold
    delays: Delays  # dead time of throttle and rudder with standard error [s]
    model: TwoDofModel  # with two degrees of freedom
    found: tuple[Comparison, ...]  # asymmetry and hysteresis
    currents: tuple[Current | None, ...] = ()  # of each batch, that was taken off; None where none was clear

    @property
    def ahead(self) -> float:
        """+1, or -1 where a negative throttle drives ahead."""
        return throttle_sign(self.batches)

    @property
    def counted(self) -> tuple[StepSample, ...]:
        """Samples that give an inertia."""
        return tuple(one for one in self.samples if one.counts)

    @property
    def repeat(self) -> tuple[StepSample, ...]:
        """Steps that gave none and should be repeated."""
        return tuple(one for one in self.samples if one.problems)


def identify_steps(record: Record, controls: Controls, *, seed: int = 0, progress: Progress = silent) -> StepTrial:
    """Model with two degrees of freedom from a record of steps.

    Raises:
        NotInformative: the record is no step trial, or has too few steps that count.
    """
    batches = tuple(sailed(batch, controls) for batch in record.batches)
    # sternway turns the rudder's effect round
    turns = sum(float(batch.commands[:, 1] @ (batch.state[:, 1] * np.sign(batch.surge))) for batch in batches)
    sign = -1 if turns < 0 else 1
    batches = tuple(replace(batch, commands=batch.commands * [1.0, sign]) for batch in batches)
    holds = holds_of(batches)
    currents = tuple(
        current_of(batch, [one for one in holds if one.batch == place and not one.astern])
        for place, batch in enumerate(batches)
    )
    batches = tuple(through_water(*pair) for pair in zip(batches, currents, strict=True))
    tests = calibrated_tests(batches, holds, np.random.default_rng(seed))
    steady = steady_from(batches, holds, tests)
    samples, delays = samples_and_delays(batches, holds, steady, progress=within(progress, 0.3, 1.0))
    halves = _halves(samples, hold_advice(holds, batches, *tests))
    return StepTrial(
        batches=batches, holds=holds, controls=controls, rudder_sign=sign, tests=tests, samples=samples, delays=delays,
        model=_model(samples, delays, halves), found=comparisons(samples),
        currents=tuple(one if one is not None and one.clear else None for one in currents),
    )  # fmt: skip


def _halves(samples: Sequence[StepSample], advice: str) -> tuple[bool, bool]:
    """Whether the steps give the speed's and the yaw rate's half of the model.

    Raises:
        NotInformative: they give neither, and why; `advice` where holds are too short.
    """
    whys, there = [], []
    for channel, name in enumerate(CHANNELS):
        own = [one for one in samples if one.hold.channel == channel and not one.hold.astern]
        count = sum(one.counts for one in own)
        there.append(count >= LEAST_SAMPLES)
        bad = next((one for one in own if one.problems), None)
        why = f"; step {bad.hold.number}: {bad.problems[0]}" if bad else ""
        whys.append(
            f"{count} of {len(own)} steps of the {name} alone give an inertia, expected {LEAST_SAMPLES} or more{why}"
        )
    if not any(there):
        short = any(one.plateau is None and not one.hold.astern for one in samples)
        raise NotInformative("; ".join([*whys, *[advice] * short]))
    return there[0], there[1]


def _model(samples: Sequence[StepSample], delays: Delays, halves: tuple[bool, bool]) -> TwoDofModel:
    steady = [(one, one.plateau) for one in samples if one.plateau is not None]
    states = np.array([part.state for _, part in steady])
    commands = np.array([one.hold.commands for one, _ in steady])
    both = np.ptp(np.sign(np.round(commands[:, 1], 6))) > 1
    visited = np.concatenate([states, *(one.location[None] for one in samples if one.counts)])
    bases = (EVEN, WITH_BIAS if both else ODD)
    damping = [
        fitted_surface(states, commands[:, place], bases[place]) if there else None
        for place, there in enumerate(halves)
    ]
    inertia = [_inertia(samples, place) if there else None for place, there in enumerate(halves)]
    return TwoDofModel(
        damping=(damping[0], damping[1]), inertia=(inertia[0], inertia[1]), delay_s=(delays[0][0], delays[1][0]),
        region=validity_region(visited),
    )  # fmt: skip


def _inertia(samples: Sequence[StepSample], channel: int) -> Surface:
    """Weighted by 1/m^2: an error of m changes the acceleration by that share.

    Raises:
        NotInformative: one is negative.
    """
    own = [one for one in samples if one.counts and one.hold.channel == channel]
    values = np.array([one.inertia for one in own])
    if (worst := own[int(np.argmin(values))]).inertia <= 0:
        raise NotInformative(
            f"step {worst.hold.number}: more {CHANNELS[channel]} gave less "
            f"{('speed', 'yaw rate')[channel]}, so that its inertia is {worst.inertia:.3g}; expected a vessel that "
            "answers its commands in one direction (leave that step out of the data)"
        )
    states = np.array([one.location for one in own])
    return fitted_surface(states, values, EVEN, weights=_weights(values), bends=True)


def _weights(values: Array) -> Array:
    weights = np.maximum(np.abs(values), 1e-3 * np.max(np.abs(values))) ** -2.0
    return np.asarray(weights / weights.mean())
