"""Errors of models on held-out runs, and searches that found one cause for every key."""

from types import SimpleNamespace

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.select.fitted_candidate import fit_candidate
from expdesign.diagnosis.select.score_tests import ScoreTest
from expdesign.diagnosis.select.selection import Selection, Step
from expdesign.diagnosis.select.starting_point import starting_point

DEVIATION = np.ones((6, 3))
RUNS = np.array([[-1.0], [-1.0], [-1.0], [1.0], [1.0], [1.0]])  # how six runs differ
POSSIBLE = SimpleNamespace(is_possible=lambda _keys: True)


def errors(fit_percent: np.ndarray | float) -> HeldOut:
    """Of six runs with these fits (b, 1) or one fit, all outputs alike."""
    return HeldOut(squared_error=DEVIATION * (1.0 - np.asarray(fit_percent) / 100.0) ** 2, squared_deviation=DEVIATION)


def steps_of(*keys: str) -> Selection:
    """A search that found one cause for every key."""
    steps = [
        SimpleNamespace(
            chosen=SimpleNamespace(
                parameters=(), keys=(key,), fit=key, is_block=False,
                candidate=Candidate(cause="current", free={key: 0.0}),
            ),
            tests=(key,), p_value=1e-4,
        )
        for key in keys
    ]  # fmt: skip
    first, last = SimpleNamespace(keys=()), SimpleNamespace(value=lambda _key: 0.0, ship=POSSIBLE)
    return Selection(steps=tuple(steps), first=first, last=last, last_tests=())  # type: ignore[arg-type]


def added(base, windows, candidate: Candidate) -> Step:
    """A cause that is fitted beside a fit, whatever it gains."""
    scored = ScoreTest(
        candidate=candidate, statistic=0.0, p_value=1.0, step=np.zeros(len(candidate.free)), multiplicity=20.0
    )
    chosen = fit_candidate(base, windows, starting_point(base, scored))
    assert chosen is not None
    return Step(chosen=chosen, p_value=0.0, alternatives=(), before=base, tests=())
