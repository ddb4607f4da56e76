"""PX4's ULog, by pyulog."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from expdesign.importing.channels import GNSS, OWN, Channel, Log, channels_of, check_size

READ = {
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
        if data.name not in READ or len(data.data["timestamp"]) < 2:
            unused.append(topic)
            continue
        own = {
            NAMES.get(key, key): np.asarray(data.data[key], dtype=float) for key in READ[data.name] if key in data.data
        }
        units = {f"{topic}.{NAMES.get(key, key)}": unit for key, unit in READ[data.name].items()}
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
