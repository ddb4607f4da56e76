"""A yaw model as the ship that is watched: its changes, and their information in stretches of data.

The drives' moment is an input. Of the measured velocities only the yaw rate is an output; an error of its first value
and an unmeasured steady moment are free in every stretch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError
from expdesign.monitoring.changes import RELATIVE_SIZE, Change
from expdesign.monitoring.evidence import STARTS, Grams, stretch_kinds
from expdesign.monitoring.yaw.estimate import LARGEST_RATE, simulate_yaw
from expdesign.monitoring.yaw.model import SAMPLES, WORDS, YawData, YawModel, term_budget, voyages
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import VesselModel

KEY, GAIN = "yaw:", "yaw-gain"
START, PUSH = 1e-4, 1e-3
"""Differences of the first yaw rate [rad/s], and of the moment as a share of its size, for their sensitivities."""
YAW_CHANNEL = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class YawShip:
    """A yaw model with values."""

    model: YawModel  # the structure
    vessel: VesselModel  # model of the ship, for the moment of the drives where none is measured
    parameters: Mapping[str, float]  # value of each
    gain: float = 0.0  # share by which the moment of the drives exceeds what is taken for it

    def get(self, effect: str) -> float:
        """Value of an effect."""
        return self.gain if effect == GAIN else self.parameters[effect.removeprefix(KEY)]

    def with_effects(self, effects: Mapping[str, float]) -> YawShip:
        """The ship with other values of some effects."""
        own = {key.removeprefix(KEY): value for key, value in effects.items() if key != GAIN}
        return replace(self, parameters={**self.parameters, **own}, gain=effects.get(GAIN, self.gain))

    @property
    def values(self) -> Array:
        """(p,) parameters in order."""
        return np.array([self.parameters[name] for name in self.model.parameters])


def yaw_changes(ship: YawShip, *, size: float = RELATIVE_SIZE) -> tuple[Change, ...]:
    """Every parameter, and the moment of the drives.

    Args:
        size: relative change that matters.
    """
    changes = [
        Change(effect=f"{KEY}{name}", size=size * abs(value), unit=(0.01 * value, "%"), words=f"{WORDS[name]} {name}")
        for name, value in zip(ship.model.parameters, ship.values.tolist(), strict=True)
    ]
    return (*changes, Change(effect=GAIN, size=size, unit=(0.01, "%"), words="yaw moment of the drives"))


def ship_of_changes(model: YawModel, vessel: VesselModel, changes: Sequence[Change]) -> YawShip:
    """The ship that changes were made for by `yaw_changes`; InputError where that was another model."""
    values = {change.effect.removeprefix(KEY): 100.0 * change.unit[0] for change in changes if change.effect != GAIN}
    if set(values) != set(model.parameters):
        raise InputError(f"changes are of {', '.join(values)}, expected those of the yaw model {model.name}")
    return YawShip(model=model, vessel=vessel, parameters=values)


def yaw_grams(
    ship: YawShip, record: Record, changes: Sequence[Change], *, begins_s: Sequence[float], stretch_s: float
) -> Grams:
    """Inner products of all stretches of a record, as `monitoring.grams_of` gives them of a whole model.

    Args:
        ship: the model with its values.
        changes: watched for, of `yaw_changes`.
        begins_s: time of the first sample of each batch [s].
        stretch_s: length of a stretch [s].

    Raises:
        InputError: a signal that the model needs is not measured.
    """
    data, begins = voyages(ship.model, ship.vessel, record, length_s=stretch_s, finest_s=stretch_s / SAMPLES)
    data = replace(data, moment=(1.0 + ship.gain) * data.moment)
    rates, slopes = simulate_yaw(ship.model, data, ship.values)
    scale = np.array([change.size for change in changes])
    moved = np.concatenate([slopes, -(slopes @ ship.values)[..., None]], axis=-1) * scale
    n, k = rates.shape
    starts = np.zeros((n, k, STARTS))
    starts[..., YAW_CHANNEL] = (_again(ship, data, first=START) - rates) / START
    pushed = (_again(ship, data, push=ship.get(f"{KEY}I_r") * PUSH) - rates) / PUSH
    columns = np.concatenate([moved, starts, pushed[..., None], (data.r - rates)[..., None]], axis=-1)
    calm = np.abs(rates).max(axis=1) < LARGEST_RATE
    columns = columns[calm]
    products = np.zeros((4, len(columns), columns.shape[-1], columns.shape[-1]))
    products[YAW_CHANNEL] = np.swapaxes(columns, 1, 2) @ columns
    counts = np.zeros((4, len(columns)))
    counts[YAW_CHANNEL] = k
    batch, first = begins.T
    step_s = record.batches[0].sample_time_s
    return Grams(
        time_s=(np.asarray(begins_s)[batch.astype(int)] + first * step_s)[calm],
        duration_s=np.full(len(columns), k * data.sample_time_s),
        products=products,
        counts=counts,
        budget=_budget(ship, data)[calm],
        kind=stretch_kinds(data.u, data.r, data.sample_time_s)[calm],
        stretch_s=stretch_s,
    )


def _budget(ship: YawShip, data: YawData) -> Array:
    """(n, m, 3) as in `Grams`: the angular acceleration, what every term adds to it, and what the drives add."""
    inertia, terms = ship.get(f"{KEY}I_r"), term_budget(ship.model, data, ship.parameters)
    turned = np.gradient(data.r, data.sample_time_s, axis=1)
    sizes = [turned, *(terms[name] / inertia for name in ship.model.parameters[1:]), data.moment / inertia]
    budget = np.zeros((len(data.r), len(sizes), 3))
    budget[..., 2] = np.stack([np.abs(values).mean(axis=1) for values in sizes], axis=-1)
    return budget


def _again(ship: YawShip, data: YawData, *, first: float = 0.0, push: float = 0.0) -> Array:
    """(n, k) yaw rates from another first value, or with a steady moment added."""
    r = np.array(data.r)
    r[:, 0] += first
    return simulate_yaw(ship.model, replace(data, r=r, moment=data.moment + push), ship.values)[0]
