"""Vessels, primitives and duration problems that the tests of the design floors share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from expdesign.conventions import Array
from expdesign.dictionary import Primitive, PrimitiveSpec, build_dictionary, complete_settings, family
from expdesign.durations import DurationProblem
from expdesign.information import PrimitiveInformation, score_primitives
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.simulation import CALM, Environment
from expdesign.vessel import Actuator, Limit, Response, Vessel, VesselModel, structure_terms
from scenario_files import SCENARIOS

FREE = Limit()
WIND = Environment(wind_to=np.array([3.0, 2.0]), current_to=np.array([0.1, -0.2]))
"""A sea in which every parameter of the full structure shows."""


@cache
def vessel(name: str) -> Vessel:
    """A vessel of the examples: model-ship, azimuth-30m, or one of them with -true."""
    return load_vessel(SCENARIOS / "vessels" / f"{name}.toml")


@cache
def example_dictionary(name: str) -> tuple[Primitive, ...]:
    """An example dictionary built with its vessel: model-ship or standard."""
    ship = vessel({"model-ship": "model-ship", "standard": "azimuth-30m"}[name])
    return build_dictionary(ship, load_dictionary(SCENARIOS / "dictionaries" / f"{name}.toml"))


@cache
def scored_example(name: str, sea: Environment = CALM) -> tuple[PrimitiveInformation, ...]:
    """An example dictionary scored without mean subtraction; moments are the same with."""
    ship = vessel({"model-ship": "model-ship", "standard": "azimuth-30m"}[name])
    return score_primitives(ship, example_dictionary(name), environment=sea, mean_subtraction="none")


def spec(family_name: str, /, name: str = "", **settings: float) -> PrimitiveSpec:
    """A request with defaults filled in."""
    complete = complete_settings(family(family_name), settings)
    return PrimitiveSpec(name=name or family_name, family=family_name, settings=complete)


def force_actuator(limit: Limit = FREE, rate: float = math.inf) -> Actuator:
    """Plain generalised forces, the same limit and slew rate on all three."""
    return Actuator(kind="force", number=1, limits=(limit,) * 3, responses=(Response(rate=rate),) * 3)


def azimuth(
    number: int = 1, *, speed: Limit = FREE, angle: Limit = FREE, forward_m: float = 0.0, starboard_m: float = 0.0
) -> Actuator:
    """An azimuth thruster."""
    return Actuator(kind="azimuth", number=number, forward_m=forward_m, starboard_m=starboard_m, limits=(speed, angle))


def tunnel(number: int = 1, *, speed: Limit = FREE, forward_m: float = 0.0) -> Actuator:
    """A tunnel thruster."""
    return Actuator(kind="tunnel", number=number, forward_m=forward_m, limits=(speed,))


def structured(structure: str, parameters: Array, actuators: tuple[Actuator, ...], **more: object) -> VesselModel:
    """A model of a built-in structure; discrete at 1 s by default."""
    given = {"form": "discrete", "sample_time_s": 1.0, "parameter_std": np.zeros(len(parameters)), **more}
    return VesselModel(terms=structure_terms(structure), parameters=parameters, actuators=actuators, **given)


def with_limit(ship: Vessel, limit: Limit, rate: float = math.inf) -> Vessel:
    """The same vessel moved by plain forces with one limit and one slew rate on all of them."""
    return replace(ship, model=replace(ship.model, actuators=(force_actuator(limit, rate),)))


def resampled(ship: Vessel, sample_time_s: float) -> Vessel:
    """The same vessel, in continuous form, commanded at another sample time."""
    model = replace(
        ship.model, parameters=ship.model.parameters / ship.model.time_scale_s, form="continuous", sample_time_s=1.0
    )
    return replace(ship, model=model, sample_time_s=sample_time_s)


def duration_problem(
    matrices: Array | Sequence[Array],
    *,
    means: int = 0,
    run_s: float | Sequence[float] = 1.0,
    total_s: float = 1000.0,
) -> DurationProblem:
    """A problem from bare matrices (q, d, d), of which the last `means` rows hold means."""
    stack = np.array(matrices, dtype=float)
    count, size = stack.shape[:2]
    return DurationProblem(
        names=tuple(f"primitive {index}" for index in range(count)),
        parameters=tuple(f"parameter {index}" for index in range(size - means)),
        mean_subtraction="complete" if means else "none",
        matrices=stack,
        run_s=np.broadcast_to(run_s, (count,)),
        total_s=total_s,
    )


def sensitivities(matrices: Array, fractions: Array) -> Array:
    """(q,) trace(B(w)^-1 B_q) of a design, the slope of log det B(w)."""
    return np.asarray(np.einsum("ij,qji->q", np.linalg.inv(np.tensordot(fractions, matrices, axes=1)), matrices))


def random_matrices(rng: np.random.Generator, *, count: int, parameters: int, outputs: int, samples: int) -> Array:
    """(count, p + n, p + n) [[X, Y], [Y^T, I]] of regressors drawn around a random offset, one output each."""
    output = np.arange(parameters) % outputs
    same = output[:, None] == output
    member = output[:, None] == np.arange(outputs)
    matrices = []
    for _ in range(count):
        rows = rng.standard_normal((samples, parameters)) + rng.standard_normal(parameters)
        X, Y = same * (rows.T @ rows) / samples, member * rows.mean(axis=0)[:, None]
        matrices.append(np.block([[X, Y], [Y.T, np.eye(outputs)]]))
    return np.array(matrices)


def one_line(error: object) -> bool:
    """Whether an error reads as one line of bearable length."""
    return "\n" not in str(error) and 0 < len(str(error)) < 400
