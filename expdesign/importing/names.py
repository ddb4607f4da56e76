"""What the names of channels say: the column, the machine, order or feedback."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.mapping import COG, EASTWARD, MAGNETIC, NORTHWARD, SOG, VARIATION, dimension
from expdesign.importing.units import FACTORS, KNOWN, SHARES, split_unit, unit_word, words
from expdesign.records.file import Source, is_input, meaning
from expdesign.values import Array

COURSE_OR_HEADING = 3
"""Rank of words that mean the heading, but for tables with another heading: there they mean the course."""
RULES = (
    ("", 0, r"\b(des|desired|nav|target|tgt|wp|std|sigma|var|cov|err(or)?|quality|id|temp|volt\w*|curr\w*)\b"),
    ("", 0, r"\b(buoy|mark|waypoint|pin|committee|ais)\b"),
    ("", 0, r"\b(water|stw|longwaterspd|transwaterspd|true wind|tws|twd|twa|mwd)\b"),
    ("wind_angle_rad", 0, r"\bawa\b|mwv angle r\b|(rel\w*|app\w*|vane)?.*wind (angle|dir\w*)"),
    ("wind_speed_mps", 0, r"\baws\b|mwv speed r\b|(rel\w*|app\w*)?.*wind (speed|spd)"),
    ("lat_deg", 0, r"\b(gga|gns|gps|fix|global position)\b.*\b(lat\w*)\b"),
    ("lat_deg", 1, r"\b(lat|latitude)\b"),
    ("lon_deg", 0, r"\b(gga|gns|gps|fix|global position)\b.*\b(lon\w*|lng)\b"),
    ("lon_deg", 1, r"\b(lon|lng|long|longitude)\b"),
    ("roll_rate_radps", 0, r"\b(roll ?(rate|speed)|rollspeed|gyr\w* x|angular velocity x|xgyro|gx|rx)\b"),
    ("r_radps", 0, r"\b(rot|rate of turn|yaw ?rate|rate yaw|yawspeed|turn rate|r)$|\brot\b"),
    ("r_radps", 1, r"\b(gyro|heading|hdg|turning) rate$"),
    ("r_radps", 1, r"\b(gyr\w* z|angular velocity z|zgyro|gz|rz)\b"),
    ("roll_rad", 0, r"\b(roll|heel|heeling)\b"),
    ("imu_lateral_mps2", 0, r"\b(acc\w* y|linear acceleration y|yacc|ay|lateral acceleration)\b"),
    (MAGNETIC, 2, r"\b(heading|hdg|hding) (m|mag\w*)\b|\b(magnetic|mag) (heading|hdg)\b"),
    (VARIATION, 0, r"\b(variation|mv|declination|magvar)\b"),
    (COG, 0, r"\b(course over ground|course made good)\b"),
    ("heading_rad", 0, r"\b(heading t|headt|true (heading|hdg)|(heading|hdg|hding) true|hdt|ths|gyro heading)\b"),
    ("heading_rad", 1, r"\b(att|attitude) (yaw|heading)\b|\b(heading|hdg|hding|psi|hdg t)\b"),
    ("heading_rad", COURSE_OR_HEADING, r"\b(kurs|kurssi|koers)\b"),
    ("heading_rad", 2, r"\b(yaw|compass|gyro)\b"),
    (COG, 0, r"\b(cogt|cog|course over ground|course|track|tmg|ctmg|g crs)\b"),
    ("n", 0, r"\b(engine|shaft|prop(eller)?|motor|screw) (speed|revs?)\b"),
    (NORTHWARD, 0, r"\b(vn|vel n|v north|velocity north)\b|\blocal position ned vx\b|global position int vx"),
    (EASTWARD, 0, r"\b(ve|vel e|v east|velocity east)\b|\blocal position ned vy\b|global position int vy"),
    (SOG, 0, r"\b(sogn|sog|speed over ground|ground ?speed|gps speed|gps spd|rmc spd)\b"),
    (
        SOG,
        1,
        r"\b(spd|speed|v ground|velocity|groundspeed|geschwindigkeit|nopeus|fahrt|fart|vaart|snelheid|vitesse|"
        r"hastighe[td]|velocidad|velocita)$",
    ),
    ("u_mps", 0, r"^(?!.*\bgps\b).*\b(u|surge|longgroundspd|surge speed)$"),
    ("v_mps", 0, r"^(?!.*\bgps\b).*\b(v|sway|transgroundspd|sway speed)$"),
    ("depth_m", 0, r"\b(depth|depthm|dpt|sounding|dpth)\b"),
    ("north_m", 2, r"\b(north|northing|pn)\b"),
    ("east_m", 2, r"\b(east|easting|pe)\b"),
    ("rudder", 0, r"\b(rudder\d*|rsa|rud|helm|steering|nozzle)\b"),
    ("a", 0, r"\b(azi|azimuth|azim|pod angle|thruster angle|azi angle)\b"),
    (
        "n",
        0,
        r"\b(rpm\d*|rps|revs|revolutions|shaft speed|prop(eller)? speed)\b|^(?!.*\bpos).*(^|\s)n( ?\d+)?$",
    ),
    ("throttle", 0, r"\b(throttle|thrust|thruster|motor|engine order|power lever|lever)\b"),
)
"""Column, or kind of actuator signal, and rank of the pattern among those of a column; the first that fits counts. The
first column of all, "", is of what is no measurement of the ship's own motion."""
ACTUATORS = ("rudder", "a", "n", "throttle")
ACTUATOR_RULES = tuple(rule for rule in RULES if rule[0] in ACTUATORS)
ORDER = r"\b(order\w*|cmd|command\w*|set|setpoint|sp|demand|dem|req\w*|desired|des|ref|target|tgt|wanted)\b"
REACHED = r"\b(act|actual|fb|fbk|feedback|meas\w*|resp\w*|rsa|reached|pos|position)\b"
PORT, STARBOARD = r"\b(p|port|portangle|ps|bb|left|l)\b", r"\b(s|stbd|stbdangle|sb|starboard|stb|right|r)\b"
BOW = r"\b(bow|bt|tunnel|thr bow|fwd|forward)\b"
BESIDE = ("roll_rad", "roll_rate_radps", "depth_m", "wind_speed_mps", "wind_angle_rad", "imu_lateral_mps2")
"""Columns that a record does without: one that is the same in all rows is no reading."""
FINE_DEG, MOSTLY = 1e-3, 0.5
"""Usual change of a coordinate below which it is in degrees; share of negative ones among heights."""


@dataclass(frozen=True, kw_only=True)
class Mark:
    """What the name of a channel says."""

    column: str  # a column or a kind of actuator signal; "" for neither
    rank: int = 9
    unit: str = ""
    name: str = ""  # in words
    exact: bool = False  # whether the name is one of ours

    @property
    def machine(self) -> tuple[str, str, str]:
        """(bow or not, side, number) of an actuator."""
        if self.exact or not self.is_actuator:
            return "", "", ""
        own = self.name
        number = re.search(r"(\d+)\b(?!.*\d)", own)
        side = "p" if re.search(PORT, own) else "s" if re.search(STARBOARD, own) else ""
        return "bow" if re.search(BOW, own) else "", side, "" if side else number[1] if number else ""

    @property
    def role(self) -> str:
        """Either "order" or "reached"; "" where the name says neither."""
        if self.exact or not self.is_actuator:
            return ""
        return "order" if re.search(ORDER, self.name) else "reached" if re.search(REACHED, self.name) else ""

    @property
    def is_actuator(self) -> bool:
        """Whether it is a signal of an actuator."""
        return self.column in ACTUATORS

    @property
    def key(self) -> tuple[str, ...]:
        """What only one channel may be."""
        return (self.column, *self.machine, self.role)


def marked(channel: Channel) -> Mark:
    """What the name of a channel says, with its unit; x, y and z are told by their readings."""
    own = meaning(channel.name, 0)
    if isinstance(own, Source) and not (is_input(own.name) and not re.search(r"\d|tau", channel.name)):
        return Mark(column=own.name, rank=-1, unit=f"times {own.factor!r}", exact=True, name=words(channel.name))
    bare, unit = split_unit(channel.name)
    name, unit = words(bare), channel.unit or unit
    if channel.unit and unit_word(channel.unit) not in {u for t in FACTORS.values() for u in t} | set(SHARES):
        unit = ""
    talker = re.match(r"([A-Z]{2})([A-Z]{3})\.", channel.name)
    if talker:  # the sentence without who talks
        name = words(f"{talker[2]}.{bare[6:]}")
    whole = words(channel.name) if bare != channel.name else name
    column, rank = _rule(name, RULES) or _rule(whole, RULES) or ("", 9)
    if column == "" and re.search(ORDER, name):
        column, rank = _rule(whole, ACTUATOR_RULES) or ("", 9)
    if name in ("x", "y", "z"):
        column, rank = _coordinate(name, channel.values), 4
    if not _fits(column, unit_word(unit)):
        column = ""
    if column in BESIDE and np.ptp(channel.values) == 0:
        column = ""
    return Mark(column=column, rank=rank, unit=unit_word(unit), name=name)


def _fits(column: str, unit: str) -> bool:
    """Whether a column can be in a unit that is stated: a speed in knots is no number of revolutions."""
    kind = {"rudder": "angle", "a": "angle", "n": "revolutions"}.get(column)
    if not column or not unit or column == "throttle" or (kind and unit in SHARES):
        return True
    return unit in FACTORS[kind or dimension(column)] or unit not in KNOWN


def family_of(channel: Channel) -> tuple[str, str]:
    """What a channel shares with those of the same sentence, message or table."""
    return channel.source, channel.name.rpartition(".")[0]


def _coordinate(name: str, values: Array) -> str:
    """What x, y, z are: degrees of latitude and longitude, which change by little; heights of the bottom, negative."""
    if name == "z":
        return "depth_m" if np.mean(values < 0) > MOSTLY else ""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    fine = len(steps) > 10 and float(np.median(steps)) < FINE_DEG and float(np.abs(values).max()) <= 180.0
    return ("lat_deg" if name == "x" else "lon_deg") if fine else ""


def _rule(name: str, rules: Sequence[tuple[str, int, str]]) -> tuple[str, int] | None:
    """Column and rank of the first pattern that a name fits."""
    return next(((column, rank) for column, rank, pattern in rules if re.search(pattern, name)), None)
