"""A diagnosis as a document."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

import numpy as np
from markupsafe import Markup

from expdesign.conventions import plus_minus
from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.accuracy import Accuracy, mean_residual
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.conclusions import (
    DIVERGED_FIT,
    accuracy_in_words,
    alternatives,
    doubt,
    has_diverged,
    manoeuvre,
)
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
from expdesign.export.diagnosis_results import CAUSE_HEADER, accuracy_entry, cause_rows, finding_entry
from expdesign.export.document import Block, Document, Figure, Gallery, Section, Table, filled, section
from expdesign.export.roll_changes import RollVerdict, roll_sentences
from expdesign.vessel.quantities import GAINS_AND_OFFSETS

DRAWN_STRETCHES = 4  # stretches of data drawn in a diagnosis
SMALLEST_P_VALUE = 1e-12  # p-values below are printed as this bound in tables


# Names of causes and estimates in words, in place of "thrust_gain" or "lag_all_s".

TITLES = {cause.name: cause.title for cause in CAUSES}  # cause -> title; other causes have their name as title
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
    (re.compile(r"orders_late_(\w+)_s"), "delay of the recorded orders of {}"),
    (re.compile(r"deadband_(\w+?)(?:_rps|_rad)?"), "width of the dead band of {}"),
    (re.compile(r"angle_offset_(\w+)_rad"), "offset of {}"),
    (re.compile(r"input_factor_(\w+)"), "acting over recorded {}"),
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
MEASURES = ("Fit", "RMS error", "Mean error")
ABOUT_FITS = (
    "The fit is 100\N{NO-BREAK SPACE}% for a perfect simulation. It is 0\N{NO-BREAK SPACE}% for one that is as good as "
    "the mean of the measured velocity, and negative for a worse one. u is the surge speed ahead, v the sway speed to "
    "starboard, r the yaw rate to starboard."
)
ASTRAY = (
    "A fit far below zero means that the simulation of a whole run diverges from the ship. The model is then "
    "course-unstable, or its parameters are far off. In that case read the figure of the error growth instead of the "
    "fit: its simulations start again from measured states."
)
GROWTH = (
    "Error growth: error of the simulation against the time since it started from a measured state. Sensor noise "
    "gives a level line. A wrong model or an unmeasured disturbance gives a rising one. Where a line leaves the "
    "figure, the simulation has diverged from the ship."
)
TOO_SHORT = "These data are too short for that analysis, or have too many gaps."
ROLL = Markup(
    "The roll of <code>[roll]</code> does not act back on the path, so that the findings hold whatever it is. Roll "
    "rate, lateral acceleration, yaw rate and rudder give the coefficients of the roll equation; instruments come from "
    "the rudder. They are compared with those of the file, within the errors of both. The accelerometer feels gravity, "
    "so that a change of the hull's righting moment and one of the load differ. K_vd and z_f, which one load case does "
    "not tell, are as in the file. Where a single explanation is left, <code>vessel-extended.toml</code> has it."
)
METHOD = Markup(
    "Each cause of a catalogue has its own effect on the simulation error. Score tests search the error for these "
    "effects. They allow for the correlation of successive errors, for a slowly varying current, and for how runs "
    "differ. Parameters with a <code>parameter_std</code> in the vessel file may move within it in every test. The "
    "best cause is fitted and added to the model. This repeats until no cause is significant. The gains are measured "
    "by cross-validation on held-out {}; the causes themselves were selected with all data. "
    "<code>vessel-extended.toml</code> holds the model with the findings, except where the notes say otherwise."
)


def diagnosis_document(found: Diagnosis, roll: RollVerdict | None = None) -> Document:
    """The causes and what adding them gains, for people."""
    rolls, many = roll_sentences(roll), len(found.findings)
    before = (f"With the vessel file as it is, {accuracy_in_words(found.before)}.",) if many else ()
    return Document(
        kind="Diagnosis of the simulation model",
        title=found.vessel.name,
        name=f"Diagnosis {found.vessel.name}",
        about=_data(found),
        findings=(found.verdict, *before, *rolls),
        values={
            "verdict": found.verdict,
            "baseline": accuracy_entry(found.before),
            "findings": [finding_entry(item, found.before.outputs) for item in found.findings],
            **({"roll": " ".join(rolls)} if rolls else {}),
        },
        sections=(
            *filled(
                section(
                    "Causes of the simulation error", Table(header=CAUSE_HEADER, rows=cause_rows(found), on="terminal")
                )
            ),
            _accuracy(found),
            section("Missing acceleration", *_missing(found)),
            *(_finding(found, index) for index in range(many)),
            *([section("Roll", ROLL)] if rolls else []),
            section("Before and after" if found.is_extended else "Measured and simulated", *_stretches(found)),
            _tested(found),
            section("Method", METHOD.format(found.unit)),
        ),
        notes=diagnosis_notes(found),
    )


def diagnosis_notes(found: Diagnosis) -> tuple[str, ...]:
    """The notes of the page: doubts about the record, notes on the diagnosis, notes on the files."""
    rest = (note for note in found.record.notes if note not in found.record.doubts)
    return (*found.record.doubts, *found.notes, *rest)


def _accuracy(found: Diagnosis) -> Section:
    astray = has_diverged(found.before) or has_diverged(found.after)
    held_out = (
        "Nothing was found to extend the model by."
        if not found.is_extended
        else "This table uses the data that the extended model was fitted to. The gains below use "
        f"{found.unit} held out of the fit."
    )
    return section(
        "Accuracy of the simulation",
        f"{ABOUT_FITS} {ASTRAY}" if astray else ABOUT_FITS,
        Table(
            title="Simulation of the vessel file against the data"
            + (", and after what was found" if found.is_extended else ""),
            header=("Output", *(f"{what}\n{model}" for model in models(found) for what in MEASURES)),
            rows=accuracy_rows(found),
        ),
        "Each run is simulated from its first measured state with the measured inputs. Measurement noise counts as "
        f"misfit. {held_out}",
        Figure(draw=partial(growth_figure, found), caption=GROWTH),
    )


def models(found: Diagnosis) -> dict[str, Accuracy]:
    """The models whose accuracy there is to tell, by name: the extended one where there is one."""
    return {"model in use": found.before} | ({"extended model": found.after} if found.is_extended else {})


def _missing(found: Diagnosis) -> Iterator[Block]:
    """The acceleration that the model lacks, against all that it may depend on."""
    yield Markup(
        "This section assumes no cause. The data are cut into stretches of {}\N{NO-BREAK SPACE}s. Each is simulated "
        "from the measured state at its beginning. The rate at which measurement and simulation diverge is the "
        "acceleration that the model lacks: ahead (u), to starboard (v) and in yaw (r). The figures show it against "
        "the states, inputs, heading, time and run, as means over groups of stretches with two standard errors. The "
        "clearest dependence comes first. All figures of an output have the same scale. <b>Orange</b> means differ "
        "by more than chance explains. Correlated variables may be orange for one reason, such as u and the input "
        "that drives it. Unmeasured disturbances also show: a varying current depends on the heading. The tests of "
        "causes{} allow for that."
    ).format(f"{found.residuals.stretch_s:g}", " below" if found.findings else "")
    figures = residual_figures(found)
    if not figures:
        yield Markup("<b>{}</b>").format(TOO_SHORT)
        return
    yield f"Mean missing acceleration, with one standard error: {', '.join(_mean_missing(found))}."
    clear = tuple(figure for is_clear, figure in figures if is_clear)
    others = tuple(figure for is_clear, figure in figures if not is_clear)
    many = len(others) > 1
    yield (
        Gallery(clear, small=True)
        if clear
        else Markup("<b>Its dependence on each of {} variables is within chance.</b>").format(len(others))
    )
    if others:
        which = "The other" if clear else "These" if many else "This"
        yield Gallery(others, small=True, folded=f"{which} {f'{len(others)} variables' if many else 'variable'}")


def _stretches(found: Diagnosis) -> Iterator[Figure]:
    for index in drawn(found):
        caption = Markup("<b>{}</b>").format(_stretch(found, index))
        yield Figure(draw=partial(window_figure, found, index), caption=caption, above=True)


def _tested(found: Diagnosis) -> Section:
    above = " with the findings above in the model" if found.findings else ""
    other = " other" if found.findings else ""
    of_two = (
        " Of two runs, one beside others also stays where simulations of held-out data are certainly worse without it."
        if len(found.record.batches) == 2
        else ""
    )
    return section(
        f"{other} causes that were tested".strip().capitalize(),
        f"p-values of all{other} causes{above}, corrected for the number of tests. 1 means no evidence. A cause "
        f"becomes a finding if its p-value after the fit is at most {SELECTION_TUNING.accepted_p_value:g} and adding "
        f"it reduces an error of held-out {found.unit} by an interval that excludes zero.{of_two}",
        Table(
            header=("Cause", "p-value"),
            rows=[(cause_title(cause), f"{p_value:.2g}") for cause, p_value in found.screened],
            on="page",
        ),
    )


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
        for item in models(found).values():
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


def _finding(found: Diagnosis, index: int) -> Section:
    item, several = found.findings[index], len(found.findings) > 1
    fits = (
        f"{name} {_fit(float(a))} \N{RIGHTWARDS ARROW} {_fit(float(b))}"
        for name, a, b in zip(found.before.outputs, item.fit_before, item.fit_after, strict=True)
    )
    reductions = [(f"{one.output} {_share(one)}") for one in item.error_reductions if np.isfinite(one.share)]
    low, high = item.gain_interval
    nb = words.NB
    rows = [
        *(
            (estimate_words(one.name, item.cause), f"{_with_error(one)}\n{_says(one)}".strip())
            for one in item.estimates
        ),
        ("p-value, corrected for the number of causes tested", _p_value(item.p_value)),
        (
            f"Fit on held-out {found.unit}, without and with this cause"
            f"{'; the findings before it are in the model' if several else ''}",
            Markup("<br>").join(fits),
        ),
        (f"Reduction of the error on these {found.unit}, 95{nb}% interval", Markup("<br>").join(reductions)),
        (
            f"Gain of fit, mean of {', '.join(found.before.outputs)}",
            f"{words.number(item.gain, 1)} points\n95{nb}% interval {words.number(low, 1)} to {words.number(high, 1)}",
        ),
        (
            f"Squared error of predictions from sample to sample, 95{nb}% interval",
            "" if item.predicted is None else f"less by {_share(item.predicted)}",
        ),
    ]
    force, signed = is_force(found, item), has_sign(item)
    what = "Missing acceleration" if force else "Measured minus simulated"
    return section(
        f"{index + 1}. {cause_title(item.cause)}",
        Markup("<b>{}</b> {}").format(item.explanation, doubt(item)),
        Table(header=("Quantity", "Value"), rows=[row for row in rows if row[1]], texts=2, on="page"),
        _alternatives(item),
        Figure(
            draw=partial(suspect_figure, found, index, f"suspect{index}"),
            caption=f"{what} of the model without this cause, against the variable that this cause makes it depend on. "
            f"Grey: each {'stretch' if force else 'sample'}. Colour: {'means' if signed else 'root mean squares'} of "
            f"groups. Without such a cause, the coloured line stays {'near zero' if signed else 'level'}.",
        ),
    )


def _alternatives(item: Finding) -> str:
    """What explains the data as well, and what would tell it apart."""
    others = alternatives(item)
    if not others:
        return "No other cause of the catalogue explains the data nearly as well."
    text = Markup("<b>Alternatives:</b> {}. {} the data as well.").format(
        ", or ".join(others), "It explains" if len(others) == 1 else "They explain"
    )
    if item.would_tell_apart is None:
        return text
    return text + Markup(
        " To distinguish them, sail <b>{}</b>. The explanations disagree most there, per minute."
    ).format(manoeuvre(item.would_tell_apart))


def _with_error(item: Estimate) -> str:
    return f"{plus_minus(item.value, item.std)} {item.unit}".rstrip().replace("-", words.MINUS)


def _says(item: Estimate) -> str:
    return "" if item.stated is None else f"the file says {words.significant(item.stated, 4)}"


def _share(item: ErrorReduction) -> str:
    shares = (words.number(100 * value, 0) for value in (item.share, item.low, item.high))
    return "{}{nb}% ({} to {}{nb}%)".format(*shares, nb=words.NB)


def _fit(value: float) -> str:
    return "diverged" if not value >= DIVERGED_FIT else f"{words.number(value, 1)}{words.NB}%"


def _p_value(p_value: float) -> str:
    """Two digits, and why a large one counts; very small ones depend on the noise, so only a bound is given."""
    if p_value > SELECTION_TUNING.level:  # see `diagnosis.select.backward_elimination`
        return f"{p_value:.2g}; it stays because simulations of held-out data are worse without it"
    return f"< {SMALLEST_P_VALUE:g}" if p_value < SMALLEST_P_VALUE else f"{p_value:.2g}"


def _data(found: Diagnosis) -> str:
    windows = found.windows
    return (
        f"{words.counted(len(windows.names), 'run')}, {words.duration(windows.duration_s)} in all, compared every "
        f"{windows.sample_s:g}{words.NB}s"
    )
