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
from expdesign.step_trials.tuning import TUNING
from expdesign.values import Array

WAITING, TRANSIENT, STEADY = "waiting", "transient", "steady"
"""States of a signal: before its response is seen, while it lasts, and after it."""


@dataclass(frozen=True, kw_only=True)
class RatioTest:
    """Filters and thresholds for one signal.

    Attributes:
        sample_time_s: of the signal [s].
        averaged: samples that are averaged to one of the test.
        rate: l1, per averaged sample.
        lower, upper: R below the lower one means steady, above the upper one transient.
        noise: variance of the averaged signal in steady state.
    """

    sample_time_s: float
    averaged: int
    rate: float
    lower: float
    upper: float
    noise: float

    @property
    def interval_s(self) -> float:
        """Time between averaged samples [s]."""
        return self.averaged * self.sample_time_s

    @property
    def variance_rate(self) -> float:
        """l2 = l3, per averaged sample."""
        return min(0.5, TUNING.quicker * self.rate)

    @property
    def memory_s(self) -> float:
        """Memory of the filtered signal [s]."""
        return self.interval_s / self.rate


@dataclass(frozen=True, kw_only=True)
class Watched:
    """State of the test for one signal.

    Attributes:
        mean, spread, jitter: xf, nu2 and delta2.
        last: averaged sample before.
        mode: one of `WAITING`, `TRANSIENT`, `STEADY`.
        below_s: time that R has been below the lower threshold [s].
        part: samples of an unfinished average.
    """

    mean: float
    spread: float
    jitter: float
    last: float
    mode: str = TRANSIENT
    below_s: float = 0.0
    part: tuple[float, ...] = ()

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
    steady = below_s >= TUNING.dwell_memories * test.memory_s
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
        rng: of the surrogates.

    Raises:
        NotInformative: the stretches are too short for the memory.
    """
    longest = max(1, int(TUNING.longest_interval_share * memory_s / sample_time_s))
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
    low, high = np.quantile(_steady_ratios(parts, blank, rng), [TUNING.lower_quantile, TUNING.upper_quantile]).tolist()
    return replace(blank, lower=low, upper=max(high, TUNING.upper_factor * low))


def _steady_ratios(parts: Sequence[Array], blank: RatioTest, rng: np.random.Generator) -> Array:
    """R in surrogates of the steady data, after the filters have settled."""
    joined = np.concatenate(parts)
    alike = replace(blank, averaged=1)
    settled = min(len(joined) // 2, math.ceil(3.0 / blank.rate))
    return np.concatenate([ratios(_surrogate(joined, rng), alike)[settled:] for _ in range(TUNING.surrogates)])


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
