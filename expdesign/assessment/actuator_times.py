"""Dead times, lags and slew rates of actuators that are not known exactly; called times here.

Output error estimates them beside the parameters, with what the vessel file states of them as one more measurement. It
is linear in them around the values that inputs are delivered with, so `delivered_anew` delivers them again with what
was found until that hardly changes. The other methods hold them, and consider their errors: with G the derivatives of
an estimate by the times, and S the times' covariance, that of the estimate grows by G S G^T.

Source: S. F. Schmidt, Advances in Control Systems 3 (1966), 293-340, for what is considered and not estimated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from expdesign.estimation.output_error import ActuatorTime
from expdesign.estimation.values import Estimate
from expdesign.reduction import TIMES, reduced
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import RATE_UNITS, Sensors, Vessel, response_values, stem, with_response_values
from expdesign.vessel.quantities import rows_of

MOST_DELIVERIES = 5  # how often data are delivered with new dead times and lags, at most
SETTLED_CHANGE = 0.5  # change of such a time, in its standard deviations, below which it is not delivered again
SURELY_EARLY = 3.0  # standard deviations by which a dead time is below zero from which it is told
TIME_CHANGE = 0.1  # of a time, for derivatives, in samples
Attempt = Callable[[Vessel, Record, tuple[ActuatorTime, ...]], Estimate]
"""(vessel, data, times that are estimated too) -> estimate."""


def uncertain(record: Record) -> tuple[str, ...]:
    """Names of the times whose derivatives the data are delivered with."""
    given = [batch.delivered.times if batch.delivered is not None else () for batch in record.batches]
    return given[0] if given and all(names == given[0] for names in given) else ()


def known_times(stated: Vessel, vessel: Vessel, record: Record) -> tuple[ActuatorTime, ...]:
    """What a vessel's file states of the uncertain times of data that are delivered with another one's."""
    before, now = (response_values(ship.actuators) for ship in (stated, vessel))
    return tuple(
        ActuatorTime(name=name, change_s=before[name] - now[name], std_s=stated.std[name]) for name in uncertain(record)
    )


def delivered_anew(raw: Record, vessel: Vessel, attempt: Attempt, *, smoothed: bool = False) -> tuple[Vessel, Record]:
    """The vessel with the times that output error finds, and the data that it delivers.

    Args:
        raw: with commands as inputs.
        vessel: as its file states it.
        attempt: output error.
        smoothed: as in `reduced`.
    """
    ship, record = vessel, reduced(raw, vessel, smoothed=smoothed)
    for _ in range(MOST_DELIVERIES):
        times = known_times(vessel, ship, record)
        if not times:
            break
        found = found_times(attempt(ship, record, times), ship)
        change = max(abs(found[time.name][0] - value(ship, time.name)) / found[time.name][1] for time in times)
        ship = with_times(ship, found)
        record = reduced(raw, ship, smoothed=smoothed)
        if change < SETTLED_CHANGE:
            break
    return ship, record


def value(vessel: Vessel, name: str) -> float:
    """A dead time or lag [s], or a slew rate, of a vessel."""
    return response_values(vessel.actuators)[name]


def found_times(found: Estimate, vessel: Vessel) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of each time that an estimate found beside what the vessel delivers inputs with."""
    return {name: (max(time, 0.0), own) for name, (time, own) in free_times(found, vessel).items()}


def free_times(found: Estimate, vessel: Vessel) -> dict[str, tuple[float, float]]:
    """The same; less than zero where the ship answers before the recorded orders."""
    names, std = found.nuisance_names, np.sqrt(np.diag(found.joint_covariance))[len(found.names) :]
    known = response_values(vessel.actuators)
    return {
        name: (known[name] + change, own)
        for name, change, own in zip(names, found.nuisance_values.tolist(), std.tolist(), strict=True)
        if name in known
    }


def with_times(vessel: Vessel, found: Mapping[str, tuple[float, float]]) -> Vessel:
    """The vessel with these times and their standard deviations."""
    actuators = with_response_values(vessel.actuators, {name: time for name, (time, _) in found.items()})
    std = {**vessel.std, **{name: own for name, (_, own) in found.items()}}
    return replace(vessel, model=replace(vessel.model, actuators=actuators), std=std)


def considered(found: Estimate, record: Record, vessel: Vessel, again: Callable[[Record], Estimate]) -> Estimate:
    """An estimate with the errors of times that it holds in its covariance.

    Args:
        vessel: which they are delivered by; states the standard deviations.
        again: the same estimate from other data.
    """
    names = uncertain(record)
    if not names:
        return found
    columns = []
    for name in names:
        step_s = vessel.std[name]  # what is delivered is linear in it
        if not name.endswith("_rate"):
            step_s = min(step_s, TIME_CHANGE * record.batches[0].sample_time_s)
        later, sooner = (
            again(replace(record, batches=tuple(_moved(batch, name, change_s) for batch in record.batches)))
            for change_s in (step_s, -step_s)
        )
        columns.append((_joint(later) - _joint(sooner)) * vessel.std[name] / (2 * step_s))
    grown = found.joint_covariance + np.array(columns).T @ np.array(columns)
    p = len(found.names)
    return replace(found, covariance=grown[:p, :p], joint_covariance=grown)


def _joint(found: Estimate) -> Array:
    """(p + q,) parameters, then nuisance parameters."""
    return np.concatenate([found.values, found.nuisance_values])


def _moved(batch: Batch, name: str, change_s: float) -> Batch:
    assert batch.delivered is not None  # as it has uncertain times
    steps = batch.delivered.moved(name, change_s)
    return replace(batch, delivered=steps, inputs=steps.mean)


def _unit(name: str) -> str:
    """Unit of a time, or of a slew rate, after a space."""
    signal, _, quantity = name.partition("_")
    unit = RATE_UNITS[stem(signal)] if quantity == "rate" else "s"
    return f" {unit}" if unit else ""


def with_times_noted(found: Estimate, record: Record, stated: Vessel, vessel: Vessel) -> Estimate:
    """An estimate with times in place of their changes, and a sentence on what became of uncertain ones.

    Args:
        record: with what the vessel delivers.
        stated: as the vessel's file has it.
        vessel: the same, or with times that were found since.
    """
    times = found_times(found, vessel)
    names = tuple(name for name in response_values(stated.actuators) if name.endswith(TIMES) and stated.std.get(name))
    if not names:
        return found
    if not uncertain(record):
        listed = ", ".join(names)
        note = f"Standard deviations do not count the errors of {listed}: the inputs used are not commands as given."
        return replace(found, warnings=(*found.warnings, note))
    if not times:
        source = "Method oe estimates them with the parameters." if vessel is stated else "They are those of method oe."
        note = f"Standard deviations count the errors of {', '.join(names)}. {source}"
        return replace(found, warnings=(*found.warnings, note))
    known = response_values(stated.actuators)
    each = [
        f"{name} {time:.3g} ± {std:.2g}{_unit(name)} (in the vessel file {known[name]:.3g} ± "
        f"{stated.std[name]:.2g}{_unit(name)})"
        for name, (time, std) in times.items()
    ]
    note = (
        f"Uncertain dead times, lags and slew rates are estimated with the parameters: {', '.join(each)}. "
        "Standard deviations of the parameters count their errors."
    )
    early = [
        f"{name.removesuffix('_delay_s')} {-time:.2g} ± {own:.1g} s"
        for name, (time, own) in free_times(found, vessel).items()
        if name.endswith("_delay_s") and time < -SURELY_EARLY * own
    ]
    if early:
        note += (
            f" The ship answers before the recorded orders, which were read late: {', '.join(early)}. Parameters count "
            "that here. A dead time cannot, so that the vessel file and the other methods have 0, and these are biased."
        )
    values = dict(zip(found.nuisance_names, found.nuisance_values.tolist(), strict=True))
    values |= {name: time for name, (time, _) in times.items()}
    return replace(found, nuisance_values=np.array(list(values.values())), warnings=(*found.warnings, note))


def with_held_noted(found: Estimate, record: Record, stated: Vessel) -> Estimate:
    """An estimate with a sentence on stated errors that its standard deviations leave out: all but those of times.

    Args:
        record: which a sensor shows whose errors count.
        stated: as the vessel's file has it.
    """
    sensed, responses = {row.key: row for row in rows_of(Sensors)}, response_values(stated.actuators)
    held = [
        name
        for name, std in stated.std.items()
        if std > 0 and not (name in responses and name.endswith(TIMES))
        and (name not in sensed or any(sensed[name].is_shown(batch.derived) for batch in record.batches))
    ]  # fmt: skip
    if not held:
        return found
    note = f"Standard deviations do not count the errors of {', '.join(held)}: the values in the vessel file are held."
    return replace(found, warnings=(*found.warnings, note))
