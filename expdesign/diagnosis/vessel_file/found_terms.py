"""The model of a vessel file with the findings: its terms, their parameters and standard deviations.

An effect that scales a term ends up in its parameter, and the effect's standard error beside that of the parameter as
if the two were independent. What is added becomes a term of its own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.model import (
    ExtendedModel,
    ahead_force_text,
    group_columns,
    is_coriolis,
    is_damping,
    is_thrust,
    reads_rudder,
)
from expdesign.diagnosis.vessel_file.shallow_water import in_shallow_water
from expdesign.vessel import Roll, Term, VesselModel
from expdesign.vessel.expressions import Expression

TURN = re.compile(r"\btau_psi\b")
FORCES = {"u": "X", "v": "Y", "r": "N"}
VISIBLE = 1e-4
"""Relative error of a written dependence on depth above which a note states it."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A term of the new model with its parameter and standard error."""

    term: Term
    value: float
    std: float


def found_model(
    model: VesselModel, ship: ExtendedModel, std: Mapping[str, float]
) -> tuple[VesselModel, tuple[str, ...]]:
    """The model with the effects of `ship`, and notes on it, one sentence each.

    Args:
        model: of the vessel file.
        ship: with effects found.
        std: standard errors of effects.
    """
    rows = [*_own(model, ship, std), *_added(ship, std)]
    rows = [_scaled(row, ship, std) for row in rows]
    if ship.get("asymmetry"):
        rows = _leaning(rows, model, ship, std.get("asymmetry", 0.0))
    notes = []
    if "change:time" in ship.effects:
        notes.append("The vessel file describes the ship after the change.")
    if ship.has_roll:
        notes.append(
            "The vessel file has the oscillation as [model.roll], and no [roll]: simulate, score, durations, indices "
            "and diagnose follow it; estimate and plans need a vessel file without that table, and say so."
        )
    found = replace(
        model,
        terms=tuple(row.term for row in rows),
        parameters=np.array([row.value for row in rows]),
        parameter_std=np.array([row.std for row in rows]),
        roll=_roll(model, ship),
    )
    found, depths = _in_depth(found, model, ship)
    return found, (*notes, *depths)


def _roll(model: VesselModel, ship: ExtendedModel) -> Roll | None:
    """The mode; what an angle of it means is as the file states it."""
    if ship.roll is None or model.roll is None:
        return ship.roll
    return replace(ship.roll, heel_rad_per_mps2=model.roll.heel_rad_per_mps2)


def _own(model: VesselModel, ship: ExtendedModel, std: Mapping[str, float]) -> list[Row]:
    """The model's own terms with their factors."""
    rows = []
    for term, expression, value, known in zip(
        model.terms, model.expressions, model.parameters.tolist(), model.parameter_std.tolist(), strict=True
    ):
        key = f"theta:{term.name}"
        factor, relative = _scale(_scaling(term, expression, ship), _inertia(term), ship, std)
        whole = factor * (value + ship.get(key))
        rows.append(Row(term=term, value=whole, std=math.hypot(factor * std.get(key, known), whole * relative)))
    return rows


def _scaled(row: Row, ship: ExtendedModel, std: Mapping[str, float]) -> Row:
    """A term that reads rudder angles, with their scale; its parameter is as uncertain as if it were linear in them."""
    text, relative = row.term.expression, 0.0
    for key, value in ship.effects.items():
        if not key.startswith("scale:"):
            continue
        names = [ship.model.inputs[column] for column in group_columns(key.split(":", 1)[1], ship.model.inputs)]
        changed = re.sub(rf"\b({'|'.join(names)})\b", rf"({1.0 + value:.9g}*\1)", text)
        relative += 0.0 if changed == text else std.get(key, 0.0) / (1.0 + value)
        text = changed
    if text == row.term.expression:
        return row
    return replace(row, term=replace(row.term, expression=text), std=math.hypot(row.std, row.value * relative))


def _added(ship: ExtendedModel, std: Mapping[str, float]) -> list[Row]:
    """Library terms that were found."""
    rows = []
    for key, value in ship.effects.items():
        if key.startswith("term:"):
            term = ship.library[key[5:]]
            factor, relative = _scale((), _inertia(term), ship, std)
            error = math.hypot(factor * std.get(key, 0.0), factor * value * relative)
            rows.append(Row(term=term, value=factor * value, std=error))
    return rows


def _scaling(term: Term, expression: Expression, ship: ExtendedModel) -> tuple[tuple[str, ...], ...]:
    """Effects whose sum, added to one, multiplies a term, for every factor that it has."""
    if is_thrust(expression, ship.model):
        factors: tuple[tuple[str, ...], ...] = (("gain",), ("change:gain",))
        return factors if reads_rudder(expression) else (*factors, ("gain:propeller",))
    if is_damping(term, expression, ship.model):
        return (("change:damping", f"change:damping_{term.equation}"),)
    return ()


def _inertia(term: Term) -> tuple[str, ...]:
    """The effect that, added to one, divides a term."""
    return () if is_coriolis(term) else (f"inertia:{term.equation}",)


def _scale(
    factors: tuple[tuple[str, ...], ...], divisor: tuple[str, ...], ship: ExtendedModel, std: Mapping[str, float]
) -> tuple[float, float]:
    """Factor of a term, and its relative standard error."""
    whole, variance = 1.0, 0.0
    for keys, power in [*((keys, 1) for keys in factors), (divisor, -1)]:
        factor = 1.0 + sum(ship.get(key) for key in keys)
        whole *= factor**power
        variance += sum(std.get(key, 0.0) ** 2 for key in keys) / factor**2
    return whole, math.sqrt(variance)


def _leaning(rows: list[Row], model: VesselModel, ship: ExtendedModel, error: float) -> list[Row]:
    """Ahead thrust that turns the ship, as the extended model has it: tau_psi is larger by so much tau_x.

    A term that is tau_psi gets one in tau_x beside it, others are rewritten. Where none reads tau_psi, the ahead force
    accelerates the yaw rate.
    """
    lean, result, beside = ship.get("asymmetry"), list[Row](), list[Row]()
    for row in rows:
        if row.term.expression.replace(" ", "") == "tau_psi":
            term = Term(row.term.equation, f"{FORCES[row.term.equation]}_tau_x", "tau_x")
            beside.append(Row(term=term, value=lean * row.value, std=math.hypot(lean * row.std, error * row.value)))
            result.append(row)
        else:
            changed = TURN.sub(f"(tau_psi + {lean:.9g}*tau_x)", row.term.expression)
            result.append(replace(row, term=replace(row.term, expression=changed)))
    if not beside and result == rows:
        factor = model.time_scale_s / (1.0 + ship.get("inertia:r"))
        term = Term("r", "N_thrust", ahead_force_text(model))
        beside.append(Row(term=term, value=lean * factor, std=error * abs(factor)))
    for row in beside:
        result = _with(row, result)
    return result


def _with(more: Row, rows: list[Row]) -> list[Row]:
    """Rows and one more, added to that which is the same term if there is one."""
    same = [row.term.equation == more.term.equation and row.term.expression == more.term.expression for row in rows]
    if any(same):
        index = same.index(True)
        old = rows[index]
        merged = replace(old, value=old.value + more.value, std=math.hypot(old.std, more.std))
        return [*rows[:index], merged, *rows[index + 1 :]]
    names, name = {row.term.name for row in rows}, more.term.name
    return [*rows, replace(more, term=replace(more.term, name=f"{name}_found" if name in names else name))]


def _in_depth(found: VesselModel, known: VesselModel, ship: ExtendedModel) -> tuple[VesselModel, tuple[str, ...]]:
    """The model with the dependence on depth that was found, and how far it holds."""
    growth = {key.split(":")[1]: value for key, value in ship.effects.items() if key.startswith("shallow:")}
    if not growth:
        return found, ()
    deeper, error = in_shallow_water(found, growth, reach=ship.max_draught_over_depth, known=known)
    note = (
        f"The dependence on depth holds for draught over depth up to {ship.max_draught_over_depth:.2f}, the largest in "
        "the data."
    )
    rough = f" Its factors are polynomials with an error of at most {100 * error:.1g} %." if error > VISIBLE else ""
    return deeper, (note + rough,)
