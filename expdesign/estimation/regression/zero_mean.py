"""Zero-mean instruments: without their mean, constants and even moments of the noise drop out of the IV equations.

Subtracting the mean over the complete data equals adding one constant nuisance parameter per output, subtracting it
per batch equals one constant per output and batch (Lemmas 7.1 and 7.2). The complete way never has more variance.

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.40), (7.19), (7.20).
"""

from __future__ import annotations

import numpy as np

from expdesign.errors import UnknownName
from expdesign.estimation.regression.regression import Integers
from expdesign.values import Array

MEANS = ("none", "batch", "complete")


def subtract_mean(rows: Array, batch: Integers, mean: str) -> Array:
    """Rows (k, ...) without their mean over the complete data, or over each batch; "none" returns them as they are.

    Raises:
        UnknownName: `mean` is not one of `MEANS`.
    """
    if mean not in MEANS:
        raise UnknownName("instrument mean", mean, known=MEANS)
    if mean == "none":
        return rows
    if mean == "complete":
        return np.asarray(rows - rows.mean(axis=0))
    result = rows.copy()
    for number in np.unique(batch):
        chosen = batch == number
        result[chosen] -= rows[chosen].mean(axis=0)
    return result
