"""The page about an estimation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from expdesign.assessment import Assessed, Assessment, sentence
from expdesign.assessment.tuning import TUNING as ASSESSMENT_TUNING
from expdesign.estimation.excitation import sample_notes
from expdesign.export import words
from expdesign.export.estimate_page.figures import autocorrelation_figure, interval_figure, residual_figure, run_figure
from expdesign.export.files import (
    breach_sentences,
    disturbance_table,
    fit_table,
    motion_words,
    plus_minus,
    prediction_table,
    prediction_title,
    unstable_warning,
)
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style
from expdesign.progress import Progress, in_phases, silent
from expdesign.vessel import Vessel

FAST_DECAY = 1e-3  # growth of an initial error below which the table says that it decays
DRAWN_METHODS = 3  # largest number of methods in the figures of runs
DRAWING_LOADS = 3.0  # how many figures could be drawn while the library for them loads, for the progress told


# The content of the page.


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateContent:
    """The values that the page shows."""

    vessel: Vessel  # as it was before the estimation
    found: Assessment  # the estimates and their assessment
    command: str  # the command line that reproduces the result
    version: str  # of the program

    @property
    def drawn(self) -> tuple[Assessed, ...]:
        """The methods whose simulations are drawn: the one in the vessel file, then those that simulate most runs."""
        others = [item for item in self.found.methods if item is not self.found.best]
        others.sort(key=lambda item: sum(bool(run.problem) for run in item.runs))
        return (self.found.best, *others)[:DRAWN_METHODS]


# Sentences on an estimation: its parameters and data, and which estimate to use.


def summary(content: EstimateContent) -> list[str]:
    """The estimated parameters and the data, in a few sentences."""
    found, best = content.found, content.found.best
    batches = found.record.batches
    seconds = sum(len(batch) * batch.sample_time_s for batch in batches)
    samples = sum(len(batch) for batch in batches)
    tests = words.counted(len(found.tests.batches), "run")
    apart = f" Test data, not used for estimation: {tests}." if found.tests.batches else ""
    fixed = f" Fixed parameters: {', '.join(found.fixed)}." if found.fixed else ""
    return [
        f"Estimated: {words.counted(len(best.estimate.names), 'parameter')} of {content.vessel.name}, from "
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


def conditions(content: EstimateContent) -> list[str]:
    """Where the data of the chosen estimate break the excitation condition."""
    best = content.found.best
    chosen = sample_notes(best.estimate.residuals)
    return [*chosen, *breach_sentences(best.breaches, len(content.found.record.batches))]


def advice(content: EstimateContent) -> list[str]:
    """Advice on the choice of the estimate, from the residuals of these data."""
    best = content.found.best
    lag = best.one_step.autocorrelation[1]
    sentences = [*([content.found.why] if content.found.why else []), *unstable_warning(content.found)]
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
    if not best.stable:
        sentences.append(
            "No estimate can simulate every run, so none is ready for use. Runs with smaller unmodelled effects help, "
            "and a model with fewer terms."
        )
    return sentences


def _names(best: Assessed, chosen: np.ndarray) -> str:
    return " and ".join(name for name, is_in in zip(best.one_step.outputs, chosen, strict=True) if is_in)


DRAWING = "drawing the report"
FACTOR = 1.959964
"""Standard deviations to either side that hold 95 % of a normal distribution."""


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """A parameter with one cell per method."""

    name: str
    term: str
    before: str
    cells: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class MethodNotes:
    """Remarks on one method."""

    name: str
    title: str
    how: str
    chosen: bool
    explained: str
    correlation: str
    warnings: tuple[str, ...]


def estimate_html(content: EstimateContent, *, progress: Progress = silent) -> str:
    """One HTML page without any outside reference."""
    found = content.found
    methods = [_notes(content, item) for item in found.methods]
    page = page_template("estimate.html")
    return page.render(
        content=content,
        found=found,
        best=found.best,
        summary=summary(content),
        parameters=parameter_rows(content),
        fits=fit_table(found),
        predictions=prediction_table(found),
        prediction_title=prediction_title(found),
        motion=motion_words(found),
        disturbances=disturbance_table(found),
        limits=limit_rows(found),
        why=[sentence(limits, run) for limits, run in zip(found.limits, found.best.runs, strict=True)],
        ahead_s=ASSESSMENT_TUNING.ahead_s,
        methods=methods,
        explained=[(item.name, item.explained, item.correlation) for item in methods],
        conditions=conditions(content),
        advice=advice(content),
        notes=_data_notes(content),
        figures=_figures(content, progress),
        sample_time_s=found.record.batches[0].sample_time_s,
    )


def estimate_notes(content: EstimateContent) -> tuple[str, ...]:
    """The notes and warnings of the page: doubts about the data first, then advice, methods, files."""
    record = content.found.record
    methods = (_notes(content, item) for item in content.found.methods)
    return (
        *record.doubts,
        *advice(content),
        *conditions(content),
        *(f"{item.name}: {warning}" for item in methods for warning in item.warnings),
        *(note for note in _data_notes(content) if note not in record.doubts),
    )


def _data_notes(content: EstimateContent) -> list[str]:
    """Notes on the files, and on methods without an answer."""
    found = content.found
    return list(dict.fromkeys([*found.record.notes, *found.tests.notes, *found.left_out]))


def _figures(content: EstimateContent, progress: Progress) -> dict[str, object]:
    found = content.found
    step = found.record.batches[0].sample_time_s
    names = tuple(batch.name for batch in found.record.batches)
    loading, drawing = in_phases(progress, DRAWING_LOADS, 3 + len(found.best.runs))
    with report_style():
        loading(DRAWING, 1.0)
        figures: list[object] = []

        def drawn(figure: object) -> object:
            figures.append(figure)
            drawing(DRAWING, len(figures) / (3 + len(found.best.runs)))
            return figure

        return {
            "intervals": drawn(interval_figure(found.methods, found.best)),
            "runs": [drawn(run_figure(index, content.drawn)) for index in range(len(found.best.runs))],
            "residuals": drawn(residual_figure(found.best, names, step)),
            "autocorrelation": drawn(autocorrelation_figure(found.best, step)),
        }


def parameter_rows(content: EstimateContent) -> list[ParameterRow]:
    """Every parameter of the model: value before, and (value with deviation, 95 % interval) per method."""
    model = content.vessel.model
    return [
        ParameterRow(
            name=term.name,
            term=f"{term.expression} in d{term.equation}/dt",
            before=words.significant(float(value)),
            cells=tuple(_cell(item, term.name) for item in content.found.methods),
        )
        for term, value in zip(model.terms, model.parameters, strict=True)
    ]


def _cell(item: Assessed, name: str) -> tuple[str, str]:
    estimate = item.estimate
    if name not in estimate.names:
        return words.significant(estimate.held[name]), "not estimated"
    index = estimate.names.index(name)
    value, std = float(estimate.values[index]), float(estimate.std[index])
    low, high = (words.significant(value + sign * FACTOR * std) for sign in (-1, 1))
    return plus_minus(value, std).replace("-", words.MINUS), f"{low} to {high}"


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


def _notes(content: EstimateContent, item: Assessed) -> MethodNotes:
    estimate, found = item.estimate, item.one_step
    how = "No instruments."
    if item.uses_instruments:
        source = "the parameters of the vessel file" if item.start == "nominal" else "the least-squares estimate"
        how = (
            f"The first instruments are simulated with {source}, and refined "
            f"{words.counted(estimate.refinements, 'time')}. Subtracted mean: {content.found.mean}."
        )
    diverged = tuple(f"Simulation fails: {run.problem}." for run in item.runs if run.problem)
    return MethodNotes(
        name=item.method.name,
        title=item.method.title,
        how=how,
        chosen=item is content.found.best,
        explained=_listed(found.outputs, found.explained.tolist(), 3),
        correlation=_listed(found.outputs, found.autocorrelation[1].tolist(), 2),
        warnings=(*estimate.warnings, *diverged),
    )


def _listed(outputs: tuple[str, ...], values: list[float], decimals: int) -> str:
    texts = ("-" if math.isnan(value) else words.number(value, decimals) for value in values)
    return ", ".join(f"{name} {text}" for name, text in zip(outputs, texts, strict=True))
