"""Actuators that do not answer small commands."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.actuator_lag import input_groups
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.extended import members

QUANTILES = (0.1, 0.2, 0.35, 0.5)


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if any(key.startswith("deadband:") for key in situation.ship.effects):
        return ()
    inputs = situation.ship.model.inputs
    found = []
    for group in input_groups(situation):
        columns = members(group, inputs)
        if len({inputs[c].rstrip("0123456789") for c in columns}) > 1:
            continue  # inputs of different units share no width
        sizes = np.concatenate([np.abs(rows[:, columns]).ravel() for rows in situation.windows.batch_inputs])
        widths = sorted({float(np.quantile(sizes[sizes > 0], q)) for q in QUANTILES}) if (sizes > 0).any() else []
        grid = tuple(np.unique(np.quantile(sizes[sizes > 0], np.linspace(0.02, 0.7, 30)))) if widths else ()
        found += [
            Candidate(
                cause="actuator_deadband",
                free={f"deadband:{group}": 1.0001 * width},
                finite=True,
                grid=(f"deadband:{group}", tuple(1.0001 * value for value in grid)),
            )
            for width in widths
        ]
    return tuple(found)


def _explain(values: Values) -> str:
    key, value, std = first(values)
    return f"The ship does not answer {key.split(':')[1]} commands smaller than {rounded(value, std)}: a dead band."


ACTUATOR_DEADBAND = Cause(name="actuator_deadband", candidates=_candidates, explain=_explain, suspect="small input")
