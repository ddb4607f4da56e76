"""Names of results in words: what an engineer reads in place of "thrust_gain" or "lag_all_s"."""

from __future__ import annotations

import re

TITLES = {
    "parameters": "Values of parameters",
    "current": "Current",
    "wind": "Wind",
    "thrust_gain": "Thrust too strong or too weak",
    "thrust_advance_loss": "Loss of thrust with speed",
    "thruster_asymmetry": "Thrust off the centre line",
    "actuator_lag": "Actuators that lag",
    "actuator_delay": "Actuators with a dead time",
    "actuator_deadband": "Actuators with a dead band",
    "load_change": "Heavier or lighter ship",
    "heading_bias": "Misaligned compass or speed sensor",
    "lever_arm": "Sensor away from amidships",
    "sensor_delay": "Late sensor",
    "gyro_scale": "Scale of the rate gyro",
    "shallow_water": "Shallow water",
    "roll_coupling": "Rolling, or another oscillation",
    "change_point": "A change during the trial",
}
"""Cause -> title; a cause that is not here is titled by its name."""
NAMES = {
    "north_mps": "to the north",
    "east_mps": "to the east",
    "damping_growth": "growth of damping per draught over depth",
    "inertia_growth": "growth of inertia per draught over depth",
    "thrust_offset_m": "line of thrust, to port of the centre line",
    "yaw_radps2_per_rps2": "yaw acceleration per n|n| of the propellers",
    "yaw_radps2_per_tau_x": "yaw acceleration per ahead force",
    "heading_bias_rad": "angle of misalignment",
    "forward_m": "sensor forward of amidships",
    "starboard_m": "sensor to starboard of amidships",
    "factor": "factor, where 1 is right",
    "time_s": "time of the change",
    "Y_phi": "push on sway, per side acceleration that would hold the roll",
    "N_phi": "push on yaw, per side acceleration that would hold the roll",
    "roll_period_s": "period of the oscillation",
    "roll_damping_ratio": "damping ratio of the oscillation",
    "toward_rad": "direction that the wind blows to",
}
OUTPUTS = {"u": "surge", "v": "sway", "r": "yaw", "psi": "heading"}
PATTERNS = (
    (re.compile(r"lag_(\w+)_s"), "time constant of {}"),
    (re.compile(r"delay_(\w+)_s"), "dead time of {}"),
    (re.compile(r"deadband_(\w+?)(?:_rps|_rad)?"), "width of the dead band of {}"),
    (re.compile(r"angle_offset_(\w+)_rad"), "offset of {}"),
    (re.compile(r"(\w+)_delay_s"), "delay of the measured {}"),
    (re.compile(r"inertia_factor_(\w+)"), "factor of inertia in {}, where 1 is right"),
    (re.compile(r"(\w+)_factor"), "factor of {} after the change"),
    (re.compile(r"(\w+)_change"), "change of {}"),
)


def titled(cause: str) -> str:
    """Title of a cause, e.g. of "missing_term:Y_r"."""
    kind, _, term = cause.partition(":")
    return f"Missing term {term}" if kind == "missing_term" else TITLES.get(cause, cause.replace("_", " "))


def worded(name: str, cause: str) -> str:
    """The name of an estimate in words; parameters and terms of the model keep theirs."""
    if cause.partition(":")[0] in ("parameters", "missing_term") or (cause == "wind" and name not in NAMES):
        return name
    for pattern, text in PATTERNS:
        match = pattern.fullmatch(name)
        if match and name not in NAMES:
            what = match.group(1)
            return text.format("all inputs" if what == "all" else OUTPUTS.get(what, what.replace("_", " ")))
    return NAMES.get(name, name)
