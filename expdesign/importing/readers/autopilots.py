"""Logs of autopilots and robots.

ArduPilot's of board (.bin, .log) and telemetry (.tlog) are read by pymavlink; PX4's ULog by pyulog; bags of ROS 1 and
ROS 2, and MCAP, by rosbags. Messages of navigation in bags follow REP 103 and REP 105: x forward, y to port, z upward
in the body; x east, y north in the world. They are turned into our axes here, and their names say so. Other messages
are taken apart into their numbers.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.importing.channels import COMPUTER, GNSS, OWN, Channel, Log, Rows, channels_of, check_size
from expdesign.importing.mapping import unit_word

DEEPEST = 4
MOST_FIELDS = 48
SKIPPED = ("Image", "CompressedImage", "PointCloud2", "LaserScan", "CameraInfo", "TFMessage", "Log", "OccupancyGrid")
"""Messages that hold nothing of a ship's motion."""
UNITS = {"lat": "deg", "lon": "deg", "heading": "rad", "roll": "rad", "r": "radps", "roll rate": "radps", "u": "mps",
         "v": "mps", "vn": "mps", "ve": "mps", "north": "m", "east": "m", "lateral acceleration": "mps2"}  # fmt: skip


def read_ros(path: Path, sample_time_s: float) -> Log:
    """All topics with numbers, at the time in their header, or of their recording."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    rows = Rows()
    skipped: Counter[str] = Counter()
    broken = 0
    with AnyReader([_bag(path)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kept = []
        for connection in reader.connections:
            if connection.msgtype.endswith(SKIPPED):
                skipped[connection.topic] += connection.msgcount
            else:
                kept.append(connection)
        for connection, stamp_ns, raw in reader.messages(connections=kept):
            try:
                message = reader.deserialize(raw, connection.msgtype)
            except Exception:  # a broken message of a bag: of any kind
                broken += 1
                continue
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            own_s = stamp.sec + stamp.nanosec * 1e-9 if stamp is not None else 0.0
            if values := list(_values(message, connection.msgtype)):
                rows.add(connection.topic, own_s or stamp_ns * 1e-9, values)
    channels: list[Channel] = []
    notes = [f"{broken} messages cannot be read and are left out"] if broken else []
    for topic in rows.tables:
        times, own = rows.columns(topic)
        columns = {f"{topic}.{key}": values for key, values in own.items()}
        units = {f"{topic}.{key}": unit for key, unit in UNITS.items()}
        found, more = channels_of(columns, times, source=path.name, units=units, what=topic)
        channels, notes = channels + found, notes + more
    clock = COMPUTER if any(channel.time_s[0] > 5e8 for channel in channels) else OWN
    unused = tuple(f"{topic} ({count})" for topic, count in skipped.items())
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=unused)


def _bag(path: Path) -> Path:
    """The folder of a bag of ROS 2 whose file is given, where it has one."""
    inside = path.suffix in (".db3", ".mcap") and (path.parent / "metadata.yaml").exists()
    return path.parent if inside else path


def _values(message: Any, kind: str) -> Iterator[tuple[str, float]]:
    """Numbers of a message, in our axes where they have axes."""
    name = kind.rpartition("/")[2]
    if name == "NavSatFix":
        if message.status.status >= 0:
            yield from (("lat", message.latitude), ("lon", message.longitude))
    elif name == "Odometry":
        yield from _pose(message.pose.pose)
        twist = message.twist.twist
        yield from (("u", twist.linear.x), ("v", -twist.linear.y), ("r", -twist.angular.z))
    elif name in ("PoseStamped", "PoseWithCovarianceStamped"):
        yield from _pose(message.pose.pose if name[4:5] == "W" else message.pose)
    elif name == "Imu":
        yield from (("heading", _heading(message.orientation)), ("roll", _roll(message.orientation)))
        yield from (("r", -message.angular_velocity.z), ("roll rate", message.angular_velocity.x))
        yield "lateral acceleration", -message.linear_acceleration.y
    elif name in ("TwistStamped", "TwistWithCovarianceStamped"):
        twist = message.twist.twist if name[5:6] == "W" else message.twist
        if "ENU" in name or message.header.frame_id in ("map", "odom", "enu", "world"):
            yield from (("vn", twist.linear.y), ("ve", twist.linear.x))
        else:
            yield from (("u", twist.linear.x), ("v", -twist.linear.y))
        yield "r", -twist.angular.z
    else:
        yield from list(_numbers(message, ""))[:MOST_FIELDS]


def _pose(pose: Any) -> Iterator[tuple[str, float]]:
    yield from (("north", pose.position.y), ("east", pose.position.x), ("heading", _heading(pose.orientation)))


def _heading(q: Any) -> float:
    """Clockwise from north, of an attitude counter-clockwise from east; nan where there is none."""
    if not (q.x or q.y or q.z or q.w):
        return math.nan
    return math.pi / 2 - math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def _roll(q: Any) -> float:
    return math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x * q.x + q.y * q.y))


def _numbers(value: Any, name: str, depth: int = 0) -> Iterator[tuple[str, float]]:
    if isinstance(value, (bool, int, float, np.number)):
        yield name or "data", float(value)
    elif isinstance(value, np.ndarray) and value.ndim == 1 and len(value) <= 16:
        yield from ((f"{name}[{k}]", float(x)) for k, x in enumerate(value) if np.isreal(x))
    elif depth < DEEPEST and hasattr(value, "__dataclass_fields__"):
        for field in value.__dataclass_fields__:
            if field not in ("header", "__msgtype__") and "covariance" not in field:
                yield from _numbers(getattr(value, field), f"{name}.{field}".strip("."), depth + 1)


def is_ros(path: Path, head: bytes) -> bool:
    """Whether a file, or a folder, is one of these."""
    return head.startswith((b"#ROSBAG V2", b"\x89MCAP", b"SQLite format 3")) or (path / "metadata.yaml").exists()


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
