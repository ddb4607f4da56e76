"""A step trial as JSON, tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import plus_minus
from expdesign.export.document import Table
from expdesign.export.files import entry, finite, named_finite, strict_json
from expdesign.export.words import counted
from expdesign.step_trials import CHANNELS, NO_BEND, StepSample, StepTrial, Surface
from expdesign.step_trials.live import StepList
from expdesign.values import Array
from expdesign.vessel import Vessel, column_name

SIGNIFICANT = 0.01  # p-value below which asymmetry and hysteresis are reported as found
STATES = ("speed", "yaw rate")
STATE_UNITS = ("m/s", "rad/s")


@dataclass(frozen=True, kw_only=True, eq=False)
class Validated:
    """A batch simulated from its first state with its commands alone."""

    name: str  # of the batch
    time_s: Array  # (k,)
    # measured, simulated: (k, 2) U and r
    measured: Array
    simulated: Array
    fit_percent: Array  # (2,)


@dataclass(frozen=True, kw_only=True, eq=False)
class StepTrialContent:
    """The values that page and files show."""

    trial: StepTrial  # what was identified
    listed: StepList | None  # steps that were to be sailed; None where every step of the record was
    # before, nominal: the vessel as its file knew it, and after the steps; None where no file was given
    before: Vessel | None
    nominal: Vessel | None
    # own, tests: simulations of the data, and of data held out
    own: tuple[Validated, ...]
    tests: tuple[Validated, ...]
    notes: tuple[str, ...]  # on the data
    command: str  # to reproduce it


def begins_s(content: StepTrialContent, one: StepSample) -> float:
    """Time of the change of command in its batch [s]."""
    return one.hold.begin * content.trial.batches[one.hold.batch].sample_time_s


def to_repeat(content: StepTrialContent) -> tuple[StepSample, ...]:
    """Steps that give no inertia, of those that were to be sailed."""
    trial, listed = content.trial, content.listed
    if listed is None:
        return trial.repeat
    sign = np.array([1.0, trial.rudder_sign])
    return tuple(
        one
        for one in trial.repeat
        if listed.holds(sign * np.subtract(one.hold.commands, one.hold.change), sign * one.hold.commands)
    )


def command_units(content: StepTrialContent) -> tuple[str, str]:
    """Units of throttle and rudder, "" for forces in the unit of a model."""
    controls = content.trial.controls
    signals = controls.throttle[0], (controls.rudder or controls.throttle)[0]
    return unit_of(signals[0]), unit_of(signals[1])


def unit_of(signal: str) -> str:
    """Unit of an input: n1 -> rps."""
    return column_name(signal).removeprefix(signal).removeprefix("_")


def sentences(content: StepTrialContent) -> Iterator[str]:
    """The findings."""
    trial = content.trial
    ahead = [one for one in trial.samples if not one.hold.astern]
    asked = sum(one.hold.channel is not None for one in ahead)
    steady = sum(one.plateau is not None for one in ahead)
    turned = ", negative for turns to starboard; the model counts it the other way" * (trial.rudder_sign < 0)
    yield (
        f"{len(trial.counted)} of {counted(asked, 'step')} give an inertia; {steady} of "
        f"{counted(len(ahead), 'hold')} were steady and give a damping. Throttle is {trial.controls.words[0]}, "
        f"rudder {trial.controls.words[1]}{turned}."
    )
    if len(ahead) < len(trial.samples):
        numbers = ", ".join(str(one.hold.number) for one in trial.samples if one.hold.astern)
        yield f"Holds {numbers} go astern or begin from astern, left out: the model is of a vessel that goes ahead."
    delays = [
        f"{name} {value:.2f} \N{PLUS-MINUS SIGN} {std:.2f} s"
        for name, (value, std) in zip(CHANNELS, trial.delays, strict=True)
        if math.isfinite(std)
    ]
    yield f"Dead times: {', '.join(delays)}."
    yield from _halves(content)
    yield from _currents(content)
    fits = [_fit(content, part) for part in content.own]
    yield f"Simulated from its commands alone, the model fits {'; '.join(fits)}, the data that it was made from."
    if content.tests:
        fits = [_fit(content, part) for part in content.tests]
        yield f"It fits {'; '.join(fits)}, which {'was' if len(fits) == 1 else 'were'} held out."
    if again := to_repeat(content):
        numbers = ", ".join(str(one.hold.number) for one in again)
        yield f"Repeat {'step' if len(again) == 1 else 'steps'} {numbers}; the reasons are below."
        if content.listed is None:
            yield "With --steps PLAN.json, only steps of its runs are asked to be repeated, not changes between them."
    yield from _compared(content)
    outside = [one for one in trial.samples if one.plateau is not None and not one.plateau.turns]
    if len(outside) > steady / 2 and not any(trial.currents):
        yield (
            f"{len(outside)} of {counted(steady, 'steady hold')} lasted less than a whole turn: a current would be in "
            "their speeds. In a current hold each step for a whole turn."
        )


def _fit(content: StepTrialContent, part: Validated) -> str:
    halves = content.trial.model.halves
    return ", ".join(f"{'Ur'[place]} {part.fit_percent[place]:.0f} %" for place, *_ in halves) + f" of {part.name}"


def _halves(content: StepTrialContent) -> Iterator[str]:
    """What the model lacks where steps of one command are missing."""
    there = {place for place, *_ in content.trial.model.halves}
    for place in {0, 1} - there:
        own = [one for one in content.trial.samples if one.hold.channel == place and not one.hold.astern]
        count = sum(one.counts for one in own)
        yield (
            f"Only the half of the {STATES[1 - place]} is identified: {count} of {counted(len(own), 'step')} of the "
            f"{CHANNELS[place]} alone give an inertia, expected 3 or more for the half of the {STATES[place]}."
        )


def _currents(content: StepTrialContent) -> Iterator[str]:
    trial = content.trial
    for batch, one in zip(trial.batches, trial.currents, strict=False):
        if one is not None:
            size, std = float(np.hypot(*one.to_mps)), math.sqrt(float(np.trace(one.covariance)) / 2)
            to = round(math.degrees(math.atan2(one.to_mps[1], one.to_mps[0]))) % 360
            about = f"{plus_minus(size, max(std, 0.001))} m/s"
            yield (
                f"{batch.name}: turns show a current of {about} to {to} degrees, "
                "which is taken off: U is the speed through the water."
            )


def _compared(content: StepTrialContent) -> Iterator[str]:
    significant = [one for one in content.trial.found if one.p_value < SIGNIFICANT]
    for one in significant:
        own = command_units(content)[CHANNELS.index(one.command)] or f"of the {one.command}"
        size = f"{plus_minus(abs(one.difference), one.std)} {own}"
        what = "port and starboard differ" if one.kind == "asymmetry" else "steps up and down end in different states"
        if one.kind == "hysteresis":
            unit = STATE_UNITS[CHANNELS.index(one.command)]
            what += (
                f": {abs(one.state_difference):.3g} {unit} {'more' if one.state_difference > 0 else 'less'} after steps"
            )
            where = (
                "on average" if one.at is None else f"at throttle {_order(one.at[0])}, rudder {_order(one.at[1])}, most"
            )
            what += f" down {where} of {counted(one.samples // 2, 'pair')} of holds, as if the {one.command} stood off"
        yield f"{one.kind.capitalize()}: {what} by {size} to either side of the mean (p = {one.p_value:.1g})."
    if content.trial.found and not significant:
        kinds = sorted({one.kind for one in content.trial.found})
        yield f"No sign of {' or '.join(kinds)} at the level of {SIGNIFICANT:g}."


def repeat_table(content: StepTrialContent) -> Table:
    """Steps to be sailed again, and why."""
    rows = [
        (str(one.hold.number), f"{begins_s(content, one):.0f} s", _to(one, 0), _to(one, 1), "; ".join(one.problems))
        for one in to_repeat(content)
    ]
    return Table(header=("Step", "Begins at", "Throttle", "Rudder", "Why"), rows=rows, texts=5)


def _to(one: StepSample, channel: int) -> str:
    after, change = one.hold.commands[channel], one.hold.change[channel]
    moved = one.hold.changed in (CHANNELS[channel], "both")
    return f"{_order(after - change)} \N{RIGHTWARDS ARROW} {_order(after)}" if moved else _order(after)


def _order(value: float) -> str:
    """A command without the rounding errors of its computation."""
    return f"{round(value, 6) + 0.0:.3g}"


def step_table(content: StepTrialContent) -> Table:
    """Every hold, on the page."""
    header = ("Step", "Throttle", "Rudder", "Steady after", "U [m/s]", "r [rad/s]", "Turns", "Time constant",
              "Inertia", "Remarks")  # fmt: skip
    rows = [_step_row(content, one) for one in content.trial.samples]
    return Table(header=header, rows=rows, texts=10, on="page")


def constant_std_s(content: StepTrialContent, one: StepSample) -> float:
    """Standard error of a step's time constant [s]: that of its response, and of the dead time before it."""
    assert one.response is not None
    return math.hypot(one.response.time_constant_std_s, content.trial.delays[one.hold.channel or 0][1])


def _step_row(content: StepTrialContent, one: StepSample) -> tuple[str, ...]:
    part, response = one.plateau, one.response
    state = ("", "", "") if part is None else (f"{part.state[0]:.2f}", f"{part.state[1]:.3f}", str(part.turns))
    time = (
        ""
        if response is None
        else f"{response.time_constant_s:.2f} \N{PLUS-MINUS SIGN} {constant_std_s(content, one):.2f} s"
    )
    mass = plus_minus(one.inertia, one.inertia_std) if math.isfinite(one.inertia) else ""
    remarks = "; ".join((*one.problems, *one.remarks))
    return (
        str(one.hold.number), _to(one, 0), _to(one, 1), "" if one.steady_s is None else f"{one.steady_s:.0f} s", *state,
        time, mass, remarks,
    )  # fmt: skip


def nominal_table(content: StepTrialContent) -> Table:
    """Parameter, value before and value after, with standard deviations; no rows without a vessel file."""
    header = ("Parameter", "Before", "After the steps")
    if content.before is None or content.nominal is None:
        return Table(header=header, rows=[])
    before, after = content.before.model, content.nominal.model
    columns = (before.names, before.parameters, before.parameter_std, after.parameters, after.parameter_std)
    rows = [
        (name, _pair(value, std), _pair(found, left)) for name, value, std, found, left in zip(*columns, strict=True)
    ]
    return Table(header=header, rows=rows, texts=3)


def _pair(value: float, std: float) -> str:
    return plus_minus(value, std) if std > 0 else f"{value:.4g}, known"


def step_model_json(content: StepTrialContent) -> str:
    """Everything, with units in the names."""
    trial, model = content.trial, content.trial.model
    return strict_json(
        {
            "remarks": list(sentences(content)),
            "throttle": list(trial.controls.throttle),
            "rudder": list(trial.controls.rudder) or "differential",
            "rudder_sign": trial.rudder_sign,
            "model": {
                "equations": "m_U(U, r) dU/dt + sigma_U(U, r) = throttle(t - delay), the same in r with the rudder",
                "delay_s": {CHANNELS[place]: model.delay_s[place] for place, *_ in model.halves},
                "delay_std_s": {name: finite(std) for name, (_, std) in zip(CHANNELS, trial.delays, strict=True)},
                **{f"sigma_{'Ur'[place]}": _surface(part) for place, part, _ in model.halves},
                **{f"m_{'Ur'[place]}": _surface(part) for place, _, part in model.halves},
                "validity_corners": [{"U_mps": u, "r_radps": r} for u, r in model.region.outline.tolist()],
            },
            "steady_state_test": {
                state: {
                    "interval_s": test.interval_s,
                    "l1_per_s": test.rate / test.interval_s,
                    "l2_l3_per_s": test.variance_rate / test.interval_s,
                    "steady_below": test.lower,
                    "transient_above": test.upper,
                }
                for state, test in zip("Ur", trial.tests, strict=True)
            },
            "steps": [_step(content, one) for one in trial.samples],
            "currents": [
                None if one is None else {"to_north_mps": one.to_mps[0], "to_east_mps": one.to_mps[1]}
                for one in trial.currents
            ],
            "comparisons": [{**vars(one), "state_difference": finite(one.state_difference)} for one in trial.found],
            "fit_percent": {part.name: named_finite("Ur", part.fit_percent) for part in (*content.own, *content.tests)},
            "notes": list(content.notes),
            "command": content.command,
        }
    )


def _surface(part: Surface) -> dict[str, object]:
    powers = [
        {"U": i, "r": j, "coefficient": c}
        for (i, j), c in zip(part.powers, part.fit.coefficients.tolist(), strict=False)
    ]
    bend = None
    if part.bend != NO_BEND:
        bend = {"a_spm": part.bend[0], "b_mps": part.bend[1], "coefficient": float(part.fit.coefficients[-1])}
    return {
        "terms": powers, "tanh": bend, "method": part.fit.method, "penalty": part.fit.penalty,
        "held_out_rms": finite(part.fit.held_out), "least_measured": part.least, "most_measured": part.most,
    }  # fmt: skip


def _step(content: StepTrialContent, one: StepSample) -> dict[str, object]:
    part, response = one.plateau, one.response
    return {
        "number": one.hold.number,
        "batch": content.trial.batches[one.hold.batch].name,
        "begins_s": begins_s(content, one),
        "changed": one.hold.changed,
        "throttle": one.hold.commands[0],
        "rudder": one.hold.commands[1],
        "steady_after_s": one.steady_s,
        "U_mps": None if part is None else float(part.state[0]),
        "U_std_mps": None if part is None else finite(part.std[0]),
        "r_radps": None if part is None else float(part.state[1]),
        "r_std_radps": None if part is None else finite(part.std[1]),
        "turns": None if part is None else part.turns,
        "time_constant_s": None if response is None else response.time_constant_s,
        "time_constant_std_s": None if response is None else finite(constant_std_s(content, one)),
        "damping_ratio": None if response is None else response.damping,
        "zero_s": None if response is None else response.zero_s,
        **entry(one, "inertia", "inertia_std", "problems", "remarks"),
    }
