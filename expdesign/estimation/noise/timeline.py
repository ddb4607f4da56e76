"""Rows of a regression in time: stretches without long gaps, and short gaps filled with zeros."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.estimation.regression import Integers, batch_slices
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array

Turn = NDArray[np.complex128]
"""exp(i psi) of headings psi."""
Numbers = TypeVar("Numbers", NDArray[np.float64], Turn)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Rows in a row, with short gaps at most.

    Attributes:
        rows: of the data.
        places: (k,) their sample numbers from the begin of the stretch.
        turn: (t,) exp(i psi) of the heading psi at every sample, zero where one was left out; None without headings.
    """

    rows: slice
    places: Integers
    turn: Turn | None = None

    @property
    def samples(self) -> int:
        """Number of samples from the first to the last, those left out included."""
        return int(self.places[-1]) + 1

    @property
    def padded(self) -> int:
        """Samples with zeros behind, up to a product of small primes: transforms of others may take 20 times longer."""
        return int(scipy.fft.next_fast_len(self.samples))

    def spread(self, rows: Array) -> Array:
        """(t, ...) from (k, ...), zero where a sample was left out."""
        return spread(rows, self.places)


def stretches(batch: Integers, step: Integers, heading: Array | None = None) -> list[Stretch]:
    """Every stretch; long gaps part a batch."""
    result = []
    for rows in batch_slices(batch):
        edges = [
            0,
            *(np.flatnonzero(np.diff(step[rows]) > TUNING.long_gap_samples) + 1).tolist(),
            rows.stop - rows.start,
        ]
        for low, high in pairwise(edges):
            part = slice(rows.start + low, rows.start + high)
            places = step[part] - step[part][0]
            turn = None if heading is None else spread(np.exp(1j * heading[part]), places)
            result.append(Stretch(part, places, turn))
    return result


def spread(rows: Numbers, places: Integers) -> Numbers:
    """(t, ...) from (k, ...), zero where a sample was left out."""
    if len(rows) == places[-1] + 1:
        return rows
    result = np.zeros((places[-1] + 1, *rows.shape[1:]), dtype=rows.dtype)
    result[places] = rows
    return result


@dataclass(frozen=True, eq=False)
class Timeline:
    """All samples from the first to the last of every stretch, those left out included.

    Attributes:
        place: (k,) where each row of the data stands.
        batch, step: (t,) number of the stretch and sample number in it.
    """

    place: Integers
    batch: Integers
    step: Integers

    def spread(self, rows: Array) -> Array:
        """(t, ...) from (k, ...), zero where a sample was left out."""
        if len(rows) == len(self.batch):
            return rows
        result = np.zeros((len(self.batch), *rows.shape[1:]))
        result[self.place] = rows
        return result


def timeline(batch: Integers, step: Integers) -> Timeline:
    """The timeline of rows (k,) with their batch and sample numbers."""
    place, numbers, steps, begin = [], [], [], 0
    for number, part in enumerate(stretches(batch, step)):
        place.append(begin + part.places)
        numbers.append(np.full(part.samples, number))
        steps.append(np.arange(part.samples))
        begin += part.samples
    return Timeline(np.concatenate(place), np.concatenate(numbers), np.concatenate(steps))
