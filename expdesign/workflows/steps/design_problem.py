"""From a scored scenario to a duration problem: criterion, robustness, prior information, and limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import (
    Aim,
    Constraints,
    DurationDesign,
    DurationProblem,
    Efficiencies,
    InformationFloor,
    build_durations,
    limits_kept,
    solve_durations,
)
from expdesign.errors import FloorOutOfReach, InputError, NoAnswer, NotInformative
from expdesign.export.document import Document, Table, tabled
from expdesign.indices import outcome_gradients
from expdesign.information import (
    MEAN_SUBTRACTIONS,
    PrimitiveInformation,
    check_informative,
    estimated_parameters,
    excitation_refusal,
)
from expdesign.information.disturbed import score_augmented
from expdesign.information.prior import equation_noise, score_prior, stated_information
from expdesign.information.recorded import pooled, recorded_information
from expdesign.memory import recalled
from expdesign.progress import Progress, silent, within
from expdesign.reduction import at_reference_point
from expdesign.scenario import Scenario
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel, VesselModel
from expdesign.workflows.steps.measured import measured

if TYPE_CHECKING:
    from expdesign.foresight import Wanted


def designed(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    *,
    stated: VesselModel | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> DurationDesign:
    """The certified durations of a scored scenario; arguments as of `duration_problem`."""
    problem = duration_problem(case, information, stated=stated, seed=seed, progress=within(progress, 0.0, 0.8))
    progress("sharing out time", 0.8)
    try:
        return recalled(solve_durations, problem)
    except FloorOutOfReach as error:
        raise _not_revealed(case, error, [item.primitive for item in information], seed=seed) from None


def duration_problem(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    *,
    stated: VesselModel | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> DurationProblem:
    """Everything that the scenario's table [design] asks of the durations.

    Args:
        information: of its dictionary, by the nominal model.
        stated: model whose prior covariance design.prior means, where the vessel's own already counts the prior data;
            None for the vessel's own.
        seed: of the models drawn from the prior.

    Raises:
        InputError, UnknownName: settings that do not fit the vessel or the data.
        NoAnswer, NotInformative: no sharing meets them.
    """
    settings, vessel = case.design, case.vessel
    parameters = estimated_parameters(vessel.model, settings.fixed_parameters)
    equation = {term.name: term.equation for term in vessel.model.terms}
    equations, interest = tuple(equation[name] for name in parameters), settings.interest
    nuisance: tuple[str, ...] = ()
    primitives = [item.primitive for item in information]
    if settings.predictor != "model":
        progress("simulating disturbances with the dictionary", 0.0)
        wide = score_augmented(
            vessel,
            primitives,
            predictor=settings.predictor,
            environment=case.environment,
            fixed_parameters=settings.fixed_parameters,
            mean_subtraction=settings.mean_subtraction,
        )
        information, parameters, equations = wide.information, wide.parameters, wide.equations
        nuisance = tuple(name for name in wide.parameters if name not in wide.interest)
        interest = _still_estimated(interest or wide.interest, wide.interest, settings.predictor)
    if settings.excitation != "free":
        _check_excitation(case, information, parameters)
        interest = interest or parameters
    sampled: Sequence[Sequence[PrimitiveInformation]] = ()
    if settings.robust != "nominal":
        progress(f"simulating the dictionary with {settings.prior_samples} models of the prior", 0.1)
        sampled, _ = score_prior(
            vessel,
            primitives,
            samples=settings.prior_samples,
            rng=np.random.default_rng(seed),
            environment=case.environment,
            fixed_parameters=settings.fixed_parameters,
            mean_subtraction=settings.mean_subtraction,
        )
    return build_durations(
        information,
        parameters,
        total_s=settings.total_s,
        mean_subtraction=settings.mean_subtraction,
        aim=aim_of(case, parameters, interest, progress=within(progress, 0.4, 0.9)),
        constraints=constraints_of(case, primitives),
        prior=_prior(case, parameters, stated or case.vessel.model, means=information[0].Y.shape[1]),
        sampled=sampled,
        robust=settings.robust,
        equations=equations,
        nuisance=nuisance,
        floors=_least_information(case, primitives, seed=seed, progress=within(progress, 0.9, 1.0)),
        excitation=settings.excitation,
    )


def _check_excitation(case: Scenario, information: Sequence[PrimitiveInformation], parameters: tuple[str, ...]) -> None:
    """Refuse samples that do not inform about every parameter, by the manoeuvres that lack the condition."""
    settings = case.design
    allowed = [item for item in information if item.primitive.name not in settings.limits.excluded]
    try:
        check_informative(allowed or information, parameters, settings.mean_subtraction)
    except NotInformative as error:
        why = excitation_refusal(case.vessel.model, allowed or information, settings.excitation)
        blind = f"no information is left about {', '.join(error.parameters)}"
        raise NotInformative(f"{blind}: {why}", parameters=error.parameters) from None


def _still_estimated(interest: tuple[str, ...], estimated: tuple[str, ...], predictor: str) -> tuple[str, ...]:
    lost = [name for name in interest if name not in estimated]
    if lost:
        raise InputError(
            f"design.interest names {', '.join(lost)}, which predictor {predictor!r} does not estimate: without "
            "measured wind the terms of air fall together with those of water"
        )
    return interest


def aim_of(
    case: Scenario, parameters: tuple[str, ...], interest: tuple[str, ...], *, progress: Progress = silent
) -> Aim:
    """Criterion of [design] with its settings for named parameters."""
    settings, model = case.design, case.vessel.model
    size = np.abs(model.parameters) if settings.relative_to == "nominal" else model.parameter_std
    nominal = dict(zip(model.names, size.tolist(), strict=True))
    own = [name for name in parameters if name in nominal]
    noise = dict(zip(own, equation_noise(case.vessel, own).tolist(), strict=True))
    names: tuple[str, ...] = ()
    gradients = np.zeros((0, 0))
    if settings.outcomes:
        progress("simulating standard trials with other parameters", 0.0)
        values, slopes = outcome_gradients(
            case.vessel,
            settings.outcomes,
            own,
            speed_mps=settings.outcome_speed_mps,
            progress=progress,
        )
        names = tuple(settings.outcomes)
        units = np.array(
            [settings.outcome_units.get(name, abs(value)) for name, value in zip(names, values, strict=True)]
        )
        if not (units > 0).all():
            raise InputError(f"design.outcome_units needs a unit for {names[int(np.argmin(units))]}, which is 0")
        gradients = np.zeros((len(names), len(parameters)))
        gradients[:, [parameters.index(name) for name in own]] = slopes / units[:, None]
    own_samples = settings.criterion == "D" and settings.excitation != "free"  # shares of samples are no parameters
    return Aim(
        criterion="D_s" if own_samples else settings.criterion,
        interest=interest,
        unit=np.array([settings.parameter_units.get(name, nominal.get(name, 0.0)) for name in parameters]),
        noise=np.array([noise.get(name, 0.0) for name in parameters]),
        outcomes=names,
        gradients=gradients,
    )


def constraints_of(case: Scenario, primitives: Sequence[Primitive]) -> Constraints:
    """Limits of [design]."""
    limits = case.design.limits
    budgets = tuple(
        item
        if item.cost_per_s
        else replace(item, cost_per_s={run.name: cubed_propeller_speed(run) for run in primitives})
        for item in limits.budgets
    )
    return replace(limits, budgets=budgets)


def cubed_propeller_speed(primitive: Primitive) -> float:
    """Mean over the run of the sum of |n|^3 of all propellers and thrusters [rps3], a proxy for shaft power.

    Raises:
        InputError: the vessel is not driven by propeller speeds.
    """
    names = [name for name in primitive.commands.names if name[0] == "n" and name[1:].isdigit()]
    if not names:
        raise InputError(
            "design.budgets: use = 'cubed_propeller_speed' needs actuators with a propeller speed; give cost_per_s by "
            "primitive instead"
        )
    return float(sum(np.mean(np.abs(primitive.commands.column(name)) ** 3) for name in names))


def _prior(case: Scenario, parameters: tuple[str, ...], stated: VesselModel, *, means: int) -> Array | None:
    """Prior information per sample of the informative time; None without any."""
    settings, model = case.design, case.vessel.model
    complete = settings.mean_subtraction == MEAN_SUBTRACTIONS[-1]
    dimension, samples = len(parameters) + (means if complete else 0), settings.total_s / case.vessel.sample_time_s
    prior = np.zeros((dimension, dimension))
    if settings.prior == "parameter_std":
        own = [name for name in parameters if name in stated.names]
        index, places = [parameters.index(name) for name in own], [stated.names.index(name) for name in own]
        known, noise = np.zeros((len(parameters), len(parameters))), np.zeros(len(parameters))
        known[np.ix_(index, index)] = stated.parameter_covariance[np.ix_(places, places)]
        noise[index] = equation_noise(case.vessel, own)
        prior += stated_information(known, noise, dimension=dimension, samples=samples)
    if settings.prior_data:
        record = at_reference_point(measured(settings.prior_data, case.vessel), case.vessel.sensors)
        batches = recorded_information(
            record,
            model,
            parameters,
            predictor="basic-wind" if all(batch.wind is not None for batch in record.batches) else "basic",
            regressors="simulated",
        )
        matrix, rows = pooled(batches, settings.mean_subtraction)
        prior += matrix * rows * record.batches[0].sample_time_s / case.vessel.sample_time_s / samples
    return prior if prior.any() else None


def _least_information(
    case: Scenario, primitives: Sequence[Primitive], *, seed: int = 0, progress: Progress = silent
) -> tuple[InformationFloor, ...]:
    """What design.reveal and design.tell_apart ask of the durations."""
    run_s = np.array([item.duration_s for item in primitives])
    return tuple(
        InformationFloor(
            name=item.name,
            matrices=item.each * (case.design.total_s / run_s)[:, None, None],
            prior=item.prior,
            L=np.eye(len(item.prior))[:, len(item.prior) - item.columns :],
            least=item.least,
        )
        for item in _wanted(case, primitives, seed, progress)
    )


def _wanted(case: Scenario, primitives: Sequence[Primitive], seed: int, progress: Progress) -> tuple[Wanted, ...]:
    settings = case.design
    if not (settings.reveal or settings.tell_apart):
        return ()
    return recalled(
        _foreseen,
        case.vessel,
        tuple(primitives),
        case.environment,
        settings.reveal,
        settings.tell_apart,
        tuple(settings.reveal_sizes.items()),
        seed,
        progress=progress,
    )


def _foreseen(
    vessel: Vessel,
    primitives: tuple[Primitive, ...],
    weather: Environment,
    reveal: tuple[str, ...],
    apart: tuple[tuple[str, str], ...],
    sizes: tuple[tuple[str, float], ...],
    seed: int,
    progress: Progress = silent,
) -> tuple[Wanted, ...]:
    from expdesign.foresight import wanted  # what asks for no cause does not wait for the diagnosis

    return wanted(
        vessel, primitives, weather, reveal=reveal, apart=apart, sizes=dict(sizes), seed=seed, progress=progress
    )


def _not_revealed(case: Scenario, error: FloorOutOfReach, primitives: Sequence[Primitive], *, seed: int) -> NoAnswer:
    """The refusal with the best probability instead of the information."""
    from expdesign.export.foresight_page import size_text
    from expdesign.foresight import power, told_apart_with

    (item,) = [one for one in _wanted(case, primitives, seed, silent) if one.name == error.name]
    if item.apart_from:
        key, what = "tell_apart", f"tell {item.cause} ({item.effect}) from {item.apart_from}"
        best = told_apart_with(error.share * item.least)
    else:
        key, what = "reveal", f"reveal {item.cause} ({item.effect})"
        best = float(power(error.share * item.least, item.freedom, item.level))
    never = "; no time would do, as the standard deviations in the vessel file allow as much" if item.within_std else ""
    size = size_text(item.effect, item.size, item.unit)
    return NoAnswer(
        f"design.{key}: {case.design.total_s:g} s of this dictionary cannot {what} at {size} with a probability of "
        f"90 %; the best is {100.0 * best:.2g} %{never}"
    )


def design_document(design: DurationDesign, compared: Sequence[Efficiencies] | None = None) -> Document:
    """What a document says of durations.

    Args:
        compared: the design under every criterion, where tables are wanted: how long to run each primitive, every
            design under every criterion, and how limits are kept.
    """
    chosen = {name: count for name, count in zip(design.problem.names, design.repeats, strict=True) if count}
    certified = design.gap_relative if np.isfinite(design.gap_relative) else None
    guaranteed = design.certificate.guaranteed
    facts = {
        "criterion": design.problem.aim.criterion,
        **({"runs": chosen} if compared is None else {}),
        "certificate_gap": certified,
        **({} if np.isnan(guaranteed) else {"log_det": design.log_det, "log_det_guaranteed": guaranteed}),
        "efficiency_of_whole_runs": design.efficiency_repeats,
        "efficiency_of_equal_shares": design.efficiency_uniform,
        **{f"price_of_{kept.name}": kept.price for kept in limits_kept(design)},
    }
    tables = () if compared is None else (_shares_table(design), *_efficiency_tables(compared), *_limits_tables(design))
    notes = (f"Whole runs: {design.note}.",) if design.note else ()
    return Document(facts=facts, values={"runs": chosen}, sections=tabled(*tables), notes=notes)


def _shares_table(design: DurationDesign) -> Table:
    proof = design.certificate
    net = design.sensitivities - proof.prices
    told = [f"{value:.4f}" if kept else "excluded" for value, kept in zip(net, design.problem.included, strict=True)]
    columns = zip(design.problem.names, design.fractions, design.durations_s, design.repeats, told, strict=True)
    return Table(
        title=f"How long to run each primitive; at the optimum those used have sensitivity {proof.level:.6g}",
        header=("primitive", "share", "seconds", "whole runs", "sensitivity"),
        rows=tuple(
            (name, f"{share:.4f}", f"{seconds:.1f}", str(runs), sensitivity)
            for name, share, seconds, runs, sensitivity in columns
        ),
    )


def _efficiency_tables(compared: Sequence[Efficiencies]) -> tuple[Table, ...]:
    known = [item for item in compared if item.of]
    columns = list(known[0].of) if known else []
    tables = [
        Table(
            title="Efficiency of designs by every criterion, 1 for its own optimum",
            header=("criterion", "makes least", *columns),
            rows=tuple((item.criterion, item.title, *(f"{item.of[name]:.3f}" for name in columns)) for item in known),
        )
    ]
    missing = tuple((item.criterion, item.missing) for item in compared if item.missing)
    if missing:
        tables.append(Table(title="Criteria not compared", header=("criterion", "because"), rows=missing))
    return tuple(tables)


def _limits_tables(design: DurationDesign) -> tuple[Table, ...]:
    rows = tuple(
        (item.name, f"{item.limit:.5g}", f"{item.continuous:.5g}", f"{item.repeats:.5g}", f"{item.price:.3g}")
        for item in limits_kept(design)
    )
    header = ("limit", "asked", "optimal shares", "whole runs", "price")
    return (Table(title="Limits on the durations", header=header, rows=rows),) if rows else ()
