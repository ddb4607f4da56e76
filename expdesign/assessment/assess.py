"""Estimates by several methods with their diagnostics, and the choice of methods, instruments and final estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.assessment.actuator_times import (
    delivered_anew,
    found_times,
    known_times,
    with_held_noted,
    with_times,
    with_times_noted,
)
from expdesign.assessment.held_out import HeldOut, ranked
from expdesign.assessment.misfit import AHEAD_S, ESTIMATION, TEST, Limits, check_run, decomposed, one_step
from expdesign.assessment.prior import PARAMETER_STD, apart_from_stated, check_prior, with_prior
from expdesign.assessment.trials import Trial, Work, attempted, horizons_of, predictions_of, prefixed, starts_of, tried
from expdesign.assessment.unstated import answers, current
from expdesign.assessment.values import CONTINUOUS, HELD_OUT, Assessed, Assessment, Disturbances, EstimateOptions
from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NoAnswer, NotInformative
from expdesign.estimation.disturbance import combined_moments, current_moments, measured_wind, tells_current
from expdesign.estimation.excitation import EQUATION_WISE, check_excitation, worst_case
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import Method, estimate, method_for, method_named
from expdesign.estimation.output_error import ActuatorTime, Begun
from expdesign.estimation.regression import CURRENT, STEADY
from expdesign.estimation.replay import Integration
from expdesign.estimation.values import Estimate
from expdesign.progress import Progress, in_phases, silent
from expdesign.reduction import reduced
from expdesign.signals import Record
from expdesign.vessel import Vessel

MOST_BY_ITSELF = 20_000  # samples, averaged, up to which output error is tried without being asked for
# how long one method takes, predictions of what is left out and the decomposition, for the progress told
METHOD_WORK, PREDICTION_WORK, DECOMPOSITION_WORK = 0.9, 0.9, 0.1
FEWEST_SPARE = 10  # samples beyond the parameters of an equation, of which a standard deviation is known within 22 %
NO_TESTS = Record(batches=())


def default_methods(vessel: Vessel, record: Record) -> tuple[str, ...]:
    """Least squares and instrumental variables; before them those that use the wind, when measured and modelled."""
    if uses_measured_wind(vessel, record):
        return ("iv-wind", "iv-air", "ls-air", "iv", "ls")
    return ("ls", "iv")


def uses_measured_wind(vessel: Vessel, record: Record) -> bool:
    """Whether wind is measured in every run and acts in the model."""
    return vessel.model.reads_air and all(batch.wind is not None for batch in record.batches)


def settled(
    vessel: Vessel, raw: Record, options: EstimateOptions, *, smoothed: bool = False, progress: Progress = silent
) -> tuple[Vessel, Record]:
    """The vessel with dead times and lags as its data show them, and the data that it delivers.

    Times are those that the first requested method of output error finds, where the vessel's file states a standard
    deviation of one; else they are the file's.

    Args:
        vessel: as its file states it.
        raw: with commands as inputs.
        smoothed: whether velocities from the pose are smoothed, as in `reduced`.

    Raises:
        InputError, NoAnswer: as of `assess`.
    """
    methods = [method for name in options.methods if (method := method_named(name)).solver == "oe"]
    if not methods:
        return vessel, reduced(raw, vessel, smoothed=smoothed)

    def attempt(ship: Vessel, record: Record, times: tuple[ActuatorTime, ...]) -> Estimate:
        work = Work(vessel=ship, stated=vessel, record=record, options=options)
        *_, horizon_s = (None, *(item for item in horizons_of(work) if item is not None))
        work = replace(work, options=replace(options, horizon_s=horizon_s))
        return attempted(work, ship, work.seen(record), methods[0], times=times, progress=progress)

    try:
        return delivered_anew(raw, vessel, attempt, smoothed=smoothed)
    except NoAnswer:  # told by the assessment, which keeps the other methods
        return vessel, reduced(raw, vessel, smoothed=smoothed)
    except InputError as error:
        raise prefixed(error, methods[0]) from None


def _check_count(vessel: Vessel, record: Record, fixed: Sequence[str]) -> None:
    """Raise NotInformative where an equation has hardly more samples than parameters: any noise is fitted then."""
    for axis, equation in enumerate(OUTPUTS):
        names = {term.name for term in vessel.model.terms if term.equation == equation} - set(fixed)
        count = sum(int(np.isfinite(batch.velocity[:, axis]).sum()) for batch in record.batches)
        if names and count < len(names) + FEWEST_SPARE:
            raise NotInformative(
                f"the data have {count} samples of {equation}, whose equation has {len(names)} parameters, expected "
                f"{len(names) + FEWEST_SPARE} or more: fewer do not show how uncertain an estimate is",
                parameters=tuple(sorted(names)),
            )


def to_fix(vessel: Vessel, record: Record) -> tuple[str, ...]:
    """Parameters that have to be held for the data to have an estimate by least squares of all others.

    Args:
        record: with delivered inputs, as of `reduced`.

    Raises:
        InputError, NoAnswer: there is no estimate, whatever is held.
    """
    fixed: tuple[str, ...] = ()
    while True:
        try:
            _check_count(vessel, record, fixed)
            estimate(record, vessel.model, method="ls", settings=Settings(fixed=fixed))
        except NotInformative as error:
            if not error.fix or set(error.fix) & set(fixed):
                raise
            fixed = (*fixed, *error.fix)
        else:
            return fixed


def assess(
    vessel: Vessel,
    record: Record,
    options: EstimateOptions | None = None,
    *,
    tests: Record = NO_TESTS,
    stated: Vessel | None = None,
    progress: Progress = silent,
) -> Assessment:
    """Estimate by every method, and simulate every run with every estimate.

    A method without an estimate is listed in `failures`, as long as another one has one.

    Args:
        record: estimation data.
        tests: runs that are simulated but not used.
        stated: as the vessel's file has it, where `vessel` has dead times or lags that were found since.

    Raises:
        InputError: the data lack what every method needs, or a name is unknown.
        NotInformative: there are too few samples, or parameters that the data cannot separate; the message names them.
        Diverged: no stable model to make instruments with.
    """
    options = options or EstimateOptions()
    if options.prior == PARAMETER_STD:
        check_prior(vessel.model, vessel.name)
    else:
        _check_count(vessel, record, options.fixed)
    work = Work(vessel=vessel, stated=stated or vessel, record=record, options=options)
    names = dict.fromkeys(options.methods or default_methods(vessel, record))
    notes: tuple[str, ...] = ()
    if not options.methods and options.choice == HELD_OUT:
        own, notes = _output_error_too(work)
        names |= dict.fromkeys(own)
    methods = [method_named(name) for name in names]
    *each, predicting, decomposing = in_phases(
        progress, *[METHOD_WORK] * len(methods), PREDICTION_WORK, DECOMPOSITION_WORK
    )
    trials, failures = tried(work, methods, each)
    compared: tuple[HeldOut, ...] = ()
    if options.choice == HELD_OUT and (len(trials) > 1 or trials[0].method.solver == "oe"):
        predicting("predicting runs that are left out", 0.0)
        beside = starts_of(work, trials)
        compared = predictions_of(work, [*trials, *beside])
        trials = _kept(trials, beside, ranked(compared))
    done = [_assessed(work, tests, trial) for trial in trials]
    chosen = preferred(done, compared)
    if options.prior != PARAMETER_STD:  # with the prior, its contradiction is told of every method
        best = done[chosen].estimate
        best = replace(best, warnings=(*best.warnings, *apart_from_stated(best, vessel.model)))
        done[chosen] = replace(done[chosen], estimate=best)
    decomposing("decomposing the misfit", 0.0)
    return Assessment(
        record=record,
        tests=tests,
        methods=tuple(done),
        failures=failures,
        notes=notes,
        asked=options.methods,
        compared=compared,
        chosen=chosen,
        mean=options.mean,
        fixed=options.fixed,
        motion=options.motion,
        prior=options.prior,
        limits=limits_of(done[chosen], options.integration, progress=decomposing),
    )


def with_unstated(
    vessel: Vessel, raw: Record, options: EstimateOptions, found: Assessment, *, smoothed: bool = False
) -> Assessment:
    """An assessment with the current and the answers to inputs that nobody stated, as output error shows them.

    Where none is among its methods, one is made for this: what nobody stated passes into the other estimates as well;
    of long data only if it is asked for, which is told.

    Args:
        raw: with commands as inputs.
        smoothed: as in `settled`.
    """
    if options.motion != CONTINUOUS:
        return found
    try:
        own = _output_error_of(vessel, options, found)
    except (InputError, NoAnswer, np.linalg.LinAlgError) as error:
        note = f"Whether there is a current or a dead time that nobody stated is not known: {error}."
        return replace(found, notes=(*found.notes, note))
    if own is None:
        return found
    method, held, flow, notes = own.method, own.found, None, list(found.notes)

    def again(ship: Vessel, record: Record, times: tuple[ActuatorTime, ...]) -> Estimate:
        work = Work(vessel=ship, stated=ship, record=record, options=replace(options, horizon_s=own.horizon_s))
        begun = Begun(values=dict(zip(held.names, held.values, strict=True)), horizon_s=own.horizon_s)
        free = attempted(work, ship, work.seen(record), method, times=times, begun=begun)
        return _informed(free, ship, options)  # as the one that it is compared with

    try:
        if not method.weather.steady:
            method = method_for("oe", STEADY, wind=method.weather.wind) or method
            free = again(vessel, found.record, known_times(vessel, vessel, found.record))
            flow = current(held, free)
            method, held = (own.method, held) if flow is None else (method, free)
    except (InputError, NoAnswer, np.linalg.LinAlgError) as error:
        method = own.method
        notes.append(f"Whether there is a current that nobody stated is not known: {error}.")
    try:
        late = answers(held, raw, vessel, again, smoothed=smoothed)
    except (InputError, NoAnswer, np.linalg.LinAlgError) as error:
        late = ()
        notes.append(f"Whether inputs are answered when the vessel file says is not known: {error}.")
    return replace(found, current=flow, answers=late, notes=tuple(notes))


def _output_error_of(vessel: Vessel, options: EstimateOptions, found: Assessment) -> Trial | None:
    """Output error of an assessment, the chosen one first; else one made in the same weather; refused for long data."""
    item = next((item for item in (found.best, *found.methods) if item.method.solver == "oe"), None)
    if item is not None:
        return Trial(method=item.method, horizon_s=item.horizon_s, found=item.estimate, start=item.start)
    weather, horizon_s = found.best.method.weather, options.horizon_s or AHEAD_S
    method = method_for("oe", weather.unknown, wind=weather.wind)
    work = Work(vessel=vessel, stated=vessel, record=found.record, options=replace(options, horizon_s=horizon_s))
    record = work.seen(found.record)
    if method is None:
        return None
    if (samples := sum(map(len, record.batches))) > MOST_BY_ITSELF:
        raise NoAnswer(f"only output error tells, asked for by --method {method.name}, as there are {samples} samples")
    own = attempted(work, vessel, record, method, times=known_times(vessel, vessel, found.record))
    return Trial(method=method, horizon_s=horizon_s, found=_informed(own, vessel, options), start="")


def _informed(found: Estimate, vessel: Vessel, options: EstimateOptions) -> Estimate:
    """An estimate joined with the vessel file's prior, where that is asked for."""
    return with_prior(found, vessel.model) if options.prior == PARAMETER_STD else found


def _kept(trials: Sequence[Trial], beside: Sequence[Trial], best: Sequence[int]) -> list[Trial]:
    """One estimate of each method, with the horizon that predicts best; of those beside them, only the best of all."""
    found = [*trials, *beside]
    of_method: dict[str, int] = {}
    for place in best:
        if place < len(trials) or place == best[0]:
            of_method.setdefault(found[place].method.name, place)
    return [found[place] for place in sorted(of_method.values())]


def _output_error_too(work: Work) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The method of output error that is tried without being asked for, if the data are not too long, and notes."""
    if work.options.motion != CONTINUOUS:
        return (), ()
    name = "oe-air" if uses_measured_wind(work.vessel, work.record) else "oe"
    samples = sum(map(len, work.seen(work.record).batches))
    if samples <= MOST_BY_ITSELF:
        return (name,), ()
    return (), (
        f"Output error is not tried by itself on more than {MOST_BY_ITSELF} samples, averaged to what the "
        f"motion asks for; there are {samples}. Ask for it with --method ls iv {name}.",
    )


def limits_of(item: Assessed, integration: Integration, *, progress: Progress = silent) -> tuple[Limits, ...]:
    """The decomposed misfit of every run simulated with an estimate."""
    wind, found = item.method.weather.wind, []
    total = sum(len(run.batch) for run in item.runs)
    for run in item.runs:
        found.append(decomposed(item.model, run, item.estimate, wind=wind, integration=integration))
        progress("decomposing the misfit", sum(len(done.batch) for done in item.runs[: len(found)]) / total)
    return tuple(found)


def preferred(found: Sequence[Assessed], compared: Sequence[HeldOut] = ()) -> int:
    """Index of the stable estimate that predicts best; without a comparison, of the first stable one with instruments.

    An estimate is stable if its model can simulate every run. Where none is, that counts which can simulate most.
    """
    failed = [sum(bool(run.problem) for run in item.runs) for item in found]
    stable = [index for index, count in enumerate(failed) if count == min(failed)]
    names = [found[index].method.name for index in stable]
    for place in ranked(compared):
        if compared[place].method.name in names:
            return stable[names.index(compared[place].method.name)]
    return next((index for index in stable if found[index].uses_instruments), stable[0])


def _assessed(work: Work, tests: Record, trial: Trial) -> Assessed:
    vessel, record, options, method = work.vessel, work.record, work.options, trial.method
    found = _informed(trial.found, vessel, options)
    wind = method.weather.wind
    now = with_times(vessel, found_times(found, vessel))
    found = with_held_noted(with_times_noted(found, record, work.stated, vessel), record, work.stated)
    model = found.model(now.model)
    runs = [
        check_run(model, batch, use=use, wind=wind, integration=options.integration)
        for use, part in ((ESTIMATION, record), (TEST, tests))
        for batch in part.batches
    ]
    breaches = check_excitation(record, vessel.model, worst=worst_case(vessel.sensors), wind_measured=wind)
    if options.samples == EQUATION_WISE and method.solver != "oe":
        breaches = ()  # no equation uses the samples that break it
    return Assessed(
        method=method,
        horizon_s=trial.horizon_s,
        estimate=found,
        start=trial.start,
        model=model,
        runs=tuple(runs),
        one_step=one_step(record, vessel.model, found, fixed=options.fixed, quadrature=options.quadrature),
        breaches=breaches,
        disturbances=_disturbances(found, record, vessel, method),
        std=now.std,
    )


def _disturbances(found: Estimate, record: Record, vessel: Vessel, method: Method) -> Disturbances:
    noise, weather = vessel.sensors.heading_rad, method.weather
    tells = (weather.steady or CURRENT in weather.disturbances) and tells_current(found)
    return Disturbances(
        current=current_moments(found, heading_std_rad=noise) if tells else None,
        combined=combined_moments(found, heading_std_rad=noise),
        wind=measured_wind(record) if method.weather.wind else None,
    )
