"""One-step residuals of a model, and the variables that they may depend on.

Each stretch of a few samples is simulated from its own measured state. The rate at which measured and simulated
velocity diverge is the acceleration that the model lacks: a one-step residual, taken over several samples because of
the measurement noise. No cause is assumed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy.simulated_fit import clipped
from expdesign.diagnosis.accuracy.tuning import TUNING
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.values import Array

TINY = 1e-300


@dataclass(frozen=True, kw_only=True, eq=False)
class Dependence:
    """Means of one output's residual over groups of stretches with similar values of a variable.

    Attributes:
        middle: (b,) of the variable.
        mean, std: (b,) of the residual, and its standard error.
        p_value: that all groups have one mean.
    """

    middle: Array
    mean: Array
    std: Array
    p_value: float


def one_step_residuals(ship: ExtendedModel, windows: Windows) -> Residuals:
    """Residuals of a model over all data."""
    short = windows.cut_shorter(TUNING.stretch_samples)
    measured = short.measured[..., :3]
    error = clipped(simulate_from_measured(ship, short).error[..., :3], measured)
    slopes, seen = _slopes(error, short.sample_s)
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    variables = _variables(ship, short)
    order = np.argsort(variables["time"], kind="stable")
    kept = order[(seen[order][:, columns] >= TUNING.fewest_measured).all(axis=1)]
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
        p_value=float(scipy.stats.f.sf(apart @ inverse @ apart / freedom, freedom, rest)) if freedom else 1.0,
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
        max(alike + b * (1 + 3 * alike) / k, 0.0), TUNING.largest_autocorrelation
    )  # subtracting group means reduces the correlation
    covariance = share.T @ share
    for lag in range(1, k):
        if alike**lag < TUNING.smallest_autocorrelation:
            break
        both = (share[lag:] * (run[lag:] == run[:-lag])[:, None]).T @ share[:-lag]
        covariance += alike**lag * (both + both.T)
    return np.asarray(variance * covariance), k * (1 - alike) / (1 + alike)


def _group_numbers(x: Array, *, by_value: bool) -> Array:
    """(k,) number of the group of every stretch, without empty groups."""
    if by_value:
        return np.asarray(np.unique(x, return_inverse=True)[1])
    edges = np.unique(np.quantile(x, np.linspace(0, 1, TUNING.groups + 1)[1:-1]))
    return np.asarray(np.unique(np.searchsorted(edges, x, side="left"), return_inverse=True)[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Missing acceleration of every stretch, and the variables there.

    Attributes:
        outputs: of the model.
        stretch_s: length of a stretch [s].
        acceleration: (k, n) measured less simulated acceleration [m/s^2, rad/s^2].
        variables: (k,) means over the stretch by name: u v r as measured, inputs, `u_q v_q` through the air and `depth`
            where they are measured, `heading` (0 to 2 pi), `time` since the data began and number of the `run`.
    """

    outputs: tuple[str, ...]
    stretch_s: float
    acceleration: Array
    variables: Mapping[str, Array]

    @property
    def sufficient(self) -> bool:
        """Whether there are enough stretches for a test."""
        return len(self.acceleration) >= TUNING.fewest_stretches
