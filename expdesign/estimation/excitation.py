"""The excitation condition, and the samples of each equation that meet it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.regression import (
    AIR,
    Integers,
    Layout,
    Polynomial,
    Rows,
    SignalTable,
    Table,
    lift,
    measured_table,
    model_for,
    symbol,
)
from expdesign.estimation.values import Residuals
from expdesign.signals import Batch, Record
from expdesign.values import Array, frozen_set
from expdesign.vessel import Operators, Sensors, VesselModel
from expdesign.vessel.structures import Expression

WORST_CASE_SIGMAS = 3.0  # standard deviations of Gaussian noise in the excitation condition


# The excitation condition: values inside a modulus keep their sign and exceed the worst noise.
#
# Then moduli are signs, the noise enters the equations as in a polynomial model, and zero-mean instruments remove what
# it leaves. The check goes sample by sample and says which ones break the condition.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, assumptions A5 and A7, (5.8), (5.54), (5.72), (5.77).

STATES = ("u", "v", "r", *AIR)


@dataclass(frozen=True, kw_only=True)
class WorstCase:
    """Largest magnitudes, zero for absent disturbances."""

    # velocity_mps, yaw_rate_radps, wind_sensor_mps: measurement noise of u and v, of r, and of the relative wind
    velocity_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    wind_sensor_mps: float = 0.0
    current_mps: float = 0.0  # speed of the current
    wind_mps: float = 0.0  # speed of the wind; counts only where no wind is measured

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < np.inf:
                raise InputError(f"worst case {name} is {value:g}, expected 0 or more")


def worst_case(sensors: Sensors, *, current_mps: float = 0.0, wind_mps: float = 0.0) -> WorstCase:
    """`WORST_CASE_SIGMAS` standard deviations of the sensors, and the strongest current and wind."""
    return WorstCase(
        velocity_mps=WORST_CASE_SIGMAS * sensors.velocity_mps,
        yaw_rate_radps=WORST_CASE_SIGMAS * sensors.yaw_rate_radps,
        wind_sensor_mps=WORST_CASE_SIGMAS * sensors.wind_mps,
        current_mps=current_mps,
        wind_mps=wind_mps,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Breach:
    """One modulus that does not keep its sign over a batch."""

    batch: str  # name of the batch
    inside: str  # what stands in the modulus, e.g. "u".
    parameters: tuple[str, ...]  # whose terms hold it
    margin: float  # how far from zero it had to stay
    samples: Integers  # (j,) samples, from 0, at which it does not
    rows: Integers  # the same as rows of the file; samples again where the batch is not from a file
    count: int  # samples of the batch

    def __post_init__(self) -> None:
        for name in ("samples", "rows"):
            array = np.array(getattr(self, name), dtype=np.int64)
            array.setflags(write=False)
            frozen_set(self, name, array)

    def __str__(self) -> str:
        return (
            f"{self.batch}: {self.inside}, inside an absolute value in the term of {', '.join(self.parameters)}, "
            f"changes sign or comes closer to zero than {self.margin:.3g} in {len(self.samples)} of {self.count} "
            f"samples (rows {_spans(self.rows)})"
        )


def check_excitation(
    record: Record, model: VesselModel, *, worst: WorstCase, wind_measured: bool = False
) -> tuple[Breach, ...]:
    """Every modulus of velocities that breaks the condition, batch by batch; empty when the condition holds.

    Args:
        worst: noise, current and wind.
        wind_measured: air velocities are data; otherwise ship velocities stand for them and must beat the wind.
    """
    driven = model_for(model, record)
    moduli = _moduli(driven, wind_measured)
    return tuple(
        breach
        for batch in record.batches
        for breach in _breaches(batch, measured_table(driven, batch, wind_measured=wind_measured), moduli, worst)
    )


@dataclass(frozen=True, eq=False)
class Sides:
    """On which side of zero what stands in a modulus is."""

    side: Integers  # (k,) 1 or -1 where it is farther from zero than its margin, else 0
    equations: tuple[str, ...]  # whose terms hold the modulus


def clear_sides(model: VesselModel, table: SignalTable, *, worst: WorstCase, wind_measured: bool) -> dict[str, Sides]:
    """Every modulus of velocities, by what stands inside, at every sample of a table of signals.

    Args:
        table: signals (k,) of one batch.
        worst, wind_measured: as in `check_excitation`.
    """
    count = len(table["psi"])
    equation = {term.name: term.equation for term in model.terms}
    found = {}
    for inside, names, windy in _moduli(model, wind_measured):
        values, margin = _values_of(inside, table, count), _margin(inside, worst, windy)
        side = (values > margin).astype(np.int64) - (values < -margin)
        found[str(inside)] = Sides(side, tuple(dict.fromkeys(equation[name] for name in names)))
    return found


Modulus = tuple[Polynomial, tuple[str, ...], bool]
"""Value inside the modulus, its parameters, and whether the margin includes the wind."""


def _moduli(model: VesselModel, wind_measured: bool) -> list[Modulus]:
    found: dict[str, Modulus] = {}
    for term, expression in zip(model.terms, model.expressions, strict=True):
        table = {name: symbol(name) for name in expression.signals}
        unmeasured = not wind_measured and bool(set(AIR) & set(expression.signals))
        if unmeasured:
            table |= {name: symbol(name[0]) for name in AIR}
        for modulus in expression.moduli:
            inside = _as_polynomial(modulus, table)
            if not inside.signals & set(STATES):
                continue
            _, names, windy = found.get(str(inside), (inside, (), False))
            found[str(inside)] = (inside, (*names, term.name), windy or unmeasured)
    return list(found.values())


def _as_polynomial(modulus: Expression, table: SignalTable) -> Polynomial:
    opaque = Operators(lambda x: symbol(f"abs({x})"), lambda x: symbol(f"sin({x})"), lambda x: symbol(f"cos({x})"))
    return lift(modulus.evaluate(table, opaque))


def _breaches(batch: Batch, table: SignalTable, moduli: list[Modulus], worst: WorstCase) -> list[Breach]:
    result = []
    for inside, names, windy in moduli:
        values = _values_of(inside, table, len(batch))
        margin = _margin(inside, worst, windy)
        sign = -1.0 if np.nanmean(np.sign(values)) < 0 else 1.0
        samples = np.flatnonzero(sign * values <= margin)
        if len(samples):
            result.append(
                Breach(
                    batch=batch.name,
                    inside=str(inside),
                    parameters=names,
                    margin=margin,
                    samples=samples,
                    rows=samples + batch.first_row,
                    count=len(batch),
                )
            )
    return result


def _values_of(inside: Polynomial, table: SignalTable, count: int) -> Array:
    functions = {
        f"{name}({signal})": lambda t, f=f, signal=signal: f(t[signal])
        for name, f in (("abs", np.abs), ("sin", np.sin), ("cos", np.cos))
        for signal in table
    }
    return np.broadcast_to(np.asarray(inside.evaluate(table, functions), dtype=float), (count,))


def _margin(inside: Polynomial, worst: WorstCase, windy: bool) -> float:
    """Largest change of a sum of signals by noise; products only have to keep their sign."""
    disturbed = max(worst.velocity_mps, worst.current_mps, worst.wind_mps if windy else 0.0)
    bounds = dict.fromkeys(("u", "v"), disturbed) | dict.fromkeys(AIR, worst.wind_sensor_mps)
    bounds["r"] = worst.yaw_rate_radps
    if any(len(monomial) != 1 for monomial in inside.terms):
        return 0.0
    return sum(abs(factor) * bounds.get(name, 0.0) for (name,), factor in inside.terms.items())


MOST_SPANS = 5  # stretches of rows that a sentence lists


def _spans(rows: Integers) -> str:
    """Rows in short: "3 to 14, 20, 31 to 33 and 7 more stretches"."""
    edges = np.flatnonzero(np.diff(rows) > 1) + 1
    stretches = np.split(rows, edges)
    texts = [f"{part[0]}" if len(part) == 1 else f"{part[0]} to {part[-1]}" for part in stretches[:MOST_SPANS]]
    more = f" and {len(stretches) - MOST_SPANS} more stretches" if len(stretches) > MOST_SPANS else ""
    return ", ".join(texts) + more


# Samples of each equation: those at which what stands inside its moduli keeps its sign.
#
# The moduli of an equation are those of its own terms: of the manoeuvring model, surge has |u|, sway and yaw have |v|.
# Where |u| is clear of zero and |v| is not, a sample is good for surge alone. Every equation therefore has its own
# samples, its own mean of instruments over them, and its own equations to solve.
#
# Samples are chosen by the signals that instruments are simulated from, which owe nothing to the noise of the sample.
# (Chosen by measured velocities, those whose noise is large would be chosen more often near the margin.) Least squares,
# which has no instruments, goes by measured ones.
#
# The mean of a square's noise changes its sign with the modulus. Samples on either side of zero therefore have a mean
# of instruments of their own, or, which is the same, a constant of their own (Lemma 7.1). Nuisance regressors change
# their signs with the modulus, too; they have one sign in a batch, and only samples on that side are used.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, 5.6, (5.72), (5.77).

ALL, EQUATION_WISE = "all", "equation-wise"
SAMPLES = (ALL, EQUATION_WISE)


def with_strata(layout: Layout, rows: Rows, tables: Sequence[Table], *, worst: WorstCase) -> Rows:
    """The rows, of which each equation uses its own samples, in groups by the sides that its moduli are on.

    Args:
        layout: columns; equations are its model's outputs.
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
            raise NotInformative(
                f"no sample keeps {' and '.join(dict.fromkeys(insides[output]))} clear of zero, as the absolute values "
                f"of d{output}/dt need in equation-wise samples; expected data with more offset, a smaller --offset, "
                "or --samples all"
            )
    return strata


def sample_notes(residuals: Residuals) -> tuple[str, ...]:
    """How many samples each equation has, where they differ from all."""
    if (residuals.rows_of == residuals.rows).all():
        return ()
    counts = ", ".join(f"d{name}/dt {count}" for name, count in zip(residuals.outputs, residuals.rows_of, strict=True))
    return (
        f"Equation-wise samples: of {residuals.rows}, {counts}. In the others something inside an absolute value of "
        "the equation is not clear of zero.",
    )
