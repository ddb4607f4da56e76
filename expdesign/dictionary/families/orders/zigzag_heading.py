"""Zig-zag switched by heading, e.g. 10/10 and 20/20.

Source: IMO MSC.137(76), 6.2; ITTC Recommended Procedure 7.5-04-02-01 (2017).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, helm_setting
from expdesign.dictionary.spec import DURATION, Excitation, Family, PrimitiveSpec, Setting
from expdesign.simulation import Conduct, steady_ahead, zigzag
from expdesign.vessel import Vessel


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings = request.settings
    approach = steady_ahead(vessel, settings["speed_mps"])
    commands, _ = zigzag(
        vessel,
        heading_rad=settings["heading_rad"],
        helm_rad=abs(settings["helm_rad"]),
        side="starboard" if settings["helm_rad"] > 0 else "port",
        conduct=Conduct(speed_mps=settings["speed_mps"], duration_s=settings["duration_s"]),
    )
    return Excitation(velocity=approach.velocity, inputs=approach.inputs, commands=commands.values)


ZIGZAG_HEADING = Family(
    name="zigzag_heading",
    summary="helm to one side until the heading has changed by a given angle, then to the other, and so on",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("helm; positive turns to starboard first", default=float(np.radians(10.0))),
        Setting(
            name="heading_rad",
            meaning="change of heading at which the helm is reversed",
            default=float(np.radians(10.0)),
            low=1e-3,
            high=np.pi,
            searched="heading",
        ),
    ),
    orders=_orders,
    closed_loop=True,
)
