"""Roll of measured records: their runs, and whether a ship still rolls as her file says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy

from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.roll.estimate import RollEstimate, estimate_roll
from expdesign.roll.model import PARAMETERS, coefficients
from expdesign.roll.problem import build_problem
from expdesign.roll.runs import Case, Run, level, low_pass, prepared
from expdesign.signals import AUXILIARY, Batch
from expdesign.simulation import acting_response, delivered_at_samples, steering_signals
from expdesign.values import Array
from expdesign.vessel import IDEAL, ROLL_PARAMETERS, RollPendulum, Vessel
from expdesign.vessel.roll import G_MPS2, Body, Load

NEEDED = ("roll_rate_radps", "imu_lateral_mps2")  # columns needed besides r_radps and the rudder


def missing_columns(batch: Batch) -> tuple[str, ...]:
    """Columns of `NEEDED` that a batch does not measure."""
    return tuple(name for name in NEEDED if not batch.measures(name))


def levelled(signals: Array, body: Body, step_s: float) -> Array:
    """(k, 4) signals of a run as a sensor above the axis of yaw would read them, that stands level."""
    found = level(signals, body.tilt_rad or 0.0)
    found[:, 1] += body.forward_m * np.gradient(found[:, 2], step_s)
    return found


def roll_run(batch: Batch, *, rudder: Sequence[str] = (), ship: Vessel | None = None, body: Body | None = None) -> Run:
    """Signals of a batch; the accelerometer counts to port in the room of roll.

    Args:
        rudder: signals whose mean steers; found by their kinds when empty.
        ship: whose file states how late actuators are; None for none.
        body: that says where the sensor is along the ship, and its tilt; that of the ship's [roll] when left out.

    Raises:
        InputError: a column is missing, or nothing steers.
    """
    for name in missing_columns(batch):
        raise InputError(f"{name}: is missing, expected it beside r_radps and the rudder")
    assert batch.auxiliary is not None
    roll_rate, sensed = (batch.auxiliary[:, AUXILIARY.index(name)] for name in NEEDED)
    chosen = [batch.input_names.index(name) for name in _rudders(batch.input_names, rudder)]
    steering = _delivered(batch, batch.inputs, ship)[:, chosen].mean(axis=1)
    signals = np.column_stack([roll_rate, -sensed, batch.velocity[:, 2], steering])
    if body is None and ship is not None and ship.pendulum is not None:
        body = ship.pendulum.body
    if body is not None:
        signals = levelled(signals, body, batch.sample_time_s)
    planned = None
    if batch.planned is not None and batch.planned.shape[1] == len(batch.input_names):
        planned = _delivered(batch, batch.planned, ship)[:, chosen].mean(axis=1)
    return Run(step_s=batch.sample_time_s, signals=signals, planned=planned)


def planned_everywhere(runs: Sequence[Run]) -> bool:
    """Whether every run has a planned rudder that moves, from which instruments may come."""
    return all(run.planned is not None and run.planned.std() > 0 for run in runs)


def with_one_source(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Runs with planned rudders in all of them or in none."""
    return tuple(runs) if planned_everywhere(runs) else tuple(replace(run, planned=None) for run in runs)


def _delivered(batch: Batch, given: Array, ship: Vessel | None) -> Array:
    """(k, m) inputs at the samples, with the lags and dead times that the vessel file states for its signals."""
    inputs = np.array(given)
    if ship is None:
        return inputs
    for signal, response in zip(ship.model.inputs, ship.responses, strict=True):
        if signal in batch.input_names and response != IDEAL:
            column = batch.input_names.index(signal)
            own = acting_response(batch, signal, response) if given is batch.inputs else response
            commanded = inputs[:, [column]]
            inputs[:, column] = delivered_at_samples([own], commanded, sample_time_s=batch.sample_time_s)[:-1, 0]
    return inputs


def _rudders(names: tuple[str, ...], asked: Sequence[str]) -> tuple[str, ...]:
    for name in asked:
        if name not in names:
            raise UnknownName("rudder signal", name, known=names)
    chosen = tuple(asked) or steering_signals(names)
    if not chosen:
        raise InputError(f"the inputs {', '.join(names)} have no rudder, expected rudder1 or a1, or --rudder")
    return chosen


# Whether a ship still rolls as her file says, and if not, what changed: from one record at one load.
#
# The record gives the five coefficients c of the roll equation, with the covariance of their errors; the file gives
# them with that of its parameters. Their difference has the sum V of both as covariance where nothing changed, so that
#
#     T = (c - c_file)' V^-1 (c - c_file)
#
# has Hotelling's distribution with 5 numbers and as many degrees of freedom as the power of the noise has at a
# frequency: waves are narrow, so that V is no better known than their power. A cause explains it when the rest, after
# the best size of the cause, is within chance. The weight's share of the righting moment is no part of the stiffness in
# this equation, as the accelerometer feels gravity too: hull and load can be distinguished.
#
# Source: doctoral thesis on grey-box identification of ship roll with few sensors, (5.17)-(5.24), for the equation; L.
# P. Hansen, Econometrica 50 (1982), 1029-1054, for the test; H. Hotelling, Annals of Mathematical Statistics 2 (1931),
# 360-378, for its distribution.

ALARM_P = 0.01  # chance that a change is reported where there is none
ENOUGH_P = 0.01  # probability of a larger remainder where the cause is right, below which the cause is not accepted
ALIKE = 6.0  # difference of sums of squares up to which two explanations cannot be distinguished
MOST_CAUSES = 2
LOAD = "load"
CAUSES = {
    "k": "righting moment of the hull",
    "d": "roll damping",
    "A_x": "roll inertia without load",
    "K_r": "roll moment by the yaw rate",
    "K_delta": "roll moment by the rudder",
    LOAD: "load on board, or the height of the masses",
}
"""Cause -> words. All but the load are one parameter of the pendulum."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RollChange:
    """One explanation of the difference."""

    causes: tuple[str, ...]  # of `CAUSES`
    # sizes, stds: of each, in the parameter's unit; of the load the moment of its mass about the rotation axis, down
    # [kg m], that was added
    sizes: tuple[float, ...]
    stds: tuple[float, ...]
    left: float  # sum of squares that is left over
    p_value: float  # chance of more than that where the explanation is right
    pendulum: RollPendulum | None  # of the file with the explanation; None where no load on board has what is found
    righting_nm: float  # with it [N m/rad]
    # change of mass [kg] and its height above the body origin [m]; None without the load among the causes
    load: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class RollJudgement:
    """What one record tells of the roll of a file."""

    pendulum: RollPendulum  # of the file
    estimate: RollEstimate  # of the five parameters that one record determines, K_vd and z_f as in the file
    p_value: float  # chance of as large a difference where nothing changed
    alarm_p: float  # chance below which a change is certain
    # explanations with as few causes as explain it, the best first; none where nothing changed for certain
    changes: tuple[RollChange, ...]

    @property
    def changed(self) -> bool:
        """Whether a change is certain."""
        return self.p_value < self.alarm_p


def judge_roll(
    pendulum: RollPendulum, runs: Sequence[Run], *, beam_m: float, alarm_p: float = ALARM_P
) -> RollJudgement:
    """The judgement of a record.

    Args:
        pendulum: of the vessel file, with the load that was on board.
        runs: at one load; those that are too short are left out, if others are not.
        alarm_p: chance that a change is reported where there is none.

    Raises:
        InputError, NotInformative: the record gives no valid estimate, and why.
    """
    estimate = record_estimate(pendulum, runs, beam_m=beam_m)
    problem, load = estimate.problem, pendulum.load
    stated = np.array([pendulum.parameters.get(name, 0.0) for name in PARAMETERS])
    file, found = coefficients(stated, problem.body, load), coefficients(estimate.theta, problem.body, load)
    own = found.jacobian[:, problem.places] @ estimate.covariance @ found.jacobian[:, problem.places].T
    prior = file.jacobian[:, : len(ROLL_PARAMETERS)] @ _prior(pendulum) @ file.jacobian[:, : len(ROLL_PARAMETERS)].T
    root = np.asarray(np.linalg.cholesky(own + prior), dtype=float)
    differ = scipy.linalg.solve_triangular(root, found.values - file.values, lower=True)
    p_value = _chance(float(differ @ differ), len(differ), estimate.freedom)
    changes: tuple[RollChange, ...] = ()
    for count in range(1, MOST_CAUSES + 1) if p_value < alarm_p else ():
        all_ = (
            _explained(pendulum, stated, found.values, root, causes, estimate.freedom)
            for causes in combinations(CAUSES, count)
        )
        enough = [one for one in all_ if one is not None and one.p_value >= ENOUGH_P]
        changes = tuple(sorted(enough, key=_price))
        if changes:
            break
    best = [one for one in changes if _price(one) < _price(changes[0]) + ALIKE]
    return RollJudgement(pendulum=pendulum, estimate=estimate, p_value=p_value, alarm_p=alarm_p, changes=tuple(best))


def _chance(total: float, numbers: int, freedom: float) -> float:
    """Chance of a larger sum of squares of so many numbers, whose covariance has so many degrees of freedom."""
    rest = freedom - numbers + 1.0
    return float(scipy.special.fdtrc(numbers, rest, total * rest / (freedom * numbers)))


def _price(change: RollChange) -> float:
    """Sum of squares and two for each number of the explanation."""
    return change.left + 2.0 * (len(change.causes) + (LOAD in change.causes))


def record_estimate(pendulum: RollPendulum, runs: Sequence[Run], *, beam_m: float) -> RollEstimate:
    """Estimate with instruments from the rudder; parameters that one record cannot determine stay as in the file.

    Raises:
        InputError, NotInformative: its intervals are not to be trusted.
    """
    if not np.isfinite(pendulum.period_s):
        raise InputError("[roll] is of a ship that does not stay upright, expected one that does")
    roll_hz, case = 1.0 / pendulum.period_s, Case(name="the record", load=pendulum.load, runs=tuple(runs))
    filter_ = low_pass((case,), roll_hz=roll_hz)
    long = tuple(run for run in runs if len(run.signals) >= filter_.least_samples)
    start = dict(pendulum.parameters)
    known = {name: start.pop(name) for name in ("K_vd", "z_f")}
    ready = prepared((replace(case, runs=long or case.runs),), filter_)
    problem = build_problem(pendulum.body, ready, beam_m=beam_m, roll_hz=roll_hz, known=known, start=start)
    found = estimate_roll(problem)
    if not found.trusted:
        raise NotInformative(f"the roll of the ship cannot be estimated from the record: {_why(found)}")
    return found


def _why(found: RollEstimate) -> str:
    if found.weak:
        return "waves and sensors hide what the rudder does; use larger rudder angles or a longer run"
    if found.answering:
        chance = f"one that answers nothing seems so in {100 * found.unanswered:.1g} % of records"
        return f"the rudder seems to answer roll ({chance}); steer by hand, or record planned_rudder1_rad"
    if found.reached:
        return f"{' and '.join(found.reached)} is nowhere near what the file says"
    return "no roll pendulum fits it" if found.settled else "the estimate did not settle; use a longer run"


def _prior(pendulum: RollPendulum) -> Array:
    """(7, 7) covariance of the file's parameters."""
    std = np.array([pendulum.parameter_std.get(name, 0.0) for name in ROLL_PARAMETERS])
    correlation = np.eye(len(std))
    for pair, value in pendulum.parameter_correlation.items():
        one, other = (ROLL_PARAMETERS.index(name) for name in pair)
        correlation[one, other] = correlation[other, one] = value
    return correlation * np.outer(std, std)


def _explained(
    pendulum: RollPendulum, stated: Array, found: Array, root: Array, causes: tuple[str, ...], freedom: float
) -> RollChange | None:
    """The best sizes of these causes; None where they do not determine themselves."""
    scale = np.concatenate(list(_sizes(pendulum, stated, causes)))

    def left(x: Array) -> Array:
        values = _coefficients(pendulum, stated, causes, x * scale)
        return np.asarray(scipy.linalg.solve_triangular(root, found - values, lower=True))

    best = scipy.optimize.least_squares(left, np.zeros(len(scale)), max_nfev=100)
    if np.linalg.matrix_rank(best.jac) < len(scale):
        return None
    x, std = best.x * scale, np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac))) * scale
    total = float(2.0 * best.cost)
    places = np.cumsum([0, *(2 if cause == LOAD else 1 for cause in causes[:-1])])
    changed, load = _pendulum(pendulum, causes, x, std)
    moment = sum(float(x[i]) for cause, i in zip(causes, places, strict=True) if cause == LOAD)
    k = pendulum.parameters["k"] + sum(float(x[i]) for cause, i in zip(causes, places, strict=True) if cause == "k")
    return RollChange(
        causes=causes, sizes=tuple(x[places].tolist()), stds=tuple(std[places].tolist()), left=total,
        p_value=_chance(total, len(found) - len(scale), freedom), pendulum=changed,
        righting_nm=k + G_MPS2 * (pendulum.moment_kgm + moment), load=load,
    )  # fmt: skip


def _sizes(pendulum: RollPendulum, stated: Array, causes: tuple[str, ...]) -> Iterator[Array]:
    """Typical sizes of each number of the causes."""
    for cause in causes:
        if cause == LOAD:
            size = 0.1 * pendulum.righting_nm / G_MPS2
            yield np.array([size, 0.1 * pendulum.inertia_kgm2])
        else:
            value = float(stated[PARAMETERS.index(cause)])
            yield np.array([0.1 * abs(value) or 0.01 * pendulum.righting_nm])


def _coefficients(pendulum: RollPendulum, stated: Array, causes: tuple[str, ...], x: Array) -> Array:
    """(5,) coefficients with the causes at these sizes; a load adds a moment [kg m] and an inertia A2 [kg m2]."""
    theta, moment, inertia, numbers = np.array(stated), 0.0, 0.0, iter(x.tolist())
    for cause in causes:
        if cause == LOAD:
            moment, inertia = next(numbers), next(numbers)
        else:
            theta[PARAMETERS.index(cause)] += next(numbers)
    z_s = pendulum.body.sensor(pendulum.parameters["z_f"])
    before = theta[PARAMETERS.index("K_vd")] + pendulum.moment_kgm
    sensed = theta[PARAMETERS.index("A_x")] - stated[PARAMETERS.index("A_x")] + pendulum.inertia_kgm2 - z_s * before
    plain = coefficients(theta, pendulum.body, pendulum.load).values * sensed
    plain[2] -= moment
    return np.asarray(plain / (sensed + inertia))


def _pendulum(
    pendulum: RollPendulum, causes: tuple[str, ...], x: Array, std: Array
) -> tuple[RollPendulum | None, tuple[float, float] | None]:
    """The file's pendulum with the causes, and the load that was added as (mass, height).

    A mass m at z below the axis adds S1 = m z and A2 = m z (z - z_s), so that z = A2 / S1 + z_s.
    """
    values, stds, added = dict(pendulum.parameters), dict(pendulum.parameter_std), None
    numbers = iter(zip(x.tolist(), std.tolist(), strict=True))
    for cause in causes:
        if cause == LOAD:
            (moment, _), (inertia, _) = next(numbers), next(numbers)
            z = inertia / moment + pendulum.body.sensor(values["z_f"])
            added = moment / z, z - values["z_f"]
        else:
            size, stds[cause] = next(numbers)
            values[cause] += size
    mass_and_height = None if added is None else (added[0], -added[1])
    try:
        pairs = {pair: value for pair, value in pendulum.parameter_correlation.items() if not set(pair) & set(causes)}
        changed = replace(pendulum, parameters=values, parameter_std=stds, parameter_correlation=pairs)
        return (changed if added is None else replace(changed, load=_together(pendulum.load, *added))), mass_and_height
    except InputError:
        return None, mass_and_height


def _together(load: Load, mass_kg: float, z_m: float) -> Load:
    """The load with a mass added, or taken where it is negative, as one mass of the same moment and inertia.

    Raises:
        InputError: there is no such load.
    """
    total = load.mass_kg + mass_kg
    if not total > 0:
        raise InputError("the load has no mass")
    middle = (load.mass_kg * load.z_m + mass_kg * z_m) / total
    about = load.mass_kg * (load.z_m - middle) ** 2 + mass_kg * (z_m - middle) ** 2 + load.inertia_kgm2
    return Load(mass_kg=total, z_m=middle, inertia_kgm2=about)
