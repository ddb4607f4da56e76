"""ArduPilot's logs of board (.bin, .log) and of telemetry (.tlog), by pymavlink."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import Any

from expdesign.importing.channels import COMPUTER, GNSS, OWN, Channel, Log, Rows, channels_of
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
