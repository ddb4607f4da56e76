"""Pull-out: a turn, then helm amidships; the decay of the yaw rate shows whether the ship is stable on course.

Source: ITTC Recommended Procedure 7.5-04-02-01 (2017).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, helm_family, helm_setting
from expdesign.dictionary.spec import DURATION, Family, PrimitiveSpec, Setting
from expdesign.values import Array


def _helm(request: PrimitiveSpec, time_s: Array) -> Array:
    turning = time_s < request.settings["turn_fraction"] * request.settings["duration_s"]
    return np.where(turning, request.settings["helm_rad"], 0.0)


PULL_OUT = Family(
    name="pull_out",
    summary="helm over for a share of the run, then back to the course-keeping angle",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("helm in the turn, positive to starboard", default=float(np.radians(20.0))),
        Setting(
            name="turn_fraction",
            meaning="share of the run with the helm over",
            default=0.5,
            low=0.05,
            high=0.95,
            searched="share",
        ),
    ),
    orders=helm_family(_helm),
)
