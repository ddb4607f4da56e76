"""Instruments against each other, before any model: each comparison gives an estimate, its interval and what is left.

All compare what two instruments say of the same motion over windows of about a ship length:

    gyro        integral of r               scale * change of heading + bias * time + delay * change of r
    log         integral of R (u, v)        scale R(angle) (change of position - change of R arm) + drift * time
    course      way to the side             - distance * change of heading + ...

R turns by the measured heading. A distance of zero in the last means that the ship never drifts in her turns: the
"heading" is her course over ground.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.kinematics.relation import Relation, relation
from expdesign.kinematics.tuning import TUNING
from expdesign.signals import Batch
from expdesign.values import Array

DEGREE = np.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What one comparison of instruments tells.

    Attributes:
        name: of the quantity, as a vessel file calls it where it may stand there.
        value, std: estimate and standard error, in the unit that the name ends in.
        rest: root mean square of what the comparison leaves over a window, in the unit of what is compared.
        text: a sentence.
    """

    name: str
    value: float
    std: float
    rest: float
    text: str


def gyro_against_heading(batches: Sequence[Batch], *, length_m: float) -> Iterator[Finding]:
    """Scale, bias and delay of the yaw rate, by the change of heading."""
    own = [batch for batch in batches if batch.pose is not None and "r" not in batch.derived]
    found = relation(stretches(own, [_turning(batch) for batch in own], length_m=length_m))
    if found is None:
        return
    rate = _rms(np.concatenate([batch.velocity[:, 2] for batch in own]))
    if found.differs(1.0, by=TUNING.scale_matters):
        scale, std = found.size, found.size_std
        yield Finding(
            name="yaw_rate_scale", value=scale, std=std, rest=found.rest,
            text=f"r_radps is {with_std(scale, std)} times the rate at which the heading changes: the scale of a gyro? "
            f"Where the heading is right, multiply sensors.yaw_rate_scale by {scale:.4g}.",
        )  # fmt: skip
    bias, std = float(found.others[0].real), float(found.others_std[0, 0])
    if abs(bias) > max(TUNING.certain * std, TUNING.rate_matters * rate):
        yield Finding(
            name="yaw_rate_bias_radps", value=bias, std=std, rest=found.rest,
            text=f"r_radps is {with_std(bias, std)} rad/s more than the rate at which the heading changes: the zero of "
            "a gyro?",
        )  # fmt: skip
    delay, std = -float(found.others[1].real), float(found.others_std[1, 0])
    if abs(delay) > max(TUNING.certain * std, TUNING.delay_matters * own[0].sample_time_s):
        later, sooner = ("r_radps", "the heading")[:: 1 if delay > 0 else -1]
        yield Finding(
            name="yaw_rate_delay_s", value=delay, std=std, rest=found.rest,
            text=f"{later} comes {with_std(abs(delay), std)} s later than {sooner}.",
        )  # fmt: skip


def log_against_positions(batches: Sequence[Batch], *, length_m: float) -> Iterator[Finding]:
    """Scale and axes of the measured velocities, the place of the positions, and a steady difference of both."""
    own = [batch for batch in batches if batch.pose is not None and not {"u", "v"} & set(batch.derived)]
    found = relation(stretches(own, [_moving(batch) for batch in own], length_m=length_m))
    if found is None:
        return
    speed = _rms(np.concatenate([np.hypot(*batch.velocity[:, :2].T) for batch in own]))
    if found.differs(1.0, by=TUNING.scale_matters):
        scale, std = found.size, found.size_std
        yield Finding(
            name="velocity_scale", value=scale, std=std, rest=found.rest,
            text=f"u_mps and v_mps are {with_std(scale, std)} times the speed that the positions give: the scale of a "
            "log?",
        )  # fmt: skip
    angle, std = float(np.angle(found.ratio)), found.std[1] / abs(found.ratio)
    if abs(angle) > max(TUNING.certain * std, TUNING.turn_matters_rad):
        yield Finding(
            name="heading_bias_rad", value=angle, std=std, rest=found.rest,
            text=f"the heading is {with_std(angle / DEGREE, std / DEGREE)} degrees more than positions and velocities "
            f"say: add {angle:.4g} to sensors.heading_bias_rad, or {-angle:.4g} to sensors.velocity_angle_rad.",
        )  # fmt: skip
    drift, std = complex(found.others[0]), float(np.hypot(*found.others_std[0]))
    if abs(drift) > max(TUNING.certain * std, TUNING.way_matters * speed):
        toward = float(np.degrees(np.angle(-drift)) % 360.0)
        yield Finding(
            name="current_mps", value=abs(drift), std=std, rest=found.rest,
            text=f"the positions move at {with_std(abs(drift), std)} m/s towards {toward:.0f} degrees beyond u_mps and "
            "v_mps: are these through the water, and not over ground?",
        )  # fmt: skip
    yield from _place_or_delay(own, found, speed, length_m=length_m)


def _place_or_delay(batches: Sequence[Batch], found: Relation, speed: float, *, length_m: float) -> Iterator[Finding]:
    """Where the positions are measured, or how late the velocities come; at one speed these are the same."""
    arm, spread = -complex(found.others[1] / found.ratio), found.others_std[1] / abs(found.ratio)
    both = relation(stretches(batches, [_moving_late(batch) for batch in batches], length_m=length_m))
    if both is not None:
        delay, std = -float((both.others[2] / both.ratio).real), float(both.others_std[2, 0] / abs(both.ratio))
        if abs(delay) > max(TUNING.certain * std, TUNING.delay_matters * batches[0].sample_time_s):
            arm, spread = -complex(both.others[1] / both.ratio), both.others_std[1] / abs(both.ratio)
            later, sooner = ("u_mps and v_mps", "the positions")[:: 1 if delay > 0 else -1]
            yield Finding(
                name="velocity_delay_s", value=delay, std=std, rest=both.rest,
                text=f"{later} come {with_std(abs(delay), std)} s later than {sooner}.",
            )  # fmt: skip
    little = TUNING.place_matters * length_m + TUNING.delay_matters * batches[0].sample_time_s * speed
    if abs(arm) > max(TUNING.certain * float(np.hypot(*spread)), little):
        ahead, beside = ("forward" if arm.real >= 0 else "aft"), ("starboard" if arm.imag >= 0 else "port")
        late = "u_mps and v_mps come" if arm.real > 0 else "the positions come"
        yield Finding(
            name="position_forward_m", value=float(arm.real), std=float(spread[0]), rest=found.rest,
            text=f"the positions are those of a place {with_std(abs(arm.real), spread[0])} m {ahead} and "
            f"{with_std(abs(arm.imag), spread[1])} m to {beside} of where u_mps and v_mps are measured"
            + (f", or {late} {abs(arm.real) / speed:.2g} s late." if abs(arm.real) > abs(arm.imag) else "."),
        )  # fmt: skip


def course_as_heading(batches: Sequence[Batch], *, length_m: float, drifts: float) -> Iterator[Finding]:
    """Whether the heading is the course over ground: the bow points where the ship goes, in her turns too.

    Args:
        batches: with positions.
        length_m: of the ship.
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
    if expected < TUNING.turning or seen > TUNING.on_track * expected:
        return
    if abs(pivot) + 2.0 * std < TUNING.on_course * drifts:
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


def _moving(batch: Batch) -> Array:
    """(k, 4) those of `log_against_positions`."""
    assert batch.pose is not None
    bow = np.exp(1j * batch.pose[:, 2])
    through = integral(bow * (batch.velocity[:, 0] + 1j * batch.velocity[:, 1]), batch)
    return np.column_stack([through, batch.pose[:, 0] + 1j * batch.pose[:, 1], batch.time_s, bow])


def _moving_late(batch: Batch) -> Array:
    """(k, 5) the same, and the velocity."""
    rows = _moving(batch)
    return np.column_stack([rows, rows[:, 3] * (batch.velocity[:, 0] + 1j * batch.velocity[:, 1])])


def _drifting(batch: Batch) -> Array:
    """(k, 5) those of `course_as_heading`: way to the side, heading, way ahead, way of a current to the side."""
    assert batch.pose is not None
    heading = batch.pose[:, 2]
    middle = np.exp(-0.5j * (heading[1:] + heading[:-1]))
    way = np.cumsum(np.append(0.0, middle * np.diff(batch.pose[:, 0] + 1j * batch.pose[:, 1])))
    stream = np.cumsum(np.append(0.0, middle)) * batch.sample_time_s
    return np.column_stack([way.imag, heading, way.real, stream.real, stream.imag])


def stretches(batches: Sequence[Batch], running: Sequence[Array], *, length_m: float) -> list[Array]:
    """Changes (k, n) of running values over windows, in stretches of which one after the other is left out."""
    windows = [_window(batch, length_m) for batch in batches]
    changes = [_changes(values, window) for values, window in zip(running, windows, strict=True)]
    alone = sum(len(part) / window for part, window in zip(changes, windows, strict=True)) / TUNING.windows
    count = min(TUNING.blocks, int(alone))
    size = max(1.0, sum(map(len, changes)) / max(count, 1))
    return (
        [piece for part in changes if len(part) for piece in np.array_split(part, max(1, round(len(part) / size)))]
        if count
        else []
    )


def _changes(values: Array, window: int) -> Array:
    """Changes over every window of so many samples, where both ends are measured."""
    steps = values[window:] - values[:-window]
    return np.asarray(steps[np.isfinite(steps).all(axis=1)], dtype=complex)


def _window(batch: Batch, length_m: float) -> int:
    """Samples in which the ship sails about her length."""
    speed = float(np.nanmedian(np.hypot(*batch.velocity[:, :2].T))) if np.isfinite(batch.velocity[:, :2]).any() else 0.0
    seconds = min(TUNING.longest_window_s, TUNING.lengths * length_m / max(speed, 1e-9))
    return max(TUNING.window_samples, round(seconds / batch.sample_time_s))


def integral(values: Array, batch: Batch) -> Array:
    """(k,) running integral over time, by the trapezoidal rule."""
    means = (values[1:] + values[:-1]) / 2.0
    return np.cumsum(np.append(0.0, means)) * batch.sample_time_s


def _rms(values: Array) -> float:
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else 0.0


def with_std(value: float, std: float) -> str:
    """A value with its standard error, to as many digits."""
    digits = max(0, 1 - int(np.floor(np.log10(std)))) if std > 0 else 3
    return f"{value:.{digits}f} \N{PLUS-MINUS SIGN} {std:.{digits}f}"
