"""Roll of a ship in operation, [roll] of her vessel file: whether she still rolls as in the reference.

The reference gives the parameters of the roll equation, piece by piece, weighted by their covariances. Every later
piece is judged against it (`roll.record`), at a chance of a false alarm that is its share of the time asked for. After
an alarm the next piece settles the size, and is the new reference. After a port call the ship may carry another load:
the next piece raises no alarm, and is the new reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.roll import RollEstimate, Run
from expdesign.roll.record import RollJudgement, judge_roll, record_estimate
from expdesign.values import Array
from expdesign.vessel import RollPendulum, Vessel

MOST_TOLD = 100  # changes that are kept, the latest
PORT_P = 0.01  # chance of a change of the load that is told after a port call where there is none


@dataclass(frozen=True, kw_only=True)
class RollEvent:
    """A change of roll."""

    # since_s, time_s: begin and end of the piece that told it first [s]
    since_s: float
    time_s: float
    after_call: bool  # whether a port call came before, so that it is no alarm
    settled: bool  # whether a whole piece after the change gives the sizes
    p_value: float  # chance of as large a difference without a change
    # causes, sizes, stds, load: of the best explanation, as in `RollChange`; no causes where none is enough
    causes: tuple[str, ...]
    sizes: tuple[float, ...]
    stds: tuple[float, ...]
    load: tuple[float, float] | None
    others: tuple[tuple[str, ...], ...]  # causes of explanations that are about as good
    values: dict[str, float]  # parameters before
    righting_nm: tuple[float, float]  # righting moment before and after [N m/rad]
    mass_kg: float  # of ship and load, before


@dataclass(frozen=True, kw_only=True, eq=False)
class RollWatch:
    """What is known of roll, from piece to piece."""

    free: tuple[str, ...] = ()  # names of the parameters that are estimated from pieces
    # mean, covariance: (p,), (p, p) of the reference; none before the first piece
    mean: Array | None = None
    covariance: Array | None = None
    called: bool = False  # whether a port call came after the last piece
    # judged_s, left_out_s: of the data, judged or not [s]; learnt_s, of the references
    judged_s: float = 0.0
    left_out_s: float = 0.0
    learnt_s: float = 0.0
    reason: str = ""  # why the last piece was left out that was
    # so far; of the last one, if it is not settled, the reference still is the one before
    events: tuple[RollEvent, ...] = ()

    @property
    def alarms(self) -> tuple[RollEvent, ...]:
        """Changes that no port call explains."""
        return tuple(event for event in self.events if not event.after_call)


def roll_learnt(now: RollWatch, ship: Vessel, runs: Sequence[Run]) -> RollWatch:
    """The watch with a piece of the reference added."""
    try:
        found = record_estimate(_pendulum(ship), runs, beam_m=ship.beam_m)
    except (InputError, NotInformative) as error:
        return replace(now, left_out_s=now.left_out_s + _duration(runs), reason=str(error))
    return _with_estimate(now, found, _duration(runs))


def roll_watched(
    now: RollWatch, ship: Vessel, runs: Sequence[Run], *, begin_s: float, end_s: float, mean_time_s: float, called: bool
) -> RollWatch:
    """The watch of roll after another piece of data.

    Args:
        ship: with [roll].
        begin_s, end_s: of the piece [s].
        mean_time_s: average time between false alarms of roll [s].
        called: whether a port call ended within the piece, which then belongs to no load.
    """
    now = replace(now, called=now.called or called)
    if now.mean is None or called:
        return roll_learnt(now, ship, runs) if not called else now
    pending = bool(now.events) and not now.events[-1].settled
    chance = PORT_P if now.called or pending else min(PORT_P, _duration(runs) / mean_time_s)
    try:
        found = judge_roll(_reference(now, ship), runs, beam_m=ship.beam_m, alarm_p=chance)
    except (InputError, NotInformative) as error:
        return replace(now, left_out_s=now.left_out_s + _duration(runs), reason=str(error))
    now = replace(now, judged_s=now.judged_s + _duration(runs))
    if pending:
        return _settled(now, found, runs)
    if not found.changed:
        return replace(now, called=False)
    event = _event(found, begin_s, end_s, after_call=now.called)
    now = replace(now, events=(*now.events, event)[-MOST_TOLD:], called=False)
    return _begun_anew(now, found, runs) if event.settled else now


def _settled(now: RollWatch, found: RollJudgement, runs: Sequence[Run]) -> RollWatch:
    """The last event with what a piece tells that lies after the change; that piece is the new reference."""
    last = now.events[-1]
    event = replace(last, settled=True)
    if found.changed:
        after = _event(found, last.since_s, last.time_s, after_call=last.after_call)
        event = replace(after, settled=True, p_value=last.p_value)
    return _begun_anew(replace(now, events=(*now.events[:-1], event)), found, runs)


def _begun_anew(now: RollWatch, found: RollJudgement, runs: Sequence[Run]) -> RollWatch:
    return _with_estimate(replace(now, mean=None, covariance=None), found.estimate, _duration(runs))


def _with_estimate(now: RollWatch, found: RollEstimate, duration_s: float) -> RollWatch:
    """The reference with one more estimate, weighted by the covariances."""
    mean, covariance = np.array([found.values[name] for name in found.problem.free]), np.asarray(found.covariance)
    if now.mean is not None and now.covariance is not None:
        gain = now.covariance @ np.linalg.inv(now.covariance + covariance)
        mean, covariance = now.mean + gain @ (mean - now.mean), now.covariance - gain @ now.covariance
    learnt_s = now.learnt_s + duration_s
    return replace(now, free=found.problem.free, mean=mean, covariance=covariance, learnt_s=learnt_s, called=False)


def _reference(now: RollWatch, ship: Vessel) -> RollPendulum:
    """The ship's pendulum with the parameters of the reference and their covariance."""
    assert now.mean is not None
    assert now.covariance is not None
    std = np.sqrt(np.diag(now.covariance))
    correlation = now.covariance / np.outer(std, std)
    pendulum = _pendulum(ship)
    return replace(
        pendulum,
        parameters={**pendulum.parameters, **dict(zip(now.free, now.mean.tolist(), strict=True))},
        parameter_std=dict(zip(now.free, std.tolist(), strict=True)),
        parameter_correlation={
            (one, other): float(correlation[i, j])
            for i, one in enumerate(now.free)
            for j, other in enumerate(now.free[:i])
        },
    )  # fmt: skip


def _event(found: RollJudgement, since_s: float, time_s: float, *, after_call: bool) -> RollEvent:
    before = found.pendulum
    best = found.changes[0] if found.changes else None
    return RollEvent(
        since_s=since_s,
        time_s=time_s,
        after_call=after_call,
        settled=after_call,
        p_value=found.p_value,
        causes=best.causes if best else (),
        sizes=best.sizes if best else (),
        stds=best.stds if best else (),
        load=best.load if best else None,
        others=tuple(one.causes for one in found.changes[1:]),
        values=dict(before.parameters),
        righting_nm=(before.righting_nm, best.righting_nm if best else float("nan")),
        mass_kg=before.body.mass_kg + before.load.mass_kg,
    )


def _pendulum(ship: Vessel) -> RollPendulum:
    if ship.pendulum is None:
        raise InputError(f"vessel {ship.name!r} has no [roll], expected a vessel file with it")
    return ship.pendulum


def _duration(runs: Sequence[Run]) -> float:
    return sum(len(run.signals) * run.step_s for run in runs)
