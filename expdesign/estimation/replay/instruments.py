"""Instruments: the regressors of a noise-free simulation with the same inputs.

Velocities come from the simulated model in calm water; where wind is used in the wind below, else in calm air. (A ship
that drifts in the wind more than she sails is not followed by a model in calm air, and what does not follow her is a
weak instrument.) Heading is the measured one of the sample before, carried on by the simulated yaw rate: a simulated
heading alone drifts away within minutes, while the measured one of the same sample shares its noise with the
regressors. A steady current that is estimated carries the simulated ship, too. Relative wind is, by choice,

- "lagged": the simulated velocity less the n-frame wind measured a sample before, whose noise the regressors do not
  share. Right for real winds, which last.
- "mean": the simulated velocity less the mean n-frame wind of the batch. A steady wind lets air terms be seen only
  where a modulus changes its sign, and their product not at all.
- "measured": the measured relative wind itself, beside velocities of a model in calm air. What only the wind's
  variation shows is then biased towards zero, by the anemometer's share of that variation; for winds white from sample
  to sample there is nothing else.

Simulations start from the first measured velocity, whose noise is in the first residual too. The first row of every
batch is therefore not used: with it, many short batches are biased by half a standard deviation.

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.37)-(4.39), for velocities.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import rotated
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.estimation.regression import (
    VANE,
    Integers,
    Layout,
    Rows,
    Table,
    batch_signs,
    heading_of,
    inputs_within,
    measured_table,
    room_for,
)
from expdesign.estimation.replay.replay import Replay
from expdesign.signals import Batch, Record, last_seen
from expdesign.simulation import to_body
from expdesign.values import Array, frozen_set
from expdesign.vessel import NUMPY, column_name

SHORTEST_STRETCH = 3  # samples between steered ones that are worth a batch
HEADINGS = ("measured", "simulated")
WINDS = ("lagged", "mean", "measured")


@dataclass(frozen=True, eq=False)
class InstrumentModel:
    """Everything that stays the same while the instruments are refined."""

    layout: Layout  # columns
    record: Record  # the data
    rows: Rows  # which samples the regression uses
    replay: Replay  # simulates the batches
    heading: str = "measured"  # one of `HEADINGS`
    wind: str = "lagged"  # one of `WINDS`
    # per batch, the table of measured signals and the signs that its moduli have
    measured: tuple[tuple[Table, dict[str, float]], ...] = field(init=False)

    def __post_init__(self) -> None:
        if self.heading not in HEADINGS:
            raise UnknownName("heading of instruments", self.heading, known=HEADINGS)
        if self.wind not in WINDS:
            raise UnknownName("wind of instruments", self.wind, known=WINDS)
        model, predictor = self.layout.model, self.layout.predictor
        tables = [measured_table(model, batch, wind_measured=predictor.wind) for batch in self.record.batches]
        signed = tuple((table, batch_signs(self.layout.nuisance, table)) for table in tables)
        frozen_set(self, "measured", signed)

    def instruments(self, parameters: Array) -> Array:
        """(k, n, p) instruments from a model with all parameters (all,) in model order.

        Raises:
            Diverged: that model is unstable.
        """
        if len(self.record.batches) == 1:
            return self._batch(0, parameters)
        Phi = self.rows.regression.Phi
        instruments, end = room_for(*Phi.shape), 0
        for index in range(len(self.record.batches)):
            part = self._batch(index, parameters)
            start, end = end, end + len(part)
            instruments[start:end] = part
        return instruments

    def _batch(self, index: int, parameters: Array) -> Array:
        batch, (_, signs) = self.record.batches[index], self.measured[index]
        ratio = batch.sample_time_s / self.layout.model.time_scale_s
        return self.layout.rows(
            self.table(index, parameters),
            signs,
            used=_run(self.rows.used[index]),
            scale=ratio,
            within=inputs_within(self.layout.model, batch),
        )

    def table(self, index: int, parameters: Array) -> Table:
        """Signals of a batch that instruments are made from, for a model with all parameters (all,).

        Raises:
            Diverged: that model is unstable.
        """
        batch, wind = self.record.batches[index], self.layout.predictor.wind
        blown = wind and self.wind != "measured"
        air_n = instrument_wind(batch, self.wind) if blown else None
        guess = self.layout.guess
        current_to = None if guess is None else guess.to_mps
        states = self.replay.states(batch, parameters, None if air_n is None else air_n.T, current_to)
        psi = states[:, 2] if self.heading == "simulated" else carried_heading(heading_of(batch), states[:, 2])
        u, v, r = states[:, 3:].T
        air = u, v
        if wind and self.wind == "measured":
            assert batch.wind is not None  # the regression was built from it
            air = batch.wind.T[0], batch.wind.T[1]
        elif wind:
            u_w, v_w = to_body(instrument_wind(batch, self.wind), psi, NUMPY)
            air = u - u_w, v - v_w
        moved = {"u": u, "v": v, "r": r, "u_q": air[0], "v_q": air[1], "psi": psi}
        table, _ = self.measured[index]
        return {name: values for name, values in ({**table, **moved}).items() if name != VANE}  # no noise of a vane


def apart_from_start(rows: Rows) -> Rows:
    """Rows without the first pair of samples of every batch, whose noise the instruments share.

    Raises:
        NotInformative: nothing is left.
    """
    regression = rows.regression
    later = np.flatnonzero(regression.step_of > 0)
    if not len(later):
        raise NotInformative("instruments need batches of at least three samples")
    return replace(rows, regression=regression.at(_run(later)), used=tuple(places[places > 0] for places in rows.used))


def _run(places: Integers) -> Integers | slice:
    """Places as a slice, where none is left out between them."""
    if not len(places):
        return slice(0, 0)
    whole = len(places) == places[-1] - places[0] + 1
    return slice(int(places[0]), int(places[-1]) + 1) if whole else places


def carried_heading(measured: Array, simulated: Array) -> Array:
    """(k,) last heading measured before each sample plus the simulated turn since; nothing measured: as simulated."""
    if not np.isfinite(measured).any():
        return simulated
    before = _seen_before(np.isfinite(measured))
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
    wind = np.stack(rotated((u, v), heading))
    if kind == "mean":
        return np.repeat(wind[:, seen].mean(axis=1, keepdims=True), len(batch), axis=1)
    return np.asarray(wind[:, _seen_before(seen)])


def _seen_before(seen: NDArray[np.bool_]) -> Integers:
    """(k,) the latest sample before each one at which something was seen; before the first, the first."""
    latest = last_seen(seen)
    return np.concatenate([latest[:1], latest[:-1]])


# Samples whose inputs follow the ship's motion: left out, or with instruments from the commands as planned.
#
# Instruments simulated from inputs are valid where those inputs owe nothing to the disturbances. An autopilot, or a
# helmsman on a track, answers with the inputs to what the disturbances did: with a current that lasts, instruments from
# such inputs are correlated with the residual for as long as the current lasts. The commands as planned do not depend
# on it, and drive the same ship. How the ship was steered is not known here, so the planned commands drive the model in
# open loop; with a known controller they would drive the closed loop. That changes how strong instruments are, not
# whether they are valid. Headings and winds of instruments stay the measured ones, as elsewhere.
#
# Where steered samples are left out, what remains of a batch is simulated from its own first measured velocity, as
# every batch is.
#
# Source: closed-loop instrumental variables from an external signal, T. Söderström and P. Stoica, Instrumental Variable
# Methods for System Identification (1983), and M. Gilson and P. Van den Hof, Automatica 41 (2005), 241-249.

AUTO, USE, LEAVE_OUT, PLANNED = "auto", "use", "leave-out", "planned"
STEERED = (AUTO, USE, LEAVE_OUT, PLANNED)


@dataclass(frozen=True)
class Steered:
    """What became of steered samples."""

    samples: int  # marked as steered
    of: int  # all samples
    treatment: str  # "use", "leave-out" or "planned"


def treatment_of(record: Record, choice: str, *, instruments: bool) -> Steered:
    """What to do with the steered samples of a record.

    Args:
        choice: one of `STEERED`; "auto" for planned commands where there are some, else left out, in methods with
            instruments, and for use in others.
        instruments: whether the method has instruments.

    Raises:
        InputError: planned commands are asked for and a batch with steered samples has none.
    """
    marked = [batch for batch in record.batches if batch.steered is not None and batch.steered.any()]
    unplanned = [batch for batch in marked if batch.planned is None]
    planned = not unplanned
    if choice == PLANNED and unplanned:
        columns = ", ".join(f"planned_{column_name(name)}" for name in unplanned[0].input_names)
        raise InputError(f"{unplanned[0].name} has steered samples and no planned inputs, expected {columns}")
    treatment = choice
    if choice == AUTO:
        treatment = (PLANNED if planned else LEAVE_OUT) if instruments else USE
    elif choice == PLANNED and not instruments:
        treatment = USE
    count = sum(int(batch.steered.sum()) for batch in marked if batch.steered is not None)
    return Steered(samples=count, of=sum(map(len, record.batches)), treatment=treatment)


def open_loop(record: Record) -> Record:
    """The stretches without steered samples, each a batch.

    Raises:
        NotInformative: there are none.
    """
    parts = [part for batch in record.batches for part in _open_stretches(batch)]
    if not parts:
        raise NotInformative(
            "all samples are marked as steered and the data have no columns of planned inputs (planned_...); "
            "--steered use keeps them"
        )
    return replace(record, batches=tuple(parts))


def _open_stretches(batch: Batch) -> list[Batch]:
    if batch.steered is None or not batch.steered.any():
        return [batch]
    edges = np.flatnonzero(np.diff(np.concatenate([[1.0], batch.steered, [1.0]])))
    return [
        replace(batch.cut(slice(begin, end)), name=f"{batch.name}, sample {begin + 1} to {end}")
        for begin, end in edges.reshape(-1, 2).tolist()
        if end - begin >= SHORTEST_STRETCH
    ]


def as_planned(record: Record) -> Record:
    """The record with planned inputs in place of the measured ones of steered samples."""
    return replace(record, batches=tuple(map(_as_planned, record.batches)))


def _as_planned(batch: Batch) -> Batch:
    if batch.steered is None or batch.planned is None or not batch.steered.any():
        return batch
    places, m = batch.steered > 0, batch.planned.shape[1]
    inputs = batch.inputs.copy()
    inputs[places, :m] = batch.planned[places]
    delivered = batch.delivered
    if delivered is not None:
        values = delivered.values.copy()
        values[places, :, :m] = batch.planned[places, None]
        delivered = replace(delivered, values=values)
    return replace(batch, inputs=inputs, delivered=delivered)
