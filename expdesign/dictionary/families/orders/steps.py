"""Steps: engine order and helm go to random levels, held for random times."""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, helm_setting, ordered, run_times, steered
from expdesign.dictionary.spec import DURATION, Excitation, Family, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.simulation.helm import steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel


def _levels(rng: np.random.Generator, time_s: Array, hold_s: float, count: int) -> Array:
    """(k,) levels between -1 and 1, each held for an exponential time of mean `hold_s`; `count` of them, 0 for any."""
    many = 8 + int(8 * (time_s[-1] + 1.0) / hold_s)
    changes = np.cumsum(rng.exponential(hold_s, size=many))
    drawn = rng.uniform(-1.0, 1.0, size=many + 1)
    if count:
        drawn = np.floor((drawn + 1.0) / 2.0 * count) * 2.0 / (count - 1) - 1.0
    return np.asarray(drawn[np.searchsorted(changes, time_s)])


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings, time_s = request.settings, run_times(vessel, request)
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    rng = np.random.default_rng(int(settings["draw"]))
    count = round(settings["levels"])
    if count == 1:
        raise InputError("levels is 1, expected 0 for any, or at least 2")
    engine, helm = (_levels(rng, time_s, settings["hold_s"], count) for _ in range(2))
    drive = np.clip(approach.drive + settings["engine_swing"] * engine, -1.0, 1.0)
    return ordered(approach, drive, settings["helm_offset_rad"] + settings["helm_rad"] * helm)


STEPS = Family(
    name="steps",
    summary="engine order and helm step to random levels about the approach's, held for random times",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("largest helm to both sides"),
        Setting(name="hold_s", meaning="mean time between steps", low=1e-2, high=1e5, searched="time"),
        Setting(
            name="engine_swing",
            meaning="largest change of the engine order, as a share of full ahead",
            default=0.0,
            low=0,
            high=2,
            searched="share",
        ),
        Setting(
            name="helm_offset_rad", meaning="steady helm added to it", default=0.0, low=-1.5, high=1.5, searched="helm"
        ),
        Setting(
            name="levels",
            meaning="number of even levels from one side to the other, a whole number: 2 for hard to hard; 0 for any",
            default=0.0,
            low=0,
            high=100,
        ),
        Setting(name="draw", meaning="seed of the random numbers", default=1.0, low=0, high=2**31, searched="draw"),
    ),
    orders=_orders,
)
