"""Names of causes and estimates in words, in place of "thrust_gain" or "lag_all_s"."""

from __future__ import annotations

import re

TITLES = {
    "parameters": "Parameter values",
    "current": "Current",
    "wind": "Wind",
    "thrust_gain": "Thrust gain",
    "thrust_advance_loss": "Thrust loss with advance speed",
    "thruster_asymmetry": "Asymmetry of thrust or angles",
    "actuator_lag": "Actuator lag",
    "actuator_delay": "Actuator dead time",
    "actuator_slew": "Slew rate of the actuators",
    "actuator_deadband": "Actuator dead band",
    "load_change": "Change of load (inertia)",
    "heading_bias": "Misaligned compass or speed sensor",
    "lever_arm": "Sensor position",
    "actuator_scale": "Scale of the rudder angle",
    "sensor_delay": "Sensor delay",
    "log_scale": "Scale error of the log",
    "gyro_scale": "Scale error of the rate gyro",
    "shallow_water": "Shallow water",
    "roll_coupling": "Roll, or a similar oscillation",
    "change_point": "Change during the trial",
}
"""Cause -> title; other causes have their name as title."""
NAMES = {
    "north_mps": "velocity to the north",
    "east_mps": "velocity to the east",
    "damping_growth": "relative increase of damping per draught over depth",
    "inertia_growth": "relative increase of inertia per draught over depth",
    "thrust_offset_m": "line of thrust, distance to port of the centre line",
    "yaw_radps2_per_rps2": "yaw acceleration per n|n| of the propellers",
    "yaw_radps2_per_tau_x": "yaw acceleration per ahead force",
    "heading_bias_rad": "measured heading less true heading",
    "velocity_angle_rad": "axis of the velocity sensor, to starboard of the bow",
    "forward_m": "sensor position, forward of amidships",
    "starboard_m": "sensor position, to starboard of amidships",
    "factor": "factor (1: as in the model)",
    "time_s": "time of the change",
    "Y_phi": "sway coupling, per side acceleration that holds the roll angle",
    "N_phi": "yaw coupling, per side acceleration that holds the roll angle",
    "roll_period_s": "period of the oscillation",
    "roll_damping_ratio": "damping ratio of the oscillation",
    "toward_rad": "direction to which the wind blows",
}
OUTPUTS = {"u": "surge", "v": "sway", "r": "yaw", "psi": "heading"}
PATTERNS = (
    (re.compile(r"lag_(\w+)_s"), "time constant of {}"),
    (re.compile(r"delay_(\w+)_s"), "dead time of {}"),
    (re.compile(r"deadband_(\w+?)(?:_rps|_rad)?"), "width of the dead band of {}"),
    (re.compile(r"angle_offset_(\w+)_rad"), "offset of {}"),
    (re.compile(r"angle_factor_(\w+)"), "acting angle over recorded angle of {}"),
    (re.compile(r"(\w+)_delay_s"), "delay of the measured {}"),
    (re.compile(r"inertia_factor_(\w+)"), "inertia factor in {} (1: as in the model)"),
    (re.compile(r"(\w+)_factor"), "factor of {} after the change (1: no change)"),
    (re.compile(r"(\w+)_change"), "change of {}"),
)


def cause_title(cause: str) -> str:
    """Title of a cause, e.g. of "missing_term:Y_r"."""
    kind, _, term = cause.partition(":")
    if kind == "unlisted_term":
        return f"No known cause: {term}"
    return f"Missing term {term}" if kind == "missing_term" else TITLES.get(cause, cause.replace("_", " "))


def estimate_words(name: str, cause: str) -> str:
    """The name of an estimate in words; parameters and terms of the model keep theirs."""
    if cause.partition(":")[0] in ("parameters", "missing_term", "unlisted_term") or (
        cause == "wind" and name not in NAMES
    ):
        return name
    for pattern, text in PATTERNS:
        match = pattern.fullmatch(name)
        if match and name not in NAMES:
            subject = match.group(1)
            return text.format("all inputs" if subject == "all" else OUTPUTS.get(subject, subject.replace("_", " ")))
    return NAMES.get(name, name)
