"""Trials of a model ship that rolls: a vessel file with [roll], simulated at several loads, measured and written."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from design_case import SCENARIOS
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import CALM, measure, simulate
from expdesign.values import Array
from expdesign.vessel import Load, Vessel

ROLL_MODEL = SCENARIOS / "vessels" / "roll-model.toml"
HIGH = Load(mass_kg=0.4, z_m=-0.256)
UNKNOWN = Load(mass_kg=0.4, z_m=-0.268)
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
    rudder, most = np.zeros(samples), vessel.limits[1].rate * vessel.sample_time_s
    for k in range(1, samples):
        rudder[k] = rudder[k - 1] + np.clip(wished[k] - rudder[k - 1], -most, most)
    values = np.column_stack([np.full(samples, 10.0), rudder])
    return Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=values)


def trial(vessel: Vessel, load: Load, seed: int, samples: int = 4000) -> dict[str, Array]:
    """Measured columns of a run at a load."""
    rng, ship = np.random.default_rng(seed), loaded(vessel, load)
    commands = orders(ship, samples, rng)
    sailed = simulate(ship, commands, velocity=UNDER_WAY)
    return measure(ship, commands, sailed, environment=CALM, rng=rng)


def write_csv(path: Path, columns: dict[str, Array]) -> Path:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    return path
