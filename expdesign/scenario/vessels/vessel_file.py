"""Vessel files: particulars, actuators, model and sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.errors import InputError
from expdesign.scenario.tables import Entry, check_table, offer, read_toml, shown
from expdesign.scenario.vessels.pendulum_table import build_pendulum, check_names, checked_correlation
from expdesign.scenario.vessels.vessel_tables import (
    ACTUATOR_TABLES,
    SAME_AS,
    ActuatorTable,
    ModelTable,
    ParticularsTable,
    TermTable,
    VesselTable,
    build_environment,
)
from expdesign.vessel import (
    CALM,
    KINDS,
    STRUCTURES,
    Actuator,
    Inertia,
    Limit,
    Missed,
    Response,
    Roll,
    RollPendulum,
    Sensors,
    Term,
    Vessel,
    VesselModel,
    limit_keys,
    response_keys,
    response_values,
    std_keys,
    structure_terms,
)
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS, parse_expression

CORRELATION_ROUNDING = 1e-6  # negative eigenvalue that rounded correlations may have


def load_vessel(path: Path | str) -> Vessel:
    """Read a vessel file.

    Args:
        path: a TOML file with `[vessel]`, `[[actuators]]`, `[model]` and optionally `[sensors]` and `[environment]`.

    Raises:
        FileError: unreadable, or something in it is wrong, missing or unknown.
    """
    entry = Entry(Path(path))
    return vessel_of(read_toml(entry.path), entry)


def vessel_of(tables: Mapping[str, Any], entry: Entry) -> Vessel:
    """The vessel of the tables of a vessel file; errors as of `load_vessel`."""
    file = check_table(VesselTable, tables, entry)
    actuators = _actuators(file.actuators, file.vessel, entry.at("actuators"))
    model = _model(file.model, actuators, file.vessel.sample_time_s, entry.at("model"))
    return Vessel(
        **file.vessel.model_dump(),
        model=model,
        sensors=Sensors(**file.sensors.model_dump()),
        environment=CALM if file.environment is None else build_environment(file.environment),
        pendulum=_pendulum(file, model, entry),
        std=_std(file.std, actuators, entry.at("std")),
    )


def _pendulum(file: VesselTable, model: VesselModel, entry: Entry) -> RollPendulum | None:
    if file.roll is None:
        return None
    if model.roll is not None:
        raise entry.at("roll").error("is given beside [model.roll], expected one of them")
    if "v" not in model.outputs:
        raise entry.at("roll").error("needs terms of v, whose acceleration drives it")
    return build_pendulum(file.roll, entry.at("roll"))


def _std(given: Mapping[str, float], actuators: Sequence[Actuator], entry: Entry) -> dict[str, float]:
    known = std_keys(actuators)
    for name in given:
        if name not in known:
            raise entry.error(f"{shown(name)} is no quantity of a sensor or an actuator, {offer(name, known)}")
        if name.endswith("_rate") and not math.isfinite(response_values(actuators)[name]):
            raise entry.at(name).error("is given without a rate, expected the rate in the table of its actuator")
    return dict(given)


def _actuators(rows: list[dict[str, Any]], ship: ParticularsTable, entry: Entry) -> tuple[Actuator, ...]:
    """Actuators numbered in file order; all kinds with a propeller share one count, so that signal names differ."""
    actuators: list[Actuator] = []
    for index, row in enumerate(rows, start=1):
        table = _actuator_table(row, entry.item(index))
        _check_place(table, ship, entry.item(index))
        kind = SAME_AS.get(table.kind, table.kind)
        number = 1 + sum(KINDS[other.kind][0] == KINDS[kind][0] for other in actuators)
        limits = tuple(_limit(table, limit_keys(stem), entry.item(index)) for stem in KINDS[kind])
        actuators.append(
            Actuator(
                kind=kind,
                number=number,
                forward_m=table.forward_m,
                starboard_m=table.starboard_m,
                limits=limits,
                responses=tuple(_response(table, stem) for stem in KINDS[kind]),
            )
        )
    _check_force_alone([actuator.kind for actuator in actuators], entry)
    return tuple(actuators)


def _actuator_table(row: Mapping[str, Any], entry: Entry) -> ActuatorTable:
    kind = row.get("kind")
    if not isinstance(kind, str):
        found = "is missing" if kind is None else f"is {shown(kind)}"
        raise entry.at("kind").error(f"{found}, expected one of {', '.join(ACTUATOR_TABLES)}")
    if kind not in ACTUATOR_TABLES:
        raise entry.at("kind").unknown(kind, ACTUATOR_TABLES)
    return check_table(ACTUATOR_TABLES[kind], row, entry)


def _check_place(table: ActuatorTable, ship: ParticularsTable, entry: Entry) -> None:
    for name, reach in (("forward_m", ship.length_m), ("starboard_m", ship.beam_m)):
        place = getattr(table, name)
        if abs(place) > reach:
            allowed = f"{-reach:g} to {reach:g}, counted from amidships"
            raise entry.at(name).error(f"is {shown(place)}, expected {allowed}")


def _check_force_alone(kinds: list[str], entry: Entry) -> None:
    """Generalised forces are the sum over all thrusters: no other thruster is allowed."""
    if "force" in kinds and sum(kind != "rudder" for kind in kinds) > 1:
        raise entry.item(kinds.index("force") + 1).at("kind").error("is 'force', expected no other thruster")


def _limit(table: ActuatorTable, keys: tuple[str, str], entry: Entry) -> Limit:
    low, high = (getattr(table, name) for name in keys)
    if low is not None and high is not None and not low < high:
        raise entry.at(keys[1]).error(f"is {shown(high)}, expected more than {keys[0]} = {shown(low)}")
    return Limit(low=-math.inf if low is None else low, high=math.inf if high is None else high)


def _response(table: ActuatorTable, stem: str) -> Response:
    given = {name: getattr(table, key, None) for name, key in response_keys(stem).items()}
    return Response(**{name: value for name, value in given.items() if value is not None})


def _model(table: ModelTable, actuators: tuple[Actuator, ...], sample_time_s: float, entry: Entry) -> VesselModel:
    if table.structure not in (*STRUCTURES, "custom"):
        raise entry.at("structure").unknown(table.structure, (*STRUCTURES, "custom"))
    _check_terms(table.terms, actuators, entry.at("terms"))
    try:
        terms = structure_terms(table.structure, tuple(Term(t.equation, t.name, t.expression) for t in table.terms))
    except InputError as error:
        raise entry.at("terms").error(str(error)) from None
    names = [term.name for term in terms]
    check_names(table.parameters, names, entry.at("parameters"))
    check_names(table.parameter_std, names, entry.at("parameter_std"))
    missing = [name for name in names if name not in table.parameters]
    if missing:
        found = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        raise entry.at("parameters").error(f"{found}, expected every parameter of structure {table.structure!r}")
    if table.roll is not None and not {"v", "r"} <= {term.equation for term in terms}:
        raise entry.at("roll").error("needs terms of v and r, which roll acts on")
    if table.inertia is not None and not {"v", "r"} <= {term.equation for term in terms}:
        raise entry.at("inertia").error("needs terms of v and r, which it couples")
    model = VesselModel(
        terms=terms,
        parameters=np.array([table.parameters[name] for name in names]),
        parameter_std=np.array([table.parameter_std.get(name, 0.0) for name in names]),
        unstated_std={
            name: table.parameter_std_unstated * abs(value)
            for name, value in table.parameters.items()
            if name not in table.parameter_std and table.parameter_std_unstated * value
        },
        speeds_mps=None if table.speeds_mps is None else (table.speeds_mps[0], table.speeds_mps[1]),
        missed=None if table.missed is None else Missed(**table.missed.model_dump()),
        form=table.form,
        sample_time_s=sample_time_s,
        actuators=actuators,
        roll=None if table.roll is None else Roll(**table.roll.model_dump()),
        inertia=_inertia(table, entry.at("inertia")),
        parameter_correlation=checked_correlation(
            table.parameter_correlation, names, entry.at("parameter_correlation")
        ),
        parameter_range=_range(table, names, entry),
    )
    if np.linalg.eigvalsh(model.parameter_correlation_matrix)[0] < -CORRELATION_ROUNDING:
        raise entry.at("parameter_correlation").error("contradicts itself: no parameters have such correlations")
    return model


def _inertia(table: ModelTable, entry: Entry) -> Inertia | None:
    try:
        return None if table.inertia is None else Inertia(**table.inertia.model_dump())
    except InputError as error:
        raise entry.error(f"has no inverse: {error}") from None


def _range(table: ModelTable, names: list[str], entry: Entry) -> dict[str, tuple[float, float]]:
    """Least and most value of the parameters that have one."""
    least, most = table.parameter_min, table.parameter_max
    check_names(least, names, entry.at("parameter_min"))
    check_names(most, names, entry.at("parameter_max"))
    found = {name: (least.get(name, -math.inf), most.get(name, math.inf)) for name in {**least, **most}}
    for name, (low, high) in found.items():
        if not low < high:
            raise entry.at("parameter_max").at(name).error(f"is {high:g}, expected more than parameter_min = {low:g}")
        value, std = table.parameters[name], table.parameter_std.get(name, 0.0)
        if not std and not low <= value <= high:
            raise entry.at("parameters").at(name).error(f"is {value:g}, known, expected {low:g} to {high:g} as stated")
    return found


def _check_terms(terms: list[TermTable], actuators: tuple[Actuator, ...], entry: Entry) -> None:
    inputs = (name for actuator in actuators for name in actuator.signals)
    signals = tuple(dict.fromkeys((*MOTION_SIGNALS, *FORCE_SIGNALS, *inputs)))
    seen: dict[str, int] = {}
    for index, term in enumerate(terms, start=1):
        if term.name in seen:
            found = f"is {shown(term.name)}, expected another name than that of term {seen[term.name]}"
            raise entry.item(index).at("name").error(found)
        seen[term.name] = index
        try:
            parse_expression(term.expression, signals=signals)
        except InputError as error:
            raise entry.item(index).at("expression").error(str(error)) from None
