"""A verified plan as its files hold it: input of routes and of simulated trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import NoPlan
from expdesign.export.routes.fence import Fence
from expdesign.plan.values import Leg, Plan
from expdesign.sea_area import LocalFrame
from expdesign.signals import Commands, Trajectory
from expdesign.simulation.environment import Environment
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedTrack:
    """Commands and the motion they give, from start to goal; verified.

    Attributes:
        scenario, vessel: names.
        length_m, beam_m: of the vessel [m].
        frame: relates north/east metres to latitude and longitude.
        environment: the forecast it was planned for.
        commands: (k, m) actuator commands.
        trajectory: k + 1 samples.
        legs: in time order, without gaps.
        clearance_m: least distance from the hull to forbidden water that is required [m].
        fence: allowed water around the track, or None when it is not known.
    """

    scenario: str
    vessel: str
    length_m: float
    beam_m: float
    frame: LocalFrame
    environment: Environment
    commands: Commands
    trajectory: Trajectory
    legs: tuple[Leg, ...]
    clearance_m: float
    fence: Fence | None = None

    @property
    def sample_leg(self) -> np.ndarray:
        """(k + 1,) index of the leg each sample belongs to; a leg owns its first sample, the last one owns its last."""
        starts = [leg.first for leg in self.legs]
        return np.searchsorted(starts, np.arange(len(self.trajectory)), side="right") - 1


def planned_track(
    plan: Plan, *, scenario: str, vessel: Vessel, environment: Environment, clearance_m: float
) -> PlannedTrack:
    """The part of a plan that its files hold.

    Raises:
        NoPlan: the plan is not verified.
    """
    require_verified(plan)
    return PlannedTrack(
        scenario=scenario,
        vessel=vessel.name,
        length_m=vessel.length_m,
        beam_m=vessel.beam_m,
        frame=plan.area.frame,
        environment=environment,
        commands=plan.commands,
        trajectory=plan.trajectory,
        legs=plan.legs,
        clearance_m=clearance_m,
    )


def require_verified(plan: Plan) -> None:
    """A draft, or a plan that failed a check, never becomes a file that somebody could sail; one often aborted does.

    Raises:
        NoPlan: naming the failed checks.
    """
    if plan.draft:
        raise NoPlan(f"the plan is {plan.verdict}; expected one made without --draft")
    if not plan.verification.passed:
        raise NoPlan(f"the plan is not verified and is not written: {'; '.join(plan.verification.problems)}")
