"""Steady-state identification: the ratio of two filtered variances, sample by sample, with calibrated thresholds.

    nu2(i)    = l2 (x(i) - xf(i-1))^2 + (1 - l2) nu2(i-1)
    delta2(i) = l3 (x(i) - x(i-1))^2  + (1 - l3) delta2(i-1)
    xf(i)     = l1 x(i) + (1 - l1) xf(i-1)
    R(i)      = (2 - l1) nu2(i) / delta2(i)

R is about 1 for white noise about a constant mean, and larger in a transient. Noise that is correlated from sample to
sample raises it too, more so the faster the sampling. Therefore samples are averaged over about the correlation time of
the noise, and thresholds are quantiles of R in recorded steady data.

Source: S. Cao and R. R. Rhinehart, An efficient method for on-line identification of steady state, J. Process Control 5
(1995), (1)-(8). Surrogates of equal spectrum: J. Theiler et al., Testing for nonlinearity in time series, Physica D 58
(1992).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.errors import NotInformative
from expdesign.step_trials.holds import Hold, Sailed
from expdesign.step_trials.responses import Transient, fit_first_order
from expdesign.values import Array

MEMORY_SHARE = 0.6  # memory of the filtered signal, as a share of the slower time constants
MOST_DELAY_S = 3.0  # dead times are sought up to this

STEADY_SHARE = 1 / 3  # end of a hold that is taken as steady before any test is calibrated
LOWER_QUANTILE, UPPER_QUANTILE = 0.9, 0.999  # of the ratio in steady data, for its thresholds
UPPER_FACTOR = 2.0  # least ratio of the thresholds
QUICKER = 3.0  # filters of both variances forget so many times as fast
DWELL_MEMORIES = 1.0  # time below the lower threshold after which the vessel is steady, in filter memories
SURROGATES = 40  # of the steady data, to find these quantiles
# a hold that would do: time constants until a response is over, memories until the filters forget it, and a mean of so
# long [s] and of so many samples
SETTLED_CONSTANTS, FORGOTTEN_MEMORIES, MEAN_S, MEAN_SAMPLES = 5.0, 5.0, 10.0, 40
LONGEST_INTERVAL_SHARE = 0.2  # of the filter's memory, between samples of the ratio test


WAITING, TRANSIENT, STEADY = "waiting", "transient", "steady"
"""States of a signal: before its response is seen, while it lasts, and after it."""


@dataclass(frozen=True, kw_only=True)
class RatioTest:
    """Filters and thresholds for one signal."""

    sample_time_s: float  # of the signal [s]
    averaged: int  # samples that are averaged to one of the test
    rate: float  # l1, per averaged sample
    # lower, upper: R below the lower one means steady, above the upper one transient
    lower: float
    upper: float
    noise: float  # variance of the averaged signal in steady state
    constant_s: float = 0.0  # rough time constant of the slower responses [s]; 0 where it is not known

    @property
    def enough_s(self) -> float:
        """A hold long enough for the response, for the filters to forget it, and for a mean [s]."""
        mean_s = max(MEAN_S, MEAN_SAMPLES * self.sample_time_s)
        return SETTLED_CONSTANTS * self.constant_s + FORGOTTEN_MEMORIES * self.memory_s + mean_s

    @property
    def interval_s(self) -> float:
        """Time between averaged samples [s]."""
        return self.averaged * self.sample_time_s

    @property
    def variance_rate(self) -> float:
        """l2 = l3, per averaged sample."""
        return min(0.5, QUICKER * self.rate)

    @property
    def memory_s(self) -> float:
        """Memory of the filtered signal [s]."""
        return self.interval_s / self.rate


@dataclass(frozen=True, kw_only=True)
class Watched:
    """State of the test for one signal."""

    # mean, spread, jitter: xf, nu2 and delta2
    mean: float
    spread: float
    jitter: float
    last: float  # averaged sample before
    mode: str = TRANSIENT  # one of `WAITING`, `TRANSIENT`, `STEADY`
    below_s: float = 0.0  # time that R has been below the lower threshold [s]
    part: tuple[float, ...] = ()  # samples of an unfinished average

    def ratio(self, test: RatioTest) -> float:
        """R."""
        return (2.0 - test.rate) * self.spread / max(self.jitter, 1e-3 * test.noise, 1e-300)


def begun(test: RatioTest, value: float) -> Watched:
    """A test that begins at a sample."""
    return Watched(mean=value, last=value, spread=2.0 * test.noise / (2.0 - test.rate), jitter=2.0 * test.noise)


def stepped(state: Watched, *, responds: bool) -> Watched:
    """The state after a command has changed, to which the signal responds or may respond."""
    return replace(state, mode=WAITING if responds else TRANSIENT, below_s=0.0)


def advanced(state: Watched, test: RatioTest, value: float) -> Watched:
    """The state after one more sample of the signal."""
    part = (*state.part, value)
    if len(part) < test.averaged:
        return replace(state, part=part)
    return _averaged(replace(state, part=()), test, math.fsum(part) / len(part))


def _averaged(state: Watched, test: RatioTest, value: float) -> Watched:
    rate = test.variance_rate
    moved = replace(
        state,
        spread=rate * (value - state.mean) ** 2 + (1.0 - rate) * state.spread,
        jitter=rate * (value - state.last) ** 2 + (1.0 - rate) * state.jitter,
        mean=test.rate * value + (1.0 - test.rate) * state.mean,
        last=value,
    )
    return _judged(moved, test)


def _judged(state: Watched, test: RatioTest) -> Watched:
    ratio = state.ratio(test)
    if state.mode == WAITING:
        return replace(state, mode=TRANSIENT) if ratio >= test.upper else state
    below_s = state.below_s + test.interval_s if ratio <= test.lower else 0.0
    if state.mode == STEADY:
        return replace(state, below_s=below_s, mode=TRANSIENT if ratio >= test.upper else STEADY)
    steady = below_s >= DWELL_MEMORIES * test.memory_s
    return replace(state, below_s=below_s, mode=STEADY if steady else TRANSIENT)


def ratios(values: Array, test: RatioTest) -> Array:
    """(k,) R at every averaged sample of a signal, which begins steady."""
    averaged, start = _means(values, test.averaged), begun(test, float(values[: test.averaged].mean()))
    mean = _filtered(averaged, test.rate, start.mean)
    spread = _filtered((averaged - np.append(start.mean, mean[:-1])) ** 2, test.variance_rate, start.spread)
    jitter = _filtered((averaged - np.append(start.last, averaged[:-1])) ** 2, test.variance_rate, start.jitter)
    return np.asarray((2.0 - test.rate) * spread / np.maximum(jitter, max(1e-3 * test.noise, 1e-300)))


def _filtered(values: Array, rate: float, before: float) -> Array:
    """y(i) = rate x(i) + (1 - rate) y(i-1)."""
    return np.asarray(scipy.signal.lfilter([rate], [1.0, rate - 1.0], values, zi=[(1.0 - rate) * before])[0])


def calibrated(
    steady: Sequence[Array], *, sample_time_s: float, memory_s: float, rng: np.random.Generator
) -> RatioTest:
    """Thresholds from stretches of steady data at the sampling rate in use.

    Args:
        steady: stretches of the signal, each steady but for a slow trend, which is taken out.
        sample_time_s: time between samples [s].
        memory_s: of the filtered signal, about half of the slowest time constant that is to be seen [s].

    Raises:
        NotInformative: the stretches are too short for the memory.
    """
    longest = max(1, int(LONGEST_INTERVAL_SHARE * memory_s / sample_time_s))
    flat = [_without_trend(part) for part in steady if len(part) > 4]
    averaged = min(longest, max(1, round(_correlation_samples(flat))))
    parts = [part for part in (_means(part, averaged) for part in flat) if len(part) > 4]
    if not parts:
        raise NotInformative(
            f"no stretch of steady data is longer than {5 * averaged * sample_time_s:g} s, which is needed to "
            "calibrate the test for steady state: hold the commands for longer"
        )
    rate = min(0.5, averaged * sample_time_s / memory_s)
    noise = max(float(np.mean([np.mean(part**2) for part in parts])), 1e-300)
    blank = RatioTest(
        sample_time_s=sample_time_s, averaged=averaged, rate=rate, lower=math.inf, upper=math.inf, noise=noise
    )
    low, high = np.quantile(_steady_ratios(parts, blank, rng), [LOWER_QUANTILE, UPPER_QUANTILE]).tolist()
    return replace(blank, lower=low, upper=max(high, UPPER_FACTOR * low))


def _steady_ratios(parts: Sequence[Array], blank: RatioTest, rng: np.random.Generator) -> Array:
    """R in surrogates of the steady data, after the filters have settled."""
    joined = np.concatenate(parts)
    alike = replace(blank, averaged=1)
    settled = min(len(joined) // 2, math.ceil(3.0 / blank.rate))
    return np.concatenate([ratios(_surrogate(joined, rng), alike)[settled:] for _ in range(SURROGATES)])


def _surrogate(values: Array, rng: np.random.Generator) -> Array:
    """Noise of the same spectrum."""
    spectrum = np.fft.rfft(values)
    turned = np.exp(2j * np.pi * rng.random(len(spectrum)))
    turned[0] = 1.0
    if len(values) % 2 == 0:
        turned[-1] = 1.0
    return np.asarray(np.fft.irfft(spectrum * turned, n=len(values)))


def _means(values: Array, count: int) -> Array:
    whole = len(values) // count * count
    return np.asarray(values[:whole].reshape(-1, count).mean(axis=1))


def _without_trend(values: Array) -> Array:
    places = np.linspace(-1.0, 1.0, len(values))
    return np.asarray(values - values.mean() - places * (places @ values) / (places @ places))


def _correlation_samples(parts: Sequence[Array]) -> float:
    """Samples until the autocorrelation of the noise falls below 1/e."""
    power = sum(float(part @ part) for part in parts)
    longest = max((len(part) for part in parts), default=0)
    for lag in range(1, longest // 2):
        products = sum(float(part[lag:] @ part[:-lag]) for part in parts if len(part) > lag)
        if products < power / math.e:
            return float(lag)
    return float(max(1, longest // 2))


LEAST_MEMORY_SAMPLES = 10


def calibrated_tests(
    batches: Sequence[Sailed], holds: Sequence[Hold], rng: np.random.Generator
) -> tuple[RatioTest, RatioTest]:
    """The tests for U and r: memory from the slower responses, thresholds from the ends of the holds.

    Raises:
        NotInformative: neither throttle steps nor rudder steps show a response, or holds are too short.
    """
    found = [_constants(batches, holds, channel) for channel in (0, 1)]
    if not any(found):
        raise NotInformative(
            "no step of the throttle alone is followed by a change of speed, and none of the rudder alone by one of "
            "yaw rate: expected steps, one by one, each held until the vessel is steady"
        )
    both = [one or next(filter(None, found)) for one in found]
    return _calibrated(batches, holds, 0, both[0], rng), _calibrated(batches, holds, 1, both[1], rng)


def _constants(batches: Sequence[Sailed], holds: Sequence[Hold], channel: int) -> list[float]:
    """Rough time constants [s] of the steps of a command."""
    own = [hold for hold in holds if hold.channel == channel and not hold.astern]
    return [rough for hold in own if (rough := _rough(batches[hold.batch], hold, holds))]


def _calibrated(
    batches: Sequence[Sailed], holds: Sequence[Hold], channel: int, constants: Sequence[float], rng: np.random.Generator
) -> RatioTest:
    step_s, constant_s = batches[0].sample_time_s, float(np.quantile(constants, 0.75))
    memory_s = max(MEMORY_SHARE * constant_s, LEAST_MEMORY_SAMPLES * step_s)
    ends = [_end(batches[hold.batch], hold, channel) for hold in holds if not hold.astern]
    try:
        test = calibrated(_steadiest(ends), sample_time_s=step_s, memory_s=memory_s, rng=rng)
    except NotInformative as error:
        blank = RatioTest(
            sample_time_s=step_s, averaged=1, rate=step_s / memory_s, lower=0.0, upper=0.0, noise=0.0,
            constant_s=constant_s,
        )  # fmt: skip
        raise NotInformative(f"{error}; {hold_advice(holds, batches, blank)}") from None
    return replace(test, constant_s=constant_s)


def hold_advice(holds: Sequence[Hold], batches: Sequence[Sailed], *tests: RatioTest) -> str:
    """Which hold would do, beside those that there are."""
    usual_s = float(np.median([(one.end - one.begin) * batches[one.batch].sample_time_s for one in holds]))
    enough_s = max(test.enough_s for test in tests)
    constant_s, step_s = max(test.constant_s for test in tests), batches[0].sample_time_s
    return (
        f"they were held for {usual_s:.0f} s; {math.ceil(enough_s / 5) * 5} s or more would do, at "
        f"{1.0 / step_s:.3g} Hz and for a time constant of about {constant_s:.2g} s"
    )


def _end(batch: Sailed, hold: Hold, channel: int) -> Array:
    first = hold.end - max(4, int(STEADY_SHARE * (hold.end - hold.settled)))
    return np.asarray(batch.state[first : hold.end, channel])


def _steadiest(ends: Sequence[Array]) -> list[Array]:
    """The half of the stretches with the least trend, in units of their own noise."""
    trends = [abs(np.polyfit(np.linspace(-1, 1, len(end)), end, 1)[0]) / (np.std(np.diff(end)) + 1e-12) for end in ends]
    return [end for end, trend in zip(ends, trends, strict=True) if trend <= np.median(trends)]


def _rough(batch: Sailed, hold: Hold, holds: Sequence[Hold]) -> float | None:
    """Time constant of the response [s], plateaus taken from the ends of both holds; None where there is none."""
    assert hold.channel is not None
    before = _end(batch, holds[hold.number - 2], hold.channel)
    after = _end(batch, hold, hold.channel)
    size, noise = after.mean() - before.mean(), np.hypot(before.std(), after.std())
    if abs(size) < 2 * noise:
        return None
    values = batch.state[hold.begin : hold.end, hold.channel]
    time_s = batch.time_s[: len(values)]
    data = Transient(time_s=time_s, values=values, before=float(before.mean()), after=float(after.mean()))
    found = fit_first_order(data, delay_s=(0.0, min(MOST_DELAY_S, float(time_s[-1]) / 4))).time_constant_s
    return found if found < time_s[-1] else None


def steady_from(
    batches: Sequence[Sailed], holds: Sequence[Hold], tests: tuple[RatioTest, RatioTest]
) -> tuple[int | None, ...]:
    """Sample from which each hold is steady in U and r, None where it never is.

    The signal that the changed command drives must be seen to respond first. A hold whose response is not seen may
    still be steady: it is when both signals have been still for as long as a seen response may take to begin.
    """
    return tuple(
        found
        for index, batch in enumerate(batches)
        for found in _steady_in(batch, [hold for hold in holds if hold.batch == index], tests)
    )


def _steady_in(batch: Sailed, holds: Sequence[Hold], tests: tuple[RatioTest, RatioTest]) -> list[int | None]:
    if not holds:
        return []
    found: list[int | None] = []
    states = tuple(begun(test, float(value)) for test, value in zip(tests, batch.state[holds[0].settled], strict=True))
    for hold in holds:
        states, steady = watched(batch, hold, states, tests)
        found.append(steady)
    return found


def watched(
    batch: Sailed, hold: Hold, states: tuple[Watched, ...], tests: tuple[RatioTest, RatioTest]
) -> tuple[tuple[Watched, ...], int | None]:
    """States of both tests at the end of a hold, and the sample from which it is steady."""
    states = tuple(stepped(state, responds=hold.channel == place) for place, state in enumerate(states))
    patience = unseen_after_s(tests)
    for sample in range(hold.begin, hold.end):
        states = tuple(
            advanced(state, test, float(batch.state[sample, place]))
            for place, (state, test) in enumerate(zip(states, tests, strict=True))
        )
        if (sample - hold.begin) * batch.sample_time_s >= patience:
            states = tuple(given_up(state) for state in states)
        if sample >= hold.settled and all(state.mode == STEADY for state in states):
            rest = [
                (advanced_many(state, test, batch.state[sample + 1 : hold.end, place]))
                for place, (state, test) in enumerate(zip(states, tests, strict=True))
            ]
            return tuple(rest), sample
    return states, None


def advanced_many(state: Watched, test: RatioTest, values: Array) -> Watched:
    """The state after several samples."""
    for value in values.tolist():
        state = advanced(state, test, value)
    return state


def unseen_after_s(tests: tuple[RatioTest, RatioTest]) -> float:
    """Time after which a response that was not seen is no longer waited for [s]."""
    return 4.0 * max(test.memory_s for test in tests)


def given_up(state: Watched) -> Watched:
    """The state, no longer waiting for a response."""
    return stepped(state, responds=False) if state.mode == "waiting" else state
