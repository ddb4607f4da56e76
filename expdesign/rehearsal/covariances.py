"""Covariances of estimates from each primitive alone, by simulated trials (7.59).

Every trial is a few runs of one primitive by the nominal ship, measured with its sensors and estimated from alone. The
scatter about the nominal parameters counts bias as well as noise. A primitive whose trials do not all give an estimate
of every parameter is not informative on its own, and has no covariance. Where instruments are weak, few trials far off
decide the covariance: the assumption (7.60) of normal estimates then fails, and shares by information are safer.

Source: F. Ljungberg, doctoral thesis, Linköping University, 7.3.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import monte_carlo_covariance
from expdesign.errors import InputError
from expdesign.processes import as_finished
from expdesign.progress import Progress, silent
from expdesign.rehearsal.validation import CHUNK_TRIALS, Rehearsal, equal_runs, estimates_of
from expdesign.simulation import CALM, Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class Alone:
    """Estimates from one primitive alone."""

    primitive: Primitive  # the manoeuvre
    runs: int  # whole runs of it in every trial
    parameters: tuple[str, ...]  # p names
    nominal: Array  # (p,) parameters of the ship that was simulated
    estimates: Array  # (n, p) of the trials that give one
    failed: int  # trials without an estimate

    def __post_init__(self) -> None:
        seal(self, nominal="p", estimates="n p")

    @property
    def informative(self) -> bool:
        """Whether every trial gives an estimate, and there are enough for a regular covariance."""
        return not self.failed and len(self.estimates) > len(self.parameters) + 1

    @property
    def covariance(self) -> Array:
        """(p, p) about the nominal parameters.

        Raises:
            InputError: the primitive is not informative.
        """
        if not self.informative:
            raise InputError(f"{self.primitive.name!r} is not informative on its own")
        return monte_carlo_covariance(self.estimates, self.nominal)

    @property
    def seconds(self) -> float:
        """Length of the data of a trial [s]."""
        return self.runs * self.primitive.duration_s


def estimates_alone(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    *,
    parameters: Sequence[str],
    total_s: float,
    trials: int,
    environment: Environment = CALM,
    method: str = "iv",
    mean_subtraction: str = "complete",
    seed: int = 0,
    progress: Progress = silent,
) -> tuple[Alone, ...]:
    """Estimates from trials of each primitive alone, as long as its equal share of a time.

    Args:
        vessel: nominal ship, simulated and estimated in the form of its model: continuous motion, or Euler's map.
        parameters: names to estimate; the others are held.
        total_s: informative time of the whole design [s].
        trials: of each primitive.
        environment: weather, drawn anew for each trial as far as it is uncertain.
        seed: of all random numbers.

    Raises:
        InputError: fewer trials than a covariance of so many parameters needs.
    """
    if trials <= len(parameters) + 1:
        raise InputError(f"{trials} trials give no covariance of {len(parameters)} parameters, expected more than "
                         f"{len(parameters) + 1}")  # fmt: skip
    runs = equal_runs(primitives, total_s)
    names = [str(number) for number in range(len(primitives))]
    alone = {name: tuple(count if name == other else 0 for other, count in zip(names, runs, strict=True))
             for name in names}  # fmt: skip
    continuous = vessel.model.form == "continuous"
    rehearsal = Rehearsal(
        truth=vessel,
        nominal=vessel,
        primitives=tuple(primitives),
        designs=alone,
        total_s=total_s,
        environment=environment,
        parameters=tuple(parameters),
        method=method,
        mean_subtraction=mean_subtraction,
        integrator="rk4" if continuous else "euler",
        trials=trials,
        seed=seed,
    )
    chunks = [(name, number) for name in names for number in range(-(-trials // CHUNK_TRIALS))]
    found: dict[tuple[str, int], Array] = {}
    for name, number, rows in as_finished(_chunk, (rehearsal,), chunks):
        found[name, number] = rows
        progress("simulating each manoeuvre alone", len(found) / len(chunks))
    known = dict(zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True))
    nominal = np.array([known[name] for name in parameters])
    return tuple(
        _alone(primitive, count, rehearsal.parameters, nominal, [found[key] for key in chunks if key[0] == name])
        for name, primitive, count in zip(names, primitives, runs, strict=True)
    )


def _chunk(rehearsal: Rehearsal, name: str, number: int) -> tuple[str, int, Array]:
    trials = min(CHUNK_TRIALS, rehearsal.trials - number * CHUNK_TRIALS)
    return name, number, estimates_of(rehearsal, name, number, trials)


def _alone(
    primitive: Primitive, runs: int, parameters: tuple[str, ...], nominal: Array, parts: Sequence[Array]
) -> Alone:
    rows = np.concatenate(parts)[:, : len(parameters)]
    kept = rows[np.isfinite(rows).all(axis=1)]
    return Alone(
        primitive=primitive,
        runs=runs,
        parameters=parameters,
        nominal=nominal,
        estimates=kept,
        failed=len(rows) - len(kept),
    )
