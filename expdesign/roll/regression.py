"""Rows of the sampled equation, y(t) on its past and on differences of other signals, and the spectrum of its noise.

Source: doctoral thesis on grey-box identification of roll with few sensors, (4.33), (5.54).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from expdesign.roll.runs import LEFT_OUT_SAMPLES, Run, level
from expdesign.values import Array, sealed

# of the noise of roll rates to that of other signals, as they enter the equation, that are tried
NOISE_RATIOS = (0.0, *(10.0**power for power in range(-4, 5)), 1e6)
# least sum of squares over its expected value, beyond which intervals are not to be trusted
MOST_SURPRISE = 3.0

LARGEST_POLE = 0.999  # of these models; larger ones are moved inside
SPECTRAL_SEGMENTS = 4  # least number of segments in all runs of a case, where spectra of residuals are estimated
SAMPLES_PER_SEGMENT = 1600.0  # there are as many segments as the root of all samples over this
LEAST_DENSITY = 1e-14  # of that of its peak, in such a spectrum, below which no frequency weighs more


def delayed(signal: Array, lags: Sequence[int]) -> Array:
    """(k, n) a signal (k,) so many samples ago, zero before its beginning."""
    result = np.zeros((len(signal), len(lags)))
    for column, lag in enumerate(lags):
        result[lag:, column] = signal[: len(signal) - lag]
    return result


def difference(signals: Array) -> Array:
    """x(t) - x(t-2) of signals (k, ...), which the bilinear map makes of a derivative; zero for the first two."""
    result = np.zeros_like(signals)
    result[2:] = signals[2:] - signals[:-2]
    return result


@sealed(y="n", X="n 5", effects="n 3 6")
class Rows:
    """The equation y = X theta + noise of one run, whitened, without its mean and its first samples."""

    y: Array  # (n,) roll rate
    X: Array  # (n, 5) regressors
    effects: Array  # (n, 3, 6) of y and X, by `Run.effects`

    def residuals(self, values: Array) -> Array:
        """(n,) residuals at coefficients (5,)."""
        return np.asarray(self.y - self.X @ values)


def build_rows(run: Run, noise: NoiseModel) -> Rows:
    """Rows of a run; those whose past reaches before it are not whitened, so that what they miss does not ring on."""
    *linear, tilt_rad = run.effects
    signals = level(run.signals, tilt_rad)  # first, as the sensor's place counts yaw alone
    table = np.column_stack([signals[:, 0], regressors(signals)])
    effects = _effects(signals, run.step_s)
    table[:2], effects[:2] = 0.0, 0.0
    table[:, :3] = unwarped(table[:, :3], run.unwarped)
    table += np.einsum("kij,i->kj", effects[:, : len(linear)], linear)
    both = np.column_stack([table, effects.reshape(len(table), -1)])
    both = without_start(noise.whitened(both)[LEFT_OUT_SAMPLES:], noise)
    return Rows(y=both[:, 0], X=both[:, 1:6], effects=both[:, 6:].reshape(-1, 3, 6))


def _effects(signals: Array, step_s: float) -> Array:
    """(k, 3, 6) change of y and X by each effect, to first order."""
    rate, turn = signals[:, 0], signals[:, 2]
    found = np.zeros((len(rate), 3, 6))
    # d (phi' + q abs(phi') phi') in place of d phi': the bilinear map makes (1 - a2) / 2 of d
    found[:, 0, 0] = found[:, 0, 2] = bent(rate)
    found[:, 1, 3] = difference(np.gradient(turn, step_s))
    # the ship's own roll rate is p + tilt r, her yaw rate r - tilt p
    found[:, 2, 0], found[:, 2, 1:3], found[:, 2, 4] = turn, -delayed(turn, (1, 2)), -difference(rate)
    return found


def bent(rate: Array) -> Array:
    """(k,) half the difference of abs(phi') phi' over two samples."""
    return difference(np.abs(rate) * rate) / 2.0


def unwarped(columns: Array, share: float) -> Array:
    """(k, 3) columns y(t), -y(t-1), -y(t-2) with derivatives and integrals as they are at low frequencies.

    The bilinear map takes (2 / T) tan(w T / 2) for w. In the equation y(t) - 2 y(t-1) + y(t-2) stands for the
    derivative of roll rate, y(t) + 2 y(t-1) + y(t-2) for its integral: they are passed, without a shift in time,
    through the ratio of w to what is taken for it, and its inverse. At high frequencies, where samples alias the kinks
    of signals, the trapezoids of the bilinear map are the better rule.

    Args:
        share: of half the sample rate, below which frequencies are corrected; none are at 0.
    """
    if not share:
        return columns
    now, one, two = columns.T * [[1.0], [-1.0], [-1.0]]
    half = np.linspace(0.0, np.pi / 2, len(columns) + 1)  # w T / 2 of a run that goes back at its end
    gone = np.clip(2.0 - half / (share * np.pi / 2), 0.0, 1.0)
    ratio = 1.0 + gone * (np.r_[1.0, half[1:] / np.tan(half[1:])] - 1.0)
    bent, middle = _mirrored(now - 2.0 * one + two, ratio), now - two
    slow = _mirrored(now + 2.0 * one + two, 1.0 / ratio)
    return np.column_stack([bent + 2 * middle + slow, bent - slow, 2 * middle - bent - slow]) / 4.0


def _mirrored(signal: Array, gain: Array) -> Array:
    """A signal (k,), followed by itself in reverse, through a gain (k + 1,) at its frequencies."""
    both = np.fft.rfft(np.r_[signal, signal[::-1]])
    return np.asarray(np.fft.irfft(both * gain, 2 * len(signal))[: len(signal)])


def without_start(table: Array, noise: NoiseModel) -> Array:
    """Columns (k, n) without their means, and without what whitening makes of noise before the run.

    The whitening filter has poles near the unit circle, where noise has its zeros. What it does not know of the noise
    before the run rings there for long, in a shape for each of its two states, which are projected out.
    """
    rings = delayed(scipy.signal.lfilter([1.0], noise.moving, np.r_[1.0, np.zeros(len(table) - 1)]), (0, 1))
    Q = np.linalg.qr(np.column_stack([np.ones(len(table)), rings]))[0]
    return np.asarray(table - Q @ (Q.T @ table))


def regressors(signals: Array) -> Array:
    """(k, 5) regressors from signals (k, 4) as in a run, measured or simulated."""
    return np.column_stack([-delayed(signals[:, 0], (1, 2)), difference(signals[:, 1:])])


@sealed(density="f")
class Spectrum:
    """Spectral density of residuals at the frequencies j / n of a real transform of length n, j = 0 to n / 2."""

    density: Array  # (f,) two-sided; its mean over all n frequencies is the variance
    length: int  # n, even
    freedom: float  # degrees of freedom of the estimate at one frequency; infinite for a density that is given

    def divided(self, signals: Array) -> Array:
        """Signals (k, q), k up to half the length, through the filter 1 / density, which shifts nothing in time."""
        changed = transforms(signals, self.length) / self.density
        return np.asarray(scipy.fft.irfft(changed, self.length)[:, : len(signals)].T)

    def covariance(self, columns: Sequence[Array]) -> Array:
        """(q, q) covariance of the sum over runs of Z' e, with columns Z (k, q) of each run that do not depend on e."""
        seen, weights = [transforms(Z, self.length) for Z in columns], shares_of(len(self.density), self.length)
        return np.asarray(sum(real_products(F, weights * self.density * F) for F in seen))


def transforms(signals: Array, length: int) -> Array:
    """(q, f) real transforms of columns (k, q)."""
    return np.asarray(scipy.fft.rfft(np.ascontiguousarray(signals.T), length))


def real_products(one: Array, other: Array) -> Array:
    """(q, p) real part of the sums over frequencies of conjugates of transforms (q, f) with others (p, f)."""
    return np.asarray(one.view(float) @ other.view(float).T)


def shares_of(frequencies: int, length: int) -> Array:
    """(f,) share of each frequency of a real transform of even length, and its negative, among all."""
    return np.asarray(np.r_[1.0, np.full(frequencies - 2, 2.0), 1.0] / length)


def flat_spectrum(residuals: Sequence[Array]) -> Spectrum:
    """Spectrum of white noise with the variance of residuals (k,) of each run."""
    length = _transform_length(residuals)
    variance = max(float(np.var(np.concatenate(residuals))), 1e-300)
    return Spectrum(density=np.full(length // 2 + 1, variance), length=length, freedom=np.inf)


def spectrum(residuals: Sequence[Array]) -> Spectrum:
    """Estimate by averaged periodograms of whitened residuals (k,) of each run of one case.

    Whitening before keeps a narrow peak, and the zero at frequency zero, from leaking into what lies beside them. The
    segments are as long as some degrees of freedom allow; resolution and freedom grow with the record.

    Source: P. D. Welch, IEEE Trans. Audio Electroacoustics 15 (1967), 70-73; R. B. Blackman and J. W. Tukey, The
    Measurement of Power Spectra (1958), for whitening before.
    """
    length, steps = _transform_length(residuals), _segments(residuals)
    density = cross_spectra([one[:, None] for one in residuals], length)[0, 0].real
    return Spectrum(
        density=np.maximum(density, max(LEAST_DENSITY * float(density.max()), 1e-100)),
        length=length,
        freedom=sum(_freedom(len(e) // (n // 2) - 1) for e, n in zip(residuals, steps, strict=True)),
    )


def cross_spectra(signals: Sequence[Array], length: int) -> Array:
    """(c, c, f) cross spectra of signals (k, c) of each run, by the segments of `spectrum`, for transforms of a length.

    Of a conjugate of the second with the first, so that all of one frequency are the covariance of their transforms.
    """
    total, count = sum(map(len, signals)), signals[0].shape[1]
    found = np.zeros((count, count, length // 2 + 1), dtype=complex)
    for one, n in zip(signals, _segments(signals), strict=True):
        window = scipy.signal.windows.hann(n, sym=False)
        parts = np.lib.stride_tricks.sliding_window_view(one, n, axis=0)[:: n - n // 2]  # (s, c, n)
        seen = scipy.fft.rfft((parts - parts.mean(axis=2, keepdims=True)) * window, length)
        share = len(one) / total / len(seen) / (window @ window)
        for i in range(count):
            for j in range(i, count):
                found[i, j] += share * np.einsum("sf,sf->f", seen[:, i], seen[:, j].conj())
    for i in range(count):
        found[i:, i] = found[i, i:].conj()
    return found


def length_for(signals: Sequence[Array]) -> int:
    """Even length of transforms of signals (k, ...) that go through filters as long as a segment of `spectrum`."""
    return 2 * int(scipy.fft.next_fast_len((max(map(len, signals)) + max(_segments(signals))) // 2 + 1))


def _segments(signals: Sequence[Array]) -> list[int]:
    """Samples of a segment in each run: resolution and degrees of freedom both grow with the root of the record."""
    total = sum(map(len, signals))
    count = max(SPECTRAL_SEGMENTS, round(float(np.sqrt(total / SAMPLES_PER_SEGMENT))))
    return [min(len(e), total // count) for e in signals]


def _freedom(segments: int) -> float:
    """Degrees of freedom of averaged periodograms of Hann windows; they overlap by half and correlate by 1 / 36."""
    return 2.0 * segments / (1.0 + 2.0 / 36.0 * (1.0 - 1.0 / segments))


def _transform_length(residuals: Sequence[Array]) -> int:
    return 2 * int(scipy.fft.next_fast_len(max(map(len, residuals)), real=True))


@sealed(past="a", moving="c")
class NoiseModel:
    """Residuals e = (C / D) n with white n, in powers of the delay; its inverse whitens."""

    past: Array  # (o + 1,) D, 1 first
    moving: Array  # (o + 1,) C, 1 first

    def whitened(self, signals: Array) -> Array:
        """Signals (k, ...) through D / C."""
        return np.asarray(scipy.signal.lfilter(self.past, self.moving, signals, axis=0))


WHITE = NoiseModel(past=np.ones(1), moving=np.ones(1))


def noise_model(residuals: Sequence[Array], past: Array, order: int) -> NoiseModel:
    """Model of residuals (k,) of each run: noise of the sensors, coloured by an autoregression.

    Noise of the roll rate enters through A = 1 + a1 q^-1 + a2 q^-2, that of other signals and white moments through
    1 - q^-2. Both have zeros on or near the unit circle, which no short autoregression sees; C is the factor with
    C C* = rho A A* + (1 - q^-2)(1 - q^2), with the rho that leaves the least innovations.

    Args:
        past: (2,) a1 and a2.
    """
    if not sum(float(e @ e) for e in residuals) > 0:
        return WHITE
    models = []
    for rho in NOISE_RATIOS:
        moving = _sensor_factor(past, rho)
        left = [scipy.signal.lfilter([1.0], moving, e) for e in residuals]
        found, innovation = _autoregression(left, order)
        models.append((innovation, NoiseModel(past=found, moving=moving)))
    return min(models, key=lambda pair: pair[0])[1]


def _sensor_factor(past: Array, rho: float) -> Array:
    """C (3,), 1 first."""
    own, others = np.array([1.0, *past]), np.array([1.0, 0.0, -1.0])
    power = rho * np.convolve(own, own[::-1]) + np.convolve(others, others[::-1])
    roots = np.roots(power)
    within = roots[np.argsort(np.abs(roots))[:2]]
    return inside(np.asarray(np.poly(within).real, dtype=float))


def _autoregression(residuals: Sequence[Array], order: int) -> tuple[Array, float]:
    """(order + 1,) 1, -c1, -c2, ... by Yule and Walker, and the variance of its innovations."""
    count = sum(map(len, residuals))
    power = np.array([sum(float(e[: len(e) - lag] @ e[lag:]) for e in residuals) for lag in range(order + 1)]) / count
    power[0] *= 1.0 + 1e-10  # residuals of data without noise may be a sum of few oscillations
    found = scipy.linalg.solve_toeplitz(power[:-1], power[1:])
    return np.concatenate([[1.0], -found]), float(power[0] - found @ power[1:])


def inside(polynomial: Array) -> Array:
    """The polynomial in powers of the delay, with roots beyond the largest allowed circle mirrored at it."""
    roots = np.roots(polynomial)
    sizes = np.maximum(np.abs(roots), 1e-9)
    wanted = np.minimum(np.minimum(sizes, 1.0 / sizes), LARGEST_POLE)
    return np.asarray(np.poly(roots * (wanted / sizes)).real)
