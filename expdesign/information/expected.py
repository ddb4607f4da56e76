"""The covariance of instrumental-variable estimates, predicted before any data are taken.

    y(k+1) - y(k) = (1 - w) Phi(k)^T theta + w Phi(k+1)^T theta + eps(k)
    eps(k) = (I - w J(k+1)) e(k+1) - (I + (1 - w) J(k)) e(k) - (1 - w) Ja(k) a(k) - w Ja(k+1) a(k+1) - Jc(k) c(k)

w is 0 for Euler's map and 1/2 for the trapezoidal rule, by which parameters of continuous motion are estimated. Inputs
are those held from k to k+1. e is the noise of the velocity sensors; it enters at both ends of a sample and, through
J = d(Phi^T theta)/d nu, the regressors. a is the noise of the wind sensor and c the white part of the current, each
with its own derivative; that of c counts how its components change along the axes of a ship that turns, too. In the sum
with instruments Z every noise sample is multiplied by a known matrix, so the covariance Omega of sum Z eps is exact to
first order, without estimated autocorrelations. With G = sum Z Phi^T the estimate has covariance G^-1 Omega G^-T.

It is valid for noise small enough for a first-order expansion that changes no sign inside a modulus. Disturbances that
are constant for a whole trial, such as a mean current, cause a bias, which is not included; a steady current may be
estimated along, though, by two regressors more (see `estimation.regression.current`), which couple the equations.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.21), (5.3), (5.61), (7.9); the first-order form is
derived here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import NotInformative
from expdesign.estimation.regression import STEADY_CURRENT
from expdesign.information.excitation import FREE, REQUIRED, kept_runs, strata_of_run
from expdesign.information.moments import regressor_rows
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, delivered, relative_velocity, simulate, to_body
from expdesign.simulation.motion import rates_over_ground, turns_current
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY, Vessel, VesselModel

IDEAL_SHARE = 1e-12  # variance of an ideal sensor's noise, in that of the noisiest, where equations are weighed by it
VELOCITY_STEP = 1e-6  # step of central differences, relative to the larger of 1 and the signal [m/s, rad/s]
TOLD = 1e-6  # squared share of a parameter in what nothing tells, below which it is told
SINGULAR = 1e12  # condition number above which a trial counts as uninformative


@sealed(velocity="3")
class TrialPart:
    """Consecutive samples of a trial: commands run from a velocity."""

    commands: Commands  # k samples
    velocity: Array  # (3,) over ground at the first sample
    heading_rad: float = 0.0  # at the first sample; matters in wind or current
    standing: Array | None = None  # (m,) commands before the first sample; None for those of the first sample
    repeats: float = 1.0  # number of runs, with independent noise; may be a fraction, as an average


def expected_covariance(
    vessel: Vessel,
    parts: Sequence[TrialPart],
    parameters: Sequence[str],
    *,
    environment: Environment = CALM,
    mean_subtraction: str = "complete",
    integrator: str = "rk4",
    unknown_current: bool = False,
    excitation: str = FREE,
) -> Array:
    """(p, p) covariance of the estimates of the named parameters from a trial.

    Args:
        parts: of the trial; noise is independent between parts.
        parameters: names of the estimated parameters, in the order of the result.
        environment: mean current and wind, and the current's white variation from sample to sample.
        mean_subtraction: from the instruments: "none", "batch" (each part's own mean) or "complete".
        integrator: "rk4" for the motion of a ship and its parameters, "euler" for the map that defines discrete ones.
        unknown_current: whether a steady current is estimated with the parameters, as by methods iv-current and
            iv-air-current.
        excitation: which samples the estimator uses in each equation, see `information.excitation`.

    Raises:
        NotInformative: the trial contains no information about some parameters.
    """
    of_repeats = covariance_of_repeats(
        vessel,
        parts,
        parameters,
        environment=environment,
        mean_subtraction=mean_subtraction,
        integrator=integrator,
        unknown_current=unknown_current,
        excitation=excitation,
    )
    return of_repeats(np.array([part.repeats for part in parts], dtype=float))


def covariance_of_repeats(
    vessel: Vessel,
    parts: Sequence[TrialPart],
    parameters: Sequence[str],
    *,
    environment: Environment = CALM,
    mean_subtraction: str = "complete",
    integrator: str = "rk4",
    unknown_current: bool = False,
    excitation: str = FREE,
) -> Callable[[Array], Array]:
    """The same as a function of the number of runs (n,) of each part; what the parts tell is computed once."""
    rows = [_rows(vessel, part, parameters, environment, integrator, unknown_current, excitation) for part in parts]
    names = (*parameters, *(STEADY_CURRENT if unknown_current else ()))

    def covariance(repeats: Array) -> Array:
        return _sandwich(*_normal(rows, repeats, mean_subtraction), names)[: len(parameters), : len(parameters)]

    return covariance


def expected_deviations(
    vessel: Vessel,
    parts: Sequence[TrialPart],
    parameters: Sequence[str],
    *,
    environment: Environment,
    mean_subtraction: str,
    unknown_current: bool,
) -> Array:
    """(p,) standard deviations of the estimates of `expected_covariance`; nan of parameters that nothing tells apart.

    Of a thruster that stands still, or of two that are always ordered alike, the other parameters keep theirs.
    """
    rows = [_rows(vessel, part, parameters, environment, "rk4", unknown_current, FREE) for part in parts]
    G, Omega = _normal(rows, np.array([part.repeats for part in parts], dtype=float), mean_subtraction)
    scaled, scale = _scaled(G)
    left, sizes, right = np.linalg.svd(scaled)
    known = sizes > sizes.max(initial=0.0) / SINGULAR
    told = np.square(right[~known]).sum(axis=0) < TOLD
    inverse = (right[known].T / sizes[known]) @ left[:, known].T / np.outer(scale, scale)
    variance = np.einsum("ip,pq,iq->i", inverse, Omega, inverse)
    return np.where(told, np.sqrt(np.maximum(variance, 0.0)), np.nan)[: len(parameters)]


def _normal(rows: Sequence[_Rows], repeats: Array, mean_subtraction: str) -> tuple[Array, Array]:
    """G and Omega (p, p) of parts that are repeated."""
    done = [(item, weight) for item, weight in zip(rows, repeats.tolist(), strict=True) if weight]
    size = rows[0].regressors.shape[1]
    G, Omega = np.zeros((size, size)), np.zeros((size, size))
    for (item, weight), Z in zip(done, _without_means(done, mean_subtraction), strict=True):
        G += weight * np.einsum("kpo,kqo->pq", Z, item.regressors)
        Omega += weight * _score_covariance(Z, item)
    return G, Omega


def _without_means(rows: Sequence[tuple[_Rows, float]], mean_subtraction: str) -> Iterator[Array]:
    """Instruments (k, p, n) of each part without the mean of their stratum, zero in samples that are not used."""
    if mean_subtraction == "complete":
        totals = _sums(rows)
    for item, _ in rows:
        if mean_subtraction != "complete":
            totals = _sums([(item, 1.0)])
        Z = np.array(item.instruments)
        for (output, label), (total, count) in totals.items():
            own = item.strata[:, output] == label
            Z[own, :, output] -= 0.0 if mean_subtraction == "none" else total / count
        yield Z * (item.strata > 0)[:, None]


def _sums(rows: Sequence[tuple[_Rows, float]]) -> dict[tuple[int, int], tuple[Array, float]]:
    """Weighted sum (p,) of instruments, and count, for each output and stratum of it."""
    found: dict[tuple[int, int], tuple[Array, float]] = {}
    for item, weight in rows:
        for output in range(item.strata.shape[1]):
            for label in np.unique(item.strata[:, output]).tolist():
                own = item.instruments[item.strata[:, output] == label, :, output]
                total, count = found.get((output, label), (np.zeros(own.shape[1]), 0.0))
                found[output, label] = total + weight * own.sum(axis=0), count + weight * len(own)
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rows:
    """Regressors and instruments (k, p, n), and the derivatives and variances of the residual's disturbances.

    Derivatives by velocity (2, k, n, n) and air (2, k, n, 2) are those at the begin and at the end of samples, times
    the share that each end has in the regressors. Strata (k, n) are 0 for samples that an output does not use.
    """

    regressors: Array
    instruments: Array
    by_velocity: Array
    by_air: Array
    by_current: Array
    sensor: Array
    air: float
    current: float
    strata: NDArray[np.int8]


def _rows(
    vessel: Vessel,
    part: TrialPart,
    parameters: Sequence[str],
    environment: Environment,
    integrator: str,
    unknown_current: bool,
    excitation: str,
) -> _Rows:
    model, sensors = vessel.model, vessel.sensors
    own = simulate(
        vessel,
        part.commands,
        pose=np.array([0.0, 0.0, part.heading_rad]),
        velocity=part.velocity,
        environment=environment,
        standing=part.standing,
        integrator=integrator,
        substeps=1 if integrator == "euler" else SUBSTEPS,
    )
    given = delivered(vessel, part.commands, standing=part.standing)
    shares, turning = (1.0, 0.0) if integrator == "euler" else (0.5, 0.5), turns_current(integrator)
    ends = [(share, begin) for begin, share in enumerate(shares) if share]
    slopes = [_derivatives(model, _from(own, begin), given, environment) for begin in range(2)]
    by_water, by_air = (
        np.stack([share * by for share, by in zip(shares, pair, strict=True)]) for pair in zip(*slopes, strict=True)
    )

    chosen = [("u", "v", "r").index(name) for name in model.outputs]
    regressors = np.zeros(())
    for share, begin in ends:
        moved = _from(own, begin)
        block = _blocks(model, moved, given, environment, parameters)
        if unknown_current:
            moving = _by_current(model, moved, given, environment, turning=turning)
            block = np.concatenate([block, moving[..., chosen]], axis=1)
        regressors = regressors + share * block
    sensor = np.array([sensors.velocity_mps, sensors.velocity_mps, sensors.yaw_rate_radps])[chosen] ** 2
    return _Rows(
        regressors=regressors,
        instruments=regressors * (_weights(sensor) if unknown_current else 1.0),
        by_velocity=by_water[:, :, chosen][..., chosen],
        by_air=by_air[:, :, chosen],
        by_current=_by_white_current(own, slopes[0][0], turning=turning)[:, chosen],
        sensor=sensor,
        air=sensors.wind_mps**2,
        current=environment.current_variation.std_mps**2,
        strata=_strata(vessel, own, given, environment, excitation, begins=[begin for _, begin in ends]),
    )


def _strata(
    vessel: Vessel,
    motion: Trajectory,
    inputs: Commands,
    environment: Environment,
    excitation: str,
    *,
    begins: Sequence[int],
) -> NDArray[np.int8]:
    """(k, n) strata of the samples of a part; intervals whose ends differ are not used."""
    if excitation == FREE:
        return np.ones((len(inputs), len(vessel.model.outputs)), dtype=np.int8)
    first, *others = [
        strata_of_run(vessel, _from(motion, begin), inputs, environment, air_measured=True) for begin in begins
    ]
    for other in others:
        first = np.where(first == other, first, 0).astype(np.int8)
    if excitation == REQUIRED:
        first = np.where(kept_runs(first)[:, None], first, 0).astype(np.int8)
    return first.T


def _from(motion: Trajectory, sample: int) -> Trajectory:
    """The motion from a sample on."""
    return Trajectory(sample_time_s=motion.sample_time_s, pose=motion.pose[sample:], velocity=motion.velocity[sample:])


def _blocks(
    model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment, parameters: Sequence[str]
) -> Array:
    """(k, p, n) regressor matrices: each parameter's term in the column of its equation, times the sample time."""
    chosen = [model.names.index(name) for name in parameters]
    values = regressor_rows(model, trajectory, commands, environment)[:, chosen]
    member = np.array([[model.terms[index].equation == output for output in model.outputs] for index in chosen])
    return np.asarray(values[:, :, None] * member * (commands.sample_time_s / model.time_scale_s))


def _by_current(
    model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment, *, turning: bool
) -> Array:
    """(k, 2, 3) change of velocity over ground in a sample with a steady current to north and to east."""
    by_velocity, _ = _derivatives(model, trajectory, commands, environment)
    heading = trajectory.pose[: len(commands), 2]
    moved = np.array([to_body(direction, heading, NUMPY) for direction in np.eye(2)])  # (2, 2, k), of the water
    through_water = -np.einsum("kod,cdk->kco", by_velocity[:, :, :2], moved)
    if not turning:
        return np.asarray(through_water)
    still, (u_c, v_c) = np.zeros(moved[:, 0].shape), moved.swapaxes(0, 1)
    turned = rates_over_ground((still, still, still), (u_c, v_c), trajectory.velocity[: len(commands), 2])
    return np.asarray(through_water + commands.sample_time_s * np.stack(turned, axis=-1).swapaxes(0, 1))


def _by_white_current(motion: Trajectory, by_velocity: Array, *, turning: bool) -> Array:
    """(k, 3, 2) change of residuals with the b-frame components of a current, by its derivatives by velocity."""
    by_current = -by_velocity[:, :, :2]
    turned = turning * motion.sample_time_s * motion.velocity[: len(by_velocity), 2]
    by_current[:, 0, 1] += turned
    by_current[:, 1, 0] -= turned
    return by_current


def _weights(variance: Array) -> Array:
    """(n,) weights of the outputs, which the current couples: one over the noise variance; all alike without noise."""
    if not variance.any():
        return np.ones(len(variance))
    return np.asarray(1.0 / np.maximum(variance, IDEAL_SHARE * variance.max()))


def _derivatives(
    model: VesselModel, trajectory: Trajectory, commands: Commands, environment: Environment
) -> tuple[Array, Array]:
    """(k, 3, 3) and (k, 3, 2): of Phi^T theta by the velocity through water, and by that through air."""
    k = len(commands)
    state = (*trajectory.pose[:k].T, *trajectory.velocity[:k].T)
    water, air = relative_velocity(state, environment.current_to, environment.wind_to, NUMPY)
    signals = np.array([np.broadcast_to(value, k) for value in (*water, *air)])
    inputs = tuple(commands.values.T)

    def change(values: Array) -> Array:
        rates = model.accelerations(tuple(values[:3]), tuple(values[3:]), inputs, NUMPY)
        return np.stack([np.broadcast_to(rate, k) for rate in rates], axis=1) * commands.sample_time_s

    columns = []
    for index in range(5):
        step = np.zeros_like(signals)
        step[index] = VELOCITY_STEP * np.maximum(1.0, np.abs(signals[index]))
        columns.append((change(signals + step) - change(signals - step)) / (2 * step[index])[:, None])
    table = np.stack(columns, axis=2)
    return table[:, :, :3], table[:, :, 3:]


def _score_covariance(Z: Array, rows: _Rows) -> Array:
    """(p, p) covariance of sum Z(k) eps(k)."""
    eye = np.eye(Z.shape[2])
    begin, end = rows.by_velocity
    parts = (
        (_meeting(Z @ (end - eye), Z @ (begin + eye)), rows.sensor),
        (_meeting(*(Z @ by for by in rows.by_air[::-1])), np.full(2, rows.air)),
        (Z @ rows.by_current, np.full(2, rows.current)),
    )
    sums = [np.tensordot(matrix * variance, matrix, axes=((0, 2), (0, 2))) for matrix, variance in parts]
    return np.asarray(np.sum(sums, axis=0))


def _meeting(entering: Array, leaving: Array) -> Array:
    """(k + 1, p, n) what multiplies the noise of each sample: as the end of one residual and the begin of the next."""
    nothing = np.zeros_like(entering[:1])
    met: Array = np.concatenate([nothing, entering])
    met += np.concatenate([leaving, nothing])
    return met


def _sandwich(G: Array, Omega: Array, parameters: Sequence[str]) -> Array:
    scaled, scale = _scaled(G)
    blind = tuple(name for name, size in zip(parameters, np.diag(scaled), strict=True) if not abs(size) > 0)
    if blind or np.linalg.cond(scaled) > SINGULAR:
        raise NotInformative(
            f"the trial contains no information about some parameters{': ' + ', '.join(blind) if blind else ''}",
            parameters=blind or tuple(parameters),
        )
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    return np.asarray(inverse @ Omega @ inverse.T)


def _scaled(G: Array) -> tuple[Array, Array]:
    """G with a diagonal of ones, or of zeros where nothing tells of a parameter, and what its sides were divided by."""
    scale = np.sqrt(np.abs(np.diag(G)))
    scale = np.where(scale > 0, scale, 1.0)
    return G / np.outer(scale, scale), scale
