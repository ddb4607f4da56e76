"""`expdesign diagnose`: causes of the simulation error on measured data."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign import requests
from expdesign.diagnosis import Proposal
from expdesign.diagnosis import diagnose as diagnose_record
from expdesign.diagnosis.vessel_file import std_keys_of
from expdesign.dictionary import build_dictionary
from expdesign.errors import FileError, InputError, NotInformative
from expdesign.estimation.regression import model_for
from expdesign.export.diagnosis_page import diagnosis_document
from expdesign.export.diagnosis_results import diagnosis_json, extended_vessel
from expdesign.export.folder import Content
from expdesign.export.roll_changes import RollVerdict
from expdesign.kinematics import in_stated_time
from expdesign.progress import Estimated, Progress, silent
from expdesign.requests import repeating
from expdesign.roll.record import judge_roll, missing_columns, roll_run, with_one_source
from expdesign.scenario import load_scenario
from expdesign.signals import Commands, Record
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, VesselModel, direct_terms, generalised_force
from expdesign.vessel.structures import FORCE_SIGNALS, SHOAL
from expdesign.workflows.outcome import Outcome, finished, results_folder, shared, workflow
from expdesign.workflows.steps.measured import doubted, equipped, measured

SINCE_CHANGE = "since-change.csv"  # file that a watch leaves for a diagnosis
WITHOUT_SHIP = "yaw"
"""Of changes that a watch by a yaw model names, which are none of the vessel file's model."""
MOST_PAGE_WORK, PAGE_SAMPLES = 270.0, 375.0
"""Simulations of few data that take as long as drawing the page, and the samples from which on they take longer."""


@workflow
def diagnose(request: requests.Diagnose, *, progress: Progress = silent) -> Outcome:
    """Causes of the simulation error and the gain from adding them, into `out` or runs/<first data file>."""
    folder = results_folder(request, request.data[0].stem)
    progress("reading the data", 0.0)
    ship, told = equipped(request.vessel, request.data)
    ship, named = with_alarms(ship, request.data)
    record = in_stated_time(measured(request.data, ship, velocity=request.velocity, told=told), ship.sensors)
    proposals = _proposals(request.scenario, model_for(ship.model, record)) if request.scenario else ()
    samples = sum(len(batch.inputs) for batch in record.batches)
    drawing = MOST_PAGE_WORK / (1.0 + samples / PAGE_SAMPLES)
    reported = Estimated(progress, after=drawing)
    with shared(request, load=None), doubted(record):
        found = diagnose_record(
            ship, record, seed=request.seed, proposals=proposals, suspected=named, progress=reported
        )
    reported.after = 0.0
    roll = _roll(ship, record)
    files: dict[str, Content] = {
        "diagnosis.json": diagnosis_json(found, roll),
        "vessel-extended.toml": extended_vessel(found, command=repeating(request), roll=roll),
    }
    return finished(
        request,
        folder,
        files,
        diagnosis_document(found, roll),
        progress,
        page="diagnosis.html",
        drawing=reported.part(drawing, 0.0),
    )


def with_alarms(ship: Vessel, data: Sequence[Path]) -> tuple[Vessel, dict[str, str]]:
    """The ship with what a watch named as unsure as its alarm says; for files that it left.

    Stated standard deviations of parameters, actuators and sensors that are smaller become the size of the change
    together with its standard error: the fit would hold it for unlikely. Returns also the effects that were named, each
    with who named it, in words.
    """
    names, std, named = ship.model.names, ship.model.parameter_std.copy(), dict[str, str]()
    stated = dict(ship.std)
    for path in data:
        told = path.with_name("monitor.json")
        if path.name != SINCE_CHANGE or not told.is_file():
            continue
        try:
            alarm = json.loads(told.read_text(encoding="utf-8"))["alarms"][-1]
            effect, size, words = str(alarm["effect"]), math.hypot(alarm["value"], alarm["std"]), alarm["in_words"]
        except (ValueError, KeyError, IndexError, TypeError):
            raise FileError(told, "alarms", f"is not as expdesign monitor leaves it beside {path.name}") from None
        if effect.startswith(WITHOUT_SHIP):
            continue
        named[effect] = f"Of {path.name} expdesign monitor named {words}"
        if (name := effect.removeprefix("theta:")) in names and size > std[names.index(name)] > 0.0:
            std[names.index(name)] = size
            named[effect] += f"; the standard deviation of {name} is taken as {size:.3g}"
        narrow = [key for key in std_keys_of(effect, ship.model.inputs) if size > stated.get(key, 0.0) > 0.0]
        stated |= dict.fromkeys(narrow, size)
        if narrow:
            named[effect] += f"; the standard deviation of {', '.join(narrow)} is taken as {size:.3g}"
    return replace(ship, model=replace(ship.model, parameter_std=std), std=stated), named


def _roll(ship: Vessel, record: Record) -> RollVerdict | None:
    """Whether the ship rolls as [roll] says; None without it."""
    if ship.pendulum is None:
        return None
    missing = dict.fromkeys(name for batch in record.batches for name in missing_columns(batch))
    if missing:
        return RollVerdict(reason=f"the data do not measure {' and '.join(missing)}")
    try:
        runs = with_one_source([roll_run(batch, ship=ship) for batch in record.batches])
        return RollVerdict(judgement=judge_roll(ship.pendulum, runs, beam_m=ship.beam_m))
    except (InputError, NotInformative) as error:
        return RollVerdict(reason=str(error))


def _proposals(scenario: Path, model: VesselModel) -> tuple[Proposal, ...]:
    """The scenario's dictionary as commands of a model's inputs."""
    case = load_scenario(scenario)
    return tuple(
        Proposal(
            name=primitive.name,
            inputs=as_inputs(primitive.commands, case.vessel, model),
            velocity=primitive.entry_velocity,
            sample_time_s=primitive.commands.sample_time_s,
        )
        for primitive in build_dictionary(case.vessel, case.dictionary)
    )


def as_inputs(commands: Commands, vessel: Vessel, model: VesselModel) -> Array:
    """(k, m) commands of a vessel as inputs of a model, which may be driven by the force that they give.

    Raises:
        InputError: they are not what drives the model.
    """
    wanted = tuple(name for name in model.inputs if name != SHOAL)
    table = dict(zip(commands.names, commands.values.T, strict=True))
    if wanted == FORCE_SIGNALS and not set(wanted) & set(table) and not direct_terms(vessel.model):
        forces = generalised_force(vessel.model.actuators, table, NUMPY)
        table = dict(zip(FORCE_SIGNALS, np.broadcast_arrays(*forces, commands.values[:, 0])[:3], strict=True))
    if not set(wanted) <= set(table):
        raise InputError(
            f"the scenario's vessel {vessel.name!r} takes {', '.join(commands.names)}, the inputs in the data are "
            f"{', '.join(wanted)}; expected a scenario of the ship in the data"
        )
    return np.column_stack([table[name] for name in wanted])
