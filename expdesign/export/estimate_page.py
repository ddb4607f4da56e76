"""The page about an estimation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from markupsafe import Markup

from expdesign.assessment import Assessed, Assessment, sentence
from expdesign.assessment.misfit import AHEAD_S
from expdesign.conventions import plus_minus
from expdesign.estimation.excitation import sample_notes
from expdesign.export import words
from expdesign.export.document import Document, Figure, Items, Section, Table, filled, notes_of, section
from expdesign.export.estimate_figures import autocorrelation_figure, interval_figure, residual_figure, run_figure
from expdesign.export.files import (
    breach_sentences,
    disturbance_table,
    estimate_values,
    failure_rows,
    fit_table,
    limit_table,
    motion_words,
    parameter_table,
    prediction_table,
    rows_by_equation,
    unstable_warning,
    unstated_sentences,
)
from expdesign.vessel import LEAST_KEPT, NOT_ACTING_BACK, Vessel, VesselModel

FAST_DECAY = 1e-3  # growth of an initial error below which the table says that it decays
DRAWN_METHODS = 3  # largest number of methods in the figures of runs
STEERED_WORDS = {"use": "used", "leave-out": "left out", "planned": "instruments from planned inputs"}


def summary(found: Assessment, vessel: Vessel) -> list[str]:
    """The estimated parameters and the data, in a few sentences."""
    best = found.best
    batches = found.record.batches
    seconds = sum(len(batch) * batch.sample_time_s for batch in batches)
    samples = sum(len(batch) for batch in batches)
    tests = words.counted(len(found.tests.batches), "run")
    apart = f" Test data, not used for estimation: {tests}." if found.tests.batches else ""
    fixed = f" Fixed parameters: {', '.join(found.fixed)}." if found.fixed else ""
    return [
        f"Estimated: {words.counted(len(best.estimate.names), 'parameter')} of {vessel.name}, from "
        f"{words.counted(len(batches), 'run')} with {words.counted(samples, 'sample')} in {words.duration(seconds)}."
        f"{apart}{fixed}",
        f"The file vessel-estimated.toml holds the estimate by {best.method.title} ({best.method.name}).",
        _fit_sentence(best),
    ]


def _fit_sentence(best: Assessed) -> str:
    kinds = [(use, [run for run in best.runs if run.use == use]) for use in ("estimation", "test")]
    parts = []
    for use, runs in kinds:
        fits = np.array([run.fit_percent for run in runs if not run.problem])
        if len(fits) and np.isfinite(fits).any():
            medians = ", ".join(
                f"{name} {words.number(float(np.nanmedian(column)), 0)}{words.NB}%"
                for name, column in zip(best.model.outputs, fits.T, strict=True)
                if np.isfinite(column).any()
            )
            parts.append(f"{medians} on the {use} runs{' that do not diverge' * (len(fits) < len(runs))}")
        if len(fits) < len(runs):
            parts.append(f"{len(runs) - len(fits)} of {words.counted(len(runs), f'{use} run')} diverged")
    return f"Fit of its simulations, median over runs: {'; '.join(parts)}." if parts else "No run could be simulated."


def advice(found: Assessment) -> list[str]:
    """Advice on the choice of the estimate, from the residuals of these data."""
    best = found.best
    lag = best.one_step.autocorrelation[1]
    sentences = [*([found.why] if found.why else []), *unstable_warning(found), *out_of_range(best.model)]
    if (lag < -0.25).any():
        sentences.append(
            f"Successive residuals of {_names(best, lag < -0.25)} are negatively correlated. This indicates "
            "measurement noise in the velocities, which biases least squares."
        )
    if (lag > 0.25).any():
        sentences.append(
            f"Successive residuals of {_names(best, lag > 0.25)} are positively correlated. The model lacks a slow "
            "effect, such as wind, current, waves or a term. No method is consistent with a wrong model structure, "
            "and the standard deviations do not include this error. The command diagnose searches for the cause."
        )
    sentences += unstated_sentences(found)
    if not best.stable:
        sentences.append(
            "No estimate can simulate every run, so none is ready for use. Runs with smaller unmodelled effects help, "
            "and a model with fewer terms."
        )
    return sentences


def out_of_range(model: VesselModel) -> list[str]:
    """A sentence where hardly any ship that an estimate allows has the signs that the vessel file states."""
    if not model.parameter_range or model.share_in_range() >= LEAST_KEPT:
        return []
    values, ranges = dict(zip(model.names, model.parameters.tolist(), strict=True)), model.parameter_range
    beyond = [name for name, (low, high) in ranges.items() if not low <= values[name] <= high]
    where = f", most of all by {', '.join(beyond)}" if beyond else ""
    return [
        "Hardly any ship that these errors allow is within the ranges of parameters that the vessel file states"
        f"{where}. No plan can be tried with ships of vessel-estimated.toml: --prior parameter_std joins what the "
        "file knew before, and more runs tell more."
    ]


def _names(best: Assessed, chosen: np.ndarray) -> str:
    return " and ".join(name for name, is_in in zip(best.one_step.outputs, chosen, strict=True) if is_in)


FACTOR = 1.959964  # standard deviations to either side that hold 95 % of a normal distribution
LIMIT_HEADER = (
    "Run", "Output", "Fit", "Constant force", "Slow forces", "Fast forces, noise", "Uncertain parameters, among these",
    "Fit limit by noise", "Error growth over the run", f"Error of {AHEAD_S:g} s prediction",
)  # fmt: skip


def estimate_document(found: Assessment, ship: Vessel) -> Document:
    """The estimates for people, with the ship as it was before."""
    step_s, batches = found.record.batches[0].sample_time_s, found.record.batches
    return Document(
        kind="Estimated manoeuvring model",
        title=ship.name,
        name=f"Estimate {ship.name}",
        about=f"{words.ship(ship)}; sample time {step_s:g} s",
        findings=tuple(summary(found, ship)),
        facts={
            "runs": len(batches),
            "samples": sum(len(batch) for batch in batches),
            "runs_kept_apart": len(found.tests.batches),
            "vessel_file_holds": found.best.method.name,
        },
        values=estimate_values(found),
        sections=filled(
            _parameters(found, ship.model),
            *_choice(found),
            _fit(found),
            _limits(found),
            *_runs(found),
            _residuals(found),
            *_methods(found),
            section("Current and wind", disturbance_table(found), DISTURBANCES),
            section("Samples used", used_samples(found)),
            section("Not estimated or not checked", Table(header=("Method", "Why"), rows=failure_rows(found), texts=2)),
        ),
        notes=(*([] if ship.pendulum is None else [NOT_ACTING_BACK]), *_data_notes(found)),
    )


def _parameters(found: Assessment, model: VesselModel) -> Section:
    explained = tuple(f"{item.method.name}\n\u00b1 standard deviation, 95 % interval" for item in found.best_first)
    of_page = Table(
        header=("Parameter\nits term", "Before", *explained),
        rows=parameter_rows(found, model),
        shaded=2,
        on="page",
    )
    return section(
        "Parameters",
        of_page,
        parameter_table(found),
        f"{motion_words(found)} The model is in {model.form} form. The shaded column is written to the "
        "vessel file. The standard deviations account for correlated residuals. They measure random error only, not "
        "errors of the model structure.",
        Figure(
            draw=partial(interval_figure, found.best_first, found.best),
            caption="Estimates of all methods with 95 % intervals. A parameter may be absent from the true ship if its "
            "interval contains zero.",
        ),
    )


def _choice(found: Assessment) -> Iterator[Section]:
    """Which estimate to use."""
    yield section("Which estimate to use", *notes_of(advice(found)), Items(METHODS_IN_WORDS))
    predictions = prediction_table(found)
    yield section(predictions.title, predictions, PREDICTIONS, level=3)
    broken = [
        *sample_notes(found.best.estimate.residuals),
        *breach_sentences(found.best.breaches, len(found.record.batches)),
    ]
    holds = "It holds in all runs, for the noise stated in the vessel file and no current."
    yield section("Excitation condition", *(notes_of(broken) or (holds,)), level=3)


def _fit(found: Assessment) -> Section:
    winds = any(item.method.weather.wind for item in found.methods)
    still = "in still water" + ", and, for methods with wind, in the measured wind" * winds
    return section(
        "Fit of the simulated output",
        f"Each run is simulated from its first measured velocity with the measured inputs, {still}. 100 % is a perfect "
        "fit. 0 % is as good as the mean of the measured velocity. Negative values are possible. A real current, "
        "sensor noise and the accumulation of errors in long runs all lower the fit, even of a perfect model.",
        fit_table(found),
    )


def _limits(found: Assessment) -> Section:
    return section(
        f"Causes of misfit of {found.best.method.name}",
        MISFIT,
        Table(header=LIMIT_HEADER, rows=limit_rows(found), texts=2, on="page"),
        limit_table(found),
    )


def _runs(found: Assessment) -> Iterator[Section]:
    """Every run as it was measured, and simulated by the best method and those that simulate most runs."""
    best, *others = found.best_first
    others.sort(key=lambda item: sum(bool(run.problem) for run in item.runs))
    drawn = (best, *others)[:DRAWN_METHODS]
    figures = []
    for number, (limits, run) in enumerate(zip(found.limits, found.best.runs, strict=True)):
        use = "test run, not used for estimation" if run.use == "test" else "used for estimation"
        about = " \u00b7 ".join([use, *([run.problem] if run.problem else [])])
        caption = Markup("<b>{}</b> \u00b7 {}<br>{}").format(run.batch.name, about, sentence(limits, run))
        figures.append(Figure(draw=partial(run_figure, number, drawn), caption=caption, above=True))
    yield section("Run by run", *figures)


def _residuals(found: Assessment) -> Section:
    best, names = found.best, tuple(batch.name for batch in found.record.batches)
    step_s = found.record.batches[0].sample_time_s
    rows = [
        (
            item.method.name,
            _listed(item.one_step.outputs, item.one_step.explained.tolist(), 3),
            _listed(item.one_step.outputs, item.one_step.autocorrelation[1].tolist(), 2),
        )
        for item in found.best_first
    ]
    header = ("Method", "Explained share of the sample-to-sample variance", "Correlation of successive residuals")
    return section(
        f"Residuals of {best.method.name}",
        Figure(
            draw=partial(residual_figure, best, names, step_s),
            caption="One-step prediction errors, as accelerations. Dotted lines separate the runs.",
        ),
        Figure(
            draw=partial(autocorrelation_figure, best, step_s),
            caption="Autocorrelation of the residuals. White residuals stay in the grey band. A value near "
            "\u22120.5 at the first lag indicates measurement noise. A slow decay indicates a slow effect that is "
            "missing from the model.",
        ),
        Table(header=header, rows=rows, texts=3, on="page"),
        "With noisy velocities the explained share is small or negative even for a good model: the noise of a "
        "difference exceeds the motion between two samples. A small share is then no evidence against an estimate.",
    )


def _methods(found: Assessment) -> Iterator[Section]:
    """How each method worked, and what it warns of."""
    yield section("Methods and warnings")
    for item in found.best_first:
        diverged = tuple(f"Simulation fails: {run.problem}." for run in item.runs if run.problem)
        warnings = notes_of((*item.estimate.warnings, *diverged), of=item.method.name)
        title = f"{item.method.name}: {item.method.title}"
        yield section(title, _how(found, item), *(warnings or ("No warnings.",)), level=3)


def _how(found: Assessment, item: Assessed) -> str:
    """Where the instruments of a method come from."""
    if not item.uses_instruments:
        return "No instruments."
    source = "the parameters of the vessel file" if item.start == "nominal" else "the least-squares estimate"
    refined = words.counted(item.estimate.refinements, "time")
    return f"The first instruments are simulated with {source}, and refined {refined}. Subtracted mean: {found.mean}."


def used_samples(found: Assessment) -> Table:
    """Samples used by each method and equation, those marked as steered, what became of these; where they differ."""
    residuals = [item.estimate.residuals for item in found.best_first]
    marked = any(batch.steered is not None for batch in found.record.batches)
    rows = [
        (
            item.method.name,
            str(item.estimate.residuals.rows),
            ", ".join(f"d{name}/dt {count}" for name, count in rows_by_equation(item).items()),
            str(steered.samples),
            STEERED_WORDS[steered.treatment] if steered.samples else "",
        )
        for item in found.best_first
        for steered in (item.estimate.steered,)
        if marked or any((own.rows_of < own.rows).any() for own in residuals)
    ]
    header = ("Method", "Samples used", "By equation", "Marked as steered", "Treatment of these")
    return Table(header=header, rows=rows, texts=5)


METHODS_IN_WORDS = (
    Markup(
        "<b>Least squares</b> (ls) is consistent only if the velocities are measured without noise and every force is "
        "modelled. It has the smallest variance. With little noise it is a good choice."
    ),
    Markup(
        "<b>Instrumental variables</b> (iv) remain consistent with noisy velocities under three conditions. The "
        "simulated instruments follow the true motion. No disturbance is correlated with the inputs; feedback from a "
        "noisy measurement to the inputs breaks this. The excitation condition holds: every velocity inside an "
        "absolute value keeps its sign and stays clear of zero."
    ),
    Markup(
        "<b>Output error</b> (oe, or oe-air with the measured wind) minimises the simulation error. It needs neither "
        "instruments nor the excitation condition. Over whole runs it is the most accurate method if the sensors are "
        "the only disturbance. If weather acts, or the ship is course-unstable, a horizon stops errors from "
        "accumulating."
    ),
    Markup(
        "<b>Augmented</b> methods also estimate an unknown mean current and wind. Methods <b>with measured wind</b> "
        "use the anemometer; in strong wind only they are suitable. Without wind in the model, the hydrodynamic "
        "parameters absorb the wind force."
    ),
    "A good fit on test runs is stronger evidence than a small standard deviation.",
)
PREDICTIONS = (
    "Runs are left out in turn, or pieces of a few; every method estimates from the rest and predicts what was left "
    "out, from measured velocities. Each error is a geometric mean over runs; 100 is no better than a constant."
)
MISFIT = (
    "The misfit of a simulation is the accumulated effect of its one-step errors. These are split into their mean over "
    "the run, their slow part and the rest. Each share of the squared misfit is computed by propagating one part "
    "alone; shares are negative where parts cancel, and add up to all of it. Errors of the parameters as large as "
    "stated are no further part: they act through these. The last column predicts from measured velocities and is "
    "relative to the standard deviation of the motion. If it is small while the fit is bad, errors accumulate or the "
    "ship is unstable; the model itself can still be useful."
)
DISTURBANCES = (
    "Velocities to north (N) and east (E) over ground, with standard deviations to first order. Mean current and "
    "second moments are estimated from nuisance parameters. The sum of the variances is not among them: it is a "
    "constant, which instruments without mean do not see. Without measured wind, drag terms of water and air coincide, "
    "and only a combination of current and wind can be estimated."
)


def _data_notes(found: Assessment) -> tuple[str, ...]:
    """Notes on the files, doubts first, and on methods without an answer."""
    return tuple(dict.fromkeys([*found.record.doubts, *found.record.notes, *found.tests.notes, *found.left_out]))


def parameter_rows(found: Assessment, model: VesselModel) -> list[tuple[str, ...]]:
    """Every parameter of the model: its term, value before, and value with deviation and 95 % interval per method."""
    return [
        (
            f"{term.name}\n{term.expression} in d{term.equation}/dt",
            words.significant(float(value)),
            *(_cell(item, term.name) for item in found.best_first),
        )
        for term, value in zip(model.terms, model.parameters, strict=True)
    ]


def _cell(item: Assessed, name: str) -> str:
    estimate = item.estimate
    if name not in estimate.names:
        return f"{words.significant(estimate.held[name])}\nnot estimated"
    index = estimate.names.index(name)
    value, std = float(estimate.values[index]), float(estimate.std[index])
    low, high = (words.significant(value + sign * FACTOR * std) for sign in (-1, 1))
    return f"{plus_minus(value, std)}\n{low} to {high}".replace("-", words.MINUS)


def limit_rows(found: Assessment) -> list[tuple[str, ...]]:
    """One row per run and output: fit, shares of the misfit, ceiling, growth, error ahead."""
    rows = []
    for limits, run in zip(found.limits, found.best.runs, strict=True):
        for index, output in enumerate(limits.outputs):
            shares = (limits.constant, limits.slow, limits.quick, limits.parameters)
            rows.append(
                (
                    run.batch.name if index == 0 else "",
                    output,
                    _percent(run.fit_percent[index]),
                    *(_percent(100 * share[index]) for share in shares),
                    _percent(limits.ceiling_percent[index]),
                    _growth(limits.growth) if index == 0 else "",
                    _percent(100 * limits.ahead_share[index]),
                )
            )
    return rows


def _growth(factor: float) -> str:
    """Growth of an initial error; "" where it is not known."""
    if not math.isfinite(factor):
        return ""
    return "decays" if factor < FAST_DECAY else f"\N{MULTIPLICATION SIGN}{words.significant(factor, 2)}"


def _percent(value: float) -> str:
    return f"{words.number(float(value), 0)}{words.NB}%" if math.isfinite(value) else "-"


def _listed(outputs: tuple[str, ...], values: list[float], decimals: int) -> str:
    texts = ("-" if math.isnan(value) else words.number(value, decimals) for value in values)
    return ", ".join(f"{name} {text}" for name, text in zip(outputs, texts, strict=True))
