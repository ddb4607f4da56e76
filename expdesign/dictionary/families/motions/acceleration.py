"""Acceleration on a straight course."""

from __future__ import annotations

from collections.abc import Mapping

from expdesign.dictionary.families.motions.shapes import RAMP_FRACTION, speed_change
from expdesign.dictionary.spec import DURATION, Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    first, last = settings["from_speed_mps"], settings["speed_mps"]
    return speed_change(time_s, first=first, last=last, share=settings["ramp_fraction"])


ACCELERATION = Family(
    name="acceleration",
    summary="from a lower to a higher surge speed on a straight course",
    settings=(
        DURATION,
        Setting(name="speed_mps", meaning="surge speed reached", low=-50, high=50, searched="surge"),
        Setting(
            name="from_speed_mps", meaning="surge speed at the start", default=0.0, low=-50, high=50, searched="surge"
        ),
        RAMP_FRACTION,
    ),
    reference=_reference,
)
