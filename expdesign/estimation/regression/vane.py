"""Terms of the wind from a vane: unbiased for noise on its angle.

Gaussian noise of standard deviation s on an angle shrinks its n-th harmonic by exp(-n**2 s**2 / 2). Components of the
wind, n = 1, come divided by exp(-s**2 / 2). In a term of second degree, such as u_q v_q, or |u_q| u_q where u_q keeps
its sign, that leaves the mean over the angle, n = 0, too large by exp(s**2) and the rest, n = 2, too small by as much.
Both are known from the term at the wind turned by 90 degrees.

That is right for instruments. Least squares is biased towards zero by the noise left in its regressors, and more so the
more they are enlarged; it uses the wind as measured.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.47)-(5.50), for components; K. V. Mardia and P. E. Jupp,
Directional Statistics (2000), 3.5.7, for the harmonics of an angle with Gaussian noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.estimation.regression.tables import AIR, Table
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import NUMPY
from expdesign.vessel.expressions import Expression


def with_wind_as_measured(record: Record) -> Record:
    """The record with winds from a vane as it measured them, shrunk by its noise."""
    if not any(batch.vane_std_rad for batch in record.batches):
        return record
    batches = tuple(
        batch
        if batch.wind is None
        else replace(batch, wind=batch.wind * np.exp(-(batch.vane_std_rad**2) / 2.0), vane_std_rad=0.0)
        for batch in record.batches
    )
    return replace(record, batches=batches)


def unbiased_value(expression: Expression, table: Table, std_rad: float) -> Array:
    """(k,) a term of at most second degree in the wind, whose mean over the noise is the term without noise.

    Args:
        expression: of the term.
        table: measured signals, with components of the wind divided by their shrinkage.
        std_rad: of the noise on the vane's angle.
    """
    signs: list[Any] = []

    def recorded(inside: Any) -> Any:
        signs.append(np.sign(inside))
        return np.abs(inside)

    value = expression.evaluate(table, replace(NUMPY, abs=recorded))
    if not set(AIR) & set(expression.signals):
        return np.asarray(value)
    u, v = (table[name] for name in AIR)

    def at(u_q: Array, v_q: Array) -> Any:
        known = iter(signs)  # moduli keep their sign while the wind is turned
        return expression.evaluate({**table, "u_q": u_q, "v_q": v_q}, replace(NUMPY, abs=lambda x: next(known) * x))

    even = (value + at(-u, -v)) / 2
    mean = (even + (at(-v, u) + at(v, -u)) / 2) / 2
    gain = np.exp(std_rad**2)
    return np.asarray(value + (gain - 1.0) * (even - mean) + (1.0 / gain - 1.0) * mean)
