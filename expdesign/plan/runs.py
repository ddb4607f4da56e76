"""Runs as the planner places them: footprint of the swept hull, and dispersion of drawn ships in drawn weather.

Each drawn ship has parameters of its own, a current and a wind that keep their drawn means or vary round them, and
actuators that deliver as the vessel's file says. For ships that wait, only the weather goes on.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import NoPlan
from expdesign.simulation import ActuatorState, Environment, Variation, draw_environment, simulate_many, step_shares
from expdesign.simulation.environment import vary
from expdesign.simulation.program import RatesProgram
from expdesign.simulation.run import LARGEST_SPEED, SUBSTEPS
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel
from expdesign.vessel.vessel import covering_discs, disc_points, thinned_poses

FEW_SHIPS = 128  # up to so many are quicker one by one than by an operation on all of them at a time


@sealed(parameters="n p", current_to="n 2", wind_to="n 2")
class Truths:
    """True parameters and mean weather of n ships."""

    parameters: Array  # (n, p) in the model's own form
    # current_to, wind_to: (n, 2) means of their trials [m/s]
    current_to: Array
    wind_to: Array


class Weather:
    """Current and wind of n ships, drawn for all of them whether they move or wait.

    Attributes:
        varies: whether they change from sample to sample.
        now: (4, n) current and wind to north and east of this sample [m/s].
    """

    def __init__(
        self, environment: Environment, truths: Truths, *, sample_time_s: float, rng: np.random.Generator
    ) -> None:
        """The means; `draw` goes on to the first sample."""
        self._rng, self._sample_time_s = rng, sample_time_s
        self._means = (truths.current_to, truths.wind_to)
        self._variations = (environment.current_variation, environment.wind_variation)
        self._varied: list[Array | None] = [None, None]
        self.varies = any(variation.std_mps > 0.0 for variation in self._variations)
        self.now: Array = np.concatenate([mean.T for mean in self._means])

    def draw(self) -> None:
        """Go on to the next sample."""
        for index, (variation, mean) in enumerate(zip(self._variations, self._means, strict=True)):
            if variation.std_mps > 0.0:
                normal, before = self._rng.standard_normal((1, *mean.shape)), self._varied[index]
                varied = vary(variation, normal, sample_time_s=self._sample_time_s, before=before)[0]
                self.now[2 * index : 2 * index + 2] = (mean + varied).T
                self._varied[index] = varied


class Fleet:
    """n ships and their states, columns of arrays side by side in memory.

    Attributes:
        vessel: the nominal one.
        weather: of all ships, also of those that the fleet is only a part of.
        states: (n, 6) pose in the n-frame and velocity over ground in the b-frame.
        given: (n, m) commands standing.
        delivered: (n, m) what the actuators gave over the last sample, on average.
        lost: (n,) ships whose motion diverged; they stay where they were.
    """

    def __init__(
        self,
        vessel: Vessel,
        environment: Environment,
        truths: Truths,
        *,
        state: Array,
        standing: Array,
        rng: np.random.Generator,
    ) -> None:
        """All ships begin in one state (6,) with commands (m,) that have stood for long.

        Args:
            environment: how current and wind vary.
            truths: of each ship.
            state, standing: at the beginning.
        """
        runs = len(truths.parameters)
        self.vessel = vessel
        self.weather = Weather(environment, truths, sample_time_s=vessel.sample_time_s, rng=rng)
        self.states: Array = np.repeat(state[:, None], runs, axis=1).T
        self.given: Array = np.repeat(standing[:, None], runs, axis=1).T
        self.delivered = self.given
        self.lost = np.zeros(runs, dtype=bool)
        self._shares = step_shares(vessel.responses, sample_time_s=vessel.sample_time_s, substeps=SUBSTEPS)
        self._actuators = ActuatorState.standing(
            vessel.responses, self.given.T, sample_time_s=vessel.sample_time_s, substeps=self._shares
        )
        self._ships, self._parameters = np.arange(runs), truths.parameters
        self._program = RatesProgram(vessel.model, runs=runs, parameters=truths.parameters)
        self._program.sea[...] = self.weather.now

    def part(self, ships: np.ndarray) -> Fleet:
        """Some of the ships (k,), by index, as a fleet that sails on by itself in the same weather."""
        some = copy(self)
        some.states, some.given, some.delivered = (_some(x, ships) for x in (self.states, self.given, self.delivered))
        some.lost, some._ships = self.lost[ships], self._ships[ships]
        some._actuators = self._actuators.part(ships)
        some._program = self._program.part(ships)
        return some

    def rejoin(self, part: Fleet, ships: np.ndarray) -> None:
        """Take over where a part (k ships, by index here) has sailed."""
        self.states, self.given, self.delivered = (
            _with(whole, ships, some)
            for whole, some in (
                (self.states, part.states),
                (self.given, part.given),
                (self.delivered, part.delivered),
            )
        )
        self.lost[ships] = part.lost
        self._actuators = self._actuators.joined(part._actuators, ships)

    def advance(self, commands: Array) -> None:
        """One sample with commands (n, m); ships that are lost wait."""
        sails = ~self.lost
        if not sails.any():
            return
        if sails.all():
            self._advance(commands)
        else:
            ships = np.flatnonzero(sails)
            part = self.part(ships)
            part._advance(commands[ships])
            self.rejoin(part, ships)

    def _advance(self, commands: Array) -> None:
        given = self._actuators.mean(commands.T)  # (substeps or 1, m, n)
        after = self._actuators.after(commands.T)
        if self.weather.varies:
            self.weather.draw()
            self._program.sea[...] = self.weather.now[:, self._ships]
        with np.errstate(over="ignore", invalid="ignore"):
            state = self._together(given) if len(commands) > FEW_SHIPS else self._one_by_one(given)
            settled = np.abs(state[3:]).max(axis=0) < LARGEST_SPEED
        delivered = given[0].T if len(given) == 1 else np.tensordot(self._shares, given, axes=1).T
        if not settled.all():
            self.lost = ~settled
            state, commands, delivered = (
                np.where(settled, new.T, old.T)
                for new, old in ((state.T, self.states), (commands, self.given), (delivered, self.delivered))
            )
            commands, delivered = commands.T, delivered.T
        self.states, self.given, self.delivered, self._actuators = state.T, commands, delivered, after

    def _together(self, given: Array) -> Array:
        """(6, n) states a sample later by operations on all ships at a time."""
        self._program.hold(given)
        state = self.states.T
        for part, share in enumerate(self._shares.tolist()):
            if part < len(given):
                self._program.select(part)
            state = self._program.rk4(state, share * self.vessel.sample_time_s)
        return state

    def _one_by_one(self, given: Array) -> Array:
        """The states a sample later by compiled steps, the quicker way for few ships."""
        from expdesign.simulation._casadi import compiled_sample  # CasADi is loaded when a motion is integrated

        sample = compiled_sample(self.vessel.model, rows=len(given), substeps=len(self._shares))
        after = sample.states(
            self.states,
            given,
            sea=self._program.sea,
            parameters=self._parameters[self._ships],
            steps_s=self._shares * self.vessel.sample_time_s,
        )
        return np.ascontiguousarray(after.T)


def _some(table: Array, ships: np.ndarray) -> Array:
    """Rows (k, ...) of a table (n, ...)."""
    return np.asarray(table.T.take(ships, axis=1).T)


def _with(table: Array, ships: np.ndarray, rows: Array) -> Array:
    """The table (n, ...) with other rows (k, ...) of some ships."""
    result = table.T.copy()
    result[:, ships] = rows.T
    return result.T


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
