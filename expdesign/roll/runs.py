"""Runs at one load each, and their preparation: low-pass filter, fewer samples, differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.errors import InputError, NotInformative
from expdesign.values import Array, seal, sealed
from expdesign.vessel.roll import Load

PASSED_GAIN = 0.9  # least gain of the low-pass filter at the roll frequency
LEAST_SAMPLES_PER_PERIOD = 10.0  # of roll in the data

SAMPLES_PER_PERIOD = 80.0  # of roll, at least; fewer bias the bilinear map by a share of about (pi / samples)^2 / 3
UNWARPED_PERIODS = 3.0  # frequencies, in that of roll, up to which the bilinear map is made exact; none above twice it
MOST_UNWARPED = 0.45  # of these, in half the sample rate
CUTOFF_SHARE = 0.4  # of the rate after thinning out, at which the low-pass filter before it leaves half
TAPS_PER_PERIOD = 2.0  # length of that filter, in periods of its cut-off, to each side
LEAST_SAMPLES = 100  # in a run, beside those that are left out
LEFT_OUT_SAMPLES = 50  # at the beginning of a run, where lags reach before it


EFFECTS = {
    "quadratic": ("quadratic damping, d2 / d of the moment d phi' + d2 abs(phi') phi'", "s/rad"),
    "forward": ("place of the sensor before the axis of yaw", "m"),
    "tilt": ("tilt of the sensor, its bow end up", "rad"),
}
"""What the equation may need besides its parameters: words and unit. The accelerometer reads -x_s r' of its place x_s,
and a tilted gyro reads p cos(tilt) - r sin(tilt) for the roll rate p."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One uninterrupted record."""

    step_s: float  # time between samples [s]
    # (k, 4) roll rate [rad/s], positive to starboard; reading of the accelerometer to port, gravity in it [m/s2]; yaw
    # rate [rad/s], positive to starboard; rudder, of any sign and unit
    signals: Array
    # (k,) what the rudder was planned to be, whatever the ship did; None where it was set beforehand itself
    planned: Array | None = None
    effects: tuple[float, ...] = (0.0, 0.0, 0.0)  # of `EFFECTS`
    unwarped: float = 0.0  # share of half the sample rate, below which the bilinear map of the equation is made exact

    def __post_init__(self) -> None:
        seal(self, signals="k 4", **({} if self.planned is None else {"planned": "k"}))

    @property
    def source(self) -> Array:
        """(k,) signal that moves the rudder and does not depend on the ship's motion: instruments come from it."""
        return self.signals[:, 3] if self.planned is None else self.planned


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Runs at one load."""

    name: str  # for reports
    load: Load | None  # on board; None for the unknown one
    runs: tuple[Run, ...]  # at least one, all with one time between samples


def level(signals: Array, tilt_rad: float) -> Array:
    """(k, 4) signals with roll and yaw rate as of gyros that are not tilted; their bow end is up by the tilt."""
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    rate, sensed, turn, rudder = signals.T
    return np.column_stack([cos * rate + sin * turn, sensed, cos * turn - sin * rate, rudder])


# Low-pass filter and thinning out of runs, which must pass the roll mode.
#
# All signals of a run pass the same symmetric filter, so that the equations between them stay as they are and nothing
# is late.
#
# Source: A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing (2010), 7.5, for windowed filters.


@sealed(taps="n")
class LowPass:
    """The filter and what it does."""

    taps: Array  # (n,) symmetric, n odd; a single one where nothing is filtered
    every: int  # samples out of which one is kept
    roll_hz: float  # frequency of roll, roughly
    passed: float  # gain at that frequency
    bandwidth_hz: float  # at which the gain is 1 / sqrt 2; half the sample rate where it is never as low
    step_s: float  # between the samples that are kept [s]

    def gain(self, frequency_hz: float) -> float:
        """Gain at a frequency."""
        return _gain(self.taps, frequency_hz, self.step_s / self.every)

    @property
    def least_samples(self) -> int:
        """Fewest samples of a run that can be filtered."""
        return len(self.taps) + self.every * (LEFT_OUT_SAMPLES + LEAST_SAMPLES)

    @property
    def samples_per_period(self) -> float:
        """Samples in one period of roll, after the filter."""
        return 1.0 / (self.roll_hz * self.step_s)


def low_pass(cases: Sequence[Case], *, roll_hz: float, cutoff_hz: float | None = None) -> LowPass:
    """The filter for load cases.

    Args:
        cases: of one sample time.
        roll_hz: frequency of roll, roughly.
        cutoff_hz: at which half is left; None for one as low as thinning out needs, if it does.

    Raises:
        InputError: the cut-off is not below half the sample rate, or takes from the roll mode.
        NotInformative: there are too few samples in a period of roll.
    """
    step_s = cases[0].runs[0].step_s
    if 1.0 / (roll_hz * step_s) < LEAST_SAMPLES_PER_PERIOD:
        raise NotInformative(
            f"roll has about {roll_hz:.3g} Hz and the data have {1.0 / step_s:.3g} samples in a second, "
            f"expected {LEAST_SAMPLES_PER_PERIOD:g} or more in a period; record faster"
        )
    every = max(1, int(1.0 / (roll_hz * step_s) / SAMPLES_PER_PERIOD))
    if cutoff_hz is None and every == 1:
        return LowPass(taps=np.ones(1), every=1, roll_hz=roll_hz, passed=1.0, bandwidth_hz=0.5 / step_s, step_s=step_s)
    wanted = CUTOFF_SHARE / (every * step_s) if cutoff_hz is None else cutoff_hz
    if not 0 < wanted < 0.5 / step_s:
        raise InputError(f"the cut-off is {wanted:g} Hz, expected less than half the sample rate, {0.5 / step_s:g} Hz")
    every = every if cutoff_hz is None else max(1, min(every, int(CUTOFF_SHARE / (wanted * step_s))))
    taps = scipy.signal.firwin(2 * int(TAPS_PER_PERIOD / (wanted * step_s)) + 1, wanted, fs=1.0 / step_s)
    found = LowPass(
        taps=taps, every=every, roll_hz=roll_hz, passed=_gain(taps, roll_hz, step_s),
        bandwidth_hz=_bandwidth(taps, step_s), step_s=every * step_s,
    )  # fmt: skip
    if found.passed < PASSED_GAIN:
        raise InputError(
            f"the low-pass filter of {wanted:g} Hz leaves {100 * found.passed:.0f} % of the roll at {roll_hz:.3g} Hz, "
            f"expected {100 * PASSED_GAIN:.0f} % or more; leave it out, or set it to {3 * roll_hz:.2g} Hz"
        )
    return found


def prepared(cases: Sequence[Case], filter_: LowPass) -> tuple[Case, ...]:
    """Filtered and thinned-out cases.

    Raises:
        NotInformative: a run is too short.
    """
    return tuple(replace(case, runs=tuple(_prepared(run, filter_, case.name) for run in case.runs)) for case in cases)


def _prepared(run: Run, filter_: LowPass, name: str) -> Run:
    if len(run.signals) < filter_.least_samples:
        raise NotInformative(
            f"{name} has a run of {len(run.signals)} samples, expected {filter_.least_samples} or more"
        )
    exact = min(UNWARPED_PERIODS * 2.0 / filter_.samples_per_period, MOST_UNWARPED)
    if len(filter_.taps) == 1:
        return replace(run, unwarped=exact)
    planned = None if run.planned is None else _passed(run.planned[:, None], filter_)[:, 0]
    return Run(step_s=filter_.step_s, signals=_passed(run.signals, filter_), planned=planned, unwarped=exact)


def _passed(signals: Array, filter_: LowPass) -> Array:
    """(k, ...) filtered and thinned out."""
    kept = scipy.signal.oaconvolve(signals, filter_.taps[:, None], mode="valid", axes=0)[:: filter_.every]
    return np.asarray(kept)


def _gain(taps: Array, frequency_hz: float, step_s: float) -> float:
    return float(np.abs(scipy.signal.freqz(taps, worN=[frequency_hz], fs=1.0 / step_s)[1][0]))


def _bandwidth(taps: Array, step_s: float) -> float:
    frequencies, response = scipy.signal.freqz(taps, worN=4096, fs=1.0 / step_s)
    low = np.abs(response) < np.sqrt(0.5)
    return float(frequencies[np.argmax(low)]) if low.any() else 0.5 / step_s
