"""A lower bound on the day: by what must be told, and by the way to the goal."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from expdesign.errors import InputError
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.bounds import Headway, time_to_sail_s
from expdesign.plan.legs import through_water
from expdesign.plan.values import Plan, PlanProblem, SailedTrial
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.bounds.fewest_samples import BOX_GAP, fewest_samples
from expdesign.shortest_day.bounds.motions import AFFINE, Affine, Motions, over_boxes
from expdesign.shortest_day.prices import fewest_runs
from expdesign.shortest_day.values import DayBound
from expdesign.simulation import to_body
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY

SPEEDS = 24  # ranges of speed whose gain and loss are bounded
SPEED_ROUNDS, SPEED_BOXES = 20, 300  # of halving boxes of such a range, and most halved at once
SLOW_START = 0.01  # share of the way's time that gaining speed must take for these boxes to be halved


# The least time of a way from rest to rest: no ship gains or loses speed faster than its model and limits allow.
#
# The speed S through water changes by dS/dt = cos(b) du/dt + sin(b) dv/dt at the drift angle b, u = S cos(b) and v = S
# sin(b). The most and the least of it that the nominal model allows are bounded over boxes of speed, drift angle, yaw
# rate, heading and inputs by affine arithmetic; boxes where a bound is far above the best sample are halved. A speed
# that gains and loses at these rates is never below that of a motion (comparison principle), so it covers the way
# first.
#
# Source: F. Clarke, Functional Analysis, Calculus of Variations and Optimal Control (2013), for the comparison;
# combined here with affine arithmetic.


@sealed(edges="n", gain="k", loss="k")
class SpeedChanges:
    """How fast speed through water can change."""

    edges: Array  # (k + 1,) of ranges of speed, from 0 [m/s]
    # gain, loss: (k,) most in each range [m/s2]; not positive where the speed cannot be passed
    gain: Array
    loss: Array

    def least_s(self, way_m: float, begin_mps: float) -> float:
        """Least time of a way that begins with a speed and ends at rest [s]; 0 where it is too short to stop on."""
        time_s = covered_m = 0.0
        for low, high, gain, loss in zip(self.edges[:-1], self.edges[1:], self.gain, self.loss, strict=True):
            above = max(low, min(high, begin_mps))  # speeds above it are gained first
            if gain <= 0 or loss <= 0:
                return float(time_s + (way_m - covered_m) / low) if low > 0 and covered_m < way_m else 0.0
            passed_m = (high**2 - above**2) / (2 * gain) + (high**2 - low**2) / (2 * loss)
            if covered_m + passed_m >= way_m:
                if above > low:
                    return 0.0
                top = np.sqrt(low**2 + 2 * (way_m - covered_m) / (1 / gain + 1 / loss))
                return float(time_s + (top - low) * (1 / gain + 1 / loss))
            time_s += (high - above) / gain + (high - low) / loss
            covered_m += passed_m
        return float(time_s + (way_m - covered_m) / self.edges[-1])


def speed_changes(motions: Motions, most_mps: float, *, rounds: int = SPEED_ROUNDS) -> SpeedChanges | None:
    """Bounds for speeds up to `most_mps`.

    Args:
        motions: of all parameters of the model.
        most_mps: of the class.
        rounds: of halving boxes; the bounds hold with any number.

    Returns:
        None where the model couples accelerations, of which nothing is known here.
    """
    if motions.model.inertia is not None:
        return None
    edges = np.linspace(0.0, most_mps, SPEEDS + 1)
    ranges = np.array([_most(motions, low, high, rounds) for low, high in pairwise(edges.tolist())])
    return SpeedChanges(edges=edges, gain=ranges[:, 0], loss=ranges[:, 1])


def _most(motions: Motions, low: float, high: float, rounds: int) -> tuple[float, float]:
    """Most gain and most loss of speeds in a range [m/s2]."""
    sides = np.array([[low, high], [-np.pi, np.pi], *np.column_stack([motions.low, motions.high])[2:]])
    centres, halves = _parted(sides)
    bounds = _bounds(motions, centres, halves)
    for _ in range(rounds):
        found = _bounds(motions, centres, np.zeros_like(halves)).max(axis=1, keepdims=True)  # samples
        most = np.where(np.isfinite(found), found + BOX_GAP * np.nan_to_num(np.abs(found), posinf=0.0), -np.inf)
        open_ = (bounds > most).any(axis=0)
        order = np.flatnonzero(open_)[np.argsort(-bounds[:, open_].max(axis=0))][:SPEED_BOXES]
        if not len(order):
            break
        across = np.argmax(halves[order, 1:] / (np.ptp(sides, axis=1)[1:] + 1e-12), axis=1) + 1
        step = np.zeros_like(halves[order])
        step[np.arange(len(order)), across] = halves[order, across] / 2
        halved = np.where(step > 0, step, halves[order])
        new = np.concatenate([centres[order] - step, centres[order] + step]), np.tile(halved, (2, 1))
        more = np.minimum(_bounds(motions, *new), np.tile(bounds[:, order], 2))
        centres, halves = (
            np.concatenate([np.delete(a, order, axis=0), b]) for a, b in zip((centres, halves), new, strict=True)
        )
        bounds = np.concatenate([np.delete(bounds, order, axis=1), more], axis=1)
    gain, loss = bounds.max(axis=1).tolist()
    return float(gain), float(loss)


def _parted(sides: Array) -> tuple[Array, Array]:
    """Centres and half sides (b, d) of the first boxes: drift angles in eight parts, which moduli bend between."""
    parts = [1, 8, *(2 if low < 0 < high else 1 for low, high in sides[2:].tolist())]
    edges = [np.linspace(low, high, count + 1) for (low, high), count in zip(sides.tolist(), parts, strict=True)]
    lows, highs = (
        np.stack([axis.ravel() for axis in np.meshgrid(*ends, indexing="ij")], axis=1)
        for ends in ([e[:-1] for e in edges], [e[1:] for e in edges])
    )
    return (lows + highs) / 2, (highs - lows) / 2


def _bounds(motions: Motions, centres: Array, halves: Array) -> Array:
    """(2, b) upper bounds on gain and loss of speed over boxes of (speed, drift angle, yaw rate, ...).

    -inf for boxes without a velocity of the class.
    """
    model = motions.model
    speed, drift, *others = over_boxes(centres, halves)
    ahead, aside = AFFINE.cos(drift), AFFINE.sin(drift)
    base, gains = motions.regressors((speed * ahead, speed * aside, *others), AFFINE)

    def along(values: list[Affine | float]) -> Affine:
        total: Affine = 0.0 * speed
        for term, theta, value in zip(model.terms, model.parameters.tolist(), values, strict=True):
            if term.equation in ("u", "v"):
                direction = ahead if term.equation == "u" else aside
                total = total + direction * (value * (theta / model.time_scale_s))
        return total

    fixed, by_force, forces = along(base), [along(gain) for gain in gains], motions.forces
    centre = fixed.centre + forces @ np.array([by.centre for by in by_force])
    slopes = fixed.slopes + np.tensordot(forces, np.array([by.slopes for by in by_force]), axes=1)
    radius = np.abs(slopes).sum(axis=1) + fixed.error + np.abs(forces) @ np.array([by.error for by in by_force])
    found = np.stack([(centre + radius).max(axis=0), (radius - centre).max(axis=0)])
    inside = [
        (value.centre - value.radius <= motions.high[side]) & (value.centre + value.radius >= motions.low[side])
        for side, value in enumerate((speed * ahead, speed * aside))
    ]
    return np.where(np.all(inside, axis=0), found, -np.inf)


def day_bound(problem: PlanProblem, accuracy: Accuracy, plan: Plan | SailedTrial) -> DayBound:
    """A bound for all days whose velocities through water stay within those of the dictionary and of a plan.

    Args:
        problem: gives vessel, weather, water, dictionary and ends.
        accuracy: to be reached; limits on standard deviations bound the way only, as noise that samples share leaves no
            information of single samples to bound.
        plan: a day found; the class of motions holds it.
    """
    seen = _velocities(problem, plan)
    velocities, speed_mps = velocity_limits(seen), float(np.hypot(*seen[:, :2].T).max())
    environment, design = problem.environment, problem.design.problem
    try:
        motions = Motions.within(
            problem.vessel.model,
            design.parameters,
            velocities,
            air_to=environment.wind_to - environment.current_to,
        )
        samples = fewest_samples(accuracy.of_information, motions, mean_subtraction=design.mean_subtraction)
    except InputError:  # inputs without limits, or enough known already: nothing to tell
        samples = None
    second = problem.vessel.sample_time_s
    return DayBound(
        information_s=samples.least * second if samples else 0.0,
        searched_s=samples.estimate * second if samples else 0.0,
        way_s=_from_rest_to_rest_s(problem, velocities, speed_mps),
        required_s=float(fewest_runs(problem) @ design.run_s),
        velocities=velocities,
        speed_mps=speed_mps,
    )


def _velocities(problem: PlanProblem, plan: Plan | SailedTrial) -> Array:
    """(k, 3) velocities through water of all runs and of a plan."""
    heading_rad, ground = plan.trajectory.pose[:, 2], plan.trajectory.velocity
    current = to_body(problem.environment.current_to, heading_rad, NUMPY)
    water = ground - np.stack([*current, np.zeros(len(ground))], axis=1)
    return np.concatenate([water, *(item.trajectory.velocity for item in problem.primitives)])


def velocity_limits(seen: Array) -> Array:
    """(3, 2) least and largest of velocities (k, 3); sway and yaw to both sides alike, as a ship is."""
    u, most = seen[:, 0], np.abs(seen).max(axis=0)
    return np.array([[u.min(), u.max()], [-most[1], most[1]], [-most[2], most[2]]])


def fastest_mps(problem: PlanProblem) -> float:
    """Largest speed through water of legs, of the runs of the dictionary, and at the start."""
    begin = through_water(problem.environment, problem.begin)[None]
    runs = np.concatenate([begin, *(item.trajectory.velocity for item in problem.primitives)])
    return max(ship_on_legs(problem).transit_speed_mps, float(np.hypot(*runs[:, :2].T).max()))


def _from_rest_to_rest_s(problem: PlanProblem, velocities: Array, speed_mps: float) -> float:
    """`way_bound_s`, and the time to gain speed and to stop, by the nominal model; without a mean current only.

    Boxes are halved for a closer bound only where that time matters.
    """
    way_s, environment = way_bound_s(problem, speed_mps), problem.environment
    if problem.current_mps > 0:
        return way_s
    model, begin_mps = problem.vessel.model, float(np.hypot(*through_water(environment, problem.begin)[:2]))
    try:
        motions = Motions.within(model, model.names, velocities, air_to=environment.wind_to)
    except InputError:  # inputs without limits
        return way_s
    found_s = way_s
    for rounds in (0, SPEED_ROUNDS):
        changes = speed_changes(motions, speed_mps, rounds=rounds)
        if changes is not None:
            found_s = max(found_s, changes.least_s(way_s * speed_mps, begin_mps))
        if found_s < (1 + SLOW_START) * way_s:
            break
    return found_s


def way_bound_s(problem: PlanProblem, speed_mps: float) -> float:
    """Least time of the way to the goal in safe water at a speed through it; 0 where the current is faster."""
    if speed_mps <= problem.current_mps:
        return 0.0
    headway = Headway(speed_mps=speed_mps, current_to=problem.environment.current_to)
    vessel, ends = problem.vessel, (problem.start, problem.goal)
    margin_m = problem.settings.clearance_m + vessel.beam_m / 2
    return max(0.0, time_to_sail_s(problem.area, margin_m, {}, {}, ends, headway, vessel.length_m / 30))
