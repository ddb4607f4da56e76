"""The rows of a regression, from the batches of a record and the columns of a layout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import NotInformative
from expdesign.estimation.regression.intervals import mean_between_readings
from expdesign.estimation.regression.nuisance import batch_signs
from expdesign.estimation.regression.predictors import Layout
from expdesign.estimation.regression.regression import Integers, Regression
from expdesign.estimation.regression.tables import heading_of, inputs_within, measured_table
from expdesign.signals import Record
from expdesign.values import Array, closed


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Where the rows of a regression come from.

    Attributes:
        regression: of all batches.
        used: per batch, the samples k - 1 whose regressors are used.
        left_out: number of rows left out because numbers are missing.
    """

    regression: Regression
    used: tuple[Integers, ...]
    left_out: int


def build_regression(layout: Layout, record: Record) -> Rows:
    """The regression of all batches.

    Raises:
        NotInformative: no row is complete.
    """
    used, left_out = [], 0
    columns = [layout.model.outputs.index(name) for name in layout.model.outputs]
    states = [OUTPUTS.index(layout.model.outputs[index]) for index in columns]
    most = sum(len(batch) - 1 for batch in record.batches)
    Phi, y = room_for(most, len(states), len(layout.names)), np.empty((most, len(states)))
    end = 0
    for batch in record.batches:
        table = measured_table(layout.model, batch, wind_measured=layout.predictor.wind)
        ratio = batch.sample_time_s / layout.model.time_scale_s
        signs = batch_signs(layout.nuisance, table)
        within = inputs_within(layout.model, batch)
        regressors = layout.rows(table, signs, used=slice(0, -1), scale=ratio, within=within)
        explained = np.diff(batch.velocity[:, states], axis=0) - ratio * layout.known(table, within)[:-1]
        if batch.interpolated is not None:
            regressors, explained = (
                mean_between_readings(part, batch.interpolated[:, states]) for part in (regressors, explained)
            )
        whole = np.flatnonzero(np.isfinite(regressors).all(axis=(1, 2)) & np.isfinite(explained).all(axis=1))
        places = slice(None) if len(whole) == len(explained) else whole
        start, end = end, end + len(whole)
        Phi[start:end], y[start:end] = regressors[places], explained[places]
        used.append(whole)
        left_out += len(explained) - len(whole)
    if not end:
        raise NotInformative("no pair of successive samples has every signal the predictor needs")
    regression = Regression(
        parameters=layout.names,
        Phi=closed(Phi)[:end],
        y=y[:end],
        batch=np.repeat(np.arange(len(used)), [len(rows) for rows in used]),
        step=np.concatenate(used),
        outputs=layout.model.outputs,
        heading=headings_at(record, used),
    )
    return Rows(regression=regression, used=tuple(used), left_out=left_out)


def room_for(rows: int, outputs: int, columns: int) -> Array:
    """(rows, outputs, columns) without values; every column lies in one piece, so that sums along it are quick."""
    return np.empty((outputs, columns, rows)).transpose(2, 0, 1)


def headings_at(record: Record, used: Sequence[Integers]) -> Array | None:
    """(k,) heading at samples used of each batch, the last one measured where one is missing; None where all are."""
    found = []
    for batch, places in zip(record.batches, used, strict=True):
        heading = heading_of(batch)
        seen = np.isfinite(heading)
        if not seen.any():
            return None
        latest = np.maximum.accumulate(np.where(seen, np.arange(len(seen)), int(seen.argmax())))
        found.append(heading[latest][places])
    return np.concatenate(found)
