"""Faults injected into measured trials, or into the model that was fitted to others, and what shows and names them.

Beside the diagnosis stand two tests that know what to look for, and say whether the records show a fault at all:

    kinematics   what instruments disagree about over windows, regressed on what the fault adds to it
    oracle       the true cause alone, fitted to all runs but one by simulations of 30 s, simulates that run better
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import fit
from expdesign.diagnosis.model.terms import term_library
from expdesign.diagnosis.motion import fitted_start, stable_windows
from expdesign.diagnosis.motion.simulation import simulate_from_measured
from expdesign.diagnosis.vessel_file.reading import extended_model, public_name
from expdesign.signals import Batch, Record
from expdesign.simulation.motion import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, VesselModel

AHEAD_S = 30.0
OFFSET_RAD, BIAS_RAD, GAIN, DELAY_S, CURRENT_MPS = np.radians(2.0), np.radians(3.0), 0.9, 1.0, 0.07
LEAD_S = 1.5  # by which orders are made early to find a dead time below zero
SCALE, ARM_M, LATE_S, RATE_RADPS = 0.95, 0.7, 0.7, 0.07
CERTAIN = 5.0  # parameters that are so many standard deviations from zero may be taken out
LEAST_COST = 0.1  # relative growth of some error 30 s ahead by which a term that is taken out must show
SEEN = 0.05  # p-value of an oracle that sees: six stretches give no less than 0.016
STD = 2.5  # standard errors within which a size is right
OF_MODEL = ("delay:all", "lead:all", "offset:rudder", "offset:a")  # effects that a model may lack before a fault


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault.

    Attributes:
        name: in the table.
        batch: what it does to a batch as recorded.
        model: what it does to the model in use, by the record that is judged; None where there is no such fault.
        causes: names of the catalogue that are right.
        effects: of the extended model, with their true values; what an oracle fits.
        record: pattern of what the record's own faults say of it, with size and standard error or without both, and the
            true size.
        needs: kind of actuator that there must be.
    """

    name: str
    batch: Callable[[Batch, np.random.Generator], Batch] | None = None
    model: Callable[[Vessel, Record], tuple[Vessel, str, float] | None] | None = None
    causes: tuple[str, ...] = ()
    effects: tuple[tuple[str, float], ...] = ()
    record: tuple[str, float] | None = None
    needs: str = ""


def _rudder(change: Callable[[Array], Array]) -> Callable[[Batch, np.random.Generator], Batch]:
    def changed(batch: Batch, _rng: np.random.Generator) -> Batch:
        inputs = np.array(batch.inputs)
        columns = [at for at, name in enumerate(batch.input_names) if name.startswith(("rudder", "a"))]
        inputs[:, columns] = change(inputs[:, columns])
        return replace(batch, inputs=inputs)

    return changed


def _one_engine(batch: Batch, _rng: np.random.Generator) -> Batch:
    """The speed of the first of several engines, recorded too small."""
    return replace(batch, inputs=batch.inputs * [GAIN if name == "n1" else 1.0 for name in batch.input_names])


def _early(batch: Batch, _rng: np.random.Generator) -> Batch:
    """Inputs as commands that actuators follow after the delay: recorded that much earlier than they act."""
    return _ahead(batch, DELAY_S)


def _ahead(batch: Batch, lead_s: float) -> Batch:
    """Inputs recorded that much earlier than they act."""
    count = round(lead_s / batch.sample_time_s)
    ahead = np.concatenate([batch.inputs[count:], np.repeat(batch.inputs[-1:], count, axis=0)])
    return replace(batch, inputs=ahead)


def _behind(batch: Batch, _rng: np.random.Generator) -> Batch:
    """Inputs recorded by a clock that is behind: that much later than they act."""
    count = round(DELAY_S / batch.sample_time_s)
    behind = np.concatenate([np.repeat(batch.inputs[:1], count, axis=0), batch.inputs[:-count]])
    return replace(batch, inputs=behind)


def _misaligned(batch: Batch, _rng: np.random.Generator) -> Batch:
    """A compass that shows too much, with which velocities over ground were turned into the ship's axes."""
    assert batch.pose is not None
    c, s = np.cos(BIAS_RAD), np.sin(BIAS_RAD)
    u, v, r = batch.velocity.T
    return replace(
        batch,
        velocity=np.stack([u * c + v * s, v * c - u * s, r], axis=-1),
        pose=batch.pose + np.array([0.0, 0.0, BIAS_RAD]),
    )


def _drifting(batch: Batch, rng: np.random.Generator) -> Batch:
    """The same motion through the water in a current, towards any side."""
    assert batch.pose is not None
    north, east = current_of(rng)
    u_c, v_c = to_body((north, east), batch.pose[:, 2], NUMPY)
    time = np.arange(len(batch)) * batch.sample_time_s
    return replace(
        batch,
        velocity=batch.velocity + np.stack([u_c, v_c, np.zeros_like(u_c)], axis=-1),
        pose=batch.pose + np.stack([north * time, east * time, np.zeros_like(time)], axis=-1),
    )


def current_of(rng: np.random.Generator) -> tuple[float, float]:
    """To north and east [m/s]."""
    toward = float(rng.uniform(0, 2 * np.pi))
    return CURRENT_MPS * np.cos(toward), CURRENT_MPS * np.sin(toward)


def _scaled(*factors: float) -> Callable[[Batch, np.random.Generator], Batch]:
    return lambda batch, _rng: replace(batch, velocity=batch.velocity * np.array(factors))


def _log_forward(batch: Batch, _rng: np.random.Generator) -> Batch:
    """A log forward of amidships."""
    return replace(batch, velocity=batch.velocity + ARM_M * batch.velocity[:, 2:] * np.array([0.0, 1.0, 0.0]))


def _forward(batch: Batch, rng: np.random.Generator) -> Batch:
    """Log and antenna forward of amidships."""
    assert batch.pose is not None
    heading = batch.pose[:, 2]
    arm = ARM_M * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=-1)
    return replace(_log_forward(batch, rng), pose=batch.pose + arm)


def _late(batch: Batch, _rng: np.random.Generator) -> Batch:
    """Velocities ahead and to starboard as they were a while ago."""
    time = np.arange(len(batch)) * batch.sample_time_s
    velocity = np.array(batch.velocity)
    for column in range(2):
        velocity[:, column] = np.interp(time - LATE_S, time, velocity[:, column])
    return replace(batch, velocity=velocity)


def _slower(vessel: Vessel, record: Record) -> tuple[Vessel, str, float] | None:
    """A rate of the rudder that is a quarter of its own: recorded angles are then taken for commands."""
    actuators = tuple(
        replace(one, responses=tuple(replace(own, rate=RATE_RADPS) for own in one.responses))
        if one.kind == "rudder" else one
        for one in vessel.model.actuators
    )  # fmt: skip
    return replace(vessel, model=replace(vessel.model, actuators=actuators)), "slew:rudder", np.nan


def _taken_out(vessel: Vessel, record: Record) -> tuple[Vessel, str, float] | None:
    """The well-determined term of the library that costs least, of those that cost enough; not those of the air."""
    model = vessel.model
    rows = zip(model.names, model.parameters.tolist(), model.parameter_std.tolist(), strict=True)
    certain = [name for name, value, std in rows if abs(value) > CERTAIN * std]
    known = {name: found for name in certain if (found := _library_name(model, name))}
    whole = error_ahead(vessel, record)
    costs = {
        name: float((error_ahead(replace(vessel, model=_without(model, name)), record) / whole).max()) - 1.0
        for name in known
    }
    name = min((name for name, cost in costs.items() if cost >= LEAST_COST), key=costs.__getitem__, default=None)
    if name is None:
        return None
    size = of_term(vessel, record, name)
    return replace(vessel, model=_without(model, name)), f"term:{known[name]}", size


def _library_name(model: VesselModel, name: str) -> str | None:
    """The only library term that the model gains when one of its own is taken out."""
    gained = [*set(term_library(_without(model, name))) - set(term_library(model))]
    return gained[0] if len(gained) == 1 else None


def _without(model: VesselModel, name: str) -> VesselModel:
    kept = [index for index, own in enumerate(model.names) if own != name]
    return replace(
        model,
        terms=tuple(model.terms[index] for index in kept),
        parameters=model.parameters[kept],
        parameter_std=model.parameter_std[kept],
    )


def error_ahead(vessel: Vessel, record: Record) -> Array:
    """(3,) root mean square error of u, v, r predicted 30 s ahead, anew every 30 s, over all samples."""
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record, longest_s=AHEAD_S)
    return np.asarray(np.sqrt(np.nanmean(simulate_from_measured(ship, windows).error[..., :3] ** 2, axis=(0, 1))))


def oracle(vessel: Vessel, record: Record, effects: Sequence[tuple[str, float]]) -> float:
    """p-value that the true cause alone, fitted to all runs but one, simulates the stretches of that one no better."""
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record, longest_s=AHEAD_S)
    scale = np.sqrt(np.nanvar(windows.measured[..., :3], axis=(0, 1)))
    keys = [key for key, _ in effects]
    size = np.array([abs(value) if np.isfinite(value) and value else 1.0 for _, value in effects])

    def errors(values: Array, held: Array) -> Array:
        changed = ship.with_effects({key: ship.get(key) + x for key, x in zip(keys, values * size, strict=True)})
        error = simulate_from_measured(changed, windows.selected(held)).error[..., :3] / scale
        return np.asarray(np.nan_to_num(error))

    lost, left = [], []
    for batch in np.unique(windows.batch):
        held = windows.batch == batch
        if held.all():
            return 1.0
        found = scipy.optimize.least_squares(
            lambda values, held=held: errors(values, ~held).ravel(), np.full(len(keys), 0.3), diff_step=0.05,
            max_nfev=15,
        )  # fmt: skip
        lost.append((errors(np.zeros(len(keys)), held) ** 2).mean(axis=(1, 2)))
        left.append((errors(found.x, held) ** 2).mean(axis=(1, 2)))
    before, after = (np.concatenate(one) for one in (lost, left))
    if before.sum() <= after.sum() or not (before - after).any():
        return 1.0
    return float(scipy.stats.wilcoxon(np.log(before + 1e-12) - np.log(after + 1e-12), alternative="greater").pvalue)


def kinematics_see(clean: Record, faulty: Record) -> bool:
    """Whether instruments disagree as the fault makes them, by their noise and by all else that they disagree about."""
    own, changed = (np.concatenate([_disagreement(batch) for batch in record.batches]) for record in (clean, faulty))
    for sign, seen in zip((changed - own).T, changed.T, strict=True):
        if np.abs(sign).max() > 1e-6:
            found = scipy.stats.linregress(sign, seen)
            if found.slope > 0 and found.pvalue < SEEN:
                return True
    return False


def _disagreement(batch: Batch) -> Array:
    """(n, 3) of positions with the integral of velocities, and of headings with that of the yaw rate, over 10 s."""
    way, pose, *_ = _changes(batch)
    rest = pose - way
    return np.stack([rest[:, 0].real, rest[:, 0].imag, rest[:, 1].real], axis=-1)


def of_instruments(record: Record) -> dict[str, float]:
    """What instruments of a record disagree about already: effect -> value, by least squares over windows of 10 s."""
    way, pose, bow, moving = (np.concatenate(parts) for parts in zip(*map(_changes, record.batches), strict=True))
    columns = np.stack([pose[:, 0], bow, moving], axis=-1)
    scale, arm, late = np.linalg.lstsq(columns, way[:, 0], rcond=None)[0].real
    turns = np.column_stack([pose[:, 1].real, np.ones(len(pose))])  # beside the zero of the gyro
    gyro = float(np.linalg.lstsq(turns, way[:, 1].real, rcond=None)[0][0])
    return {"gyro": gyro - 1.0, "log": float(scale) - 1.0, "lever:forward": float(-arm), "late:u": float(-late)}


def of_model(vessel: Vessel, record: Record, effects: Iterable[str], beside: Mapping[str, float]) -> dict[str, float]:
    """What of these a model lacks on untouched records already, each by the likelihood alone.

    A ship needs some angle to sail straight, another one on another day. Least squares make a dead time: their
    differences from sample to sample are those of a ship a little later than she is, or sooner. Less than no dead time
    is no effect, so that it is found beside orders that are made early by `LEAD_S`, which no fault is. A slew rate also
    makes the ship late: what she lacks beside another one than the file's is another dead time. Orders that are late
    hide one of the same length.

    Args:
        beside: effects that the model has instead of those of the file.
    """
    found = {}
    for effect in effects:
        key = effect.replace("lead:", "delay:")
        sample_s = record.batches[0].sample_time_s
        lead_s = round(LEAD_S / sample_s) * sample_s if key.startswith("delay:") else 0.0
        data = replace(record, batches=tuple(_ahead(batch, lead_s) for batch in record.batches))
        ship = extended_model(vessel, data).with_effects({**beside, **({key: lead_s} if lead_s else {})})
        windows = stable_windows(ship, data)
        own = float(fit(ship, windows, (key,), starts=fitted_start(ship, windows)).value(key)) - lead_s
        found[effect] = own if effect == key else -own
    return found


def of_term(vessel: Vessel, record: Record, name: str) -> float:
    """Size of one of the model's terms in these runs, by the likelihood alone, all else as it is in the model."""
    ship = extended_model(vessel, record).with_known_parameters()
    windows, key = stable_windows(ship, record), f"theta:{name}"
    own = float(fit(ship, windows, (key,), starts=fitted_start(ship, windows)).value(key))
    return own + dict(zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True))[name]


def _changes(batch: Batch) -> tuple[Array, Array, Array, Array]:
    """Changes over windows: (n, 2) way and turn by velocities and by the pose; (n,) of the bow and of the velocity."""
    assert batch.pose is not None
    heading, dt = batch.pose[:, 2], batch.sample_time_s
    bow = np.exp(1j * heading)
    moving = bow * (batch.velocity[:, 0] + 1j * batch.velocity[:, 1])
    rates = np.stack([moving, batch.velocity[:, 2] + 0j], axis=-1)
    way = np.concatenate([np.zeros((1, 2)), np.cumsum((rates[1:] + rates[:-1]) / 2 * dt, axis=0)])
    pose = np.stack([batch.pose[:, 0] + 1j * batch.pose[:, 1], heading + 0j], axis=-1)
    every = slice(None, None, round(10.0 / dt))
    return tuple(np.diff(values[every], axis=0) for values in (way, pose, bow, moving))


def answer(
    fault: Fault, found: Diagnosis, effects: Sequence[tuple[str, float]], own: dict[str, float]
) -> tuple[str, float | None]:
    """How a fault is named, and the largest distance of its size from the truth, in stated standard errors.

    What instruments disagreed about before, or the model lacked, counts as part of the truth.

    By the "record" itself, "first", as "equivalent" to the first, "among" others, or "" where it is not named. The
    distance is None where no size is stated, or none is known.
    """
    pattern = fault.record[0] if fault.record else "(?!)"
    texts = [one.groups() for text in getattr(found.record, "faults", ()) if (one := re.search(pattern, text))]
    if fault.record and texts and not texts[0]:
        return "record", None
    if fault.record and texts:
        value, std = (float(number) for number in texts[0])
        effect, _ = effects[0]
        before = 0.0 if effect.startswith("late") and EARLY_POSITIONS in " ".join(found.record.faults) else own[effect]
        true = fault.record[1] * (1.0 + before) if fault.record[1] == SCALE else fault.record[1] + before
        return "record", abs(value - true) / std
    terms = {key for key, _ in effects if key.startswith("term:")}
    right = {*fault.causes} | {f"missing_{key}" for key in terms}
    right |= {item.cause for item in found.findings if terms & {*item.keys}}  # one of the wind is named "wind"
    causes = [item.cause for item in found.findings]
    item = next((item for item in found.findings if item.cause in right), None)
    if item is None:
        return ("equivalent" if causes and {*found.findings[0].not_distinguishable_from} & right else ""), None
    true = dict(effects)
    off = [
        abs(value - true[key] - own.get(key, 0.0) * (key in OF_MODEL)) / std
        for key, (value, std) in estimates(item, found).items()
        if np.isfinite(true.get(key, np.nan))
    ]
    return ("first" if causes[0] in right else "among"), max(off, default=None)


def slew_times(found: Diagnosis) -> dict[str, float]:
    """Those that were found, by effect."""
    pairs = (pair for item in found.findings for pair in estimates(item, found).items())
    return {key: value for key, (value, _) in pairs if key.startswith("slew:")}


def estimates(item: Finding, found: Diagnosis) -> dict[str, tuple[float, float]]:
    """Effect -> value and standard error, from the numbers of the results."""
    ship = extended_model(found.vessel, found.record)
    rows = {}
    for key, one in zip(item.keys, item.estimates, strict=True):
        _, factor, offset, _ = public_name(key, ship)
        rows[key] = ((one.value - offset) / factor, one.std / abs(factor))
    return rows


EARLY_POSITIONS = "later than the positions"  # what the record says of early positions, apart from late velocities
PLUS = "(-?[0-9.]+) \N{PLUS-MINUS SIGN} ([0-9.]+)"
FAULTS = (
    Fault(name="untouched"),
    Fault(
        name="rudder gain 0.9", batch=_rudder(lambda angle: GAIN * angle), causes=("actuator_scale",),
        effects=(("scale:rudder", 1 / GAIN - 1),), needs="rudder",
    ),
    Fault(
        name="rudder offset 2 deg", batch=_rudder(lambda angle: angle + OFFSET_RAD), causes=("thruster_asymmetry",),
        effects=(("offset:ANGLE", -OFFSET_RAD),),
    ),
    Fault(
        name="heading bias 3 deg", batch=_misaligned, causes=("heading_bias",),
        effects=(("heading_bias", -BIAS_RAD),),
    ),
    Fault(name="orders early 1 s", batch=_early, causes=("actuator_delay",), effects=(("delay:all", DELAY_S),)),
    Fault(
        name="gyro 0.95", batch=_scaled(1, 1, SCALE), causes=("gyro_scale",), effects=(("gyro", SCALE - 1),),
        record=(f"r_radps is {PLUS} times", SCALE),
    ),
    Fault(
        name="log 0.95", batch=_scaled(SCALE, SCALE, 1), causes=("log_scale",), effects=(("log", SCALE - 1),),
        record=(f"u_mps (?:and v_mps are|(?=.*perhaps v_mps)is) {PLUS} times", SCALE),
    ),
    Fault(
        name="log ahead 0.95", batch=_scaled(SCALE, 1, 1), causes=("log_scale",), effects=(("log", SCALE - 1),),
        record=(f"u_mps (?:and v_mps are(?=.*u_mps alone)|is) {PLUS} times", SCALE),
    ),
    Fault(
        name="current 0.07 m/s", batch=_drifting, causes=("current",),
        effects=(("current:north", np.nan), ("current:east", np.nan)),
    ),
    Fault(
        name="log 0.7 m forward", batch=_log_forward, causes=("lever_arm",), effects=(("lever:forward", ARM_M),),
        record=(f"place {PLUS} m (?:forward|aft)", ARM_M),
    ),
    Fault(
        name="all 0.7 m forward", batch=_forward, causes=("lever_arm",), effects=(("lever:forward", ARM_M),),
    ),
    Fault(
        name="u, v late 0.7 s", batch=_late, causes=("sensor_delay",), effects=(("late:u", LATE_S), ("late:v", LATE_S)),
        record=(f"u_mps and v_mps come {PLUS} s later than heading", LATE_S),
    ),
    Fault(name="term taken out", model=_taken_out),
    Fault(
        name="rate of the rudder", model=_slower, causes=("actuator_slew",), needs="rudder",
        record=("rudder1 moves evenly at", np.nan),
    ),
    Fault(name="orders late 1 s", batch=_behind, causes=("late_orders",), effects=(("lead:all", DELAY_S),)),
    Fault(
        name="one engine 0.9", batch=_one_engine, causes=("actuator_scale",), effects=(("scale:n1", 1 / GAIN - 1),),
        needs="azimuth",
    ),
)  # fmt: skip
