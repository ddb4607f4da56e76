"""What nobody stated and the data show: a steady current, and inputs answered at other times than orders and file say.

Both pass into the parameters, with standard errors that know nothing of it. Where orders are read once a row, one that
a row shows was given up to a row before it, and dead times are rarely measured: half a second moved damping and rudder
of a ship with a time constant of 12 s by 10 to 25 %, ten standard deviations. A current of a tenth of her speed gave
her sway terms other signs.

So output error is repeated with a current, and with a dead time of every input, free. With t the times so found and S
their covariance, one alone, others held, is g_i / J_ii with the standard deviation J_ii^(-1/2), where J = S^-1 and
g = J t. Inputs are delivered with the times found until these hardly change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.assessment.actuator_times import (
    MOST_DELIVERIES,
    SETTLED_CHANGE,
    free_times,
    known_times,
    value,
    with_times,
)
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.output_error import ActuatorTime
from expdesign.estimation.regression import STEADY_CURRENT
from expdesign.estimation.values import Estimate
from expdesign.reduction import reduced
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel

UNKNOWN_S = 10.0  # standard deviation with which a dead time is as good as unknown
SURE = 3.0  # standard deviations of a time from which it is told; a current as seldom as a time by chance
UNSETTLED = "she seems to answer much later or sooner, but by how much does not settle; diagnose looks further"
MATTERS = 2.0  # standard deviations by which it moves a parameter at least


@dataclass(frozen=True, kw_only=True)
class Moved:
    """The parameter that moves most once something that nobody stated is estimated, too."""

    parameter: str
    by_std: float  # in its standard deviations, in size


@dataclass(frozen=True, kw_only=True)
class Current:
    """A steady current that nobody stated, or whatever else pushes to one side of the earth."""

    north_mps: float
    east_mps: float
    std_mps: float  # the larger standard deviation of both
    moved: Moved


@dataclass(frozen=True, kw_only=True)
class Answer:
    """An input that the ship answers later or sooner than orders and stated dead time say."""

    signal: str  # the input
    late_s: float  # negative where she answers sooner [s]
    std_s: float
    moved: Moved


def moved(held: Estimate, free: Estimate) -> Moved | None:
    """What moves most from one estimate to another, or None where nothing moves that matters."""
    by_std = np.abs(free.values - held.values) / np.maximum(held.std, np.finfo(float).tiny)
    most = int(np.argmax(by_std))
    return Moved(parameter=held.names[most], by_std=float(by_std[most])) if by_std[most] >= MATTERS else None


def current(held: Estimate, free: Estimate) -> Current | None:
    """The current that an estimate has beside one that knows of none."""
    names = list(free.nuisance_names)
    if not set(STEADY_CURRENT) <= set(names) or (most := moved(held, free)) is None:
        return None
    rows = np.array([names.index(name) for name in STEADY_CURRENT])
    flow, places = free.nuisance_values[rows], len(free.names) + rows
    covariance = free.joint_covariance[np.ix_(places, places)]
    chance = 2.0 * scipy.stats.norm.sf(SURE)
    if flow @ np.linalg.solve(covariance, flow) < scipy.stats.chi2.isf(chance, len(flow)):
        return None
    north, east = flow.tolist()
    return Current(north_mps=north, east_mps=east, std_mps=float(np.sqrt(np.diag(covariance).max())), moved=most)


Again = Callable[[Vessel, Record, tuple[ActuatorTime, ...]], Estimate]
"""(vessel, data, times that are estimated too) -> estimate."""


def answers(held: Estimate, raw: Record, vessel: Vessel, again: Again, *, smoothed: bool = False) -> tuple[Answer, ...]:
    """Inputs that the ship answers at other times, where that moves parameters; the surest one first.

    Args:
        held: by output error, with dead times as the vessel has them.
        raw: with commands as inputs.
        vessel: delivers them.
        again: the same output error with times that are estimated too.
        smoothed: as in `reduced`.

    Raises:
        InputError, NoAnswer: there is no such estimate.
    """
    free = {f"{name}_delay_s": name for name in _ordered(raw, vessel)}
    if not free:
        return ()
    stated = replace(vessel, std={**vessel.std, **dict.fromkeys(free, UNKNOWN_S)})
    ship, most, sure = stated, None, list[tuple[int, float, float]]()
    for _ in range(MOST_DELIVERIES):
        record = reduced(raw, ship, smoothed=smoothed)
        try:
            found = again(ship, record, known_times(stated, ship, record))
        except (InputError, NoAnswer, np.linalg.LinAlgError):
            if sure:
                raise NoAnswer(UNSETTLED) from None
            raise
        times = free_times(found, ship)
        names = [name for name in times if name in free]
        places = len(found.names) + np.array([found.nuisance_names.index(name) for name in names], dtype=int)
        late_s = np.array([times[name][0] - value(vessel, name) for name in names])
        sure = _surest(late_s, found.joint_covariance[np.ix_(places, places)]) if names else []
        most = moved(held, found)
        # an estimate is linear in a time about the one that inputs are delivered with, and wrong far from it
        after = with_times(ship, {name: (max(time, 0.0), std) for name, (time, std) in times.items()})
        if not sure or all(abs(value(after, n) - value(ship, n)) < SETTLED_CHANGE * times[n][1] for n in names):
            break
        ship = after
    else:
        raise NoAnswer(UNSETTLED)
    if most is None:
        return ()
    return tuple(
        Answer(signal=free[names[index]], late_s=late_s, std_s=std_s, moved=most) for index, late_s, std_s in sure
    )


def _ordered(raw: Record, vessel: Vessel) -> list[str]:
    """Inputs that are commands of actuators, move, and have no dead time that is estimated as it is."""
    signals = {signal for actuator in vessel.model.actuators for signal in actuator.signals}
    return [
        name
        for column, name in enumerate(raw.batches[0].input_names)
        if name in signals
        and not vessel.std.get(f"{name}_delay_s")
        and all(name not in batch.reached for batch in raw.batches)
        and any(np.ptp(batch.inputs[:, column]) > 0 for batch in raw.batches)
    ]


def _surest(times: Array, covariance: Array) -> list[tuple[int, float, float]]:
    """Index, size and standard deviation of times that differ from zero, each beside those before it."""
    information: Array = np.asarray(np.linalg.inv(covariance))
    score, found = information @ times, list[tuple[int, float, float]]()
    while len(found) < len(times):
        chosen = [index for index, *_ in found]
        best = max(
            (_beside(information, score, [*chosen, index]) for index in range(len(times)) if index not in chosen),
            key=lambda one: abs(one[1]) / one[2],
        )
        if not abs(best[1]) >= SURE * best[2]:  # nor where a number is not finite
            break
        found.append(best)
    return found


def _beside(information: Array, score: Array, indices: Sequence[int]) -> tuple[int, float, float]:
    """The last of these times where the others of them are free, too, and all others held."""
    covariance = np.linalg.inv(information[np.ix_(indices, indices)])
    return indices[-1], float((covariance @ score[indices])[-1]), float(np.sqrt(covariance[-1, -1]))
