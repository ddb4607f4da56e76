"""Actuators that do not answer small commands."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.causes.actuators.actuator_lag import open_groups
from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel, group_columns
from expdesign.values import Array
from expdesign.vessel import stem

QUANTILES = (0.1, 0.2, 0.35, 0.5)
SHARE, COUNT = 0.75, 40


def between(widths: Array, levels: Array) -> list[float]:
    """Widths moved to the middle between adjacent command levels, which the data cannot resolve further."""
    place = np.clip(np.searchsorted(levels, widths, side="right"), 1, len(levels) - 1)
    return sorted(set(((levels[place - 1] + levels[place]) / 2).tolist()))


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    inputs = situation.ship.model.inputs
    found = []
    for group in open_groups(situation, "deadband"):
        columns = group_columns(group, inputs)
        if len({stem(inputs[c]) for c in columns}) > 1:
            continue  # inputs of different units share no width
        sizes = np.concatenate([np.abs(rows[:, columns]).ravel() for rows in situation.windows.batch_inputs])
        levels = np.unique(sizes[sizes > 0])
        if len(levels) < 3:
            continue  # nothing is small beside the rest
        key = f"deadband:{group}"
        grid = tuple(between(np.quantile(levels, np.linspace(0.0, SHARE, COUNT)), levels))
        found += [
            Candidate(cause="actuator_deadband", free={key: float(width)}, finite=True, positive=True, grid=(key, grid))
            for width in between(np.quantile(sizes[sizes > 0], QUANTILES), levels)
        ]
    return tuple(found)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return f"Commands of {key.split(':')[1]} smaller than {rounded(value, std)} have no effect: a dead band."


ACTUATOR_DEADBAND = Cause(
    name="actuator_deadband",
    summary="actuators that do not answer small commands",
    candidates=_candidates,
    explain=_explain,
)
