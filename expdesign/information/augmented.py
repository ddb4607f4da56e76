"""Information with nuisance regressors for unknown current and wind in the predictor.

The estimator then also estimates parameters of the disturbances, so the design's matrices have columns for them, and a
criterion about the ship alone is D_s. The regressors are those of the estimator, in noise-free runs of every primitive
on evenly spread headings, because the heading of a run is not known before the plan.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.76), (7.50)-(7.57).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import Diverged
from expdesign.estimation.regression import Layout, batch_signs, build_layout, measured_table, model_for
from expdesign.information.moments import PrimitiveInformation, log_det_or_none
from expdesign.information.scoring import score_primitives
from expdesign.information.tuning import TUNING
from expdesign.signals import Batch, Record
from expdesign.simulation import CALM, Environment, delivered, simulate_many, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel


@dataclass(frozen=True, kw_only=True)
class AugmentedInformation:
    """A dictionary scored with nuisance regressors."""

    information: tuple[PrimitiveInformation, ...]  # of each primitive, about all columns
    parameters: tuple[str, ...]  # names of all columns: parameters of the ship, then of the disturbances
    interest: tuple[str, ...]  # names of the ship's parameters that are estimated
    equations: tuple[str, ...]  # of all columns


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
        predictor: one with nuisance regressors, see `estimation.predictors`.
        environment: mean current and wind.
        fixed_parameters: held at the nominal values.
        mean_subtraction: "none", "batch" or "complete".

    Raises:
        UnknownName: no such predictor, parameter or mean subtraction.
        InputError: every parameter is fixed, or a term is of third order.
        Diverged: the nominal model is unstable.
    """
    basic = score_primitives(
        vessel,
        primitives,
        environment=environment,
        fixed_parameters=fixed_parameters,
        mean_subtraction=mean_subtraction,
    )
    batches = _measured(vessel, primitives, environment)
    record = Record(batches=tuple(batches))
    model = model_for(vessel.model, record)
    layout = build_layout(model, record, predictor=predictor, fixed=fixed_parameters)
    found = [_moments(layout, batch) for batch in batches]
    information = []
    for number, item in enumerate(basic):
        own = found[number * TUNING.headings : (number + 1) * TUNING.headings]
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


def _measured(vessel: Vessel, primitives: Sequence[Primitive], environment: Environment) -> list[Batch]:
    """Noise-free runs of every primitive on every heading, in this order, as they would be measured.

    Runs of one length are simulated together. Inputs are what the actuators deliver.

    Raises:
        Diverged: the nominal model is unstable.
    """
    headings = 2 * np.pi * np.arange(TUNING.headings) / TUNING.headings
    current_b = np.stack(to_body(environment.current_to, headings, NUMPY), axis=1)
    pose = np.pad(headings[:, None], ((0, 0), (2, 0)))
    lengths: dict[tuple[int, float], list[int]] = {}
    for index, primitive in enumerate(primitives):
        commands = primitive.commands
        lengths.setdefault((len(commands), commands.sample_time_s), []).append(index)
    found: dict[int, list[Batch]] = {}
    for members in lengths.values():
        some = [primitives[index] for index in members]
        states = simulate_many(
            vessel,
            np.repeat([primitive.commands.values for primitive in some], TUNING.headings, axis=0),
            pose=np.tile(pose, (len(some), 1)),
            velocity=np.concatenate([item.entry_velocity + np.pad(current_b, ((0, 0), (0, 1))) for item in some]),
            current_to=np.tile(environment.current_to, (len(some) * TUNING.headings, 1)),
            wind_to=np.tile(environment.wind_to, (len(some) * TUNING.headings, 1)),
            parameters=np.tile(vessel.model.parameters, (len(some) * TUNING.headings, 1)),
            standing=np.repeat([primitive.entry_inputs for primitive in some], TUNING.headings, axis=0),
        )
        for place, index in enumerate(members):
            own = states[:-1, place * TUNING.headings : (place + 1) * TUNING.headings]
            if not np.isfinite(own).all():
                raise Diverged(
                    f"vessel {vessel.name!r}: the model is unstable under the commands of {some[place].name!r}"
                )
            found[index] = [
                _batch(vessel, some[place], own[:, heading], environment) for heading in range(TUNING.headings)
            ]
    return [batch for index in range(len(primitives)) for batch in found[index]]


def _batch(vessel: Vessel, primitive: Primitive, states: Array, environment: Environment) -> Batch:
    """One run from its states (k, 6)."""
    pose, velocity = states[:, :3], states[:, 3:]
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
