"""From the steps to the nominal vessel model with three degrees of freedom, with the covariance that is left.

Two things are compared with the vessel model of parameters theta. At each plateau, the state at which the model is
steady under the same inputs, found by one Newton step from the measured one, with its errors in U, r and, where it is
measured, v. For each step, the time constant of the model with that of the response: for the throttle (U+ - U-)/2 over
the model's acceleration half way, for the rudder that of sway and yaw together by the area between response and
plateau, T1 + T2 - T3. The sum of squares of both, and of the distance from the vessel file's values in its standard
deviations, is made least. Errors are enlarged where plateaus or steps disagree with the model by more than they should
(R. T. Birge, Physical Review 40, 1932).

That an acceleration is zero must not be fitted as it stands: theta = 0 would do so perfectly. A state can be compared.

Steps of U and r say little about sway. Where sway is not measured, it is taken as steady under the sway parameters of
the vessel file. These keep their values, and their stated errors become errors of the others that depend on them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import scipy

from expdesign.errors import InputError
from expdesign.step_trials.holds import Controls
from expdesign.step_trials.nominal.evidence import Evidence, check_sway, compared, evidence
from expdesign.step_trials.samples import Delays, StepSample
from expdesign.values import Array
from expdesign.vessel import Vessel, VesselModel, with_response_values

MOST_STEPS = 60  # largest number of Gauss-Newton steps between two enlargements of errors
TIMES = 4  # errors of both dead times, and of both kinds of time constants by their definition
FARTHEST = 5.0  # largest value of each of these errors, in standard deviations: steps far beyond have no effect
CURRENT_STD_MPS = 0.2
"""Standard deviation of a steady current to north and to east, a current of its own in each record."""
ROUNDS = 4  # largest number of enlargements of errors
FORM_STD = 0.03
"""Relative error of what one time constant says about a response of another form; chosen from simulations."""


def posterior(model: VesselModel, known: Evidence, *, rounds: int = ROUNDS) -> tuple[Array, Array]:
    """(p,) parameters and (p, p) covariance, by Gauss and Newton from the vessel file's values.

    Errors of the two dead times, and of both kinds of time constants by their definition, are estimated beside the
    parameters, and a steady current in each record: speeds over less than a whole turn contain it. Where sway is not
    measured its parameters are considered, not estimated: they stay, and their stated errors count as errors of the
    data, in weights and covariance (S. F. Schmidt, Advances in Control Systems 3, 1966).

    Args:
        model: the vessel's, with what is known before.
        rounds: of weights and parameters in turn.

    Raises:
        NotInformative: sway has no steady drift at the vessel file's values.
    """
    check_sway(model, known.steady)
    free, considered = _free(model, known)
    root = np.linalg.cholesky(model.parameter_covariance[np.ix_(free, free)])
    beside = TIMES + 2 * known.records
    estimated = len(free) - considered + beside

    def parts(z: Array) -> tuple[Array, ...]:
        theta = model.parameters.copy()
        theta[free] += root @ z[beside:]
        own = FARTHEST * np.tanh(z[:beside] / FARTHEST)
        late_s, form = known.delay_std_s * own[:2], FORM_STD * own[2:TIMES]
        return compared(model, theta, known, late_s, form, CURRENT_STD_MPS * own[TIMES:].reshape(-1, 2))

    def with_considered(z: Array) -> Array:
        return np.append(z, np.zeros(considered))

    z = np.zeros(estimated)
    if np.isfinite(known.steady.sway).all():
        begun, _ = posterior(model, known.without_sway(), rounds=1)
        z[beside:] = np.linalg.solve(root, (begun - model.parameters)[free])
    enlarged, slopes = np.ones(5), _considered_slopes(parts, with_considered(z), considered)

    def whitening(z: Array) -> Array:
        return _whitening(np.repeat(enlarged, list(map(len, parts(with_considered(z))))), slopes)

    for _ in range(rounds):
        white = whitening(z)
        found = scipy.optimize.least_squares(
            lambda z, white=white: np.append(white @ np.concatenate(parts(with_considered(z))), z),
            z, x_scale="jac", max_nfev=MOST_STEPS,
        )  # fmt: skip
        z = found.x
        slopes = _considered_slopes(parts, with_considered(z), considered)
        enlarged = _enlarged(parts(with_considered(z)), estimated)
    left = _schmidt(np.linalg.solve(white, found.jac[: len(white)]), whitening(z), slopes)
    value, covariance = model.parameters.copy(), np.zeros((len(model.names),) * 2)
    value[free] += root @ with_considered(z)[beside:]
    covariance[np.ix_(free, free)] = root @ left[beside:, beside:] @ root.T
    return value, covariance


def _free(model: VesselModel, known: Evidence) -> tuple[npt.NDArray[np.intp], int]:
    """Indices of the parameters that are not known, and how many at their end are considered."""
    uncertain = model.parameter_std > 0
    unseen = not np.isfinite(known.steady.sway).all()
    sways = np.array([term.equation == "v" for term in model.terms]) & uncertain & unseen
    return np.concatenate([np.flatnonzero(uncertain & ~sways), np.flatnonzero(sways)]), int(sways.sum())


def _considered_slopes(parts: Callable[[Array], Sequence[Array]], z: Array, considered: int) -> Array:
    """(n, considered) change of all distances with each considered parameter, half a standard deviation each way."""
    steps = 0.5 * np.eye(len(z))[len(z) - considered :]
    columns = [np.concatenate(parts(z + step)) - np.concatenate(parts(z - step)) for step in steps]
    return np.stack(columns, axis=1) if columns else np.zeros((sum(map(len, parts(z))), 0))


def _whitening(errors: Array, slopes: Array) -> Array:
    """(n, n) what gives distances unit covariance, for errors (n,) of their own and unit ones along slopes (n, c)."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(np.diag(errors**2) + slopes @ slopes.T)))


def _schmidt(jacobian: Array, white: Array, slopes: Array) -> Array:
    """(p + c, p + c) covariance of estimated and considered parameters, both of unit covariance before.

    Args:
        jacobian: (n, p) derivatives of distances by the estimated ones.
        white: (n, n) as of `_whitening`, with these slopes.
        slopes: (n, c) derivatives by the considered ones.
    """
    scaled = white @ jacobian
    gain = np.linalg.inv(scaled.T @ scaled + np.eye(scaled.shape[1]))
    cross = -gain @ scaled.T @ white @ slopes
    return np.block([[gain, cross], [cross.T, np.eye(slopes.shape[1])]])


def _enlarged(parts: Sequence[Array], parameters: int) -> Array:
    """Factor by which the errors of each part are too small, never less than 1.

    What considered parameters add is not taken off: it is far from linear in them, and parameters would come out
    several standard deviations wrong.
    """
    count = sum(map(len, parts))
    freedom = count / max(count - parameters, 1)
    return np.array([max(1.0, math.sqrt(freedom * np.mean(part**2))) if len(part) else 1.0 for part in parts])


def nominal_vessel(vessel: Vessel, samples: Sequence[StepSample], delays: Delays, input_names: Sequence[str]) -> Vessel:
    """The vessel with parameters and covariance from its file and the steps.

    Raises:
        InputError: the record has other inputs than the vessel, its model has no surge or yaw, or its file states no
            standard deviations.
        NotInformative: sway has no steady drift.
    """
    model = vessel.model
    if tuple(input_names) != model.inputs:
        raise InputError(
            f"the data give {', '.join(input_names)}, expected the inputs of vessel {vessel.name!r}: "
            f"{', '.join(model.inputs)}"
        )
    if not {"u", "r"} <= set(model.outputs):
        raise InputError(
            f"the model of vessel {vessel.name!r} has equations for {', '.join(model.outputs)}, expected u and r"
        )
    if not model.parameter_std.any():
        raise InputError(
            f"vessel {vessel.name!r} states no [model.parameter_std], so all of its model counts as known: state how "
            "well each parameter is known before the trial"
        )
    value, covariance = posterior(model, evidence(samples, delays))
    return replace(vessel, model=model.with_parameters(value).with_covariance(model.names, covariance))


def with_delays(vessel: Vessel, controls: Controls, delays: Sequence[tuple[float, float] | None]) -> Vessel:
    """The vessel with dead times of throttle and rudder (value and standard error) in its file."""
    found: dict[str, tuple[float, float]] = {}
    for names, delay in zip((controls.throttle, controls.rudder), delays, strict=True):
        found |= {f"{name}_delay_s": delay for name in names if delay is not None and math.isfinite(delay[1])}
    std = {**vessel.std, **{name: delay[1] for name, delay in found.items() if delay[0] > 0}}
    actuators = with_response_values(vessel.actuators, {name: delay[0] for name, delay in found.items()})
    return replace(vessel, model=replace(vessel.model, actuators=actuators), std=std)
