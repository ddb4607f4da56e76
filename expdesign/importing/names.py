"""What the names of channels say: the column, the machine and its number, order or feedback."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.languages import split_sense, words
from expdesign.importing.mapping import (
    COG,
    EASTWARD,
    FACTORS,
    KNOWN,
    MAGNETIC,
    NORTHWARD,
    SHARES,
    SOG,
    VARIATION,
    Mapping,
    Use,
    dimension,
    split_unit,
    unit_word,
)
from expdesign.records.file import Source, is_input, meaning
from expdesign.values import Array
from expdesign.vessel import Actuator, stem

COURSE_OR_HEADING = 3
"""Rank of words that mean the heading, but for tables with another heading: there they mean the course."""
RULES = (
    ("", 0, r"\b(des|desired|nav|target|tgt|wp|std|sigma|var|cov|err(or)?|quality|id|temp|volt\w*|curr\w*)\b"),
    ("", 0, r"\b(buoy|mark|waypoint|pin|committee|ais)\b"),
    ("", 0, r"\b(limit\w*|mode|modus|alarm\w*|max|maximum|minimum|cts|to steer)\b"),
    ("", 0, r"\b(turbo\w*|t c|generator|dg|alternator|pump\w*|fan|blower|compressor)\b"),
    ("", 0, r"\b(bow|stern|lateral|transvers\w*) (speed|spd)\b"),
    ("", 0, r"^(em |doppler |speed )?log( speed| spd)?$"),
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
    ("u_mps", 0, r"^(?!.*\bgps\b).*\b(u|surge|longgroundspd|surge (speed|velocity))$"),
    ("v_mps", 0, r"^(?!.*\bgps\b).*\b(v|sway|transgroundspd|sway (speed|velocity))$"),
    (SOG, 0, r"\b(sogn|sog|speed over ground|ground ?speed|gps speed|gps spd|rmc spd)\b"),
    (
        SOG,
        1,
        r"\b(spd|speed|v ground|velocity|groundspeed|geschwindigkeit|nopeus|fahrt|fart|vaart|snelheid|vitesse|"
        r"hastighe[td]|velocidad|velocita)$",
    ),
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
SIDED = (*ACTUATORS, "r_radps", "roll_rad", "roll_rate_radps", "v_mps", "imu_lateral_mps2", "wind_angle_rad")
"""What is to one side or the other."""
ORDER = r"\b(order\w*|cmd|command\w*|set|setpoint|sp|demand|dem|req\w*|desired|des|ref|target|tgt|wanted)\b"
REACHED = r"\b(act|actual|fb|fbk|feedback|meas\w*|resp\w*|rsa|reached|pos|position)\b"
PORT, STARBOARD = r"\b(p|port|portangle|ps|bb|left|l)\b", r"\b(s|stbd|stbdangle|sb|starboard|stb|right|r)\b"
BOW = r"\b(bow|bt|tunnel|thr bow|fwd|forward)\b"
BESIDE = ("roll_rad", "roll_rate_radps", "depth_m", "wind_speed_mps", "wind_angle_rad", "imu_lateral_mps2")
"""Columns that a record does without: one that is the same in all rows is no reading."""
FINE_DEG, MOSTLY = 1e-3, 0.5
"""Usual change of a coordinate below which it is in degrees; share of negative ones among heights."""


FOREIGN = (
    "N", "kN", "MN", "t", "kg", "Nm", "kNm", "W", "kW", "MW", "hp", "A", "mA", "V", "mV", "bar", "mbar", "Pa", "kPa",
    "MPa", "C", "°C", "degC", "K", "l/h", "kg/h", "t/h", "m3/h",
)  # fmt: skip
"""Units of forces, torques, powers and other quantities beside an actuator, which are no order or position of it."""
FORCE = r"\b(thrust|force|pull|push|tau|f?[xy])\b"


@dataclass(frozen=True, kw_only=True)
class Mark:
    """What the name of a channel says."""

    column: str  # a column or a kind of actuator signal; "" for neither
    rank: int = 9
    unit: str = ""
    name: str = ""  # in words
    exact: bool = False  # whether the name is one of ours
    sense: float = 0.0  # -1 where the name says that port is positive, 1 for starboard, 0 for nothing

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
    plain, sense = split_sense(channel.name)
    bare, unit = split_unit(plain)
    name, unit = words(bare), channel.unit or unit
    if channel.unit and unit_word(channel.unit) not in {u for t in FACTORS.values() for u in t} | set(SHARES):
        unit = ""
    talker = re.match(r"([A-Z]{2})([A-Z]{3})\.", channel.name)
    if talker:  # the sentence without who talks
        name = words(f"{talker[2]}.{bare[6:]}")
    whole = words(plain) if bare != plain else name
    column, rank = _rule(name, RULES) or _rule(whole, RULES) or ("", 9)
    if column == "" and re.search(ORDER, name):
        column, rank = _rule(whole, ACTUATOR_RULES) or ("", 9)
    if name in ("x", "y", "z"):
        column, rank = _coordinate(name, channel.values), 4
    if not _fits(column, unit_word(unit)) or (column not in ACTUATORS and re.search(ORDER, name)):
        column = ""  # an order of a heading or a speed is no reading of it
    if column and _is_foreign(plain, channel.unit, whole, column=column):
        column = ""
    if column in BESIDE and np.ptp(channel.values) == 0:
        column = ""
    return Mark(column=column, rank=rank, unit=unit_word(unit), name=name, sense=sense if column in SIDED else 0.0)


def _is_foreign(name: str, unit: str, in_words: str, *, column: str) -> bool:
    """Whether a channel is in the unit of a quantity that is not read, or named after one."""
    found = re.search(r"(?:[\[({]\s*([^\])}]*?)\s*[\])}]|[_\s,/]([A-Za-z°]+))\s*$", name)
    stated, actuator = unit or (found[1] or found[2] if found else ""), column in ACTUATORS
    if not actuator and unit_word(stated) in FACTORS[dimension(column)]:
        return False  # SOG [kN] is in knots, and a depth in metres is one, though a pressure sensor gives it
    if re.search(r"\b(torque|force|power(?! lever)|pressure|temperature|current|voltage)\b", in_words):
        return True
    if len(stated) == 1 and not (unit or name.rstrip().endswith("]") or re.search(FORCE, in_words)):
        return False  # engine_N is a speed, Rudder (A) the first of two
    return stated in FOREIGN and (actuator or stated != "N")  # lat [N]


def _fits(column: str, unit: str) -> bool:
    """Whether a column can be in a unit that is stated: a speed in knots is no number of revolutions."""
    kind = {"rudder": "angle", "a": "angle", "n": "revolutions"}.get(column)
    if not column or not unit or (kind and unit in SHARES):
        return True
    if column == "throttle":  # a lever or revolutions, no force and no angle
        return unit in SHARES or unit in FACTORS["revolutions"] or unit not in KNOWN
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


STEPPED = 0.5  # share of all movement in single jumps from which a signal is an order


def numbered(
    used: Sequence[tuple[Use, Mark]], channels: Sequence[Channel], actuators: Sequence[Actuator]
) -> Iterator[tuple[int, Use]]:
    """Uses of actuators' signals with their columns, by the identity of the use without."""
    own = [(use, mark) for use, mark in used if mark.is_actuator]
    driven = {mark.machine for _, mark in own if mark.column in ("n", "throttle")}
    # an angle without revolutions beside it steers as a rudder does
    own = [
        (use, replace(mark, column="rudder") if mark.column == "a" and mark.machine not in driven else mark)
        for use, mark in own
    ]
    table = {(c.source, c.name): c for c in channels}
    shares = any(use.unit in SHARES for use, _ in own)
    forces = not actuators or any(one.kind == "force" for one in actuators)
    throttles = {mark.machine for _, mark in own if mark.column == "throttle"}
    as_forces = shares and forces and len(throttles) < 2 and not any(mark.column in ("n", "a") for _, mark in own)
    as_forces = as_forces and all(use.unit in SHARES for use, _ in own)  # an angle is no share
    machines = sorted({mark.machine for _, mark in own if mark.column != "rudder"}, key=_as_listed)
    rudders = sorted({mark.machine for _, mark in own if mark.column == "rudder"}, key=_as_listed)
    turning = {mark.machine for _, mark in own if mark.column == "a"}
    numbers = {machine: str(k) for k, machine in enumerate(machines, start=1)}
    numbers |= _by_place(machines, turning, actuators)
    for use, mark in own:
        roles = {other.role for _, other in own if (other.column, other.machine) == (mark.column, mark.machine)}
        reached, said = _is_reached(mark, roles, table[use.file, use.channel])
        prefix = "reached_" if reached else ""
        if as_forces:
            column, extra = ("tau_psi" if mark.column == "rudder" else "tau_x"), "as a share of the largest"
            yield id(use), replace(use, column=column, why=f"{use.why}; {extra}")
            continue
        if mark.column == "rudder":
            signal, scale = f"rudder{rudders.index(mark.machine) + 1}", _largest(actuators, "rudder", use)
        else:
            kind = "a" if mark.column == "a" else "n"
            signal, scale = f"{kind}{numbers[mark.machine]}", _largest(actuators, kind, use)
        column = f"{prefix}{signal}_{'rps' if signal[0] == 'n' else 'rad'}"
        unit_words = (
            ""
            if use.unit not in SHARES
            else f"; of {scale:.4g}, {'as the vessel file has it' if actuators else 'as nothing tells the largest'}"
        )
        yield id(use), replace(use, column=column, scale=use.scale * scale, why=f"{use.why}; {said}{unit_words}")


def shared(uses: Sequence[Use], marks: Sequence[Mark], actuators: Sequence[Actuator]) -> list[Use]:
    """Further uses of a signal without side and number, of which the log has one and the vessel several actuators."""
    found = []
    for own_stem, kinds in (("rudder", ("rudder",)), ("n", ("propeller", "azimuth")), ("a", ("azimuth",))):
        signals = [name for one in actuators if one.kind in kinds for name in one.signals if stem(name) == own_stem]
        ending = "rps" if own_stem == "n" else "rad"
        own = [
            (use, mark) for use, mark in zip(uses, marks, strict=True)
            if mark.is_actuator and stem(use.column.removeprefix("reached_").removesuffix(f"_{ending}")) == own_stem
        ]  # fmt: skip
        if len(signals) < 2 or any(mark.machine != ("", "", "") for _, mark in own):
            continue
        for use, _ in own:
            first = use.column.removeprefix("reached_").removesuffix(f"_{ending}")
            why = f"{use.why}; of all {len(signals)}, as the log has one"
            found += [
                replace(use, column=use.column.replace(first, name), why=why) for name in signals if name != first
            ]
    return found


def _as_listed(machine: tuple[str, str, str]) -> tuple[str, str, str]:
    """Stern before bow, port before starboard, by number."""
    bow, side, number = machine
    return bow, number.rjust(3), side


def _largest(actuators: Sequence[Actuator], wanted: str, use: Use) -> float:
    """What 100 per cent of an order are."""
    if use.unit not in SHARES:
        return 1.0
    limits = [
        limit.high for one in actuators for name, limit in zip(one.signals, one.limits, strict=True)
        if stem(name) == wanted and np.isfinite(limit.high)
    ]  # fmt: skip
    return limits[0] if limits else 1.0 if wanted == "n" else np.pi / 180.0 * 35.0


def _by_place(
    machines: Sequence[tuple[str, str, str]], turning: set[tuple[str, str, str]], actuators: Sequence[Actuator]
) -> dict[tuple[str, str, str], str]:
    """Numbers in the vessel file, where places tell: tunnels are at the bow, sides are as signed."""
    found = {}
    for machine in machines:
        bow, side, number = machine
        kinds = ("tunnel",) if bow else ("azimuth",) if machine in turning else ("propeller", "azimuth")
        able = [one for one in actuators if one.kind in kinds]
        if side:
            able = [one for one in able if np.sign(one.starboard_m) == (-1.0 if side == "p" else 1.0)]
        elif number:
            able = [one for one in able if str(one.number) == number]
        if len(able) == 1:
            found[machine] = str(able[0].number)
    return found if len(set(found.values())) == len(found) else {}


def _is_reached(mark: Mark, roles: set[str], channel: Channel) -> tuple[bool, str]:
    """Whether a signal is a position that was reached, and why."""
    if mark.role:
        return mark.role == "reached", f"{'an order' if mark.role == 'order' else 'feedback'} by its name"
    if "order" in roles:
        return True, "feedback, as there is an order too"
    if "reached" in roles:
        return False, "the order, as there is feedback too"
    if not np.ptp(channel.values):
        return False, "an order, as it never changes"
    if jumps(channel.values):
        return False, "it jumps as an order does"
    return True, "it moves as an actuator does, so what was reached (give the column without reached_ for an order)"


def jumps(values: Array) -> bool:
    """Whether a signal moves mostly by jumps from one held value to the next, as orders do."""
    steps = np.diff(values)
    size = float(np.abs(steps).max(initial=0.0))
    if not size:
        return True
    moving = np.abs(steps) > 0.02 * size
    alone = moving & ~np.r_[False, moving[:-1]] & ~np.r_[moving[1:], False]
    return float(np.abs(steps[alone]).sum()) > STEPPED * float(np.abs(steps[moving]).sum())


def bow_signals(mapping: Mapping) -> tuple[str, ...]:
    """Signals of thrusters across the bow, by the names of their channels."""
    return tuple(
        use.column.removeprefix("reached_").removesuffix("_rps")
        for use in mapping.uses
        if re.search(BOW, words(split_sense(use.channel)[0])) and use.column.endswith("_rps")
    )


def sides(mapping: Mapping) -> dict[str, float]:
    """Signal of a thruster -> side that the name of its channel says, -1 for port."""
    found: dict[str, float] = {}
    for use in mapping.uses:
        if use.column.endswith("_rps"):
            name, signal = words(split_sense(use.channel)[0]), use.column.removeprefix("reached_").removesuffix("_rps")
            side = -1.0 if re.search(PORT, name) else 1.0 if re.search(STARBOARD, name) else 0.0
            found |= {signal: side} if side else {}
    return found
