"""What actuators deliver, and its derivatives by their dead times, lags and slew rates.

Samples are divided where commands arrive. A later arrival lengthens the part before it and shortens the part after it:
what acts in the parts stays, so that simulated motion is smooth in dead times. Parts may have no length, where commands
arrive together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.simulation import SampleMap, deliver_through, mapped, positions
from expdesign.values import Array
from expdesign.vessel import Response

SMALL = 1e-4  # change that derivatives are taken by: of a time, in samples; of a slew rate, as a share of it
TIMES = ("delay_s", "lag_s", "rate")  # fields of `Response` that may be uncertain and that inputs have derivatives by


@dataclass(frozen=True, kw_only=True)
class UncertainTime:
    """A dead time, lag or slew rate of an actuator signal that is not known exactly."""

    column: int  # of the signal, among the inputs
    quantity: str  # one of `TIMES`


@dataclass(frozen=True, kw_only=True)
class Division:
    """Which commands act in which parts of a sample."""

    begins: tuple[float, ...]  # shares of the sample at which equal parts begin
    arriving: tuple[int, ...]  # columns of the signals whose arrivals divide it, in the order of `places`
    places: tuple[int, ...]  # of these arrivals among all begins of parts
    lateness: tuple[int, ...]  # whole samples of each signal's dead time

    def shares(self, responses: Sequence[Response], sample_time_s: float) -> Array:
        """(s,) shares of the sample that its parts take; responses may differ a little from the original ones."""
        begins = np.full(len(self.begins) + len(self.arriving), np.nan)
        begins[list(self.places)] = [
            responses[column].delay_s / sample_time_s - self.lateness[column] for column in self.arriving
        ]
        begins[np.isnan(begins)] = self.begins
        return np.diff(np.append(begins, 1.0))

    def maps(self, responses: Sequence[Response], sample_time_s: float) -> list[SampleMap | None]:
        """The map of each signal over a sample."""
        steps_s, first = sample_time_s * self.shares(responses, sample_time_s), dict.fromkeys(range(len(responses)), 0)
        first |= dict(zip(self.arriving, self.places, strict=True))
        return [
            mapped(
                response,
                self.lateness[column],
                [[(1 if part < first[column] else 2, step_s)] for part, step_s in enumerate(steps_s.tolist())],
            )
            for column, response in enumerate(responses)
        ]


def division(
    responses: Sequence[Response], times: Sequence[UncertainTime], *, sample_time_s: float, substeps: int
) -> Division:
    """A sample divided into equal parts, and where late commands arrive or may."""
    late = [response.delay_s / sample_time_s for response in responses]
    lateness = tuple(math.floor(share + 1e-9) for share in late)
    moving = {time.column for time in times if time.quantity == "delay_s"}
    arriving = [column for column, share in enumerate(late) if share > 0 or column in moving]
    begins = [part / substeps for part in range(substeps)]
    order = np.argsort([*begins, *(max(late[column] - lateness[column], 0.0) for column in arriving)], kind="stable")
    places = {index - substeps: place for place, index in enumerate(order.tolist()) if index >= substeps}
    return Division(
        begins=tuple(begins),
        arriving=tuple(arriving),
        places=tuple(places[index] for index in range(len(arriving))),
        lateness=lateness,
    )


def delivered_with_slopes(
    responses: Sequence[Response],
    commands: Array,
    times: Sequence[UncertainTime],
    *,
    sample_time_s: float,
    substeps: int,
    standing: Array | None = None,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Delivered values (k, s, m) and shares (s,) of parts of samples, and both by the times (u, k, s, m), (u, s).

    Derivatives are per second of a time, and per unit of a slew rate.

    Args:
        responses: one for each signal.
        commands: (k, m) held.
        times: to take derivatives by.
        sample_time_s: time between samples [s].
        substeps: equal parts that are divided.
        standing: (m,) commands that stood before the first sample; None for those of the first sample.
    """
    parts = division(responses, times, sample_time_s=sample_time_s, substeps=substeps)

    def given(own: Sequence[Response]) -> tuple[Array, Array]:
        shares = parts.shares(own, sample_time_s)
        maps: list[SampleMap | None] = [
            None if responses[column].follows and column not in moved else through
            for column, through in enumerate(parts.maps(own, sample_time_s))
        ]
        acting, _ = positions(own, commands, sample_time_s=sample_time_s, standing=standing)
        return deliver_through(maps, acting, len(shares), standing=standing), shares

    moved, slopes = {time.column for time in times if time.quantity != "rate"}, []
    for time in times:
        was, own = getattr(responses[time.column], time.quantity), list(responses)
        small = SMALL * (was if time.quantity == "rate" else sample_time_s)
        ends = was + small, max(was - small, 0.0)
        found = []
        for value in ends:
            own[time.column] = replace(responses[time.column], **{time.quantity: value})
            found.append(given(own))
        (values, shares), (values_before, shares_before) = found
        step_s = ends[0] - ends[1]
        slopes.append(((values - values_before) / step_s, (shares - shares_before) / step_s))
    by_time = np.stack([by for by, _ in slopes]), np.stack([by for _, by in slopes])
    return given(responses), by_time
