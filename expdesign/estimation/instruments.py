"""Instruments: the regressors of a noise-free simulation with the same inputs.

Velocities come from the simulated model, in calm water and air. Heading is the measured one of the sample before,
carried on by the simulated yaw rate: a simulated heading alone drifts away within minutes, while the measured one of
the same sample shares its noise with the regressors. Relative wind is, by choice,

- "lagged": the simulated velocity less the n-frame wind measured a sample before, whose noise the regressors do not
  share. Right for real winds, which last.
- "mean": the simulated velocity less the mean n-frame wind of the batch. A steady wind lets air terms be seen only
  where a modulus changes its sign, and their product not at all.
- "measured": the measured relative wind itself. What only the wind's variation shows is then biased towards zero, by
  the anemometer's share of that variation; for winds white from sample to sample there is nothing else.

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.37)-(4.39), for velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import InputError, UnknownName
from expdesign.estimation.nuisance import batch_signs
from expdesign.estimation.predictors import Layout, Rows
from expdesign.estimation.regression import Integers
from expdesign.estimation.replay import Replay
from expdesign.estimation.tables import heading_of, inputs_of, measured_table, signal_table
from expdesign.signals import Batch, Record
from expdesign.simulation import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY

HEADINGS = ("measured", "simulated")
WINDS = ("lagged", "mean", "measured")


@dataclass(frozen=True, eq=False)
class InstrumentModel:
    """Everything that stays the same while the instruments are refined.

    Attributes:
        layout: columns.
        record: the data.
        rows: which samples the regression uses.
        replay: simulates the batches.
        heading: one of `HEADINGS`.
        wind: one of `WINDS`.
    """

    layout: Layout
    record: Record
    rows: Rows
    replay: Replay
    heading: str = "measured"
    wind: str = "lagged"

    def __post_init__(self) -> None:
        if self.heading not in HEADINGS:
            raise UnknownName("heading of instruments", self.heading, known=HEADINGS)
        if self.wind not in WINDS:
            raise UnknownName("wind of instruments", self.wind, known=WINDS)

    def instruments(self, parameters: Array) -> Array:
        """(k, n, p) for a model with all parameters (all,) in model order.

        Raises:
            Diverged: that model is unstable.
        """
        parts = [
            self._batch(batch, parameters, used)
            for batch, used in zip(self.record.batches, self.rows.used, strict=True)
        ]
        return np.concatenate(parts)

    def _batch(self, batch: Batch, parameters: Array, used: Integers) -> Array:
        model, wind = self.layout.model, self.layout.predictor.wind
        states = self.replay.states(batch, parameters)
        psi = states[:, 2] if self.heading == "simulated" else carried_heading(heading_of(batch), states[:, 2])
        velocity, air = states[:, 3:], states[:, 3:5]
        if wind and self.wind == "measured":
            assert batch.wind is not None  # the regression was built from it
            air = batch.wind
        elif wind:
            air = air - np.stack(to_body(instrument_wind(batch, self.wind), psi, NUMPY), axis=1)
        table = signal_table(model, velocity, air, psi, inputs_of(model, batch))
        signs = batch_signs(self.layout.nuisance, measured_table(model, batch, wind_measured=wind))
        ratio = batch.sample_time_s / model.time_scale_s
        return np.asarray(ratio * self.layout.rows(table, signs)[used])


def carried_heading(measured: Array, simulated: Array) -> Array:
    """(k,) last heading measured before each sample plus the simulated turn since; nothing measured: as simulated."""
    if not np.isfinite(measured).any():
        return simulated
    before = _last_seen(np.isfinite(measured))
    return np.asarray(measured[before] + simulated - simulated[before])


def instrument_wind(batch: Batch, kind: str) -> Array:
    """(2, k) wind to north/east [m/s] that instruments are made with, "mean" or "lagged".

    Raises:
        InputError: no sample has velocity, relative wind and heading.
    """
    heading = heading_of(batch)
    seen = np.isfinite(heading) & np.isfinite(batch.velocity[:, :2]).all(axis=1)
    if batch.wind is None or not (seen & np.isfinite(batch.wind).all(axis=1)).any():
        raise InputError(f"{batch.name}: instruments for wind need measured relative wind and heading")
    seen &= np.isfinite(batch.wind).all(axis=1)
    u, v = (batch.velocity[:, :2] - batch.wind).T
    c, s = np.cos(heading), np.sin(heading)
    wind = np.stack([u * c - v * s, u * s + v * c])
    if kind == "mean":
        return np.repeat(wind[:, seen].mean(axis=1, keepdims=True), len(batch), axis=1)
    return np.asarray(wind[:, _last_seen(seen)])


def _last_seen(seen: NDArray[np.bool_]) -> Integers:
    """(k,) the latest sample before each one at which something was seen; before the first, the first."""
    count = len(seen)
    latest = np.maximum.accumulate(np.where(seen, np.arange(count), -1))
    before = np.concatenate([[-1], latest[:-1]])
    return np.where(before < 0, int(np.argmax(seen)), before)
