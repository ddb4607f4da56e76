"""A manoeuvre primitive: commands, entry state, and simulated motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import to_b_frame
from expdesign.signals import Commands, Trajectory
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Primitive:
    """One entry of the dictionary, simulated with the nominal vessel in calm water from the origin, heading north.

    Attributes:
        name: unique in its dictionary.
        family: the manoeuvre family that made it.
        settings: the family's parameters, units in the names.
        commands: actuator commands (k samples).
        entry_inputs: (m,) actuator commands before the run.
        trajectory: simulated motion, k + 1 samples; its first velocity is the entry velocity through water.
    """

    name: str
    family: str
    settings: Mapping[str, float]
    commands: Commands
    entry_inputs: Array
    trajectory: Trajectory

    def __post_init__(self) -> None:
        seal(self, entry_inputs="m")

    @property
    def duration_s(self) -> float:
        """Time of one run [s]."""
        return self.commands.duration_s

    @property
    def entry_velocity(self) -> Array:
        """(3,) u, v, r through water at the start."""
        return np.asarray(self.trajectory.velocity[0])

    @property
    def exit_velocity(self) -> Array:
        """(3,) u, v, r through water at the end."""
        return np.asarray(self.trajectory.velocity[-1])

    @property
    def displacement(self) -> Array:
        """(3,) forward m, starboard m, turn rad from start to end, in the start pose's frame."""
        pose = self.trajectory.pose
        return np.array([*to_b_frame(pose[-1, :2], pose[0]), pose[-1, 2] - pose[0, 2]])
