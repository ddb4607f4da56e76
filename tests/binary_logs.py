"""The voyage of `logged_trial.py`, written as logs of binary formats.

Formats without a writer in a kept library are written by hand, from their specification.
"""

from __future__ import annotations

import math
import struct
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from logged_trial import NAMES, START_S, Voyage, logger_rows


def write_excel(path: Path, trip: Voyage) -> Path:
    """A sheet with a header, units below it, and dates."""
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet()
    sheet.append(["Time", "Latitude", "Longitude", "SOG", "COG", "HDG", "ROT", "RPM", "Rudder order", "Rudder angle"])
    sheet.append(["UTC", "deg", "deg", "kn", "deg", "deg", "deg/min", "rpm", "deg", "deg"])
    for time_s, row in zip(trip.time_s.tolist(), logger_rows(trip).tolist(), strict=True):
        sheet.append([datetime.fromtimestamp(round(time_s, 3), UTC).replace(tzinfo=None), *row])
    book.save(path)
    return path


def write_parquet(path: Path, trip: Voyage) -> Path:
    """A table with time stamps."""
    import pyarrow
    import pyarrow.parquet

    stamps = np.round(trip.time_s * 1e3).astype("datetime64[ms]")
    names = [name.replace(" ", "_") for name in NAMES]
    columns = dict(zip(names, logger_rows(trip).T, strict=True))
    pyarrow.parquet.write_table(pyarrow.table({"timestamp": stamps, **columns}), path)
    return path


def matlab_content(trip: Voyage) -> dict[str, np.ndarray]:
    return {
        "t": trip.time_s - START_S, "lat": trip.lat_deg, "lon": trip.lon_deg, "psi": np.degrees(trip.heading_rad),
        "u": trip.u_mps, "v": trip.v_mps, "yaw_rate": np.degrees(trip.r_radps), "rpm": 60 * trip.n_rps,
        "rudder_cmd": np.degrees(trip.order_rad), "rudder_act": np.degrees(trip.rudder_rad),
    }  # fmt: skip


def write_matlab(path: Path, trip: Voyage) -> Path:
    """A structure of vectors, version 5."""
    import scipy.io

    scipy.io.savemat(path, {"ship": matlab_content(trip), "note": "a trial"})
    return path


def write_matlab73(path: Path, trip: Voyage) -> Path:
    """Version 7.3: HDF5, vectors as columns of a matrix."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in matlab_content(trip).items():
            file[f"ship/{name}"] = values[None, :]
    return path


DF = {
    "GPS": (130, "QBIHBcLLeffffB", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    "ATT": (131, "QccccCCccB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "IMU": (132, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "RCOU": (133, "QHHHH", "TimeUS,C1,C2,C3,C4"),
    "PARM": (134, "QNff", "TimeUS,Name,Value,Default"),
}
FORMATS = {"Q": "Q", "B": "B", "I": "I", "H": "H", "c": "h", "C": "H", "L": "i", "e": "i", "f": "f", "N": "16s"}
GPS_EPOCH_S, LEAP_S = 315_964_800.0, 18.0


def write_ardupilot(path: Path, trip: Voyage) -> Path:
    """A board's log, by the layout of its FMT messages: servo 1 steers, servo 3 is the throttle."""
    out = bytearray()
    for name, (kind, form, labels) in {"FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"), **DF}.items():
        size = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(FORMATS[c] for c in form))
        body = struct.pack("<BB4s16s64s", kind, size, name.encode(), form.encode(), labels.encode())
        out += b"\xa3\x95\x80" + body

    def add(name: str, *values: object) -> None:
        kind, form, _ = DF[name]
        out.extend(b"\xa3\x95" + bytes([kind]) + struct.pack("<" + "".join(FORMATS[c] for c in form), *values))

    for servo, function in ((b"SERVO1_FUNCTION", 26.0), (b"SERVO3_FUNCTION", 70.0)):
        add("PARM", 1, servo, function, 0.0)
    for k in range(len(trip.time_s)):
        us = round((trip.time_s[k] - START_S) * 1e6) + 5_000_000
        week, ms = divmod(trip.time_s[k] - GPS_EPOCH_S + LEAP_S, 604_800.0)
        course = math.degrees(trip.course_rad[k])
        add("GPS", us, 4, round(ms * 1e3), int(week), 12, 90, round(trip.lat_deg[k] * 1e7),
            round(trip.lon_deg[k] * 1e7),            0, trip.speed_mps[k], course, 0.0, 0.0, 1)  # fmt: skip
        add("ATT", us, 0, 0, 0, 0, 0, round(math.degrees(trip.heading_rad[k]) * 100), 0, 0, 3)
        add("IMU", us, 0, 0.0, 0.0, trip.r_radps[k], 0.0, 0.0, -9.8, 0, 0, 20.0, 1, 1, 10, 10)
        add(
            "RCOU",
            us,
            1500 + round(trip.order_rad[k] / math.radians(35) * 500),
            1500,
            1500 + round(trip.n_rps[k] * 100),
            0,
        )
    path.write_bytes(out)
    return path


def write_telemetry(path: Path, trip: Voyage) -> Path:
    """A telemetry log, by pymavlink's own encoder."""
    from pymavlink.dialects.v20 import ardupilotmega as mav

    link = mav.MAVLink(None)
    with path.open("wb") as file:

        def add(time_s: float, message: object) -> None:
            file.write(struct.pack(">Q", round(time_s * 1e6)) + message.pack(link))  # type: ignore[attr-defined]

        for k in range(len(trip.time_s)):
            t, ms = trip.time_s[k], round((trip.time_s[k] - START_S) * 1e3)
            c, s = math.cos(trip.heading_rad[k]), math.sin(trip.heading_rad[k])
            north, east = trip.u_mps[k] * c - trip.v_mps[k] * s, trip.u_mps[k] * s + trip.v_mps[k] * c
            yaw = (trip.heading_rad[k] + math.pi) % (2 * math.pi) - math.pi
            add(t, mav.MAVLink_global_position_int_message(
                ms, round(trip.lat_deg[k] * 1e7), round(trip.lon_deg[k] * 1e7), 0, 0, round(north * 100),
                round(east * 100), 0, round(math.degrees(trip.heading_rad[k]) * 100) % 36000))  # fmt: skip
            add(t, mav.MAVLink_attitude_message(ms, 0.0, 0.0, yaw, 0.0, 0.0, trip.r_radps[k]))
            add(t, mav.MAVLink_servo_output_raw_message(
                ms * 1000, 0, 1500 + round(trip.order_rad[k] / math.radians(35) * 500), 1500,
                1500 + round(trip.n_rps[k] * 100), 0, 0, 0, 0, 0))  # fmt: skip
            if k == 0:
                for name, value in ((b"SERVO1_FUNCTION", 26.0), (b"SERVO3_FUNCTION", 70.0)):
                    add(t, mav.MAVLink_param_value_message(name, value, 2, 2, 0))
    return path


def write_ulog(path: Path, trip: Voyage) -> Path:
    """PX4's format, by its specification: formats, subscriptions, data."""
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))

    def add(kind: str, body: bytes) -> None:
        out.extend(struct.pack("<HB", len(body), ord(kind)) + body)

    topics = {
        "sensor_gps": (
            "uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;float vel_n_m_s;"
            "float vel_e_m_s;",
            "<QQddff",
        ),
        "vehicle_attitude": ("uint64_t timestamp;float[4] q;", "<Qffff"),
        "vehicle_angular_velocity": ("uint64_t timestamp;float[3] xyz;", "<Qfff"),
        "actuator_servos": ("uint64_t timestamp;float[2] control;", "<Qff"),
        "actuator_motors": ("uint64_t timestamp;float[2] control;", "<Qff"),
    }
    add("B", bytes(40))
    for name, (form, _) in topics.items():
        add("F", f"{name}:{form}".encode())
    for number, name in enumerate(topics):
        add("A", struct.pack("<BH", 0, number) + name.encode())
    for k in range(len(trip.time_s)):
        us = round((trip.time_s[k] - START_S) * 1e6) + 1_000_000
        c, s = math.cos(trip.heading_rad[k]), math.sin(trip.heading_rad[k])
        half = trip.heading_rad[k] / 2
        rows = (
            (us, round(trip.time_s[k] * 1e6), trip.lat_deg[k], trip.lon_deg[k], trip.u_mps[k] * c - trip.v_mps[k] * s,
             trip.u_mps[k] * s + trip.v_mps[k] * c),
            (us, math.cos(half), 0.0, 0.0, math.sin(half)),
            (us, 0.0, 0.0, trip.r_radps[k]),
            (us, trip.order_rad[k] / math.radians(35), math.nan),
            (us, trip.n_rps[k] / 5, math.nan),
        )  # fmt: skip
        for number, (row, (_, packed)) in enumerate(zip(rows, topics.values(), strict=True)):
            add("D", struct.pack("<H", number) + struct.pack(packed, *row))
    path.write_bytes(out)
    return path


def write_ros(path: Path, trip: Voyage, *, kind: str) -> Path:
    """A bag with position, odometry, rudder and shaft, by rosbags' writers: "ros1", "sqlite3" or "mcap"."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    t = store.types
    writer = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=StoragePlugin[kind.upper()])
    serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
    with writer:
        topics = {
            "/fix": "sensor_msgs/msg/NavSatFix", "/odom": "nav_msgs/msg/Odometry",
            "/rudder_cmd": "std_msgs/msg/Float64", "/rudder_angle": "std_msgs/msg/Float64",
            "/shaft_rpm": "std_msgs/msg/Float64",
        }  # fmt: skip
        links = {name: writer.add_connection(name, form, typestore=store) for name, form in topics.items()}
        zeros = np.zeros(36)
        for k in range(len(trip.time_s)):
            ns = round(trip.time_s[k] * 1e3) * 1_000_000
            stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
            extra = {"seq": k} if kind == "ros1" else {}
            header = t["std_msgs/msg/Header"](stamp=stamp, frame_id="map", **extra)
            v3, point = t["geometry_msgs/msg/Vector3"], t["geometry_msgs/msg/Point"]
            yaw = math.pi / 2 - trip.heading_rad[k]
            turn = t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
            pose = t["geometry_msgs/msg/Pose"](
                position=point(x=trip.east_m[k], y=trip.north_m[k], z=0.0), orientation=turn
            )
            twist = t["geometry_msgs/msg/Twist"](
                linear=v3(x=trip.u_mps[k], y=-trip.v_mps[k], z=0.0), angular=v3(x=0.0, y=0.0, z=-trip.r_radps[k])
            )
            messages = {
                "/fix": t["sensor_msgs/msg/NavSatFix"](
                    header=header, status=t["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
                    latitude=float(trip.lat_deg[k]), longitude=float(trip.lon_deg[k]), altitude=0.0,
                    position_covariance=np.zeros(9), position_covariance_type=0),
                "/odom": t["nav_msgs/msg/Odometry"](
                    header=header, child_frame_id="base_link",
                    pose=t["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=zeros),
                    twist=t["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=zeros)),
                "/rudder_cmd": t["std_msgs/msg/Float64"](data=math.degrees(trip.order_rad[k])),
                "/rudder_angle": t["std_msgs/msg/Float64"](data=math.degrees(trip.rudder_rad[k])),
                "/shaft_rpm": t["std_msgs/msg/Float64"](data=60 * trip.n_rps[k]),
            }  # fmt: skip
            for name, message in messages.items():
                writer.write(links[name], ns, serialize(message, topics[name]))
    return path
