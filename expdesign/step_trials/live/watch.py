"""A step trial that is being sailed, row by row: when a step is over, what comes next, what must be repeated.

Values in, values out: the same rows give the same events, whether they come from a file or one by one from a stream.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import NotInformative
from expdesign.signals import Commands
from expdesign.simulation import simulate
from expdesign.step_trials.holds import (
    CHANNELS,
    LEAST_HOLD_S,
    LEAST_HOLD_SAMPLES,
    Hold,
    Sailed,
    changed_words,
    commands_of,
    signed_speed,
)
from expdesign.step_trials.live import values
from expdesign.step_trials.live.step_list import Inputs, Listed, StepList, in_sequence
from expdesign.step_trials.live.values import Event, Finished, Held, Row, State
from expdesign.step_trials.samples import Plateau, plateau, step_sample, with_errors
from expdesign.step_trials.steady_state import (
    LEAST_MEMORY_SAMPLES,
    MEMORY_SHARE,
    MOST_DELAY_S,
    STEADY,
    advanced,
    begun,
    calibrated,
    given_up,
    stepped,
    unseen_after_s,
)
from expdesign.values import Array
from expdesign.vessel import Vessel

LONGEST_HOLD_CONSTANTS = 15.0  # expected time constants after which a hold that is not steady is given up
SETTLING_SHARE = 1 / 3  # beginning of the first hold that is not learnt from
LEAST_PLATEAU_S = 10.0  # time that a steady state is held, for its mean
LONGEST_TURN_S = 60.0  # a whole turn is made where it takes no longer, which takes a current out of the mean
MOST_ATTEMPTS = 3  # at one step of a trial that is being sailed
KEPT_HOLDS = 20  # the latest, whose noise gives the errors of means
GAP_SAMPLE_TIMES = 1.5  # interval, in sample times, from which a trial that is being sailed has a gap


def plateau_of(held: Held, state: State, steps: StepList) -> Plateau:
    """Mean of the rows since a hold has been steady, its errors by the noise of all that were."""
    assert held.steady is not None
    batch = _sailed(held, state.sample_time_s, steps)
    own = plateau(batch, held.steady, len(held.rows))
    found = with_errors([own], [batch.state[-own.samples :]], beside=state.steady)[0]
    # For a time constant with a dead time of its own, the noise would refuse steps that all together make good.
    return replace(found, density=own.density)


def judged(held: Held, state: State, steps: StepList) -> tuple[Plateau, str]:
    """Plateau of a hold, and why its step does not count; "" where it does, and for commands that are only gone to."""
    assert held.steady is not None
    assert held.inputs is not None
    before, after = state.before, plateau_of(held, state, steps)
    batch = _sailed(held, state.sample_time_s, steps)
    if held.step is None:
        return after, ""
    if held.gap_s:
        return after, f"a gap of {held.gap_s:.1f} s in the data"
    standing = steps.commands(held.inputs)
    known = steps.commands(before[0]) if before is not None else standing
    hold = Hold(
        number=held.step.number, batch=0, begin=0, settled=held.stands, end=len(held.rows),
        commands=(standing[0], standing[1]), changed=changed_words(held.changed),
        change=(standing[0] - known[0], standing[1] - known[1]), first=False,
    )  # fmt: skip
    free = (0.0, MOST_DELAY_S)
    sample = step_sample(batch, hold, held.steady, after, before[1] if before else None, (free, free))
    return after, "; ".join(sample.problems)


def _sailed(held: Held, sample_time_s: float, steps: StepList) -> Sailed:
    u, v, r = np.array([row.motion for row in held.rows]).T
    inputs = np.array([row.inputs for row in held.rows])
    return Sailed(
        name="live", sample_time_s=sample_time_s, state=np.stack([signed_speed(u, v), r], axis=1), sway=v,
        commands=commands_of(steps.controls, steps.names, inputs), inputs=inputs,
    )  # fmt: skip


StateAndEvents = tuple[State, tuple[Event, ...]]


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What does not change while a trial is sailed."""

    steps: StepList  # the list
    constants_s: tuple[float, float]  # expected time constants of U and r [s]
    learn_s: float  # time of the first hold from which the noise is learnt [s]
    seed: int = 0  # of the calibration

    @property
    def longest_s(self) -> float:
        """Time after which a hold that is not steady is given up [s]."""
        return LONGEST_HOLD_CONSTANTS * max(self.constants_s)


def beginning(setup: Setup) -> State:
    """The state before the first row."""
    return State(left=setup.steps.steps)


def after_row(state: State, row: Row, setup: Setup) -> StateAndEvents:
    """State after one more row, and the events that it causes."""
    if not state.left:
        return state, ()
    if state.held is not None and row.time_s <= state.held.rows[-1].time_s:
        return replace(state, skipped=state.skipped + 1), ()
    if state.tests is None:
        return _learning(state, row, setup)
    assert state.held is not None
    state, events = _with_row(state, state.held, row, setup)
    state, more = _settled(state, setup)
    state, steady = _judged(state, setup)
    return state, (*events, *more, *steady)


def _learning(state: State, row: Row, setup: Setup) -> StateAndEvents:
    """Rows of the first commands until there are enough for the thresholds."""
    held, steps = state.held, setup.steps
    there = steps.same(row.inputs, steps.start)
    if held is None or not there or not steps.same(held.rows[-1].inputs, steps.start) or _gap_s(held, row):
        event = Event(time_s=row.time_s, kind=values.UNLISTED, inputs=row.inputs, following=(steps.start, None))
        new = held is None or steps.same(held.rows[-1].inputs, steps.start)
        return replace(state, held=Held(rows=(row,))), (event,) if new and not there else ()
    held = replace(held, rows=(*held.rows, row))
    state = replace(state, held=held)
    return _calibrated(state, held, setup) if held.elapsed_s >= setup.learn_s else (state, ())


def _gap_s(held: Held, row: Row) -> float:
    """Length of a gap before a row [s], zero where there is none; judged by the intervals so far."""
    step_s = row.time_s - held.rows[-1].time_s
    usual_s = held.elapsed_s / (len(held.rows) - 1) if len(held.rows) > 2 else math.inf
    return step_s if step_s > GAP_SAMPLE_TIMES * usual_s else 0.0


def _calibrated(state: State, held: Held, setup: Setup) -> StateAndEvents:
    step_s = held.elapsed_s / (len(held.rows) - 1)
    settling = int(len(held.rows) * SETTLING_SHARE)
    speed = _states(held.rows[settling:])
    rng = np.random.default_rng(setup.seed)
    memories = [max(MEMORY_SHARE * constant, LEAST_MEMORY_SAMPLES * step_s) for constant in setup.constants_s]
    try:
        tests = tuple(
            calibrated([column], sample_time_s=step_s, memory_s=memory, rng=rng)
            for column, memory in zip(speed.T, memories, strict=True)
        )
    except NotInformative:
        raise NotInformative(
            f"{setup.learn_s:g} s of the first hold are too short to learn the noise from: give a longer --learn-s"
        ) from None
    watched = tuple(begun(test, float(value)) for test, value in zip(tests, speed[0], strict=True))
    held = replace(held, inputs=setup.steps.start)
    state = replace(state, tests=(tests[0], tests[1]), watched=watched, sample_time_s=step_s, held=held)
    steady = None
    for place, sample in enumerate(speed):
        state = _watching(state, sample)
        steady = place if steady is None and all(part.mode == STEADY for part in state.watched) else steady
    learnt = Event(time_s=held.rows[-1].time_s, kind=values.LEARNT, inputs=setup.steps.start, seconds=step_s)
    if steady is not None:
        held = replace(held, steady=settling + steady, hold_s=LEAST_PLATEAU_S)
    state, events = _judged(replace(state, held=held), setup)
    return state, (learnt, *events)


def _states(rows: tuple[Row, ...]) -> np.ndarray:
    """(k, 2) U and r."""
    u, v, r = np.array([row.motion for row in rows]).T
    return np.stack([signed_speed(u, v), r], axis=1)


def _watching(state: State, sample: np.ndarray) -> State:
    assert state.tests is not None
    watched = tuple(
        advanced(part, test, value)
        for part, test, value in zip(state.watched, state.tests, sample.tolist(), strict=True)
    )
    return replace(state, watched=watched)


def _with_row(state: State, held: Held, row: Row, setup: Setup) -> StateAndEvents:
    """Take a row; a new hold begins where the commands change."""
    assert state.tests is not None
    events: tuple[Event, ...] = ()
    if held.inputs is not None and not setup.steps.same(held.inputs, row.inputs):
        state, events = _ended(state, held, row, setup)
        moved = setup.steps.moved(held.inputs, row.inputs)
        watched = tuple(stepped(part, responds=responds) for part, responds in zip(state.watched, moved, strict=True))
        state, held = replace(state, watched=watched), Held(rows=(row,), changed=moved)
    else:
        gap_s, held = _gap_s(held, row), replace(held, rows=(*held.rows, row))
        if gap_s and not held.over:
            held, state = replace(held, gap_s=max(gap_s, held.gap_s), steady=None), _again(state, row)
            events = (Event(time_s=row.time_s, kind=values.GAP, step=held.step, seconds=gap_s),)
    state = _watching(state, _states((row,))[0])
    assert state.tests is not None
    if held.elapsed_s >= unseen_after_s(state.tests):
        state = replace(state, watched=tuple(map(given_up, state.watched)))
    return replace(state, held=held), events


def _again(state: State, row: Row) -> State:
    """Tests that begin anew after a gap."""
    assert state.tests is not None
    first = _states((row,))[0].tolist()
    return replace(state, watched=tuple(begun(test, value) for test, value in zip(state.tests, first, strict=True)))


def _ended(state: State, held: Held, row: Row, setup: Setup) -> StateAndEvents:
    """Take the last row of a hold; one that was left too early is judged by the rows it has."""
    assert held.inputs is not None
    events: tuple[Event, ...] = ()
    if not held.over and held.steady is not None:
        state, events = _over(state, held, setup, quiet=True)
    elif not held.over:
        state, events = _failed(state, held, "the commands changed before it was steady", row.time_s, setup, quiet=True)
    if held.steady is None:
        return replace(state, before=None), events
    steady = plateau_of(held, state, setup.steps)
    known = (*state.steady, _states(held.rows[-steady.samples :]))[-KEPT_HOLDS:]
    return replace(state, before=(held.inputs, steady), steady=known), events


def _settled(state: State, setup: Setup) -> StateAndEvents:
    """Commands that have stood for long enough, and the step that they are."""
    held, steps = state.held, setup.steps
    assert held is not None
    if held.inputs is not None:
        return state, ()
    now = held.rows[-1]
    if not steps.same(held.rows[held.stands].inputs, now.inputs):
        held = replace(held, stands=len(held.rows) - 1)
    stood = held.rows[held.stands :]
    if stood[-1].time_s - stood[0].time_s < LEAST_HOLD_S or len(stood) < LEAST_HOLD_SAMPLES:
        return replace(state, held=held), ()
    inputs = steps.level(now.inputs) or now.inputs
    before = state.before
    changed = held.changed if before is None else steps.moved(before[0], inputs)
    step = steps.sailed(state.left, before[0] if before else None, inputs)
    held = replace(held, inputs=inputs, step=step, changed=changed)
    state = replace(state, held=held)
    listed = step is not None or inputs in {commands for commands, _ in in_sequence(state.left, None, steps)}
    kind = values.BEGUN if listed else values.UNLISTED
    following = None if listed else _following(state, setup)
    return state, (Event(time_s=now.time_s, kind=kind, step=step, inputs=inputs, following=following),)


def _judged(state: State, setup: Setup) -> StateAndEvents:
    """What follows from the tests: steady, over, or never steady."""
    held = state.held
    assert held is not None
    if held.inputs is None or held.over:
        return state, ()
    now = held.rows[-1].time_s
    if held.steady is not None:
        return _over(state, held, setup) if _held_long_enough(held) else (state, ())
    if all(part.mode == STEADY for part in state.watched):
        turn_s = 2 * math.pi / max(abs(state.watched[1].mean), 1e-9)
        hold_s = turn_s if turn_s <= LONGEST_TURN_S else LEAST_PLATEAU_S
        state = replace(state, held=replace(held, steady=len(held.rows) - 1, hold_s=hold_s))
        event = Event(
            time_s=now, kind=values.STEADY, step=held.step, inputs=held.inputs, seconds=hold_s,
            whole_turn=turn_s <= LONGEST_TURN_S,
            state=(state.watched[0].mean, state.watched[1].mean),
        )  # fmt: skip
        return state, (event,)
    if held.elapsed_s > setup.longest_s:
        state = replace(state, held=replace(held, over=True))
        return _failed(state, replace(held, over=True), f"not steady within {setup.longest_s:.0f} s", now, setup)
    return state, ()


def _held_long_enough(held: Held) -> bool:
    """Whether the time to hold is over; a whole turn must have been turned, or half as much time again passed."""
    assert held.steady is not None
    rows = held.rows[held.steady :]
    passed = rows[-1].time_s - rows[0].time_s
    if held.hold_s <= LEAST_PLATEAU_S or passed < 0.9 * held.hold_s:
        return passed >= held.hold_s
    rates = np.array([row.motion[2] for row in rows])
    turned = abs(float(np.sum(rates))) * passed / (len(rows) - 1)
    return turned >= 2 * math.pi or passed >= 1.5 * held.hold_s


def _over(state: State, held: Held, setup: Setup, *, quiet: bool = False) -> StateAndEvents:
    """A hold that was steady: its step counts, or is bad; `quiet` as in `_failed`."""
    held = replace(held, over=True)
    state = replace(state, held=held)
    now = held.rows[-1].time_s
    assert held.steady is not None
    plateau, why = judged(held, state, setup.steps)
    if why:
        return _failed(state, held, why, now, setup, quiet=quiet)
    u, r = plateau.state.tolist()
    if held.step is not None:
        std = np.hypot(plateau.std, _to_come(held, state, plateau, setup)).tolist()
        done = Finished(
            number=held.step.number, begins_s=held.rows[0].time_s,
            steady_s=held.rows[held.steady].time_s - held.rows[0].time_s, state=(u, r), state_std=(std[0], std[1]),
        )  # fmt: skip
        left = tuple(step for step in state.left if step != held.step)
        state = replace(state, left=left, finished=(*state.finished, done))
    over = Event(
        time_s=now, kind=values.OVER, step=held.step, inputs=held.inputs or (), state=(u, r),
        following=None if quiet else _following(state, setup),
    )  # fmt: skip
    return state, (over, *_end(state, now))


def _to_come(held: Held, state: State, after: Plateau, setup: Setup) -> Array:
    """(2,) by which means of U and r miss what the step still brings; constants are rough, so it is an error."""
    if state.before is None:
        return np.zeros(2)
    assert held.steady is not None
    begin_s, steady_s, end_s = (held.rows[place].time_s for place in (0, held.steady, -1))
    share = still_to_come(np.array(setup.constants_s), passed_s=steady_s - begin_s, lasts_s=end_s - steady_s)
    return np.asarray(np.abs(after.state - state.before[1].state) * share)


def still_to_come(constants_s: Array, *, passed_s: float, lasts_s: float) -> Array:
    """(n,) share of exponential steps that is missing on average, when some time has passed, as long as it lasts."""
    lasts = np.maximum(lasts_s, 1e-9) / constants_s
    return np.asarray(np.exp(-passed_s / constants_s) * -np.expm1(-lasts) / lasts)


def _end(state: State, now: float) -> tuple[Event, ...]:
    return () if state.left else (Event(time_s=now, kind=values.DONE),)


def _failed(state: State, held: Held, why: str, now: float, setup: Setup, *, quiet: bool = False) -> StateAndEvents:
    """A step that does not count: to the end of the list, or left out after too many attempts.

    Args:
        state: with `held`.
        held: what failed.
        now: time [s].
        quiet: the next commands stand already, so that none are told.
    """
    step = held.step
    if step is not None:
        again = step.failed(why)
        rest = tuple(other for other in state.left if other != step)
        if again.attempts < MOST_ATTEMPTS:
            state = replace(state, left=(*rest, again))
        else:
            state = replace(state, left=rest, left_out=(*state.left_out, again))
    kind = values.LEFT_OUT if step is not None and step.attempts + 1 >= MOST_ATTEMPTS else values.BAD
    following = None if quiet else _following(state, setup)
    event = Event(time_s=now, kind=kind, step=step, inputs=held.inputs or (), why=why, following=following)
    return state, (event, *_end(state, now))


def _following(state: State, setup: Setup) -> tuple[Inputs, Listed | None] | None:
    """Commands to set next, and the step that they are."""
    at = state.held.inputs if state.held is not None else None
    return next(iter(in_sequence(state.left, at, setup.steps)), None)


PART_S = 20.0
"""Simulated at a time [s], for a vessel of 1 m; with the square root of the length, as Froude's law has it."""
MOST_PARTS = 8
STILL = 0.01
"""Change in the second half of what was simulated, as a share of all of it, below which the vessel is steady."""


def expected_constants(vessel: Vessel, steps: StepList) -> tuple[float, float]:
    """Time constants of U and r [s]: the upper quartile of the times to 1 - 1/e of the changes that steps make.

    Raises:
        NotInformative: by the model, no step of the throttle changes the speed, or none of the rudder the yaw rate.
    """
    found: tuple[list[float], list[float]] = ([], [])
    motion, at = _passed(vessel, steps.start, np.array([1.0, 0.0, 0.0]))[-1], steps.start
    for step in steps.steps:
        if step.before != at:
            motion = _passed(vessel, step.before, motion)[-1]
        passed = _passed(vessel, step.after, motion)
        motion, at = passed[-1], step.after
        moved = np.diff(commands_of(steps.controls, steps.names, np.array([step.before, step.after])), axis=0)[0]
        state = np.stack([np.hypot(passed[:, 0], passed[:, 1]), passed[:, 2]], axis=1)
        for channel in np.flatnonzero(moved).tolist():
            apart = np.abs(state[:, channel] - state[-1, channel])
            if apart[0] > STILL * np.abs(state[:, channel]).max():
                found[channel].append(float(np.argmax(apart < apart[0] / math.e)) * vessel.sample_time_s)
    for name, state_name, constants in zip(CHANNELS, ("speed", "yaw rate"), found, strict=True):
        if not constants:
            raise NotInformative(
                f"by the model of vessel {vessel.name!r} no step of the {name} in the list changes the {state_name}"
            )
    return float(np.quantile(found[0], 0.75)), float(np.quantile(found[1], 0.75))


def _passed(vessel: Vessel, inputs: Inputs, motion: Array) -> Array:
    """(k, 3) u, v, r under commands that stand, until they hardly change."""
    count = math.ceil(PART_S * math.sqrt(vessel.length_m) / vessel.sample_time_s)
    passed = np.asarray(motion, dtype=float)[None]
    for _ in range(MOST_PARTS):
        commands = Commands(
            sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=np.tile(inputs, (count, 1))
        )
        more = simulate(vessel, commands, velocity=passed[-1]).velocity
        passed = np.concatenate([passed, more[1:]])
        late = passed[len(passed) // 2 :]
        if np.all(np.ptp(late, axis=0) <= STILL * np.maximum(np.abs(late[-1] - passed[0]), 1e-3)):
            break
    return passed
