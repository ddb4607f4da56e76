"""The trial as it grows, stretch after stretch."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from expdesign.plan.values import Leg, Placement, SailedTrial
from expdesign.signals import Commands, Trajectory
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SailedStretch:
    """A leg with its commands (k, m) and states (k + 1, 6), and what found its path."""

    kind: str
    name: str
    commands: Array
    states: Array
    path: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Timeline:
    """The trial so far."""

    begin: Array  # (6,) state before the first stretch
    begin_inputs: Array  # (m,) commands standing then
    stretches: list[SailedStretch] = field(default_factory=list)  # in time order; the only part that grows

    @property
    def state(self) -> Array:
        """(6,) where the ship is now."""
        return np.asarray(self.stretches[-1].states[-1] if self.stretches else self.begin)

    @property
    def inputs(self) -> Array:
        """(m,) commands standing now."""
        return np.asarray(self.stretches[-1].commands[-1] if self.stretches else self.begin_inputs)

    @property
    def given(self) -> Array:
        """(h, m) all commands so far, what stood before them first."""
        return np.concatenate([self.begin_inputs[None], *(stretch.commands for stretch in self.stretches)])

    @property
    def last(self) -> str:
        """Name of the stretch sailed last, or ""."""
        return self.stretches[-1].name if self.stretches else ""

    def sail(self, kind: str, name: str, commands: Array, track: Trajectory, path: str = "") -> None:
        """Add a stretch."""
        states = np.hstack([track.pose, track.velocity])
        self.stretches.append(SailedStretch(kind=kind, name=name, commands=commands, states=states, path=path))

    def undo_run(self) -> Placement:
        """Remove the last run and the leg to it; where the run began."""
        run = self.stretches.pop()
        self.stretches.pop()
        return Placement(primitive=run.name, pose=run.states[0, :3])

    def joined(self, *, sample_time_s: float, names: tuple[str, ...]) -> SailedTrial:
        """Everything as one command series, one trajectory and the legs in it."""
        values = np.concatenate([stretch.commands for stretch in self.stretches])
        states = np.concatenate([self.begin[None], *(stretch.states[1:] for stretch in self.stretches)])
        ends = np.cumsum([len(stretch.commands) for stretch in self.stretches]).tolist()
        legs = tuple(
            Leg(
                kind=stretch.kind,
                name=stretch.name,
                first=end - len(stretch.commands),
                last=end,
                path=stretch.path,
            )
            for stretch, end in zip(self.stretches, ends, strict=True)
        )
        commands = Commands(sample_time_s=sample_time_s, names=names, values=values)
        track = Trajectory(sample_time_s=sample_time_s, pose=states[:, :3], velocity=states[:, 3:])
        return SailedTrial(commands=commands, trajectory=track, legs=legs, standing=self.begin_inputs)
