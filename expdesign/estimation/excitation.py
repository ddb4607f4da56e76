"""The excitation condition: values inside a modulus keep their sign and exceed the worst noise.

Then moduli are signs, the noise enters the equations as in a polynomial model, and zero-mean instruments remove what it
leaves. The check goes sample by sample and says which ones break the condition.

Source: F. Ljungberg, doctoral thesis, Linköping University, assumptions A5 and A7, (5.8), (5.54), (5.72), (5.77).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError
from expdesign.estimation.regression import (
    AIR,
    Integers,
    Polynomial,
    SignalTable,
    lift,
    measured_table,
    model_for,
    symbol,
)
from expdesign.estimation.tuning import TUNING
from expdesign.signals import Batch, Record
from expdesign.values import Array, frozen_set
from expdesign.vessel import Operators, Sensors, VesselModel
from expdesign.vessel.expressions import Expression

STATES = ("u", "v", "r", *AIR)


@dataclass(frozen=True, kw_only=True)
class WorstCase:
    """Largest magnitudes, zero for absent disturbances.

    Attributes:
        velocity_mps, yaw_rate_radps, wind_sensor_mps: measurement noise of u and v, of r, and of the relative wind.
        current_mps: speed of the current.
        wind_mps: speed of the wind; counts only where no wind is measured.
    """

    velocity_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    wind_sensor_mps: float = 0.0
    current_mps: float = 0.0
    wind_mps: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < np.inf:
                raise InputError(f"worst case {name} is {value:g}, expected 0 or more")


def worst_case(sensors: Sensors, *, current_mps: float = 0.0, wind_mps: float = 0.0) -> WorstCase:
    """`TUNING.worst_case_sigmas` standard deviations of the sensors, and the strongest current and wind."""
    return WorstCase(
        velocity_mps=TUNING.worst_case_sigmas * sensors.velocity_mps,
        yaw_rate_radps=TUNING.worst_case_sigmas * sensors.yaw_rate_radps,
        wind_sensor_mps=TUNING.worst_case_sigmas * sensors.wind_mps,
        current_mps=current_mps,
        wind_mps=wind_mps,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Breach:
    """One modulus that does not keep its sign over a batch.

    Attributes:
        batch: name of the batch.
        inside: what stands in the modulus, e.g. "u".
        parameters: whose terms hold it.
        margin: how far from zero it had to stay.
        samples: (j,) samples, from 0, at which it does not.
        rows: the same as rows of the file; samples again where the batch is not from a file.
        count: samples of the batch.
    """

    batch: str
    inside: str
    parameters: tuple[str, ...]
    margin: float
    samples: Integers
    rows: Integers
    count: int

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
        record: the data.
        model: whose terms hold the moduli.
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
    """On which side of zero what stands in a modulus is.

    Attributes:
        side: (k,) 1 or -1 where it is farther from zero than its margin, else 0.
        equations: whose terms hold the modulus.
    """

    side: Integers
    equations: tuple[str, ...]


def clear_sides(model: VesselModel, table: SignalTable, *, worst: WorstCase, wind_measured: bool) -> dict[str, Sides]:
    """Every modulus of velocities, by what stands inside, at every sample of a table of signals.

    Args:
        model: whose terms hold the moduli.
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


def _spans(rows: Integers, most: int = 5) -> str:
    """Rows in short: "3 to 14, 20, 31 to 33 and 7 more stretches"."""
    edges = np.flatnonzero(np.diff(rows) > 1) + 1
    stretches = np.split(rows, edges)
    texts = [f"{part[0]}" if len(part) == 1 else f"{part[0]} to {part[-1]}" for part in stretches[:most]]
    more = f" and {len(stretches) - most} more stretches" if len(stretches) > most else ""
    return ", ".join(texts) + more
