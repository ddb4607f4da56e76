"""Causes in actuators and their thrust."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.causes.candidate import (
    Candidate,
    Cause,
    Situation,
    Values,
    first,
    from_zero,
    may_be_zero,
    rounded,
)
from expdesign.diagnosis.model import (
    ADVANCE_LOSS,
    ANGLE_STEMS,
    LEAST_EFFECT,
    ExtendedModel,
    ahead_force_text,
    group_columns,
    input_groups,
    is_thrust,
    own_advance_terms,
    reads_rudder,
    turns_by_force,
)
from expdesign.values import Array
from expdesign.vessel import stem

SAMPLES = (0.5, 2.0, 6.0)
SHARES = (0.5, 1.5)


def open_groups(situation: Situation, kind: str) -> list[str]:
    """Groups of inputs without a stated effect of a kind, and those with one stated value.

    None once an effect of the kind was found.
    """
    ship = situation.ship
    if ship.has_found(f"{kind}:"):
        return []
    inputs = ship.model.inputs
    stated = {key.split(":", 1)[1] for key in ship.stated if key.startswith(f"{kind}:")}
    taken = {column for group in stated for column in group_columns(group, inputs)}
    return [group for group in input_groups(inputs) if group in stated or not taken & {*group_columns(group, inputs)}]


def followers(situation: Situation, kind: str, cause: str) -> tuple[Candidate, ...]:
    """Candidate times of every group of inputs, smaller and larger than the stated one."""
    sample, found = situation.windows.sample_s, []
    for group in open_groups(situation, kind):
        key = f"{kind}:{group}"
        stated = situation.ship.stated.get(key)
        times = [sample * number for number in SAMPLES] if stated is None else [stated * share for share in SHARES]
        found += [Candidate(cause=cause, free={key: time}, finite=True, positive=stated is None) for time in times]
    return tuple(found)


def _candidates_lag(situation: Situation) -> tuple[Candidate, ...]:
    return followers(situation, "lag", "actuator_lag")


def _explain_lag(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"The error occurs after each change of command and decays. {key.split(':')[1].capitalize()} inputs lag behind "
        f"their commands with a time constant of {from_zero(value, std)} s."
    )


ACTUATOR_LAG = Cause(
    name="actuator_lag",
    title="Actuator lag",
    missing="the lag of the actuators",
    summary="actuators that follow their commands with a first-order lag",
    candidates=_candidates_lag,
    explain=_explain_lag,
)


def _slewing(situation: Situation) -> tuple[Candidate, ...]:
    return tuple(item for item in followers(situation, "slew", "actuator_slew") if not item.positive)


def _explain_slew(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    begin = f"The error occurs during changes of command. {key.split(':')[1].capitalize()} inputs "
    if may_be_zero(value, std) and value + 2.0 * std > 0.0:
        least = 1.0 / (value + 2.0 * std)
        return f"{begin}follow them at once, or at {least:.2g} per second or more, faster than stated."
    if value <= 0.0:
        return f"{begin}follow them at once."
    return f"{begin}move at {rounded(1.0 / value, std / value**2)} per second, another slew rate than stated."


ACTUATOR_SLEW = Cause(
    name="actuator_slew",
    title="Slew rate of the actuators",
    missing="the slew rate of the actuators",
    summary="actuators that move at another rate than stated",
    candidates=_slewing,
    explain=_explain_slew,
)
QUANTILES = (0.1, 0.2, 0.35, 0.5)
SHARE, COUNT = 0.75, 40


def between(widths: Array, levels: Array) -> list[float]:
    """Widths moved to the middle between adjacent command levels, which the data cannot resolve further."""
    place = np.clip(np.searchsorted(levels, widths, side="right"), 1, len(levels) - 1)
    return sorted(set(((levels[place - 1] + levels[place]) / 2).tolist()))


def _candidates_deadband(situation: Situation) -> tuple[Candidate, ...]:
    inputs = situation.ship.model.inputs
    found = []
    for group in open_groups(situation, "deadband"):
        columns = group_columns(group, inputs)
        if len({stem(inputs[c]) for c in columns}) > 1:
            continue  # inputs of different units share no width
        sizes = np.concatenate([np.abs(rows[:, columns]).ravel() for rows in situation.windows.batch_inputs])
        levels = np.unique(sizes[sizes > 0])
        if len(levels) < 3:
            continue  # nothing is small beside the rest
        key = f"deadband:{group}"
        grid = tuple(between(np.quantile(levels, np.linspace(0.0, SHARE, COUNT)), levels))
        found += [
            Candidate(cause="actuator_deadband", free={key: float(width)}, finite=True, positive=True, grid=(key, grid))
            for width in between(np.quantile(sizes[sizes > 0], QUANTILES), levels)
        ]
    return tuple(found)


def _explain_deadband(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return f"Commands of {key.split(':')[1]} smaller than {rounded(value, std)} have no effect: a dead band."


ACTUATOR_DEADBAND = Cause(
    name="actuator_deadband",
    title="Actuator dead band",
    missing="the dead band of the actuators",
    summary="actuators that do not answer small commands",
    candidates=_candidates_deadband,
    explain=_explain_deadband,
    unseen="commands have too few sizes, or a dead band is stated",
)


def _candidates_delay(situation: Situation) -> tuple[Candidate, ...]:
    return () if situation.ship.has_found("lead:") else followers(situation, "delay", "actuator_delay")


def _explain_delay(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"The error occurs for a fixed time after each change of command. The dead time of {key.split(':')[1]} inputs "
        f"is {from_zero(value, std)} s."
    )


ACTUATOR_DELAY = Cause(
    name="actuator_delay",
    title="Actuator dead time",
    missing="the dead time of the actuators",
    summary="actuators that follow their commands after a dead time",
    candidates=_candidates_delay,
    explain=_explain_delay,
)


def _candidates_late_orders(situation: Situation) -> tuple[Candidate, ...]:
    """Of inputs without a dead time: one that is stated and too long is a dead time to be found shorter, to zero.

    Up to half a sample is how a record is read: its orders are held, while what was recorded may have been on its way.
    """
    ship, half_s = situation.ship, situation.windows.sample_s / situation.windows.rows_per_step / 2.0
    delayed = {
        column
        for key, value in ship.effects.items()
        if key.startswith("delay:") and value > LEAST_EFFECT
        for column in group_columns(key.split(":", 1)[1], ship.model.inputs)
    }
    return tuple(
        replace(one, above=dict.fromkeys(one.free, half_s))
        for one in followers(situation, "lead", "late_orders")
        for key in one.free
        if not delayed & {*group_columns(key.split(":", 1)[1], ship.model.inputs)}
    )


def _explain_late_orders(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    group = key.split(":")[1]
    return (
        f"The ship answers before the orders that are recorded, which no actuator can: {group} orders are recorded "
        f"{from_zero(value, std)} s late by the clock of the motion, or what is recorded is a reply that lags "
        "behind what acts."
    )


LATE_ORDERS = Cause(
    name="late_orders",
    title="Orders recorded late",
    missing="the delay of the recorded orders",
    summary="a ship that answers before the recorded orders: their clock is behind that of the motion",
    candidates=_candidates_late_orders,
    explain=_explain_late_orders,
)


def _candidates_scale(situation: Situation) -> tuple[Candidate, ...]:
    """All rudders together, then each, and each of several engines; one of all engines is a gain of thrust."""
    ship, inputs = situation.ship, situation.ship.model.inputs
    scaled = (key.split(":", 1)[1] for key in ship.effects if key.startswith("scale:"))
    taken = {column for group in scaled for column in group_columns(group, inputs)}
    rudders, engines = ({*group_columns(stem, inputs)} for stem in ("rudder", "n"))
    found = []
    for group in input_groups(inputs):
        columns = {*group_columns(group, inputs)}
        one_engine = len(columns) == 1 and columns < engines
        if (columns <= rudders or one_engine) and not columns & taken:
            found.append(Candidate(cause="actuator_scale", free={f"scale:{group}": 0.0}))
    return tuple(found)


def _explain_scale(values: Values, ship: ExtendedModel) -> str:
    key, value, std = first(values)
    group = key.split(":")[1]
    what = "speed" if stem(group) == "n" else "angle"
    text = (
        f"The {group} {what} that acts is {rounded(100 * (1 + value), 100 * std)} % of the recorded one: the ship "
        f"answers as if every {what} were that much larger or smaller."
    )
    model = ship.model
    rows = zip(model.expressions, model.parameter_std.tolist(), strict=True)
    if what == "speed" and any(error and is_thrust(expression, model) for expression, error in rows):
        text += " Engines differ by that much; whether this one or the others are not as stated depends on the thrust."
    return text


ACTUATOR_SCALE = Cause(
    name="actuator_scale",
    title="Scale of a rudder's angle or of one engine's speed",
    missing="the scale of an actuator",
    summary="rudders, or one of several engines, that give a share of what is ordered: a wrong scale of the recorded "
    "orders, of the linkage or of a stated speed, or an engine that is weaker than the others",
    candidates=_candidates_scale,
    explain=_explain_scale,
    unseen="the ship has neither a rudder nor several engines, or the scale is stated",
)


def _candidates_thrust_advance_loss(situation: Situation) -> tuple[Candidate, ...]:
    ship = situation.ship
    if any(key in ship.effects for key in (f"term:{name}" for name in ADVANCE_LOSS)):
        return ()
    keys = [f"theta:{name}" for name in own_advance_terms(ship.model)]
    keys += [f"term:{name}" for name in ADVANCE_LOSS if name in ship.library]
    return tuple(Candidate(cause="thrust_advance_loss", free={key: 0.0}) for key in keys)


def _explain_thrust_advance_loss(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"Thrust depends on the surge speed in another way than in the model. Change of {key.split(':')[1]}: "
        f"{rounded(value, std)}."
    )


THRUST_ADVANCE_LOSS = Cause(
    name="thrust_advance_loss",
    title="Thrust loss with advance speed",
    missing="the loss of thrust with speed",
    summary="thrust that falls with the speed of advance",
    candidates=_candidates_thrust_advance_loss,
    explain=_explain_thrust_advance_loss,
)


def _candidates_thrust_gain(situation: Situation) -> tuple[Candidate, ...]:
    if situation.has("gain") or situation.has("gain:propeller"):
        return ()
    model = situation.ship.model
    thrust = [e for e in model.expressions if is_thrust(e, model)]
    found = [Candidate(cause="thrust_gain", free={"gain": 0.0})] if thrust else []
    if any(reads_rudder(e) for e in thrust) and not all(reads_rudder(e) for e in thrust):
        found.append(Candidate(cause="thrust_gain", free={"gain:propeller": 0.0}))
    return tuple(found)


def _explain_thrust_gain(values: Values, _ship: ExtendedModel) -> str:
    _, value, std = first(values)
    relation = "larger" if value > 0 else "smaller"
    return (
        f"Thrust is {rounded(100 * abs(value), 100 * std)} % {relation} than in the model, by the same factor in all "
        "directions. The damping is correct."
    )


THRUST_GAIN = Cause(
    name="thrust_gain",
    title="Thrust gain",
    missing="the correct thrust gain",
    summary="thrust too weak or too strong by one factor in every regime",
    candidates=_candidates_thrust_gain,
    explain=_explain_thrust_gain,
)


def _candidates_asymmetry(situation: Situation) -> tuple[Candidate, ...]:
    ship = situation.ship
    if ship.has_found("offset:") or ship.has_found("asymmetry") or "r" not in ship.model.outputs:
        return ()
    angles = {column for stem in ANGLE_STEMS for column in group_columns(stem, ship.model.inputs)}
    groups = [
        group for group in open_groups(situation, "offset") if {*group_columns(group, ship.model.inputs)} <= angles
    ]
    lean = Candidate(cause="thruster_asymmetry", free={"asymmetry": 0.0})
    return (lean, *(Candidate(cause="thruster_asymmetry", free={f"offset:{group}": 0.0}) for group in groups))


def _explain_asymmetry(values: Values, ship: ExtendedModel) -> str:
    key, value, std = first(values)
    side = "port" if value > 0 else "starboard"
    if key == "asymmetry" and not turns_by_force(ship.model):
        turn = "starboard" if value > 0 else "port"
        return (
            f"Thrust turns the ship to {turn} at zero angle. The yaw acceleration is {rounded(value, std)} "
            f"rad/s\N{SUPERSCRIPT TWO} per {ahead_force_text(ship.model)}, as if thrust acted to {side} of the centre "
            "line."
        )
    if key == "asymmetry":
        return (
            f"A yaw moment is proportional to the ahead thrust: {rounded(abs(value), std)} m, as if thrust acted at "
            f"this distance to {side} of the centre line. The ship turns at zero angle."
        )
    size = rounded(math.degrees(value), math.degrees(std))
    return f"The angle of {key.split(':')[1]} is off by {size} degrees: the ship turns when it is commanded straight."


THRUSTER_ASYMMETRY = Cause(
    name="thruster_asymmetry",
    title="Asymmetry of thrust or angles",
    missing="an asymmetry of thrust",
    summary="a ship that turns at zero angle: thrust off the centre line, or wrong angles",
    candidates=_candidates_asymmetry,
    explain=_explain_asymmetry,
    unseen="yaw is not in the model",
)
