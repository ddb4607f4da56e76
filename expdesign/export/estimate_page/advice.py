"""Sentences on an estimation: its parameters and data, and which estimate to use."""

from __future__ import annotations

import numpy as np

from expdesign.assessment import Assessed
from expdesign.estimation.equation_wise import sample_notes
from expdesign.export import words
from expdesign.export.estimate_page.content import EstimateContent
from expdesign.export.files import breach_sentences, unstable_warning


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
