"""Bags of ROS 1 and ROS 2, and MCAP, by rosbags.

Messages of navigation follow REP 103 and REP 105: x forward, y to port, z upward in the body; x east, y north in the
world. They are turned into our axes here, and their names say so. Other messages are taken apart into their numbers.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.importing.channels import COMPUTER, OWN, Channel, Log, Rows, channels_of

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
