"""Information of the stitched trajectory: transits inform too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.durations import Collected, DurationDesign, DurationProblem, bordered_moments
from expdesign.errors import NotInformative
from expdesign.information import moments, regressor_rows
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.information.unknown_current import beside_current, bordered_by_current, current_rows
from expdesign.plan.values import SailedTrial
from expdesign.signals import Commands
from expdesign.simulation import Environment, delivered
from expdesign.values import Array
from expdesign.vessel import Vessel


def realised_efficiencies(
    vessel: Vessel,
    design: DurationDesign,
    environment: Environment,
    sailed: SailedTrial,
) -> tuple[float | None, float | None]:
    """Efficiencies of the runs as they are placed, and of the whole trial, against the optimum in the time asked for.

    By the design's criterion and the nominal model, of the information collected, not per second. What the runs lose
    against the design's whole runs is due to their places: headings in wind, and entries that a leg reached within its
    tolerance. What the whole trial has more is due to its legs; above 1 where they add more than rounding and places
    take. A steady current that the forecast leaves unknown is estimated too; the optimum is for runs of any heading,
    whose information is then the same. None where the design has nuisance regressors, recorded primitives, or samples
    of each equation's own: their information is not that of the track.
    """
    problem = replace(design.problem, robust="nominal", sampled=np.zeros((0, 0, 0, 0)))
    known = set(problem.parameters) <= set(vessel.model.names) and problem.excitation == "free"
    if not known or not problem.symmetric:
        return None, None
    collected, share = Collected.of(problem), sailed.commands.sample_time_s / problem.total_s
    legs = track_information(vessel, problem, environment, sailed)
    runs = legs[[leg.kind == "primitive" for leg in sailed.legs]].sum(axis=0)
    placed, realised = (
        collected.efficiency_of(share * about_ship(problem, matrix), design.fractions)
        for matrix in (runs, legs.sum(axis=0))
    )
    return placed, realised


def track_information(vessel: Vessel, problem: DurationProblem, environment: Environment, sailed: SailedTrial) -> Array:
    """(legs, d, d) information of each leg of a trial: sums over its samples, bordered as B_q.

    Where the forecast leaves a steady current unknown, it is (legs, d + 2, d + 2), about the current, too. `about_ship`
    reduces a sum of them to the ship's parameters.
    """
    names, mean = problem.parameters, problem.mean_subtraction
    commands = delivered(vessel, sailed.commands)
    rows = regressor_rows(vessel.model, sailed.trajectory, commands, environment)
    parts = [slice(leg.first, leg.last) for leg in sailed.legs]
    matrices = [(part.stop - part.start) * _bordered(vessel, rows[part], names, mean) for part in parts]
    if environment.current_std_mps:
        J = current_rows(vessel, sailed.trajectory, commands, environment)
        matrices = [
            bordered_by_current(vessel, M, rows[part], J[part], names, mean)
            for M, part in zip(matrices, parts, strict=True)
        ]
    return np.array(matrices)


def about_ship(problem: DurationProblem, information: Array) -> Array:
    """(d, d) information about the ship in information (d, d), or (d + 2, d + 2) with an unknown current."""
    if len(information) == problem.dimension:
        return information
    return beside_current(information, len(problem.parameters))


def track_covariance(
    vessel: Vessel, design: DurationDesign, environment: Environment, sailed: SailedTrial
) -> Array | None:
    """(p, p) inverse information of a whole trial about the parameters, means left out, in units of the noise.

    None where the design has nuisance regressors or samples of each equation's own, or the track does not determine
    every parameter.
    """
    problem = design.problem
    p = len(problem.parameters)
    if not set(problem.parameters) <= set(vessel.model.names) or problem.excitation != "free":
        return None
    M = about_ship(problem, track_information(vessel, problem, environment, sailed).sum(axis=0))
    scale = np.sqrt(np.maximum(np.diag(M), 0.0))
    if not (scale > 0).all() or np.linalg.matrix_rank(M / np.outer(scale, scale)) < len(M):
        return None
    return np.asarray((np.linalg.inv(M / np.outer(scale, scale)) / np.outer(scale, scale))[:p, :p])


def part_of_track(sailed: SailedTrial, first: int = 0, last: int | None = None) -> TrialPart:
    """Some of its samples, all by default, as one batch of data."""
    commands, motion = sailed.commands, sailed.trajectory
    begin = np.zeros(len(commands.names)) if sailed.standing is None else sailed.standing
    return TrialPart(
        commands=Commands(
            sample_time_s=commands.sample_time_s, names=commands.names, values=commands.values[first:last]
        ),
        velocity=motion.velocity[first],
        heading_rad=float(motion.pose[first, 2]),
        standing=commands.values[first - 1] if first else begin,
    )


def expected_errors(
    vessel: Vessel, problem: DurationProblem, environment: Environment, sailed: SailedTrial
) -> Array | None:
    """(p, p) covariance of estimates from the whole track as one batch, in the parameters' units.

    By first-order propagation of the sensors' noise, see `information.expected`. None where the track does not
    determine every parameter.
    """
    try:
        return expected_covariance(
            vessel,
            [part_of_track(sailed)],
            problem.parameters,
            environment=environment,
            mean_subtraction=problem.mean_subtraction,
            unknown_current=environment.current_std_mps > 0,
        )
    except NotInformative:
        return None


def _bordered(vessel: Vessel, rows: Array, parameters: Sequence[str], mean_subtraction: str) -> Array:
    X, Y = moments(vessel.model, rows, parameters)
    return bordered_moments(X, Y, Y, Y @ Y.T, mean_subtraction)
