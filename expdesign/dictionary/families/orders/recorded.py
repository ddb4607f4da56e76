"""Recorded or hand-made commands, read from a file and repeated as they are."""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.spec import Excitation, Family, PrimitiveSpec, Setting
from expdesign.dictionary.trim import hold
from expdesign.errors import InputError
from expdesign.vessel import Vessel


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    recorded, settings = request.commands, request.settings
    if recorded is None:
        raise InputError("family 'recorded' needs commands, which a dictionary file gives by the key file")
    if set(recorded.names) != set(vessel.model.inputs):
        raise InputError(
            f"its file commands {', '.join(recorded.names)}, vessel {vessel.name!r} takes "
            f"{', '.join(vessel.model.inputs)}"
        )
    if abs(recorded.sample_time_s - vessel.sample_time_s) > 1e-6 * vessel.sample_time_s:
        raise InputError(
            f"its file has a sample every {recorded.sample_time_s:g} s, vessel {vessel.name!r} takes one every "
            f"{vessel.sample_time_s:g} s"
        )
    values = np.stack([recorded.column(name) for name in vessel.model.inputs], axis=1)
    velocity = np.array([settings["speed_mps"], settings["sway_mps"], settings["yaw_rate_radps"]])
    return Excitation(velocity=velocity, inputs=hold(vessel, velocity), commands=values)


RECORDED = Family(
    name="recorded",
    summary="commands read from a CSV file, recorded or made by hand",
    settings=(
        Setting(name="duration_s", meaning="duration of one run, that of the file", low=1e-3, high=1e5),
        Setting(name="speed_mps", meaning="surge speed at the start", default=0.0, low=-50, high=50),
        Setting(name="sway_mps", meaning="sway speed at the start", default=0.0, low=-20, high=20),
        Setting(name="yaw_rate_radps", meaning="yaw rate at the start", default=0.0, low=-5, high=5),
    ),
    orders=_orders,
)
