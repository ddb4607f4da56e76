"""A record as its instruments show it: readings at their own times, and what does not agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError
from expdesign.estimation.regression import model_for
from expdesign.kinematics.held import Held, held, knots_held
from expdesign.kinematics.instruments import (
    Finding,
    course_as_heading,
    gyro_against_heading,
    log_against_positions,
)
from expdesign.kinematics.steering import against_inputs, faster_than_stated
from expdesign.reduction import at_reference_point, with_delivered_inputs
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Mounting, Sensors, Vessel, VesselModel
from expdesign.vessel.sensors import GAINS_AND_OFFSETS

DRIFTS = 0.2  # that distance of ships, at least, from which the drift is expected


SIGNALS = {"position": "positions", "heading": "headings", "velocity": "velocities", "yaw_rate": "yaw rates",
           "wind": "winds"}  # fmt: skip


SCALES = {
    **{fault.key: tuple(map(OUTPUTS.index, fault.signals)) for fault in GAINS_AND_OFFSETS if fault.is_gain},
    "surge_scale": (0,),
    "sway_scale": (1,),
}
"""Findings that are undone -> columns of the velocity that are divided by them."""
OFFSETS = {fault.key: tuple(map(OUTPUTS.index, fault.signals)) for fault in GAINS_AND_OFFSETS if not fault.is_gain}
"""Findings that are undone -> columns of the velocity that they are taken off."""
LATE = "velocity_delay_s"
"""A finding that is undone where it is positive: then one instrument is late by two others."""
OF_LOG = (*SCALES, LATE, "heading_bias_rad", "current_mps", "position_delay_s", "position_forward_m")[1:]
"""Findings of the same comparison, which one that stands may imitate."""


def checked(record: Record, vessel: Vessel, *, smoothed: bool = False, undo: bool = True) -> Record:
    """The record with held and interpolated signals read in time, and its doubts: what does not agree.

    A gain, an offset or a delay that two other instruments show in all files together is undone.

    Args:
        record: as measured.
        vessel: what its file states of actuators and sensors, which is taken into account.
        smoothed: whether velocities from the pose are smoothed, rather than central differences.
        undo: whether faults that are certain are undone; not where a change of them is watched for.
    """
    in_time = [_in_time(batch, vessel.sensors, smoothed=smoothed) for batch in record.batches]
    record = replace(record, batches=tuple(batch for batch, _ in in_time))
    held_notes = _shared([(batch.name, note) for batch, notes in in_time for note in notes])
    files = list(dict.fromkeys(map(_file, record.batches)))
    everywhere = ", ".join(files[:1]) + (f" and {len(files) - 1} more" if len(files) > 1 else "")
    found = _findings(record, vessel, smoothed=smoothed)
    done = {item.name: _what_is_done(item) if undo else "" for item in found}
    faults = [f"{everywhere}: {item.text}{done[item.name]}" for item in found]
    known = [item for item in found if done[item.name]]
    record = _undone(record, known, vessel.sensors, smoothed=smoothed)
    stands = {name for name, text in done.items() if not text}
    stands |= {*OF_LOG} if stands & {*OF_LOG} else set()
    for file in files * (len(files) > 1):
        own = replace(record, batches=tuple(batch for batch in record.batches if _file(batch) == file))
        alone = _findings(own, vessel, smoothed=smoothed)
        faults += [f"{file}: {item.text}" for item in alone if item.name not in stands]
    doubts = (*held_notes, *faults)
    return replace(record, notes=(*doubts, *record.notes), doubts=doubts, faults=tuple(faults))


def _what_is_done(item: Finding) -> str:
    """A sentence on what is undone of a finding; "" for nothing."""
    if item.name in SCALES:
        return " Here it is divided by that."
    if item.name in OFFSETS:
        return " Here that is taken off."
    return " Here they are moved to their own time." if item.name == LATE and item.value > 0 else ""


def _undone(record: Record, found: Sequence[Finding], sensors: Sensors, *, smoothed: bool) -> Record:
    """The record with measured velocities without the gains and offsets that were found, and at their own times."""
    late = sum(item.value for item in found if item.name == LATE)
    record = replace(record, batches=tuple(_corrected(batch, found) for batch in record.batches))
    if not late:
        return record
    like = Sensors(heading_rad=sensors.heading_rad, velocity=Mounting(delay_s=late))
    return replace(record, batches=at_reference_point(record, like, smoothed=smoothed).batches)


def _corrected(batch: Batch, found: Sequence[Finding]) -> Batch:
    gains, offsets = np.ones(3), np.zeros(3)
    measured = [name not in batch.derived for name in OUTPUTS]
    for item in found:
        gains[[column for column in SCALES.get(item.name, ()) if measured[column]]] *= item.value
        offsets[[column for column in OFFSETS.get(item.name, ()) if measured[column]]] += item.value
    same = (gains == 1.0).all() and not offsets.any()
    return batch if same else replace(batch, velocity=(batch.velocity - offsets) / gains)


def in_stated_time(record: Record, sensors: Sensors) -> Record:
    """The record with signals read at the stated intervals of their sensors, for models that know no intervals."""
    intervals = {name: Mounting(interval_s=getattr(sensors, name).interval_s) for name in SIGNALS}
    if not any(place.interval_s for place in intervals.values()):
        return record
    like: dict[str, Any] = {name: place for name, place in intervals.items() if place.interval_s}
    own = replace(Sensors(heading_rad=sensors.heading_rad), **like)
    read = at_reference_point(record, own)
    return replace(read, batches=tuple(map(_where_pose_is_known, read.batches)))


def _in_time(batch: Batch, sensors: Sensors, *, smoothed: bool) -> tuple[Batch, list[str]]:
    """A batch with the signals that its file holds between readings, of sensors without a stated interval."""
    found = {
        name: how
        for name, values in _signals(batch).items()
        if not getattr(sensors, name).interval_s and (how := held(values)) is not None
    }
    notes = [_how_held(name, how, batch.sample_time_s) for name, how in found.items()]
    undone = {name: how for name, how in found.items() if how.even}
    if not undone:
        return batch, notes
    lines = {name: knots_held(_signals(batch)[name], how) for name, how in undone.items() if how.interpolated}
    intervals: dict[str, Any] = {
        name: Mounting(interval_s=how.interval * batch.sample_time_s) for name, how in undone.items()
    }
    like = replace(Sensors(heading_rad=sensors.heading_rad), **intervals)
    (read,) = at_reference_point(Record(batches=(_with(batch, lines),)), like, smoothed=smoothed).batches
    return _where_pose_is_known(read), notes


def _where_pose_is_known(batch: Batch) -> Batch:
    """A batch without the ends before the first and after the last reading of a pose."""
    if batch.pose is None:
        return batch
    known = np.flatnonzero(np.isfinite(batch.pose[:, np.isfinite(batch.pose).any(axis=0)]).all(axis=1))
    return batch.cut(slice(int(known[0]), int(known[-1]) + 1)) if len(known) else batch


def _signals(batch: Batch) -> dict[str, Array]:
    """Sensor -> its measured values (k, c)."""
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


def _with(batch: Batch, lines: dict[str, Array]) -> Batch:
    """The batch with other values of some sensors."""
    pose, velocity = (None if own is None else own.copy() for own in (batch.pose, batch.velocity))
    assert velocity is not None
    for name, part in (("position", slice(0, 2)), ("heading", slice(2, 3))):
        if name in lines and pose is not None:
            pose[:, part] = lines[name]
    for name, part in (("velocity", slice(0, 2)), ("yaw_rate", slice(2, 3))):
        if name in lines:
            velocity[:, part] = lines[name]
    return replace(batch, pose=pose, velocity=velocity, wind=lines.get("wind", batch.wind))


def _how_held(name: str, how: Held, sample_time_s: float) -> str:
    seconds, words = how.interval * sample_time_s, SIGNALS[name]
    between = "a straight line is drawn between readings" if how.interpolated else "the last one is repeated in between"
    if not how.even:
        return (
            f"the {words} are read about every {seconds:.3g} s, and {between}, at uneven times: they cannot be undone, "
            "and rates and differences from them are wrong"
        )
    return (
        f"the {words} are read every {seconds:.4g} s, and {between} ({how.changes} changes tell); they count as read "
        f"then, as with sensors.{name}_interval_s = {seconds:.4g}"
    )


def _findings(record: Record, vessel: Vessel, *, smoothed: bool) -> list[Finding]:
    """What instruments, or inputs and motion, disagree about in all batches together."""
    try:
        seen = at_reference_point(record, vessel.sensors, smoothed=smoothed)
        model = model_for(vessel.model, seen)
    except InputError:  # told by whoever needs them
        return []
    moved = faster_than_stated(record.batches, vessel.model.actuators)
    return [*_disagreements(with_delivered_inputs(seen, model).batches, vessel, model), *moved]


def _file(batch: Batch) -> str:
    return batch.name.partition(", batch ")[0]


def _disagreements(batches: Sequence[Batch], vessel: Vessel, model: VesselModel) -> Iterator[Finding]:
    length_m = vessel.length_m
    course = list(course_as_heading(batches, length_m=length_m, drifts=drifts(batches, model, length_m)))
    yield from course
    if not course:
        yield from gyro_against_heading(batches, length_m=length_m)
        yield from log_against_positions(batches, length_m=length_m)
    yield from against_inputs(batches, model, length_m=length_m)


def drifts(batches: Sequence[Batch], model: VesselModel, length_m: float) -> float:
    """Distance forward of midships, in ship lengths, of the place that by the model does not drift in these turns.

    At the measured speeds and yaw rates, the model's sway is taken for steady. What ships do where the model says
    nothing: no sway, or all parameters zero.
    """
    velocity = np.concatenate([batch.velocity for batch in batches])
    u, r = velocity[np.isfinite(velocity[:, [0, 2]]).all(axis=1)][:, [0, 2]].T
    if "v" not in model.outputs or not len(u):
        return 0.0 if "v" not in model.outputs else DRIFTS
    still, small = np.zeros_like(u), 0.01 * np.maximum(np.abs(u), 1e-6)
    inputs = np.zeros((len(model.inputs), len(u)))

    def sway(v: Array) -> Array:
        return np.broadcast_to(np.asarray(model.accelerations((u, v, r), (u, v), inputs)[1], dtype=float), u.shape)

    damping = (sway(small) - sway(-small)) / (2.0 * small)
    steady = np.divide(-sway(still), damping, out=np.zeros_like(u), where=damping < 0)
    expected = float(-(steady @ r) / max(r @ r, 1e-300)) / length_m
    return min(abs(expected), DRIFTS) if (damping < 0).any() and (sway(still) != 0).any() else DRIFTS


def _shared(noted: Sequence[tuple[str, str]]) -> list[str]:
    """Notes with the names of the batches that share them."""
    names: dict[str, list[str]] = {}
    for name, note in noted:
        names.setdefault(note, []).append(name)
    return [f"{own[0]}{f' and {len(own) - 1} more' if len(own) > 1 else ''}: {note}" for note, own in names.items()]
