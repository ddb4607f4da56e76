"""The page about a diagnosis."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from expdesign.conventions import plus_minus
from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.accuracy import mean_residual
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.conclusions import DIVERGED_FIT, accuracy_in_words, alternatives, has_diverged, manoeuvre
from expdesign.diagnosis.select import SELECTION_TUNING
from expdesign.diagnosis.values import ErrorReduction, Estimate
from expdesign.export import words
from expdesign.export.diagnosis_figures import (
    ACCELERATION_AXES,
    growth_figure,
    has_sign,
    is_force,
    residual_figures,
    suspect_figure,
    window_figure,
)
from expdesign.export.diagnosis_results import RollVerdict, roll_sentences
from expdesign.export.pages import page_template
from expdesign.export.pages.figures import report_style
from expdesign.progress import Progress, silent
from expdesign.vessel.quantities import GAINS_AND_OFFSETS

DRAWN_STRETCHES = 4  # stretches of data drawn in a diagnosis
SMALLEST_P_VALUE = 1e-12  # p-values below are printed as this bound in tables


# Names of causes and estimates in words, in place of "thrust_gain" or "lag_all_s".

TITLES = {cause.name: cause.title for cause in CAUSES}
"""Cause -> title; other causes have their name as title."""
NAMES = {
    "north_mps": "velocity to the north",
    "east_mps": "velocity to the east",
    "damping_growth": "relative increase of damping per draught over depth",
    "inertia_growth": "relative increase of inertia per draught over depth",
    "thrust_offset_m": "line of thrust, distance to port of the centre line",
    "yaw_radps2_per_rps2": "yaw acceleration per n|n| of the propellers",
    "yaw_radps2_per_tau_x": "yaw acceleration per ahead force",
    "heading_bias_rad": "measured heading less true heading",
    "velocity_angle_rad": "axis of the velocity sensor, to starboard of the bow",
    "forward_m": "sensor position, forward of amidships",
    "starboard_m": "sensor position, to starboard of amidships",
    **{row.key: row.words for row in GAINS_AND_OFFSETS if not row.is_gain},
    "factor": "factor (1: as in the model)",
    "time_s": "time of the change",
    "Y_phi": "sway coupling, per side acceleration that holds the roll angle",
    "N_phi": "yaw coupling, per side acceleration that holds the roll angle",
    "roll_period_s": "period of the oscillation",
    "roll_damping_ratio": "damping ratio of the oscillation",
    "toward_rad": "direction to which the wind blows",
}
OUTPUTS = {"u": "surge", "v": "sway", "r": "yaw", "psi": "heading"}
PATTERNS = (
    (re.compile(r"lag_(\w+)_s"), "time constant of {}"),
    (re.compile(r"delay_(\w+)_s"), "dead time of {}"),
    (re.compile(r"deadband_(\w+?)(?:_rps|_rad)?"), "width of the dead band of {}"),
    (re.compile(r"angle_offset_(\w+)_rad"), "offset of {}"),
    (re.compile(r"angle_factor_(\w+)"), "acting angle over recorded angle of {}"),
    (re.compile(r"(\w+)_delay_s"), "delay of the measured {}"),
    (re.compile(r"inertia_factor_(\w+)"), "inertia factor in {} (1: as in the model)"),
    (re.compile(r"(\w+)_factor"), "factor of {} after the change (1: no change)"),
    (re.compile(r"(\w+)_change"), "change of {}"),
)


def cause_title(cause: str) -> str:
    """Title of a cause, e.g. of "missing_term:Y_r"."""
    kind, _, term = cause.partition(":")
    if kind == "unlisted_term":
        return f"No known cause: {term}"
    return f"Missing term {term}" if kind == "missing_term" else TITLES.get(cause, cause.replace("_", " "))


def estimate_words(name: str, cause: str) -> str:
    """The name of an estimate in words; parameters and terms of the model keep theirs."""
    if cause.partition(":")[0] in ("parameters", "missing_term", "unlisted_term") or (
        cause == "wind" and name not in NAMES
    ):
        return name
    for pattern, text in PATTERNS:
        match = pattern.fullmatch(name)
        if match and name not in NAMES:
            subject = match.group(1)
            return text.format("all inputs" if subject == "all" else OUTPUTS.get(subject, subject.replace("_", " ")))
    return NAMES.get(name, name)


NO_NUMBER = "\N{EN DASH}"


def diagnosis_html(
    found: Diagnosis, *, command: str, roll: RollVerdict | None = None, progress: Progress = silent
) -> str:
    """One HTML page without any outside reference."""
    figures = _figures(found, progress)
    page = page_template("diagnosis.html")
    return page.render(
        found=found,
        verdict=found.verdict.partition(". "),
        alarm=f"{SELECTION_TUNING.accepted_p_value:g}",
        apart=found.unit,
        findings=[_finding(item, found) for item in found.findings],
        before=accuracy_in_words(found.before),
        astray=has_diverged(found.before) or has_diverged(found.after),
        outputs=", ".join(found.before.outputs),
        whole=_mean_missing(found),
        tested=[(cause_title(cause), p_value) for cause, p_value in found.screened],
        accuracy=accuracy_rows(found),
        data=_data(found),
        roll=roll_sentences(roll),
        notes=diagnosis_notes(found),
        figures=figures,
        command=command,
    )


def diagnosis_notes(found: Diagnosis) -> tuple[str, ...]:
    """The notes of the page: doubts about the record, notes on the diagnosis, notes on the files."""
    rest = (note for note in found.record.notes if note not in found.record.doubts)
    return (*found.record.doubts, *found.notes, *rest)


def _figures(found: Diagnosis, progress: Progress) -> dict[str, object]:
    """Figures by their places in the page."""
    windows, causes = drawn(found), range(len(found.findings))
    drawing: list[Callable[[], Any]] = [
        partial(growth_figure, found),
        partial(residual_figures, found),
        *(partial(window_figure, found, index) for index in windows),
        *(partial(suspect_figure, found, index, f"suspect{index}") for index in causes),
    ]
    done: list[Any] = []
    with report_style():
        for figure in drawing:
            progress("drawing the page", len(done) / len(drawing))
            done.append(figure())
    growth, residuals, *others = done
    stretches = [(_stretch(found, index), others.pop(0)) for index in windows]
    return {"windows": stretches, "growth": growth, "residuals": residuals, "suspects": others}


def _mean_missing(found: Diagnosis) -> list[str]:
    """Mean acceleration that the model lacks, e.g. "u 10.2 +- 0.7 mm/s2"."""
    means = []
    for output in found.residuals.outputs:
        label, factor = ACCELERATION_AXES[output]
        name, _, unit = label.partition(" ")
        mean, std = mean_residual(found.residuals, output)
        means.append(f"{name} {plus_minus(factor * mean, factor * std)} {unit.strip('[]')}".replace("-", words.MINUS))
    return means


def drawn(found: Diagnosis) -> list[int]:
    """Windows to draw: those with the largest errors of the model in use."""
    error = np.nan_to_num(found.windows.measured - found.simulated_before)[..., :3]
    scale = np.maximum(np.nanstd(found.windows.measured[..., :3], axis=(0, 1)), 1e-12)
    size = np.clip((error / scale) ** 2, 0, 1e6).sum(axis=(1, 2))
    return [int(index) for index in np.sort(np.argsort(-size)[:DRAWN_STRETCHES])]


def _stretch(found: Diagnosis, index: int) -> str:
    """The run of a window, and where in it the window begins."""
    windows = found.windows
    begin = float(windows.first[index]) * windows.step_s
    return windows.names[int(windows.batch[index])] + (f", from {begin:.0f}{words.NB}s" if begin > 0 else "")


def accuracy_rows(found: Diagnosis) -> list[tuple[str, ...]]:
    """By output: fit, root mean square and mean of the error, as the vessel file states and with what was found."""
    rows = []
    for index, name in enumerate(found.before.outputs):
        unit, factor = ("\N{DEGREE SIGN}/s", float(np.degrees(1.0))) if name == "r" else ("m/s", 1.0)
        cells = [f"{name} [{unit}]"]
        for item in (found.before, found.after):
            if not float(item.fit[index]) >= DIVERGED_FIT:
                cells += [_fit(float(item.fit[index])), NO_NUMBER, NO_NUMBER]
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
        "title": cause_title(item.cause),
        "explanation": item.explanation,
        "estimates": [
            (estimate_words(one.name, item.cause), _with_error(one).replace("-", words.MINUS), _says(one))
            for one in item.estimates
        ],
        "p_value": _p_value(item.p_value),
        "gain": words.number(item.gain, 1),
        "interval": f"{words.number(low, 1)} to {words.number(high, 1)}",
        "fits": rows,
        "signed": has_sign(item),
        "force": is_force(found, item),
        "reductions": [_reduction(reduction) for reduction in item.error_reductions if np.isfinite(reduction.share)],
        "alternatives": alternatives(item),
        "distinguishing": None if item.would_tell_apart is None else manoeuvre(item.would_tell_apart),
    }


def _with_error(item: Estimate) -> str:
    return f"{plus_minus(item.value, item.std)} {item.unit}".rstrip()


def _says(item: Estimate) -> str:
    return "" if item.stated is None else f"the file says {words.significant(item.stated, 4)}"


def _reduction(item: ErrorReduction) -> str:
    shares = (words.number(100 * value, 0) for value in (item.share, item.low, item.high))
    return "{} {}{nb}% ({} to {}{nb}%)".format(item.output, *shares, nb=words.NB)


def _fit(value: float) -> str:
    return "diverged" if not value >= DIVERGED_FIT else f"{words.number(value, 1)}{words.NB}%"


def _p_value(p_value: float) -> str:
    """Two digits; very small ones depend on the shape of the noise, so only a bound is given."""
    return f"< {SMALLEST_P_VALUE:g}" if p_value < SMALLEST_P_VALUE else f"{p_value:.2g}"


def _data(found: Diagnosis) -> str:
    windows = found.windows
    return (
        f"{words.counted(len(windows.names), 'run')}, {words.duration(windows.duration_s)} in all, compared every "
        f"{windows.sample_s:g}{words.NB}s"
    )
