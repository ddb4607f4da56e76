"""The page about a diagnosis."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.accuracy import mean_residual
from expdesign.diagnosis.conclusions import (
    DIVERGED_FIT,
    accuracy_in_words,
    benefit,
    has_diverged,
    manoeuvre,
    missing_effect,
    unit_name,
)
from expdesign.diagnosis.select import SELECTION_TUNING
from expdesign.diagnosis.values import ErrorReduction
from expdesign.export import words
from expdesign.export.diagnosis_page.figures import (
    ACCELERATION_AXES,
    growth_figure,
    residual_figures,
    suspect_figure,
    window_figure,
)
from expdesign.export.diagnosis_page.suspects import has_sign, is_force
from expdesign.export.diagnosis_page.wording import titled, worded
from expdesign.export.files import plus_minus
from expdesign.export.pages import page_templates
from expdesign.export.pages.figures import report_style

SHOWN = 4
"""Stretches of data drawn."""
UNTOLD = "\N{EN DASH}"


def diagnosis_html(found: Diagnosis, *, command: str, version: str) -> str:
    """One HTML page without any outside reference."""
    with report_style():
        figures = {
            "windows": [(_stretch(found, i), window_figure(found, i)) for i in drawn(found)],
            "growth": growth_figure(found),
            "residuals": residual_figures(found),
            "suspects": [suspect_figure(found, i, f"suspect{i}") for i in range(len(found.findings))],
        }
    page = page_templates("expdesign.export.diagnosis_page").get_template("diagnosis.html")
    return page.render(
        found=found,
        alarm=f"{SELECTION_TUNING.accepted_p_value:g}",
        apart=unit_name(found.windows),
        findings=[_finding(item, found) for item in found.findings],
        before=accuracy_in_words(found.before),
        astray=has_diverged(found.before) or has_diverged(found.after),
        outputs=", ".join(found.before.outputs),
        whole=_on_the_whole(found),
        tested=[(titled(cause), p_value) for cause, p_value in found.screened],
        accuracy=_accuracy(found),
        data=_data(found),
        figures=figures,
        command=command,
        version=version,
    )


def _on_the_whole(found: Diagnosis) -> list[str]:
    """Mean of what the model lacks, e.g. "u 10.2 +- 0.7 mm/s2"."""
    told = []
    for output in found.residuals.outputs:
        label, factor = ACCELERATION_AXES[output]
        name, _, unit = label.partition(" ")
        mean, std = mean_residual(found.residuals, output)
        told.append(f"{name} {plus_minus(factor * mean, factor * std)} {unit.strip('[]')}".replace("-", words.MINUS))
    return told


def drawn(found: Diagnosis) -> list[int]:
    """Windows to draw: where the model in use is most wrong."""
    error = np.nan_to_num(found.windows.measured - found.simulated_before)[..., :3]
    scale = np.maximum(np.nanstd(found.windows.measured[..., :3], axis=(0, 1)), 1e-12)
    size = np.clip((error / scale) ** 2, 0, 1e6).sum(axis=(1, 2))
    return [int(index) for index in np.sort(np.argsort(-size)[:SHOWN])]


def _stretch(found: Diagnosis, index: int) -> str:
    """The run of a window, and where in it the window begins."""
    windows = found.windows
    begin = float(windows.first[index]) * windows.step_s
    return windows.names[int(windows.batch[index])] + (f", from {begin:.0f}{words.NB}s" if begin > 0 else "")


def _accuracy(found: Diagnosis) -> list[tuple[str, ...]]:
    rows = []
    for index, name in enumerate(found.before.outputs):
        unit, factor = ("\N{DEGREE SIGN}/s", float(np.degrees(1.0))) if name == "r" else ("m/s", 1.0)
        cells = [f"{name} [{unit}]"]
        for item in (found.before, found.after):
            if not float(item.fit[index]) >= DIVERGED_FIT:
                cells += [_fit(float(item.fit[index])), UNTOLD, UNTOLD]
                continue
            cells += [
                _fit(float(item.fit[index])),
                words.significant(factor * float(item.rmse[index])),
                words.significant(factor * float(item.bias[index])),
            ]
        rows.append(tuple(cells))
    return rows


def _finding(item: Finding, found: Diagnosis) -> dict[str, object]:
    low, high = item.gain_interval
    rows = [
        f"{name} {_fit(float(a))} \N{RIGHTWARDS ARROW} {_fit(float(b))}"
        for name, a, b in zip(found.before.outputs, item.fit_before, item.fit_after, strict=True)
    ]
    return {
        "cause": item.cause,
        "title": titled(item.cause),
        "explanation": item.explanation,
        "estimates": [
            (worded(one.name, item.cause), plus_minus(one.value, one.std).replace("-", words.MINUS), one.unit)
            for one in item.estimates
        ],
        "chance": _chance(item.p_value),
        "gain": words.number(item.gain, 1),
        "interval": f"{words.number(low, 1)} to {words.number(high, 1)}",
        "fits": rows,
        "signed": has_sign(item),
        "force": is_force(found, item),
        "worth": benefit(item),
        "falls": [_fall(fall) for fall in item.error_reductions if np.isfinite(fall.share)],
        "rivals": [missing_effect(name) for name in item.not_distinguishable_from],
        "telling": None if item.would_tell_apart is None else manoeuvre(item.would_tell_apart),
    }


def _fall(item: ErrorReduction) -> str:
    shares = (words.number(100 * value, 0) for value in (item.share, item.low, item.high))
    return "{} {}{nb}% ({} to {}{nb}%)".format(item.output, *shares, nb=words.NB)


def _fit(value: float) -> str:
    return "lost" if not value >= DIVERGED_FIT else f"{words.number(value, 1)}{words.NB}%"


def _chance(p_value: float) -> str:
    if p_value < 1e-12:
        return "less than one in a million million"
    if p_value < 1e-6:
        return "less than one in a million"
    return f"about 1 in {round(1 / p_value)}" if p_value < 0.5 else "large"


def _data(found: Diagnosis) -> str:
    windows = found.windows
    return (
        f"{words.counted(len(windows.names), 'run')}, {words.duration(windows.duration_s)} in all, compared every "
        f"{windows.sample_s:g}{words.NB}s"
    )
