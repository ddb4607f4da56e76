"""A change of parameters during a run; between separate runs much else may differ."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel

COUNT = 12
FINER = 6
EDGE = 0.06
"""Share of a run at either end in which no change is tested."""


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if "change:time" in situation.ship.effects or not windows.starts:
        return ()
    end = float(windows.time_s.max())
    outputs = situation.ship.model.outputs
    effects = ["change:gain", "change:damping", *(f"change:damping_{name}" for name in outputs)]
    spacing = end / (COUNT + 1)
    found = []
    for time in np.linspace(0.0, end, COUNT + 2)[1:-1].tolist():
        _, begin, length = windows.place(time)
        inside = begin + EDGE * length, begin + (1.0 - EDGE) * length
        finer = np.clip(time + spacing * np.linspace(-1, 1, 2 * FINER + 1), *inside)
        found += [
            Candidate(
                cause="change_point",
                free={key: 0.0},
                fixed={"change:time": float(np.clip(time, *inside))},
                grid=("change:time", tuple(np.unique(finer).tolist())),
                above={"change:time": begin},
                below={"change:time": begin + length},
            )
            for key in effects
        ]
    return tuple(found)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    time, std = values["change:time"]
    rest = {key: pair for key, pair in values.items() if key != "change:time"}
    words = ", ".join(f"{key.split(':')[1]} by {rounded(100 * v, 100 * s)} %" for key, (v, s) in rest.items())
    return f"The model is correct until {rounded(time, std)} s. After that the data show changes: {words}."


CHANGE_POINT = Cause(
    name="change_point",
    summary="a change of parameters during a run; between separate runs much else may differ",
    candidates=_candidates,
    explain=_explain,
)
