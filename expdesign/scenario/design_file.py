"""The `[design]` table of a scenario: criterion, robustness, prior information, limits, numbers of runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from expdesign.durations import Budget, Constraints
from expdesign.errors import FileError, nearest
from expdesign.indices import OUTCOMES
from expdesign.input_files import read_text
from expdesign.scenario.design_tables import LONGEST_TOTAL_S, AccuracyTable, BudgetTable, DesignTable, build_grow
from expdesign.scenario.tables import Entry, same_keys, shown
from expdesign.scenario.values import DesignSettings
from expdesign.shortest_day import AccuracySettings
from expdesign.vessel import Vessel

EXPECTED = "a durations.json as expdesign durations and expdesign run write it"


def load_repeats(path: Path | str, *, names: Sequence[str]) -> tuple[int, ...]:
    """Whole runs of each named primitive; those the file leaves out are not run.

    Raises:
        FileError: the file is missing or not of that kind, or names an unknown primitive.
    """
    text = read_text(Path(path), EXPECTED)
    try:
        entries = json.loads(text)["primitives"]
        repeats = {entry["name"]: entry["repeats"] for entry in entries}
    except (ValueError, KeyError, TypeError, RecursionError):
        raise FileError(path, "primitives", f"expected {EXPECTED}: a list of {{name, repeats, ...}}") from None
    if len(repeats) < len(entries):
        raise FileError(path, "primitives", "names a primitive twice")
    for name, count in repeats.items():
        if name not in names:
            near = nearest(str(name), names)
            hint = f", did you mean {near!r}?" if near else f"; it has {', '.join(names)}"
            raise FileError(path, "primitives.name", f"{name!r} is not in the scenario's dictionary{hint}")
        if not isinstance(count, int) or isinstance(count, bool) or count < 0:
            raise FileError(path, f"primitives.{name}.repeats", f"is {count!r}, expected a whole number of 0 or more")
    if not sum(repeats.values()):
        raise FileError(path, "primitives", "has no run, expected at least one repeat")
    return tuple(repeats.get(name, 0) for name in names)


def design_settings(table: DesignTable, vessel: Vessel, primitives: tuple[str, ...], entry: Entry) -> DesignSettings:
    """The checked settings.

    Args:
        entry: the table's place, for messages.

    Raises:
        FileError: a name is unknown or given twice, or keys contradict each other.
    """
    names = vessel.model.names
    _check_fixed(table, names, entry)
    if table.total_s < vessel.sample_time_s:
        least = f"at least the vessel's sample_time_s = {vessel.sample_time_s:g}"
        raise entry.at("total_s").error(f"is {shown(table.total_s)}, expected {least}")
    if table.total_s > LONGEST_TOTAL_S:
        most = f"at most {LONGEST_TOTAL_S:.0f}, eleven days"
        raise entry.at("total_s").error(f"is {shown(table.total_s)}, expected {most}")
    estimated = tuple(name for name in names if name not in table.fixed_parameters)
    _check_list(table.interest, estimated, entry.at("interest"))
    _check_keys(table.parameter_units, estimated, entry.at("parameter_units"))
    _check_list(table.outcomes, OUTCOMES, entry.at("outcomes"))
    _check_keys(table.outcome_units, table.outcomes, entry.at("outcome_units"), of="design.outcomes")
    for key in ("least_s", "most_s"):
        _check_keys(getattr(table, key), primitives, entry.at(key))
    for key in ("required", "excluded"):
        _check_list(getattr(table, key), primitives, entry.at(key))
    _check_together(table, vessel, entry)
    _check_causes(table, vessel, entry)
    own = {
        "prior_samples": (table.prior_samples or 20) if table.robust != "nominal" else 0,
        "prior_data": named_files(table.prior_data, entry.at("prior_data")),
        "limits": Constraints(
            **same_keys(table, Constraints) | {"budgets": _budgets(table.budgets, primitives, entry.at("budgets"))}
        ),
        "tell_apart": tuple((one, other) for one, other in table.tell_apart),
        "grow": None if table.grow is None else build_grow(table.grow, entry.at("grow")),
        "accuracy": _asked(table, vessel, estimated, entry),
    }
    return DesignSettings(**same_keys(table, DesignSettings) | own)


def _asked(table: DesignTable, vessel: Vessel, estimated: tuple[str, ...], entry: Entry) -> AccuracySettings | None:
    """What is asked of a day, if anything is."""
    if table.day_s is not None:
        if table.accuracy is not None:
            raise entry.at("day_s").error("is given beside [design.accuracy], expected one of them")
        if not 2 * vessel.sample_time_s <= table.day_s <= LONGEST_TOTAL_S:
            least = f"{2 * vessel.sample_time_s:g}, two samples, to {LONGEST_TOTAL_S:.0f}, eleven days"
            raise entry.at("day_s").error(f"is {shown(table.day_s)}, expected {least}")
        return AccuracySettings(as_durations=True, day_s=table.day_s)
    if table.accuracy is None:
        return None
    return _accuracy(table.accuracy, vessel, estimated, table.outcome_speed_mps, entry.at("accuracy"))


def _accuracy(
    table: AccuracyTable, vessel: Vessel, estimated: tuple[str, ...], speed_mps: float | None, entry: Entry
) -> AccuracySettings:
    _check_keys(table.std, estimated, entry.at("std"))
    _check_keys(table.relative_std, estimated, entry.at("relative_std"))
    _check_keys(table.outcomes_95, OUTCOMES, entry.at("outcomes_95"))
    if not (table.as_ or table.std or table.relative_std or table.outcomes_95):
        raise entry.error("is empty, expected as = 'durations', std, relative_std or outcomes_95")
    if table.starts > 1 and not table.grow:
        raise entry.at("starts").error(f"is {table.starts} without a search for manoeuvres, expected 1 or grow = true")
    nominal = dict(zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True))
    for name in table.relative_std:
        if name in table.std:
            raise entry.at("relative_std").error(f"names {name!r}, which std names too; expected it once")
        if nominal[name] == 0:
            raise entry.at("relative_std").error(f"names {name!r}, whose nominal value is 0; expected it in std")
    own = {"as_durations": table.as_ is not None, "outcome_speed_mps": speed_mps}
    return AccuracySettings(**same_keys(table, AccuracySettings) | own)


def _check_fixed(table: DesignTable, names: tuple[str, ...], entry: Entry) -> None:
    _check_list(table.fixed_parameters, names, entry.at("fixed_parameters"))
    if len(table.fixed_parameters) == len(names):
        raise entry.at("fixed_parameters").error("names every parameter, expected at least one to be estimated")


def _check_list(given: list[str], known: Iterable[str], entry: Entry) -> None:
    allowed = tuple(known)
    for index, name in enumerate(given, start=1):
        place = entry.item(index)
        if name not in allowed:
            raise place.unknown(name, allowed)
        if name in given[: index - 1]:
            raise place.error(f"is {name!r} again, expected every name once")


def _check_causes(table: DesignTable, vessel: Vessel, entry: Entry) -> None:
    if not (table.reveal or table.tell_apart or table.reveal_sizes):
        return
    from expdesign.foresight import causes_by_runs  # what asks for no cause does not wait for the diagnosis

    known = causes_by_runs(vessel.model)
    _check_list(table.reveal, known, entry.at("reveal"))
    for index, pair in enumerate(table.tell_apart, start=1):
        place = entry.at("tell_apart").item(index)
        if len(pair) != 2:
            raise place.error(f"has {len(pair)} names, expected two causes")
        _check_list(pair, known, place)
    _check_keys(table.reveal_sizes, [*table.reveal, *(name for pair in table.tell_apart for name in pair)],
                entry.at("reveal_sizes"), of="design.reveal and design.tell_apart")  # fmt: skip


def _check_keys(given: Mapping[str, float], known: Iterable[str], entry: Entry, *, of: str = "") -> None:
    """`of`: the keys that the names come from, where these may be empty."""
    allowed = tuple(known)
    if given and not allowed and of:
        raise entry.error(f"has no effect while {of} {'are' if ' and ' in of else 'is'} empty")
    for name in given:
        if name not in allowed:
            raise entry.unknown(name, allowed)


def _check_together(table: DesignTable, vessel: Vessel, entry: Entry) -> None:
    """Keys that need other keys."""
    if table.criterion == "D_s" and not table.interest and table.predictor == "model":
        raise entry.at("interest").error("is missing, criterion D_s needs the parameters of interest")
    if table.criterion == "V" and not table.outcomes:
        raise entry.at("outcomes").error(f"is missing, criterion V needs one or more of {', '.join(OUTCOMES)}")
    if table.criterion == "T" and not (table.reveal or table.tell_apart):
        raise entry.at("criterion").error("is 'T', which needs causes in design.reveal or design.tell_apart")
    if table.prior_samples is not None and table.robust == "nominal":
        raise entry.at("prior_samples").error("has no effect while design.robust is 'nominal'")
    uses_std = {"robust": table.robust != "nominal", "prior": table.prior != "none",
                "relative_to": table.relative_to != "nominal"}  # fmt: skip
    if any(uses_std.values()) and not np.any(vessel.model.parameter_std):
        key = next(key for key, used in uses_std.items() if used)
        raise entry.at(key).error("needs standard deviations in the vessel's [model.parameter_std], found none")
    if table.predictor != "model" and (table.robust != "nominal" or table.prior_data):
        raise entry.at("predictor").error("with nuisance regressors excludes design.robust and prior_data")
    if table.excitation != "free":
        others = {
            "predictor": table.predictor != "model",
            "robust": table.robust != "nominal",
            "prior_data": bool(table.prior_data),
            "grow": table.grow is not None,
            "accuracy": table.accuracy is not None,
            "day_s": table.day_s is not None,
        }
        if any(others.values()):
            key = next(key for key, used in others.items() if used)
            raise entry.at("excitation").error(f"is {table.excitation!r}, which excludes design.{key}")
    for name in table.required:
        if name in table.excluded:
            raise entry.at("excluded").error(f"names {name!r}, which design.required names too")


def _budgets(tables: list[BudgetTable], primitives: tuple[str, ...], entry: Entry) -> tuple[Budget, ...]:
    for index, table in enumerate(tables, start=1):
        if table.name in [other.name for other in tables[: index - 1]]:
            raise entry.item(index).at("name").error(f"is {table.name!r} again, expected a name not used before")
    return tuple(_budget(table, primitives, entry.item(index)) for index, table in enumerate(tables, start=1))


def _budget(table: BudgetTable, primitives: tuple[str, ...], entry: Entry) -> Budget:
    _check_keys(table.cost_per_s, primitives, entry.at("cost_per_s"))
    if bool(table.cost_per_s) == bool(table.use):
        raise entry.error("needs either cost_per_s by primitive or use = 'cubed_propeller_speed'")
    return Budget(name=table.name, limit=table.limit, cost_per_s=dict(table.cost_per_s))


def named_files(given: list[str], entry: Entry) -> tuple[Path, ...]:
    """The files that a list of an entry names.

    Raises:
        FileError: one does not exist.
    """
    return tuple(entry.item(index).file(name) for index, name in enumerate(given, start=1))
