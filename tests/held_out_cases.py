"""Errors of models on held-out runs, and searches that found one cause for every key."""

from types import SimpleNamespace

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.fit.held_out import HeldOut
from expdesign.diagnosis.select.selection import Selection

DEVIATION = np.ones((6, 3))
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
