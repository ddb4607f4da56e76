"""A voyage of the 50 m ship of the field's data, simulated here, and written as logs of many formats.

The equations are those of `data/field/README.md`: no part of the package makes or writes them. Formats of text are
here, the others in `binary_logs.py`.
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

import numpy as np

RATE_RADPS = 0.05
STEP_S = 0.1
START_S = 1_760_000_000.0  # 2025-10-09 08:53:20 UTC
LAT, LON = 54.5, 18.6
PARTS = (("steady", 120.0), ("zigzag", 300.0), ("steady", 240.0), ("circle", 500.0), ("steady", 150.0))


@dataclass(frozen=True)
class Voyage:
    """Truth every 0.1 s: the heading wrapped to a turn, the rudder's order and where it stands."""

    time_s: np.ndarray
    north_m: np.ndarray
    east_m: np.ndarray
    heading_rad: np.ndarray
    u_mps: np.ndarray
    v_mps: np.ndarray
    r_radps: np.ndarray
    n_rps: np.ndarray
    order_rad: np.ndarray
    rudder_rad: np.ndarray

    def every(self, count: int) -> Voyage:
        """Every so many samples."""
        return Voyage(*(getattr(self, name)[::count] for name in self.__dataclass_fields__))

    @cached_property
    def lat_deg(self) -> np.ndarray:
        """By the radii of curvature at the place."""
        return LAT + np.degrees(self.north_m / 6_377_900.0)

    @cached_property
    def lon_deg(self) -> np.ndarray:
        return LON + np.degrees(self.east_m / (6_392_320.0 * math.cos(math.radians(LAT))))

    @cached_property
    def speed_mps(self) -> np.ndarray:
        return np.hypot(self.u_mps, self.v_mps)

    @cached_property
    def course_rad(self) -> np.ndarray:
        return (self.heading_rad + np.arctan2(self.v_mps, self.u_mps)) % (2 * np.pi)


def voyage(*, parts: tuple[tuple[str, float], ...] = PARTS, heading: float = 0.3) -> Voyage:
    """Steady legs, a 20/20 zig-zag and a turning circle, without weather."""
    state = np.array([0.0, 0.0, heading, 4.24, 0.0, 0.0])
    rows, rudder, order = [], 0.0, 0.0
    n = 3.0
    time = 0.0
    for kind, seconds in parts:
        course = state[2]
        order = {"zigzag": math.radians(20.0), "circle": math.radians(35.0)}.get(kind, 0.0)
        for _ in range(round(seconds / STEP_S)):
            if kind == "zigzag" and order * (state[2] - course) >= math.radians(20.0) * abs(order):
                order = -order
            if kind == "steady":
                order = math.radians(
                    round(math.degrees(np.clip(1.2 * (course - state[2]) - 25.0 * state[5], -0.03, 0.03)), 1)
                )
            rows.append([time, *state, n, order, rudder])
            middle = rudder + np.clip(order - rudder, -RATE_RADPS * STEP_S / 2, RATE_RADPS * STEP_S / 2)
            a = derivative(state, n, middle)
            state = state + STEP_S * derivative(state + STEP_S / 2 * a, n, middle)
            rudder += float(np.clip(order - rudder, -RATE_RADPS * STEP_S, RATE_RADPS * STEP_S))
            time += STEP_S
    t, north, east, psi, u, v, r, rps, orders, rudders = np.array(rows).T
    return Voyage(START_S + t, north, east, psi % (2 * np.pi), u, v, r, rps, orders, rudders)


def derivative(state: np.ndarray, n: float, rudder: float) -> np.ndarray:
    """The ship's equations of motion."""
    _, _, psi, u, v, r = state
    return np.array([
        u * math.cos(psi) - v * math.sin(psi),
        u * math.sin(psi) + v * math.cos(psi),
        r,
        -0.004 * abs(u) * u + 0.008 * abs(n) * n + 1.2 * v * r,
        -0.02 * abs(u) * v - 0.3 * u * r,
        -0.02 * abs(u) * r + 0.0005 * abs(u) * u * math.sin(rudder),
    ])  # fmt: skip


def iso(time_s: float) -> str:
    """`2025-10-09T08:53:20.100Z`."""
    return datetime.fromtimestamp(round(time_s, 3), UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def write_own(path: Path, trip: Voyage) -> Path:
    """A CSV of ours."""
    head = "time_s,lat_deg,lon_deg,heading_rad,u_mps,v_mps,r_radps,n1_rps,rudder1_rad,reached_rudder1_rad"
    columns = (trip.time_s - START_S, trip.lat_deg, trip.lon_deg, trip.heading_rad, trip.u_mps, trip.v_mps,
               trip.r_radps, trip.n_rps, trip.order_rad, trip.rudder_rad)  # fmt: skip
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.10g")
    return path


NAMES = ("Lat", "Lon", "SOG [kn]", "COG", "HDG", "ROT (deg/min)", "RPM", "Rudder order", "Rudder angle")


def logger_rows(trip: Voyage) -> np.ndarray:
    """(k, 9) what a bridge logger writes: degrees, knots, revolutions per minute."""
    return np.column_stack([
        trip.lat_deg, trip.lon_deg, trip.speed_mps * 3600 / 1852, np.degrees(trip.course_rad),
        np.degrees(trip.heading_rad), np.degrees(trip.r_radps) * 60, trip.n_rps * 60, np.degrees(trip.order_rad),
        np.degrees(trip.rudder_rad),
    ])  # fmt: skip


def write_dialect(path: Path, trip: Voyage, *, separator: str = ";", comma: bool = True, stamps: str = "iso") -> Path:
    """A logger's CSV: some separator, decimal sign and clock."""
    lines = ["Bridge logger, exported", separator.join([*{"split": ("Date", "Time")}.get(stamps, ("Time",)), *NAMES])]
    for time_s, row in zip(trip.time_s.tolist(), logger_rows(trip).tolist(), strict=True):
        cells = [f"{row[0]:.8f}", f"{row[1]:.8f}", *(f"{value:.4f}" for value in row[2:])]
        text = iso(time_s)
        clock = {
            "iso": [text], "split": [f"{text[8:10]}.{text[5:7]}.{text[:4]}", text[11:23]], "s": [f"{time_s:.3f}"],
            "ms": [f"{time_s * 1e3:.0f}"], "us": [f"{time_s * 1e6:.0f}"], "ns": [f"{round(time_s * 1e3) * 10**6}"],
            "day": [text[11:23]], "hhmmss": [text[11:23].replace(":", "")],
        }[stamps]  # fmt: skip
        cells = [cell.replace(".", ",") for cell in cells] if comma else cells
        lines.append(separator.join([*clock, *cells]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def sentence(body: str) -> str:
    """With its checksum."""
    total = 0
    for letter in body:
        total ^= ord(letter)
    return f"${body}*{total:02X}"


def dm(degrees: float, digits: int) -> str:
    """Degrees and minutes run together."""
    whole = int(abs(degrees))
    return f"{whole:0{digits}d}{60 * (abs(degrees) - whole):010.7f}"


def nmea(trip: Voyage, *, magnetic: float | None = None) -> list[str]:
    """Sentences of a bridge: position, speed, heading (magnetic with a variation [deg]), turn, rudder, shaft."""
    lines = []
    for k in range(len(trip.time_s)):
        when = datetime.fromtimestamp(round(trip.time_s[k], 3), UTC)
        clock, date = when.strftime("%H%M%S.") + f"{when.microsecond // 10000:02d}", when.strftime("%d%m%y")
        knots, course = trip.speed_mps[k] * 3600 / 1852, math.degrees(trip.course_rad[k])
        place = f"{dm(trip.lat_deg[k], 2)},N,{dm(trip.lon_deg[k], 3)},E"
        heading = math.degrees(trip.heading_rad[k])
        lines += [
            sentence(f"GPRMC,{clock},A,{place},{knots:.4f},{course:.3f},{date},,,A"),
            sentence(f"GPGGA,{clock},{place},4,12,0.9,10.0,M,0.0,M,,"),
            sentence(f"HEHDT,{heading:.4f},T")
            if magnetic is None
            else sentence(
                f"HCHDG,{(heading - magnetic) % 360:.4f},,,{abs(magnetic):.1f},{'E' if magnetic > 0 else 'W'}"
            ),
            sentence(f"TIROT,{math.degrees(trip.r_radps[k]) * 60:.4f},A"),
            sentence(f"IIRSA,{math.degrees(trip.rudder_rad[k]):.4f},A,,V"),
            sentence(f"IIRPM,S,0,{trip.n_rps[k] * 60:.2f},100,A"),
            sentence("GPGSV,1,1,00"),
        ]
    return lines


def write_nmea(path: Path, trip: Voyage, *, magnetic: float | None = None, broken: int = 0) -> Path:
    """A log of NMEA 0183, some of whose lines are broken off."""
    lines = nmea(trip, magnetic=magnetic)
    rng = np.random.default_rng(3)
    for place in rng.choice(len(lines), broken, replace=False).tolist():
        lines[place] = lines[place][: len(lines[place]) // 2] + lines[place][len(lines[place]) // 2 + 1 :]
    path.write_text("\r\n".join(lines) + "\r\n")
    return path


def write_opencpn(path: Path, trip: Voyage) -> Path:
    """What OpenCPN's data recorder writes: time of reception, kind, and the sentence in quotes."""
    lines, each = nmea(trip), 7
    rows = ["timestamp,type,id,message"]
    for k, line in enumerate(lines):
        rows.append(f'{iso(trip.time_s[k // each] + 0.012)},NMEA0183,{line[3:6]},"{line}"')
    path.write_text("\n".join(rows) + "\n")
    return path


def n2k(trip: Voyage) -> list[tuple[float, int, int, bytes, dict[str, object]]]:
    """Time, message, priority, its eight bytes after the standard, and fields as canboat's analyzer names them."""
    found: list[tuple[float, int, int, bytes, dict[str, object]]] = []
    columns = (trip.time_s, trip.lat_deg, trip.lon_deg, trip.heading_rad, trip.speed_mps, trip.course_rad, trip.r_radps,
               trip.n_rps, trip.order_rad, trip.rudder_rad)  # fmt: skip
    for k, row in enumerate(np.stack(columns, axis=1).tolist()):
        time_s, lat, lon, heading, speed, course, rate, rps, order, rudder = row
        sid = k % 250
        found += [
            (time_s, 129025, 2, struct.pack("<ii", round(lat * 1e7), round(lon * 1e7)),
             {"Latitude": lat, "Longitude": lon}),
            (time_s, 129026, 2, struct.pack("<BBHH2x", sid, 0xFC, round(course * 1e4), round(speed * 100)),
             {"COG Reference": "True", "COG": course, "SOG": speed}),
            (time_s, 127250, 2, struct.pack("<BHhhB", sid, round(heading * 1e4), 0x7FFF, 0x7FFF, 0xFC),
             {"Heading": heading, "Reference": "True"}),
            (time_s, 127251, 2, struct.pack("<Bi3x", sid, round(rate / 3.125e-8)), {"Rate": rate}),
            (time_s, 127245, 2, struct.pack("<BBhhH", 0, 0xF8, round(order * 1e4), round(rudder * 1e4), 0xFFFF),
             {"Instance": 0, "Angle Order": order, "Position": rudder}),
            (time_s, 127488, 2, struct.pack("<BHHbH", 0, round(rps * 240), 0xFFFF, 0x7F, 0xFFFF),
             {"Instance": 0, "Speed": rps * 60}),
        ]  # fmt: skip
    return found


def write_n2k(path: Path, trip: Voyage, *, form: str) -> Path:
    """NMEA 2000 as text: plain, candump, frames of gateways, Actisense's ASCII, or JSON."""
    lines = []
    for time_s, number, priority, body, fields in n2k(trip):
        stamp, source = iso(time_s), 12
        name = f"{priority << 26 | number << 8 | source:08X}"
        octets = [f"{byte:02X}" for byte in body]
        lines.append({
            "plain": f"{stamp},{priority},{number},{source},255,8,{','.join(octets).lower()}",
            "candump": f"({time_s:.6f}) can0 {name}#{''.join(octets)}",
            "frames": f"{stamp[11:23]} R {name} {' '.join(octets)}",
            "ascii": f"A{stamp[11:23].replace(':', '')} {source:02X}FF{priority} {number:05X} {''.join(octets)}",
            "json": json.dumps(
                {"timestamp": stamp, "prio": priority, "src": source, "dst": 255, "pgn": number, "fields": fields}
            ),
        }[form])  # fmt: skip
    head = ['{"version":"6.0.0","units":"si"}'] if form == "json" else ["# a comment"]
    path.write_text("\n".join([*head, *lines]) + "\n")
    return path


def write_signalk(path: Path, trip: Voyage, *, served: bool = False) -> Path:
    """Deltas of Signal K, in SI units; as a server logs them, with another vessel among them and a second compass."""
    lines = [json.dumps({"name": "server", "version": "2.0.0", "self": "vessels.urn:mrn:imo:mmsi:219000001"})]
    columns = (trip.time_s, trip.lat_deg, trip.lon_deg, trip.heading_rad, trip.speed_mps, trip.course_rad, trip.r_radps,
               trip.n_rps, trip.order_rad, trip.rudder_rad)  # fmt: skip
    for k, row in enumerate(np.stack(columns, axis=1).tolist()):
        time_s, lat, lon, heading, speed, course, rate, rps, order, rudder = row
        place = {"latitude": lat, "longitude": lon}
        paths = {"navigation.position": place, "navigation.speedOverGround": speed,
                 "navigation.courseOverGroundTrue": course, "navigation.headingTrue": heading,
                 "navigation.rateOfTurn": rate, "propulsion.main.revolutions": rps,
                 "steering.autopilot.target.rudderAngle": order, "steering.rudderAngle": rudder}  # fmt: skip
        deltas = [("vessels.urn:mrn:imo:mmsi:219000001", "n2k.12", paths)]
        if served:
            away = {"latitude": lat + 0.1, "longitude": lon}
            deltas.append(("vessels.urn:mrn:imo:mmsi:230000002", "ais.1", {"navigation.position": away}))
            deltas += [("vessels.self", "compass.2", {"navigation.headingTrue": heading + 0.1})] * (k % 2)
        for vessel, source, own in deltas:
            values = [{"path": name, "value": value} for name, value in own.items()]
            update = {"$source": source, "timestamp": iso(time_s), "values": values}
            lines.append(json.dumps({"context": vessel, "updates": [update]}))
            lines[-1] = f"{time_s * 1e3 + 30:.0f};I;{lines[-1]}" if served else lines[-1]
    path.write_text("\n".join(lines) + "\n")
    return path


SHIP = """
[vessel]
name = "field-50m"
length_m = 50.0
beam_m = 10.0
draught_m = 3.0
sample_time_s = 1.0
[[actuators]]
kind = "propeller"
speed_min_rps = -4.0
speed_max_rps = 4.0
[[actuators]]
kind = "rudder"
forward_m = -25.0
angle_min_rad = -0.62
angle_max_rad = 0.62
angle_rate_radps = 0.05
[model]
structure = "custom"
form = "continuous"
terms = [
  {equation = "u", name = "X_uu", expression = "abs(u)*u"},
  {equation = "u", name = "X_nn", expression = "abs(n1)*n1"},
  {equation = "u", name = "X_vr", expression = "v*r"},
  {equation = "v", name = "Y_uv", expression = "abs(u)*v"},
  {equation = "v", name = "Y_ur", expression = "u*r"},
  {equation = "r", name = "N_ur", expression = "abs(u)*r"},
  {equation = "r", name = "N_ud", expression = "abs(u)*u*sin(rudder1)"},
]
[model.parameters]
X_uu = -0.005
X_nn = 0.007
X_vr = 1.0
Y_uv = -0.03
Y_ur = -0.4
N_ur = -0.03
N_ud = 0.0006
[sensors]
position_m = 0.3
heading_rad = 0.003
velocity_mps = 0.02
yaw_rate_radps = 0.001
"""
"""A vessel file for the voyage, with parameters that are not those of `derivative`."""
