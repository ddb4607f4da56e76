"""Rows of a regression in time: stretches without long gaps, and short gaps filled with zeros."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from expdesign.estimation.regression import Integers, batch_slices
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array


def stretches(batch: Integers, step: Integers) -> list[tuple[slice, Integers]]:
    """Rows of every stretch, and their sample numbers from its begin; long gaps part a batch."""
    result = []
    for rows in batch_slices(batch):
        edges = [
            0,
            *(np.flatnonzero(np.diff(step[rows]) > TUNING.long_gap_samples) + 1).tolist(),
            rows.stop - rows.start,
        ]
        for low, high in pairwise(edges):
            part = slice(rows.start + low, rows.start + high)
            result.append((part, step[part] - step[part][0]))
    return result


def spread(rows: Array, places: Integers) -> Array:
    """(t, ...) from (k, ...), zero where a sample was left out."""
    if len(rows) == places[-1] + 1:
        return rows
    result = np.zeros((places[-1] + 1, *rows.shape[1:]))
    result[places] = rows
    return result


@dataclass(frozen=True, eq=False)
class Timeline:
    """All samples from the first to the last of every stretch, those left out included.

    Attributes:
        place: (k,) where each row of the data stands.
        batch, step: (t,) number of the stretch and sample number in it.
        owner: (s,) place among the batches of each stretch's own.
    """

    place: Integers
    batch: Integers
    step: Integers
    owner: Integers

    def spread(self, rows: Array) -> Array:
        """(t, ...) from (k, ...), zero where a sample was left out."""
        if len(rows) == len(self.batch):
            return rows
        result = np.zeros((len(self.batch), *rows.shape[1:]))
        result[self.place] = rows
        return result


def timeline(batch: Integers, step: Integers) -> Timeline:
    """The timeline of rows (k,) with their batch and sample numbers."""
    place, numbers, steps, owner, begin = [], [], [], [], 0
    known = np.unique(batch)
    for number, (rows, offset) in enumerate(stretches(batch, step)):
        count = int(offset[-1]) + 1
        place.append(begin + offset)
        numbers.append(np.full(count, number))
        steps.append(np.arange(count))
        owner.append(int(np.searchsorted(known, batch[rows.start])))
        begin += count
    return Timeline(np.concatenate(place), np.concatenate(numbers), np.concatenate(steps), np.array(owner))
