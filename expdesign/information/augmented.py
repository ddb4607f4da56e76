"""Information when the predictor carries nuisance regressors for unknown current and wind.

The estimator then has to tell the ship's parameters from those of the disturbances, so the design's matrices carry the
nuisance columns too, and a criterion about the ship alone is D_s. The regressors are the estimator's own, on a
noise-free run of every primitive on headings all around, because the heading of a run is not known before the plan is.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.76), (7.50)-(7.57).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.estimation.nuisance import batch_signs
from expdesign.estimation.predictors import Layout, build_layout
from expdesign.estimation.tables import measured_table, model_for
from expdesign.information.moments import HEADINGS, log_det_or_none
from expdesign.information.primitive_information import PrimitiveInformation
from expdesign.information.scoring import score_primitives
from expdesign.signals import Batch, Record
from expdesign.simulation import CALM, Environment, delivered, simulate, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel


@dataclass(frozen=True, kw_only=True)
class AugmentedInformation:
    """A dictionary scored with nuisance regressors.

    Attributes:
        information: of each primitive, about all columns.
        parameters: names of all columns: parameters of the ship, then of the disturbances.
        interest: names of the ship's parameters that are estimated.
        equations: of all columns.
    """

    information: tuple[PrimitiveInformation, ...]
    parameters: tuple[str, ...]
    interest: tuple[str, ...]
    equations: tuple[str, ...]


def score_augmented(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    *,
    predictor: str,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
) -> AugmentedInformation:
    """Information of every primitive about the ship's parameters and the nuisance parameters of a predictor.

    Args:
        vessel: nominal.
        primitives: the dictionary.
        predictor: "augmented" or "wind", see `estimation.predictors`.
        environment: mean current and wind.
        fixed_parameters: held at the nominal values.
        mean_subtraction: "none", "batch" or "complete".

    Raises:
        UnknownName: no such predictor, parameter or mean subtraction.
        InputError: nothing is left to estimate, or a term of third order.
        Diverged: the nominal model is unstable.
    """
    basic = score_primitives(
        vessel,
        primitives,
        environment=environment,
        fixed_parameters=fixed_parameters,
        mean_subtraction=mean_subtraction,
    )
    batches = [
        _batch(vessel, primitive, 2 * np.pi * number / HEADINGS, environment)
        for primitive in primitives
        for number in range(HEADINGS)
    ]
    record = Record(batches=tuple(batches))
    model = model_for(vessel.model, record)
    layout = build_layout(model, record, predictor=predictor, fixed=fixed_parameters)
    found = [_moments(layout, batch) for batch in batches]
    information = []
    for number, item in enumerate(basic):
        own = found[number * HEADINGS : (number + 1) * HEADINGS]
        X, Y = np.mean([X for X, _ in own], axis=0), np.mean([Y for _, Y in own], axis=0)
        YZ = np.mean([Y @ Y.T for _, Y in own], axis=0)
        taken = {"none": np.zeros_like(X), "batch": YZ, "complete": Y @ Y.T}[mean_subtraction]
        alone = log_det_or_none(X - taken, np.diag(X))
        information.append(replace(item, X=X, Y=Y, Z=Y, YZ=YZ, log_det_alone=alone))
    equation = {term.name: term.equation for term in model.terms}
    return AugmentedInformation(
        information=tuple(information),
        parameters=layout.names,
        interest=layout.parameters,
        equations=(*(equation[name] for name in layout.parameters), *(item.equation for item in layout.nuisance)),
    )


def _batch(vessel: Vessel, primitive: Primitive, heading: float, environment: Environment) -> Batch:
    """A noise-free run as it would be measured, with what the actuators deliver as inputs."""
    current_b = np.array(to_body(environment.current_to, heading, NUMPY))
    run = simulate(
        vessel,
        primitive.commands,
        pose=(0.0, 0.0, heading),
        velocity=primitive.entry_velocity + np.append(current_b, 0.0),
        environment=environment,
        standing=primitive.entry_inputs,
    )
    pose, velocity = run.pose[:-1], run.velocity[:-1]
    wind_b = np.stack(to_body(environment.wind_to, pose[:, 2], NUMPY), axis=1)
    return Batch(
        name=primitive.name,
        sample_time_s=primitive.commands.sample_time_s,
        input_names=primitive.commands.names,
        inputs=delivered(vessel, primitive.commands, standing=primitive.entry_inputs).values,
        velocity=velocity,
        pose=pose,
        wind=velocity[:, :2] - wind_b,
    )


def _moments(layout: Layout, batch: Batch) -> tuple[Array, Array]:
    table = measured_table(layout.model, batch, wind_measured=layout.predictor.wind)
    rows = layout.rows(table, batch_signs(layout.nuisance, table), used=slice(None), scale=1.0)  # (k, n, p)
    return np.einsum("kni,knj->ij", rows, rows) / len(rows), rows.mean(axis=0).T
