"""Records reduced: to the reference point, with delivered inputs.

Data faster than the motion are averaged: velocities over blocks of samples, inputs as they drive these means. The mean
of a linear motion over a block is its response to the mean input: with blocks of m samples,

    mean of x over block j + 1  -  mean of x over block j  =  1/m  sum over i, s < m of  dx(j m + i + s)

so inputs of a step are means over blocks of means over m samples. White noise of the sensors shrinks by the root of m,
and hardly anything is lost, as long as a block is short beside the ship's own times. These scale with the time in which
she sails, or turns through, her length.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS, listed
from expdesign.errors import InputError
from expdesign.reduction.sensors import Stated, measured, shrinkage, turned, undone
from expdesign.reduction.uncertain_times import TIMES, UncertainTime, delivered_with_slopes
from expdesign.signals import Batch, Delivered, Record
from expdesign.simulation import acting_response, deliver, step_shares
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array
from expdesign.vessel import IDEAL, RATE_UNITS, Response, Sensors, Vessel, VesselModel, column_name, stem
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, NOISE, READINGS

SHORTEST_BATCH = 4  # samples that a batch must keep

LONGEST_MEAN_S = 1.0  # over which samples are averaged, at most [s]
# of the time in which the ship sails, or turns through, her length, over which they are, at most. Her own times are a
# third of it and more
MEAN_SHARE = 0.1


def averaged(record: Record, count: int) -> Record:
    """The record with so many samples averaged to one; the record itself for 1.

    Batches of fewer than `SHORTEST_BATCH` means are left out, unless all are so short.

    Args:
        record: reduced, with inputs as delivered.
        count: of `samples_of_a_mean`.
    """
    long = [batch for batch in record.batches if len(batch) >= count * SHORTEST_BATCH]
    return record if count < 2 or not long else replace(record, batches=tuple(_over_blocks(b, count) for b in long))


def samples_of_a_mean(record: Record, length_m: float) -> int:
    """Number of samples to average to one, as the motion of a ship of this length [m] allows."""
    if len({batch.sample_time_s for batch in record.batches}) != 1:
        return 1
    sample_s = record.batches[0].sample_time_s
    slow = max(1, int(LONGEST_MEAN_S / sample_s + 1e-9))
    rows = np.concatenate([_block_means(batch.velocity, slow) for batch in record.batches])
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        return 1
    u, v, r = np.sqrt(np.mean(rows**2, axis=0)).tolist()
    speed = float(np.hypot(np.hypot(u, v), length_m * r))
    mean_s = min(LONGEST_MEAN_S, MEAN_SHARE * length_m / max(speed, 1e-9))
    return max(1, int(mean_s / sample_s + 1e-9))


def _over_blocks(batch: Batch, count: int) -> Batch:
    velocity = batch.velocity
    if batch.interpolated is not None:
        velocity = np.where(batch.interpolated > 0, np.nan, velocity)
    optional = {name: getattr(batch, name) for name in ("pose", "wind", "depth_m", "steered", "planned")}
    means: dict[str, Any] = {name: _block_means(rows, count) for name, rows in optional.items() if rows is not None}
    if "steered" in means:
        means["steered"] = np.ceil(means["steered"])
    return replace(
        batch,
        sample_time_s=count * batch.sample_time_s,
        velocity=_block_means(velocity, count),
        inputs=_driving(batch.inputs, count),
        delivered=None if batch.delivered is None else _means_of_steps(batch.delivered, count),
        interpolated=None,
        auxiliary=None,
        **means,
    )


def _means_of_steps(steps: Delivered, count: int) -> Delivered | None:
    """What drives the means, in one part a step; None where nothing about it is uncertain."""
    if not steps.times:
        return None
    by_time = np.einsum("ksmu,s->kmu", steps.values_by_time, steps.shares)
    by_time += np.einsum("ksm,su->kmu", steps.values, steps.shares_by_time)
    return Delivered(
        values=_driving(steps.mean, count)[:, None],
        shares=np.ones(1),
        times=steps.times,
        values_by_time=_driving(by_time, count)[:, None],
        shares_by_time=np.zeros((1, len(steps.times))),
    )


def _driving(rows: Array, count: int) -> Array:
    """(k / count, ...) means over blocks of the means over so many rows; the last row lasts."""
    wide = np.concatenate([rows, np.repeat(rows[-1:], count - 1, axis=0)])
    sums = np.cumsum(np.concatenate([np.zeros_like(wide[:1]), wide]), axis=0)
    return _block_means((sums[count:] - sums[:-count]) / count, count)


def _block_means(rows: Array, count: int) -> Array:
    """(k / count, ...) means of whole blocks; nan where less than half of one is a number."""
    blocks = rows[: len(rows) // count * count].reshape(-1, count, *rows.shape[1:])
    seen = np.isfinite(blocks)
    number = seen.sum(axis=1)
    means = np.where(seen, blocks, 0.0).sum(axis=1) / np.maximum(number, 1)
    return np.asarray(np.where(2 * number >= count, means, np.nan))


STATED = "As the vessel file states, "


def remarks(stated: Stated) -> Iterator[str]:
    """One sentence for each stated fault of a sensor in the data."""
    sensors = stated.sensors
    signals = {name: values for name, values in readings_by_sensor(stated.batch).items() if measured(values)}
    for name, values in signals.items():
        timing, place, words = sensors.timing(name), sensors.place(name), READINGS[name]
        if any(timing):
            yield STATED + _timing(words, *timing, as_stated=stated.readings(name, values)[1])
        if any(place):
            yield from _moved(words, _where(*place), stated)
    if "heading" in signals and sensors.heading_bias_rad:
        yield f"{STATED}{sensors.heading_bias_rad:.4g} rad is taken off the headings."
    if "velocity" in signals and sensors.velocity_angle_rad:
        yield from _along_axes(stated)
    for row in GAINS_AND_OFFSETS:
        value = getattr(sensors, row.key)
        if row.sensor in signals and value != row.neutral:
            yield f"{STATED}{row.undone(value)}."
    if "wind" in signals and sensors.wind_axis_rad:
        yield f"{STATED}winds are measured along axes {sensors.wind_axis_rad:.4g} rad to starboard; they are turned."
    if "wind" in signals and (shrunk := shrinkage(sensors)) < 1.0:
        yield f"{STATED}noise on the vane's angle shrinks the wind to {shrunk:.4g}; it is divided by that."


def readings_by_sensor(batch: Batch) -> dict[str, Array]:
    """Sensor -> its measured values (k, c), of the sensors that the batch comes from."""
    values: dict[str, Array] = {}
    if batch.pose is not None:
        values |= {"position": batch.pose[:, :2], "heading": batch.pose[:, 2:]}
    if not {"u", "v"} & set(batch.derived):
        values["velocity"] = batch.velocity[:, :2]
    if "r" not in batch.derived:
        values["yaw_rate"] = batch.velocity[:, 2:]
    if batch.wind is not None:
        values["wind"] = batch.wind
    return values


def _timing(words: str, delay_s: float, interval_s: float, *, as_stated: bool) -> str:
    late = f"{words} are {delay_s:g} s late; they are moved to their own time" if delay_s else ""
    held = f"{words} are read every {interval_s:g} s; they are interpolated between readings"
    if interval_s and not as_stated:
        held = (
            f"{words} would be read every {interval_s:g} s, but change at other samples; every sample counts "
            "as a reading"
        )
    return ", and ".join(filter(None, (late, held if interval_s else ""))) + "."


def _moved(words: str, where: str, stated: Stated) -> Iterator[str]:
    """What is done about a place off the reference point."""
    if words != READINGS["position"] and not measured(stated.batch.velocity[:, 2]):
        yield f"{words.capitalize()} are not moved from {where}, as that needs a yaw rate."
    elif words == READINGS["position"] and stated.batch.pose is not None and not measured(stated.batch.pose[:, 2]):
        yield f"{words.capitalize()} are not moved from {where}, as that needs a heading."
    else:
        yield f"{STATED}{words} are measured {where}; they are moved to amidships."


def _along_axes(stated: Stated) -> Iterator[str]:
    angle = stated.sensors.velocity_angle_rad
    if np.isfinite(stated.batch.velocity[:, :2]).any(axis=0).all():
        yield f"{STATED}velocities are measured along axes {angle:.4g} rad to starboard; they are turned to the ship's."
    else:
        yield f"Velocities are not turned by {angle:.4g} rad to the ship's axes, as that needs surge and sway."


def _where(forward_m: float, starboard_m: float) -> str:
    """A place in words, e.g. 6 m forward and 1 m to port."""
    parts = (
        (forward_m, f"{abs(forward_m):g} m {'forward' if forward_m > 0 else 'aft'}"),
        (starboard_m, f"{abs(starboard_m):g} m to {'starboard' if starboard_m > 0 else 'port'}"),
    )
    return " and ".join(words for size, words in parts if size)


KNOWN: Mapping[str, float] = {}
"""No standard deviations: all times are known exactly."""


def reduced(record: Record, vessel: Vessel, *, smoothed: bool = False) -> Record:
    """The record of the reference point, with the inputs that the actuators deliver.

    Args:
        record: as measured, with commands as inputs.
        vessel: what its file states of actuators and sensors.
        smoothed: whether velocities from the pose are smoothed, rather than central differences.

    Returns:
        The record itself where actuators are ideal, sensors exact but for their noise, velocities measured, and no
        weather is stated. Otherwise batches that lack the samples which a delayed sensor has not yet shown, with a note
        for everything that was undone. Where no wind is measured, and the model reads it, it is the mean wind that is
        stated.

    Raises:
        InputError: no batch is left.
    """
    delivered = with_delivered_inputs(record, vessel.model, std=vessel.std)
    delivered = delivered if smoothed else with_averaged_inputs(delivered)
    return _in_stated_weather(at_reference_point(delivered, vessel.sensors, smoothed=smoothed), vessel)


def with_averaged_inputs(record: Record) -> Record:
    """The record with inputs averaged as velocities are that are central differences of the pose.

    Such a velocity is the mean over the sample before and the one after. Its change in a sample is the mean of the
    acceleration over three samples with the weights 1/4, 1/2, 1/4.
    """
    if not any(set(OUTPUTS) <= set(batch.derived) for batch in record.batches):
        return record
    batches = tuple(_averaged(b) if set(OUTPUTS) <= set(b.derived) else b for b in record.batches)
    note = "Inputs are averaged over three samples, as velocities from the pose are."
    return replace(record, batches=batches, notes=(*record.notes, note))


def _averaged(batch: Batch) -> Batch:
    wide = np.concatenate([batch.inputs[:1], batch.inputs, batch.inputs[-1:]])
    return replace(batch, inputs=(wide[:-2] + 2.0 * wide[1:-1] + wide[2:]) / 4.0, delivered=None)


def _in_stated_weather(record: Record, vessel: Vessel) -> Record:
    """The record with the stated mean wind where none is measured, and a note on a stated current.

    Headings turn the wind; their noise shrinks it, see `records.central_difference`.
    """
    notes, weather = list(record.notes), vessel.environment
    if weather.current_to.any():
        notes.append(
            "The current that the vessel file states is not taken off velocities over ground; augmented methods "
            "estimate the current of the data."
        )
    reads_air = any({"u_q", "v_q"} & set(expression.signals) for expression in vessel.model.expressions)
    unmeasured = all(b.wind is None and b.pose is not None and measured(b.pose[:, 2]) for b in record.batches)
    if not (weather.wind_to.any() and reads_air and unmeasured):
        return record if len(notes) == len(record.notes) else replace(record, notes=tuple(notes))
    north, east = weather.wind_to.tolist()
    notes.append(
        f"No wind is measured; as the vessel file states, it blows at {north:.3g} m/s to north, {east:.3g} m/s to east."
    )
    shrunk = float(np.exp(-(vessel.sensors.heading_rad**2) / 2.0))
    batches = tuple(_blown(batch, weather.wind_to / shrunk) for batch in record.batches)
    return replace(record, batches=batches, notes=tuple(notes))


def _blown(batch: Batch, wind_to: Array) -> Batch:
    assert batch.pose is not None  # as its heading is measured
    wind = turned(np.broadcast_to(wind_to, (len(batch), 2)), -batch.pose[:, 2])
    return replace(batch, wind=batch.velocity[:, :2] - wind)


def with_delivered_inputs(
    record: Record, model: VesselModel, *, standing: Array | None = None, std: Mapping[str, float] = KNOWN
) -> Record:
    """The record with the mean delivered value of every input over each sample, and over each integrator step in it.

    Inputs that are no commands of the model's actuators stay as they are.

    Args:
        record: with commands as inputs.
        model: whose actuators respond.
        standing: (m,) commands held for long before each batch; None for its first ones.
        std: standard deviations of what the vessel file states, as in `Vessel.std`; derivatives by dead times, lags and
            slew rates that have one come with what is delivered.
    """
    responses = {
        signal: response
        for actuator in model.actuators
        for signal, response in zip(actuator.signals, actuator.responses, strict=True)
        if response != IDEAL or any(std.get(f"{signal}_{quantity}", 0.0) > 0 for quantity in TIMES)
    }
    if not responses or not record.batches:
        return record
    names = [name for name in record.batches[0].input_names if name in responses]
    if not names:
        note = "The inputs in the data are forces; the responses that the vessel file states are of other signals."
        return replace(record, notes=(*record.notes, note))
    batches = tuple(_delivered(batch, responses, standing, std) for batch in record.batches)
    notes = [*record.notes, *_slew_notes(record, {name: responses[name] for name in names})]
    reached_in_all = set.intersection(*(set(batch.reached) for batch in record.batches))
    late = [name for name in names if not responses[name].follows and name not in reached_in_all]
    if late:
        notes.append(
            f"As the vessel file states, commands of {', '.join(late)} act with lags, dead times, dead bands or "
            "offsets; what is delivered is used."
        )
    return replace(record, batches=batches, notes=tuple(notes))


def _slew_notes(record: Record, responses: Mapping[str, Response]) -> Iterator[str]:
    """What the recorded values of signals with slew rates are taken for."""
    commands: dict[str, list[str]] = {}  # rate -> columns that are followed at it
    measured_in: dict[str, list[str]] = {}  # in which batches -> columns of positions that were reached
    for name, response in responses.items():
        commanded = [batch for batch in record.batches if name not in batch.reached]
        if len(commanded) < len(record.batches):
            count = len(record.batches) - len(commanded)
            where = f" in {count} of {len(record.batches)} batches" if commanded else ""
            measured_in.setdefault(where, []).append(f"reached_{column_name(name)}")
        if commanded and math.isfinite(response.rate):
            moving = [batch for batch in commanded if np.ptp(batch.inputs[:, batch.input_names.index(name)]) > 0]
            kept = [acting_response(batch, name, response).rate == math.inf for batch in moving]
            column, rate = column_name(name), f"{response.rate:.3g} {RATE_UNITS[stem(name)]}"
            if not kept:
                continue  # what never moves may be either
            if not any(kept):
                commands.setdefault(rate, []).append(column)
            else:
                where = (
                    "" if all(kept) else f" in {sum(kept)} of {len(kept)} batches, and for the command in the others"
                )
                still = "" if replace(response, offset=0.0).follows else "; dead times, lags and dead bands still act"
                yield (
                    f"{column} changes no faster than {rate}, the stated rate, and is taken for the position{where}"
                    f"{still}. A position that was measured is best named reached_{column}."
                )
    for where, columns in measured_in.items():
        verb, them = ("is", "it") if len(columns) == 1 else ("are", "them")
        yield (
            f"{listed(columns)} {verb} used as measured{where}; no rate, dead time, lag or dead band acts on {them}."
        )
    for rate, columns in commands.items():
        one = len(columns) == 1
        yield (
            f"{listed(columns)} {'is taken for the command; it is' if one else 'are taken for commands; they are'} "
            f"followed at {rate}, as the vessel file states."
        )


def _delivered(
    batch: Batch, responses: Mapping[str, Response], standing: Array | None, std: Mapping[str, float]
) -> Batch:
    own = [acting_response(batch, name, responses.get(name, IDEAL)) for name in batch.input_names]
    time_s, planned = batch.sample_time_s, batch.planned
    if planned is not None:
        commanded = [responses.get(name, IDEAL) for name in batch.input_names[: planned.shape[1]]]
        planned = deliver(commanded, planned, sample_time_s=time_s)[:, 0]
    uncertain = {
        f"{name}_{quantity}": UncertainTime(column=column, quantity=quantity)
        for column, name in enumerate(batch.input_names)
        for quantity in TIMES
        if std.get(f"{name}_{quantity}", 0.0) > 0 and name in responses and name not in batch.reached
    }
    if uncertain:
        (values, shares), (by_values, by_shares) = delivered_with_slopes(
            own, batch.inputs, tuple(uncertain.values()), sample_time_s=time_s, substeps=SUBSTEPS, standing=standing
        )
        steps = Delivered(
            values=values,
            shares=shares,
            times=tuple(uncertain),
            values_by_time=np.moveaxis(by_values, 0, -1),
            shares_by_time=by_shares.T,
        )
    else:
        shares = step_shares(own, sample_time_s=time_s, substeps=SUBSTEPS)
        values = deliver(own, batch.inputs, sample_time_s=time_s, substeps=shares, standing=standing)
        if values.shape[1] == 1:  # held over the whole sample
            return replace(batch, inputs=values[:, 0], planned=planned)
        steps = Delivered(values=values, shares=shares)
    return replace(batch, inputs=steps.mean, delivered=steps, planned=planned)


def at_reference_point(record: Record, sensors: Sensors, *, smoothed: bool = False) -> Record:
    """The record with stated faults of sensors undone; arguments and errors as of `reduced`."""
    if not _faulty(sensors):
        return record
    stated = [Stated(batch, sensors, smoothed) for batch in record.batches]
    kept = [cut for item in stated if (cut := _without_ends(item.batch, undone(item))) is not None]
    if not kept:
        raise InputError(
            f"no batch is longer than the delays of the vessel's sensors by {SHORTEST_BATCH} samples or more, "
            "expected such a batch"
        )
    notes = list(dict.fromkeys(remark for item in stated for remark in remarks(item)))
    if len(kept) < len(stated):
        notes.append(f"{len(stated) - len(kept)} batches too short for the delays of the sensors are left out.")
    return replace(record, batches=tuple(kept), notes=(*record.notes, *notes))


def with_reduced_wind(record: Record, sensors: Sensors) -> Record:
    """The record as measured, but for the wind: measured velocity less wind is the air's velocity over ground.

    For models of the sensors themselves, which compare velocities as measured.
    """
    return replace(record, batches=tuple(_with_wind(batch, sensors) for batch in record.batches))


def _with_wind(batch: Batch, sensors: Sensors) -> Batch:
    if batch.wind is None or not _faulty(sensors):
        return batch
    there = undone(Stated(batch, sensors, smoothed=False))
    assert there.wind is not None  # as it was measured
    return replace(batch, wind=batch.velocity[:, :2] - (there.velocity[:, :2] - there.wind))


def _faulty(sensors: Sensors) -> bool:
    noise: dict[str, Any] = {name: getattr(sensors, name) for name in (*NOISE, "wind_sensor")}
    return shrinkage(sensors) < 1.0 or sensors != Sensors(**noise)


def _without_ends(before: Batch, after: Batch) -> Batch | None:
    """The batch without the ends at which velocity or wind was measured and is not known at the reference point."""
    lost = _lost(before.velocity, after.velocity)
    if before.wind is not None and after.wind is not None:
        lost = lost | _lost(before.wind, after.wind)
    known = np.flatnonzero(~lost)
    if len(known) < SHORTEST_BATCH:
        return None
    part = slice(int(known[0]), int(known[-1]) + 1)
    return after if part == slice(0, len(after)) else after.cut(part)


def _lost(before: Array, after: Array) -> NDArray[np.bool_]:
    return np.asarray((np.isfinite(before) & ~np.isfinite(after)).any(axis=1))
