"""Predictors: how measured batches become a regression.

One row per pair of samples: nu(k) - nu(k - 1) is regressed on Phi(k - 1) times sample time over time scale, so that
parameters come out in the model's own form, discrete or continuous. Phi(k - 1) is by choice that of the sample: the
parameters are then those of Euler's map, which differ from the motion's in the first order of the sample time (a decay
of a = 0.35 per sample shows as 1 - exp(-a) = 0.295). Or it is the mean of both ends of the interval under the inputs
held over it, the trapezoidal rule, which leaves an error of second order (2 tanh(a / 2) = 0.346). Either is of second
order in the data, so what holds for instruments, moduli and means holds for both. Every parameter belongs to one
equation. Rows never reach across batches; rows with numbers missing are left out. Parameters held fixed move to the
left side.

`PREDICTORS` are what may be known and unknown of the weather. Without wind, terms of air velocities fall together with
those of water. What is unknown adds nuisance regressors: of current and wind (5.68)-(5.70), of a current beside
measured wind (5.74)-(5.76), of one of them where the other is absent, the derivatives of its terms, as (6.5)-(6.7) for
still water. A steady current is estimated itself, see `nuisance`.

Fewer regressors leave more information about the ship, and a bias where the disturbance is there after all.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.76), (6.5)-(6.10).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.estimation.regression.nuisance import (
    STEADY_CURRENT,
    Guess,
    Nuisance,
    batch_signs,
    headings,
    nuisance_regressors,
    slopes,
    symbolic,
    through_water,
    turned_with,
    unbiased_value,
)
from expdesign.estimation.regression.polynomial import Algebra
from expdesign.estimation.regression.regression import (
    AIR,
    VANE,
    Integers,
    Regression,
    Table,
    heading_of,
    inputs_within,
    measured_table,
)
from expdesign.signals import Batch, Record, last_seen
from expdesign.simulation.motion import turns_current
from expdesign.values import Array, closed
from expdesign.vessel import NUMPY, VesselModel
from expdesign.vessel.structures import MOTION_SIGNALS

NOTHING, CURRENT, WIND, BOTH, STEADY = "nothing", "current", "wind", "both", "steady-current"
UNKNOWN = (NOTHING, CURRENT, WIND, BOTH, STEADY)  # what may be unknown of the weather and is estimated beside the ship


@dataclass(frozen=True)
class Predictor:
    """Signals that the regressors are made from."""

    name: str  # as scenarios have it
    suffix: str  # as methods have it, after the name of their estimator
    title: str  # for tables, after that of an estimator
    wind: bool  # whether measured wind is used
    unknown: str = NOTHING  # one of `UNKNOWN`

    @property
    def disturbances(self) -> tuple[str, ...]:
        """Those that nuisance regressors are added for, of `CURRENT` and `WIND`."""
        return {CURRENT: (CURRENT,), WIND: (WIND,), BOTH: (CURRENT, WIND)}.get(self.unknown, ())

    @property
    def nuisance(self) -> bool:
        """Whether there are nuisance regressors."""
        return bool(self.disturbances)

    @property
    def steady(self) -> bool:
        """Whether a steady current itself is estimated with the parameters."""
        return self.unknown == STEADY


PREDICTORS = (
    Predictor("basic", "", "", wind=False),
    Predictor("basic-wind", "air", " with measured wind", wind=True),
    Predictor("augmented", "augmented", " with unknown current and wind", wind=False, unknown=BOTH),
    Predictor("wind", "wind", " with an unknown current and measured wind", wind=True, unknown=CURRENT),
    Predictor("no-current", "no-current", " with unknown wind and no current", wind=False, unknown=WIND),
    Predictor("no-wind", "no-wind", " with an unknown current and no wind", wind=False, unknown=CURRENT),
    Predictor("steady-current", "current", " with an unknown steady current", wind=False, unknown=STEADY),
    Predictor(
        "steady-current-wind",
        "air-current",
        " with an unknown steady current and measured wind",
        wind=True,
        unknown=STEADY,
    ),
)

Within = Sequence[tuple[float, Table]]
"""Share of each part of a sample, and the signals of its inputs."""
HELD: Within = ((1.0, {}),)
QUADRATURES = ("euler", "trapezoid")
"""Regressors of the sample at which an interval begins, or the mean of both its ends under the inputs held over it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """The columns of the regression."""

    model: VesselModel  # driven by the recorded inputs; its parameters give the values of those held
    predictor: Predictor  # which signals are used
    parameters: tuple[str, ...]  # names estimated
    fixed: tuple[str, ...]  # names held at the model's values
    # names left out because no wind is used: their effect is in other terms' parameters, or nowhere
    merged: tuple[str, ...]
    # those of merged names whose effect is in another term's parameter, and the name of that
    partners: Mapping[str, str]
    nuisance: tuple[Nuisance, ...]  # further regressors
    notes: tuple[str, ...] = field(default=())  # one sentence for each thing that a reader of the estimate must know
    quadrature: str = "euler"  # one of `QUADRATURES`
    # what the columns of a steady current are linearised around; their parameters are what it lacks. None where no
    # current is estimated.
    guess: Guess | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters, then nuisance parameters."""
        return self.parameters + tuple(item.name for item in self.nuisance) + (STEADY_CURRENT if self.guess else ())

    def full_parameters(self, values: Array) -> Array:
        """All parameters (all,) of the model from those estimated: others are held, or zero where merged."""
        full = np.array(self.model.parameters)
        for name, value in zip(self.parameters, values, strict=False):
            full[self.model.names.index(name)] = value
        for name in self.merged:
            full[self.model.names.index(name)] = 0.0
        return full

    def rows(
        self,
        table: Table,
        signs: dict[str, float],
        *,
        used: Integers | slice,
        scale: float,
        within: Within = HELD,
    ) -> Array:
        """(k, n, p) regressors of a table of signals, times a scale, at the samples used.

        `within` are the inputs of parts of samples, as of `inputs_within`.
        """
        first, *rest = self._points(table, within)
        rows = self._rows(first[1], signs, used, first[0] * scale)
        for share, part in rest:
            rows += self._rows(part, signs, used, share * scale)
        return rows

    def _points(self, table: Table, within: Within) -> list[tuple[float, Table]]:
        """Tables whose sum with these weights is the mean over samples: terms run straight from sample to sample."""
        table = self._in_water(table)
        if self.quadrature == "euler":
            return [(1.0, table)]
        after, points, begun = ahead(table), [], 0.0
        for share, inputs in within:
            middle, begun = begun + share / 2.0, begun + share
            points += [(share * (1.0 - middle), {**table, **inputs}), (share * middle, {**after, **inputs})]
        return points

    def _rows(self, table: Table, signs: dict[str, float], used: Integers | slice, scale: float) -> Array:
        places = {name: index for index, name in enumerate(self.model.names)}
        columns = [(self._term(places[name]), self._values(places[name], table)) for name in self.parameters]
        turned = {**table, **signs, **headings(table["psi"])} if self.nuisance else {}
        columns += [(item.equation, item.evaluate(turned)) for item in self.nuisance]
        count = len(table["psi"][used])
        rows = np.zeros((len(self.model.outputs), len(self.names), count)).transpose(2, 0, 1)  # columns in one piece
        row_of = {name: index for index, name in enumerate(self.model.outputs)}
        for index, (equation, values) in enumerate(columns):
            np.multiply(np.broadcast_to(values, table["psi"].shape)[used], scale, out=rows[:, row_of[equation], index])
        if self.guess is not None:
            moved = slopes(self.model, self.guess.parameters, table, turning=self._turning)[:, used]  # (2, k, n)
            np.multiply(moved.transpose(1, 2, 0), scale, out=rows[:, :, len(columns) :])
        return rows

    def _in_water(self, table: Table) -> Table:
        return table if self.guess is None else through_water(table, self.guess.to_mps)

    def known(self, table: Table, within: Within = HELD) -> Array:
        """(k, n) part explained by the parameters held fixed, and by turning in the current that is guessed."""
        return np.asarray(sum(share * self._known(part) for share, part in self._points(table, within)))

    def _known(self, table: Table) -> Array:
        outputs = self.model.outputs
        total = np.zeros((len(table["psi"]), len(outputs)))
        for name in self.fixed:
            place = self.model.names.index(name)
            total[:, outputs.index(self._term(place))] += self.model.parameters[place] * self._values(place, table)
        if self.guess is not None and self._turning:
            total += turned_with(self.model, table, self.guess.to_mps)
        return total

    @property
    def _turning(self) -> bool:
        """As of `simulation.motion_rates`: by the map that belongs to the quadrature."""
        return turns_current(self.quadrature)

    def _term(self, place: int) -> str:
        return self.model.terms[place].equation

    def _values(self, place: int, table: Table) -> Array:
        expression = self.model.expressions[place]
        if VANE in table:
            return unbiased_value(expression, table, float(table[VANE]))
        return np.asarray(expression.evaluate(table, NUMPY))


def ahead(table: Table) -> Table:
    """The table a sample later, with the inputs that were held until then; the last sample stands for itself."""
    moved = {name: np.concatenate([table[name][1:], table[name][-1:]]) for name in (*MOTION_SIGNALS, "psi")}
    return {**table, **moved}


def build_layout(
    model: VesselModel, record: Record, *, predictor: str, fixed: Sequence[str] = (), quadrature: str = "euler"
) -> Layout:
    """Decide the columns for a record.

    Args:
        model: from `tables.model_for`.
        predictor: a name in `PREDICTORS`.
        fixed: parameters held at the model's values.
        quadrature: one of `QUADRATURES`.

    Raises:
        UnknownName: no such predictor, parameter or quadrature.
        InputError: nothing to estimate, or the record lacks wind or heading.
    """
    known = {item.name: item for item in PREDICTORS}
    if predictor not in known:
        raise UnknownName("predictor", predictor, known=known)
    for name in fixed:
        if name not in model.names:
            raise UnknownName("parameter", name, known=model.names)
    if quadrature not in QUADRATURES:
        raise UnknownName("quadrature", quadrature, known=QUADRATURES)
    chosen = known[predictor]
    tables = [_checked_table(model, batch, chosen) for batch in record.batches]
    reads_air = {t.name for t, e in zip(model.terms, model.expressions, strict=True) if set(AIR) & set(e.signals)}
    merged = () if chosen.wind else tuple(n for n in model.names if n in reads_air and n not in fixed)
    parameters = tuple(name for name in model.names if name not in merged and name not in fixed)
    if not parameters:
        raise InputError("all parameters are fixed, none is left to estimate")
    nuisance: tuple[Nuisance, ...] = ()
    if chosen.nuisance:
        disturbed = [name for name in model.names if (WIND if name in reads_air else CURRENT) in chosen.disturbances]
        nuisance = nuisance_regressors(
            model,
            disturbed,
            tables,
            wind_measured=chosen.wind,
            turning=CURRENT in chosen.disturbances and turns_current(quadrature),
        )
        if not nuisance:
            raise InputError(f"predictor {predictor!r} needs terms of the velocity through the air, the model has none")
    partners = {name: partner for name in merged if (partner := _partner(model, name)) is not None}
    notes = tuple(_merged_note(name, partners) for name in merged)
    guess = Guess(to_mps=np.zeros(2), parameters=model.parameters) if chosen.steady else None
    return Layout(
        model=model,
        predictor=chosen,
        parameters=parameters,
        fixed=tuple(fixed),
        merged=merged,
        partners=partners,
        nuisance=nuisance,
        notes=notes,
        quadrature=quadrature,
        guess=guess,
    )


def _checked_table(model: VesselModel, batch: Batch, predictor: Predictor) -> Table:
    table = measured_table(model, batch, wind_measured=predictor.wind)
    if (predictor.nuisance or predictor.steady) and not np.isfinite(table["psi"]).any():
        raise InputError(f"{batch.name} has no measured heading; use a method that estimates no current")
    return table


def _partner(model: VesselModel, name: str) -> str | None:
    """The term of the water that a term of the air falls together with where the wind is not measured."""
    algebra, index = Algebra(), model.names.index(name)
    own = symbolic(model.expressions[index], algebra, wind_measured=False)
    for term, expression in zip(model.terms, model.expressions, strict=True):
        same = term.equation == model.terms[index].equation and not set(AIR) & set(expression.signals)
        if same and str(symbolic(expression, algebra, wind_measured=False)) == str(own):
            return term.name
    return None


def _merged_note(name: str, partners: Mapping[str, str]) -> str:
    if name in partners:
        partner = partners[name]
        return f"This method uses no wind: {partner} is the sum of {partner} and {name}, and {name} is set to 0."
    return f"This method uses no wind: {name} is set to 0."


# Rows of a regression where velocities are read less often than they are sampled.
#
# Between two readings a velocity is interpolated, and its differences from sample to sample are those of the
# interpolation. Their sum from one reading to the next is a difference of readings. Every row therefore becomes the
# mean of the rows between two readings, for each output by itself; equations that hold for rows hold for their means.


def mean_between_readings(rows: Array, interpolated: Array) -> Array:
    """Rows (k - 1, n, ...) of pairs of successive samples, each replaced by the mean over its interval.

    Args:
        rows: of pairs of samples.
        interpolated: (k, n) positive where an output lies between readings; the ends count as read.
    """
    result = np.array(rows)
    for output, between in enumerate(interpolated.T):
        starts = np.flatnonzero(~(between[:-1] > 0) | (np.arange(len(rows)) == 0))
        counts = np.diff(np.append(starts, len(rows)))
        sums = np.add.reduceat(rows[:, output], starts, axis=0)
        means = sums / counts.reshape(-1, *[1] * (sums.ndim - 1))
        result[:, output] = np.repeat(means, counts, axis=0)
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Where the rows of a regression come from."""

    regression: Regression  # of all batches
    used: tuple[Integers, ...]  # per batch, the samples k - 1 whose regressors are used
    left_out: int  # number of rows left out because numbers are missing


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
        found.append(heading[last_seen(seen)[places]])
    return np.concatenate(found)
