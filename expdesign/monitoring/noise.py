"""The noise within a stretch: of the sensors, of waves that the sensors feel, and of forces that push the ship.

The error of a free simulation is white where the sensors alone err. In a sea it is not: waves move the sensors by
periods of seconds, and gusts and waves push the ship, whose answer lasts as long as her time constants. An autopilot
answers both, so that the inputs go with the noise. A filter of the motion in time, with the noise that the reference
shows, leaves the innovations of the error, which are white and do not go with earlier inputs: the scores of changes
then stay unbiased in closed loop. Sensitivities pass through the same filter.

Sources: L. Ljung, System Identification (1999), section 13.4, for closed loops; P. de Jong, Biometrika 78 (1991),
73-88, for the filtered columns of a regression; P. Whittle, Journal of the Royal Statistical Society B 15 (1953),
125-139, for the likelihood of spectra.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from expdesign.values import Array, sealed

FEWEST = 20  # stretches from which noise is learnt
FIRST_BIN = 2  # of a stretch's spectrum: below it the initial velocities and steady forces explain the error
PERIODS_S = (4.0, 6.0, 9.0, 14.0)  # of waves, where the search begins [s]
# waves: shortest period in samples, least and largest share of their motion that a second leaves
SHORTEST_PERIOD, KEPT = 2.5, (0.5, 0.995)
GAIN = 15.0  # log-likelihood by which forces, and then waves, have to explain the spectra better
OTHER_SEA = 2.0  # deviance, in that of the data that noise was learnt from, beyond which it is learnt anew
LEAST_SHARE = 1e-8  # of the variance in the variance of a source
AXES = 3


@sealed(std="4", pushes="3", waves="3")
class Noise:
    """Sources of the error within a stretch, beside what the calibration learns of all."""

    std: Array  # (4,) of the sensors of u, v, r and the rate of the heading; only their ratios matter
    pushes: Array  # (3,) variance that forces on u, v and r add in a second [(m/s)^2/s, (rad/s)^2/s]
    waves: Array  # (3,) variance of u, v and r by waves
    period_s: float  # of the waves [s]
    kept: float  # share of their motion that a second leaves
    unlike: float = 0.0  # deviance of a stretch's spectra from these sources, beyond chance, where they were learnt

    @property
    def white(self) -> bool:
        """Whether the sensors alone err."""
        return not (self.pushes.any() or self.waves.any())

    def same(self, other: Noise) -> bool:
        """Whether all numbers are."""
        return all(np.array_equal(value, getattr(other, name)) for name, value in vars(self).items())

    def wave_transition(self, step_s: float) -> Array:
        """(2, 2) of the motion by waves and a companion a quarter of a period behind."""
        turn = 2.0 * np.pi * step_s / self.period_s
        c, s = np.cos(turn), np.sin(turn)
        return np.asarray(self.kept**step_s * np.array([[c, -s], [s, c]]))


WHITE = Noise(std=np.ones(4), pushes=np.zeros(AXES), waves=np.zeros(AXES), period_s=10.0, kept=0.9)


def whitened(columns: Array, seen: NDArray[np.bool_], transition: Array, noise: Noise, *, step_s: float) -> Array:
    """(c, w, s, 4) innovations of columns, in the units of the columns.

    Args:
        columns: (c, w, s, 4), zero where not measured.
        seen: (w, s, 4) what is measured.
        transition: (w, k, n, n) over each integrator step, as many between samples as `k` has.
        step_s: of the integrator [s].
    """
    if noise.white:
        return columns
    (w, samples), per_sample = seen.shape[:2], (transition.shape[1] + 1) // seen.shape[1]
    n, waving = transition.shape[-1], np.flatnonzero(noise.waves)
    whole = n + 2 * len(waving)
    shown = np.zeros((4, whole))
    shown[[0, 1, 2, 3], [0, 1, 2, 2]] = 1.0
    moving, fresh = np.zeros((w, whole, whole)), np.zeros(whole)
    fresh[:AXES] = noise.pushes * step_s
    covariance = np.zeros((w, whole, whole))
    for place, axis in enumerate(waving.tolist()):
        own = slice(n + 2 * place, n + 2 * place + 2)
        shown[[axis, 3] if axis == 2 else [axis], own.start] = 1.0
        moving[:, own, own] = noise.wave_transition(step_s)
        fresh[own] = noise.waves[axis] * (1.0 - noise.kept ** (2.0 * step_s))
        covariance[:, own, own] = noise.waves[axis] * np.eye(2)
    table = np.ascontiguousarray(np.moveaxis(columns, (2, 3, 1, 0), (0, 1, 2, 3)))  # (s, 4, w, c)
    told = np.zeros((w, whole, table.shape[-1]))
    result = np.zeros_like(table)
    for sample in range(samples):
        for channel in range(4):
            here = seen[:, sample, channel]
            if not here.any():
                continue
            across = covariance @ shown[channel]
            spread = across @ shown[channel] + noise.std[channel] ** 2
            missed = np.where(here[:, None], table[sample, channel] - shown[channel] @ told, 0.0)
            result[sample, channel] = missed * (noise.std[channel] / np.sqrt(spread))[:, None]
            gain = across / spread[:, None]
            told += gain[:, :, None] * missed[:, None]
            covariance = covariance - np.where(here, 1.0, 0.0)[:, None, None] * gain[:, :, None] * across[:, None]
        for step in range(per_sample * sample, min(per_sample * (sample + 1), transition.shape[1])):
            moving[:, :n, :n] = transition[:, step]
            told = moving @ told
            covariance = moving @ covariance @ np.swapaxes(moving, 1, 2) + np.diag(fresh)
    return np.moveaxis(result, (0, 1, 2, 3), (2, 3, 1, 0))


def learnt_noise(
    columns: Array,
    seen: NDArray[np.bool_],
    transition: Array,
    *,
    changes: int,
    sample_s: float,
    known: Noise | None = None,
) -> Noise:
    """The noise with the largest likelihood of the spectra that the errors have; the known one where it fits them.

    Weather is no property of the ship: later data may show another sea than the reference.

    Args:
        columns: (c, w, s, 4) responses to changes, starts and forces, and the error last; zero where not measured.
        seen: (w, s, 4).
        transition: (w, k, n, n).
        changes: their number, the first of the columns.
        sample_s: between samples [s].
        known: of earlier data.
    """
    whole = seen[..., :AXES].all(axis=(1, 2))
    if whole.sum() < FEWEST:
        return known or WHITE
    left = _residuals(columns[:, whole], seen[whole], changes)
    power = _power(left)
    per_sample = (transition.shape[1] + 1) // seen.shape[1]
    matrix = np.linalg.matrix_power(transition[whole].mean(axis=(0, 1))[:AXES, :AXES], per_sample)
    fit = _Spectra(power=power, count=int(whole.sum()), matrix=matrix, sample_s=sample_s)
    if known is not None and fit.fitted_by(known):
        return known
    noise = fit.best()
    compass = _compass_std(left, seen[whole], float(noise.std[2]))
    return replace(noise, std=np.append(noise.std[:AXES], compass))


def _compass_std(residuals: Array, seen: NDArray[np.bool_], gyro: float) -> float:
    """Standard deviation of the rate of a heading, from its difference from a gyro's rate, which moves alike."""
    apart = np.asarray(residuals[..., 3] - residuals[..., 2])[seen[..., 2:].all(axis=2)]
    return float(np.sqrt(max(float(apart.var()) - gyro**2, 0.01 * gyro**2))) if len(apart) else gyro


def _residuals(columns: Array, seen: NDArray[np.bool_], changes: int) -> Array:
    """(w, s, 4) errors that neither one change of the ship for all nor starts and forces of each stretch explain."""
    scale = np.maximum(columns[-1].std(axis=(0, 1)), 1e-12)
    table = np.where(seen, columns / scale, 0.0)
    rows = np.moveaxis(table, 0, -1).reshape(seen.shape[0], -1, len(columns))
    own = rows[:, :, changes:-1]
    inner = np.swapaxes(own, 1, 2) @ own + 1e-9 * np.eye(own.shape[-1])
    left = rows - own @ np.linalg.solve(inner, np.swapaxes(own, 1, 2) @ rows)
    flat = left.reshape(-1, len(columns))
    shift = np.linalg.solve(
        flat[:, :changes].T @ flat[:, :changes] + np.eye(changes), flat[:, :changes].T @ flat[:, -1]
    )
    return np.asarray((left[..., -1] - left[..., :changes] @ shift).reshape(seen.shape) * scale)


def _power(residuals: Array) -> Array:
    """(3, f) mean of the stretches' spectra above the lowest; white noise has its variance in each."""
    found = np.abs(np.fft.rfft(residuals, axis=1)) ** 2 / residuals.shape[1]
    return np.asarray(found.mean(axis=0).T[:AXES, FIRST_BIN:])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Spectra:
    """Spectra of a reference's errors, and the sources that explain them."""

    power: Array  # (3, f)
    count: int  # of stretches
    matrix: Array  # (3, 3) transition over a sample
    sample_s: float

    def _shape(self, theta: Array, pushed: bool, waving: bool) -> Array:
        """(3, f) spectra for logarithms of variances: sensors (3), pushes (3) and waves (3), period and decay."""
        bins = self.power.shape[1] + FIRST_BIN
        z = np.exp(1j * np.pi * np.arange(FIRST_BIN, bins) / (bins - 1))
        level = np.exp(theta[:AXES])[:, None] * np.ones(len(z))
        if pushed:
            answer = np.linalg.inv(z[:, None, None] * np.eye(AXES) - self.matrix)
            level = level + np.einsum("fij,j->if", np.abs(answer) ** 2, np.exp(theta[AXES : 2 * AXES]))
        if waving:
            turn, kept = 2 * np.pi * self.sample_s / np.exp(theta[-2]), self._kept(theta[-1])
            c, s = kept * np.cos(turn), kept * np.sin(turn)
            own = (np.abs(z - c) ** 2 + s**2) / np.abs((z - c) ** 2 + s**2) ** 2 * (1 - kept**2)
            level = level + np.exp(theta[-2 - AXES : -2])[:, None] * own
        return np.asarray(level)

    def _kept(self, value: float) -> float:
        """Share of the waves that a sample leaves."""
        low, high = KEPT
        return float((low + (high - low) / (1.0 + np.exp(-value))) ** self.sample_s)

    def _found(self, first: Array, *, pushed: bool, waving: bool) -> tuple[float, Array]:
        """Log-likelihood and logarithms of the best sources."""
        scale = np.log(self.power.mean(axis=1))

        def cost(theta: Array) -> float:
            level = self._shape(theta, pushed, waving)
            return float((np.log(level) + self.power / level).sum())

        ends = [(one - 18.0, one + 3.0) for one in scale]
        bounds = ends + ends * pushed + ends * waving
        if waving:
            bounds += [(np.log(SHORTEST_PERIOD * self.sample_s), np.log(30.0)), (-4.0, 4.0)]
        best: Any = minimize(cost, first, bounds=bounds, method="L-BFGS-B")
        return -self.count * float(best.fun), np.asarray(best.x)

    def best(self) -> Noise:
        """Sensors alone; with pushes, and with waves, where these explain the spectra clearly better."""
        scale = np.log(self.power.mean(axis=1))
        value, theta = self._found(scale, pushed=False, waving=False)
        pushed = waving = False
        more, other = self._found(np.concatenate([theta, scale - 5.0]), pushed=True, waving=False)
        if more > value + GAIN:
            value, theta, pushed = more, other, True
        periods = [period for period in PERIODS_S if period > SHORTEST_PERIOD * self.sample_s]
        starts = [np.concatenate([theta, scale - 1.0, [np.log(period), 1.5]]) for period in periods]
        tried = [self._found(start, pushed=pushed, waving=True) for start in starts]
        if tried and max(tried, key=lambda one: one[0])[0] > value + GAIN:
            value, theta = max(tried, key=lambda one: one[0])
            waving = True
        return self._noise(theta, pushed, waving)

    def fitted_by(self, known: Noise) -> bool:
        """Whether sources explain the spectra as well as those that they were learnt from."""
        waving = bool(known.waves.any())
        floor = np.log(LEAST_SHARE * self.power.mean(axis=1))
        logarithms = [
            np.log(np.maximum(values, np.exp(floor)))
            for values in (known.std[:AXES] ** 2, known.pushes * self.sample_s, known.waves)
        ]
        low, high = KEPT
        kept = (min(max(known.kept, low + 1e-6), high - 1e-6) - low) / (high - low)
        theta = np.concatenate([*logarithms, [np.log(known.period_s), np.log(kept / (1.0 - kept))]])
        allowed = self.count * known.unlike + self.power.size
        return self._deviance(theta, bool(known.pushes.any()), waving) < OTHER_SEA * allowed

    def _deviance(self, theta: Array, pushed: bool, waving: bool) -> float:
        """Twice the log-likelihood that the spectra's own values gain; by chance, one for each of them."""
        ratio = self.power / self._shape(theta, pushed, waving)
        return float(2.0 * self.count * (ratio - np.log(ratio) - 1.0).sum())

    def _noise(self, theta: Array, pushed: bool, waving: bool) -> Noise:
        total = self.power.mean(axis=1)

        def kept(values: Array) -> Array:
            return np.where(values > LEAST_SHARE * total, values, 0.0)

        std = np.sqrt(np.exp(theta[:AXES]))
        return Noise(
            std=np.append(std, std[2]),
            pushes=kept(np.exp(theta[AXES : 2 * AXES])) / self.sample_s if pushed else np.zeros(AXES),
            waves=kept(np.exp(theta[-2 - AXES : -2])) if waving else np.zeros(AXES),
            period_s=float(np.exp(theta[-2])) if waving else WHITE.period_s,
            kept=self._kept(theta[-1]) ** (1.0 / self.sample_s) if waving else WHITE.kept,
            unlike=max(self._deviance(theta, pushed, waving) - self.power.size, 0.0) / self.count,
        )
