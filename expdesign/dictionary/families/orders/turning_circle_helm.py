"""Turning circle of the standard trials: a given helm, held.

Source: IMO MSC.137(76), 6.1 (35 degrees of rudder, or as much as there is).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, helm_family, helm_setting
from expdesign.dictionary.spec import DURATION, Family, PrimitiveSpec
from expdesign.values import Array


def _helm(request: PrimitiveSpec, time_s: Array) -> Array:
    return np.full_like(time_s, request.settings["helm_rad"])


TURNING_CIRCLE_HELM = Family(
    name="turning_circle_helm",
    summary="helm over from a straight approach and held; engines as on the approach",
    settings=(DURATION, APPROACH, helm_setting("helm, positive to starboard", default=float(np.radians(35.0)))),
    orders=helm_family(_helm),
)
