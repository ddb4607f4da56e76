"""From a vessel to a model with effects, and back: everything found becomes part of a vessel file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from expdesign.diagnosis.model import (
    LEAST_EFFECT,
    RESPONSES,
    ExtendedModel,
    ahead_force_text,
    group_columns,
    is_coriolis,
    is_damping,
    is_thrust,
    mean_wind,
    reads_rudder,
    response_effect,
)
from expdesign.diagnosis.vessel_file.reading import found_std, with_std
from expdesign.values import Array
from expdesign.vessel import Actuator, Response, Roll, Sensors, Term, Vessel, VesselModel, response_values, std_keys
from expdesign.vessel.quantities import NOT_NEGATIVE, rows_of
from expdesign.vessel.structures import SHOAL, Expression

# Dependence on depth as factors of a model's terms.
#
# The growth becomes a factor of the terms: a term ``u`` turns into ``(u)*(1 + 0.8*h)``, where the signal `h` is draught
# over depth. Parameters keep their names and their values, which are those of deep water. Inertia divides, which the
# language of terms cannot express. So its factor 1 / (1 + b h) is written as a polynomial of third order, exact in deep
# water and nearly exact down to the least depth in the data. A dependence on depth that the model already has counts as
# known, and the growth that is found multiplies it.

DAMPING, INERTIA = "damping", "inertia"
ORDER = 3
WRITTEN = re.compile(rf"\((.+)\)\*\(1((?: \+ [-+.e\d]+(?:\*{SHOAL})+)+)\)")
POWER = re.compile(rf" \+ ([-+.e\d]+)((?:\*{SHOAL})+)")
"""A term times a factor as it is written here, and one power in that factor."""


def in_shallow_water(
    model: VesselModel, growth: Mapping[str, float], *, reach: float, known: VesselModel
) -> tuple[VesselModel, float]:
    """The model with more dependence on depth, and the largest relative error of its factors.

    Args:
        model: with the terms that were found.
        growth: "damping" and "inertia" per unit of draught over depth; zero by default.
        reach: largest draught over depth in the data.
        known: the model diagnosed, without the terms that were found; only its own terms are damping that grows.
    """
    damping = Polynomial([1.0, growth.get(DAMPING, 0.0)])
    lighter, error = _inverse(growth.get(INERTIA, 0.0), reach)
    terms = []
    for term, expression in zip(model.terms, model.expressions, strict=True):
        grows = term.name in known.names and is_damping(term, expression, known)
        factor = lighter * damping if grows else lighter
        terms.append(term if is_coriolis(term) else _times(term, factor))
    return replace(model, terms=tuple(terms)), error


def _inverse(growth: float, reach: float) -> tuple[Polynomial, float]:
    """1 / (1 + growth h) for h from 0 to reach as a polynomial, exact at 0, and its largest relative error."""
    if growth == 0.0 or reach <= 0.0:
        return Polynomial([1.0]), 0.0

    def exact(h: Array) -> Array:
        return np.asarray(1.0 / (1.0 + growth * h))

    h = np.linspace(0.0, reach, 200)[1:]
    slopes = np.linalg.lstsq(h[:, None] ** np.arange(1, ORDER + 1), exact(h) - 1.0, rcond=None)[0]
    found = Polynomial([1.0, *slopes])
    return found, float(np.abs(found(h) / exact(h) - 1.0).max())


def _times(term: Term, factor: Polynomial) -> Term:
    """The term times a polynomial of draught over depth; a factor that it has already is multiplied."""
    plain, known = _taken_apart(term.expression)
    powers = [
        "*".join([f"{value:.9g}", *([SHOAL] * order)])
        for order, value in enumerate((known * factor).coef.tolist())
        if value
    ]
    text = plain if len(powers) == 1 else f"({plain})*({' + '.join(powers)})"
    return replace(term, expression=text)


def _taken_apart(expression: str) -> tuple[str, Polynomial]:
    """An expression without its factor as written here, and that factor; one where there is none."""
    written = WRITTEN.fullmatch(expression)
    if not written:
        return expression, Polynomial([1.0])
    powers = {len(match[2]) // (1 + len(SHOAL)): float(match[1]) for match in POWER.finditer(written[2])}
    return written[1], Polynomial([1.0, *(powers.get(order, 0.0) for order in range(1, max(powers) + 1))])


# The model of a vessel file with the findings: its terms, their parameters and standard deviations.
#
# An effect that scales a term ends up in its parameter, and the effect's standard error beside that of the parameter as
# if the two were independent. What is added becomes a term of its own.

TURN = re.compile(r"\btau_psi\b")
FORCES = {"u": "X", "v": "Y", "r": "N"}
TINY = 1e-300
VISIBLE = 1e-4  # relative error of a written dependence on depth above which a note states it


@dataclass(frozen=True, kw_only=True)
class Row:
    """A term of the new model with its parameter and standard error."""

    term: Term
    value: float
    std: float


def found_model(
    model: VesselModel, ship: ExtendedModel, std: Mapping[str, float]
) -> tuple[VesselModel, tuple[str, ...]]:
    """The model with the effects of `ship`, and notes on it, one sentence each."""
    rows = [*_own(model, ship, std), *_added(ship, std)]
    if ship.get("asymmetry"):
        rows = _leaning(rows, model, ship, std.get("asymmetry", 0.0))
    rows = [_scaled(row, ship, std) for row in rows]
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
    ).with_kept_ranges()
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
    """A term that reads scaled inputs or their force; its parameter is as uncertain as if it were linear in them."""
    text, relative = row.term.expression, 0.0
    for key, value in ship.effects.items():
        if not key.startswith("scale:"):
            continue
        names = [ship.model.inputs[column] for column in group_columns(key.split(":", 1)[1], ship.model.inputs)]
        changed = re.sub(rf"\b({'|'.join(names)})\b", rf"({1.0 + value:.9g}*\1)", text)
        for force, own in _own_force(ship, names).items():
            changed = re.sub(rf"\b{force}\b", f"({force} + {value:.9g}*({own}))", changed)
        error = std.get(key, 0.0)
        relative += 0.0 if changed == text else error / max(abs(1.0 + value), error, TINY)
        text = changed
    if text == row.term.expression:
        return row
    return replace(row, term=replace(row.term, expression=text), std=math.hypot(row.std, row.value * relative))


def _own_force(ship: ExtendedModel, names: Sequence[str]) -> dict[str, str]:
    """What engines with these speeds add to the forces, as terms read it: the texts of `Actuator.force`."""
    parts: dict[str, list[str]] = {"tau_x": [], "tau_y": [], "tau_psi": []}
    for one in ship.model.actuators:
        if one.kind in ("force", "rudder", "depth") or one.signals[0] not in names:
            continue
        speed, *angle = one.signals
        ahead = f"{speed}*cos({angle[0]})" if angle else speed if one.kind == "propeller" else "0"
        side = f"{speed}*sin({angle[0]})" if angle else speed if one.kind == "tunnel" else "0"
        parts["tau_x"].append(ahead)
        parts["tau_y"].append(side)
        parts["tau_psi"].append(f"{one.forward_m:.9g}*{side} - {one.starboard_m:.9g}*{ahead}")
    return {force: " + ".join(texts) for force, texts in parts.items() if texts}


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


def extend(
    vessel: Vessel,
    ship: ExtendedModel,
    std: Mapping[str, float],
    estimated: tuple[Sequence[str], Array] = ((), np.zeros((0, 0))),
) -> tuple[Vessel, tuple[str, ...]]:
    """The vessel with the effects of `ship`, and notes on those that it cannot hold, one sentence each.

    Args:
        estimated: effects, and the covariance (c, c) of their estimates.
    """
    model, missing = found_model(vessel.model, ship, std)
    model = _correlated(model, *estimated)
    actuators, more = _actuators(model.actuators, ship)
    if "u" not in ship.derived and ship.get("late:u") != ship.get("late:v"):
        more = (*more, "The delay of u or v alone is written as one of the whole velocity sensor.")
    early = (key.startswith("late:") and value < 0 for key, value in ship.effects.items())
    if any(early) or any(key.startswith("lead:") for key in ship.effects):
        more = (
            *more,
            "The vessel file leaves out a delay below zero, and its simulation gains nothing by that finding.",
        )
    weather = vessel.environment
    if _has(ship, "current:"):
        weather = replace(weather, current_to=np.array([ship.get("current:north"), ship.get("current:east")]))
    if _has(ship, "wind:"):
        weather = replace(weather, wind_to=np.array(mean_wind(ship)))
    weather = with_std(weather, std)
    return (
        replace(
            vessel,
            model=replace(model, actuators=actuators),
            sensors=_sensors(vessel.sensors, ship),
            environment=weather,
            pendulum=None if model.roll is not None else vessel.pendulum,
            std=found_std(vessel, ship, std, _may_be_unsure(actuators)),
        ),
        (*missing, *more),
    )


def _may_be_unsure(actuators: tuple[Actuator, ...]) -> tuple[str, ...]:
    """Keys of `Vessel.std`, without those of slew rates that have no limit."""
    values = response_values(actuators)
    return tuple(name for name in std_keys(actuators) if math.isfinite(values.get(name, 0.0)))


def _correlated(model: VesselModel, keys: Sequence[str], covariance: Array) -> VesselModel:
    """The model with the correlations of what was estimated in place of its prior ones; its stds stay."""
    places = [place for place, key in enumerate(keys) if key.startswith(("theta:", "term:"))]
    if not places:
        return model
    names = [keys[place].split(":", 1)[1] for place in places]
    found = model.with_covariance(names, covariance[np.ix_(places, places)]).parameter_correlation
    return replace(model, parameter_correlation=found)


def _has(ship: ExtendedModel, prefix: str) -> bool:
    return any(key.startswith(prefix) for key in ship.effects)


def _actuators(actuators: tuple[Actuator, ...], ship: ExtendedModel) -> tuple[tuple[Actuator, ...], tuple[str, ...]]:
    own = tuple(name for actuator in actuators for name in actuator.signals)
    recorded = ship.model.inputs
    changes: dict[str, dict[str, float]] = {}
    lost = []
    for key in dict.fromkeys((*ship.stated, *ship.effects)):
        kind, _, group = key.partition(":")
        if kind not in RESPONSES:
            continue
        for index in group_columns(group, recorded):
            if recorded[index] in own:
                row = changes.setdefault(recorded[index], {})
                row[kind] = row.get(kind, 0.0) + ship.get(key)
            else:
                lost.append(
                    f"{kind} of {recorded[index]} is not in the vessel file, whose actuators take other signals."
                )
    result = []
    for actuator in actuators:
        responses = tuple(
            _changed(response, changes.get(signal, {}))
            for signal, response in zip(actuator.signals, actuator.responses, strict=True)
        )
        result.append(replace(actuator, responses=responses))
    return tuple(result), tuple(dict.fromkeys(lost))


def _changed(response: Response, effects: Mapping[str, float]) -> Response:
    """A response with other effects; those that played no role in the data stay as they are stated."""
    found = {kind: value if abs(value) > LEAST_EFFECT else 0.0 for kind, value in effects.items()}
    return replace(response, **{RESPONSES[kind]: response_effect(kind, value) for kind, value in found.items()})


def _sensors(sensors: Sensors, ship: ExtendedModel) -> Sensors:
    """The sensors with the effects that the data show; no sensor shows what is yet to come."""
    found: dict[str, Any] = {}
    for row in rows_of(Sensors):
        if row.effects and row.is_shown(ship.derived):
            value = row.neutral + row.sign * max(map(ship.get, row.effects))
            found[row.key] = max(0.0, value) if row.takes == NOT_NEGATIVE else value
    return replace(sensors, **found)
