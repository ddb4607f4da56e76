"""A record cut into holds: stretches in which throttle and rudder stand still."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.signals import Batch
from expdesign.values import Array, frozen_set, seal

CONSTANT_SHARE = 0.02  # of a command's range, within which it counts as held
# least_hold_s, least_hold_samples: shorter holds belong to the change of command that follows
LEAST_HOLD_S = 3.0
LEAST_HOLD_SAMPLES = 6

CHANNELS = ("throttle", "rudder")  # commands; the first drives the speed U, the second the yaw rate r
COLUMNS = ("state", "sway", "commands", "inputs", "heading", "surge")  # of a record, one row for each sample
ASTERN_SHARE = 0.5  # of the speed, that is astern where a vessel goes astern
THROTTLES, RUDDERS = ("n", "tau_x"), ("rudder", "a", "tau_psi")


@dataclass(frozen=True, kw_only=True)
class Controls:
    """Which signals are the two commands."""

    throttle: tuple[str, ...]  # signals whose mean drives the vessel
    rudder: tuple[str, ...] = ()  # signals whose mean turns it
    # half the difference of the first and the last throttle turns it, as with two fixed propellers
    differential: bool = False

    @property
    def words(self) -> tuple[str, str]:
        """Both commands in words."""
        turns = f"({self.throttle[0]} - {self.throttle[-1]})/2" if self.differential else _mean(self.rudder)
        return _mean(self.throttle), turns


def _mean(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"mean of {', '.join(names)}"


def controls_of(names: Sequence[str], throttle: Sequence[str] = (), rudder: Sequence[str] = ()) -> Controls:
    """The commands among the inputs of a record: those asked for, else by the kinds of actuators.

    Raises:
        UnknownName: a signal that the record lacks.
        InputError: no signal drives, or none turns.
    """
    for name in (*throttle, *rudder):
        if name not in names:
            raise UnknownName("input signal", name, known=names)
    drives = tuple(throttle) or _first_kind(names, THROTTLES)
    if not drives:
        raise InputError(f"the inputs {', '.join(names)} have no throttle, expected n1 or tau_x, or --throttle")
    turns = tuple(rudder) or _first_kind([name for name in names if name not in drives], RUDDERS)
    if turns:
        return Controls(throttle=drives, rudder=turns)
    if len(drives) > 1:
        return Controls(throttle=drives, differential=True)
    raise InputError(f"the inputs {', '.join(names)} have no rudder, expected rudder1, a1, tau_psi or n2, or --rudder")


def _first_kind(names: Sequence[str], kinds: Sequence[str]) -> tuple[str, ...]:
    found = [tuple(name for name in names if name.rstrip("0123456789") == kind) for kind in kinds]
    return next(filter(None, found), ())


@dataclass(frozen=True, kw_only=True, eq=False)
class Sailed:
    """One uninterrupted record of a step trial."""

    name: str  # of the batch
    sample_time_s: float  # time between samples [s]
    state: Array  # (k, 2) speed over ground U [m/s] and yaw rate r [rad/s]
    sway: Array  # (k,) [m/s], nan where it is not known
    commands: Array  # (k, 2) throttle and rudder, in the units of their signals
    inputs: Array  # (k, m) all inputs of the record
    # (k,) [rad]; when left out, the yaw rate summed up from an unknown heading
    heading: Array = field(default_factory=lambda: np.zeros(0))
    surge: Array = field(default_factory=lambda: np.zeros(0))  # (k,) u [m/s], negative astern; U when left out
    compass: bool = False  # whether the heading was measured
    current_covariance: Array = field(default_factory=lambda: np.zeros((2, 2)))  # of a steady current N, E [m2/s2]

    def __post_init__(self) -> None:
        if not len(self.heading):
            frozen_set(self, "heading", np.cumsum(self.state[:, 1]) * self.sample_time_s)
        if not len(self.surge):
            frozen_set(self, "surge", self.state[:, 0])
        seal(
            self, state="k 2", sway="k", commands="k 2", inputs="k m", heading="k", surge="k", current_covariance="2 2"
        )

    @property
    def time_s(self) -> Array:
        """(k,) from zero [s]."""
        return np.asarray(np.arange(len(self.state)) * self.sample_time_s, dtype=float)


def commands_of(controls: Controls, names: Sequence[str], inputs: Array) -> Array:
    """(k, 2) throttle and rudder of inputs (k, m)."""
    column = dict(zip(names, inputs.T, strict=True))
    throttle = np.mean([column[name] for name in controls.throttle], axis=0)
    if controls.differential:
        rudder = (column[controls.throttle[0]] - column[controls.throttle[-1]]) / 2
    else:
        rudder = np.mean([column[name] for name in controls.rudder], axis=0)
    return np.stack([throttle, rudder], axis=1)


def sailed(batch: Batch, controls: Controls) -> Sailed:
    """Speed, yaw rate and the two commands of a batch."""
    u, v, r = batch.velocity.T
    speed = np.where(np.isfinite(v), np.hypot(u, np.nan_to_num(v)), np.abs(u))
    known = batch.pose is not None and np.isfinite(batch.pose[:, 2]).all()
    return Sailed(
        name=batch.name,
        sample_time_s=batch.sample_time_s,
        state=np.stack([speed, r], axis=1),
        sway=v,
        commands=commands_of(controls, batch.input_names, batch.inputs),
        inputs=batch.inputs,
        heading=batch.pose[:, 2] if batch.pose is not None and known else np.zeros(0),
        surge=u,
        compass=bool(known),
    )


@dataclass(frozen=True, kw_only=True)
class Hold:
    """Commands that stand still."""

    number: int  # counted through all batches, from 1
    batch: int  # index of the batch
    begin: int  # sample at which the commands began to change towards these
    settled: int  # sample from which on they stand
    end: int  # sample after the last
    commands: tuple[float, float]  # throttle and rudder
    changed: str  # what changed before it: "throttle", "rudder", "both", or "" for nothing
    change: tuple[float, float]  # signed change of throttle and rudder
    first: bool  # of its batch
    astern: bool = False  # the vessel goes astern, or is ordered to, in it or in the hold that it begins from

    @property
    def channel(self) -> int | None:
        """0 for a throttle step, 1 for a rudder step, None for others."""
        return CHANNELS.index(self.changed) if self.changed in CHANNELS else None


def holds_of(batches: Sequence[Sailed]) -> tuple[Hold, ...]:
    """All holds, in order.

    Raises:
        NotInformative: there are less than three.
    """
    values = np.concatenate([batch.commands for batch in batches])
    width = np.maximum(CONSTANT_SHARE * np.ptp(values, axis=0), 1e-9)
    ahead = throttle_sign(batches)
    found: list[Hold] = []
    for index, batch in enumerate(batches):
        own = list(_holds(batch, index, width, first=len(found) + 1))
        gone = [_astern(batch, one, ahead * one.commands[0] < -width[0]) for one in own]
        from_ = [False, *gone][: len(own)]
        found += [replace(one, astern=yes or was) for one, yes, was in zip(own, gone, from_, strict=True)]
    if len(found) < 3:
        raise NotInformative(
            f"the commands stand still in {len(found)} stretches of at least {LEAST_HOLD_S:g} s, expected three "
            "or more: this is no step trial"
        )
    return tuple(found)


def throttle_sign(batches: Sequence[Sailed]) -> float:
    """+1, or -1 where a negative throttle drives ahead."""
    return 1.0 if sum(float(batch.commands[:, 0] @ batch.surge) for batch in batches) >= 0 else -1.0


def _holds(batch: Sailed, index: int, width: Array, *, first: int) -> Iterator[Hold]:
    least = max(LEAST_HOLD_SAMPLES, round(LEAST_HOLD_S / batch.sample_time_s))
    stretches = [part for part in _constant(batch.commands, width) if part[1] - part[0] >= least]
    before: tuple[int, tuple[float, float]] | None = None
    for number, (settled, end) in enumerate(stretches, start=first):
        throttle, rudder = np.median(batch.commands[settled:end], axis=0).tolist()
        change = (0.0, 0.0) if before is None else (throttle - before[1][0], rudder - before[1][1])
        yield Hold(
            number=number, batch=index, begin=settled if before is None else before[0], settled=settled, end=end,
            commands=(throttle, rudder), changed="" if before is None else _changed(change, width), change=change,
            first=before is None,
        )  # fmt: skip
        before = (end, (throttle, rudder))


def signed_speed(u: Array, v: Array) -> Array:
    """(k,) speed [m/s], negative where a vessel goes astern; v is nan where it is not known."""
    speed = np.hypot(u, np.nan_to_num(v))
    return np.asarray(np.where(u < -ASTERN_SHARE * speed, -speed, speed))


def ahead_only(batch: Sailed, sign: float) -> Sailed:
    """The longest stretch of a batch that is sailed ahead and ordered ahead: throttle times a sign, not below 0."""
    least = -CONSTANT_SHARE * float(np.ptp(batch.commands[:, 0]))
    gone = (sign * batch.commands[:, 0] < least) | (batch.surge < -ASTERN_SHARE * batch.state[:, 0])
    if not gone.any():
        return batch
    edges = np.flatnonzero(np.concatenate([[True], gone, [True]]))
    longest = int(np.argmax(np.diff(edges)))
    kept = slice(int(edges[longest]), int(edges[longest + 1]) - 1)
    return replace(batch, **{name: getattr(batch, name)[kept] for name in COLUMNS})


def _astern(batch: Sailed, hold: Hold, ordered: bool) -> bool:
    """Whether a hold's throttle is astern, or the vessel goes astern at its end, more so than sideways or by noise."""
    end = slice(hold.end - max(1, (hold.end - hold.settled) // 3), hold.end)
    return ordered or float(batch.surge[end].mean()) < -ASTERN_SHARE * float(batch.state[end, 0].mean())


def levels_of(values: Array, sample_time_s: float) -> tuple[Array, Array]:
    """(n, m) commands that stand still in turn, of commands (k, m) at every sample, and (n,) for how long [s]."""
    width = np.maximum(CONSTANT_SHARE * np.ptp(values, axis=0), 1e-9)
    least = max(LEAST_HOLD_SAMPLES, round(LEAST_HOLD_S / sample_time_s))
    parts = [part for part in _constant(values, width) if part[1] - part[0] >= least]
    levels = np.array([np.median(values[begin:end], axis=0) for begin, end in parts])
    lengths = np.array([(end - begin) * sample_time_s for begin, end in parts])
    return levels.reshape(len(parts), values.shape[1]), lengths


def _constant(commands: Array, width: Array) -> Iterator[tuple[int, int]]:
    """Longest stretches within `width` of their first sample, one after the other."""
    begin, jumps = 0, np.abs(np.diff(commands, axis=0)) > 0
    moves = np.append(np.flatnonzero(jumps.any(axis=1)) + 1, len(commands)).tolist()
    for move in moves:
        if move == len(commands) or (np.abs(commands[move] - commands[begin]) > width).any():
            yield begin, move
            begin = move


def _changed(change: tuple[float, float], width: Array) -> str:
    throttle, rudder = (np.abs(change) > width).tolist()
    return changed_words((throttle, rudder))


def changed_words(moved: tuple[bool, bool]) -> str:
    """What changed: "throttle", "rudder", "both", or "" for nothing."""
    return "both" if all(moved) else next((name for name, yes in zip(CHANNELS, moved, strict=True) if yes), "")
