"""Instruments against each other, before any model: each comparison gives an estimate, its interval and what is left.

All compare what two instruments say of the same motion over windows of about a ship length:

    gyro        integral of r       scale * change of heading + bias * time + delay * change of r
    log         change of position  integral of R(angle) (u / scale, v / scale) + change of R arm + drift * time
                                    + delay of positions * change of R (u, v) + delay of log * integral of R d(u, v)
    course      way to the side     - distance * change of heading + ...

R turns by the measured heading. A distance of zero in the last means that the ship never drifts in her turns: the
"heading" is her course over ground.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import plus_minus
from expdesign.kinematics.relation import CERTAIN, SCALE_STD, Relation, integral, relation, samples_in_window, stretches
from expdesign.signals import Batch
from expdesign.values import Array

SCALE_MATTERS = 0.02  # change of a scale that is told
SWAY_WITHIN = 1.5  # factor within which the scale of sway is that of surge; beyond, sway is hardly more than noise
TURN_MATTERS_RAD = 0.0175  # misalignment that is told [rad]
RATE_MATTERS = 0.1  # bias of a rate, as a share of its root mean square, that is told
PLACE_STD = 0.001  # standard error of a place, at least, in ship lengths: small differences of clocks imitate that
PLACE_MATTERS = 0.05  # distance of an instrument, in ship lengths, that is told
LEAST_TRUE = 0.2  # share of a way that is no noise from which its scale is known at all
ALIKE = 1.05  # what an explanation may leave, by what another one leaves, to be named beside it
DELAY_MATTERS = 0.6  # of one instrument after another, in samples, that is told; Euler's map alone gives a half
DELAY_STD = 0.05  # standard error of a delay, at least, in samples
DELAY_ROUNDS = 2  # in which the delay of a log is found
WAY_MATTERS = 0.05  # steady difference of velocities, as a share of the speed, that is told
# least share of a regressor that the others do not explain; that of a way, which is measured better than most
TOLD_WAY = 0.002
# share of the expected distance of the place that does not drift in turns below which a heading is one of the track
ON_COURSE = 0.5
ON_TRACK = 0.5  # share of the expected drift below which heading and course are the same
TURNING = 0.02  # drift expected in turns [rad], root mean square, from which heading and course can be told apart
DEGREE = np.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What one comparison of instruments tells."""

    name: str  # of the quantity, as a vessel file calls it where it may stand there
    # value, std: estimate and standard error, in the unit that the name ends in
    value: float
    std: float
    rest: float  # root mean square of what the comparison leaves over a window, in the unit of what is compared
    text: str  # a sentence


def gyro_against_heading(batches: Sequence[Batch], *, length_m: float) -> Iterator[Finding]:
    """Scale, bias and delay of the yaw rate, by the change of heading."""
    own = [batch for batch in batches if batch.pose is not None and "r" not in batch.derived]
    found = relation(stretches(own, [_turning(batch) for batch in own], length_m=length_m))
    if found is None:
        return
    rate = _rms(np.concatenate([batch.velocity[:, 2] for batch in own]))
    if found.differs(1.0, by=SCALE_MATTERS):
        scale, std = found.size, found.size_std
        yield Finding(
            name="yaw_rate_scale", value=scale, std=std, rest=found.rest,
            text=f"r_radps is {plus_minus(scale, std)} times the rate at which the heading changes: the scale of a "
            f"gyro? Where the heading is right, multiply sensors.yaw_rate_scale by {scale:.4g}.",
        )  # fmt: skip
    bias, std = float(found.others[0].real), float(found.others_std[0, 0])
    if abs(bias) > max(CERTAIN * std, RATE_MATTERS * rate):
        yield Finding(
            name="yaw_rate_bias_radps", value=bias, std=std, rest=found.rest,
            text=f"r_radps is {plus_minus(bias, std)} rad/s more than the rate at which the heading changes: the zero "
            f"of a gyro? Where the heading is right, add {bias:.4g} to sensors.yaw_rate_bias_radps.",
        )  # fmt: skip
    delay, std = -float(found.others[1].real), float(found.others_std[1, 0])
    if abs(delay) > max(CERTAIN * std, DELAY_MATTERS * own[0].sample_time_s):
        later, sooner = ("r_radps", "the heading")[:: 1 if delay > 0 else -1]
        yield Finding(
            name="yaw_rate_delay_s", value=delay, std=std, rest=found.rest,
            text=f"{later} comes {plus_minus(abs(delay), std)} s later than {sooner}.",
        )  # fmt: skip


SHOWN_STD, SHOWN_SAMPLES = 2.0, 0.5
"""Standard errors, and samples beside these, within which one instrument shows the clock of another."""


def shown_delays(batches: Sequence[Batch], *, length_m: float) -> dict[str, tuple[float, float]]:
    """Effect -> least and greatest delay [s] of a yaw rate or heading by each other; nothing where neither tells."""
    own = [batch for batch in batches if batch.pose is not None and "r" not in batch.derived]
    found = relation(stretches(own, [_turning(batch) for batch in own], length_m=length_m))
    if found is None:
        return {}
    late = -float(found.others[1].real)
    apart = SHOWN_STD * float(found.others_std[1, 0]) + SHOWN_SAMPLES * own[0].sample_time_s
    return {"late:r": (late - apart, late + apart), "late:psi": (-late - apart, apart - late)}


def log_against_positions(batches: Sequence[Batch], *, length_m: float) -> Iterator[Finding]:
    """Scale, axes and clock of the measured velocities, place and clock of the positions, and a steady difference."""
    own = [batch for batch in batches if batch.pose is not None and not {"u", "v"} & set(batch.derived)]
    found = _log(own, length_m=length_m)
    if found is None:
        return
    speed = _rms(np.concatenate([np.hypot(*batch.velocity[:, :2].T) for batch in own]))
    yield from _log_scale(found)
    angle, std = -float(np.angle(found.ahead.ratio)), found.ahead.std[1] / abs(found.ahead.ratio)
    if abs(angle) > max(CERTAIN * std, TURN_MATTERS_RAD):
        yield Finding(
            name="heading_bias_rad", value=angle, std=std, rest=found.ahead.rest,
            text=f"the heading is {plus_minus(angle / DEGREE, std / DEGREE)} degrees more than positions and "
            "velocities say: "
            f"add {angle:.4g} to sensors.heading_bias_rad, or {-angle:.4g} to sensors.velocity_angle_rad.",
        )  # fmt: skip
    drift, spread = found.of("drift")
    if abs(drift) > max(CERTAIN * float(np.hypot(*spread)), WAY_MATTERS * speed):
        toward = float(np.degrees(np.angle(drift)) % 360.0)
        yield Finding(
            name="current_mps", value=abs(drift), std=float(np.hypot(*spread)), rest=found.ahead.rest,
            text=f"the positions move at {plus_minus(abs(drift), float(np.hypot(*spread)))} m/s towards {toward:.0f} "
            "degrees beyond u_mps and v_mps: are these through the water, and not over ground?",
        )  # fmt: skip
    yield from _clocks(found)
    yield from _place(found, own[0].sample_time_s, speed, length_m=length_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Log:
    """How positions follow the way that a log tells."""

    ahead: Relation  # positions on the way ahead, or on all way where that to the side has the same scale
    # of the other regressors, in order: "drift", "arm", and of "side", "positions", "log" those that differ for certain
    names: tuple[str, ...]
    sample_s: float  # time between samples
    late_s: float = 0.0  # by which the velocities were late, and were moved before
    # the same with a scale of sway of its own, which is not certainly another; None where nothing tells
    apart: _Log | None = None
    placed: _Log | None = None  # with that scale in place of another place of the positions
    # share of the way to the side, beyond what the others explain, that is no white noise of the measured sway
    true_share: float = 1.0

    def of(self, name: str) -> tuple[complex, Array]:
        """Coefficient of a regressor, and the standard errors of its parts."""
        place = self.names.index(name)
        return complex(self.ahead.others[place]), self.ahead.others_std[place]

    @property
    def side(self) -> tuple[float, float]:
        """Least and greatest scale of sway: regression makes it smaller by the share of it that is noise."""
        value = self.of("side")[0].real
        return value, value / self.true_share

    @property
    def side_scale(self) -> tuple[float, float]:
        """Measured over true sway speed, and its standard error with half the distance of both bounds."""
        (low, high), spread = self.side, self.of("side")[1][0]
        side, std = (low + high) / 2.0, float(np.hypot(spread, (high - low) / 2.0))
        return 1.0 / side, std / side**2

    def delay_std(self, name: str) -> float:
        """Standard error of a delay [s], with what sampling leaves open."""
        return float(np.hypot(self.of(name)[1][0], DELAY_STD * self.sample_s))


def _log(batches: Sequence[Batch], *, length_m: float) -> _Log | None:
    """The relation with a scale of sway and with clocks of their own, as far as the data show these; None without any.

    Regressors that are not certain are left out one by one, the least certain first: at one speed and little turn a
    place, two clocks and a scale of sway look alike. The relation is linear in the delay of a log; what it finds is
    undone, and the rest found anew.
    """
    late_s = 0.0

    def related(names: Sequence[str]) -> _Log | None:
        x = "ahead" if "side" in names else "way"
        running = [_columns(batch, late_s) for batch in batches]
        wide = [np.column_stack([rows[name] for name in ("position", x, *names)]) for rows in running]
        found = relation(stretches(batches, wide, length_m=length_m), told=TOLD_WAY)
        if found is None:
            return None
        share = 1.0
        if "side" in names:
            place = 2 + list(names).index("side")
            share = _true_share([np.roll(rows[:, 1:], 1 - place, axis=1) for rows in wide], batches, length_m=length_m)
            if share < LEAST_TRUE:
                return None
        return _Log(ahead=found, names=tuple(names), sample_s=batches[0].sample_time_s, late_s=late_s, true_share=share)

    optional = ("side", "positions", "log")
    found = _certain(related, optional) if batches else None
    for _ in range(DELAY_ROUNDS):
        if found is None or "log" not in found.names:
            break
        late_s += found.of("log")[0].real
        found = _certain(related, tuple(name for name in found.names if name in optional))
    if found is None or "side" in found.names:
        return found
    return replace(found, apart=related((*found.names, "side")), placed=related(("drift", "side")))


def _true_share(running: Sequence[Array], batches: Sequence[Batch], *, length_m: float) -> float:
    """Share of the way to the side, beyond what other ways explain, that is no white noise of the measured sway.

    Args:
        running: (k, n) the way to the side and the others, of every batch.
        batches: whose sway it is.
        length_m: of the ship.
    """
    ways = np.concatenate(stretches(batches, running, length_m=length_m))
    rest = ways[:, 0] - ways[:, 1:] @ np.linalg.lstsq(ways[:, 1:], ways[:, 0], rcond=1e-9)[0]
    noise = [
        (np.nanmean(np.diff(batch.velocity[:, 1], 2) ** 2) / 6.0 * batch.sample_time_s**2 * window, len(batch))
        for batch in batches
        if len(batch) > (window := samples_in_window(batch, length_m))
    ]
    white = np.average([size for size, _ in noise], weights=[count for _, count in noise])
    return float(1.0 - white / max(np.mean(np.abs(rest) ** 2), 1e-300))


def _certain(related: Callable[[Sequence[str]], _Log | None], optional: Sequence[str]) -> _Log | None:
    """The relation with those of the optional regressors that are certain; a delay that was found before is."""
    names = ["drift", "arm", *optional]
    while True:
        found = related(names)
        sizes = {} if found is None else {name: _certainty(found, name) for name in names[2:]}
        doubtful = {name: size for name, size in sizes.items() if size < 1.0}
        if len(names) == 2 or (found is not None and not doubtful):
            return found
        names.remove(min(doubtful, key=doubtful.__getitem__) if doubtful else names[-1])


def _certainty(found: _Log, name: str) -> float:
    """Size of a coefficient of its own, in those that are told."""
    value, spread = found.of(name)
    if name == "side":
        ahead = abs(found.ahead.ratio)
        if not 1.0 / SWAY_WITHIN < value.real / ahead < SWAY_WITHIN:  # the noise of a log that hardly drifts, or none
            return 0.0
        low, high = (bound - ahead for bound in found.side)
        apart = min(abs(low), abs(high)) if low * high > 0 else 0.0
        return float(apart / max(CERTAIN * np.hypot(spread[0], found.ahead.std[0]), SCALE_MATTERS))
    delay_s = abs(value.real + found.late_s * (name == "log"))
    return float(delay_s / max(CERTAIN * found.delay_std(name), DELAY_MATTERS * found.sample_s))


def _log_scale(found: _Log) -> Iterator[Finding]:
    """The scale of a log, or those of its two axes where these are certainly different."""
    if "side" not in found.names:
        yield from _one_scale(found)
        return
    whole = found.ahead
    scale, std = 1.0 / whole.size, whole.size_std / whole.size**2
    axes = (("surge", "u_mps", scale, std), ("sway", "v_mps", *found.side_scale))
    for axis, column, value, error in axes:
        error = float(np.hypot(error, SCALE_STD))
        if abs(value - 1.0) > max(CERTAIN * error, SCALE_MATTERS):
            yield Finding(
                name=f"{axis}_scale", value=value, std=error, rest=whole.rest,
                text=f"{column} is {plus_minus(value, error)} times the {axis} speed that the positions give: the "
                f"scale of one axis of a log? Where the positions are right, multiply sensors.{axis}_scale by "
                f"{value:.4g}.",
            )  # fmt: skip


def _one_scale(found: _Log) -> Iterator[Finding]:
    """A scale of both axes, or of surge alone: the likelier is said first, and the other one unless it is excluded.

    A log that is wrong in both is no likelier beforehand than one that is wrong in one, so neither has to be certain.
    """
    if not found.ahead.differs(1.0, by=SCALE_MATTERS):
        return
    excluded, nearer = (True, False) if found.apart is None else _sway_is_right(found.apart)
    whole = found.apart.ahead if nearer and found.apart is not None else found.ahead
    scale, std = 1.0 / whole.size, whole.size_std / whole.size**2
    size = plus_minus(scale, std)
    if nearer:
        text = f"u_mps is {size} times the surge speed that the positions give, and perhaps v_mps too (sway is too " \
            f"little to tell): the scale of a log? Where the positions are right, multiply sensors.surge_scale by " \
            f"{scale:.4g}."  # fmt: skip
    else:
        text = f"u_mps and v_mps are {size} times the speed that the positions give" \
            f"{'' if excluded else ', or u_mps alone (sway is too little to tell)'}: the scale of a log? Where the " \
            f"positions are right, multiply sensors.velocity_scale by {scale:.4g}."  # fmt: skip
    name = "surge_scale" if nearer else "velocity_scale"
    yield Finding(name=name, value=scale, std=std, rest=whole.rest, text=text)


def _sway_is_right(apart: _Log) -> tuple[bool, bool]:
    """Whether a scale of one is excluded for sway, and whether sway's is nearer to one than to that of surge."""
    (low, high), spread = apart.side, apart.of("side")[1][0]
    side = (low + high) / 2.0
    plain = 1.0 / SWAY_WITHIN < low < SWAY_WITHIN  # not the noise of a log that hardly drifts
    excluded = plain and (low - 1.0 > CERTAIN * spread or 1.0 - high > CERTAIN * spread)
    return excluded, bool(plain and not excluded and abs(side - 1.0) < abs(side - abs(apart.ahead.ratio)))


def _clocks(found: _Log) -> Iterator[Finding]:
    """How late the velocities come, and the positions."""
    if "log" in found.names:
        late_s, std = found.late_s + found.of("log")[0].real, found.delay_std("log")
        late = "later" if late_s > 0 else "sooner"
        yield Finding(
            name="velocity_delay_s", value=late_s, std=std, rest=found.ahead.rest,
            text=f"u_mps and v_mps come {plus_minus(abs(late_s), std)} s {late} than heading and positions.",
        )  # fmt: skip
    if "positions" in found.names:
        early_s, std = found.of("positions")[0].real, found.delay_std("positions")
        later, sooner = ("heading, u_mps and v_mps", "the positions")[:: 1 if early_s > 0 else -1]
        yield Finding(
            name="position_delay_s", value=-early_s, std=std, rest=found.ahead.rest,
            text=f"{later} come {plus_minus(abs(early_s), std)} s later than {sooner}.",
        )  # fmt: skip


def _place(found: _Log, sample_time_s: float, speed: float, *, length_m: float) -> Iterator[Finding]:
    """Where the positions are measured; at one speed a late clock is the same."""
    arm, spread = found.of("arm")
    spread = np.hypot(spread, PLACE_STD * length_m)
    late = {"log", "positions"} & set(found.names)
    little = PLACE_MATTERS * length_m + (0.0 if late else DELAY_MATTERS * sample_time_s * speed)
    if abs(arm) > max(CERTAIN * float(np.hypot(*spread)), little):
        ahead, beside = ("forward" if arm.real >= 0 else "aft"), ("starboard" if arm.imag >= 0 else "port")
        clock = "u_mps and v_mps come" if arm.real > 0 else "the positions come"
        yield Finding(
            name="position_forward_m", value=float(arm.real), std=float(spread[0]), rest=found.ahead.rest,
            text=f"the positions are those of a place {plus_minus(abs(arm.real), spread[0])} m {ahead} and "
            f"{plus_minus(abs(arm.imag), spread[1])} m to {beside} of where u_mps and v_mps are measured"
            + (f", or {clock} {abs(arm.real) / speed:.2g} s late" if abs(arm.real) > abs(arm.imag) and not late else "")
            + f"{_sway_alike(found)}.",
        )  # fmt: skip


def _sway_alike(found: _Log) -> str:
    """A scale of sway that explains as much as another place: ships drift by about as much as they turn."""
    other = found.placed
    if other is None or other.ahead.rest > ALIKE * found.ahead.rest:
        return ""
    scale, std = other.side_scale
    if abs(scale - 1.0) < max(CERTAIN * std, SCALE_MATTERS):
        return ""
    return f", or v_mps is {plus_minus(scale, std)} times the sway speed that the positions give"


def course_as_heading(batches: Sequence[Batch], *, length_m: float, drifts: float) -> Iterator[Finding]:
    """Whether the heading is the course over ground: the bow points where the ship goes, in her turns too.

    Args:
        batches: with positions.
        drifts: distance from midships, in ship lengths, of the place that is expected not to drift in a turn.
    """
    own = [batch for batch in batches if batch.pose is not None]
    windows = stretches(own, [_drifting(batch) for batch in own], length_m=length_m)
    found = relation(windows)
    if found is None:
        return
    aside, turn, ahead = np.concatenate(windows)[:, :3].real.T
    seen = _rms(np.arctan2(aside, ahead))
    expected = _rms(drifts * length_m * turn / np.maximum(np.abs(ahead), 1e-9))
    pivot, std = -found.ratio.real / length_m, found.std[0] / length_m
    if expected < TURNING or seen > ON_TRACK * expected:
        return
    if abs(pivot) + 2.0 * std < ON_COURSE * drifts:
        yield Finding(
            name="drift_rad", value=seen, std=std * expected / drifts, rest=found.rest,
            text="the heading column holds course over ground: in turns it keeps within "
            f"{seen / DEGREE:.2g} degrees of where the positions go, where a ship of this length drifts by "
            f"{expected / DEGREE:.2g}. Nothing that follows of sway and yaw is right; give the headings of a compass.",
        )  # fmt: skip


def _turning(batch: Batch) -> Array:
    """(k, 4) running y, x and z of `gyro_against_heading`."""
    assert batch.pose is not None
    r = batch.velocity[:, 2]
    return np.column_stack([integral(r, batch), batch.pose[:, 2], batch.time_s, r])


def _columns(batch: Batch, late_s: float) -> dict[str, Array]:
    """Running values (k,) of `log_against_positions`, north + i east; velocities are moved by what they are late."""
    assert batch.pose is not None
    bow = np.exp(1j * batch.pose[:, 2])
    speed = batch.velocity[:, 0] + 1j * batch.velocity[:, 1]
    if late_s:
        own = batch.time_s + late_s
        speed = np.interp(own, batch.time_s, speed)
    ahead, side = (integral(bow * part, batch) for part in (speed.real, 1j * speed.imag))
    return {
        "position": batch.pose[:, 0] + 1j * batch.pose[:, 1],
        "ahead": ahead,
        "side": side,
        "way": ahead + side,
        "drift": batch.time_s,
        "arm": bow,
        "positions": bow * speed,
        "log": np.cumsum(np.append(0.0, (bow[1:] + bow[:-1]) / 2.0 * np.diff(speed))),
    }


def _drifting(batch: Batch) -> Array:
    """(k, 5) those of `course_as_heading`: way to the side, heading, way ahead, way of a current to the side."""
    assert batch.pose is not None
    heading = batch.pose[:, 2]
    middle = np.exp(-0.5j * (heading[1:] + heading[:-1]))
    way = np.cumsum(np.append(0.0, middle * np.diff(batch.pose[:, 0] + 1j * batch.pose[:, 1])))
    stream = np.cumsum(np.append(0.0, middle)) * batch.sample_time_s
    return np.column_stack([way.imag, heading, way.real, stream.real, stream.imag])


def _rms(values: Array) -> float:
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else 0.0
