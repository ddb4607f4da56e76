"""Logs of autopilots: ArduPilot's of board (.bin, .log) and telemetry (.tlog), by pymavlink; PX4's ULog, by pyulog."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.importing.channels import COMPUTER, GNSS, OWN, Channel, Log, Rows, channels_of, check_size
from expdesign.importing.units import unit_word

READ = {"ATT", "GPS", "IMU", "RCOU", "RPM", "XKF1", "NKF1", "EKF1", "DPTH", "WIND", "RFND", "ESC", "AOA",
        "GLOBAL_POSITION_INT", "GPS_RAW_INT", "ATTITUDE", "SERVO_OUTPUT_RAW", "VFR_HUD", "SCALED_IMU", "RAW_IMU",
        "DISTANCE_SENSOR", "LOCAL_POSITION_NED"}  # fmt: skip
"""Messages that are read; the rest is about the autopilot."""
FUNCTIONS = {26: "steering", 70: "throttle", 73: "throttle port", 74: "throttle starboard", 89: "sail"}
"""Of a servo output, by SERVOn_FUNCTION."""
CLOCKS = ("TimeUS", "TimeMS", "time_boot_ms", "time_usec")
INSTANCES = ("I", "Instance", "C")


def read_ardupilot(path: Path, sample_time_s: float) -> Log:
    """Attitude, satellite positions, gyros, filter, servo outputs and revolutions.

    Times are those that pymavlink gives: of satellites where the board knew them, else of the telemetry's computer.
    """
    from pymavlink import mavutil

    with closing(mavutil.mavlink_connection(str(path))) as source:
        return _log(path, source)


def _log(path: Path, source: Any) -> Log:
    rows = Rows()
    units: dict[str, str] = {}
    functions: dict[str, int] = {}
    skipped: Counter[str] = Counter()
    while (message := source.recv_msg()) is not None:
        kind = message.get_type()
        if kind in ("PARM", "PARAM_VALUE"):
            name, value = (message.Name, message.Value) if kind == "PARM" else (message.param_id, message.param_value)
            if str(name).startswith("SERVO") and str(name).endswith("_FUNCTION"):
                functions[str(name)[5:-9]] = int(value)
            continue
        if kind not in READ:
            skipped[kind] += 1
            continue
        instance = next((getattr(message, key) for key in INSTANCES if key in message.get_fieldnames()), 0)
        name = f"{kind}[{instance}]" if instance else kind
        values = [
            (field, float(value)) for field in message.get_fieldnames()
            if isinstance(value := getattr(message, field), (int, float)) and field not in (*CLOCKS, *INSTANCES)
        ]  # fmt: skip
        rows.add(name, message._timestamp, values)
        for field, _ in values:
            if f"{name}.{field}" not in units:
                units[f"{name}.{field}"] = _unit(message, field)
    channels: list[Channel] = []
    notes: list[str] = []
    for name in rows.tables:
        times, whole = rows.columns(name)
        names = {field: _named(name, field, functions) for field in whole}
        own = {names[field]: values for field, values in whole.items()}
        found, more = channels_of(
            own, times, source=path.name, units={names[field]: units[f"{name}.{field}"] for field in whole}, what=name
        )
        channels, notes = channels + found, notes + more
    absolute = any(channel.time_s[0] > 5e8 for channel in channels)
    clock = (COMPUTER if path.suffix.lower() == ".tlog" else GNSS) if absolute else OWN
    unused = tuple(f"{kind} ({count})" for kind, count in skipped.most_common())
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=unused)


def _unit(message: object, field: str) -> str:
    told = getattr(message, "fieldunits_by_name", {}).get(field, "")
    form = getattr(message, "fmt", None)
    if form is not None and hasattr(form, "get_unit"):
        told = form.get_unit(field)
    return unit_word(str(told or ""))


def _named(name: str, field: str, functions: dict[str, int]) -> str:
    """A servo output after what it moves."""
    number = field[1:] if name == "RCOU" else field[5:-4] if name == "SERVO_OUTPUT_RAW" else ""
    what = FUNCTIONS.get(functions.get(number, 0), "")
    return f"{name}.{field} {what} pwm".replace("  ", " ") if number.isdecimal() else f"{name}.{field}"


def is_ardupilot(path: Path, head: bytes) -> bool:
    """Whether a file is one of these."""
    telemetry = path.suffix.lower() == ".tlog" and len(head) > 8 and head[8] in (0xFD, 0xFE)
    return head.startswith((b"\xa3\x95", b"FMT, ")) or telemetry


READ_PX4 = {
    "vehicle_global_position": {"lat": "deg", "lon": "deg", "vel_n": "mps", "vel_e": "mps", "yaw": "rad"},
    "vehicle_gps_position": {"lat": "", "lon": "", "vel_n_m_s": "mps", "vel_e_m_s": "mps", "cog_rad": "rad"},
    "sensor_gps": {"latitude_deg": "deg", "longitude_deg": "deg", "lat": "", "lon": "", "vel_n_m_s": "mps",
                   "vel_e_m_s": "mps"},
    "vehicle_local_position": {"vx": "mps", "vy": "mps", "heading": "rad"},
    "vehicle_attitude": {},
    "vehicle_angular_velocity": {"xyz[0]": "radps", "xyz[2]": "radps"},
    "vehicle_rates": {"rollspeed": "radps", "yawspeed": "radps"},
    "actuator_motors": {f"control[{k}]": "share" for k in range(2)},
    "actuator_servos": {f"control[{k}]": "share" for k in range(2)},
    "actuator_outputs": {f"output[{k}]": "pwm" for k in range(8)},
    "rpm": {"indicated_frequency_rpm": "rpm"},
    "distance_sensor": {"current_distance": "m"},
    "airspeed_wind": {},
}  # fmt: skip
"""Topics and fields that are read, with their units; the rest is about the autopilot."""
NAMES = {"vel_n": "vn", "vel_n_m_s": "vn", "vx": "vn", "vel_e": "ve", "vel_e_m_s": "ve", "vy": "ve",
         "xyz[0]": "roll rate", "xyz[2]": "yaw rate", "latitude_deg": "lat", "longitude_deg": "lon"}  # fmt: skip
LEAST_UTC_US = 1e15
BYTES = 8  # of the file for a number, or more where topics are about the autopilot


def read_px4(path: Path, sample_time_s: float) -> Log:
    """Positions, velocities, attitude, rates and outputs; times are those of satellites where a receiver gave them."""
    from pyulog import ULog

    check_size(path.stat().st_size // BYTES)
    content = ULog(str(path))
    late_s, clock = _clock(content.data_list)
    channels: list[Channel] = []
    notes: list[str] = []
    unused = []
    for data in content.data_list:
        topic = f"{data.name}[{data.multi_id}]" if data.multi_id else data.name
        if data.name not in READ_PX4 or len(data.data["timestamp"]) < 2:
            unused.append(topic)
            continue
        own = {
            NAMES.get(key, key): np.asarray(data.data[key], dtype=float)
            for key in READ_PX4[data.name]
            if key in data.data
        }
        units = {f"{topic}.{NAMES.get(key, key)}": unit for key, unit in READ_PX4[data.name].items()}
        if "q[0]" in data.data:
            w, x, y, z = (np.asarray(data.data[f"q[{k}]"], dtype=float) for k in range(4))
            own["heading"] = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            own["roll"] = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
            units |= {f"{topic}.heading": "rad", f"{topic}.roll": "rad"}
        times = np.asarray(data.data["timestamp"], dtype=float) * 1e-6 + late_s
        what = {"actuator_motors": " throttle", "actuator_servos": " steering"}.get(data.name, "")
        named = {f"{topic}.{key}{what}": values for key, values in own.items()}
        units = {f"{key}{what}": unit for key, unit in units.items()}
        found, more = channels_of(named, times, source=path.name, units=units, what=topic)
        channels, notes = channels + found, notes + more
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=tuple(unused))


def _clock(topics: list) -> tuple[float, str]:  # type: ignore[type-arg]
    """What is added to times since the board began [s], and the kind of clock that gives."""
    for data in topics:
        if "time_utc_usec" in data.data:
            utc = np.asarray(data.data["time_utc_usec"], dtype=float)
            known = utc > LEAST_UTC_US
            if known.any():
                return float(
                    np.median(utc[known] - np.asarray(data.data["timestamp"], dtype=float)[known])
                ) * 1e-6, GNSS
    return 0.0, OWN
