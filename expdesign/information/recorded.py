"""Information of measured batches: regressors as measured, instruments from the simulated model.

    X = mean Phi Z^T,   Y = mean Phi,   Z = mean of the instruments                                   (7.50)-(7.55)

Regressors are noisy and instruments are not, so X is not symmetric, and the design problem is not convex.

Source: F. Ljungberg, doctoral thesis, Linköping University, 7.3 and (7.50)-(7.55).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.errors import InputError
from expdesign.estimation.regression import build_layout, build_regression, model_for
from expdesign.estimation.replay import InstrumentModel, Integration, build_replay
from expdesign.information.moments import MEAN_SUBTRACTIONS
from expdesign.reduction import with_delivered_inputs
from expdesign.signals import Record
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array, sealed
from expdesign.vessel import VesselModel

REGRESSORS = ("measured", "simulated")


@sealed(X="p p", Y="p n", Z="p n")
class BatchInformation:
    """Per-sample moments of one measured batch."""

    name: str  # of the batch
    seconds: float  # its length [s]
    samples: int  # number of regression rows
    X: Array  # (p, p) mean of Phi Z^T
    Y: Array  # (p, n) mean of Phi
    Z: Array  # (p, n) mean of the instruments

    def bordered(self, mean_subtraction: str) -> Array:
        """(d, d) as of a primitive: [[X, Y], [Z^T, I]], or with the batch's own means taken off."""
        if mean_subtraction == "none":
            return self.X
        if mean_subtraction == "batch":
            return np.asarray(self.X - self.Y @ self.Z.T)
        return np.block([[self.X, self.Y], [self.Z.T, np.eye(self.Y.shape[1])]])


def recorded_information(
    record: Record,
    model: VesselModel,
    parameters: Sequence[str],
    *,
    predictor: str = "basic",
    regressors: str = "measured",
    delivered: bool = False,
) -> tuple[BatchInformation, ...]:
    """Information of every batch about named parameters, in the units of `information.moments`.

    A parameter that is not in the predictor (of wind, where wind was not measured) has rows of zeros: these data do not
    inform about it.

    Args:
        record: measured data, with commands as inputs unless `delivered`.
        model: nominal; its simulation gives the instruments.
        parameters: p names; all others are fixed.
        predictor: name in `estimation.predictors.PREDICTORS` without nuisance regressors, "basic" or "basic-wind".
        regressors: "measured", or "simulated" as in the instruments, which makes X symmetric.
        delivered: the record holds what the actuators deliver, not commands.

    Raises:
        InputError: a predictor with nuisance regressors, or data that lack what it needs.
        UnknownName: no such predictor or parameter.
        Diverged: the nominal model is unstable.
    """
    if regressors not in REGRESSORS:
        raise InputError(f"regressors is {regressors!r}, expected one of {', '.join(REGRESSORS)}")
    driven = model_for(model, record)
    if not delivered:
        record = with_delivered_inputs(record, driven)
    fixed = tuple(name for name in driven.names if name not in parameters)
    layout = build_layout(driven, record, predictor=predictor, fixed=fixed)
    if layout.nuisance:
        raise InputError(f"predictor {predictor!r} has nuisance regressors, expected basic or basic-wind")
    rows = build_regression(layout, record)
    motion = Integration(integrator="rk4", substeps=SUBSTEPS)  # as primitives are scored
    replay = build_replay(driven, record, motion, windy=layout.predictor.wind)
    Z = InstrumentModel(layout, record, rows, replay, "measured", "lagged").instruments(driven.parameters)
    place = [list(parameters).index(name) for name in layout.parameters]
    found, first = [], 0
    for batch, used in zip(record.batches, rows.used, strict=True):
        scale = driven.time_scale_s / batch.sample_time_s
        part = slice(first, first + len(used))
        first += len(used)
        if not len(used):
            continue
        own, simulated = scale * rows.regression.Phi[part], scale * Z[part]
        left = own if regressors == "measured" else simulated
        X, Y, means = np.einsum("kni,knj->ij", left, simulated) / len(used), left.mean(axis=0).T, simulated.mean(axis=0)
        found.append(
            BatchInformation(
                name=batch.name,
                seconds=len(batch) * batch.sample_time_s,
                samples=len(used),
                X=_padded(X, place, len(parameters), both=True),
                Y=_padded(Y, place, len(parameters)),
                Z=_padded(means.T, place, len(parameters)),
            )
        )
    return tuple(found)


def _padded(values: Array, place: list[int], count: int, *, both: bool = False) -> Array:
    full = np.zeros((count, count if both else values.shape[1]))
    full[np.ix_(place, place if both else range(values.shape[1]))] = values
    return full


def by_label(batches: Sequence[BatchInformation], labels: Sequence[str]) -> tuple[BatchInformation, ...]:
    """Information of each label: the moments of all its batches together, in the order in which labels first appear.

    Args:
        batches: as from `recorded_information`.
        labels: of each batch.
    """
    found = []
    for label in dict.fromkeys(labels):
        own = [batch for batch, name in zip(batches, labels, strict=True) if name == label]
        rows = np.array([batch.samples for batch in own])
        X, Y, Z = (
            np.tensordot(rows / rows.sum(), np.array([getattr(batch, name) for batch in own]), axes=1)
            for name in ("X", "Y", "Z")
        )
        seconds = sum(batch.seconds for batch in own)
        found.append(BatchInformation(name=label, seconds=seconds, samples=int(rows.sum()), X=X, Y=Y, Z=Z))
    return tuple(found)


def pooled(batches: Sequence[BatchInformation], mean_subtraction: str) -> tuple[Array, int]:
    """(d, d) per-sample matrix of all batches together, and the number of samples.

    Raises:
        InputError: no batches.
    """
    if mean_subtraction not in MEAN_SUBTRACTIONS or not batches:
        raise InputError("pooling needs batches and a known mean subtraction")
    samples = np.array([batch.samples for batch in batches])
    matrices = np.array([batch.bordered(mean_subtraction) for batch in batches])
    return np.asarray(np.tensordot(samples / samples.sum(), matrices, axes=1)), int(samples.sum())
