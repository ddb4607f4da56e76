"""Results of roll identification: JSON and a document."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from expdesign import __version__
from expdesign.conventions import plus_minus
from expdesign.export.document import Document, Mark, Table, filled, section
from expdesign.export.files import entry, finite, strict_json
from expdesign.export.words import percent
from expdesign.roll import (
    EFFECTS,
    MEANINGS,
    PARAMETERS,
    UNITS,
    LowPass,
    NullSpace,
    RollEstimate,
    froude_scaled,
    metacentric_height,
    roll_frequency,
    stiffness,
)
from expdesign.roll.estimate import LEAST_STRENGTH
from expdesign.roll.regression import MOST_SURPRISE

PARAMETER_HEADER = ("Parameter", "Meaning", "Estimate", "95 % interval", "Unit")
SCALED_HEADER = ("Parameter", "At full scale", "95 % interval", "Unit")
CURE_HEADER = ("What more", "Directions left open", "Smallest relative sensitivity")
EFFECT_WORDS = {"quadratic": "damping by the square", "forward": "the sensor's place", "tilt": "the sensor's tilt"}
NORMAL = 1.96
LEAST_CHANCE = 1e-4  # smallest probability that is written out


@dataclass(frozen=True, kw_only=True, eq=False)
class RollContent:
    """The values that page and files show."""

    estimate: RollEstimate  # the parameters
    report: NullSpace  # the combinations that the data do not determine
    filter: LowPass  # that the data passed
    notes: tuple[str, ...]  # on the data
    command: str  # to reproduce it
    scale: float | None = None  # of the ship to the model that was tried; None for a ship


def parameter_rows(content: RollContent) -> list[tuple[str, ...]]:
    """One for each parameter that is estimated or given."""
    return [
        (name, MEANINGS[name], f"{value:.4g}", _interval(content, name), UNITS[name])
        for name, value in content.estimate.values.items()
        if name in content.estimate.problem.free or value
    ]


def _interval(content: RollContent, name: str, factor: float = 1.0) -> str:
    estimate = content.estimate
    if name not in estimate.problem.free:
        return "given"
    if name in estimate.held:
        return "held: not determined"
    low, high = (factor * end for end in interval(content, name))
    only = f" for {' and '.join(estimate.held)} as held" if name in content.report.undetermined else ""
    shown = f"{low:.4g} to {high:.4g}{only}" if high < float("inf") else f"{low:.4g} or more{only}"
    return shown if estimate.trusted and name not in estimate.by_tilt else f"none to be trusted ({shown})"


def interval(content: RollContent, name: str) -> tuple[float, float]:
    """95 % interval of a free parameter, for held parameters as they are; that of the unknown load by its profile."""
    if name == "m" and content.estimate.load_interval is not None:
        return content.estimate.load_interval
    value, std = content.estimate.values[name], content.estimate.std[name]
    return value - NORMAL * std, value + NORMAL * std


def scaled_rows(content: RollContent) -> list[tuple[str, ...]]:
    """What Froude's law makes of free parameters for the ship; none without a scale."""
    if content.scale is None:
        return []
    of = dict(zip(PARAMETERS, froude_scaled(np.ones(len(PARAMETERS)), content.scale).tolist(), strict=True))
    estimate = content.estimate
    free = [name for name in estimate.problem.free if name not in estimate.held]
    return [
        (name, f"{of[name] * estimate.values[name]:.4g}", _interval(content, name, of[name]), UNITS[name])
        for name in free
    ]


def cure_rows(content: RollContent) -> list[tuple[str, ...]]:
    """What would determine the open directions, the best first."""
    count = len(content.report.free)
    return [(one.what, str(count - one.rank), f"{one.smallest:.2g}") for one in content.report.cures]


def roll_sentences(content: RollContent) -> Iterator[str]:
    """The findings."""
    estimate, report, body = content.estimate, content.report, content.estimate.problem.body
    if not estimate.trusted:
        yield f"None of these estimates is to be trusted: {headline(content)}."
    if "m" in estimate.problem.free:
        yield _load(content)
    for case in estimate.problem.cases:
        right = stiffness(estimate.theta, body, case.load)
        hertz = roll_frequency(estimate.theta, body, case.load)
        upright = f"a roll period of {1.0 / hertz:.3g} s" if hertz else "which does not keep her upright"
        if_so = f", for {' and '.join(estimate.held)} as held" if estimate.held else ""
        height = f"a metacentric height of {plus_minus(*metacentric_height(estimate, case.load))} m"
        warned = "" if estimate.trusted else "Not to be trusted: "
        yield f"{warned}{case.name}: righting moment {right:.4g} N m/rad, {height}, {upright}{if_so}."
    if estimate.trusted and estimate.tilt_told:
        yield from _effects(content)
    yield from _open(content)
    for one in report.faint:
        yield f"The data hardly show the combination {one}: its relative standard deviation is {1.0 / one.size:.2g}."
    yield _filtered(content)
    if not estimate.settled:
        yield "Instruments and noise models did not settle; expected longer runs, or a better start under [start]."
    if estimate.surprise > MOST_SURPRISE:
        yield (
            f"Residuals follow the rudder {estimate.surprise:.2g} times as much as noise would: the model misses "
            "something, or a strong roll moment of waves hides what the rudder does."
        )
    if estimate.weak:
        yield (
            "Waves and sensors hide what the rudder does, so that estimates lean towards those of least squares: the "
            f"information from the rudder is {estimate.strength:.2g} times what noise alone would give, expected "
            f"{LEAST_STRENGTH:g} times or more by larger rudder angles, longer runs or calmer water."
        )
    if estimate.answering:
        yield (
            "The rudder seems to answer what rolls the ship: it follows the noise of roll, as one that answers nothing "
            f"does by chance in {_chance(estimate.unanswered)} of trials. Estimates then lean towards what the "
            "helm does; steer by hand or by a course alone, or give what was planned as planned_rudder1_rad."
        )
    if estimate.trusted and estimate.by_tilt:
        moved = ", ".join([*estimate.by_tilt, *(EFFECT_WORDS[name] for name in estimate.effects)])
        yield (
            f"{moved} are not to be trusted, as nothing tells how the sensor is tilted: other tilts fit as well, with "
            "other values of these. Load and metacentric heights are hardly affected. Measure the tilt and state "
            "sensor_tilt_deg."
        )
    for name in estimate.reached:
        yield (
            f"{name} stands at a bound of the search, {estimate.values[name]:.4g} {UNITS[name]}: it is no estimate; "
            "give it under [known], or a better start under [start]."
        )
    if estimate.method == "ls":
        yield "Least squares is biased where waves or sensors disturb, and its intervals do not say so; use iv."
    if not estimate.trusted:
        yield "The 95 % intervals are not to be trusted, for what is said above; they may be far too short."


def _load(content: RollContent) -> str:
    """The unknown load, where the data tell it."""
    estimate, (low, high) = content.estimate, interval(content, "m")
    value = f"{estimate.values['m']:.4g} kg"
    if "m" in estimate.held:
        return f"The unknown load is not known: the load cases do not determine it, and {value} is its start value."
    if "m" in estimate.reached:
        return f"The unknown load is not known: its search ended at a bound, {value}."
    above = high == float("inf")
    known = f"{low:.4g} kg or more, to which the data set no limit" if above else f"{low:.4g} to {high:.4g} kg"
    known = f"95 % interval {known}"
    only = f", for {' and '.join(estimate.held)} as held" if "m" in content.report.undetermined else ""
    if not estimate.trusted:
        return f"The unknown load is not known: the estimate of {value} with the {known}{only} is not to be trusted."
    return f"The unknown load is {value}, {known}{only}."


def headline(content: RollContent) -> str:
    """The first reason why nothing is to be trusted, in a few words; "" where all is."""
    one = content.estimate
    reasons = {
        "least squares is biased by waves and sensors": one.method == "ls",
        f"the search for {' and '.join(one.reached)} ended at a bound": bool(one.reached),
        "the model misses something of what the rudder does": one.surprise > MOST_SURPRISE,
        "waves and sensors hide what the rudder does": one.weak,
        "the rudder seems to answer roll": one.answering,
        "the estimate did not settle": not one.settled,
    }
    return next((reason for reason, true in reasons.items() if true), "")


def _effects(content: RollContent) -> Iterator[str]:
    """What the equation needed besides its parameters."""
    estimate, body = content.estimate, content.estimate.problem.body
    apart = "\N{PLUS-MINUS SIGN}"
    for name, (value, std) in estimate.effects.items():
        if name == "quadratic":
            yield (
                "Roll is damped by the square of its rate, too, which is estimated beside d: the moment is "
                f"d (phi' + q abs(phi') phi') with q = {value:.3g} {apart} {std:.2g} s/rad. A vessel file has the "
                "linear part alone."
            )
        elif name == "forward":
            yield (
                f"The accelerometer reads as if it stood {body.forward_m + value:.3g} {apart} {std:.2g} m before "
                f"the axis of yaw, not {body.forward_m:g} m as stated; this is estimated, too. State sensor_forward_m."
            )
        else:
            stated = "not level" if body.tilt_rad is None else f"not {np.degrees(body.tilt_rad):g} as stated"
            tilt, error = np.degrees((body.tilt_rad or 0.0) + value), np.degrees(std)
            yield (
                f"The gyros read as if the sensor were tilted by {tilt:.3g} {apart} {error:.2g} degrees, bow end up, "
                f"{stated}; this is estimated, too. State sensor_tilt_deg."
            )


def _open(content: RollContent) -> Iterator[str]:
    report, held = content.report, content.estimate.held
    if not report.open:
        yield f"The load cases determine all {len(report.free)} parameters (rank {report.rank})."
        return
    yield (
        f"The load cases determine {report.rank} of {len(report.free)} parameters, whatever the data are. "
        f"{', '.join(held)} {'was' if len(held) == 1 else 'were'} held at the start value."
    )
    for one in report.open:
        yield f"The data would be the same if these changed together: {one}. So none of them is known by itself."


def _chance(p_value: float) -> str:
    return percent(p_value) if p_value >= LEAST_CHANCE else f"less than {percent(LEAST_CHANCE)}"


def _filtered(content: RollContent) -> str:
    used = content.filter
    if len(used.taps) == 1:
        return f"No filter; {used.samples_per_period:.0f} samples in a period of roll."
    return (
        f"The low-pass filter has a bandwidth of {used.bandwidth_hz:.3g} Hz and passes {percent(used.passed)} of "
        f"roll at {used.roll_hz:.3g} Hz; {used.samples_per_period:.0f} samples in its period."
    )


def roll_json(content: RollContent) -> str:
    """All results as JSON."""
    estimate, report = content.estimate, content.report
    return strict_json(
        {
            "command": content.command,
            "version": __version__,
            "method": estimate.method,
            "parameters": {name: _parameter(content, name) for name in estimate.values},
            "null_space": {
                **entry(report, "free", "rank", "singular_values"),
                "open": [one.change for one in report.open],
                "faint": [{"change": one.change, "relative_std": 1.0 / one.size} for one in report.faint],
                "cures": [vars(one) for one in report.cures],
            },
            "filter": {
                **entry(content.filter, "bandwidth_hz", "roll_hz", "passed"),
                "sample_time_s": content.filter.step_s,
            },
            **({} if content.scale is None else {"at_full_scale": _scaled(content)}),
            "effects": {
                name: {
                    "value": value,
                    "std": std,
                    "meaning": EFFECTS[name][0],
                    "unit": EFFECTS[name][1],
                    "trusted": estimate.trusted and estimate.tilt_told,
                }
                for name, (value, std) in estimate.effects.items()
            },
            "metacentric_heights_m": {
                case.name: dict(zip(("value", "std"), metacentric_height(estimate, case.load), strict=True))
                for case in estimate.problem.cases
            },
            "load_interval_kg": None
            if estimate.load_interval is None
            else [finite(end) for end in estimate.load_interval],
            "settled": estimate.settled,
            "surprise": finite(estimate.surprise),
            "instrument_strength": finite(estimate.strength),
            "chance_that_the_rudder_answers_nothing": finite(estimate.unanswered),
            "reached_bounds": list(estimate.reached),
            "intervals_trusted": estimate.trusted,
            "not_trusted_for_tilt": list(estimate.by_tilt),
            "remarks": list(roll_sentences(content)),
            "notes": list(content.notes),
        }
    )


def _scaled(content: RollContent) -> dict[str, object]:
    estimate, scale = content.estimate, content.scale
    assert scale is not None
    std = np.array([estimate.std.get(name, 0.0) for name in PARAMETERS])
    values, stds = froude_scaled(estimate.theta, scale).tolist(), froude_scaled(std, scale).tolist()
    rows = zip(PARAMETERS, values, stds, strict=True)
    entries = {
        name: {"value": value, "std": deviation or None, "determined": _determined(content, name)}
        for name, value, deviation in rows
    }
    return {"scale": scale, **entries}


def _determined(content: RollContent, name: str) -> bool:
    return name in content.estimate.problem.free and name not in content.report.undetermined


def _parameter(content: RollContent, name: str) -> dict[str, object]:
    estimate = content.estimate
    free = name in estimate.problem.free
    std = estimate.std[name] if free and name not in estimate.held else None
    return {
        "value": estimate.values[name],
        "unit": UNITS[name],
        "std": std,
        "determined": _determined(content, name),
    }


EQUATION = Markup(
    "A<sub>1</sub> &phi;'' = &minus;(k + g S) &phi; &minus; d &phi;' + (K<sub>vd</sub> + S) a<sub>y</sub> + "
    "K<sub>r</sub> r + K<sub>&delta;</sub> &delta;, with roll &phi;, positive to starboard, side acceleration "
    "a<sub>y</sub>, yaw rate r and rudder &delta;. A<sub>1</sub> is the inertia of A<sub>x</sub> and all masses about "
    "the rotation axis, S their first moment, negative for masses above it."
)
FROUDE = (
    "By Froude\u2019s law, in the same water: in sea water, 2.5 % heavier than fresh, mass, moments and inertia of the "
    "ship grow by as much. Damping by friction is relatively less at full scale."
)
STANDARD = "Behind \N{PLUS-MINUS SIGN} stands one standard deviation; intervals hold the truth in 95 % of trials."
SENSITIVITY = (
    "One of these is enough where no direction is left open; the higher the sensitivity, the better. The sensitivity "
    "is that of the coefficients of all cases to relative changes of the parameters, along the direction that the data "
    "determine least. At 0.01 a coefficient changes by 1 % while the parameters change by 100 %."
)


def roll_document(content: RollContent) -> Document:
    """The estimate for people."""
    estimate, report = content.estimate, content.report
    scaled = Table(header=SCALED_HEADER, rows=scaled_rows(content))
    cures = Table(header=CURE_HEADER, rows=cure_rows(content))
    as_long = f"The ship, {content.scale or 1.0:g} times as long as her model"
    return Document(
        kind="Roll and loading",
        title=", ".join(case.name for case in estimate.problem.cases),
        name="Roll and loading",
        about=EQUATION,
        mark=None if estimate.trusted else Mark(text=f"None to be trusted: {headline(content)}", good=False),
        findings=tuple(roll_sentences(content)),
        facts={"parameters_sought": len(report.free), "of_these_determined": report.rank},
        values={
            "trusted": "all" if estimate.trusted else f"none: {headline(content)}",
            "parameters": estimate.values,
            "std": {name: std for name, std in estimate.std.items() if name not in estimate.held},
            "held": list(estimate.held),
        },
        sections=filled(
            section("Parameters", Table(header=PARAMETER_HEADER, rows=parameter_rows(content), texts=2), STANDARD),
            section(as_long, scaled, FROUDE),
            section("What would determine the rest" if report.open else "What would tell more", cures, SENSITIVITY),
        ),
        notes=content.notes,
    )
