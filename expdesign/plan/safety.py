"""The chance that a run leaves the allowed water when the vessel is not quite the nominal one.

How the helm is taken to react: every run begins at its planned pose and entry velocity, because the leg before it is
steered; during the run the commands are given open loop. Legs are steered along the plan and not part of this chance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from expdesign.plan.area import SeaArea
from expdesign.plan.footprint import hull_outlines
from expdesign.plan.uncertainty import draw_truths
from expdesign.plan.values import Leg
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, simulate_many
from expdesign.values import Array
from expdesign.vessel import Vessel

DRAWS = 300
LOOK_EVERY_M = 0.25
"""Hull lengths the ship moves, by its planned speed, between looks at the chart."""


def leave_water_probability(
    vessel: Vessel,
    area: SeaArea,
    environment: Environment,
    *,
    commands: Commands,
    trajectory: Trajectory,
    legs: Sequence[Leg],
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> tuple[float, tuple[float | None, ...]]:
    """Share of drawn vessels, currents and winds for which some run's hull leaves the allowed water, and for each leg.

    Legs between runs have no share, None.

    One draw is one trial: the same parameters (normal, independent, standard deviations of the vessel file), current
    and wind in all its runs. Its standard error is sqrt(p (1 - p) / draws). Runs that diverge count as leaving.
    """
    parameters, current, wind = draw_truths(vessel, environment, draws, rng)
    shapely.prepare(area.water)
    left = np.zeros(draws, dtype=bool)
    shares: list[float | None] = []
    for leg in legs:
        if leg.kind != "primitive":
            shares.append(None)
            continue
        run = Commands(
            sample_time_s=commands.sample_time_s, names=commands.names, values=commands.values[leg.first : leg.last]
        )
        states = simulate_many(
            vessel,
            run,
            pose=np.tile(trajectory.pose[leg.first], (draws, 1)),
            velocity=np.tile(trajectory.velocity[leg.first], (draws, 1)),
            current_to=current,
            wind_to=wind,
            parameters=parameters,
            standing=commands.values[leg.first - 1] if leg.first else None,
        )
        leaves = _leaves(area, vessel, states)
        left |= leaves
        shares.append(float(leaves.mean()))
    return float(left.mean()), tuple(shares)


def _leaves(area: SeaArea, vessel: Vessel, states: Array) -> np.ndarray:
    """(n,) whether the hull, or what it sweeps between looks, ever reaches outside, from states (k, n, 6)."""
    speed = np.hypot(states[..., 3], states[..., 4]) + np.abs(states[..., 5]) * vessel.length_m / 2
    every = max(1, int(LOOK_EVERY_M * vessel.length_m / (np.nanquantile(speed, 0.9) * vessel.sample_time_s + 1e-9)))
    looked = np.unique(np.r_[np.arange(0, len(states), every), len(states) - 1])
    pose = states[looked, :, :3]
    lost = np.isnan(pose).any(axis=(0, 2))
    corners = hull_outlines(np.nan_to_num(pose).reshape(-1, 3), vessel.hull_b).reshape(*pose.shape[:2], -1, 2)
    spans = shapely.convex_hull(shapely.multipoints(np.concatenate([corners[:-1], corners[1:]], axis=2)))
    return np.asarray(lost | ~shapely.contains_properly(area.water, spans).all(axis=0))
