"""Whether the ship answers her inputs in the sense that the vessel file's model gives.

The model at the measured velocities splits an acceleration into what an input adds and the rest. Over windows,

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

import numpy as np

from expdesign.conventions import OUTPUTS, plus_minus
from expdesign.estimation.regression import inputs_of
from expdesign.kinematics.instruments import Finding, integral, stretches
from expdesign.kinematics.relation import CERTAIN, relation
from expdesign.signals import Batch
from expdesign.values import Array
from expdesign.vessel import Actuator, VesselModel, column_name

FASTER = 1.2  # multiple of a stated rate above which an input moves faster than stated
RAMP, FEWEST_RAMPS = 3, 3  # samples of an even movement, and how many of them tell
RAMPS = 0.3  # share of the fast samples that must be inside such movements
RAMP_SPREAD = 0.15  # median deviation from their speed, as a share of it
OPPOSED = (0.1, 10.0)  # least and most size of an answer to an input, in units of the model's, that has the wrong sign
OPPOSED_SHARE = 0.3  # share of the changes that the input explains then
ALIKE = 3.0  # factor from one within which an answer is that of the model
TURNED_RAD, TURNED_SHARE = 1.6, 0.95  # turn against a held input, and its share of all turns, that count as opposed
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
        length_m: of the ship.
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
