"""Whether measured velocities and the pose agree.

Over windows of some seconds, the change of pose is compared with the integral of the measured velocity. Noise and
antenna offsets average out, while a wrong unit, sign or axis does not. If they disagree, the mistake that explains it
is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.conventions import KNOTS_PER_MPS, rotated
from expdesign.records.file import Table
from expdesign.sea_area import LocalFrame
from expdesign.values import Array

WINDOW_S = 10.0  # interval over which changes of the pose are compared with velocities [s]
POSE_DISAGREEMENT = 0.3  # relative difference of both changes (root mean square) that gets a note
POSE_SUSPICION = 0.1  # relative difference above which an explanation is searched for
POSE_EXPLAINED = 0.25  # share of the difference that may remain with an explanation
COURSE_SPREAD = 0.02  # circular variance of course less heading below which it is not questioned
COURSE_AXIS_RAD = 0.5  # distance of an axis at which headings may begin [rad]
EQUALLY_GOOD = 1.5  # ratio of remaining differences below which explanations are named together
TURNING_RAD = 0.05  # change of heading over a window (root mean square) below which no turn is compared [rad]
# change of the pose over a window (root mean square) that noise alone may make: of heading [rad] and of place [m]
NOISE_RAD, NOISE_M = 0.2, 5.0
BY_CHANCE = 1e-3  # probability from which noise may look like a mistake
FASTEST_MPS = 60.0  # speed over ground that positions may show
DEGREE = np.pi / 180.0

LONG_TIMES = (
    ("time_s is in minutes", 60.0),
    ("time_s is in hours", 3600.0),
    ("time_s is in days", 86400.0),
)
SPEED_UNITS = (
    ("u_mps and v_mps are in knots", 1 / KNOTS_PER_MPS),
    ("u_mps and v_mps are in km/h", 1 / 3.6),
    ("u_mps and v_mps are in ft/s", 0.3048),
    ("u_mps and v_mps are in cm/s", 0.01),
    ("time_s is in milliseconds, or u_mps and v_mps in mm/s", 0.001),
    ("u_mps and v_mps have the wrong sign", -1.0),
    *LONG_TIMES,
)
RATE_UNITS = (
    ("r_radps is in degrees per second, or the heading in radians under a degree name", DEGREE),
    ("r_radps is in degrees per minute", DEGREE / 60.0),
    ("the heading is in degrees under a radian name", 1.0 / DEGREE),
    ("r_radps is positive to port, or the heading counts counter-clockwise", -1.0),
    ("time_s is in milliseconds", 0.001),
    *LONG_TIMES,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Mistake:
    """A possible mistake in the file."""

    text: str  # the mistake, for the message
    moved: Array  # (n, d) change of pose over the windows, with the mistake corrected
    expected: Array  # (n, d) integral of the measured velocity, with the mistake corrected

    @property
    def difference(self) -> float:
        """Root-mean-square difference relative to the larger of both."""
        size = max(float(np.linalg.norm(self.moved)), float(np.linalg.norm(self.expected)))
        return float(np.linalg.norm(self.moved - self.expected)) / size if size else 0.0

    @property
    def change(self) -> float:
        """Root-mean-square change of the pose over a window."""
        return float(np.sqrt(np.mean(np.sum(self.moved**2, axis=1))))

    @property
    def by_chance(self) -> float:
        """Least probability that white noise in place of the pose is as near to the direction of what is expected.

        It is the share of the sphere in d dimensions that lies within that angle (S. Li, Concise formulas for the area
        and volume of a hyperspherical cap, Asian Journal of Mathematics and Statistics 4, 2011, 66-70).
        """
        return float(0.5 * scipy.special.betainc((self.moved.size - 1) / 2, 0.5, min(self.difference, 1.0) ** 2))


def check_agreement(table: Table, batches: tuple[slice, ...], sample_time_s: float) -> Table:
    """Compare measured velocities with pose, where both are there.

    Returns:
        The table, with a note when they disagree and no single mistake explains it.

    Raises:
        FileError: a mistake of unit, sign or axis explains the disagreement.
    """
    windows = _windows(batches, sample_time_s)
    if not len(windows):
        return table
    if {"heading_rad", "r_radps"} <= set(table.columns):
        table = _check_turning(table, windows, sample_time_s)
    if {"heading_rad", "north_m", "u_mps", "v_mps"} <= set(table.columns):
        table = _check_moving(table, windows, sample_time_s)
    elif {"heading_rad", "north_m", "u_mps"} <= set(table.columns):
        table = _check_ahead(table, windows, sample_time_s)
    return table


def check_speed(table: Table, batches: tuple[slice, ...], sample_time_s: float) -> None:
    """Raise where positions move faster than any ship, as they do with another unit of time or place.

    Raises:
        FileError: naming the speed.
    """
    windows = _windows(batches, sample_time_s)
    if not {"north_m", "east_m"} <= set(table.columns) or not len(windows):
        return
    way = np.linalg.norm(_change(table.stack("north_m", "east_m"), windows), axis=1)
    speed = float(np.median(way / (np.diff(windows, axis=1)[:, 0] * sample_time_s)))
    if speed > FASTEST_MPS:
        header, clock = (table.sources[name].header for name in ("north_m", "time_s"))
        found = f"the position moves at {speed:.3g} m/s over ground, expected at most {FASTEST_MPS:g} m/s"
        raise table.error("north_m", f"{found}; are {clock} and {header} in the units that their names say?")


def check_heading(table: Table, batches: tuple[slice, ...], sample_time_s: float) -> None:
    """Compare the heading with the course over ground, where no velocity is measured that would tell.

    Raises:
        FileError: the heading counts the other way round.
    """
    if {"heading_rad", "north_m"} <= set(table.columns):
        pose = table.stack("north_m", "east_m", "heading_rad")
        if how := mirrored_heading([pose[part] for part in batches], sample_time_s):
            names = [table.sources[name].header for name in ("north_m", "east_m")]
            other = f", or {names[0]} and {names[1]} are exchanged" if how == FROM_EAST else ""
            raise table.error("heading_rad", f"{how}, as the positions show{other}; expected clockwise from north")


COUNTER_CLOCKWISE = "counts counter-clockwise"
FROM_EAST = f"{COUNTER_CLOCKWISE} from east, as in mathematics"


def mirrored_heading(poses: Sequence[Array], sample_time_s: float) -> str:
    """How a heading counts the other way round; "" where it does not.

    A ship mostly goes where she points, so that course less heading varies little. Where course plus heading varies far
    less, the heading is mirrored: about north, or about northeast where it counts from east.

    Args:
        poses: (k, 3) n-frame north m, east m, heading rad, each in even steps.
        sample_time_s: the step [s].
    """
    way, bow = [np.zeros(0, dtype=complex)], [np.zeros(0, dtype=complex)]
    for pose in poses:
        windows = _windows((slice(0, len(pose)),), sample_time_s)
        if len(windows):
            way.append(_change(pose[:, :2], windows) @ (1.0, 1j))
            bow.append(np.exp(1j * pose[windows.mean(axis=1).astype(int), 2]))
    moved, pointed = np.concatenate(way), np.concatenate(bow)
    size = float(np.abs(moved).sum())
    ahead, mirrored = (complex(np.sum(moved * turn)) / size if size else 0j for turn in (pointed.conj(), pointed))
    if not size or 1.0 - abs(ahead) < COURSE_SPREAD or 1.0 - abs(mirrored) > POSE_EXPLAINED * (1.0 - abs(ahead)):
        return ""
    for axis, how in ((0.0, COUNTER_CLOCKWISE), (np.pi / 2.0, FROM_EAST)):
        if abs(np.angle(mirrored * np.exp(-1j * axis))) < COURSE_AXIS_RAD:
            return how
    return ""


def _check_turning(table: Table, windows: Array, sample_time_s: float) -> Table:
    turned = _change(table.columns["heading_rad"][:, None], windows)
    expected = _integral(table.columns["r_radps"][:, None], windows, sample_time_s)
    mistakes = [Mistake(text=text, moved=turned, expected=factor * expected) for text, factor in RATE_UNITS]
    as_is = Mistake(text="", moved=turned, expected=expected)
    _raise_explained(table, "r_radps", "disagrees with the change of heading", as_is, mistakes, noise=NOISE_RAD)
    if as_is.difference > POSE_DISAGREEMENT and as_is.change > TURNING_RAD:
        return table.noted(f"heading and r_radps disagree by {as_is.difference:.0%} over {WINDOW_S:g} s")
    return table


def _check_moving(table: Table, windows: Array, sample_time_s: float) -> Table:
    heading, velocity = table.columns["heading_rad"], table.stack("u_mps", "v_mps")
    position = table.stack("north_m", "east_m")
    moved = _change(position, windows)

    def expected(angle: Array, b_frame: Array = velocity) -> Array:
        return _integral(_to_n(b_frame, angle), windows, sample_time_s)

    as_is = Mistake(text="", moved=moved, expected=expected(heading))
    mistakes = [Mistake(text=t, moved=moved, expected=factor * as_is.expected) for t, factor in SPEED_UNITS]
    rotated = {
        "v_mps is positive to port": expected(heading, velocity * (1, -1)),
        "u_mps and v_mps are north and east velocities": _integral(velocity, windows, sample_time_s),
        "the heading counts counter-clockwise": expected(-heading),
        "the heading counts counter-clockwise from east": expected(np.pi / 2 - heading),
        "the heading is in degrees under a radian name": expected(heading * DEGREE),
        "the heading is in radians under a degree name": expected(heading / DEGREE),
    }
    mistakes += [Mistake(text=text, moved=moved, expected=other) for text, other in rotated.items()]
    mistakes.append(Mistake(text="east_m is positive to west", moved=moved * (1, -1), expected=as_is.expected))
    swapped = _change(_swapped(table), windows)
    names = f"{table.sources['north_m'].header} and {table.sources['east_m'].header}"
    mistakes.append(Mistake(text=f"{names} are exchanged", moved=swapped, expected=as_is.expected))
    _raise_explained(table, "u_mps", "disagrees with the positions", as_is, mistakes, noise=NOISE_M)
    if as_is.difference > POSE_DISAGREEMENT:
        disagree = f"positions and measured velocities disagree by {as_is.difference:.0%} over {WINDOW_S:g} s"
        return table.noted(disagree + _heading_offset(as_is))
    return table


def _check_ahead(table: Table, windows: Array, sample_time_s: float) -> Table:
    """The same of surge alone: the way along the heading, which a sway that nobody measured is no part of."""
    heading, position = table.columns["heading_rad"], table.stack("north_m", "east_m")

    def ahead(angle: Array, places: Array = position) -> Array:
        middle, along = (angle[1:] + angle[:-1]) / 2.0, np.zeros(len(angle))
        steps = np.diff(places, axis=0)
        along[1:] = np.cumsum(np.cos(middle) * steps[:, 0] + np.sin(middle) * steps[:, 1])
        return _change(along[:, None], windows)

    as_is = Mistake(text="", moved=ahead(heading), expected=_integral(table.stack("u_mps"), windows, sample_time_s))
    mistakes = [
        Mistake(text=_of_surge(text), moved=as_is.moved, expected=factor * as_is.expected)
        for text, factor in SPEED_UNITS
    ]
    names = f"{table.sources['north_m'].header} and {table.sources['east_m'].header}"
    other = {
        "the heading counts counter-clockwise": ahead(-heading),
        "the heading counts counter-clockwise from east": ahead(np.pi / 2 - heading),
        "the heading is in degrees under a radian name": ahead(heading * DEGREE),
        "the heading is in radians under a degree name": ahead(heading / DEGREE),
        "east_m is positive to west": ahead(heading, position * (1, -1)),
        f"{names} are exchanged": ahead(heading, _swapped(table)),
    }
    mistakes += [Mistake(text=text, moved=moved, expected=as_is.expected) for text, moved in other.items()]
    _raise_explained(table, "u_mps", "disagrees with the positions", as_is, mistakes, noise=NOISE_M)
    if as_is.difference > POSE_DISAGREEMENT:
        return table.noted(f"positions and measured surge disagree by {as_is.difference:.0%} over {WINDOW_S:g} s")
    return table


def _of_surge(text: str) -> str:
    return text.replace("u_mps and v_mps are", "u_mps is").replace("u_mps and v_mps have", "u_mps has").replace(
        "u_mps and v_mps", "u_mps"
    )  # fmt: skip


def _heading_offset(as_is: Mistake) -> str:
    """The constant heading error that explains a disagreement, or ""."""
    moved, expected = (pairs[:, 0] + 1j * pairs[:, 1] for pairs in (as_is.moved, as_is.expected))
    offset = float(np.angle(np.vdot(expected, moved)))
    turned = expected * np.exp(1j * offset)
    corrected = Mistake(text="", moved=as_is.moved, expected=np.stack([turned.real, turned.imag], axis=-1))
    if corrected.difference > POSE_EXPLAINED * as_is.difference:
        return ""
    return f", only by {corrected.difference:.0%} with {offset / DEGREE:+.0f} degrees added to the heading"


def _raise_explained(
    table: Table, name: str, problem: str, as_is: Mistake, mistakes: list[Mistake], *, noise: float
) -> None:
    """Raise where a mistake explains the disagreement, and not as chance would: noise may look like any of them."""
    if as_is.change < noise and len(mistakes) * min(mistake.by_chance for mistake in mistakes) > BY_CHANCE:
        return
    best = min(mistake.difference for mistake in mistakes)
    if as_is.difference <= POSE_SUSPICION or best > POSE_EXPLAINED * as_is.difference:
        return
    likely = [mistake for mistake in mistakes if mistake.difference <= EQUALLY_GOOD * best + 0.01]
    texts = ", or ".join(mistake.text for mistake in sorted(likely, key=lambda mistake: mistake.difference))
    found = f"{problem} by {as_is.difference:.0%}, but only by {best:.0%} if {texts}"
    raise table.error(name, f"{found}; expected units, signs and axes as in the column names")


def _windows(batches: tuple[slice, ...], sample_time_s: float) -> Array:
    """(n, 2) first and last sample of windows that do not overlap and do not cross batches."""
    length = max(round(WINDOW_S / sample_time_s), 1)
    pairs = [
        (start, start + step)
        for part in batches
        for step in [min(length, part.stop - part.start - 1)]
        for start in range(part.start, part.stop - step, step)
    ]
    return np.array(pairs, dtype=float).reshape(-1, 2)


def _change(values: Array, windows: Array) -> Array:
    first, last = windows.astype(int).T
    return np.asarray(values[last] - values[first])


def _integral(rates: Array, windows: Array, sample_time_s: float) -> Array:
    """Trapezoidal integrals over the windows, (n, d)."""
    total = np.zeros_like(rates)
    total[1:] = np.cumsum((rates[1:] + rates[:-1]) / 2, axis=0) * sample_time_s
    return _change(total, windows)


def _to_n(velocity: Array, heading_rad: Array) -> Array:
    return np.stack(rotated(velocity[:, :2].T, heading_rad), axis=-1)


def _swapped(table: Table) -> Array:
    """Positions if the two columns were exchanged."""
    if "lat_deg" not in table.columns:
        return table.stack("east_m", "north_m")
    lat, lon = table.columns["lon_deg"], table.columns["lat_deg"]
    if np.abs(lat).max() >= 90:
        return table.stack("north_m", "east_m")
    return LocalFrame(float(lat[0]), float(lon[0])).to_metres(np.stack([lat, lon], axis=-1))
