"""Samples of each equation: those at which what stands inside its moduli keeps its sign.

The moduli of an equation are those of its own terms: of the manoeuvring model, surge has |u|, sway and yaw have |v|.
Where |u| is clear of zero and |v| is not, a sample is good for surge alone. Every equation therefore has its own
samples, its own mean of instruments over them, and its own equations to solve.

Samples are chosen by the signals that instruments are simulated from, which owe nothing to the noise of the sample.
(Chosen by measured velocities, those whose noise is large would be chosen more often near the margin.) Least squares,
which has no instruments, goes by measured ones.

The mean of a square's noise changes its sign with the modulus. Samples on either side of zero therefore have a mean of
instruments of their own, or, which is the same, a constant of their own (Lemma 7.1). Nuisance regressors change their
signs with the modulus, too; they have one sign in a batch, and only samples on that side are used.

Source: F. Ljungberg, doctoral thesis, Linköping University, 5.6, (5.72), (5.77).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.excitation import WorstCase, clear_sides
from expdesign.estimation.regression import Integers, Layout, Rows, Table
from expdesign.estimation.values import Residuals

ALL, EQUATION_WISE = "all", "equation-wise"
SAMPLES = (ALL, EQUATION_WISE)


def with_strata(layout: Layout, rows: Rows, tables: Sequence[Table], *, worst: WorstCase) -> Rows:
    """The rows, of which each equation uses its own samples, in groups by the sides that its moduli are on.

    Args:
        layout: columns; equations are its model's outputs.
        rows: of the regression.
        tables: signals of each batch, simulated or measured.
        worst: noise, current and wind that signals inside a modulus must exceed.

    Raises:
        InputError: a steady current is estimated, which the equations share and which needs no such samples.
        NotInformative: an equation has no samples.
    """
    strata = _strata(layout, rows, tables, worst=worst)
    whole = bool((strata == strata[0]).all() and strata.all())
    return replace(rows, regression=replace(rows.regression, strata=None if whole else strata))


def _strata(layout: Layout, rows: Rows, tables: Sequence[Table], *, worst: WorstCase) -> Integers:
    """(k, n) stratum of each row and equation: 0 where it is not used, else a number for the signs of its moduli."""
    if layout.guess is not None:
        raise InputError("equation-wise samples are for methods without a steady current; those need no such samples")
    model, wind = layout.model, layout.predictor.wind
    found, insides = [], dict[str, list[str]]()
    for table, places in zip(tables, rows.used, strict=True):
        own = np.ones((len(places), len(model.outputs)), dtype=np.int64)
        for inside, modulus in clear_sides(model, table, worst=worst, wind_measured=wind).items():
            side = modulus.side
            if layout.nuisance:
                side = np.where(side == (1 if side.sum() >= 0 else -1), side, 0)
            if layout.quadrature != "euler":
                side = np.where(side == np.append(side[1:], side[-1:]), side, 0)
            label = np.where(side == 0, 0, (side + 3) // 2)[places]  # 0, 1 below zero, 2 above
            for equation in modulus.equations:
                column = model.outputs.index(equation)
                own[:, column] = np.where(label == 0, 0, own[:, column] * 2 + label - 2)
                insides.setdefault(equation, []).append(inside)
            own = np.maximum(own, 0)
        found.append(own)
    strata = np.concatenate(found)
    for output, column_of in zip(model.outputs, strata.T, strict=True):
        if not column_of.any():
            raise NotInformative(_nothing_left(output, tuple(dict.fromkeys(insides[output]))))
    return strata


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
