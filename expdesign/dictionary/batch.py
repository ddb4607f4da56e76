"""Commands and entry states of many specifications of one duration, without building primitives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary.build import desired_commands, desired_velocities, family, follow
from expdesign.dictionary.spec import PrimitiveSpec
from expdesign.dictionary.trim import lost
from expdesign.dictionary.tuning import TUNING
from expdesign.errors import InputError, NoAnswer
from expdesign.values import Array, seal
from expdesign.vessel import Vessel, within_limits


@dataclass(frozen=True, kw_only=True, eq=False)
class ExcitedRuns:
    """Commands and entry states of specifications of one duration.

    Attributes:
        possible: (n,) 1 where the settings are consistent and the vessel can hold the entry state, else 0.
        velocity: (n, 3) entry u, v, r through water.
        entry_inputs: (n, m) commands before the run.
        commands: (n, k, m) within limits and rates.
    """

    possible: Array
    velocity: Array
    entry_inputs: Array
    commands: Array

    def __post_init__(self) -> None:
        seal(self, possible="n", velocity="n 3", entry_inputs="n m", commands="n k m")


def excite_many(vessel: Vessel, specs: Sequence[PrimitiveSpec]) -> ExcitedRuns:
    """Commands of many specifications; impossible ones are marked instead of raising.

    Args:
        vessel: nominal.
        specs: of the same duration.
    """
    samples = round(specs[0].settings["duration_s"] / vessel.sample_time_s)
    possible, velocity = np.zeros(len(specs)), np.zeros((len(specs), 3))
    entry = np.zeros((len(specs), len(vessel.limits)))
    commands = np.zeros((len(specs), samples, len(vessel.limits)))
    desired: dict[int, Array] = {}
    for index, spec in enumerate(specs):
        try:
            if family(spec.family).reference is not None:
                desired[index] = desired_velocities(vessel, spec)
                continue
            found = desired_commands(vessel, spec)
        except (InputError, NoAnswer):
            continue
        if len(found.commands) == samples:
            possible[index], velocity[index], entry[index] = 1.0, found.velocity, found.inputs
            commands[index] = found.commands
    ordered = np.flatnonzero(possible)
    commands[ordered] = within_limits(
        vessel.actuators, commands[ordered], sample_time_s=vessel.sample_time_s, before=entry[ordered]
    )
    if desired:
        rows = np.array(list(desired))
        references = np.array(list(desired.values()))
        before, followed = follow(vessel, references)
        possible[rows] = lost(vessel, references[:, 0], before) <= TUNING.steady_change
        velocity[rows], entry[rows], commands[rows] = references[:, 0], before, followed
    return ExcitedRuns(possible=possible, velocity=velocity, entry_inputs=entry, commands=commands)
