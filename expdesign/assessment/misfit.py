"""The misfit of a simulated run: one-step residuals, the run from its first measured state, the causes of its error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.conventions import OUTPUTS
from expdesign.errors import Diverged
from expdesign.estimation.methods import as_read, method_named
from expdesign.estimation.regression import Integers, build_layout, build_regression, drive_of, model_for, parts_of
from expdesign.estimation.replay import Compiled, Integration, Stretches, compiled, instrument_wind, simulate_batch
from expdesign.estimation.values import Estimate
from expdesign.signals import Batch, Record, fit_percent
from expdesign.values import Array, frozen_set, seal, sealed
from expdesign.vessel import VesselModel

AHEAD_S = 30.0  # prediction horizon from measured states [s]

LAGS = 60  # longest lag of the autocorrelation, in samples
SLOW_S = 20.0  # periods longer than this [s], or than 40 samples, count as slow
UNSTABLE_GROWTH = 5.0  # growth of an error over a run above which the ship is unstable
# share of the squared misfit above which its parts have opposite signs, and their sizes no meaning
CANCELLING_SHARE = 1.1
LEAST_SQUARED_ERROR = 1e-16  # in units of the outputs' standard deviations, below which a difference is rounding
ESTIMATION, TEST = "estimation", "test"


@sealed(fit_percent="n", rmse="n", simulated="k 3")
class RunCheck:
    """The simulation of one run and its errors."""

    batch: Batch  # the run
    use: str  # "estimation" or "test"
    outputs: tuple[str, ...]  # the velocities that have an equation
    # (n,) of the simulated output, nan where the measured one is constant or the simulation diverges
    fit_percent: Array
    rmse: Array  # (n,) root-mean-square error [m/s, rad/s], nan likewise
    simulated: Array | None  # (k, 3) u, v, r; None when the simulation diverges
    problem: str  # why there is no simulation, or ""


EULER = Integration()


def check_run(model: VesselModel, batch: Batch, *, use: str, wind: bool, integration: Integration = EULER) -> RunCheck:
    """Simulate a run and compare.

    Args:
        model: with estimated parameters.
        use: "estimation" or "test".
        wind: simulate in the wind that was measured; otherwise in still air. The water is still in both.
        integration: Euler's map at the sample time when left out.
    """
    try:
        simulated, problem = _simulated(model, batch, wind=wind, integration=integration), ""
    except Diverged as error:
        simulated, problem = None, str(error)
    columns = [OUTPUTS.index(name) for name in model.outputs]
    fit = rmse = np.full(len(columns), np.nan)
    if simulated is not None:
        measured, compared = batch.velocity[:, columns], simulated[:, columns]
        fit = fit_percent(measured, compared)
        rmse = np.sqrt(np.nanmean((measured - compared) ** 2, axis=0))
    return RunCheck(
        batch=batch, use=use, outputs=model.outputs, fit_percent=fit, rmse=rmse, simulated=simulated, problem=problem
    )


def _simulated(model: VesselModel, batch: Batch, *, wind: bool, integration: Integration) -> Array:
    """(k, 3); in wind that is the n-frame one which anemometer, velocity and heading give at each sample."""
    air = instrument_wind(batch, "lagged").T if wind else None
    return simulate_batch(model, batch, integration=integration, wind_to=air).velocity


# The causes of misfit of a simulated run: a decomposition of the simulation error.
#
# With y measured, x simulated and f one step of the model, the misfit e = y - x obeys
#
#     e(k+1) = A(k) e(k) + eps(k)        eps(k) = y(k+1) - f(y(k)), A(k) the slope of f half-way between y(k) and x(k)
#
# so it is the sum of the propagated parts of the one-step residuals eps: their mean over the run (a constant unmodelled
# force, or a wrong parameter with the same effect), their slow part (gusts, current, missing terms), and the rest
# (measurement noise, fast disturbances). Shares are projections on the misfit and add up to one: each slope is changed
# by as little as makes it carry e(k) to e(k+1) - eps(k), the difference that f makes of y and x (a secant in Broyden's
# sense; C. G. Broyden, Mathematics of Computation 19 (1965), 577-593). Without that they miss what the slope half-way
# does of f's curvature. The slopes as they are give the growth of an initial error. Where it grows, the ship is
# unstable under the recorded inputs, for any model: the recorded steering stabilised her, but the simulation does not
# react to the motion.


@sealed(constant="n", slow="n", quick="n", parameters="n", ceiling_percent="n", ahead_rms="n", ahead_share="n")
class Limits:
    """The decomposed misfit of one run."""

    outputs: tuple[str, ...]  # names
    # constant, slow, quick: (n,) shares of the squared misfit by the kind of one-step residual that causes it
    constant: Array
    slow: Array
    quick: Array
    parameters: Array  # (n,) squared misfit expected from the parameters' covariance, over the actual one
    # (n,) lower bound on the fit with measurement noise alone: the noise is estimated by third differences, which also
    # contain motion that is fast at the sample time
    ceiling_percent: Array
    ahead_rms: Array  # (n,) of predictions `AHEAD_S` ahead from measured velocities [m/s, rad/s]
    ahead_share: Array  # (n,) the same over the standard deviation of the measured output
    growth: float  # how many times an error of the first velocity is larger at the end of the run, at worst
    duration_s: float  # of the run

    @property
    def unstable(self) -> bool:
        """Whether errors grow by themselves."""
        return self.growth > UNSTABLE_GROWTH

    @property
    def doubling_s(self) -> float:
        """Time in which an error doubles, infinite where it does not grow [s]."""
        return self.duration_s * float(np.log(2) / np.log(self.growth)) if self.growth > 1 else float("inf")


def decomposed(model: VesselModel, run: RunCheck, found: Estimate, *, wind: bool, integration: Integration) -> Limits:
    """Decompose the misfit of a run.

    Args:
        run: its simulation; where that diverged shares are nan.
        found: the estimate, for its covariance.
        wind: whether the model is simulated in the measured wind.
    """
    places = [OUTPUTS.index(name) for name in model.outputs]
    measured = whole(run.batch.velocity[:, places])
    stretches = _stretches(model, run.batch, wind, integration, found)
    values = np.concatenate([found.values, np.zeros(len(places))])[None]
    n, unknown = len(places), np.full(len(places), np.nan)
    shares, growth, uncertain = np.tile(unknown, (3, 1)), float("nan"), unknown
    if run.simulated is not None:
        misfit = measured - run.simulated[:, places]
        shares, growth = _shares(stretches, values, measured, misfit)
        by_values, _ = compiled(stretches).sensitivities(values, run.simulated[:, None, places])
        slopes = by_values[:, 0, :, : len(found.values)]
        expected = np.einsum("knp,pq,knq->n", slopes, found.covariance, slopes)
        uncertain = expected / np.maximum((misfit**2).sum(axis=0), 1e-300)
    spread = measured.std(axis=0)
    spread = np.where(spread > 0, spread, np.nan)
    ahead = _ahead(stretches, values, measured, run.batch.sample_time_s)
    noise = np.diff(measured, 3, axis=0).std(axis=0) / np.sqrt(20) if len(measured) > 4 else np.zeros(n)
    return Limits(
        outputs=model.outputs,
        constant=shares[0],
        slow=shares[1],
        quick=shares[2],
        parameters=uncertain,
        ceiling_percent=100 * (1 - noise / spread),
        ahead_rms=ahead,
        ahead_share=ahead / spread,
        growth=growth,
        duration_s=len(measured) * run.batch.sample_time_s,
    )


def _stretches(model: VesselModel, batch: Batch, wind: bool, integration: Integration, found: Estimate) -> Stretches:
    """The run as one stretch."""
    driven = model_for(model, Record(batches=(batch,)))
    drive = drive_of(driven, batch, substeps=integration.substeps)
    if wind and batch.wind is not None:
        drive = np.concatenate([drive, whole(batch.velocity[:, :2] - batch.wind)], axis=1)
    return Stretches(
        model=driven,
        sought=tuple(driven.names.index(name) for name in found.names),
        states=tuple(OUTPUTS.index(name) for name in driven.outputs),
        drive=drive[:, None],
        windy=wind and batch.wind is not None,
        sample_time_s=batch.sample_time_s,
        integrator=integration.integrator,
        substeps=integration.substeps,
        parts=parts_of(batch, substeps=integration.substeps),
    )


def _shares(stretches: Stretches, values: Array, measured: Array, misfit: Array) -> tuple[Array, float]:
    """(3, n) shares of constant, slow and quick residuals, and the growth of an error over the run."""
    one_step = _one_step(stretches)
    held = np.repeat(values, len(measured) - 1, axis=0)
    eps = measured[1:] - one_step.states(held, measured[:-1])[1]
    half_way = np.stack([measured[:-1] - misfit[:-1] / 2, measured[1:]])
    A = one_step.sensitivities(held, half_way)[1][1]  # (k, n, n)
    scale = np.where(measured.std(axis=0) > 0, measured.std(axis=0), 1.0)
    secant = _secants(A, misfit[:-1], misfit[1:] - eps, scale)
    mean = np.broadcast_to(eps.mean(axis=0), eps.shape)
    slow = _slow_part(eps - mean, stretches.sample_time_s)
    parts = np.stack([mean, slow, eps - mean - slow], axis=2)
    grown, error = np.zeros((len(eps) + 1, *parts.shape[1:])), np.eye(eps.shape[1])
    for k in range(len(eps)):
        grown[k + 1] = secant[k] @ grown[k] + parts[k]
        error = A[k] @ error
    growth = float(np.linalg.norm(error * scale / scale[:, None], ord=2))
    return np.einsum("knc,kn->cn", grown, misfit) / np.maximum((misfit**2).sum(axis=0), 1e-300), growth


def _secants(A: Array, error: Array, reached: Array, scale: Array) -> Array:
    """(k, n, n) matrices nearest to A that carry errors (k, n) to those reached (k, n), in units of a scale (n,)."""
    towards = error / scale**2
    size = (error * towards).sum(axis=1)
    missed = reached - np.einsum("kij,kj->ki", A, error)
    missed[size < LEAST_SQUARED_ERROR] = 0.0
    return np.asarray(A + missed[:, :, None] * (towards / np.maximum(size, LEAST_SQUARED_ERROR)[:, None])[:, None, :])


def _one_step(stretches: Stretches) -> Compiled:
    """Every sample a stretch of its own, one step long."""
    drive = np.repeat(stretches.drive[:-1].transpose(1, 0, 2), 2, axis=0)
    return compiled(replace(stretches, drive=drive))


def _slow_part(values: Array, sample_time_s: float) -> Array:
    """The part with periods over `SLOW_S` or 40 samples; a cosine transform is not periodic at the ends."""
    spectrum = scipy.fft.dct(values, axis=0, norm="ortho")
    period_s = max(SLOW_S, 40 * sample_time_s)
    spectrum[int(2 * len(values) * sample_time_s / period_s) + 1 :] = 0.0
    return np.asarray(scipy.fft.idct(spectrum, axis=0, norm="ortho"))


def _ahead(stretches: Stretches, values: Array, measured: Array, sample_time_s: float) -> Array:
    """(n,) RMS of predictions from measured states, over windows that lie end to end; the run when it is shorter."""
    length = min(len(measured), round(AHEAD_S / sample_time_s) + 1)
    firsts = np.arange(0, len(measured) - length + 1, max(1, length - 1))
    rows = firsts + np.arange(length)[:, None]
    windows = compiled(replace(stretches, drive=stretches.drive[:, 0][rows]))
    with np.errstate(over="ignore", invalid="ignore"):
        states = windows.states(np.repeat(values, len(firsts), axis=0), measured[firsts])
        return np.asarray(np.sqrt(np.mean((measured[rows] - states) ** 2, axis=(0, 1))))


def whole(values: Array) -> Array:
    """Gaps filled linearly; zero in columns without data."""
    places, filled = np.arange(len(values)), np.zeros_like(values)
    for index, column in enumerate(values.T):
        seen = np.isfinite(column)
        if seen.any():
            filled[:, index] = np.interp(places, places[seen], column[seen])
    return filled


def sentence(limits: Limits, run: RunCheck) -> str:
    """The causes of misfit of a run in words and numbers."""
    ahead = _listed(limits, 100 * limits.ahead_share)
    tail = f"The {AHEAD_S:g} s prediction from measured velocities has an error of {ahead} of the standard deviation."
    if not np.isfinite(limits.ahead_rms).all():
        tail = f"Even the {AHEAD_S:g} s prediction from measured velocities diverges."
    if run.problem:
        return f"The simulation diverges. {tail}"
    if limits.unstable:
        return (
            f"The ship is unstable under the recorded inputs: an error grows {limits.growth:.2g}-fold over the run and "
            f"doubles every {limits.doubling_s:.2g} s. The helmsman or autopilot that stabilised her does not act in "
            f"the simulation. {tail}"
        )
    if not np.isfinite(run.fit_percent).any():
        return f"All measured outputs are constant. {tail}"
    worst = int(np.nanargmin(run.fit_percent))
    causes = (
        ("a constant unmodelled force", limits.constant[worst]),
        (f"slow forces (periods over {SLOW_S:g} s)", limits.slow[worst]),
        ("fast forces and measurement noise", limits.quick[worst]),
    )
    if not np.isfinite([share for _, share in causes]).all():
        return tail
    percent = [(round(100 * share), what) for what, share in sorted(causes, key=lambda c: -c[1])]
    parts = ", ".join(f"{size} % from {what}" for size, what in percent if size >= 0)
    parts += "".join(f", less {-size} % by {what} of opposite sign" for size, what in percent if size < 0)
    if max(abs(share) for _, share in causes) > CANCELLING_SHARE:
        parts = "parts of opposite sign, so no single cause can be named"
    doubt = limits.parameters[worst]
    much = f"{100 * doubt:.0f} % of it" if not doubt >= 1 else "all of it"
    uncertain = f" Among all these, errors of the parameters as large as stated would make {much}."
    ceiling = limits.ceiling_percent[worst]
    quiet = f" Noise alone limits this fit to {ceiling:.0f} %." if ceiling < 95 else ""
    return f"The worst output is {limits.outputs[worst]}. Its squared error: {parts}.{uncertain}{quiet} {tail}"


def _listed(limits: Limits, values: Array) -> str:
    texts = (
        f"{name} {value:.0f} %" if np.isfinite(value) else f"{name} -"
        for name, value in zip(limits.outputs, values.tolist(), strict=True)
    )
    return ", ".join(texts)


# One-step residuals of an estimate: the explained share of the accelerations, and the residuals over time.


@dataclass(frozen=True, kw_only=True, eq=False)
class OneStep:
    """Residuals nu(k) - nu(k - 1) - Phi(k - 1)^T theta, their mean taken off."""

    outputs: tuple[str, ...]  # names
    residuals: Array  # (k, n) in the unit of a sample-to-sample difference
    batch: Integers  # (k,) number of the run
    explained: Array  # (n,) share of the variance of nu(k) - nu(k - 1) that the model explains, at most 1
    autocorrelation: Array  # (lags + 1, n), 1 at lag 0; pairs never reach across runs or missing samples

    def __post_init__(self) -> None:
        seal(self, residuals="k n", explained="n", autocorrelation="l n")
        numbers = np.array(self.batch, dtype=np.int64)
        numbers.setflags(write=False)
        frozen_set(self, "batch", numbers)

    @property
    def white_band(self) -> float:
        """Autocorrelations of white residuals stay within this, 95 times in 100."""
        return 1.96 / float(np.sqrt(max(1, len(self.residuals))))


def one_step(
    record: Record, model: VesselModel, found: Estimate, *, fixed: Sequence[str] = (), quadrature: str = "euler"
) -> OneStep:
    """The residuals of an estimate on the record it comes from.

    Args:
        model: the initial model; gives the values of the fixed parameters.
        quadrature: one of `predictors.QUADRATURES`.
    """
    method = method_named(found.method)
    record = as_read(record, method)
    layout = build_layout(
        model_for(model, record), record, predictor=method.weather.name, fixed=tuple(fixed), quadrature=quadrature
    )
    regression = build_regression(layout, record).regression
    names, values = (*found.names, *found.nuisance_names), np.concatenate([found.values, found.nuisance_values])
    residuals = regression.residuals(values[[names.index(name) for name in regression.parameters]])
    residuals = residuals - residuals.mean(axis=0)
    total = np.var(regression.y, axis=0)
    explained = 1.0 - np.var(residuals, axis=0) / np.where(total > 0, total, np.nan)
    return OneStep(
        outputs=regression.outputs,
        residuals=residuals,
        batch=regression.batch_of,
        explained=explained,
        autocorrelation=autocorrelation(residuals, regression.batch_of, regression.step_of),
    )


def autocorrelation(residuals: Array, batch: Integers, step: Integers, *, lags: int = LAGS) -> Array:
    """(lags + 1, n) mean products of residuals so many samples apart over the mean square; 0 where no pair exists."""
    power = (residuals**2).mean(axis=0)
    power = np.where(power > 0, power, 1.0)
    rows = [np.ones(residuals.shape[1])]
    place = _places(batch, step)
    grid = np.zeros((int(place[-1]) + 1, residuals.shape[1]))
    there = np.zeros(len(grid))
    grid[place], there[place] = residuals, 1.0
    owner = np.full(len(grid), -1)
    owner[place] = batch
    for lag in range(1, lags + 1):
        same = (owner[lag:] == owner[:-lag]) & (there[lag:] > 0) & (there[:-lag] > 0)
        pairs = (grid[lag:] * grid[:-lag])[same]
        rows.append(pairs.mean(axis=0) / power if len(pairs) else np.zeros(residuals.shape[1]))
    return np.array(rows)


def _places(batch: Integers, step: Integers) -> Integers:
    """(k,) places of the samples on one line on which the runs lie one after the other, gaps and all."""
    starts = np.flatnonzero(np.diff(batch, prepend=batch[0] - 1))
    ends = np.append(starts[1:], len(batch)) - 1
    lengths = step[ends] - step[starts] + 1
    offsets = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    run = np.searchsorted(starts, np.arange(len(batch)), side="right") - 1
    return np.asarray(step - step[starts][run] + offsets[run], dtype=np.int64)
