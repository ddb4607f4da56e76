"""Trials of a model ship that rolls: a vessel file with [roll], simulated at several loads, measured and written."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from design_case import SCENARIOS
from expdesign.dictionary import Primitive
from expdesign.loading import Question, build_question, run_information
from expdesign.roll import Case, RollEstimate, Run, build_problem, estimate_roll
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import CALM, in_waves, measure, rudder_angle, simulate
from expdesign.values import Array
from expdesign.vessel import NOMINAL, Load, Vessel

ROLL_MODEL = SCENARIOS / "vessels" / "roll-model.toml"
HIGH = Load(mass_kg=0.4, z_m=-0.256)
UNKNOWN = Load(mass_kg=0.4, z_m=-0.268)
GUESS = {"m": UNKNOWN.mass_kg, "z_m": UNKNOWN.z_m}
UNDER_WAY = (0.8, 0.0, 0.0)


def roll_model() -> Vessel:
    return load_vessel(ROLL_MODEL)


def loaded(vessel: Vessel, load: Load) -> Vessel:
    """The same with a load on board; her path is the same."""
    assert vessel.pendulum is not None
    return replace(vessel, pendulum=replace(vessel.pendulum, load=load))


def orders(vessel: Vessel, samples: int, rng: np.random.Generator, *, hold_s: float = 2.0) -> Commands:
    """Steady propeller, and a rudder that goes to one of three angles at random, as fast as it can, for so long."""
    hold = round(hold_s / vessel.sample_time_s)
    wished = np.repeat(rng.choice([-0.5, 0.0, 0.5], samples // hold + 1), hold)[:samples]
    rudder, most = np.zeros(samples), vessel.rates[1] * vessel.sample_time_s
    for k in range(1, samples):
        rudder[k] = rudder[k - 1] + np.clip(wished[k] - rudder[k - 1], -most, most)
    values = np.column_stack([np.full(samples, 10.0), rudder])
    return Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=values)


def trial(vessel: Vessel, load: Load, seed: int, samples: int = 4000) -> dict[str, Array]:
    """Measured columns of a run at a load."""
    rng, ship = np.random.default_rng(seed), loaded(vessel, load)
    commands = orders(ship, samples, rng)
    sailed = in_waves(ship, simulate(ship, commands, velocity=UNDER_WAY), rng)
    return measure(ship, commands, sailed, environment=CALM, rng=rng)


def write_csv(path: Path, columns: dict[str, Array]) -> Path:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    return path


def steps(ship: Vessel, samples: int = 1000, seed: int = 1) -> Primitive:
    """A manoeuvre of `orders`."""
    commands = orders(ship, samples, np.random.default_rng(seed))
    sailed = simulate(ship, commands, velocity=UNDER_WAY)
    return Primitive(
        name=f"steps-{seed}", family="steps", settings={}, commands=commands, entry_inputs=commands.values[0],
        trajectory=sailed,
    )  # fmt: skip


def measured(ship: Vessel, load: Load, seed: int, samples: int, late_s: float = 0.0) -> Run:
    """A run as the estimate reads it, the accelerometer late."""
    told = trial(ship, load, seed, samples=samples)
    rudder = rudder_angle(ship, orders(ship, samples, np.random.default_rng(seed)))
    sensed = np.interp(told["time_s"] - late_s, told["time_s"], -told["imu_lateral_mps2"])
    signals = [told["roll_rate_radps"], sensed, told["r_radps"], rudder]
    return Run(step_s=ship.sample_time_s, signals=np.column_stack(signals))


def bound(ship: Vessel, seed: int, samples: int = 3000) -> tuple[Question, Array]:
    """Three load cases with k known, and the least standard deviations (p,) by their information."""
    assert ship.pendulum is not None
    known = {"k": ship.pendulum.parameters["k"]}
    question = build_question(ship, (NOMINAL, HIGH, None), known=known, guess=GUESS)
    told = sum(
        run_information(ship, question.theta, option, [steps(ship, samples, 10 * seed + place)])[0]
        for place, option in enumerate(question.options)
    )
    scaled = np.asarray(told)[np.ix_(question.places, question.places)] * np.outer(question.size, question.size)
    return question, np.sqrt(np.diag(np.linalg.inv(scaled))) * question.size


def error_and_bound(ship: Vessel, seed: int, *, late_s: float = 0.0, samples: int = 3000) -> tuple[Array, Array]:
    """Errors (p,) of an estimate from three load cases with k known, and their least standard deviations (p,)."""
    question, least = bound(ship, seed, samples)
    found = estimated(ship, question, seed, late_s=late_s, samples=samples)
    return (found.theta - question.theta)[question.places], least


def estimated(ship: Vessel, question: Question, seed: int, *, late_s: float = 0.0, samples: int = 3000) -> RollEstimate:
    """From three load cases with k known."""
    assert ship.pendulum is not None
    cases = tuple(
        Case(
            name=option.name,
            load=option.load,
            runs=(measured(ship, option.load or UNKNOWN, 10 * seed + place, samples, late_s),),
        )
        for place, option in enumerate(question.options)
    )
    start = dict(ship.pendulum.parameters)
    known = {"k": start.pop("k")}
    problem = build_problem(ship.pendulum.body, cases, beam_m=0.3, roll_hz=0.8, known=known, start=start)
    return estimate_roll(problem)
