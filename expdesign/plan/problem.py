"""The problem that the planner solves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import DurationDesign
from expdesign.plan.values import PlanSettings, UnderWay
from expdesign.sea_area import SeaArea
from expdesign.simulation import Environment, to_body
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanProblem:
    """A trial to be planned."""

    # vessel, area, environment, settings: who, where, in what weather, with which settings
    vessel: Vessel
    area: SeaArea
    environment: Environment
    settings: PlanSettings
    primitives: tuple[Primitive, ...]  # of the dictionary, in the design's order
    design: DurationDesign  # gives the number of runs of each
    # start, goal: (3,) poses; the ship ends at rest through the water
    start: Array
    goal: Array
    seed: int = 0  # of everything drawn
    # whether plans are compared by their expected time, go-arounds included, where the ship has a rule
    expected: bool = False
    # how the ship moves at the start; None where it is at rest through the water there
    under_way: UnderWay | None = None

    def __post_init__(self) -> None:
        seal(self, start="3", goal="3")

    @property
    def repeats(self) -> dict[str, int]:
        """How often each primitive is run."""
        return dict(zip(self.design.problem.names, self.design.repeats, strict=True))

    @property
    def used(self) -> tuple[Primitive, ...]:
        """Primitives that are run."""
        return tuple(item for item in self.primitives if self.repeats[item.name])

    @property
    def ends(self) -> Array:
        """(2, 2) positions of start and goal."""
        return np.stack([self.start[:2], self.goal[:2]])

    @property
    def current_mps(self) -> float:
        """Speed of the forecast's mean current."""
        return float(np.hypot(*self.environment.current_to))

    @property
    def begin(self) -> Array:
        """(6,) state at the start."""
        return self.at_rest(self.start) if self.under_way is None else np.r_[self.start, self.under_way.velocity]

    @property
    def standing(self) -> Array:
        """(m,) commands standing there."""
        return np.zeros(len(self.vessel.limits)) if self.under_way is None else self.under_way.inputs

    def moving(self, pose: Array, velocity: Array) -> Array:
        """(6,) state at a pose with a velocity (3,) through the forecast's mean current."""
        u_c, v_c = to_body(self.environment.current_to, pose[2], NUMPY)
        return np.asarray(np.r_[pose, velocity + np.array([u_c, v_c, 0.0])])

    def at_rest(self, pose: Array) -> Array:
        """(6,) state at a pose, at rest through the water."""
        return self.moving(pose, np.zeros(3))
