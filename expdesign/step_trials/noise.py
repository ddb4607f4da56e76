"""What disturbs steady states: noise that is correlated in time, and a steady current.

Standard errors of means. The noise of all plateaus of a record has one autocorrelation, by an autoregression of means
over short blocks, and each plateau its own size, drawn towards that of all as far as it is too short to tell. Taking
means out of short stretches hides slow noise; what it hides is added again until both agree.

A steady current. Over ground a vessel that turns goes faster on some headings than on others:

    u = u_w + c_N cos(psi) + c_E sin(psi)          v = v_w - c_N sin(psi) + c_E cos(psi)

with u_w, v_w constant in each hold, which is a regression on the heading; its covariance comes from how holds differ.

Source: M. B. Priestley, Spectral Analysis and Time Series (1981), 5.3, for means of correlated noise; K.-Y. Liang and
S. L. Zeger, Biometrika 73 (1986), 13-22, for covariances by groups.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.step_trials.holds import Hold, Sailed
from expdesign.values import Array

BLOCKS = 32  # of a plateau of median length, whose means follow an autoregression
ORDER = 3  # of it
ROUNDS = 20  # until what means hide is added
SHARED = 10.0  # independent values that the size of the noise in all plateaus counts as, beside those of one
CLEAR = 20.0  # squared size over its covariance, from which a current is taken off
STEADY_SHARE = 1 / 3  # end of a hold in which the vessel counts as steady here
SMALL = 0.1  # of the mean speed: standard error of a current up to which it is counted though none was seen


def mean_errors(parts: Sequence[Array]) -> tuple[tuple[float, float], ...]:
    """Of each stretch (k,) of one state, all with one sample time; infinite where a stretch is too short to tell.

    Returns:
        Standard error of the mean, and the variance of the mean of many samples, times their number.
    """
    per = max(1, round(float(np.median([len(part) for part in parts])) / BLOCKS))
    means = [_apart(part, per) for part in parts]
    long = [one for one in means if len(one) > ORDER + 1]
    if not long:
        return ((math.inf, math.inf),) * len(parts)
    shape = _autocorrelation(long)
    hidden = [_hidden(shape, len(one)) for one in means]
    own = [float(one @ one) / max(len(one) * (1.0 - gone), 1e-9) for one, gone in zip(means, hidden, strict=True)]
    weight = [len(one) for one in means]
    common = float(np.average(own, weights=weight))
    wider = _wider(sum(1.0 / gone - 1.0 for gone in hidden))
    found = []
    for one, gone, size in zip(means, hidden, own, strict=True):
        independent = 1.0 / gone - 1.0
        variance = (SHARED * common + independent * size) / (SHARED + independent)
        std = wider * math.sqrt(variance * gone) if len(one) > 1 else math.inf
        found.append((std, variance * per * float(shape[0] + 2.0 * shape[1:].sum())))
    return tuple(found)


def _wider(independent: float) -> float:
    """Factor by which 1.96 deviations that so many values tell are widened to hold 95 %, by Student's distribution.

    The power at frequency zero comes from an autoregression: with one of first order phi and n values its relative
    variance is 4 (1 + phi) / (1 - phi) / n, twice that of the variance of n (1 - phi) / (1 + phi) independent values.

    Source: K. N. Berk, Annals of Statistics 2 (1974), 489-502, for errors of autoregressive spectra.
    """
    return float(scipy.stats.t.ppf(0.975, max(independent / 2.0, 1.0)) / scipy.stats.norm.ppf(0.975))


def _apart(part: Array, per: int) -> Array:
    """Means of blocks of so many samples, less their mean."""
    whole = max(1, len(part) // per) * min(per, len(part))
    means = part[:whole].reshape(-1, min(per, len(part))).mean(axis=1)
    return np.asarray(means - means.mean())


def _autocorrelation(parts: Sequence[Array]) -> Array:
    """(k,) of an autoregression, 1 first, as long as the longest stretch."""
    longest, order = max(map(len, parts)), ORDER
    power = np.array(
        [
            sum(float(x[: len(x) - lag] @ x[lag:]) for x in parts) / sum(len(x) - lag for x in parts)
            for lag in range(order + 1)
        ]
    )
    if not power[0] > 0:
        return np.concatenate([[1.0], np.zeros(longest - 1)])
    share, shape = 0.0, np.concatenate([[1.0], np.zeros(longest - 1)])
    for _ in range(ROUNDS):
        now = power + share * power[0] / (1.0 - share)
        shape = _continued(now / now[0], longest)
        hidden = [_hidden(shape, len(x)) for x in parts]
        share = min(0.5, float(np.average(hidden, weights=[len(x) for x in parts])))
    return shape


def _continued(first: Array, count: int) -> Array:
    """The autocorrelation (o + 1,) as an autoregression goes on with it."""
    row = first[:-1] * np.r_[1.0 + 1e-9, np.ones(len(first) - 2)]
    by = scipy.linalg.solve_toeplitz(row, first[1:])
    found = list(np.clip(first, -0.999, 1.0))
    while len(found) < count:
        found.append(min(max(float(by @ found[-1 : -len(by) - 1 : -1]), -1.0), 1.0))
    return np.asarray(found[:count])


def _hidden(shape: Array, count: int) -> float:
    """Variance of the mean of so many values, over theirs."""
    lags = np.arange(1, count)
    total = 1.0 + 2.0 * float((1.0 - lags / count) @ shape[1:count])
    return min(max(total / count, 1e-3 / count), 0.9)


@dataclass(frozen=True, kw_only=True, eq=False)
class Current:
    """Steady current of a record."""

    to_mps: Array  # (2,) to north and east
    covariance: Array  # (2, 2)
    clear: bool  # whether it is taken off


def current_of(batch: Sailed, holds: Sequence[Hold]) -> Current | None:
    """From the turns of a batch; None where its heading or its sway is not known, or it does not turn."""
    if not batch.compass or not np.isfinite(batch.sway).all():
        return None
    information, moment, parts = np.zeros((2, 2)), np.zeros(2), []
    for hold in holds:
        end = slice(hold.end - max(4, int(STEADY_SHARE * (hold.end - hold.settled))), hold.end)
        cos, sin = np.cos(batch.heading[end]), np.sin(batch.heading[end])
        columns = [part - part.mean(axis=0) for part in (np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1))]
        values = [part - part.mean() for part in (batch.surge[end], batch.sway[end])]
        X, y = np.concatenate(columns), np.concatenate(values)
        information += X.T @ X
        moment += X.T @ y
        parts.append((X, y))
    if len(parts) < 3 or np.linalg.cond(information) > 1e6:
        return None
    inverse = np.linalg.inv(information)
    found = inverse @ moment
    scores = np.array([X.T @ (y - X @ found) for X, y in parts])
    covariance = inverse @ (scores.T @ scores) @ inverse * len(parts) / (len(parts) - 2.0)
    size = float(found @ np.linalg.solve(covariance + 1e-12 * np.eye(2), found))
    return Current(to_mps=found, covariance=covariance, clear=size > CLEAR)


def through_water(batch: Sailed, current: Current | None) -> Sailed:
    """The batch without its current where that is clear, and how uncertain it is."""
    if current is None:
        return batch
    if not current.clear:
        small = math.sqrt(float(np.trace(current.covariance))) < SMALL * float(batch.state[:, 0].mean())
        return replace(batch, current_covariance=current.covariance) if small else batch
    cos, sin = np.cos(batch.heading), np.sin(batch.heading)
    north, east = current.to_mps.tolist()
    surge = batch.surge - cos * north - sin * east
    sway = batch.sway + sin * north - cos * east
    state = np.stack([np.hypot(surge, sway), batch.state[:, 1]], axis=1)
    return replace(batch, state=state, surge=surge, sway=sway, current_covariance=current.covariance)
