"""A trial simulated with nothing hidden: the ship in use, its sensors, the forecast weather."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import rotated
from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.motion import Motion, initial_states, simulate_from_measured, stable_windows
from expdesign.diagnosis.select import ScoreTest, fit_nuisance, open_candidates, score_tests
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.dictionary import Primitive
from expdesign.rehearsal.validation import heading_rad
from expdesign.signals import Batch, Commands, Record, Trajectory
from expdesign.simulation import Environment, draw_weather, measure, simulate
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

RECORDS = 12  # of a trial with nothing hidden, from which the errors of held-out runs are drawn


@sealed(pose="3", velocity="3")
class TrialRun:
    """One uninterrupted stretch of a trial."""

    name: str  # of its batch
    commands: Commands  # k samples
    pose: Array  # (3,) at the first sample [m, m, rad]
    velocity: Array  # (3,) over ground in the b-frame at the first sample [m/s, m/s, rad/s]
    # (m,) commands that stood before the first sample; None for those of the first sample
    standing: Array | None = None


def design_runs(primitives: Sequence[Primitive], repeats: Sequence[int]) -> tuple[TrialRun, ...]:
    """Every whole run of a design, its first headings spread as `rehearsal` spreads them."""
    order = [item for item, count in zip(primitives, repeats, strict=True) for _ in range(count)]
    return tuple(run_of(item, heading_rad(number)) for number, item in enumerate(order))


def run_of(primitive: Primitive, heading: float) -> TrialRun:
    """One run of a manoeuvre that begins on a heading [rad]."""
    return TrialRun(
        name=primitive.name,
        commands=primitive.commands,
        pose=np.array([0.0, 0.0, heading]),
        velocity=primitive.entry_velocity,
        standing=primitive.entry_inputs,
    )


def weather_without_causes(vessel: Vessel, forecast: Environment) -> Environment:
    """The forecast with the mean current that the model in use knows of; how both vary stays.

    A mean current that the vessel file does not state is a cause, and wind is measured.
    """
    return replace(
        forecast, current_to=vessel.environment.current_to, current_std_mps=0.0, wind_std_mps=0.0, sea_state=None
    )


def simulated_record(
    vessel: Vessel, runs: Sequence[TrialRun], weather: Environment, rng: np.random.Generator
) -> Record:
    """Measured data of every run, one batch each.

    Args:
        vessel: the ship that sails, with its sensors.
        weather: its means and how it varies.
        rng: of weather and sensor noise.
    """
    return Record(batches=tuple(_batch(vessel, run, weather, rng) for run in runs))


def _batch(vessel: Vessel, run: TrialRun, weather: Environment, rng: np.random.Generator) -> Batch:
    commands = run.commands
    met = draw_weather(weather, len(commands), sample_time_s=commands.sample_time_s, rng=rng)
    sailed = simulate(vessel, commands, pose=run.pose, velocity=run.velocity, environment=met, standing=run.standing)
    seen = measure(vessel, commands, sailed, environment=met, rng=rng)
    return Batch(
        name=run.name,
        sample_time_s=commands.sample_time_s,
        input_names=commands.names,
        inputs=commands.values,
        velocity=np.column_stack([seen["u_mps"], seen["v_mps"], seen["r_radps"]]),
        pose=np.column_stack([seen["north_m"], seen["east_m"], np.unwrap(seen["heading_rad"])]),
        wind=np.column_stack([seen["wind_u_mps"], seen["wind_v_mps"]]),
    )


def exact_record(runs: Sequence[tuple[str, Commands, Trajectory]], wind_to: Array) -> Record:
    """Motions as sensors without noise would show them, in a steady wind (2,) to north and east [m/s]."""
    batches = []
    for name, commands, motion in runs:
        count = len(commands)
        heading, velocity = motion.pose[:count, 2], motion.velocity[:count]
        air = np.column_stack(rotated(wind_to, -heading))
        batches.append(
            Batch(
                name=name,
                sample_time_s=commands.sample_time_s,
                input_names=commands.names,
                inputs=commands.values,
                velocity=velocity,
                pose=motion.pose[:count],
                wind=velocity[:, :2] - air,
            )
        )
    return Record(batches=tuple(batches))


@dataclass(frozen=True, kw_only=True, eq=False)
class Background:
    """A trial with nothing hidden, as a diagnosis sees it before it looks for causes."""

    base: Fit  # the fit of uncertain parameters and of the noise
    windows: Windows  # the data
    # the same runs with other noise, simulated by the model in use as it is and cut like the data
    again: tuple[Motion, ...]
    candidates: tuple[Candidate, ...]  # of the catalogue
    tests: tuple[ScoreTest, ...]  # of those candidates that differ from everything in the fit


def background(vessel: Vessel, runs: Sequence[TrialRun], weather: Environment, *, seed: int = 0) -> Background:
    """Simulate a trial without hidden effects, and prepare its tests.

    Args:
        seed: of sensor noise, weather and the null distribution of the tests.
    """
    rng = np.random.default_rng(seed)
    calm = weather_without_causes(vessel, weather)
    record = simulated_record(vessel, runs, calm, rng)
    ship = extended_model(vessel, record)
    windows = stable_windows(ship, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    candidates = tuple(open_candidates(base, windows))
    tests = score_tests(base, candidates, rng)
    records = [simulated_record(vessel, runs, calm, rng) for _ in range(RECORDS)]
    like = {"longest_s": windows.steps * windows.step_s, "step_s": windows.step_s}
    again = [simulate_from_measured(ship, cut_windows(ship.model, item, **like)) for item in records]
    return Background(base=base, windows=windows, again=tuple(again), candidates=candidates, tests=tests)
