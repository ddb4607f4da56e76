"""Dead times of throttle and rudder, from the responses to all of their steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from expdesign.progress import Progress, silent, within
from expdesign.step_trials.holds import Hold, Sailed
from expdesign.step_trials.responses import Transient, shared_delay
from expdesign.step_trials.samples import LEAST_GROUP, Delays, StepSample, step_samples, without_outliers
from expdesign.step_trials.steady_state import MOST_DELAY_S

# beginning of a response to the rudder, from which its dead time is found, in time constants, and the least of it
ENTRY_CONSTANTS, LEAST_ENTRY_SAMPLES = 2.0, 10


MEDIAN_OVER_MEAN = math.sqrt(math.pi / 2.0)
"""Standard error of a median by that of a mean, of normal values."""
SPEED_DEGREE = 3
"""Degree of the polynomial in time that the speed follows during a response."""


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
