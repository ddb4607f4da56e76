"""A change of parameters during the trial."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel

COUNT = 12
FINER = 6
EDGE = 0.06
"""Share of the data at either end in which no change is tested."""


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    if "change:time" in situation.ship.effects:
        return ()
    end = float(situation.windows.time_s.max())
    times = np.linspace(0.0, end, COUNT + 2)[1:-1]
    outputs = situation.ship.model.outputs
    effects = ["change:gain", "change:damping", *(f"change:damping_{name}" for name in outputs)]
    spacing = end / (COUNT + 1)
    return tuple(
        Candidate(
            cause="change_point",
            free={key: 0.0},
            fixed={"change:time": float(time)},
            grid=(
                "change:time",
                tuple(
                    np.clip(time + spacing * np.linspace(-1, 1, 2 * FINER + 1), EDGE * end, (1 - EDGE) * end).tolist()
                ),
            ),
        )
        for time in times
        for key in effects
    )


def _explain(values: Values, _ship: ExtendedModel) -> str:
    time, std = values["change:time"]
    rest = {key: pair for key, pair in values.items() if key != "change:time"}
    words = ", ".join(f"{key.split(':')[1]} by {rounded(100 * v, 100 * s)} %" for key, (v, s) in rest.items())
    return f"The model is correct until {rounded(time, std)} s. After that the data show changes: {words}."


CHANGE_POINT = Cause(name="change_point", candidates=_candidates, explain=_explain)
