"""A voyage as tables of loggers that write some things their own way: clocks, places, angles, words, headers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone

import numpy as np

from logged_trial import Voyage

KNOT = 1852 / 3600
NAMES = {"time": "Time", "lat": "Latitude", "lon": "Longitude", "sog": "SOG [kn]", "cog": "COG", "hdg": "Heading",
         "rot": "ROT [deg/min]", "rpm": "RPM", "order": "Rudder order [deg]",
         "rudder": "Rudder angle [deg]"}  # fmt: skip
Cell = Callable[[float], str]


def when(time_s: float) -> datetime:
    return datetime.fromtimestamp(round(time_s, 3), UTC)


def values(trip: Voyage) -> dict[str, np.ndarray]:
    """Columns in the units of `NAMES`, seconds since 1970."""
    return {
        "time": trip.time_s, "lat": trip.lat_deg, "lon": trip.lon_deg, "sog": trip.speed_mps / KNOT,
        "cog": np.degrees(trip.course_rad), "hdg": np.degrees(trip.heading_rad), "rot": np.degrees(trip.r_radps) * 60,
        "rpm": trip.n_rps * 60, "order": np.degrees(trip.order_rad), "rudder": np.degrees(trip.rudder_rad),
    }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Style:
    """What one logger does its own way; the rest is as usual."""

    names: Mapping[str, str] = field(default_factory=dict)  # column -> heading; several where they are split by "|"
    cells: Mapping[str, Cell] = field(default_factory=dict)  # column -> its text, of as many cells as headings
    without: tuple[str, ...] = ()
    before: tuple[str, ...] = ()  # lines above the headings
    separator: str = ","
    encoding: str = "utf-8"
    dated: bool = True
    largest: float = 35.0  # degrees that 100 per cent of the helm are
    south: bool = False  # of the equator, and west of Greenwich

    def text(self, trip: Voyage) -> str:
        """The file."""
        table = values(trip)
        if self.south:
            table |= {"lat": -table["lat"], "lon": -table["lon"]}
        kept = [name for name in NAMES if name not in self.without]
        cells = {name: f"{{:.{ {'lat': 8, 'lon': 8}.get(name, 4) }f}}".format for name in kept} | {
            "time": lambda t: f"{when(t):%Y-%m-%dT%H:%M:%S}Z",
            **self.cells,
        }
        head = self.separator.join(self.names.get(name, NAMES[name]).replace("|", self.separator) for name in kept)
        rows = zip(*(map(cells[name], table[name].tolist()) for name in kept), strict=True)
        lines = [self.separator.join(cell.replace("|", self.separator) for cell in row) for row in rows]
        return "\n".join([*self.before, *([head] if head.strip(self.separator) else []), *lines]) + "\n"


def minutes(value: float, digits: int = 2) -> str:
    """Degrees and minutes run together."""
    size = abs(value)
    return f"{int(size):0{digits}d}{60 * (size % 1):08.5f}"


def dms(value: float) -> str:
    size = abs(value)
    return f"{int(size)}°{int(size * 60 % 60):02d}'{size * 3600 % 60:07.4f}\""


def ticks(origin: datetime, per_second: float) -> Cell:
    return lambda t: f"{((when(t) - origin) / timedelta(seconds=1)) * per_second:.0f}"


def days(origin: datetime, *, digits: int = 9) -> Cell:
    return lambda t: f"{(when(t) - origin) / timedelta(days=1):.{digits}f}"


def year(number: int) -> datetime:
    return datetime(number, 1, 1, tzinfo=UTC)


def of_day(t: float) -> float:
    return (when(t) - when(t).replace(hour=0, minute=0, second=0, microsecond=0)) / timedelta(seconds=1)


def gps(t: float) -> float:
    """Seconds since 1980 of the time of GPS, 18 s before UTC."""
    return (when(t) - datetime(1980, 1, 6, tzinfo=UTC)).total_seconds() + 18.0


EAST_2 = timezone(timedelta(hours=2))
CLOCKS: dict[str, Style] = {
    "ticks of .NET": Style(names={"time": "Timestamp"}, cells={"time": ticks(year(1), 1e7)}),
    "file times of Windows": Style(names={"time": "Timestamp"}, cells={"time": ticks(year(1601), 1e7)}),
    "seconds of LabVIEW": Style(cells={"time": lambda t: f"{(when(t) - year(1904)).total_seconds():.3f}"}),
    "days of a spreadsheet": Style(cells={"time": days(datetime(1899, 12, 30, tzinfo=UTC))}),
    "days of datenum": Style(cells={"time": lambda t: f"{719529 + t / 86400:.9f}"}),
    "Julian days": Style(cells={"time": lambda t: f"{2440587.5 + t / 86400:.9f}"}),
    "modified Julian days": Style(cells={"time": lambda t: f"{40587 + t / 86400:.9f}"}),
    "share of a day": Style(dated=False, cells={"time": lambda t: f"{of_day(t) / 86400:.9f}"}),
    "day of the year": Style(dated=False, names={"time": "DOY"}, cells={"time": days(year(2025))}),
    "hours": Style(dated=False, names={"time": "Time [h]"}, cells={"time": lambda t: f"{of_day(t) / 3600:.8f}"}),
    "hours by the name": Style(
        dated=False, names={"time": "decimal hour"}, cells={"time": lambda t: f"{of_day(t) / 3600:.8f}"}
    ),
    "minutes": Style(dated=False, names={"time": "Time (min)"}, cells={"time": lambda t: f"{of_day(t) / 60:.6f}"}),
    "week and seconds of GPS": Style(
        names={"time": "GPS Week|GPS TOW [s]"},
        cells={"time": lambda t: "{:.0f}|{:.3f}".format(*divmod(gps(t), 604800.0))},
    ),
    "AM and PM, the month first": Style(
        cells={"time": lambda t: f'"{when(t):%m/%d/%Y %I:%M:%S %p}"'}, names={"lat": '"Latitude"'}
    ),
    "14 digits": Style(cells={"time": lambda t: f"{when(t):%Y%m%d%H%M%S}"}),
    "names of months": Style(cells={"time": lambda t: f"{when(t):%d-%b-%Y %H:%M:%S}"}),
    "the month first, by its name": Style(cells={"time": lambda t: f"{when(t):%b %d %Y %H:%M:%S}"}),
    "day of the year before the time": Style(cells={"time": lambda t: f"{when(t):%Y:%j:%H:%M:%S}"}),
    "a colon between date and time": Style(cells={"time": lambda t: f"{when(t):%Y-%m-%d:%H:%M:%S}"}),
    "points in the time": Style(separator=";", cells={"time": lambda t: f"{when(t):%d.%m.%Y %H.%M.%S}"}),
    "a year of two digits": Style(cells={"time": lambda t: f"{when(t):%d.%m.%y %H:%M:%S}"}),
    "a zone in the cells": Style(
        cells={"time": lambda t: f"{when(t).astimezone(EAST_2):%Y-%m-%d %H:%M:%S%z}"}
    ),
    "a zone by its name": Style(
        cells={"time": lambda t: f"{when(t).astimezone(EAST_2):%Y-%m-%d %H:%M:%S} CEST"}
    ),
    "a zone by its name above the cells": Style(
        names={"time": "Uhrzeit (MESZ)"}, cells={"time": lambda t: f"{when(t).astimezone(EAST_2):%Y-%m-%d %H:%M:%S}"}
    ),
    "days of MATLAB": Style(
        names={"time": "datenum"}, cells={"time": lambda t: f"{round(t, 3) / 86400.0 + 719529.0:.9f}"}
    ),
    "a zone in the name": Style(
        names={"time": "Time (UTC+2)"}, cells={"time": lambda t: f"{when(t).astimezone(EAST_2):%Y-%m-%d %H:%M:%S}"}
    ),
    "local time before UTC": Style(
        names={"time": "Local time|UTC"},
        cells={"time": lambda t: f"{when(t).astimezone(EAST_2):%Y-%m-%d %H:%M:%S}|{when(t):%Y-%m-%d %H:%M:%S}"},
    ),
    "milliseconds behind a colon": Style(dated=False, cells={"time": lambda t: f"{when(t):%H:%M:%S}:000"}),
    "parts of a date": Style(
        names={"time": "Year|Month|Day|Hour|Minute|Second"}, cells={"time": lambda t: f"{when(t):%Y|%m|%d|%H|%M|%S}"}
    ),
}  # fmt: skip
"""Clocks of a second per row."""
PLACES: dict[str, Style] = {
    "a side in a column of its own": Style(
        south=True, names={"lat": "Lat|N/S", "lon": "Lon|E/W"},
        cells={"lat": lambda x: f"{abs(x):.8f}|S", "lon": lambda x: f"{abs(x):.8f}|W"},
    ),
    "minutes run together, and the side in a column of its own": Style(
        south=True, names={"lat": "Latitude|NS", "lon": "Longitude|EW"},
        cells={"lat": lambda x: f"{minutes(x)}|S", "lon": lambda x: f"{minutes(x, 3)}|W"},
    ),
    "degrees, minutes and seconds with the side": Style(
        south=True, cells={"lat": lambda x: f"{dms(x)}S", "lon": lambda x: f"{dms(x)}W"}, separator=";",
    ),
    "degrees, minutes and seconds with a sign": Style(
        south=True, cells={"lat": lambda x: f"-{dms(x)}", "lon": lambda x: f"-{dms(x)}"}, separator=";",
    ),
    "the side first": Style(
        south=True,
        cells={"lat": lambda x: f"S{int(-x)} {60 * (-x % 1):.6f}",
        "lon": lambda x: f"W{int(-x):03d} {60 * (-x % 1):.6f}"},
        separator=";",
    ),
    "degrees and minutes in two columns": Style(
        names={"lat": "Lat deg|Lat min", "lon": "Lon deg|Lon min"},
        cells={"lat": lambda x: f"{int(x)}|{60 * (x % 1):.6f}", "lon": lambda x: f"{int(x)}|{60 * (x % 1):.6f}"},
    ),
    "radians": Style(
        cells={"lat": lambda x: f"{math.radians(x):.10f}", "lon": lambda x: f"{math.radians(x):.10f}"},
    ),
    "in 1e-7 degrees": Style(cells={"lat": lambda x: f"{x * 1e7:.0f}", "lon": lambda x: f"{x * 1e7:.0f}"}),
    "decimal commas": Style(
        separator=";", cells={name: lambda x: f"{x:.8f}".replace(".", ",") for name in NAMES if name != "time"}
    ),
}  # fmt: skip
ANGLES: dict[str, Style] = {
    "tenths of degrees": Style(
        cells={"hdg": lambda x: f"{10 * x % 3600:.0f}", "cog": lambda x: f"{10 * x % 3600:.0f}"}
    ),
    "hundredths of degrees": Style(
        cells={"hdg": lambda x: f"{100 * x % 36000:.0f}", "cog": lambda x: f"{100 * x % 36000:.0f}"}
    ),
    "port and starboard by letters": Style(
        cells={"rudder": lambda x: f"{abs(x):.4f} {'P' if x < 0 else 'S'}",
               "order": lambda x: f"{'PORT' if x < 0 else 'STBD'} {abs(x):.4f}"}
    ),
    "a rate of turn with letters": Style(cells={"rot": lambda x: f"{abs(x):.4f}{'P' if x < 0 else 'S'}"}),
    "per cent of the largest helm": Style(
        names={"order": "rudder_cmd_pct", "rudder": "Rudder act. [%]"},
        cells={"order": lambda x: f"{x / 0.35:.4f}", "rudder": lambda x: f"{x / 0.35:.4f}"},
    ),
    "per cent by the size": Style(
        names={"order": "rudder cmd", "rudder": "rudder"},
        cells={"order": lambda x: f"{x * 5.0:.4f}", "rudder": lambda x: f"{x * 5.0:.4f}"}, largest=20.0,
    ),
    "names like ours, without a number": Style(names={"rudder": "rudder_deg"}),
    "within half a turn": Style(cells={"hdg": lambda x: f"{(x + 180) % 360 - 180:.4f}"}),
    "units in the cells": Style(
        names={name: text.split(" [")[0] for name, text in NAMES.items()},
        cells={"sog": lambda x: f"{x:.4f} kn", "hdg": lambda x: f"{x:.4f}°", "rudder": lambda x: f"{x:.4f}°",
               "rpm": lambda x: f"{x:.4f} rpm", "rot": lambda x: f"{x:.4f} °/min"}
    ),
}  # fmt: skip
WORDS: dict[str, Style] = {
    "German": Style(separator=";", encoding="cp1252", names={
        "time": "Uhrzeit", "lat": "Breite", "lon": "Länge", "sog": "Fahrt über Grund [kn]",
        "cog": "Kurs über Grund [°]",
        "hdg": "Steuerkurs [°]", "rot": "Wendegeschwindigkeit [°/min]", "rpm": "Drehzahl [U/min]",
        "order": "Ruder Soll [°]", "rudder": "Ruder Ist [°]"}),
    "German, of pilots": Style(separator="\t", encoding="utf-16", names={
        "time": "Zeit", "lat": "Breite", "lon": "Länge", "sog": "Fahrt (kn)", "cog": "Kurs (°)", "hdg": "Heading (°)",
        "rot": "Drehrate (°/min)", "rpm": "Drehzahl (U/min)", "order": "Ruder Soll (°)", "rudder": "Ruder Ist (°)"}),
    "English of engineers": Style(names={
        "rot": "Gyro Rate [deg/min]", "rpm": "Engine Speed [1/min]", "order": "Rudder cmd [deg]"}),
    "French": Style(separator=";", encoding="cp1252", names={
        "time": "Heure", "lat": "Latitude", "lon": "Longitude", "sog": "Vitesse fond (nds)", "cog": "Route fond (°)",
        "hdg": "Cap vrai (°)", "rot": "Taux de giration (°/min)", "rpm": "Régime (tr/min)",
        "order": "Barre consigne (°)", "rudder": "Barre mesurée (°)"}),
    "Finnish": Style(separator=";", names={
        "time": "Aika", "lat": "Leveysaste", "lon": "Pituusaste", "sog": "Nopeus pohjan suhteen [kn]",
        "cog": "Kurssi pohjan suhteen", "hdg": "Keulasuunta", "rot": "Kääntymisnopeus [°/min]",
        "rpm": "Kierrosluku [rpm]",
        "order": "Peräsin ohje", "rudder": "Peräsinkulma"}),
    "Swedish": Style(separator=";", names={
        "time": "Tid", "lat": "Latitud", "lon": "Longitud", "sog": "Fart över grund [knop]", "cog": "Kurs över grund",
        "hdg": "Stävad kurs", "rot": "Girhastighet [°/min]", "rpm": "Varvtal [rpm]", "order": "Roder order",
        "rudder": "Rodervinkel"}),
    "Norwegian": Style(separator=";", names={
        "time": "Tid", "lat": "Bredde", "lon": "Lengde", "sog": "Fart over grunn [knop]", "cog": "Kurs over grunn",
        "hdg": "Heading", "rot": "Girhastighet [°/min]", "rpm": "Turtall [rpm]", "order": "Ror ordre",
        "rudder": "Rorvinkel"}),
    "Danish": Style(separator=";", names={
        "time": "Tid", "lat": "Breddegrad", "lon": "Længdegrad", "sog": "Fart over grund [knob]",
        "cog": "Kurs over grund", "hdg": "Styret kurs", "rot": "Drejehastighed [°/min]", "rpm": "Omdrejninger [rpm]",
        "order": "Ror ordre", "rudder": "Ror målt"}),
    "Dutch": Style(separator=";", names={
        "time": "Tijd", "lat": "Breedtegraad", "lon": "Lengtegraad", "sog": "Snelheid over de grond [kn]",
        "cog": "Grondkoers", "hdg": "Koers voorliggend", "rot": "Draaisnelheid [°/min]", "rpm": "Toerental [rpm]",
        "order": "Roerhoek gewenst", "rudder": "Roerhoek"}),
    "Spanish": Style(separator=";", names={
        "time": "Hora", "lat": "Latitud", "lon": "Longitud", "sog": "Velocidad sobre el fondo [nudos]",
        "cog": "Rumbo sobre el fondo", "hdg": "Rumbo verdadero", "rot": "Velocidad de giro [°/min]",
        "rpm": "Revoluciones [rpm]", "order": "Timón orden", "rudder": "Timón ángulo"}),
    "Italian": Style(separator=";", names={
        "time": "Ora", "lat": "Latitudine", "lon": "Longitudine", "sog": "Velocità sul fondo [nodi]",
        "cog": "Rotta sul fondo", "hdg": "Prua vera", "rot": "Velocità di accostata [°/min]", "rpm": "Giri [rpm]",
        "order": "Timone comando", "rudder": "Timone"}),
    "Japanese": Style(encoding="cp932", names={
        "time": "時刻", "lat": "緯度", "lon": "経度", "sog": "対地速力[kn]", "cog": "対地針路[deg]",
        "hdg": "船首方位[deg]",
        "rot": "回頭角速度[deg/min]", "rpm": "プロペラ回転数[rpm]", "order": "命令舵角[deg]", "rudder": "舵角[deg]"}),
    "Chinese": Style(encoding="utf-8-sig", names={
        "time": "时间", "lat": "纬度", "lon": "经度", "sog": "对地航速[kn]", "cog": "对地航向", "hdg": "艏向",
        "rot": "转首角速度[deg/min]", "rpm": "螺旋桨转速[rpm]", "order": "指令舵角", "rudder": "舵角"}),
    "Korean": Style(encoding="cp949", names={
        "time": "시간", "lat": "위도", "lon": "경도", "sog": "대지속력[kn]", "cog": "대지침로", "hdg": "선수방위",
        "rot": "선회각속도[deg/min]", "rpm": "프로펠러 회전수[rpm]", "order": "명령타각", "rudder": "타각"}),
}  # fmt: skip
HEADERS: dict[str, Style] = {
    "a row of groups above the names": Style(
        before=("Logger v2,,,,,,,,,", ",Position,,Ground,,Gyro,,Shaft,Rudder,"),
        names={"time": "Time", "lat": "Lat", "lon": "Lon", "sog": "Speed [kn]", "cog": "Course", "hdg": "Heading",
               "rot": "Rate of turn [deg/min]", "rpm": "RPM", "order": "Order [deg]", "rudder": "Actual [deg]"},
    ),
    "a row of units below the names": Style(
        before=("Time,Lat,Lon,SOG,COG,Heading,ROT,RPM,Rudder order,Rudder angle",),
        names={"time": "[UTC]", "lat": "[°]", "lon": "[°]", "sog": "[kn]", "cog": "[°]", "hdg": "[°]",
               "rot": "[°/min]", "rpm": "[1/min]", "order": "[°]", "rudder": "[°]"},
    ),
    "UTF-16 with a mark": Style(encoding="utf-16"),
    "UTF-16 without a mark": Style(encoding="utf-16-le"),
    "fixed widths, names of several words": Style(
        separator="   ", names={"time": "Date time          ", "sog": "Speed over ground [kn]"},
        cells={"time": lambda t: f"{when(t):%Y-%m-%dT%H:%M:%S}"},
    ),
    "underscores for blanks": Style(
        names={"sog": "speed_over_ground_kn", "cog": "course_over_ground_deg", "hdg": "true_heading_deg",
               "rot": "rate_of_turn_deg_min", "rpm": "engine_rpm", "order": "rudder_setpoint_deg",
               "rudder": "rudder_feedback_deg"},
    ),
    "paths of Signal K": Style(
        names={"lat": "navigation.position.latitude", "lon": "navigation.position.longitude",
               "sog": "navigation.speedOverGround", "cog": "navigation.courseOverGroundTrue",
               "hdg": "navigation.headingTrue", "rot": "navigation.rateOfTurn", "rpm": "propulsion.main.revolutions",
               "order": "steering.autopilot.target.rudderAngle", "rudder": "steering.rudderAngle"},
        cells={"sog": lambda x: f"{x * KNOT:.5f}", "rot": lambda x: f"{math.radians(x / 60):.7f}",
               "rpm": lambda x: f"{x / 60:.5f}",
               **{name: lambda x: f"{math.radians(x):.7f}" for name in ("cog", "hdg", "order", "rudder")}},
    ),
}  # fmt: skip
STYLES = {**CLOCKS, **PLACES, **ANGLES, **WORDS, **HEADERS}
