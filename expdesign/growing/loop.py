"""Growth of the dictionary: search for the manoeuvre of largest sensitivity, add it, and solve again.

A run with d = trace(B(w)^-1 B_run) above the dimension raises the optimal log det. If no evaluated run is above it, the
design is optimal over all evaluated runs, by the equivalence theorem.

Source: V. V. Fedorov, Theory of Optimal Experiments (1972), chapter 2 (adding the point of largest sensitivity);
J. Kiefer and J. Wolfowitz, Canad. J. Math. 12 (1960), 363-366.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.dictionary import FAMILIES, Primitive, PrimitiveSpec, build_primitive, family
from expdesign.durations import bordered, d_optimal, log_det, rows_of, whitened
from expdesign.errors import InputError, UnknownName
from expdesign.growing._casadi import FreeForm, optimise_commands
from expdesign.growing.search import (
    FamilySpace,
    GrowRound,
    GrowSettings,
    Growth,
    Measure,
    Worth,
    best_of,
    family_spaces,
    pool_of,
    refined,
    violation,
)
from expdesign.information import PrimitiveInformation, check_informative, estimated_parameters, score_primitives
from expdesign.progress import Progress, silent, within
from expdesign.simulation import CALM, Environment
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

FREE_FORM_EXCESS = 1e-6  # share of a range by which optimised commands may exceed a limit


@sealed(fractions="q", inverse="d d")
class Optimum:
    """Shares of the time, the optimal ones or others, and their information."""

    fractions: Array  # (q,) time fractions
    log_det: float  # in physical scale
    inverse: Array  # (d, d) B^-1 in physical scale

    @property
    def dimension(self) -> int:
        """Size of B."""
        return len(self.inverse)


def optimum(information: Sequence[PrimitiveInformation], mean_subtraction: str) -> Optimum:
    """D-optimal time fractions of a dictionary that informs about every parameter."""
    white, _ = whitened(np.array([bordered(item, mean_subtraction) for item in information]))
    rows = rows_of(white)
    assert rows is not None  # simulated runs have positive semidefinite information
    return shared(information, d_optimal(rows, tolerance=1e-10).fractions, mean_subtraction)


def shared(
    information: Sequence[PrimitiveInformation], fractions: Array, mean_subtraction: str = "complete"
) -> Optimum:
    """The information of given time fractions (q,)."""
    matrices = np.array([bordered(item, mean_subtraction) for item in information])
    white, offset = whitened(matrices)
    total = np.tensordot(fractions, matrices, axes=1)
    scale = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(scale, scale)) / np.outer(scale, scale)
    return Optimum(fractions=fractions, log_det=log_det(white, fractions) + offset, inverse=inverse)


def sensitivity(best: Optimum, item: PrimitiveInformation, mean_subtraction: str) -> float:
    """d = trace(B(w)^-1 B) of one run."""
    return float(np.sum(best.inverse * bordered(item, mean_subtraction)))


OUTPUT_KEYS = ("u_mps", "v_mps", "r_radps")


def grow_dictionary(
    vessel: Vessel,
    information: Sequence[PrimitiveInformation],
    *,
    settings: GrowSettings,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
    progress: Progress = silent,
) -> Growth:
    """Add the most informative manoeuvres of the families to a scored dictionary, one by one, for the D criterion.

    Args:
        information: the present dictionary, scored with the same environment, fixed parameters and mean subtraction.
        environment, fixed_parameters, mean_subtraction: as in `score_primitives`.

    Raises:
        NotInformative: the present dictionary does not inform about every parameter.
        UnknownName: no such family.
        InputError: no family or no range is left to search.
    """
    primitives = [item.primitive for item in information]
    measure = Measure(
        vessel=vessel,
        names=estimated_parameters(vessel.model, tuple(fixed_parameters)),
        environment=environment,
        mean_subtraction=mean_subtraction,
        limits=motion_limits(settings, primitives),
    )
    check_informative(information, measure.names, mean_subtraction)
    progress("simulating candidates", 0.0)
    spaces = searched_spaces(vessel, primitives, settings, measure.limits)
    rng = np.random.default_rng(settings.seed or 0)
    archives = pool_of(spaces, measure, settings.pool, settings.seed or 0)
    grown, specs, rounds = list(information), list[PrimitiveSpec](), list[GrowRound]()
    first = best = optimum(grown, mean_subtraction)
    while True:
        number, last = len(rounds), settings.rounds + 1
        part = within(progress, number / last, (number + 1) / last)
        worth = Worth(gradient=best.inverse)
        archives = refined(archives, worth, measure, rng, part)
        found = best_of(archives, worth)
        left = -np.inf if found is None else found.merit
        if found is None or len(rounds) == settings.rounds:
            break
        item, spec = _addition(measure, best, found.spec, settings, part)
        left = sensitivity(best, item, mean_subtraction)
        if left <= best.dimension * (1 + settings.tolerance):
            break
        name = _unused(len(rounds) + 1, spec.family, grown)
        spec, item = replace(spec, name=name), replace(item, primitive=replace(item.primitive, name=name))
        before, best = best, optimum([*grown, item], mean_subtraction)
        grown.append(item)
        specs.append(spec)
        rounds.append(
            GrowRound(
                name=name,
                family=spec.family,
                settings=spec.settings,
                sensitivity=left,
                searched=found.merit,
                log_det_gain=best.log_det - before.log_det,
                efficiency=float(np.exp((best.log_det - first.log_det) / len(measure.names))),
                excitation_condition=item.excitation_condition,
            )
        )
    return Growth(
        specs=tuple(specs),
        information=tuple(grown),
        rounds=tuple(rounds),
        limits=measure.limits,
        evaluated=sum(len(archive.points) for archive in archives),
        dimension=best.dimension,
        parameters=len(measure.names),
        best_left=left,
    )


def _addition(
    measure: Measure, best: Optimum, spec: PrimitiveSpec, settings: GrowSettings, progress: Progress
) -> tuple[PrimitiveInformation, PrimitiveSpec]:
    """The candidate found, or commands optimised from it if they are more informative."""
    item = _scored(measure, spec)
    if not settings.free_form:
        return item, spec
    progress("optimising its commands", 0.9)
    free = _free_form(measure, best, item)
    if free is None:
        return item, spec
    scored = _scored(measure, free)
    over = violation(scored.primitive.trajectory.velocity[None], measure.limits)[0]
    better = sensitivity(best, scored, measure.mean_subtraction) > sensitivity(best, item, measure.mean_subtraction)
    return (scored, free) if better and over <= FREE_FORM_EXCESS else (item, spec)


def _free_form(measure: Measure, best: Optimum, item: PrimitiveInformation) -> PrimitiveSpec | None:
    run = item.primitive
    values = optimise_commands(
        FreeForm(
            vessel=measure.vessel,
            names=measure.names,
            gradient=best.inverse,
            mean_subtraction=measure.mean_subtraction,
            limits=measure.limits,
            entry_inputs=run.entry_inputs,
            commands=run.commands.values,
            velocity=run.trajectory.velocity,
        )
    )
    if values is None:
        return None
    speed, sway, yaw = run.entry_velocity.tolist()
    settings = {"duration_s": run.duration_s, "speed_mps": speed, "sway_mps": sway, "yaw_rate_radps": yaw}
    commands = replace(run.commands, values=values)
    return PrimitiveSpec(name=run.name, family="recorded", settings=settings, commands=commands)


def _scored(measure: Measure, spec: PrimitiveSpec) -> PrimitiveInformation:
    """A candidate as `information.score_primitives` scores it."""
    names = estimated_parameters(measure.vessel.model, ())
    (item,) = score_primitives(
        measure.vessel,
        [build_primitive(measure.vessel, spec)],
        environment=measure.environment,
        fixed_parameters=[name for name in names if name not in measure.names],
        mean_subtraction=measure.mean_subtraction,
    )
    return item


def motion_limits(settings: GrowSettings, primitives: Sequence[Primitive]) -> Array:
    """(3, 2) low and high of u, v, r: as in the settings, else the range of the primitives in calm water.

    Raises:
        UnknownName: a limit on another quantity.
        InputError: low is not below high.
    """
    motion = np.concatenate([primitive.trajectory.velocity for primitive in primitives])
    limits = np.stack([motion.min(axis=0), motion.max(axis=0)], axis=1)
    for key, (low, high) in settings.limits.items():
        if key not in OUTPUT_KEYS:
            raise UnknownName("velocity in limits", key, known=OUTPUT_KEYS)
        if not low < high:
            raise InputError(f"limits.{key} is [{low:g}, {high:g}], expected low below high")
        limits[OUTPUT_KEYS.index(key)] = low, high
    return limits


def searched_spaces(
    vessel: Vessel, primitives: Sequence[Primitive], settings: GrowSettings, limits: Array
) -> tuple[FamilySpace, ...]:
    """What is searched for additions to a dictionary.

    Raises:
        UnknownName: no such family.
        InputError: no family is left.
    """
    step_s = vessel.sample_time_s
    run_s = settings.run_s or float(np.median([item.duration_s for item in primitives]))
    chosen = tuple(family(name) for name in settings.families) or FAMILIES
    return family_spaces(vessel, chosen, limits, max(round(run_s / step_s), 2) * step_s)


def _unused(number: int, kind: str, grown: Sequence[PrimitiveInformation]) -> str:
    """A name that no primitive has."""
    name, taken = f"grown-{number}-{kind.replace('_', '-')}", {item.primitive.name for item in grown}
    while name in taken:
        name += "-again"
    return name
