"""Results of the validation of designs in simulated trials: JSON and a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.estimation.methods import METHODS, method_named
from expdesign.export import words
from expdesign.export.document import Document, Figure, Section, Table, section
from expdesign.export.files import entry, finite, strict_json
from expdesign.export.pages.figures import (
    BLUE,
    GREY,
    LINES,
    VERMILION,
    light_grid,
    new_figure,
    page_figure,
    plain,
    round_ticks,
    svg,
)
from expdesign.export.words import significant
from expdesign.rehearsal import Rehearsal, Validated, random_runs
from expdesign.values import Array

# largest relative difference of standard deviations that counts as agreement, apart from sampling error
AGREEING_STD = 0.10
BIASED = 0.5  # bias over standard deviation beyond which an estimator does not count as consistent
CHANCE = 0.01  # probability that a bias, or a wrong standard deviation, is reported where there is none
SAME_TIME = 0.02  # relative difference of informative times up to which designs have the same
DRAWS = 400  # of random designs, whose mean length is known to a few thousandths by them
ERROR_LIMIT = 1.5  # normalised error below which the thesis calls a trial good


def chance(result: Validated) -> float:
    """Relative standard error of a standard deviation that is estimated from these trials."""
    return float(1.0 / np.sqrt(2.0 * len(result.estimates)))


def sampling_error(result: Validated) -> tuple[float, float]:
    """Least and largest ratio of observed to true standard deviations by chance, at the level of `CHANCE` for all."""
    freedom, tail = len(result.estimates) - 1, _tail(result.theory)
    least, most = (float(np.sqrt(scipy.special.chdtri(freedom, share) / freedom)) for share in (1.0 - tail, tail))
    return least, most


def off_theory(result: Validated) -> list[str]:
    """Parameters whose observed and predicted standard deviations differ by more than agreement and chance allow.

    None without a prediction.
    """
    (least, most), ratio = sampling_error(result), result.found / result.theory
    agreeing = AGREEING_STD
    return _named(result, (ratio > (1.0 + agreeing) * most) | (ratio < (1.0 - agreeing) * least))


def biased(result: Validated) -> list[str]:
    """Parameters whose bias surely is more than a share of their standard deviation."""
    standard_error = result.found / np.sqrt(len(result.estimates))
    return _named(result, np.abs(result.bias) > BIASED * result.found + _limit(result) * standard_error)


def surely_biased(result: Validated) -> list[str]:
    """Parameters whose bias is more than chance: 1 % for all parameters of a design together, by Bonferroni."""
    return _named(result, result.bias_deviations > _limit(result))


def _limit(result: Validated) -> float:
    """Standard errors of a mean that chance exceeds seldom, for all parameters together."""
    return -float(scipy.special.stdtrit(len(result.estimates) - 1, _tail(result.truth)))


def _tail(values: Array) -> float:
    """Probability of one tail for each of the known values."""
    return CHANCE / (2 * max(1, int(np.isfinite(values).sum())))


def _named(result: Validated, chosen: NDArray[np.bool_]) -> list[str]:
    return [name for name, is_so in zip(result.parameters, chosen, strict=True) if is_so]


def judgements(rehearsal: Rehearsal, results: Sequence[Validated], *, noisy_moduli: Sequence[str]) -> tuple[str, ...]:
    """The conclusions from the trials, in sentences.

    Args:
        results: of every design, that of the optimised one first.
        noisy_moduli: primitives of the optimised design in which noise or weather may change the sign of a velocity
            inside an absolute value.
    """
    judged = [sentence for item in results for sentence in _judged(item)]
    doubtful = any(biased(item) or off_theory(item) for item in results)
    return (*_comparison(rehearsal, results), *judged, *(_assumptions(rehearsal, noisy_moduli) if doubtful else ()))


def _comparison(rehearsal: Rehearsal, results: Sequence[Validated]) -> Iterator[str]:
    """Other designs beside the best one; variances fall as the time grows, which differs by rounding to whole runs."""
    best, *others = results
    for other in others:
        ratio = _ratio(other.found, best.found)
        longer = informative_s(rehearsal, other) / informative_s(rehearsal, best)
        times = ""
        if abs(longer - 1.0) > SAME_TIME:
            times = f" in {longer:.2f} times its time, so about {ratio * np.sqrt(longer):.2f} times in equal time"
        yield (
            f"{other.design.capitalize()}: standard deviations are {ratio:.2f} times (geometric mean) those of the "
            f"{best.design} design{times}. The median error is {np.median(other.errors):.3g}, that of the "
            f"{best.design} design {np.median(best.errors):.3g}."
        )


def informative_s(rehearsal: Rehearsal, result: Validated) -> float:
    """How long all runs of a design take; of random ones the mean of many draws, the last run of which goes beyond."""
    runs, rng = rehearsal.designs[result.design], np.random.default_rng(0)
    counts = [random_runs(rehearsal, rng) for _ in range(DRAWS)] if runs is None else [runs]
    return float(np.mean(counts, axis=0) @ [one.duration_s for one in rehearsal.primitives])


def _ratio(some: Array, others: Array) -> float:
    return float(np.exp(np.mean(np.log(some / others))))


def _stated(result: Validated) -> Iterator[str]:
    """Whether the estimator's own standard deviations are those that its estimates have."""
    ratio, (least, most) = _ratio(np.median(result.stated, axis=0), result.found), sampling_error(result)
    agreeing = 1.0 + AGREEING_STD
    if not 1.0 / (most * agreeing) < ratio < agreeing / least:
        kind = "wide" if ratio > 1.0 else "narrow"
        yield (
            f"{result.design.capitalize()}: the standard deviations that the estimator states are {ratio:.2g} times "
            f"(geometric mean) those observed: its 95 % intervals are too {kind}."
        )


def _judged(result: Validated) -> Iterator[str]:
    trials = len(result.estimates) + result.failed
    if result.failed:
        yield f"{result.design.capitalize()}: {result.failed} of {trials} trials gave no estimate."
    off, shifted = off_theory(result), biased(result)
    if np.isfinite(result.theory).all() and not off:
        least, most = sampling_error(result)
        yield (
            f"{result.design.capitalize()}: every observed standard deviation is within "
            f"{100 * AGREEING_STD:g} % of the predicted one, apart from a sampling error of "
            f"{significant(100 * (least - 1), 2)} to +{significant(100 * (most - 1), 2)} % "
            f"({100 * CHANCE:g} % for all parameters together)."
        )
    yield from _stated(result)
    if off:
        yield f"{result.design.capitalize()}: predicted and observed standard deviations differ for {', '.join(off)}."
    if surely := surely_biased(result):
        worst = float(np.nanmax(result.bias_deviations))
        yield (
            f"{result.design.capitalize()}: the bias is more than chance for {', '.join(surely)}, up to {worst:.1f} "
            "standard errors of its mean over the trials."
        )
    else:
        yield f"{result.design.capitalize()}: no bias is more than chance (1 % for all parameters together)."
    if shifted:
        yield f"{result.design.capitalize()}: the bias exceeds half a standard deviation for {', '.join(shifted)}."


def _assumptions(rehearsal: Rehearsal, noisy_moduli: Sequence[str]) -> Iterator[str]:
    """Which assumptions of the prediction do not hold here."""
    failing = (*_of_motion(rehearsal, noisy_moduli), *_of_weather(rehearsal))
    found = [f"Assumption that fails: {text}" for text in failing]
    yield from found
    if not found:
        yield (
            "No assumption that can be checked from the files fails. One assumption remains: the noise is small enough "
            "for first-order propagation. Test it with less noise in the vessel file of the true ship."
        )


def _of_motion(rehearsal: Rehearsal, noisy_moduli: Sequence[str]) -> Iterator[str]:
    if method_named(rehearsal.method).solver == "ls":
        yield (
            "the regressors have no noise. Sensor noise biases least squares. The prediction is for instrumental "
            "variables."
        )
    if noisy_moduli:
        yield (
            "every velocity inside an absolute value keeps its sign under noise. The sign may change in "
            f"{', '.join(noisy_moduli)}."
        )
    if rehearsal.integrator == "rk4" and rehearsal.nominal.model.form == "discrete":
        yield (
            "the parameters are the same in both models. The file has parameters of the Euler discretisation, but the "
            "simulated ship moves continuously between samples. --integrator euler removes this difference."
        )
    if rehearsal.truth.model.names != rehearsal.nominal.model.names:
        yield "the model has the terms of the true ship. They differ."


def _of_weather(rehearsal: Rehearsal) -> Iterator[str]:
    weather, method = rehearsal.environment, method_named(rehearsal.method)
    current = weather.current_to.any() or weather.current_std_mps > 0
    wind = weather.wind_to.any() or weather.wind_std_mps > 0
    solver, allows = method.solver, method.weather.suffix
    if (current or wind) and not allows:
        steady = f", {solver}-current for a steady current" if current and _there(solver, "current") else ""
        yield (
            f"no current and wind. Method {method.name} removes only a constant; "
            f"--method {_there(solver, 'air', 'wind', 'augmented')} accounts for weather{steady}."
        )
    if current and allows == "air":
        also = _there(solver, "wind", "air-current")
        yield f"no current. Method {method.name} accounts for measured wind only; {also} also for current."
    if wind and allows == "current":
        also = _there(solver, "air-current")
        yield f"no wind. Method {method.name} accounts for a steady current only; {also} also for measured wind."
    if (current and allows == "no-current") or (wind and allows == "no-wind"):
        yield f"{allows.replace('-', ' ')}. Method {method.name} leaves it out; {solver}-augmented accounts for both."
    known = {"wind": "the current", "no-wind": "the current", "no-current": "the wind", "augmented": "current and wind"}
    if allows in known:
        what = known[allows]
        yield (
            f"{what} known. Method {method.name} estimates additional parameters for it; the prediction does not "
            f'include the loss of accuracy. Design for it with predictor = "{method.weather.name}" in the scenario.'
        )
    drawn = weather.current_std_mps > 0 and not method.weather.steady
    if drawn or weather.wind_std_mps > 0:
        yield "every trial has the mean weather of the forecast. Here the weather of each trial is random."


def _there(solver: str, *allows: str) -> str:
    """The methods of a solver that there are among those that account for some weather: "a, b or c"; "" for none."""
    known = {method.name for method in METHODS}
    *first, last = [name for name in (f"{solver}-{item}" for item in allows) if name in known] or [""]
    return f"{', '.join(first)} or {last}" if first else last


def validation_json(rehearsal: Rehearsal, results: Sequence[Validated], *, scenario: str, judged: Sequence[str]) -> str:
    """`validation.json`."""
    described = {
        "scenario": scenario,
        "truth": rehearsal.truth.name,
        **entry(rehearsal, "method", "mean_subtraction", "excitation", "integrator", "trials", "seed"),
        "designs": {item.design: _entry(rehearsal, item) for item in results},
        "judgements": list(judged),
    }
    return strict_json(described)


def _entry(rehearsal: Rehearsal, result: Validated) -> dict[str, object]:
    runs = rehearsal.designs[result.design]
    names = [primitive.name for primitive in rehearsal.primitives]
    return {
        "informative_s": informative_s(rehearsal, result),
        "runs": None if runs is None else {name: count for name, count in zip(names, runs, strict=True) if count},
        "failed": result.failed,
        "normalised_error": {
            "median": float(np.median(result.errors)),
            "percentile_95": float(np.percentile(result.errors, 95)),
            "share_below_1_5": float((result.errors < ERROR_LIMIT).mean()),
        },
        "parameters": {
            name: {
                "truth": finite(result.truth[index]),
                "bias": finite(result.bias[index]),
                "bias_in_standard_errors": finite(result.bias_deviations[index]),
                "std_found": finite(result.found[index]),
                "std_predicted_at_truth": finite(result.theory[index]),
                "std_forecast_by_nominal": finite(result.forecast[index]),
                "std_stated_mean": finite(result.stated[:, index].mean()),
                "coverage_95": finite(result.coverage[index]),
            }
            for index, name in enumerate(result.parameters)
        },
    }


@page_figure
def error_figure(results: tuple[Validated, ...]) -> str:
    """Share of trials below each normalised error, one line per design."""
    figure = new_figure(6.4, 3.4)
    axes = figure.subplots()
    for result, colour in zip(results, LINES, strict=False):
        errors = np.sort(result.errors)
        share = np.arange(1, len(errors) + 1) / len(errors)
        axes.step(errors, 100 * share, where="post", color=colour, label=plain(result.design))
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if low < ERROR_LIMIT < high:
        axes.axvline(ERROR_LIMIT, color=GREY, linewidth=0.8, linestyle="--", label=f"good below {ERROR_LIMIT:g}")
    round_ticks(axes)
    axes.set_xlabel("error of a trial, relative to the true parameters")
    axes.set_ylabel("trials below [%]")
    axes.set_ylim(0, 101)
    axes.legend(loc="upper left", fontsize=9)
    light_grid(axes)
    return svg(figure, key="errors", label="Share of simulated trials below each normalised error, by design")


@page_figure
def spread_figure(result: Validated) -> str:
    """Observed over predicted standard deviation of each parameter, with its sampling error."""
    names = [plain(name) for name in result.parameters]
    figure = new_figure(6.4, 1.1 + 0.26 * len(names))
    axes = figure.subplots()
    rows = np.arange(len(names))
    axes.axvline(1.0, color="black", linewidth=1.0)
    error = 1.96 * chance(result)
    for ratio, marker, colour, label in (
        (result.found / result.theory, "o", BLUE, "predicted with the true ship"),
        (result.found / result.forecast, "D", VERMILION, "forecast with the nominal model"),
    ):
        shift = -0.12 if marker == "o" else 0.12
        axes.errorbar(
            ratio, rows + shift, xerr=error * ratio, fmt=marker, color=colour, markersize=5, label=label, linewidth=1
        )
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xscale("log")
    round_ticks(axes)
    axes.set_xlabel("standard deviation, observed / predicted")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=9)
    light_grid(axes, "x")
    return svg(figure, key="spread", label="Observed over predicted standard deviation of each parameter")


PARAMETER_HEADER = (
    "Parameter",
    "Truth",
    "Bias",
    "Std. dev.\nobserved",
    "Predicted\ntrue ship",
    "Forecast\nnominal model",
    "Stated\nby the estimator",
    "95 % interval\ncontains truth",
)


def validation_document(
    rehearsal: Rehearsal, results: tuple[Validated, ...], *, scenario: str, judged: tuple[str, ...]
) -> Document:
    """The trials for people."""
    return Document(
        kind="Designs in Monte Carlo trials",
        title=scenario,
        name=f"Validation of the design of {scenario}",
        about=f"{rehearsal.trials} simulated trials of each design. True ship: {rehearsal.truth.name}. Nominal model: "
        f"{rehearsal.nominal.name}. Estimator: {method_named(rehearsal.method).title} ({rehearsal.method}).",
        findings=judged,
        values={
            "trials_of_each_design": rehearsal.trials,
            "median_error": {item.design: float(np.median(item.errors)) for item in results},
            "without_estimate": {item.design: item.failed for item in results},
        },
        sections=(
            _designs(rehearsal, results),
            *_accuracy(results),
            *(_parameters(item) for item in results),
            section(
                "Method",
                "Each trial simulates a number of whole runs from their entry velocities, measures them with the "
                "sensors of the true ship, and estimates as with measured data. The prediction propagates the "
                "sensor noise to first order. It is valid while the noise is small. Parameters are in SI units "
                "and radians.",
            ),
        ),
    )


def _designs(rehearsal: Rehearsal, results: tuple[Validated, ...]) -> Section:
    header = (
        "Design",
        "Runs",
        "Time",
        "Median error",
        "95th percentile",
        f"Error below {ERROR_LIMIT:g}",
        "No estimate",
    )
    rows = [_design_row(rehearsal, item) for item in results]
    return section(
        "Designs",
        Table(header=header, rows=rows, texts=2),
        "All designs have the informative time that is nearest to the scenario's in whole runs, equal shares at least "
        "one run of each manoeuvre, random runs what is drawn until it is reached. The error of a trial is "
        "the root mean square over the parameters of (estimate \u2212 truth) / |truth|.",
        Figure(
            draw=partial(error_figure, results),
            caption="Share of trials whose error is below the value on the axis. A curve further left is better.",
        ),
    )


def _accuracy(results: tuple[Validated, ...]) -> Iterator[Section]:
    predicted = next((item for item in results if np.isfinite(item.theory).all()), None)
    if predicted is not None:
        caption = (
            f"Design \u201c{predicted.design}\u201d: standard deviation observed in the trials divided by the "
            "predicted one, with 95 % sampling error. Circles use the true ship and test the theory. Diamonds use the "
            "nominal model, as a forecast before the trial does."
        )
        figure = Figure(draw=partial(spread_figure, predicted), caption=caption)
        yield section("Predicted and observed accuracy", figure)


def _parameters(result: Validated) -> Section:
    table = Table(header=PARAMETER_HEADER, rows=_parameter_rows(result))
    return section(f"Parameters, {result.design}", table)


def _design_row(rehearsal: Rehearsal, result: Validated) -> tuple[str, ...]:
    runs = rehearsal.designs[result.design]
    names = [primitive.name for primitive in rehearsal.primitives]
    spelled = (
        "random in every trial"
        if runs is None
        else ", ".join(
            f"{count} \N{MULTIPLICATION SIGN} {name}" for name, count in zip(names, runs, strict=True) if count
        )
    )
    return (
        result.design,
        spelled,
        words.duration(informative_s(rehearsal, result)),
        f"{np.median(result.errors):.3g}",
        f"{np.percentile(result.errors, 95):.3g}",
        f"{100 * (result.errors < ERROR_LIMIT).mean():.1f} %",
        str(result.failed),
    )


def _parameter_rows(result: Validated) -> list[tuple[str, ...]]:
    return [
        (
            name,
            _text(result.truth[index]),
            _text(result.bias[index]),
            _text(result.found[index]),
            _text(result.theory[index]),
            _text(result.forecast[index]),
            _text(result.stated[:, index].mean()),
            f"{100 * result.coverage[index]:.0f} %" if np.isfinite(result.truth[index]) else "\N{EN DASH}",
        )
        for index, name in enumerate(result.parameters)
    ]


def _text(value: float) -> str:
    return words.significant(value) if np.isfinite(value) else "\N{EN DASH}"
