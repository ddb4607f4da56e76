"""Dispersion of a run about its nominal track, for vessels and weather drawn from their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import NoPlan
from expdesign.plan.runs.ensemble import Truths
from expdesign.simulation import Environment, Variation, draw_environment, simulate_many
from expdesign.simulation.environment import vary
from expdesign.values import Array
from expdesign.vessel import Vessel
from expdesign.vessel.hull import covering_discs, disc_points, thinned_poses

FEWEST_DRAWS, USUAL_DRAWS = 200, 2000  # drawn runs of each primitive
EXPECTED_OUTSIDE = 2.0  # draws are so many that this number may leave the room
MOST_DRAWS = 50_000  # where one outside takes more than the usual number
DRAWS_AT_ONCE = 4000  # simulated together, which bounds the memory


def draw_truths(vessel: Vessel, environment: Environment, draws: int, rng: np.random.Generator) -> Truths:
    """Parameters, mean currents and mean winds drawn from the prior and the forecast.

    Parameters are normal with the vessel file's standard deviations and correlations.
    """
    parameters = vessel.model.drawn_parameters(draws, rng)
    weather = [draw_environment(environment, rng) for _ in range(draws)]
    return Truths(
        parameters=parameters,
        current_to=np.array([x.current_to for x in weather]),
        wind_to=np.array([x.wind_to for x in weather]),
    )


def dispersion_m(
    vessel: Vessel,
    primitive: Primitive,
    environment: Environment,
    *,
    centres_m: Array,
    confidence: float,
    rng: np.random.Generator,
    draws: int | None = None,
) -> Array:
    """(k + 1,) radius round the nominal disc centres that a share `confidence` of drawn runs keeps to all the time.

    Each draw has its own vessel, weather and heading, begins at the entry velocity and runs open loop. The radius
    grows with time like the draws' root mean square distance, scaled so that the desired share stays inside throughout.

    Args:
        vessel, primitive, environment: the nominal run and what is uncertain about it.
        centres_m: (c,) forward positions of the discs that cover the hull.
        confidence: between 0 and 1.
        rng: draws.
        draws: how many; by default by `Tuning`.

    Raises:
        NoPlan: so many drawn vessels are unstable that the share cannot be met, or it is too high to be estimated.
    """
    draws, most = draws or draws_for(confidence), DRAWS_AT_ONCE
    counts = [min(most, draws - first) for first in range(0, draws, most)]
    apart = [_apart(vessel, primitive, environment, centres_m=centres_m, rng=rng, draws=count) for count in counts]
    return _radius(np.concatenate(apart, axis=1), confidence, primitive.name)


def draws_for(confidence: float) -> int:
    """How many draws resolve what a share `confidence` of runs keeps to.

    So many that `EXPECTED_OUTSIDE` are outside, or one where that takes many.

    Raises:
        NoPlan: the share is so high that it takes too many.
    """
    outside = 1.0 - confidence
    usual = int(np.clip(np.ceil(EXPECTED_OUTSIDE / outside), FEWEST_DRAWS, USUAL_DRAWS))
    needed = max(usual, int(np.ceil((1.0 - 1e-9) / outside)))
    if needed > MOST_DRAWS:
        raise NoPlan(
            f"plan.confidence is too high to be estimated: each run would have to keep to its room in {confidence:.6g} "
            f"of all cases, and it takes {needed} drawn vessels to resolve that, more than {MOST_DRAWS}",
            what="confidence",
        )
    return needed


def _apart(
    vessel: Vessel,
    primitive: Primitive,
    environment: Environment,
    *,
    centres_m: Array,
    rng: np.random.Generator,
    draws: int,
) -> Array:
    """(k + 1, n) distance of the discs of drawn runs from the nominal ones, the largest of each sample."""
    truths, samples = draw_truths(vessel, environment, draws, rng), len(primitive.commands)
    heading = rng.uniform(-np.pi, np.pi, draws)
    states = run_at_headings(
        vessel,
        primitive,
        heading,
        entering=environment.current_to,
        current_to=truths.current_to + _varying(vessel, environment.current_variation, (samples, draws, 2), rng),
        wind_to=truths.wind_to + _varying(vessel, environment.wind_variation, (samples, draws, 2), rng),
        parameters=truths.parameters,
    )
    c, s = np.cos(heading), np.sin(heading)
    moved = states[..., :2] - environment.current_to * primitive.trajectory.time_s[:, None, None]
    back = np.stack([moved[..., 0] * c + moved[..., 1] * s, moved[..., 1] * c - moved[..., 0] * s], axis=-1)
    pose_b = np.concatenate([back, states[..., 2:3] - heading[:, None]], axis=-1)  # (k + 1, n, 3)
    nominal = disc_points(primitive.trajectory.pose, centres_m)
    drawn = disc_points(pose_b.reshape(-1, 3), centres_m).reshape(*pose_b.shape[:2], -1, 2)
    return np.asarray(np.hypot(*np.moveaxis(drawn - nominal[:, None], -1, 0)).max(axis=-1))


def run_at_headings(
    vessel: Vessel,
    primitive: Primitive,
    heading: Array,
    *,
    entering: Array,
    current_to: Array,
    wind_to: Array,
    parameters: Array,
) -> Array:
    """(k + 1, n, 6) states over ground of a run that begins at the origin at headings (n,).

    Args:
        vessel, primitive: ship and run.
        heading: of each ship [rad].
        entering: (2,) current through which all begin with the entry velocity [m/s].
        current_to, wind_to: (n, 2) or (k, n, 2) during the run [m/s].
        parameters: (n, p) of each ship.
    """
    c, s = np.cos(heading), np.sin(heading)
    north, east = entering
    return simulate_many(
        vessel,
        primitive.commands,
        pose=np.stack([0 * c, 0 * c, heading], axis=1),
        velocity=primitive.entry_velocity + np.stack([north * c + east * s, east * c - north * s, 0 * c], axis=1),
        current_to=current_to,
        wind_to=wind_to,
        parameters=parameters,
        standing=primitive.entry_inputs,
    )


def _varying(
    vessel: Vessel, variation: Variation, shape: tuple[int, int, int], rng: np.random.Generator
) -> Array | float:
    """(k, n, 2) variation of a current or a wind about its mean; 0 where it is steady."""
    if variation.std_mps == 0.0:
        return 0.0
    return vary(variation, rng.standard_normal(shape), sample_time_s=vessel.sample_time_s)


def _radius(apart: Array, confidence: float, name: str) -> Array:
    stable = ~np.isnan(apart).any(axis=0)
    shape = np.sqrt(np.mean(apart[:, stable] ** 2, axis=1)) + 1e-9 if stable.any() else np.ones(len(apart))
    ratio = np.where(stable, np.nan_to_num(apart / shape[:, None]).max(axis=0), np.inf)
    factor = float(np.quantile(ratio, confidence, method="higher"))
    if not np.isfinite(factor):
        raise NoPlan(
            f"{name!r} is unstable for {np.mean(~stable):.1%} of the vessels drawn from model.parameter_std, while "
            f"plan.confidence, shared out over the runs, allows each {1.0 - confidence:.2%}; model.parameter_min and "
            "model.parameter_max state what is known to hold, as damping below 0",
            what="unstable",
            which=name,
        )
    return np.asarray(factor * shape)


# Runs as placed shapes: the discs that cover the swept hull, the clearance they need, and the displacement.


@dataclass(frozen=True, kw_only=True, eq=False)
class Footprint:
    """A primitive as the search places it."""

    name: str  # of the primitive
    discs: Array  # (n, 2) forward/starboard centres of the discs that cover its swept hull [m]
    times_s: Array  # (n,) when the hull is there [s]
    room_m: Array  # (n,) clearance that each disc centre needs [m]
    displacement: Array  # (3,) forward m, starboard m, turn rad through water
    duration_s: float  # of one run [s]
    # entry_mps, exit_mps: surge speed at its ends
    entry_mps: float
    exit_mps: float

    @property
    def needs(self) -> str:
        """The water that it needs, in words."""
        return (
            f"it goes up to {np.hypot(*self.discs.T).max():.4g} m from its start and needs up to "
            f"{self.room_m.max():.4g} m round its centre line (hull, plan.clearance_m, and what the vessel's "
            "parameter_std and the forecast add at plan.confidence)"
        )

    @property
    def displacement_m(self) -> float:
        """Distance made good through water."""
        return float(np.hypot(*self.displacement[:2]))

    @property
    def course_rad(self) -> float:
        """Course made good, from the heading at the beginning."""
        return float(np.arctan2(self.displacement[1], self.displacement[0]))

    @property
    def course_from_end_rad(self) -> float:
        """Course made good, from the heading at the end."""
        return self.course_rad - float(self.displacement[2])


def footprint(primitive: Primitive, room_m: Array, *, length_m: float, beam_m: float) -> Footprint:
    """Reduce a primitive to what the search needs; `room_m` (k + 1,) is the clearance for discs at each sample."""
    centres, _ = covering_discs(length_m, beam_m)
    pose = primitive.trajectory.pose
    kept = thinned_poses(pose, reach_m=length_m / 2, spacing_m=length_m / 4)
    return Footprint(
        name=primitive.name,
        discs=disc_points(pose[kept], centres).reshape(-1, 2),
        times_s=np.repeat(kept * primitive.trajectory.sample_time_s, len(centres)),
        room_m=np.repeat(room_m[kept], len(centres)),
        displacement=primitive.displacement,
        duration_s=primitive.duration_s,
        entry_mps=float(primitive.entry_velocity[0]),
        exit_mps=float(primitive.exit_velocity[0]),
    )
