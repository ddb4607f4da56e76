"""Causes in sensors."""

from __future__ import annotations

import math

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values, first, listed, rounded
from expdesign.diagnosis.model import ExtendedModel
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, LOG, Fault, Quantity


def _candidates_heading_bias(situation: Situation) -> tuple[Candidate, ...]:
    if not {"u", "v"} <= set(situation.ship.model.outputs):
        return ()
    return (Candidate(cause="heading_bias", free={"heading_bias": 0.0}),)


def _explain_heading_bias(values: Values, ship: ExtendedModel) -> str:
    _, value, std = first(values)
    size, less = rounded(math.degrees(abs(value)), math.degrees(std)), value > 0
    leak = "Measured sway contains surge speed, v_measured = v + u sin(bias)"
    if "u" in ship.derived:
        return f"{leak}: velocities come from positions and heading, and the compass shows {size} degrees too " + (
            "little." if less else "much."
        )
    return (
        f"{leak}: the axes of the velocity sensor lie {size} degrees to {'port' if less else 'starboard'} of the "
        f"ship's. Where velocities were turned with the compass before they were recorded, the compass shows that much "
        f"too {'little' if less else 'much'} instead."
    )


HEADING_BIAS = Cause(
    name="heading_bias",
    title="Misaligned compass or speed sensor",
    missing="the misalignment of a sensor",
    summary="a misaligned compass or velocity sensor: surge speed leaks into measured sway",
    candidates=_candidates_heading_bias,
    explain=_explain_heading_bias,
    unseen="surge and sway are not both measured",
)


def _candidates_lever_arm(situation: Situation) -> tuple[Candidate, ...]:
    outputs = set(situation.ship.model.outputs)
    if situation.ship.has_found("lever:") or not {"v", "r"} <= outputs:
        return ()
    found = [Candidate(cause="lever_arm", free={"lever:forward": 0.0})]
    if "u" in outputs:
        found += [
            Candidate(cause="lever_arm", free={"lever:starboard": 0.0}),
            Candidate(cause="lever_arm", free={"lever:forward": 0.0, "lever:starboard": 0.0}),
        ]
    return tuple(found)


def _explain_lever_arm(values: Values, ship: ExtendedModel) -> str:
    sensor = "the antenna of the positions" if "u" in ship.derived else "the velocity sensor"
    return (
        f"Measured velocities contain the yaw rate times a lever arm. Position of {sensor} relative to the origin of "
        f"the model: {listed(values, ' m')}."
    )


LEVER_ARM = Cause(
    name="lever_arm",
    title="Sensor position",
    missing="the distance of a sensor from amidships",
    summary="an antenna or velocity sensor away from the point that the model describes",
    candidates=_candidates_lever_arm,
    explain=_explain_lever_arm,
    unseen="sway and yaw are not both measured",
)


def _of_row(row: Quantity, fault: Fault) -> Cause:
    """The cause of a gain or an offset.

    Not of a gain of the log where positions are measured: these tell it before any model (`kinematics`). Of an offset
    they do not, as a current looks like one.
    """

    def candidates(situation: Situation) -> tuple[Candidate, ...]:
        told = row.is_gain and row.shown_by == LOG and situation.windows.has_position
        seen = row.is_shown(situation.windows.derived) and {*row.signals} <= {*situation.ship.model.outputs}
        return (Candidate(cause=fault.name, free=dict.fromkeys(row.effects, 0.0)),) if seen and not told else ()

    def explain(values: Values, _ship: ExtendedModel) -> str:
        _, value, std = first(values)
        return fault.explained.format(rounded(100 * (1 + value), 100 * std) if row.is_gain else rounded(value, std))

    return Cause(
        name=fault.name, title=fault.title, missing=fault.missing, summary=fault.summary, unseen=fault.unseen,
        candidates=candidates, explain=explain,
    )  # fmt: skip


OF_ROWS = tuple(_of_row(row, row.fault) for row in GAINS_AND_OFFSETS if row.fault is not None)
NAMES = {
    "u": "the speed ahead",
    "v": "the speed to starboard",
    "r": "the yaw rate",
    "psi": "the heading",
    "position": "the position",
}


def _candidates_sensor_delay(situation: Situation) -> tuple[Candidate, ...]:
    if situation.ship.has_found("late:"):
        return ()
    outputs = situation.ship.model.outputs
    derived = set(situation.windows.derived)
    signals = [name for name in outputs if name not in derived]
    signals += ["psi"] if derived or (situation.windows.has_heading and "r" in outputs) else []
    signals += ["position"] if derived & {"u", "v"} else []
    found = [Candidate(cause="sensor_delay", free={f"late:{name}": 0.0}) for name in signals]
    if {"u", "v"} <= set(signals):
        found.append(Candidate(cause="sensor_delay", free={"late:u": 0.0, "late:v": 0.0}))
    return tuple(found)


def _explain_sensor_delay(values: Values, _ship: ExtendedModel) -> str:
    parts = " and ".join(
        f"{NAMES.get(key[5:], key[5:])} is recorded {rounded(abs(value), std)} s {'late' if value >= 0 else 'early'}"
        for key, (value, std) in values.items()
    )
    if any(value < 0 for value, _ in values.values()):
        return f"Signals are not synchronous: {parts}. An early signal means that the others are late or filtered."
    return f"Signals are not synchronous: {parts}."


SENSOR_DELAY = Cause(
    name="sensor_delay",
    title="Sensor delay",
    missing="the delay of a sensor",
    summary="one measured signal late against the others",
    candidates=_candidates_sensor_delay,
    explain=_explain_sensor_delay,
)
SENSOR_CAUSES = (HEADING_BIAS, LEVER_ARM, SENSOR_DELAY, *OF_ROWS)  # faults of the record rather than of the model
