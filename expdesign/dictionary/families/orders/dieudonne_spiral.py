"""Dieudonne (direct) spiral: the helm goes through steps from one side to the other and back.

Source: ITTC Recommended Procedure 7.5-04-02-01 (2017); J. Dieudonne, Collected French papers on the stability of route
of ships at sea, 1949-1950, DTMB Translation 246 (1953).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, helm_family, helm_setting
from expdesign.dictionary.spec import DURATION, Family, PrimitiveSpec, Setting
from expdesign.values import Array


def _helm(request: PrimitiveSpec, time_s: Array) -> Array:
    steps = round(request.settings["steps"])
    down = np.linspace(1.0, -1.0, 2 * steps + 1)
    levels = np.concatenate([down, down[-2::-1]])  # to the other side and back
    place = (time_s / request.settings["duration_s"] * len(levels)).astype(int)
    return np.asarray(request.settings["helm_rad"] * levels[np.minimum(place, len(levels) - 1)])


DIEUDONNE_SPIRAL = Family(
    name="dieudonne_spiral",
    summary="helm in equal steps from one side to the other and back, each held for the same time",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("largest helm, where it begins; positive to starboard", default=float(np.radians(15.0))),
        Setting(name="steps", meaning="steps of helm to each side, a whole number", default=3.0, low=1, high=50),
    ),
    orders=helm_family(_helm),
)
