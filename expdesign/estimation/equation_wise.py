"""Samples of each equation: those at which what stands inside its moduli keeps its sign.

The moduli of an equation are those of its own terms: of the manoeuvring model, surge has |u|, sway and yaw have |v|.
Where |u| is clear of zero and |v| is not, a sample is good for surge alone. Every equation therefore has its own
samples, its own mean of instruments over them, and its own equations to solve.

Samples are chosen by the signals that instruments are simulated from, which owe nothing to the noise of the sample.
(Chosen by measured velocities, those whose noise is large would be chosen more often near the margin.) Least squares,
which has no instruments, goes by measured ones. A modulus has one sign over all samples whose instruments share a mean:
the mean of a square's noise changes its sign with the modulus, and only then is one constant.

Source: F. Ljungberg, doctoral thesis, Linköping University, 5.6, (5.72), (5.77).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.excitation import WorstCase, clear_sides
from expdesign.estimation.regression import Layout, Mask, Rows, Table
from expdesign.estimation.values import Residuals

ALL, EQUATION_WISE = "all", "equation-wise"
SAMPLES = (ALL, EQUATION_WISE)


def chosen_rows(layout: Layout, rows: Rows, tables: Sequence[Table], *, worst: WorstCase, by_batch: bool) -> Mask:
    """(k, n) which rows of the regression each equation uses.

    Args:
        layout: columns; equations are its model's outputs.
        rows: of the regression.
        tables: signals of each batch, simulated or measured.
        worst: noise, current and wind that signals inside a modulus must exceed.
        by_batch: whether a modulus may have another sign in another batch.

    Raises:
        InputError: a steady current is estimated, which the equations share and which needs no such samples.
        NotInformative: an equation has no samples.
    """
    if layout.guess is not None:
        raise InputError("equation-wise samples are for methods without a steady current; those need no such samples")
    model, wind = layout.model, layout.predictor.wind
    sides = [clear_sides(model, table, worst=worst, wind_measured=wind) for table in tables]
    found = []
    for number, places in enumerate(rows.used):
        own = np.ones((len(places), len(model.outputs)), dtype=bool)
        for inside, modulus in sides[number].items():
            others = [sides[number]] if by_batch else sides
            side = 1 if sum(int(item[inside].side.sum()) for item in others) >= 0 else -1
            clear = modulus.side == side
            if layout.quadrature != "euler":
                clear = clear & np.append(clear[1:], clear[-1:])
            own &= clear[places][:, None] | ~np.isin(model.outputs, modulus.equations)
        found.append(own)
    chosen = np.concatenate(found)
    for output, column in zip(model.outputs, chosen.T, strict=True):
        if not column.any():
            raise NotInformative(_nothing_left(output, [str(i) for i, m in sides[0].items() if output in m.equations]))
    return chosen


def _nothing_left(output: str, insides: Sequence[str]) -> str:
    return (
        f"no sample keeps {' and '.join(insides)} clear of zero, as the absolute values of d{output}/dt need in "
        "equation-wise samples; expected data with more offset, a smaller --offset, or --samples all"
    )


def sample_notes(residuals: Residuals) -> tuple[str, ...]:
    """How many samples each equation has, where they differ from all."""
    if (residuals.rows_of == residuals.rows).all():
        return ()
    counts = ", ".join(f"d{name}/dt {count}" for name, count in zip(residuals.outputs, residuals.rows_of, strict=True))
    return (
        f"Equation-wise samples: of {residuals.rows}, {counts}. In the others something inside an absolute value of "
        "the equation is not clear of zero.",
    )
