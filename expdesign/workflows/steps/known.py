"""Knowledge from the data so far, the gain from the rest of a trial, and the manoeuvres that give it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from expdesign.assessment import INSTRUMENTS, Assessed, EstimateOptions, apart_from_stated, assess, with_unstated
from expdesign.durations import DurationDesign
from expdesign.errors import Diverged, NoAnswer, NotInformative
from expdesign.estimation.regression import in_depth
from expdesign.estimation.values import Estimate, into_range
from expdesign.export.estimate_page import advice
from expdesign.export.files import Purchase
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.plan.values import Plan
from expdesign.progress import Progress
from expdesign.signals import Commands, Record
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.vessel.structures import SHOAL

MATTERS = 1.05  # factor of a parameter's standard deviation without some runs from which these are named for it


def updated(
    vessel: Vessel, raw: Record, record: Record, *, fixed: Sequence[str], prior_counts: bool, progress: Progress
) -> tuple[Vessel, str, tuple[str, ...]]:
    """The vessel with parameters estimated from the data so far, by the method that an assessment prefers.

    Parameters that these data cannot determine stay at the vessel's values. All of them do if no estimate gives a model
    that can simulate the data. Notes say so, and what is said of such an estimate by `expdesign estimate`.

    Args:
        raw: the data, with commands as inputs.
        record: the same with what the actuators delivered, and with draught over depth where the model reads depth.
        fixed: parameters that are not to be estimated.
        prior_counts: whether to combine the estimate with the vessel's values by their standard deviations.

    Returns:
        Vessel, where its parameters come from, and notes.
    """
    held: tuple[str, ...] = ()
    while len(held) + len(fixed) < len(vessel.model.names):
        try:
            options = EstimateOptions(fixed=(*fixed, *held), choice=INSTRUMENTS)
            found = assess(vessel, record, options, progress=progress)
            for _, error in found.failures:
                if isinstance(error, NotInformative):
                    raise error
        except NotInformative as error:
            more = tuple(name for name in error.parameters if name not in (*fixed, *held))
            if not more:
                return _unchanged(vessel, str(error))
            held = (*held, *more)
            continue
        except Diverged as error:
            return _unchanged(vessel, str(error))
        if not found.best.stable:
            return _unchanged(vessel, next(run.problem for run in found.best.runs if run.problem))
        ship = combined(vessel, found.best.estimate, prior_counts=prior_counts)
        notes = (
            [f"The data so far cannot determine {', '.join(held)}. The values known before are kept."] if held else []
        )
        notes.append(_fit_note(found.best))
        notes += advice(with_unstated(vessel, raw, options, found))
        notes += () if prior_counts else apart_from_stated(found.best.estimate, vessel.model)
        how = ", combined with what was known before" if prior_counts else ""
        return ship, f"estimated from the data so far by {found.best.method.title}{how}", tuple(notes)
    return _unchanged(vessel, "they determine no parameter")


def _fit_note(item: Assessed) -> str:
    rows = np.array([run.fit_percent for run in item.runs])
    fits = [(name, column[np.isfinite(column)]) for name, column in zip(item.runs[0].outputs, rows.T, strict=True)]
    shares = ", ".join(f"{name} {fit.mean():.0f} %" if len(fit) else f"{name} steady" for name, fit in fits)
    return f"With it the simulation fits the data so far by {shares}. expdesign diagnose finds causes of misfit."


def _unchanged(vessel: Vessel, why: str) -> tuple[Vessel, str, tuple[str, ...]]:
    return vessel, "as known before the trial", (f"The data so far give no estimate to plan with: {why}.",)


def combined(vessel: Vessel, estimate: Estimate, *, prior_counts: bool) -> Vessel:
    """The vessel with an estimate, perhaps combined with its own values by their standard deviations.

    Args:
        vessel: as known before; the standard deviations of parameters that were not estimated stay.
        prior_counts: whether to combine it with values that have a stated standard deviation.
    """
    model = vessel.model
    places = [model.names.index(name) for name in estimate.names]
    values, covariance = estimate.values, estimate.covariance
    index = np.flatnonzero(model.parameter_std[places] > 0)
    if prior_counts and len(index):
        known = np.array(places)[index]
        stated = model.parameter_covariance[np.ix_(known, known)]
        gain = np.linalg.solve(covariance[np.ix_(index, index)] + stated, covariance[index]).T
        values = values + gain @ (model.parameters[known] - values[index])
        covariance = covariance - gain @ covariance[index]
        ends = [model.parameter_range.get(name, (-np.inf, np.inf)) for name in estimate.names]
        values = into_range(values, covariance, ends)
    whole = np.diag(model.parameter_std**2)
    whole[np.ix_(places, places)] = covariance
    assigned = model.with_parameters(dict(zip(estimate.names, values.tolist(), strict=True)))
    return replace(vessel, model=assigned.with_covariance(model.names, whole).with_kept_ranges())


def data_parts(record: Record, vessel: Vessel) -> tuple[TrialPart, ...]:
    """The data so far as parts of a trial: their commands, from their first velocity and heading."""
    inputs = in_recorded_depth(vessel).model.inputs
    return tuple(
        TrialPart(
            commands=Commands(
                sample_time_s=batch.sample_time_s,
                names=inputs,
                values=batch.inputs[:, [batch.input_names.index(name) for name in inputs]],
            ),
            velocity=np.nan_to_num(batch.velocity[0]),
            heading_rad=0.0 if batch.pose is None else float(np.nan_to_num(batch.pose[0, 2])),
        )
        for batch in record.batches
    )


def in_recorded_depth(vessel: Vessel) -> Vessel:
    """The vessel with the recorded depth as one more input if its model reads depth; else unchanged."""
    return replace(vessel, model=in_depth(vessel.model)) if vessel.model.reads_depth else vessel


def plan_part(plan: Plan, vessel: Vessel) -> TrialPart:
    """The whole track of a plan as one part of a trial, in deep water as all plans are."""
    motion, commands = plan.trajectory, plan.commands
    if vessel.model.reads_depth:
        deep = np.column_stack([commands.values, np.zeros(len(commands))])
        commands = replace(commands, names=(*commands.names, SHOAL), values=deep)
    return TrialPart(commands=commands, velocity=motion.velocity[0], heading_rad=float(motion.pose[0, 2]))


def expected_std(
    vessel: Vessel,
    parts: Sequence[TrialPart],
    parameters: Sequence[str],
    *,
    environment: Environment,
    mean_subtraction: str,
) -> Array:
    """(p,) theoretical standard deviations of estimates from a trial; nan for parameters that it does not determine.

    A steady current that the forecast leaves unknown, the same in all parts, is estimated with the parameters.
    """
    determined = list(parameters)
    found: Mapping[str, float] = {}
    while determined:
        try:
            covariance = expected_covariance(
                vessel,
                parts,
                determined,
                environment=environment,
                mean_subtraction=mean_subtraction,
                unknown_current=environment.current_std_mps > 0,
            )
        except NotInformative as error:
            rest = [name for name in determined if name not in error.parameters]
            determined = rest if len(rest) < len(determined) else []
            continue
        except NoAnswer:
            break
        found = dict(zip(determined, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
        break
    return np.array([found.get(name, np.nan) for name in parameters])


def purchases(design: DurationDesign, parameters: Sequence[str]) -> tuple[Purchase, ...]:
    """For each parameter the manoeuvre that its accuracy depends on most.

    By the inverse of the design's information matrix, prior data included.
    """
    problem = design.problem
    shares = np.array(design.repeats) * problem.run_s / problem.total_s
    pieces = shares[:, None, None] * (problem.matrices + problem.matrices.transpose(0, 2, 1)) / 2
    whole = _variances(problem.prior + pieces.sum(axis=0))
    used = np.flatnonzero(design.repeats)
    without = {index: _variances(problem.prior + pieces.sum(axis=0) - pieces[index]) for index in used.tolist()}
    found = []
    for name in parameters:
        place = problem.parameters.index(name)
        ratios = {index: float(np.sqrt(variances[place] / whole[place])) for index, variances in without.items()}
        best = max(ratios, key=lambda index: ratios[index], default=None)
        if best is None or not ratios[best] > MATTERS:
            found.append(Purchase(primitive="", runs=0, without=1.0 if best is None else ratios[best]))
        else:
            found.append(Purchase(primitive=problem.names[best], runs=design.repeats[best], without=ratios[best]))
    return tuple(found)


def _variances(matrix: Array) -> Array:
    """(d,) diagonal of the inverse; infinite throughout where there is none."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    size = np.where(scale > 0, scale, 1.0)
    scaled = matrix / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    if not values[0] > 1e-12 * values[-1]:
        lost = (vectors[:, values <= 1e-12 * values[-1]] ** 2).sum(axis=1) > 1e-6
        kept = values > 1e-12 * values[-1]
        rest = (vectors[:, kept] ** 2 / values[kept]).sum(axis=1) / size**2
        return np.where(lost, np.inf, rest)
    return np.asarray((vectors**2 / values).sum(axis=1) / size**2)
