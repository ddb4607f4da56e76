"""A record as its instruments show it: readings at their own times, and what does not agree.

One of these is whether the ship answers her inputs in the sense that the vessel file's model gives. That model, at the
measured velocities, splits an acceleration into what an input adds and the rest. Over windows,

    change of r = k * integral of the input's share + b * integral of the rest + ...

and k is about one where model and record agree, whatever the size of the forces. Where the input's sign is wrong in the
record, or the parameter's in the vessel file, k is negative: no convention of either is taken for granted.

A turning circle by itself does not tell k apart from the ship's damping; there the turn itself must be the other way,
by more than a quarter of a circle while the input is held.

Where k is far above one, and about one with the inputs in the other unit of their kind, the column has the name of the
wrong unit.

Inputs that answer the ship are no trouble as long as they explain her changes: a helmsman against a gust moves the
rudder against the turn, but then the rudder does not explain it, and nothing is said.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.conventions import OUTPUTS, plus_minus
from expdesign.errors import InputError
from expdesign.estimation.regression import inputs_of, model_for
from expdesign.kinematics.held import Held, held, knots_held
from expdesign.kinematics.instruments import (
    Finding,
    course_as_heading,
    gyro_against_heading,
    log_against_positions,
    shown_delays,
)
from expdesign.kinematics.relation import CERTAIN, integral, relation, stretches
from expdesign.reduction import at_reference_point, readings_by_sensor, with_delivered_inputs
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Actuator, Sensors, Vessel, VesselModel, column_name
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, LOG, READINGS, SENSORS

FASTER = 1.2  # multiple of a stated rate above which an input moves faster than stated
RAMP, FEWEST_RAMPS = 3, 3  # samples of an even movement, and how many of them tell
RAMPS = 0.3  # share of the fast samples that must be inside such movements
RAMP_SPREAD = 0.15  # median deviation from their speed, as a share of it
OPPOSED = (0.1, 10.0)  # least and most size of an answer to an input, in units of the model's, that has the wrong sign
OPPOSED_SHARE = 0.3  # share of the changes that the input explains then
ALIKE = 3.0  # factor from one within which an answer is that of the model
TURNED_RAD, TURNED_SHARE = 1.6, 0.95  # turn against a held input, and its share of all turns, that count as opposed
AXES_MATTER = 0.3  # difference of the scales of both axes that is told; slow sway may look like half of it
EXPLAINED = 0.5  # least share of the way along one axis that the other then explains
PUSHING = 0.1  # share of an input's largest effect below which it is not held to any side

GROUPS = (
    ("rudder", 2, ("rudder",), "the ship turns against the rudder", "positive to port"),
    ("azimuth", 2, ("a",), "the ship turns against her thrusters' angles", "positive to port"),
    ("tunnel", 2, ("n",), "the ship turns against her tunnel thruster", "positive to port"),
    ("force", 2, ("tau_psi",), "the ship turns against the moment", "positive to port"),
    ("propeller", 0, ("n",), "the ship goes against her propeller", "negative ahead"),
    ("azimuth", 0, ("n",), "the ship goes against her thrusters", "negative ahead"),
    ("force", 0, ("tau_x",), "the ship goes against the force", "negative ahead"),
)
"""Kind of actuator, equation, stems of signals, what is seen where the answer is opposite, and the likely reason."""
UNITS = {
    "rudder": (180.0 / np.pi, "radians under the name of degrees"),
    "propeller": (60.0, "revolutions per second under the name of revolutions per minute"),
}
"""Factor between the units of an input and the mistake by which it is recorded so much too small. Too large ones are
beyond the actuators' limits, which is told where records are read."""


def against_inputs(batches: Sequence[Batch], model: VesselModel, *, length_m: float) -> Iterator[Finding]:
    """Groups of inputs that the ship answers in the opposite sense, or as if they were recorded in another unit.

    Args:
        batches: at the reference point, with delivered inputs.
        model: of the vessel file, driven by what is recorded.
    """
    for kind, axis, stems, seen, reason in GROUPS:
        own = [
            signal
            for actuator in model.actuators
            if actuator.kind == kind
            for signal in actuator.signals
            if signal.rstrip("0123456789") in stems
        ]
        if not own or OUTPUTS[axis] not in model.outputs:
            continue
        places = [model.inputs.index(signal) for signal in own]
        answers = [_answers(batch, model, axis, places) for batch in batches]
        names = ", ".join(own)
        question = f"Is {names} {reason}, or a sign wrong in [model.parameters]?"
        found = relation(stretches(batches, answers, length_m=length_m))
        if found is not None and found.share >= OPPOSED_SHARE:
            low, high = OPPOSED
            answer, std = found.ratio.real, found.std[0]
            if answer < -CERTAIN * std and low < -answer < high:
                yield Finding(
                    name=f"answer_to_{kind}", value=answer, std=std, rest=found.rest,
                    text=f"{seen}: the change of {OUTPUTS[axis]} is {plus_minus(answer, std)} times what the vessel "
                    f"file's model gives. {question}",
                )  # fmt: skip
            if abs(answer) > high and kind in UNITS:
                times, mistake = UNITS[kind]
                larger = [_answers(batch, model, axis, places, times) for batch in batches]
                then = relation(stretches(batches, larger, length_m=length_m))
                if then is not None and 1.0 / ALIKE < then.ratio.real < ALIKE:
                    yield Finding(
                        name=f"unit_of_{kind}", value=answer, std=std, rest=found.rest,
                        text=f"the change of {OUTPUTS[axis]} is {plus_minus(answer, std)} times what the vessel file's "
                        f"model gives, and {plus_minus(then.ratio.real, then.std[0])} times with {names} {times:.3g} "
                        f"times as large: {mistake}?",
                    )  # fmt: skip
        elif found is None and OUTPUTS[axis] == "r":
            turned = np.concatenate([_turned(rows) for rows in answers])
            against = -float(turned[turned < 0].sum())
            if against > max(TURNED_RAD, TURNED_SHARE * float(np.abs(turned).sum())):
                yield Finding(
                    name=f"answer_to_{kind}", value=-against, std=0.0, rest=float(turned[turned > 0].sum()),
                    text=f"{seen}: by {np.degrees(against):.0f} degrees in all the other way than the vessel file's "
                    f"model gives. {question}",
                )  # fmt: skip


def faster_than_stated(batches: Sequence[Batch], actuators: Sequence[Actuator]) -> Iterator[Finding]:
    """Inputs that move evenly, and faster than an actuator of the vessel file can: positions, and a rate that is wrong.

    Orders jump, or follow a helmsman; an actuator that slews goes on for several samples in equal steps.

    Args:
        batches: with inputs as recorded.
        actuators: with the rates that the file states.
    """
    for actuator in actuators:
        for signal, response in zip(actuator.signals, actuator.responses, strict=True):
            own = [one for one in batches if signal in one.input_names and signal not in one.reached]
            speeds = [np.diff(one.inputs[:, one.input_names.index(signal)]) / one.sample_time_s for one in own]
            ramps = [part for values in speeds for part in _ramps(values, FASTER * response.rate)]
            long = [part[1:-1] for part in ramps if len(part) >= RAMP]
            inner = np.concatenate(long) if long else np.zeros(0)
            if sum(map(len, ramps)) > len(inner) / RAMPS or len(long) < FEWEST_RAMPS:
                continue
            rate, spread = float(np.median(inner)), float(np.median(np.abs(inner - np.median(inner))))
            if spread < RAMP_SPREAD * rate:
                yield Finding(
                    name=f"rate_of_{signal}", value=rate, std=spread / np.sqrt(len(long)), rest=spread,
                    text=f"{signal} moves evenly at {rate:.3g} per second in {len(long)} places, where the vessel file "
                    f"states {response.rate:.3g}: a measured position (name it reached_{column_name(signal)}), and "
                    "another rate?",
                )  # fmt: skip


def _ramps(speeds: Array, least: float) -> list[Array]:
    """Sizes of successive speeds (k,) above a least one and of one sign."""
    sense = np.sign(speeds) * (np.abs(speeds) > least)
    parts = np.split(np.arange(len(speeds)), np.flatnonzero(np.diff(sense)) + 1)
    return [np.abs(speeds[part]) for part in parts if sense[part[0]]] if len(speeds) else []


def _turned(answers: Array) -> Array:
    """(n,) what the ship turns by while the inputs' share keeps its sign, counted in the sense of that share [rad]."""
    share, turn = np.diff(answers[:, 1]), np.diff(answers[:, 3])
    sense = np.sign(share) * (np.abs(share) > PUSHING * np.abs(share).max(initial=0.0))
    ends = np.flatnonzero(np.diff(sense)) + 1
    return np.array([part.sum() for part in np.split(sense * turn, ends)])


def _answers(batch: Batch, model: VesselModel, axis: int, places: Sequence[int], times: float = 1.0) -> Array:
    """(k, 5) running velocity, integrals of the share of inputs so large and of the rest, of the velocity, of time."""
    inputs = inputs_of(model, batch).copy()
    inputs[:, places] *= times
    neutral = inputs.copy()
    neutral[:, places] = 0.0
    moving = batch.velocity if batch.wind is None else np.where(np.isfinite(batch.velocity), batch.velocity, 0.0)
    air = batch.wind if batch.wind is not None else moving[:, :2]
    whole, rest = (
        np.broadcast_to(model.accelerations(moving.T, air.T, own.T)[axis], (len(batch),)) for own in (inputs, neutral)
    )
    velocity = batch.velocity[:, axis]
    return np.column_stack(
        [velocity, integral(whole - rest, batch), integral(rest, batch), integral(velocity, batch), batch.time_s]
    )


DRIFTS = 0.2  # that distance of ships, at least, from which the drift is expected
SCALES = {row.key: tuple(map(OUTPUTS.index, row.signals)) for row in GAINS_AND_OFFSETS if row.is_gain}
"""Findings that are undone -> columns of the velocity that are divided by them."""
OFFSETS = {row.key: tuple(map(OUTPUTS.index, row.signals)) for row in GAINS_AND_OFFSETS if not row.is_gain}
"""Findings that are undone -> columns of the velocity that they are taken off."""
LATE = "velocity_delay_s"  # a finding that is undone where it is positive: then one instrument is late by two others
OF_LOG = (
    *(row.key for row in GAINS_AND_OFFSETS if row.shown_by == LOG),
    *(LATE, "heading_bias_rad", "current_mps", "position_delay_s", "position_forward_m", "position_axes"),
)
"""Findings of the same comparison, which one that stands may imitate."""


def checked(record: Record, vessel: Vessel, *, smoothed: bool = False, undo: bool = True) -> Record:
    """The record with held and interpolated signals read in time, and its doubts: what does not agree.

    A gain, an offset or a delay that two other instruments show in all files together is undone. What a gyro and a
    heading show of each other's clocks stands beside (`Record.shown`).

    Args:
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
    shown = shown_delays(record.batches, length_m=vessel.length_m)
    return replace(record, notes=(*doubts, *record.notes), doubts=doubts, faults=tuple(faults), shown=shown)


def in_doubt(record: Record) -> dict[str, tuple[str, ...]]:
    """Batches of files whose instruments disagree as those of other files do not: name -> what is said of the file."""
    said = [(text.partition(": ")[0], text) for text in record.faults]
    found = {
        batch.name: tuple(text for file, text in said if batch.name == file or batch.name.startswith(f"{file}, "))
        for batch in record.batches
    }
    return {} if all(found.values()) else {name: texts for name, texts in found.items() if texts}


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
    like = Sensors(heading_rad=sensors.heading_rad, velocity_delay_s=late)
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
    intervals: dict[str, Any] = {key: getattr(sensors, key) for key in (f"{name}_interval_s" for name in SENSORS)}
    if not any(intervals.values()):
        return record
    own = Sensors(heading_rad=sensors.heading_rad, **intervals)
    read = at_reference_point(record, own)
    return replace(read, batches=tuple(map(_where_pose_is_known, read.batches)))


def _in_time(batch: Batch, sensors: Sensors, *, smoothed: bool) -> tuple[Batch, list[str]]:
    """A batch with the signals that its file holds between readings, of sensors without a stated interval."""
    found = {
        name: how
        for name, values in readings_by_sensor(batch).items()
        if not sensors.timing(name)[1] and (how := held(values)) is not None
    }
    notes = [_how_held(name, how, batch.sample_time_s) for name, how in found.items()]
    undone = {name: how for name, how in found.items() if how.even}
    if not undone:
        return batch, notes
    lines = {name: knots_held(readings_by_sensor(batch)[name], how) for name, how in undone.items() if how.interpolated}
    intervals: dict[str, Any] = {
        f"{name}_interval_s": how.interval * batch.sample_time_s for name, how in undone.items()
    }
    like = Sensors(heading_rad=sensors.heading_rad, **intervals)
    (read,) = at_reference_point(Record(batches=(_with(batch, lines),)), like, smoothed=smoothed).batches
    return _where_pose_is_known(read), notes


def _where_pose_is_known(batch: Batch) -> Batch:
    """A batch without the ends before the first and after the last reading of a pose."""
    if batch.pose is None:
        return batch
    known = np.flatnonzero(np.isfinite(batch.pose[:, np.isfinite(batch.pose).any(axis=0)]).all(axis=1))
    return batch.cut(slice(int(known[0]), int(known[-1]) + 1)) if len(known) else batch


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
    seconds, words = how.interval * sample_time_s, READINGS[name]
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
    axes = list(axes_of_positions(batches, length_m=length_m))
    yield from axes
    course = list(course_as_heading(batches, length_m=length_m, drifts=drifts(batches, model, length_m)))
    yield from () if axes else course
    if axes:  # they tell nothing of a log
        yield from gyro_against_heading(batches, length_m=length_m)
    elif not course:
        gyro = list(gyro_against_heading(batches, length_m=length_m))
        yield from gyro
        late_s = max(0.0, -sum(item.value for item in gyro if item.name == "yaw_rate_delay_s"))
        # a heading that is late bends the way that a log tells, as would an antenna elsewhere
        turned = [_heading_sooner(batch, late_s) for batch in batches] if late_s else batches
        yield from log_against_positions(turned, length_m=length_m)
    yield from against_inputs(batches, model, length_m=length_m)


def axes_of_positions(batches: Sequence[Batch], *, length_m: float) -> Iterator[Finding]:
    """The scale of east over that of north, a, where it certainly is not one: an axis in feet, or unshortened degrees.

    A ship moves along her heading, whatever her course, so that on tracks that bend enough to tell

        east' cos(heading) = a north' sin(heading) + sway + stream + bias ahead'
    """
    own = [batch for batch in batches if batch.pose is not None]
    found = relation(stretches(own, [_ways(batch) for batch in own], length_m=length_m))
    if found is None or found.ratio.real <= 0.0 or found.share < EXPLAINED:
        return
    if found.differs(1.0, by=AXES_MATTER):
        ratio, std = found.size, found.size_std
        yield Finding(
            name="position_axes", value=ratio, std=std, rest=found.rest,
            text=f"positions move {plus_minus(ratio, std)} times as far to east as to north for the same way along the "
            "heading: has one axis another unit (feet are 0.3048 m), or are degrees of longitude not shortened by the "
            "cosine of the latitude? Nothing that follows from these positions is right.",
        )  # fmt: skip


def _ways(batch: Batch) -> Array:
    """(k, 6) running way to east by cosine and to north by sine of the heading, heading, way ahead, stream to both."""
    assert batch.pose is not None
    north, east, heading = batch.pose.T
    middle = (heading[1:] + heading[:-1]) / 2.0
    along = np.diff(east) * np.cos(middle), np.diff(north) * np.sin(middle)
    ahead = np.diff(north) * np.cos(middle) + np.diff(east) * np.sin(middle)
    stream = np.cos(middle) * batch.sample_time_s, np.sin(middle) * batch.sample_time_s
    own, other, *rest = (np.cumsum(np.append(0.0, part)) for part in (*along, ahead, *stream))
    return np.column_stack([own, other, heading, *rest])


def _heading_sooner(batch: Batch, late_s: float) -> Batch:
    """A batch with the heading of so much later [s]; nan where it ends before."""
    if batch.pose is None:
        return batch
    pose = batch.pose.copy()
    pose[:, 2] = np.interp(batch.time_s + late_s, batch.time_s, pose[:, 2], right=np.nan)
    return replace(batch, pose=pose)


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
