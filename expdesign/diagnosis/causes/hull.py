"""Causes in the model of the hull: terms, parameters, load, roll, a change during the trial."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import AXES
from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values, first, rounded
from expdesign.diagnosis.model import (
    ADVANCE_LOSS,
    AIR,
    ROLL,
    ExtendedModel,
    asymmetry_terms,
    own_advance_terms,
    own_air_terms,
)

CHANGE_POINTS = 12
FINER = 6
EDGE = 0.06  # share of a run at either end in which no change is tested


def _candidates_change_point(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if "change:time" in situation.ship.effects or not windows.starts:
        return ()
    end = float(windows.time_s.max())
    outputs = situation.ship.model.outputs
    effects = ["change:gain", "change:damping", *(f"change:damping_{name}" for name in outputs)]
    spacing = end / (CHANGE_POINTS + 1)
    found = []
    for time in np.linspace(0.0, end, CHANGE_POINTS + 2)[1:-1].tolist():
        _, begin, length = windows.place(time)
        inside = begin + EDGE * length, begin + (1.0 - EDGE) * length
        finer = np.clip(time + spacing * np.linspace(-1, 1, 2 * FINER + 1), *inside)
        found += [
            Candidate(
                cause="change_point",
                free={key: 0.0},
                fixed={"change:time": float(np.clip(time, *inside))},
                grid=("change:time", tuple(np.unique(finer).tolist())),
                above={"change:time": begin},
                below={"change:time": begin + length},
            )
            for key in effects
        ]
    return tuple(found)


def _explain_change_point(values: Values, _ship: ExtendedModel) -> str:
    time, std = values["change:time"]
    rest = {key: pair for key, pair in values.items() if key != "change:time"}
    words = ", ".join(f"{key.split(':')[1]} by {rounded(100 * v, 100 * s)} %" for key, (v, s) in rest.items())
    return f"The model is correct until {rounded(time, std)} s. After that the data show changes: {words}."


CHANGE_POINT = Cause(
    name="change_point",
    title="Change during the trial",
    missing="a change of the ship during the trial",
    summary="a change of parameters during a run; between separate runs much else may differ",
    candidates=_candidates_change_point,
    explain=_explain_change_point,
)


def _candidates_load_change(situation: Situation) -> tuple[Candidate, ...]:
    if any(key.startswith("inertia:") for key in situation.ship.effects):
        return ()
    outputs = situation.ship.model.outputs
    groups: list[tuple[str, ...]] = [(name,) for name in outputs]
    if len(outputs) == 3:
        groups += [("u", "v"), ("v", "r"), ("u", "v", "r")]
    return tuple(Candidate(cause="load_change", free={f"inertia:{n}": 0.0 for n in group}) for group in groups)


def _explain_load_change(values: Values, _ship: ExtendedModel) -> str:
    parts = ", ".join(f"{AXES[key[-1]]} by {rounded(100 * value, 100 * std)} %" for key, (value, std) in values.items())
    return f"Damping and thrust are wrong by the same factor, so the inertia differs from the model's: {parts}."


LOAD_CHANGE = Cause(
    name="load_change",
    title="Change of load (inertia)",
    missing="the correct inertia",
    summary="inertia that differs from the model's: other accelerations, the same steady speeds",
    candidates=_candidates_load_change,
    explain=_explain_load_change,
)


def absent_terms(situation: Situation, *, air: bool) -> list[str]:
    """Library terms not yet in the extended model: those of the air, or the others without the advance loss."""
    return [
        name
        for name in situation.ship.library
        if (name in AIR) == air and name not in ADVANCE_LOSS and not situation.has(f"term:{name}")
    ]


def _candidates_missing_term(situation: Situation) -> tuple[Candidate, ...]:
    return tuple(
        Candidate(cause=f"missing_term:{name}", free={f"term:{name}": 0.0})
        for name in absent_terms(situation, air=False)
    )


def _explain_missing_term(values: Values, ship: ExtendedModel) -> str:
    ((key, (value, std)),) = values.items()
    name = key[5:]
    term = f"the term {name} = {rounded(value, std)}, which multiplies {ship.library[name].expression}"
    return f"The error is correlated with a regressor that the model lacks: {term}."


MISSING_TERM = Cause(
    name="missing_term",
    title="Missing term",
    missing="",
    summary="a term of the library that the model lacks: linear, a product or modulus of speeds, or cubic damping",
    candidates=_candidates_missing_term,
    explain=_explain_missing_term,
)


def _candidates_parameters(situation: Situation) -> tuple[Candidate, ...]:
    """Single parameters, all of an equation, and all; not those alone whose change is another cause."""
    model = situation.ship.model
    named = {*own_advance_terms(model), *own_air_terms(model), *asymmetry_terms(model)}
    groups: list[tuple[str, ...]] = [(f"theta:{name}",) for name in model.names if name not in named]
    for equation in model.outputs:
        groups.append(tuple(f"theta:{term.name}" for term in model.terms if term.equation == equation))
    groups.append(tuple(f"theta:{name}" for name in model.names))
    return tuple(Candidate(cause="parameters", free=dict.fromkeys(group, 0.0)) for group in dict.fromkeys(groups))


def _explain_parameters(values: Values, _ship: ExtendedModel) -> str:
    changes = ", ".join(f"{key[6:]} by {rounded(value, std)}" for key, (value, std) in values.items())
    return f"The model structure explains the data with other parameter values. Changes: {changes}."


PARAMETERS = Cause(
    name="parameters",
    title="Parameter values",
    missing="the correct values of some parameters",
    summary="parameter values that are wrong by more than their stated standard deviations",
    candidates=_candidates_parameters,
    explain=_explain_parameters,
)
ROLL_MODES = 14
DAMPING = 0.08
INSIDE = 1.01
"""Of the shortest period that the data show and of the longest that the ship can have: a fit that ends there has found
no roll."""


def _candidates_roll_coupling(situation: Situation) -> tuple[Candidate, ...]:
    outputs = set(situation.ship.model.outputs)
    if situation.ship.has_found("roll:") or not {"v", "r"} <= outputs:
        return ()
    if situation.ship.has_roll:  # the vessel file has a mode, which may be another
        return (Candidate(cause="roll_coupling", free=dict.fromkeys(ROLL, 0.0)),)
    shortest, longest = 4.0 * situation.windows.sample_s, situation.ship.longest_roll_s / INSIDE
    if shortest > longest:
        return ()
    periods = np.geomspace(shortest, min(7.5 * shortest, longest), ROLL_MODES)
    return tuple(
        Candidate(
            cause="roll_coupling",
            free={"roll:sway": 0.0, "roll:yaw": 0.0},
            fixed={"roll:period": float(period), "roll:damping": DAMPING},
            above={"roll:period": INSIDE * situation.windows.shortest_period_s},
            below={"roll:period": longest},
        )
        for period in periods
    )


def _explain_roll_coupling(values: Values, _ship: ExtendedModel) -> str:
    period, std = values["roll:period"]
    return (
        f"Sway or yaw oscillates with a period of {rounded(period, std)} s, as roll can cause. Roll is not measured. "
        "Compare the period with the ship's roll period: waves or a steering loop can cause the same oscillation."
    )


ROLL_COUPLING = Cause(
    name="roll_coupling",
    title="Roll, or a similar oscillation",
    missing="an oscillation like roll",
    summary="roll that shows in sway and yaw: a lightly damped mode driven by the side acceleration",
    candidates=_candidates_roll_coupling,
    explain=_explain_roll_coupling,
    unseen="sway and yaw are not both in the model",
)


def _explain_unlisted_term(values: Values, ship: ExtendedModel) -> str:
    key, value, std = first(values)
    term = ship.library[key.split(":", 1)[1]]
    return (
        f"No cause of the catalogue matches. Of many products of motion and inputs, a term like {term.expression} in "
        f"{AXES[term.equation]} explains most, {rounded(value, std)}. Its form is a fit to these data, not physics: "
        "look for an effect of that form."
    )


UNLISTED_TERM = Cause(
    name="unlisted_term",
    title="Unlisted term",
    missing="",
    summary="a term that no cause of the catalogue is: found by regression on products of motion and inputs",
    candidates=lambda _situation: (),
    explain=_explain_unlisted_term,
)
