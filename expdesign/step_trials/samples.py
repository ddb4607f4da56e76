"""Damping and inertia from each step, and why a step gives none.

At a plateau sigma(x) = tau. Of a step of one command, with k = change of command / change of state and the time
constant T of the response, m = k T, at the middle of the transient.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.progress import Progress, silent
from expdesign.step_trials.holds import CHANNELS, Hold, Sailed
from expdesign.step_trials.noise import mean_errors
from expdesign.step_trials.responses import (
    Response,
    Transient,
    fit_first_order,
    fit_second_order,
    preference,
)
from expdesign.values import Array, sealed

STEADY_BLOCKS = 8  # of a plateau, whose means give its standard error

VISIBLE_DEVIATIONS = 5.0  # change of a steady value, in its standard errors, below which a step is too small
MISFIT = 0.2  # distance of plateau and end of transient, as a share of the step, from which they disagree
OUTLIER = 3.5  # modified z-score from which a value is an outlier (B. Iglewicz and D. Hoaglin, 1993)
LEAST_GROUP = 5  # samples of one command level among which outliers are sought
PREFERRED = 10.0  # decrease of Akaike's criterion from which a second order response is preferred


ASTERN = "astern, or begun from astern: left out, as the model is of a vessel that goes ahead"


@sealed(state="2", std="2", inputs="m", course="2", density="2")
class Plateau:
    """Steady state of a hold."""

    # state, std: (2,) mean of U and r, and their standard errors
    state: Array
    std: Array
    # sway, sway_std: mean v and its standard error, nan where it is not known
    sway: float
    sway_std: float
    inputs: Array  # (m,) all inputs of the record
    turns: int  # whole turns over which the mean was taken, which cancel a current to first order; 0 for none
    duration_s: float  # time of the mean [s]
    # (2,) mean cosine and sine of the heading, near zero over whole turns
    course: Array = field(default_factory=lambda: np.zeros(2))
    samples: int = 0  # of the mean
    density: Array = field(default_factory=lambda: np.zeros(2))  # of the noise: see `mean_errors`


@dataclass(frozen=True, kw_only=True, eq=False)
class StepSample:
    """What one hold gives."""

    hold: Hold  # its commands
    steady_s: float | None  # time from the change of command until steady [s], None where it never was
    plateau: Plateau | None  # None where the hold was not steady
    before: Plateau | None = None  # plateau of the hold before
    transient: Transient | None = None  # data of the state that the command drives
    response: Response | None = None  # of the state that the command drives: second order where that is preferred
    first_order: Response | None = None  # the same by a first order, for comparison
    middle: tuple[Array, float] | None = None  # (2,) U and r at half of the transient; v, nan where it is not known
    # inertia, inertia_std: m in units of command per acceleration
    inertia: float = math.nan
    inertia_std: float = math.nan
    problems: tuple[str, ...] = ()  # why the step gives no inertia; it should be repeated
    remarks: tuple[str, ...] = ()  # on a step that counts

    @property
    def counts(self) -> bool:
        """Whether it gives an inertia."""
        return self.response is not None and not self.problems

    @property
    def location(self) -> Array:
        """(2,) middle of the transient in U and r."""
        assert self.before is not None
        assert self.plateau is not None
        return np.asarray((self.before.state + self.plateau.state) / 2)

    @property
    def upward(self) -> bool:
        """Whether the command that changed moved away from zero, on the side where it ends."""
        channel = self.hold.channel or 0
        return self.hold.commands[channel] * self.hold.change[channel] > 0


Delays = tuple[tuple[float, float], tuple[float, float]]
"""Dead times of throttle and rudder, two numbers each: bounds, or value and standard error [s]."""


def step_samples(
    batches: Sequence[Sailed],
    holds: Sequence[Hold],
    steady: Sequence[int | None],
    *,
    delay_s: Delays,
    progress: Progress = silent,
) -> tuple[StepSample, ...]:
    """A sample of every hold, with dead times between bounds."""
    plateaus = _with_common_noise(batches, holds, [
        None if begin is None or hold.astern else plateau(batches[hold.batch], begin, hold.end)
        for hold, begin in zip(holds, steady, strict=True)
    ])  # fmt: skip
    samples = []
    for place, (hold, begin) in enumerate(zip(holds, steady, strict=True)):
        progress(f"fitting the response to step {hold.number} of {len(holds)}", place / len(holds))
        samples.append(step_sample(batches[hold.batch], hold, begin, plateaus[place], plateaus[place - 1], delay_s))
    return tuple(samples)


def _with_common_noise(
    batches: Sequence[Sailed], holds: Sequence[Hold], plateaus: Sequence[Plateau | None]
) -> list[Plateau | None]:
    """Plateaus with standard errors by the noise of all of them, and by what is not known of a current."""
    there = [(place, part) for place, part in enumerate(plateaus) if part is not None]
    found = list(plateaus)
    if not there:
        return found
    ends = [slice(holds[place].end - part.samples, holds[place].end) for place, part in there]
    own = [batches[holds[place].batch] for place, _ in there]
    parts = with_errors([part for _, part in there], [batch.state[end] for batch, end in zip(own, ends, strict=True)])
    sways = [batch.sway[end] for batch, end in zip(own, ends, strict=True)]
    known = all(bool(np.isfinite(part).all()) for part in sways)
    sway = mean_errors(sways) if known else [None] * len(there)
    for (place, _), part, batch, v in zip(there, parts, own, sway, strict=True):
        drift = float(part.course @ batch.current_covariance @ part.course)
        across = np.array([-part.course[1], part.course[0]])
        aside = float(across @ batch.current_covariance @ across)
        found[place] = replace(
            part,
            std=np.array([math.hypot(part.std[0], math.sqrt(drift)), part.std[1]]),
            sway_std=part.sway_std if v is None else math.hypot(v[0], math.sqrt(aside)),
        )
    return found


def with_errors(parts: Sequence[Plateau], states: Sequence[Array], *, beside: Sequence[Array] = ()) -> list[Plateau]:
    """Plateaus with standard errors by the noise of all of them; samples correlated by waves count as fewer.

    Args:
        states: (k, 2) U and r that each is the mean of.
        beside: the same of other plateaus, whose noise is counted, too.
    """
    both = [mean_errors([state[:, column] for state in (*beside, *states)])[len(beside) :] for column in (0, 1)]
    return [
        replace(part, std=np.array([u[0], r[0]]), density=np.array([u[1], r[1]]))
        for part, u, r in zip(parts, *both, strict=True)
    ]


def plateau(batch: Sailed, begin: int, end: int) -> Plateau:
    """Mean from a sample to another, over the last whole turns where there are some."""
    turned = np.abs(np.cumsum(batch.state[begin:end, 1])) * batch.sample_time_s
    turns = int(turned[-1] // (2 * np.pi))
    if turns:
        begin += int(np.argmax(turned >= turned[-1] - 2 * np.pi * turns))
    part = slice(begin, end)
    sway = batch.sway[part]
    known = bool(np.isfinite(sway).all())
    return Plateau(
        state=batch.state[part].mean(axis=0),
        std=np.array([standard_error(column) for column in batch.state[part].T]),
        sway=float(sway.mean()) if known else math.nan,
        sway_std=standard_error(sway) if known else math.nan,
        inputs=np.median(batch.inputs[part], axis=0),
        turns=turns,
        duration_s=(end - begin) * batch.sample_time_s,
        course=np.array([np.cos(batch.heading[part]).mean(), np.sin(batch.heading[part]).mean()]),
        samples=end - begin,
    )


def standard_error(values: Array) -> float:
    """Standard error of the mean of correlated values, from the means of blocks."""
    blocks = min(STEADY_BLOCKS, len(values) // 2)
    if blocks < 2:
        return float("inf")
    size = len(values) // blocks
    means = values[: blocks * size].reshape(blocks, size).mean(axis=1)
    return float(means.std(ddof=1) / math.sqrt(blocks))


def step_sample(
    batch: Sailed, hold: Hold, begin: int | None, after: Plateau | None, before: Plateau | None, delay_s: Delays
) -> StepSample:
    """What one hold gives.

    Args:
        batch: in which it is.
        hold: its commands.
        begin: sample from which on it is steady, None where it never is.
        after, before: plateaus of this hold and of the one before.
        delay_s: bounds of both dead times.
    """
    own = StepSample(
        hold=hold,
        steady_s=None if begin is None else (begin - hold.begin) * batch.sample_time_s,
        plateau=after,
        before=None if hold.first else before,
    )
    if hold.astern:
        return replace(own, remarks=(ASTERN,))
    if after is None:
        return replace(own, problems=(f"not steady within {(hold.end - hold.begin) * batch.sample_time_s:.0f} s",))
    if hold.first or not hold.changed:
        return own
    if hold.channel is None:
        return replace(own, remarks=("both commands changed at once",))
    if before is None:
        return replace(own, problems=("the vessel was not steady before it",))
    return _with_response(own, batch, hold, begin or hold.end, delay_s)


def _with_response(own: StepSample, batch: Sailed, hold: Hold, steady: int, delay_s: Delays) -> StepSample:
    assert own.plateau is not None
    assert own.before is not None
    assert hold.channel is not None
    channel, name = hold.channel, ("speed", "yaw rate")[hold.channel]
    if not np.isfinite([*own.plateau.std, *own.before.std]).all():
        return replace(own, problems=("the steady part, or that before, is too short for a mean",))
    size = own.plateau.state[channel] - own.before.state[channel]
    error = math.hypot(own.plateau.std[channel], own.before.std[channel])
    if not abs(size) > VISIBLE_DEVIATIONS * error:
        return replace(own, problems=(f"the {name} changed by {abs(size) / error:.1f} standard errors only",))
    data = Transient(
        time_s=batch.time_s[: steady + 1 - hold.begin],
        values=batch.state[hold.begin : steady + 1, channel],
        before=float(own.before.state[channel]),
        after=float(own.plateau.state[channel]),
        before_std=float(own.before.std[channel]),
        after_std=float(own.plateau.std[channel]),
        density=float(own.plateau.density[channel]),
    )
    return _fitted(own, batch, hold, data, delay_s[channel])


def _fitted(own: StepSample, batch: Sailed, hold: Hold, data: Transient, delay_s: tuple[float, float]) -> StepSample:
    assert hold.channel is not None
    latest = float(data.time_s[-1]) / 3
    delay_s = min(delay_s[0], latest), min(delay_s[1], latest)
    first = fit_first_order(data, delay_s=delay_s)
    response = _preferred(data, first, delay_s) if hold.changed == "rudder" and delay_s[0] == delay_s[1] else first
    slope = hold.change[hold.channel] / data.size
    spread = math.hypot(
        response.time_constant_std_s / response.time_constant_s, data.before_std / data.size, data.after_std / data.size
    )
    inertia = slope * response.time_constant_s
    return replace(
        own,
        transient=data,
        response=response,
        first_order=first,
        middle=_middle(own, batch, hold, response),
        inertia=inertia,
        inertia_std=abs(inertia) * spread,
        problems=tuple(_problems(own, hold, data, response)),
        remarks=()
        if response is first
        else (f"second order, damping {response.damping:.2f}, zero {response.zero_s:.1f} s",),
    )


def _preferred(data: Transient, first: Response, delay_s: tuple[float, float]) -> Response:
    """First order, or the second order of sway and yaw together where the data clearly want it."""
    second = fit_second_order(data, first, delay_s=delay_s)
    return second if preference(first, second) > PREFERRED and second.time_constant_s > 0 else first


def _problems(own: StepSample, hold: Hold, data: Transient, response: Response) -> list[str]:
    found = []
    tail = data.values[-max(3, len(data.values) // 10) :]
    noise = standard_error(tail) if len(tail) > 3 else response.rms
    apart = abs(float(tail.mean()) - data.after)
    if apart > MISFIT * abs(data.size) and apart > 3 * math.hypot(noise, data.after_std):
        found.append("the plateau does not continue the transient (a current, or no whole turn)")
    if response.time_constant_s > float(data.time_s[-1]):
        found.append("the response is slower than the hold is long")
    if response.time_constant_std_s > response.time_constant_s / 2:
        found.append("the time constant is known to half its size only")
    assert hold.channel is not None
    assert own.plateau is not None
    return found


def _middle(own: StepSample, batch: Sailed, hold: Hold, response: Response) -> tuple[Array, float]:
    """The state that the command drives as fitted, the others as measured about that time."""
    assert hold.channel is not None
    half = hold.begin + round((response.delay_s + response.time_constant_s * math.log(2)) / batch.sample_time_s)
    about = max(1, round(0.2 * response.time_constant_s / batch.sample_time_s))
    part = slice(max(hold.begin, half - about), min(hold.end, half + about + 1))
    state = batch.state[part].mean(axis=0) if part.start < part.stop else own.location
    state[hold.channel] = own.location[hold.channel]
    sway = batch.sway[part]
    return state, float(sway.mean()) if len(sway) else math.nan


def modified_scores(values: Array) -> Array:
    """(n,) distances from the median in robust standard deviations, 0.6745 (x - median) / MAD.

    Unlike those from mean and standard deviation, which cannot exceed (n - 1)/sqrt(n), they have no bound.
    """
    apart = values - np.median(values)
    spread = float(np.median(np.abs(apart)))
    return np.asarray(0.6745 * apart / max(spread, 1e-12))


def without_outliers(samples: Sequence[StepSample]) -> tuple[StepSample, ...]:
    """Samples whose inertia is far from the others at one level of the other command are marked, by log(m)."""
    marked = {
        place
        for channel in range(len(CHANNELS))
        for group in _groups(samples, channel)
        for place, score in zip(group, modified_scores(_logs(samples, group)).tolist(), strict=True)
        if abs(score) > OUTLIER
    }
    return tuple(
        replace(one, problems=(*one.problems, "its inertia is an outlier among the steps at the same level"))
        if place in marked
        else one
        for place, one in enumerate(samples)
    )


def _logs(samples: Sequence[StepSample], places: Sequence[int]) -> Array:
    return np.log(np.abs([samples[place].inertia for place in places]))


def _groups(samples: Sequence[StepSample], channel: int) -> list[list[int]]:
    """Places of the samples of one command at one level of the other, where there are enough of them."""
    levels: dict[float, list[int]] = {}
    for place, one in enumerate(samples):
        if one.counts and one.hold.channel == channel:
            level = one.hold.commands[1 - channel]
            near = next((key for key in levels if abs(key - level) <= 0.05 * max(abs(key), abs(level), 1e-9)), level)
            levels.setdefault(near, []).append(place)
    return [group for group in levels.values() if len(group) >= LEAST_GROUP]
