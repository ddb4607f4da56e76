"""A step trial from its record to the model: holds, steady states, samples, surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import NotInformative
from expdesign.progress import Progress, silent, within
from expdesign.signals import Record
from expdesign.step_trials.dead_times import samples_and_delays
from expdesign.step_trials.holds import CHANNELS, Controls, Hold, Sailed, holds_of, sailed, throttle_sign
from expdesign.step_trials.model import TwoDofModel
from expdesign.step_trials.noise import Current, current_of, through_water
from expdesign.step_trials.samples import Delays, StepSample
from expdesign.step_trials.steady_state import RatioTest, calibrated_tests, hold_advice, steady_from
from expdesign.step_trials.surfaces import (
    EVEN,
    ODD,
    WITH_BIAS,
    Comparison,
    Surface,
    comparisons,
    fitted_surface,
    validity_region,
)
from expdesign.values import Array

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
