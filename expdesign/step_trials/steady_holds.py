"""When each hold of a record was steady, by the ratio test with thresholds calibrated on the record itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.errors import NotInformative
from expdesign.step_trials.holds import Hold, Sailed
from expdesign.step_trials.responses import Transient, fit_first_order
from expdesign.step_trials.steady_state import (
    STEADY,
    RatioTest,
    Watched,
    advanced,
    begun,
    calibrated,
    stepped,
)
from expdesign.step_trials.tuning import TUNING
from expdesign.values import Array

LEAST_MEMORY_SAMPLES = 10


def calibrated_tests(
    batches: Sequence[Sailed], holds: Sequence[Hold], rng: np.random.Generator
) -> tuple[RatioTest, RatioTest]:
    """The tests for U and r: memory from the slower responses, thresholds from the ends of the holds.

    Raises:
        NotInformative: no throttle step or no rudder step shows a response, or holds are too short.
    """
    return _calibrated(batches, holds, 0, rng), _calibrated(batches, holds, 1, rng)


def _calibrated(batches: Sequence[Sailed], holds: Sequence[Hold], channel: int, rng: np.random.Generator) -> RatioTest:
    constants = [
        rough for hold in holds if hold.channel == channel and (rough := _rough(batches[hold.batch], hold, holds))
    ]
    if not constants:
        name, state = (("throttle", "speed"), ("rudder", "yaw rate"))[channel]
        raise NotInformative(
            f"no step of the {name} alone is followed by a change of {state}: expected steps of {name}, one by one, "
            "each held until the vessel is steady"
        )
    step_s = batches[0].sample_time_s
    memory_s = max(TUNING.memory_share * float(np.quantile(constants, 0.75)), LEAST_MEMORY_SAMPLES * step_s)
    ends = [_end(batches[hold.batch], hold, channel) for hold in holds]
    return calibrated(_steadiest(ends), sample_time_s=step_s, memory_s=memory_s, rng=rng)


def _end(batch: Sailed, hold: Hold, channel: int) -> Array:
    first = hold.end - max(4, int(TUNING.steady_share * (hold.end - hold.settled)))
    return np.asarray(batch.state[first : hold.end, channel])


def _steadiest(ends: Sequence[Array]) -> list[Array]:
    """The half of the stretches with the least trend, in units of their own noise."""
    trends = [abs(np.polyfit(np.linspace(-1, 1, len(end)), end, 1)[0]) / (np.std(np.diff(end)) + 1e-12) for end in ends]
    return [end for end, trend in zip(ends, trends, strict=True) if trend <= np.median(trends)]


def _rough(batch: Sailed, hold: Hold, holds: Sequence[Hold]) -> float | None:
    """Time constant of the response [s], plateaus taken from the ends of both holds; None where there is none."""
    assert hold.channel is not None
    before = _end(batch, holds[hold.number - 2], hold.channel)
    after = _end(batch, hold, hold.channel)
    size, noise = after.mean() - before.mean(), np.hypot(before.std(), after.std())
    if abs(size) < 2 * noise:
        return None
    values = batch.state[hold.begin : hold.end, hold.channel]
    time_s = batch.time_s[: len(values)]
    data = Transient(time_s=time_s, values=values, before=float(before.mean()), after=float(after.mean()))
    found = fit_first_order(data, delay_s=(0.0, min(TUNING.most_delay_s, float(time_s[-1]) / 4))).time_constant_s
    return found if found < time_s[-1] else None


def steady_from(
    batches: Sequence[Sailed], holds: Sequence[Hold], tests: tuple[RatioTest, RatioTest]
) -> tuple[int | None, ...]:
    """Sample from which each hold is steady in U and r, None where it never is.

    The signal that the changed command drives must be seen to respond first. A hold whose response is not seen may
    still be steady: it is when both signals have been still for as long as a seen response may take to begin.
    """
    return tuple(
        found
        for index, batch in enumerate(batches)
        for found in _steady_in(batch, [hold for hold in holds if hold.batch == index], tests)
    )


def _steady_in(batch: Sailed, holds: Sequence[Hold], tests: tuple[RatioTest, RatioTest]) -> list[int | None]:
    if not holds:
        return []
    found: list[int | None] = []
    states = tuple(begun(test, float(value)) for test, value in zip(tests, batch.state[holds[0].settled], strict=True))
    for hold in holds:
        states, steady = watched(batch, hold, states, tests)
        found.append(steady)
    return found


def watched(
    batch: Sailed, hold: Hold, states: tuple[Watched, ...], tests: tuple[RatioTest, RatioTest]
) -> tuple[tuple[Watched, ...], int | None]:
    """States of both tests at the end of a hold, and the sample from which it is steady."""
    states = tuple(stepped(state, responds=hold.channel == place) for place, state in enumerate(states))
    patience = unseen_after_s(tests)
    for sample in range(hold.begin, hold.end):
        states = tuple(
            advanced(state, test, float(batch.state[sample, place]))
            for place, (state, test) in enumerate(zip(states, tests, strict=True))
        )
        if (sample - hold.begin) * batch.sample_time_s >= patience:
            states = tuple(given_up(state) for state in states)
        if sample >= hold.settled and all(state.mode == STEADY for state in states):
            rest = [
                (advanced_many(state, test, batch.state[sample + 1 : hold.end, place]))
                for place, (state, test) in enumerate(zip(states, tests, strict=True))
            ]
            return tuple(rest), sample
    return states, None


def advanced_many(state: Watched, test: RatioTest, values: Array) -> Watched:
    """The state after several samples."""
    for value in values.tolist():
        state = advanced(state, test, value)
    return state


def unseen_after_s(tests: tuple[RatioTest, RatioTest]) -> float:
    """Time after which a response that was not seen is no longer waited for [s]."""
    return 4.0 * max(test.memory_s for test in tests)


def given_up(state: Watched) -> Watched:
    """The state, no longer waiting for a response."""
    return stepped(state, responds=False) if state.mode == "waiting" else state
