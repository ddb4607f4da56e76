"""Shallow water: damping and inertia grow with draught over depth."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import rounded
from expdesign.diagnosis.model import ExtendedModel

LEAST_VARIATION = 0.01


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if not windows.has_depth or any(key.startswith("shallow:") for key in situation.ship.effects):
        return ()
    shoal = situation.ship.draught_m / windows.depth_m
    if np.ptp(shoal) < LEAST_VARIATION:
        return ()
    groups = (("damping",), ("inertia",), ("damping", "inertia"))
    return tuple(Candidate(cause="shallow_water", free={f"shallow:{n}": 0.0 for n in group}) for group in groups)


def _explain(values: Values, _ship: ExtendedModel) -> str:
    half = ", ".join(
        f"{key.split(':')[1]} by {rounded(50 * value, 50 * std)} %" for key, (value, std) in values.items()
    )
    return f"The motion depends on the water depth. A depth of twice the draught increases {half}."


SHALLOW_WATER = Cause(
    name="shallow_water",
    summary="shallow water: damping and inertia grow with draught over depth",
    candidates=_candidates,
    explain=_explain,
)
