"""The list of steps that a step trial sails, from a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from expdesign.dictionary import build_dictionary
from expdesign.errors import FileError, InputError
from expdesign.export.routes import read_plan
from expdesign.records import read_levels
from expdesign.scenario import load_dictionary
from expdesign.step_trials import Controls, levels_of
from expdesign.step_trials.live import StepList, step_list
from expdesign.values import Array
from expdesign.vessel import Vessel

STEP_FAMILIES = ("throttle_steps", "rudder_steps")
USUAL_INTERVAL_S = 1.0  # time between rows of a list that has one row [s]
Listing = tuple[Array, Sequence[int | None] | None, float]
"""Levels of the commands, numbers of the steps to them, and the time of the first [s]."""


def listed_steps(path: Path, names: Sequence[str], controls: Controls, vessel: Vessel | None) -> StepList:
    """The steps of a file.

    Args:
        path: plan.json, whose runs hold the steps; a dictionary with families of steps (.toml); or a CSV of commands,
            one row for each hold, or with times.
        vessel: for which a dictionary is built; None where none is known.

    Raises:
        FileError: the file is wrong, or holds no steps.
        InputError: a dictionary without a vessel.
    """
    if path.suffix == ".json":
        found = _in_turn(_of_plan(path, names))
    elif path.suffix == ".toml":
        found = _in_turn(_of_dictionary(path, vessel))
    else:
        found = _of_table(path, names)
    levels, numbers, first_s = found
    try:
        return step_list(names, levels, controls, numbers=numbers, first_s=first_s)
    except InputError as error:
        raise FileError(path, "", str(error)) from None


def _of_plan(path: Path, names: Sequence[str]) -> list[tuple[Array, Array]]:
    """Levels of each run of a plan, and their times."""
    plan = read_plan(path)
    commands = plan.commands
    if missing := [name for name in names if name not in commands.names]:
        raise FileError(path, "inputs", f"lacks {', '.join(missing)}, expected the inputs of the data")
    order = [commands.names.index(name) for name in names]
    return [
        levels_of(commands.values[leg.first : leg.last, order], commands.sample_time_s)
        for leg in plan.legs
        if leg.kind == "primitive"
    ]


def _of_dictionary(path: Path, vessel: Vessel | None) -> list[tuple[Array, Array]]:
    if vessel is None:
        raise InputError(f"--steps {path} is a dictionary, expected --vessel beside it")
    runs = [run for run in build_dictionary(vessel, load_dictionary(path)) if run.family in STEP_FAMILIES]
    if not runs:
        raise FileError(path, "primitives", f"has no family of steps, expected {' or '.join(STEP_FAMILIES)}")
    return [levels_of(run.commands.values, vessel.sample_time_s) for run in runs]


def _of_table(path: Path, names: Sequence[str]) -> Listing:
    values, time_s, numbers = read_levels(path, inputs=names)
    if time_s is None:
        return values, numbers, math.inf
    interval_s = float(np.median(np.diff(time_s))) if len(values) > 1 else USUAL_INTERVAL_S
    levels, lengths_s = levels_of(values, interval_s)
    return levels, None, float(lengths_s[0]) if len(levels) else math.inf


def _in_turn(runs: Sequence[tuple[Array, Array]]) -> Listing:
    """Levels of runs one after the other; that a run begins with is only gone to, which is no step."""
    held = [(levels, lengths_s) for levels, lengths_s in runs if len(levels)]
    if not held:
        return np.zeros((0, 1)), (), math.inf
    steps = np.concatenate([np.arange(len(levels)) > 0 for levels, _ in held])
    numbers = tuple(int(count) if step else None for count, step in zip(np.cumsum(steps), steps, strict=True))
    return np.concatenate([levels for levels, _ in held]), numbers, float(held[0][1][0])
