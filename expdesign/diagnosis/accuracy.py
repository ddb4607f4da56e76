"""Accuracy of the simulation, one-step residuals, and excitation by the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Windows, channel_std, cut_windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.errors import NotInformative
from expdesign.signals import Record, fit_percent
from expdesign.values import Array

# times after a start at which the growth of the error is measured [s]
HORIZONS_S = (2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0)
ABOUT = 1.25  # factor by which windows may be longer than that
# errors beyond so many standard deviations of the measurements count as that large; the simulation has diverged,
# and the size of its error has no meaning
LARGEST_ERROR = 10.0
STRETCH_SAMPLES = 10  # of a stretch of the residual analysis
FEWEST_MEASURED = 5  # samples of a stretch that must be measured
GROUPS = 8  # of stretches with similar values of a variable
FEWEST_STRETCHES = 16  # for a test
# largest_autocorrelation, smallest_autocorrelation: of successive residuals, beyond which they are bounded and
# ignored
LARGEST_AUTOCORRELATION = 0.9
SMALLEST_AUTOCORRELATION = 0.01
FEWEST_SAMPLES = 100  # for a diagnosis
CONSTANT_RANGE = 1e-9  # range of a constant input, as a share of its size
# response of the motion to the inputs' changes, in standard deviations of the noise, at least
LEAST_RESPONSE = 0.5
PER_SECOND_DIFFERENCE = np.sqrt(6.0)  # standard deviation of second differences of white noise of unit variance


def check_excitation(ship: ExtendedModel, windows: Windows) -> None:
    """Refuse data that are too short, do not measure an output, or whose inputs move the ship too little.

    Raises:
        NotInformative: naming what is missing.
    """
    samples = int(np.isfinite(windows.measured[..., :3]).any(axis=2).sum())
    if samples < FEWEST_SAMPLES:
        seconds = samples * windows.sample_s
        raise NotInformative(
            f"the data are too short for a diagnosis: {samples} samples of {windows.sample_s:g} s ({seconds:.0f} s), "
            f"expected {FEWEST_SAMPLES} or more"
        )
    for name in ship.model.outputs:
        if not np.isfinite(windows.measured[..., OUTPUTS.index(name)]).any():
            raise NotInformative(
                f"the data cannot support a diagnosis: {name} is not measured; expected it, or a pose to derive it from"
            )
    still = constant_inputs(ship, windows)
    if len(still) == len(ship.model.inputs):
        raise NotInformative(
            f"the data cannot support a diagnosis: no input changes ({', '.join(still)}), so a steady run is all there "
            f"is; expected runs in which {', '.join(still)} vary",
            parameters=still,
        )
    _check_answer(ship, windows)


def constant_inputs(ship: ExtendedModel, windows: Windows) -> tuple[str, ...]:
    """Inputs that never change."""
    rows = np.concatenate(windows.batch_inputs)
    size = CONSTANT_RANGE * (1.0 + np.abs(rows).max(axis=0))
    return tuple(name for name, span, least in zip(ship.model.inputs, np.ptp(rows, axis=0), size, strict=True)
                 if span <= least)  # fmt: skip


def _check_answer(ship: ExtendedModel, windows: Windows) -> None:
    """Refuse inputs whose simulated effect on the motion is smaller than the noise."""
    held = tuple(np.broadcast_to(rows.mean(axis=0), rows.shape) for rows in windows.batch_inputs)
    moved, steady = (
        simulate_from_measured(ship, data).predicted[..., :3] for data in (windows, replace(windows, batch_inputs=held))
    )
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    measured = windows.measured[..., columns]
    answer = np.where(np.isfinite(measured), (moved - steady)[..., columns], 0.0)
    size = np.sqrt((answer**2).sum(axis=(0, 1)) / np.maximum(np.isfinite(measured).sum(axis=(0, 1)), 1))
    noise = white_noise_std(measured)
    if (size < LEAST_RESPONSE * noise).all():
        rows = np.concatenate(windows.batch_inputs)
        spans = ", ".join(
            f"{name} by {span:.2g}" for name, span in zip(ship.model.inputs, np.ptp(rows, axis=0).tolist(), strict=True)
        )
        raise NotInformative(
            f"the data cannot support a diagnosis: the inputs change so little ({spans}) that what the model makes of "
            f"it is less than half of the noise in every output; expected runs with larger changes",
            parameters=ship.model.inputs,
        )


def white_noise_std(measured: Array) -> Array:
    """(n,) standard deviation of white noise in (w, s, n), from second differences, which include some motion."""
    second = np.diff(measured, 2, axis=1)
    seen = np.isfinite(second)
    mean = np.where(seen, second, 0.0) ** 2
    return np.asarray(np.sqrt(mean.sum(axis=(0, 1)) / np.maximum(seen.sum(axis=(0, 1)), 1)) / PER_SECOND_DIFFERENCE)


WHOLE_S = 1e9  # length of windows that are whole runs [s]


def accuracy(ship: ExtendedModel, record: Record) -> Accuracy:
    """Accuracy of a model on all batches."""
    outputs = ship.model.outputs
    columns = [OUTPUTS.index(name) for name in outputs]
    windows = cut_windows(ship.model, record, longest_s=WHOLE_S)
    motion = simulate_from_measured(ship, windows)
    measured = windows.measured[..., columns]
    error = clipped(motion.error[..., columns], measured)
    flat = error.reshape(-1, len(columns))
    horizons, growth = _growth(ship, record, columns)
    return Accuracy(
        outputs=outputs,
        fit=pooled_fit(error, measured),
        rmse=np.sqrt(np.nanmean(flat**2, axis=0)),
        bias=np.nanmean(flat, axis=0),
        horizons_s=horizons,
        growth=growth,
        per_batch=np.stack([fit_percent(m, m - e) for m, e in zip(measured, error, strict=True)]),
    )


def pooled_fit(error: Array, measured: Array) -> Array:
    """(n,) fit [%] over several windows (w, s, n), each around its own mean."""
    lost, varied = squared_sums(error, measured)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100 * (1 - np.sqrt(lost.sum(axis=0) / varied.sum(axis=0))))


def squared_sums(error: Array, measured: Array) -> tuple[Array, Array]:
    """(w, n) squared error and squared deviation from the mean of every window."""
    seen = np.isfinite(measured)
    mean = np.where(seen, measured, 0).sum(axis=1, keepdims=True) / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    lost = np.where(seen, clipped(error, measured) ** 2, 0.0).sum(axis=1)
    return lost, np.where(seen, (measured - mean) ** 2, 0.0).sum(axis=1)


def clipped(error: Array, measured: Array) -> Array:
    """Errors (w, s, n) no larger than `LARGEST_ERROR` standard deviations of the measurements."""
    size = channel_std(measured)
    most = np.where(size > 0, LARGEST_ERROR * size, np.inf)
    return np.asarray(np.clip(error, -most, most))


def _growth(ship: ExtendedModel, record: Record, columns: list[int]) -> tuple[Array, Array]:
    shortest = min(len(batch) * batch.sample_time_s for batch in record.batches)
    horizons, rows = [], []
    for horizon in HORIZONS_S:
        if horizon < 4 * record.batches[0].sample_time_s or horizon > shortest:
            continue
        windows = cut_windows(ship.model, record, longest_s=horizon)
        if windows.measured.shape[1] < 4 or windows.steps * windows.step_s > ABOUT * horizon:
            continue  # windows have a least number of samples
        error = clipped(simulate_from_measured(ship, windows).error[..., columns], windows.measured[..., columns])
        last = error[:, -max(1, error.shape[1] // 5) :]
        rows.append(np.sqrt(np.nanmean(last**2, axis=(0, 1))))
        horizons.append(horizon)
    return np.array(horizons), np.array(rows).reshape(len(horizons), len(columns))


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy:
    """Accuracy per output over all batches, each simulated from its first state."""

    outputs: tuple[str, ...]  # u, v, r, those that the model has
    # fit, rmse, bias: (n,) fit [%], root mean square and mean of measured less simulated
    fit: Array
    rmse: Array
    bias: Array
    horizons_s: Array  # (h,) and growth (h, n): root mean square error that long after a start from a measured state
    growth: Array
    per_batch: Array  # (b, n) fit of every batch


# One-step residuals of a model, and the variables that they may depend on.
#
# Each stretch of a few samples is simulated from its own measured state. The rate at which measured and simulated
# velocity diverge is the acceleration that the model lacks: a one-step residual, taken over several samples because of
# the measurement noise. No cause is assumed.

TINY = 1e-300


@dataclass(frozen=True, kw_only=True, eq=False)
class Dependence:
    """Means of one output's residual over groups of stretches with similar values of a variable."""

    middle: Array  # (b,) of the variable
    # mean, std: (b,) of the residual, and its standard error
    mean: Array
    std: Array
    p_value: float  # that all groups have one mean


def one_step_residuals(ship: ExtendedModel, windows: Windows) -> Residuals:
    """Residuals of a model over all data."""
    short = windows.cut_shorter(STRETCH_SAMPLES)
    measured = short.measured[..., :3]
    error = clipped(simulate_from_measured(ship, short).error[..., :3], measured)
    slopes, seen = _slopes(error, short.sample_s)
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    variables = _variables(ship, short)
    order = np.argsort(variables["time"], kind="stable")
    kept = order[(seen[order][:, columns] >= FEWEST_MEASURED).all(axis=1)]
    return Residuals(
        outputs=ship.model.outputs,
        stretch_s=short.steps * short.step_s,
        acceleration=slopes[kept][:, columns],
        variables={name: values[kept] for name, values in variables.items()},
    )


def _slopes(error: Array, sample_s: float) -> tuple[Array, Array]:
    """(w, 3) slopes of straight lines through errors (w, s, 3), and how many samples they are of."""
    seen = np.isfinite(error)
    count = seen.sum(axis=1)
    time = np.where(seen, sample_s * np.arange(error.shape[1])[None, :, None], 0.0)
    e, least = np.where(seen, error, 0.0), np.maximum(count, 1)
    centred = np.where(seen, time - (time.sum(axis=1) / least)[:, None], 0.0)
    variation = np.maximum((centred**2).sum(axis=1), 1e-12)
    return (centred * e).sum(axis=1) / variation, count


def _variables(ship: ExtendedModel, short: Windows) -> dict[str, Array]:
    """Values (w,) of every variable."""
    middle = short.steps // 2
    measured = short.measured[..., :3]
    count = np.maximum(np.isfinite(measured).sum(axis=1), 1)
    states = np.nansum(measured, axis=1) / count
    inputs = short.step_inputs.mean(axis=1)
    found = {name: states[:, i] for i, name in enumerate(OUTPUTS) if name in ship.model.outputs}
    found |= {name: inputs[:, i] for i, name in enumerate(ship.model.inputs)}
    if short.has_wind:
        air = states[:, :2] - short.wind.mean(axis=1)
        found |= {"u_q": air[:, 0], "v_q": air[:, 1]}
    if short.has_depth:
        found["depth"] = short.depth_m.mean(axis=1)
    if short.has_heading:
        found["heading"] = short.heading[:, middle] % (2 * np.pi)
    return found | {"time": short.time_s[:, middle], "run": short.batch}


def dependence(found: Residuals, output: str, name: str) -> Dependence:
    """Dependence of an output's residual on a variable: by run, or in groups of equal numbers of stretches.

    Residuals are modelled as a first-order autoregression within each run, so that their correlation does not count as
    a dependence. Too few stretches give no groups and nan.
    """
    x, y = found.variables[name], found.acceleration[:, found.outputs.index(output)]
    if not found.sufficient:
        nothing = np.zeros(0)
        return Dependence(middle=nothing, mean=nothing, std=nothing, p_value=float("nan"))
    place = _group_numbers(x, by_value=name == "run")
    share = np.eye(int(place.max()) + 1)[place]
    share = share / share.sum(axis=0)  # (k, b) weights of stretches in the mean of their group
    mean = y @ share
    covariance, effective_count = _covariance(y - mean[place], share, found.variables["run"])
    inverse = np.linalg.pinv(covariance, hermitian=True)
    apart = mean - float(np.sum(inverse @ mean)) / max(float(inverse.sum()), TINY)
    freedom, rest = len(mean) - 1, max(effective_count - len(mean), 1.0)
    return Dependence(
        middle=x @ share, mean=mean, std=np.sqrt(np.diag(covariance)),
        p_value=float(scipy.special.fdtrc(freedom, rest, apart @ inverse @ apart / freedom)) if freedom else 1.0,
    )  # fmt: skip


def mean_residual(found: Residuals, output: str) -> tuple[float, float]:
    """Mean residual of an output, and its standard error; nan of too few."""
    y = found.acceleration[:, found.outputs.index(output)]
    if not found.sufficient:
        return float("nan"), float("nan")
    share = np.full((len(y), 1), 1 / len(y))
    covariance, _ = _covariance(y - y.mean(), share, found.variables["run"])
    return float(y.mean()), float(np.sqrt(covariance[0, 0]))


def _covariance(rest: Array, share: Array, run: Array) -> tuple[Array, float]:
    """(b, b) covariance of the groups' means, and the effective number of independent stretches.

    Args:
        rest: (k,) residuals less the mean of their group.
        share: (k, b) weights of stretches in the means.
        run: (k,) of each stretch.
    """
    k, b = share.shape
    variance = float(rest @ rest) / max(k - b, 1)
    together = run[1:] == run[:-1]
    alike = float((rest[1:] * rest[:-1])[together].sum()) / max(float(rest @ rest), TINY)
    alike = min(
        max(alike + b * (1 + 3 * alike) / k, 0.0), LARGEST_AUTOCORRELATION
    )  # subtracting group means reduces the correlation
    covariance = share.T @ share
    for lag in range(1, k):
        if alike**lag < SMALLEST_AUTOCORRELATION:
            break
        both = (share[lag:] * (run[lag:] == run[:-lag])[:, None]).T @ share[:-lag]
        covariance += alike**lag * (both + both.T)
    return np.asarray(variance * covariance), k * (1 - alike) / (1 + alike)


def _group_numbers(x: Array, *, by_value: bool) -> Array:
    """(k,) number of the group of every stretch, without empty groups."""
    if by_value:
        return np.asarray(np.unique(x, return_inverse=True)[1])
    edges = np.unique(np.quantile(x, np.linspace(0, 1, GROUPS + 1)[1:-1]))
    return np.asarray(np.unique(np.searchsorted(edges, x, side="left"), return_inverse=True)[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Missing acceleration of every stretch, and the variables there."""

    outputs: tuple[str, ...]  # of the model
    stretch_s: float  # length of a stretch [s]
    acceleration: Array  # (k, n) measured less simulated acceleration [m/s^2, rad/s^2]
    # (k,) means over the stretch by name: u v r as measured, inputs, `u_q v_q` through the air and `depth` where they
    # are measured, `heading` (0 to 2 pi), `time` since the data began and number of the `run`
    variables: Mapping[str, Array]

    @property
    def sufficient(self) -> bool:
        """Whether there are enough stretches for a test."""
        return len(self.acceleration) >= FEWEST_STRETCHES
