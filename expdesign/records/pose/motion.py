"""Velocities in the b-frame from pose, by differences or smoothed, and the origin of each velocity.

The smoother is that of Rauch, Tung and Striebel for a constant-velocity model: each signal is an integrated random walk
observed in white noise, x' = w, w' = white noise of intensity q. With a flat prior, the smoothed states are the minimum
of a quadratic form whose matrix is block tridiagonal, so one banded Cholesky factorisation gives the result of the
forward and backward recursions, and the likelihood. The ratio of q to the measurement variance is the one that makes
the data most likely.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.66)-(3.74), for the difference and its correction;
H. E. Rauch, F. Tung, C. T. Striebel, AIAA Journal 3 (1965) 1445-1450; B. M. Bell, SIAM Journal on Optimization 4 (1994)
626-636 (the smoother as a least-squares problem).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS, POSE_COLUMNS, VELOCITY_COLUMNS, rotated
from expdesign.errors import FileError
from expdesign.records.file import Table, mistyped
from expdesign.values import Array

LOG10_RATIOS = (-9.0, 6.0)  # range of q Ts^3 / variance of the smoother, from strong smoothing to none
LEARNING_SAMPLES = 8192  # samples, from the middle, from which the smoother learns its ratio
SHORTEST_SMOOTHED = 4  # samples that the smoother needs


# Rauch-Tung-Striebel smoother of a constant-velocity model, solved as the banded system that it is.


def smooth(values: Array, sample_time_s: float, *, noise_std: float | None = None) -> tuple[Array, Array]:
    """Smoothed signals and their rates.

    Args:
        values: (k, m) signals with the same noise and the same liveliness, k of 4 or more.
        sample_time_s: time between samples [s].
        noise_std: of the measurements, or None to learn it too.

    Returns:
        Smoothed values (k, m) and rates (k, m) [per second].
    """
    surplus = max(len(values) - LEARNING_SAMPLES, 0) // 2
    ratio = _likeliest_ratio(values[surplus : len(values) - surplus], noise_std)
    state = _solve(values, ratio)[0]
    return state[:, 0], state[:, 1] / sample_time_s


def _likeliest_ratio(values: Array, noise_std: float | None) -> float:
    """Maximum of the restricted likelihood over the ratio: the best of a grid, refined between its neighbours."""

    def cost(exponent: float) -> float:
        return _minus_log_likelihood(values, 10.0**exponent, noise_std)

    grid = np.arange(LOG10_RATIOS[0], LOG10_RATIOS[1] + 0.5)
    best = float(grid[np.argmin([cost(exponent) for exponent in grid])])
    bounds = (max(best - 1.0, LOG10_RATIOS[0]), min(best + 1.0, LOG10_RATIOS[1]))
    return float(
        10.0 ** scipy.optimize.minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.02}).x
    )


def _minus_log_likelihood(values: Array, ratio: float, noise_std: float | None) -> float:
    """Twice the negative restricted log likelihood, up to a constant; the variance at its best unless it is given."""
    count, signals = values.shape
    _, misfit, log_det = _solve(values, ratio)
    freedom = signals * (count - 2)
    tiny = np.finfo(float).tiny + (1e-15 * np.ptp(values)) ** 2
    variance = max(misfit / freedom, tiny) if noise_std is None else max(noise_std**2, tiny)
    return float(freedom * np.log(variance) + misfit / variance + signals * (log_det + 2 * (count - 1) * np.log(ratio)))


def _solve(values: Array, ratio: float) -> tuple[Array, float, float]:
    """States (k, 2, m) [value, change per sample], the least misfit in units of the variance, log det of the matrix."""
    count, signals = values.shape
    line = values[0] + np.linspace(0.0, 1.0, count)[:, None] * (values[-1] - values[0])
    rest = np.zeros((count, 2, signals))
    rest[:, 0] = values - line
    factor = scipy.linalg.cholesky_banded(_matrix(count, ratio), check_finite=False)
    state = scipy.linalg.cho_solve_banded(
        (factor, False), rest.reshape(2 * count, signals), check_finite=False
    ).reshape(rest.shape)
    kick = np.stack([np.diff(state[:, 0], axis=0) - state[:-1, 1], np.diff(state[:, 1], axis=0)])
    misfit = np.sum((rest[:, 0] - state[:, 0]) ** 2) + np.einsum("ikm,ij,jkm->", kick, WEIGHT, kick) / ratio
    state[:, 0] += line
    state[:, 1] += (values[-1] - values[0]) / (count - 1)
    return state, float(misfit), float(2.0 * np.log(factor[-1]).sum())


WEIGHT = np.array([[12.0, -6.0], [-6.0, 4.0]])
"""Inverse of [[1/3, 1/2], [1/2, 1]], the covariance of one sample's kick for unit intensity."""
STEP = np.array([[1.0, 1.0], [0.0, 1.0]])


def _matrix(count: int, ratio: float) -> Array:
    """Upper banded form (4, 2 k) of the information matrix of all states, in units of the variance."""
    onward, across = STEP.T @ WEIGHT @ STEP / ratio, -STEP.T @ WEIGHT / ratio
    blocks = np.zeros((count, 2, 2))
    blocks[:-1] += onward
    blocks[1:] += WEIGHT / ratio
    blocks[:, 0, 0] += 1.0
    banded = np.zeros((4, 2 * count))
    banded[3, 0::2], banded[3, 1::2], banded[2, 1::2] = blocks[:, 0, 0], blocks[:, 1, 1], blocks[:, 0, 1]
    banded[1, 2::2], banded[0, 3::2] = across[0, 0], across[0, 1]
    banded[2, 2::2], banded[1, 3::2] = across[1, 0], across[1, 1]
    return banded


VELOCITY_METHODS = ("auto", "measured", "difference", "smoothed")


def central_difference(pose: Array, sample_time_s: float, *, heading_std_rad: float = 0.0) -> Array:
    """Velocity at all samples but the first and the last.

    Noise on the heading shrinks surge and sway on average by mu = E cos(e) = exp(-var / 2) for Gaussian e; they are
    divided by it. Measurement noise of standard deviation s on positions becomes s / (sqrt(2) Ts), correlated over two
    samples.

    Args:
        pose: (k, 3) n-frame north m, east m, heading rad, continuous.
        sample_time_s: time between samples [s].
        heading_std_rad: standard deviation of the heading's noise [rad].

    Returns:
        (k - 2, 3) u, v, r of samples 1 to k - 2.
    """
    rates = (pose[2:] - pose[:-2]) / (2.0 * sample_time_s)
    shrunk = float(np.exp(-(heading_std_rad**2) / 2.0))
    return np.asarray(turned_to_b(rates, pose[1:-1, 2]) / np.array([shrunk, shrunk, 1.0]))


def smoothed_velocity(pose: Array, sample_time_s: float, *, heading_std_rad: float | None = None) -> Array:
    """Velocity at all samples from a Rauch-Tung-Striebel smoother with a constant-velocity model in the n-frame.

    Positions share one signal-to-noise ratio, so that the answer does not depend on where north is; heading has its
    own. The smoothed heading turns the rates into the b-frame.

    Args:
        pose: (k, 3) n-frame north m, east m, heading rad, continuous; k of 4 or more.
        sample_time_s: time between samples [s].
        heading_std_rad: standard deviation of the heading's noise [rad], or None to learn it from the data.

    Returns:
        (k, 3) u, v, r.
    """
    _, moving = smooth(pose[:, :2], sample_time_s)
    heading, turning = smooth(pose[:, 2:], sample_time_s, noise_std=heading_std_rad)
    return turned_to_b(np.hstack([moving, turning]), heading[:, 0])


def turned_to_b(rates: Array, heading_rad: Array) -> Array:
    """R(psi)^T applied to n-frame rates (k, 3) [m/s, m/s, rad/s] at headings (k,)."""
    north, east, turn = rates.T
    return np.stack([*rotated((north, east), -heading_rad), turn], axis=-1)


MEASURED, DIFFERENCE, SMOOTHED = "measured", "difference", "smoothed"
COLUMN_OF = dict(zip(OUTPUTS, VELOCITY_COLUMNS, strict=True))
NEEDS = {"u": POSE_COLUMNS, "v": POSE_COLUMNS, "r": POSE_COLUMNS[2:]}
SAMPLES = {MEASURED: 2, DIFFERENCE: 4, SMOOTHED: SHORTEST_SMOOTHED}  # samples that a batch must have
DERIVED = "north_m and east_m (or lat_deg and lon_deg) with heading_rad (or heading_deg)"
WORDS = {DIFFERENCE: "central differences of the pose", SMOOTHED: "the smoothed pose"}


@dataclass(frozen=True, kw_only=True)
class Request:
    """Options for velocities."""

    method: str  # "auto", "measured", "difference" or "smoothed"
    heading_std_rad: float | None  # of the heading's noise, or None
    outputs: tuple[str, ...]  # required velocities


def velocity_origins(table: Table, request: Request) -> dict[str, str]:
    """Available velocity (u, v, r) -> measured, difference or smoothed.

    Raises:
        FileError: a required velocity can neither be read nor derived.
    """
    origins: dict[str, str] = {}
    for output, column in COLUMN_OF.items():
        if request.method in ("auto", MEASURED) and column in table.columns:
            origins[output] = MEASURED
        elif request.method != MEASURED and set(NEEDS[output]) <= set(table.columns):
            origins[output] = SMOOTHED if request.method == SMOOTHED else DIFFERENCE
        elif output in request.outputs:
            raise _missing(table, output, column, request.method)
    return origins


def needed_columns(origins: Mapping[str, str]) -> set[str]:
    """The columns that velocities are read or derived from, and the heading."""
    measured = {column for output, column in COLUMN_OF.items() if origins.get(output) == MEASURED}
    derived = (NEEDS[output] for output, origin in origins.items() if origin != MEASURED)
    return measured.union(["heading_rad"], *derived)


def long_enough(batches: tuple[slice, ...], origins: Mapping[str, str]) -> tuple[slice, ...]:
    """The batches that the velocities can be derived in."""
    least = max((SAMPLES[origin] for origin in origins.values()), default=2)
    return tuple(part for part in batches if part.stop - part.start >= least)


def left_out_notes(table: Table, batches: tuple[slice, ...], kept: tuple[slice, ...]) -> list[str]:
    """Which batches are too short."""
    gone = np.zeros(len(table), dtype=bool)
    for part in [part for part in batches if part not in kept]:
        gone[part] = True
    return [f"left out {table.rows(gone)}, batches too short to derive velocities in"] if gone.any() else []


def kept_samples(part: slice, origins: Mapping[str, str]) -> slice:
    """The samples of a batch that have a velocity: differences lack the first and the last."""
    return slice(part.start + 1, part.stop - 1) if DIFFERENCE in origins.values() else part


def batch_velocity(
    table: Table, part: slice, sample_time_s: float, origins: Mapping[str, str], heading_std_rad: float | None
) -> Array:
    """Velocities (k, 3) of the samples that `kept_samples` gives; nan where there is none."""
    kept = kept_samples(part, origins)
    pose = table.stack(*POSE_COLUMNS)[part]
    sources: dict[str, Array] = {MEASURED: table.stack(*VELOCITY_COLUMNS)[kept]}
    if DIFFERENCE in origins.values():
        sources[DIFFERENCE] = central_difference(pose, sample_time_s, heading_std_rad=heading_std_rad or 0.0)
    if SMOOTHED in origins.values():
        sources[SMOOTHED] = smoothed_velocity(pose, sample_time_s, heading_std_rad=heading_std_rad)
    columns = [
        sources[origins[output]][:, index] if output in origins else np.full(kept.stop - kept.start, np.nan)
        for index, output in enumerate(OUTPUTS)
    ]
    return np.stack(columns, axis=-1)


def origin_notes(origins: Mapping[str, str]) -> list[str]:
    """Notes on derived and unknown velocities."""
    notes = []
    for origin, words in WORDS.items():
        names = [output for output in OUTPUTS if origins.get(output) == origin]
        if names:
            ends = ", which the first and last sample of a batch lack" if origin == DIFFERENCE else ""
            notes.append(f"{', '.join(names)} {'come' if len(names) > 1 else 'comes'} from {words}{ends}")
    unknown = [output for output in OUTPUTS if output not in origins]
    return [*notes, *([f"{', '.join(unknown)} not measured"] if unknown else [])]


def _missing(table: Table, output: str, column: str, method: str) -> FileError:
    pose = [name for name in NEEDS[output] if name not in table.columns]
    if method == MEASURED:
        return FileError(table.path, "row 1", f"names no {column}, expected it{mistyped(column, table.header)}")
    derive = DERIVED if output != "r" else "heading_rad (or heading_deg)"
    wanted = f"expected {column}, or {derive}" if method == "auto" else f"expected {derive}"
    hint = mistyped(column, table.header) if method == "auto" else ""
    hint = hint or next((found for name in pose if (found := mistyped(name, table.header))), "")
    return FileError(table.path, "row 1", f"gives no {output}: {wanted}{hint}")
