"""What stretches of data hold: inner products of the sensitivities and the error of their simulations.

A stretch has the error e = X d + S a + R g + F f + noise: of the measured velocities from a simulation of the model,
with the changes d, the error a of the initial velocities, of which nothing is known, the unmeasured force f, a steady
current and steady accelerations. Noise, too, are how much these accelerations grow within the stretch and the drift of
a gyro, g.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.data import cut_windows
from expdesign.diagnosis.fit import effect_disturbances
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import (
    Disturbance,
    LinearisedMotion,
    disturbance_of,
    linearise,
    responses,
    simulate_from_measured,
    start_responses,
)
from expdesign.monitoring.changes import Change
from expdesign.monitoring.compass import RATE, turned
from expdesign.monitoring.noise import WHITE, Noise, learnt_noise, whitened
from expdesign.signals import Batch, Record
from expdesign.values import Array, seal, sealed

STRETCH_S = 60.0  # length of the stretches that are simulated [s], for a ship of `length_m`
LENGTH_M = 20.0  # see there [m]
FEWEST_SAMPLES = 15  # measured samples of a stretch that is judged
STILL_MPS, STILL_MPS2 = 0.3, 1e-3  # speed and acceleration by propulsion below which a ship lies still [m/s, m/s2]
# change of heading in a stretch that counts as a turn [rad], and of speed, as a share
TURNED_RAD, GAINED_SHARE = 0.26, 0.15
LARGEST_SPEED = 100.0  # speed beyond which a simulation has diverged [m/s, rad/s]


STARTS = 3
KINDS = ("steady course", "turning", "changing speed", "turning and changing speed")
"""Of stretches, by what the ship does in them."""
CURRENT = ("current:north", "current:east")
FEWEST_ROWS = 4  # of a batch that is simulated
PER_CURRENT = 1e-3  # difference of a current for its sensitivity [m/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Grams:
    """Inner products of the sensitivities and the error of w stretches, by channel."""

    time_s: Array  # (w,) beginning of each stretch, since the data began [s]
    duration_s: Array  # (w,) measured time in it [s]: `stretch_s`, or less where the data end or pause
    # (h, w, c, c) of the columns X (m), S (3), R, F and e, for u, v, r, the rate of the heading and, but for models of
    # yaw alone, what it adds up to beyond r, see `compass`
    products: Array
    counts: Array  # (h, w) measured samples
    # (w, m, 3) mean size of what the term of every change adds to the accelerations [m/s2, rad/s2]; of inertia, the
    # acceleration itself; zero for changes that are no term
    budget: Array
    kind: NDArray[np.int64]  # (w,) number in `KINDS`
    stretch_s: float  # length of a whole one [s]
    ramps: int = 0  # columns R
    winds: int = 0  # accelerations that keep their direction on the earth, the first of the columns F
    pushes: int = 0  # steady accelerations, the last of them
    # (w,) draught over depth, where it is measured and the model does not read it; else zero
    shoal: Array = field(default_factory=lambda: np.zeros(0))
    heading: Array = field(default_factory=lambda: np.zeros(0))  # (w,) mean in each [rad], nan where it is not known
    # (w,) mean speed of the air past the ship [m/s], where it is measured; else zero
    wind_mps: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        for name, value in (("shoal", 0.0), ("heading", math.nan), ("wind_mps", 0.0)):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(len(self.time_s), value))
        shapes = {name: "w" for name, axis in _ALONG.items() if axis == 0 and name != "kind"}
        seal(self, **(shapes | {"products": "h w c c", "counts": "h w", "budget": "w m 3"}))

    @property
    def changes(self) -> int:
        """Their number m."""
        return int(self.budget.shape[1])

    def __len__(self) -> int:
        return len(self.time_s)

    def part(self, stretches: slice) -> Grams:
        """Some of the stretches."""
        places = {name: (slice(None),) * axis + (stretches,) for name, axis in _ALONG.items()}
        return replace(self, **{name: getattr(self, name)[place] for name, place in places.items()})

    @property
    def forces(self) -> int:
        """Number of components of the unmeasured force."""
        return int(self.products.shape[-1] - self.changes - STARTS - self.ramps - 1)


_ALONG = {
    "time_s": 0, "duration_s": 0, "products": 1, "counts": 1, "budget": 0, "kind": 0, "shoal": 0, "heading": 0,
    "wind_mps": 0,
}  # fmt: skip
"""Field of `Grams` -> its axis of stretches."""


def grams_of(
    ship: ExtendedModel,
    record: Record,
    changes: Sequence[Change],
    *,
    begins_s: Sequence[float],
    stretch_s: float,
    noise: Noise = WHITE,
) -> Grams:
    """Inner products of all stretches of a record.

    Left out are stretches whose simulation diverges, with few samples, or of a ship that lies still.

    Args:
        ship: the model with what its file states.
        changes: watched for.
        begins_s: time of the first sample of each batch [s].
        stretch_s: length of a stretch [s].
        noise: within stretches.

    Raises:
        InputError: batches of different sample times.
    """
    return _grams(_simulated(ship, record, changes, begins_s, stretch_s), changes, noise, stretch_s=stretch_s)


Simulated = tuple[LinearisedMotion, Sequence[Disturbance], Array, NDArray[np.bool_], Array]
"""All stretches: motion, changes, columns X, S, F and e (c, w, s, 4), what is measured, and where batches begin."""


def _grams(simulated: Simulated, changes: Sequence[Change], noise: Noise, *, stretch_s: float) -> Grams:
    linear, known, columns, seen, begins = simulated
    windows = linear.motion.windows
    sums, summed = turned(columns, seen, noise, sample_s=windows.sample_s)
    columns = whitened(columns, seen, linear.transition, noise, step_s=windows.step_s)
    budget = _budget(linear, known, changes)
    keep = _usable(linear, seen) & ~_still(linear, budget, changes)
    table = np.moveaxis(columns, (3, 1, 0, 2), (0, 1, 2, 3))[:, keep]  # (4, w, c, s)
    sums = np.moveaxis(sums, 0, 1)[keep]  # (w, c, t)
    begin_s = begins[windows.batch.astype(int)] + windows.first * windows.step_s
    return Grams(
        time_s=begin_s[keep],
        duration_s=_durations(seen, windows.sample_s)[keep],
        products=np.concatenate([table @ np.swapaxes(table, 2, 3), (sums @ np.swapaxes(sums, 1, 2))[None]]),
        counts=np.concatenate([seen.sum(axis=1).T, summed.sum(axis=1)[None]])[:, keep],
        budget=budget[keep],
        kind=stretch_kinds(linear.motion.states[..., 0], linear.motion.states[..., 2], windows.step_s)[keep],
        stretch_s=stretch_s,
        shoal=_shoal(linear)[keep],
        heading=_headings(linear)[keep],
        wind_mps=_wind_mps(linear)[keep],
        ramps=_pushes(linear) + _drifts(linear),
        winds=_winds(linear),
        pushes=_pushes(linear),
    )


def _headings(linear: LinearisedMotion) -> Array:
    """(w,) of `Grams`, within half a turn of north."""
    heading = linear.motion.windows.heading[:, :-1].mean(axis=1)  # the last step is towards the stretch that follows
    heading = np.remainder(heading + np.pi, 2 * np.pi) - np.pi
    return heading if linear.motion.windows.has_heading else np.full(len(heading), math.nan)


def _shoal(linear: LinearisedMotion) -> Array:
    """(w,) of `Grams`."""
    ship, windows = linear.motion.ship, linear.motion.windows
    read = ship.model.reads_depth or any(key.startswith("shallow:") for key in ship.effects)
    if read or not windows.has_depth:
        return np.zeros(len(windows.depth_m))
    return np.asarray((ship.draught_m / windows.depth_m).mean(axis=1))


def _wind_mps(linear: LinearisedMotion) -> Array:
    """(w,) of `Grams`."""
    windows = linear.motion.windows
    if not windows.has_wind:
        return np.zeros(len(windows.wind))
    u, v = np.moveaxis(linear.motion.states[:, :-1, :2] - windows.wind[:, :-1], -1, 0)
    return np.asarray(np.hypot(u, v).mean(axis=1))


def grams_and_noise(
    ship: ExtendedModel,
    record: Record,
    changes: Sequence[Change],
    *,
    begins_s: Sequence[float],
    stretch_s: float,
    known: Noise | None = None,
) -> tuple[Grams, Noise]:
    """`grams_of` with the noise that the record shows within stretches, the known one where it fits; and that noise."""
    simulated = _simulated(ship, record, changes, begins_s, stretch_s)
    noise = _noise_of(simulated, changes, known)
    return _grams(simulated, changes, noise, stretch_s=stretch_s), noise


def _noise_of(simulated: Simulated, changes: Sequence[Change], known: Noise | None) -> Noise:
    linear, acting, columns, seen, _ = simulated
    keep = _usable(linear, seen) & ~_still(linear, _budget(linear, acting, changes), changes)
    windows, first = linear.motion.windows, len(changes) + STARTS
    left = np.s_[first : first + _pushes(linear) + _drifts(linear) + _winds(linear)]
    columns = np.delete(columns, left, axis=0)  # ramps are noise themselves, and a wind within a stretch is a push
    return learnt_noise(
        columns[:, keep], seen[keep], linear.transition[keep], changes=len(changes), sample_s=windows.sample_s,
        known=known,
    )  # fmt: skip


def _simulated(
    ship: ExtendedModel, record: Record, changes: Sequence[Change], begins_s: Sequence[float], stretch_s: float
) -> Simulated:
    parts, begins = _whole_stretches(record, begins_s, stretch_s)
    windows = cut_windows(ship.model, parts, longest_s=stretch_s)
    linear = linearise(simulate_from_measured(ship, windows))
    known = effect_disturbances(linear, [change.effect for change in changes])
    columns = _columns(linear, known, changes)
    error = _compared(linear)
    seen = np.isfinite(error)
    columns = np.where(seen, np.concatenate([columns, np.where(seen, error, 0.0)[None]]), 0.0)
    return linear, known, columns, seen, begins


def _whole_stretches(record: Record, begins_s: Sequence[float], stretch_s: float) -> tuple[Record, Array]:
    """Every batch as one of whole stretches and one of the rest, and when these begin [s]."""
    parts, begins = list[Batch](), list[float]()
    for batch, begin_s in zip(record.batches, begins_s, strict=True):
        samples = max(1, round(stretch_s / batch.sample_time_s))
        whole = len(batch) // samples * samples
        for part in (slice(0, whole), slice(whole, len(batch))):
            if part.stop - part.start >= FEWEST_ROWS:
                parts.append(batch.cut(part))
                begins.append(begin_s + part.start * batch.sample_time_s)
    return replace(record, batches=tuple(parts)), np.array(begins)


def later_part(
    record: Record, begins_s: Sequence[float], since_s: float, stretch_s: float
) -> tuple[Record, tuple[float, ...]]:
    """The whole stretches of a record since a time [s], with the rest, and when their batches begin [s]."""
    parts, begins = list[Batch](), list[float]()
    for batch, begin_s in zip(record.batches, begins_s, strict=True):
        samples = max(1, round(stretch_s / batch.sample_time_s))
        over_s = samples * batch.sample_time_s
        first = samples * max(0, math.ceil((since_s - begin_s) / over_s - 1e-6))
        if len(batch) - first >= FEWEST_ROWS:
            parts.append(batch.cut(slice(first, len(batch))))
            begins.append(begin_s + first * batch.sample_time_s)
    return replace(record, batches=tuple(parts)), tuple(begins)


def _durations(seen: NDArray[np.bool_], sample_s: float) -> Array:
    """(w,) time to the end of the last sample [s] that has a measured channel in (w, s, 4)."""
    numbered = np.arange(1, seen.shape[1] + 1)[:, None] * seen.any(axis=2, keepdims=True)
    return np.asarray(sample_s * numbered.max(axis=(1, 2)))


def _columns(linear: LinearisedMotion, known: Sequence[Disturbance], changes: Sequence[Change]) -> Array:
    """(m + 3 + o + q, w, s, 4) responses to changes of their sizes, initial velocities, ramps and the force."""
    moved = responses(linear, [*known, *_forces(linear)])
    moved[: len(changes)] *= np.array([change.size for change in changes])[:, None, None, None]
    first = len(changes) + _pushes(linear)
    drift = np.zeros((_drifts(linear), *moved.shape[1:]))
    drift[..., RATE] = 1.0
    starts = start_responses(linear.motion, linear.transition)
    return np.concatenate([moved[: len(changes)], starts, moved[len(changes) : first], drift, moved[first:]])


def _compared(linear: LinearisedMotion) -> Array:
    """(w, s, 4) error; the rate of the heading within stretches only, so that each stands alone."""
    error = linear.motion.error.copy()
    error[:, [0, -1], STARTS] = np.nan
    return error


def _usable(linear: LinearisedMotion, seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(w,) stretches with a simulation and with enough samples."""
    calm = np.abs(linear.motion.states).max(axis=(1, 2)) < LARGEST_SPEED
    return np.asarray(calm & (seen[..., :STARTS].any(axis=2).sum(axis=1) >= FEWEST_SAMPLES))


def _budget(linear: LinearisedMotion, known: Sequence[Disturbance], changes: Sequence[Change]) -> Array:
    """(w, m, 3) of `Grams`."""
    budget = np.zeros((len(linear.motion.states), len(changes), 3))
    for place, (one, change) in enumerate(zip(known, changes, strict=True)):
        if one.force is not None and change.whole:
            budget[:, place] = abs(change.whole) * np.abs(one.force[..., :3]).mean(axis=1)
    return budget


def _still(linear: LinearisedMotion, budget: Array, changes: Sequence[Change]) -> NDArray[np.bool_]:
    """(w,) stretches without way and without propulsion: in port or adrift, where the model does not hold."""
    way = np.hypot(linear.motion.states[..., 0], linear.motion.states[..., 1]).mean(axis=1)
    push = np.hypot(*np.moveaxis(budget[:, [change.effect for change in changes].index("gain"), :2], -1, 0))
    return np.asarray((way < STILL_MPS) & (push < STILL_MPS2))


def stretch_kinds(u: Array, r: Array, step_s: float) -> NDArray[np.int64]:
    """(w,) number in `KINDS` of stretches with surge speeds and yaw rates (w, k)."""
    turned = np.abs(r).mean(axis=1) * u.shape[1] * step_s
    gained = np.ptp(u, axis=1) / np.maximum(np.abs(u).max(axis=1), 1e-9)
    return np.asarray((turned > TURNED_RAD) + 2 * (gained > GAINED_SHARE), dtype=np.int64)


def joined(parts: Sequence[Grams]) -> Grams:
    """Stretches of several records as one."""
    columns = {name: [getattr(part, name) for part in parts] for name in _ALONG}
    found: dict[str, Any] = {name: np.concatenate(values, _ALONG[name]) for name, values in columns.items()}
    return replace(parts[0], **found)


def stretch_length(length_m: float) -> float:
    """Length of the stretches [s] for a ship of a length [m]: its motion scales as Froude's law has it."""
    return max(5.0, 5.0 * float(round(STRETCH_S * (length_m / LENGTH_M) ** 0.5 / 5.0)))


def _pushes(linear: LinearisedMotion) -> int:
    """Number of accelerations."""
    return sum(name in linear.motion.ship.model.outputs for name in "uvr")


def _winds(linear: LinearisedMotion) -> int:
    """Number of accelerations that keep their direction on the earth."""
    return 2 * _pushes(linear) * linear.motion.windows.has_heading


def _drifts(linear: LinearisedMotion) -> int:
    """Number of sensors that may drift within a stretch: a gyro beside a compass tells."""
    return int(linear.motion.windows.has_heading and not {"r"} & {*linear.motion.windows.derived})


def _forces(linear: LinearisedMotion) -> list[Disturbance]:
    """Ramps; where a heading is measured, winds and a steady current; and steady accelerations of modelled velocities.

    Ramps are accelerations that grow within the stretch, with variance one in it. Winds are accelerations that go as
    the cosine and the sine of the heading.
    """
    motion = linear.motion
    flows = [
        disturbance_of(linear, motion.ship.with_effects({key: motion.ship.get(key) + PER_CURRENT}), PER_CURRENT)
        for key in CURRENT * motion.windows.has_heading
    ]
    w, k, n = motion.states.shape
    axes = [axis for axis, name in enumerate("uvr") if name in motion.ship.model.outputs]

    def pushes(over: Array) -> list[Disturbance]:
        """Of every axis, as it goes over the steps (w, k - 1) or (k - 1,)."""
        force = over[..., None, None] * np.eye(n)[axes] * np.ones((w, 1, 1, 1))  # (w, k - 1, axes, n)
        return [Disturbance(force=force[:, :, place], sensor=None) for place in range(len(axes))]

    heading = motion.windows.heading[:, : k - 1]
    turned = [np.cos(heading), np.sin(heading)] if motion.windows.has_heading else []
    winds = [one for over in turned for one in pushes(over)]
    return [*pushes(np.sqrt(3.0) * np.linspace(-1.0, 1.0, k - 1)), *winds, *flows, *pushes(np.ones(k - 1))]


@sealed(time_s="w", products="w c c", counts="w", heading="w")
class Stretches:
    """What w stretches hold, for a known noise and whatever their initial velocities are."""

    time_s: Array  # (w,) beginning of each stretch [s]
    products: Array  # (w, c, c) inner products of the columns X (m), F (q) and e, in standard deviations of the noise
    counts: Array  # (w,) measured numbers
    changes: int  # m
    heading: Array  # (w,) as in `Grams`
    winds: int = 0  # columns of winds, the first of F

    def __len__(self) -> int:
        return len(self.time_s)

    def since(self, index: int) -> tuple[float, float]:
        """Time [s] and turn [rad] from the stretch before to one with a number."""
        time_s, turn_rad = (np.diff(values[index - 1 : index + 1]) for values in (self.time_s, self.heading))
        return float(time_s[0]), float(turn_rad[0])

    def less(self, change: Array) -> Stretches:
        """The stretches with the error of a ship that differs by a change (m,), in sizes."""
        after = np.eye(self.products.shape[-1])
        after[: self.changes, -1] = -change
        return replace(self, products=after.T @ self.products @ after)


def stretches_of(grams: Grams, std: Array, ramp: Array) -> Stretches:
    """The stretches for noise with standard deviations (h,) of the channels, infinite where there is none.

    Ramps of the force, and a drift, with variances (o,) are noise, too.

    Source: C. R. Rao, Linear Statistical Inference (1973), section 4a, for mixed linear models.
    """
    m, first = grams.changes, grams.changes + STARTS + grams.ramps
    whole = np.einsum("c,cwij->wij", 1.0 / std**2, grams.products)
    kept = np.r_[:m, first : whole.shape[1]]
    inner = whole[:, m:first, m:first] + np.diag(np.concatenate([np.full(STARTS, 1e-9), 1.0 / ramp]))
    across = whole[:, m:first][:, :, kept]
    left = whole[:, kept][:, :, kept] - np.swapaxes(across, 1, 2) @ np.linalg.solve(inner, across)
    return Stretches(
        time_s=grams.time_s, products=left, counts=grams.counts.sum(axis=0), changes=m, heading=grams.heading,
        winds=grams.winds,
    )  # fmt: skip
