"""Kinds of missing effects that no term of motion describes: places, times, single inputs and clocks.

Each is a disturbance along the simulated path. A vessel file cannot hold them, so they are named and not added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import AXES, OUTPUTS
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ANGLE_STEMS, group_columns
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion, disturbance_of, exogenous_inputs, stacked_rates
from expdesign.values import Array
from expdesign.vessel import stem

LAG_S, MORE_LAG_S = 4.0, 1.0  # of an actuator without a lag, and beyond one that it has
TIMES = 9  # number of times at which an effect may begin, evenly over the data
SATURATED = (0.5, 0.75)  # quantiles of an input at which it may saturate


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of missing effect."""

    words: str  # what is missing, to follow "looks like"
    unit: str  # of its size, or empty
    # per unit of its size, along a motion: that of all windows or of some of them
    disturbance: Callable[[LinearisedMotion], Disturbance]
    whole: bool = False  # its size is one where it is what is missing


def kinds(linear: LinearisedMotion) -> tuple[Kind, ...]:
    """All kinds that the data can show."""
    clock = Kind(words=CLOCK, unit="s per second", disturbance=_drifting)
    return (*_steady(linear), *_by_heading(linear), *_inputs(linear), *_slow_answers(linear), clock)


def _force(axis: int, values: Callable[[Windows], Array], linear: LinearisedMotion) -> Disturbance:
    """In an equation of motion, with values (w, k) in windows."""
    states = linear.motion.states
    force = np.zeros((states.shape[0], states.shape[1] - 1, states.shape[2]))
    force[..., axis] = values(linear.motion.windows)[:, :-1]
    return Disturbance(force=force, sensor=None)


def _steady(linear: LinearisedMotion) -> Iterator[Kind]:
    end_s = max(float(linear.motion.windows.run_time_s[:, :-1].max()), 1.0)
    for name in linear.motion.ship.model.outputs:
        axis, unit = OUTPUTS.index(name), "rad/s\N{SUPERSCRIPT TWO}" if name == "r" else "m/s\N{SUPERSCRIPT TWO}"
        words = f"a steady {'moment' if name == 'r' else 'force'} in {AXES[name]}"
        steady, growing = (partial(_force, axis, values) for values in (_ones, partial(_grown, end_s)))
        yield Kind(words=words, unit=unit, disturbance=steady)
        yield Kind(words=f"{words} that grows with time", unit=f"{unit} at the end", disturbance=growing)


def _ones(windows: Windows) -> Array:
    return np.ones_like(windows.time_s)


def _grown(end_s: float, windows: Windows) -> Array:
    return windows.run_time_s / end_s


def _by_heading(linear: LinearisedMotion) -> Iterator[Kind]:
    if not linear.motion.windows.has_heading:
        return
    for name in linear.motion.ship.model.outputs:
        for times in (1, 2):
            for shape in (np.sin, np.cos):
                text = f"{shape.__name__}({'' if times == 1 else '2 '}heading)"
                words = f"a force in {AXES[name]} that goes with {text}"
                values = partial(_of_heading, shape, times)
                yield Kind(words=words, unit="", disturbance=partial(_force, OUTPUTS.index(name), values))


def _of_heading(shape: Callable[[Array], Array], times: int, windows: Windows) -> Array:
    return shape(times * windows.heading)


def _inputs(linear: LinearisedMotion) -> Iterator[Kind]:
    """Inputs that from some time on stay where they were or do nothing, saturated inputs, and inputs with play."""
    inputs, windows = linear.motion.ship.model.inputs, linear.motion.windows
    times = np.linspace(0.0, float(windows.time_s.max()), TIMES + 2)[1:-1].tolist()
    for column, name in enumerate(inputs):
        for time in times:
            for held, what in ((True, "stuck"), (False, "without effect")):
                run, begin, _ = windows.place(time)
                words = f"{name} {what} from about {time - begin:.0f} s of {run} on"
                changed = partial(_with_inputs, [column], partial(_stopped, held), time)
                yield Kind(words=words, unit="of it", disturbance=changed, whole=True)
    for name in dict.fromkeys(map(stem, inputs)):
        columns = group_columns(name, inputs)
        unit = " rad" if name in ANGLE_STEMS else ""
        sizes = np.abs(np.concatenate([rows[:, columns].ravel() for rows in windows.batch_inputs]))
        for size in np.unique(np.quantile(sizes, SATURATED)).tolist():
            words = f"less effect of {name} above {size:.2g}{unit}, as by saturation or ventilation"
            yield Kind(
                words=words, unit="of it lost", disturbance=partial(_with_inputs, columns, partial(_cut, size), 0.0)
            )
        words = f"play (hysteresis) of {name}"
        yield Kind(words=words, unit=unit.strip(), disturbance=partial(_with_inputs, columns, _play, 0.0))


def _with_inputs(
    columns: list[int],
    change: Callable[[Array, NDArray[np.bool_]], Array],
    begin_s: float,
    linear: LinearisedMotion,
) -> Disturbance:
    """The disturbance by another course of some inputs: `change` of their values (k,) from a time on, by mask (k,).

    To the end of the run: what is stuck in one may be free in the next.
    """
    motion = linear.motion
    windows = motion.windows
    rows = np.concatenate(windows.batch_inputs)  # laid end to end, as the times are
    times = np.arange(len(rows)) * windows.step_s / windows.rows_per_step
    _, begin, length = windows.place(begin_s)
    since = (times >= begin_s) & (times < begin + length)
    for column in columns:
        rows[:, column] = change(rows[:, column], since)
    ends_of_runs = np.cumsum([len(part) for part in windows.batch_inputs])[:-1]
    changed = np.split(rows, ends_of_runs)
    exogenous = exogenous_inputs(motion.ship, replace(windows, batch_inputs=tuple(changed))).without_last_step
    force = stacked_rates(motion.ship, motion.ends, exogenous).mean(axis=0) - linear.mean_rates
    return Disturbance(force=force, sensor=None)


def _cut(size: float, values: Array, _since: NDArray[np.bool_]) -> Array:
    """Values no larger than a size."""
    return np.clip(values, -size, size)


def _stopped(held: bool, values: Array, since: NDArray[np.bool_]) -> Array:
    """Values that stay as they are at the time, or vanish."""
    if not since.any():
        return values
    last = values[max(int(np.argmax(since)) - 1, 0)] if held else 0.0
    return np.where(since, last, values)


def _play(values: Array, _since: NDArray[np.bool_]) -> Array:
    """What follows its order only once that has turned round by more than the play: here of size one."""
    direction = np.sign(np.diff(values, prepend=values[:1]))
    index = np.maximum.accumulate(np.where(direction != 0, np.arange(len(values)), 0))
    return np.asarray(values - 0.5 * direction[index])


def _slow_answers(linear: LinearisedMotion) -> Iterator[Kind]:
    """Lags that are longer at speed, or in slow motion, beside a lag that the model has."""
    motion = linear.motion
    speed = motion.states[:, :-1, 0]
    mean, spread = float(speed.mean()), max(float(speed.std()), 1e-9)
    for name in dict.fromkeys(map(stem, motion.ship.model.inputs)):
        lagging = partial(_lagging, f"lag:{name}", mean, spread)
        yield Kind(words=f"a lag of {name} that changes with speed", unit="s per standard deviation of speed",
                   disturbance=lagging)  # fmt: skip


def _lagging(key: str, mean: float, spread: float, linear: LinearisedMotion) -> Disturbance:
    """By a lag per standard deviation of speed, given the mean speed and its standard deviation over all data."""
    lag_s = linear.motion.ship.get(key)
    more_s = MORE_LAG_S if lag_s else LAG_S
    force = disturbance_of(linear, linear.motion.ship.with_effects({key: lag_s + more_s}), more_s).force
    share = (linear.motion.states[:, :-1, 0] - mean) / spread
    return Disturbance(force=None if force is None else force * share[..., None], sensor=None)


CLOCK = "time stamps of the sensors that drift against those of the inputs"
"""Measurements are later and later: their clock runs at another rate than that of the inputs."""


def _drifting(linear: LinearisedMotion) -> Disturbance:
    motion = linear.motion
    windows = motion.windows
    time = windows.run_time_s[:, :: windows.steps_per_sample][:, : motion.predicted.shape[1], None]
    return Disturbance(force=None, sensor=-time * np.gradient(motion.predicted, windows.sample_s, axis=1))
