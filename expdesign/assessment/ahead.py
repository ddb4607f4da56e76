"""Predictions from measured states, over `AHEAD_S` at a time: their errors, by run, over the spread of each output.

And over as long as a standard trial lasts: the shares of the way sailed and of the heading turned that they miss.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.assessment.misfit import AHEAD_S, whole
from expdesign.conventions import OUTPUTS
from expdesign.estimation.regression import Integers, drive_of, model_for, parts_of
from expdesign.estimation.replay import Compiled, Integration, Stretches, compiled
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Missed, VesselModel

# over the standard deviation of an output: errors that count as no larger, and as no smaller
LARGEST_ERROR, SMALLEST_ERROR = 1.0, 1e-4
TRIAL_LENGTHS = 6.0  # ship lengths sailed in half a turning circle, or from side to side in a zig-zag


class Ahead:
    """Windows of `AHEAD_S` of some runs, ready to be predicted by models of one structure.

    Args:
        model: the structure.
        batches: the runs, as they are to be predicted.
        wind: whether measured wind acts.
        integration: how models are simulated.
        spread: the runs over whose standard deviations errors are, where others than these.
        horizon_s: length of the windows, shorter only where a run is.

    Attributes:
        measured: (k, w, n) velocities in the windows, nan after the end of shorter ones.
    """

    def __init__(
        self,
        model: VesselModel,
        batches: Sequence[Batch],
        *,
        wind: bool,
        integration: Integration,
        spread: Sequence[Batch] | None = None,
        horizon_s: float = AHEAD_S,
    ) -> None:
        """Cut the windows and compile them."""
        driven = model_for(model, Record(batches=tuple(batches)))
        self._places = tuple(OUTPUTS.index(name) for name in driven.outputs)
        windy = wind and all(batch.wind is not None for batch in batches)
        measured, drives, owners = [], [], []
        for number, batch in enumerate(batches):
            states, drive = (
                whole(batch.velocity[:, self._places]),
                drive_of(driven, batch, substeps=integration.substeps),
            )
            if windy and batch.wind is not None:
                drive = np.concatenate([drive, whole(batch.velocity[:, :2] - batch.wind)], axis=1)
            length = min(len(batch), round(horizon_s / batch.sample_time_s) + 1)
            for first in range(0, len(batch) - length + 1, max(1, length - 1)):
                measured.append(states[first : first + length])
                drives.append(drive[first : first + length])
                owners.append(number)
        counts = np.array([len(rows) for rows in measured])
        self.measured, drive = _stacked(measured, counts.max(), np.nan), _stacked(drives, counts.max(), None)
        self.owners: Integers = np.array(owners)
        spread = batches if spread is None else spread
        self._spread = np.stack([self._of_run(batch, spread) for batch in spread])
        self._compiled: Compiled = compiled(
            Stretches(
                model=driven,
                sought=tuple(range(len(driven.names))),
                states=self._places,
                drive=drive,
                windy=windy,
                sample_time_s=batches[0].sample_time_s,
                integrator=integration.integrator,
                substeps=integration.substeps,
                parts=parts_of(batches[0], substeps=integration.substeps),
                counts=counts,
            )
        )

    def _of_run(self, batch: Batch, batches: Sequence[Batch]) -> Array:
        """(n,) standard deviations of a run, of all its pieces, which have its name."""
        pieces = [whole(own.velocity[:, self._places]) for own in batches if own.name == batch.name]
        return np.asarray(np.concatenate(pieces).std(axis=0))

    def predicted(self, models: Sequence[VesselModel | None]) -> Array:
        """(k, w, n) velocities from the first measured ones of each window, each run by a model of its own."""
        n, q = len(self._places), self._compiled.stretches.values
        values = np.zeros((len(models), q + n))
        for row, model in zip(values, models, strict=True):
            row[:q] = np.nan if model is None else model.parameters
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(self._compiled.states(values[self.owners], self.measured[0]))

    def shares(self, models: Sequence[VesselModel | None]) -> Array:
        """(runs, n) errors over standard deviations, each run by a model of its own; at most `LARGEST_ERROR`."""
        with np.errstate(over="ignore", invalid="ignore"):
            squares = (self.predicted(models) - self.measured) ** 2
        seen = np.isfinite(self.measured)
        total, number = np.zeros(self._spread.shape), np.zeros(self._spread.shape)
        np.add.at(total, self.owners, np.where(seen, squares, 0.0).sum(axis=0))
        np.add.at(number, self.owners, seen.sum(axis=0))
        errors = np.sqrt(total / number) / np.where(self._spread > 0, self._spread, np.nan)
        bounded = np.clip(errors, SMALLEST_ERROR, LARGEST_ERROR)
        return np.where(np.isfinite(bounded) | (self._spread == 0), bounded, LARGEST_ERROR)


def _stacked(rows: Sequence[Array], length: int, fill: float | None) -> Array:
    """(L, W, c); shorter ones are filled, with their last row where nothing else is given."""
    parts = []
    for own in rows:
        tail = own[-1:] if fill is None else np.full_like(own[-1:], fill)
        parts.append(np.concatenate([own, np.repeat(tail, length - len(own), axis=0)]))
    return np.stack(parts, axis=1)


def missed(
    models: Sequence[VesselModel | None],
    batches: Sequence[Batch],
    *,
    length_m: float,
    wind: bool,
    integration: Integration,
) -> Missed | None:
    """What predictions as long as a standard trial miss, of all of them together; None where nothing turns.

    A prediction that misses by more than all that was sailed or turned counts as one that misses by all.

    Args:
        models: one of each run, None where there is none.
        batches: the runs, in the frame of the water where its current is known.
        length_m: of the ship.
        wind: whether measured wind acts.
        integration: how models are simulated.
    """
    pairs = [(model, batch) for model, batch in zip(models, batches, strict=True) if model is not None]
    swift = np.sqrt(np.nanmean(np.concatenate([batch.velocity[:, 0] for _, batch in pairs]) ** 2)) if pairs else 0.0
    if not swift > 0 or not {"u", "r"} <= {*pairs[0][0].outputs}:
        return None
    ahead = Ahead(
        pairs[0][0], [batch for _, batch in pairs], wind=wind, integration=integration,
        horizon_s=TRIAL_LENGTHS * length_m / float(swift),
    )  # fmt: skip
    predicted = ahead.predicted([model for model, _ in pairs])
    way, turn = (
        _share(ahead.measured[..., column], predicted[..., column])
        for column in (pairs[0][0].outputs.index(name) for name in ("u", "r"))
    )
    return Missed(way_share=way, turn_share=turn)


def _share(measured: Array, predicted: Array) -> float:
    """By how much sums over windows (k, w) differ, root mean square, over those of sizes."""
    seen = np.isfinite(measured)
    sizes = np.where(seen, np.abs(measured), 0.0).sum(axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.abs(np.where(seen, predicted - measured, 0.0).sum(axis=0))
    apart = np.where(apart < sizes, apart, sizes)  # one that runs away, too
    return float(np.linalg.norm(apart) / np.linalg.norm(sizes)) if sizes.any() else 0.0


def typical(shares: Array) -> Array:
    """(n,) geometric means over runs (runs, n), of those in which an output changes."""
    seen = np.isfinite(shares)
    logs = np.log(np.where(seen, shares, 1.0)).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return np.asarray(np.where(seen.any(axis=0), np.exp(logs), np.nan))


def by_run(shares: Array, names: Sequence[str]) -> Array:
    """(runs,) means of the logarithms of shares (pieces, n), given the run of each piece; nan where none is known."""
    logs, owners = np.log(shares), np.array(names)
    rows = [logs[owners == name] for name in dict.fromkeys(names)]
    return np.array([own[np.isfinite(own)].mean() if np.isfinite(own).any() else np.nan for own in rows])
