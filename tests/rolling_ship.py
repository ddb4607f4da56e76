"""Trials of a coaster that rolls: a vessel file with [roll], simulated at several loads, measured and written."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from design_case import SCENARIOS
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import CALM, measure, simulate
from expdesign.values import Array
from expdesign.vessel import Load, Vessel

COASTER = SCENARIOS / "vessels" / "coaster-80m-roll.toml"
HIGH = Load(mass_kg=6e4, z_m=-9.0)
UNKNOWN = Load(mass_kg=9e4, z_m=-7.0)


def coaster() -> Vessel:
    return load_vessel(COASTER)


def loaded(vessel: Vessel, load: Load) -> Vessel:
    """The same with a load on board; her path is the same."""
    assert vessel.pendulum is not None
    return replace(vessel, pendulum=replace(vessel.pendulum, load=load))


def orders(vessel: Vessel, samples: int, rng: np.random.Generator, *, hold_s: float = 20.0) -> Commands:
    """Steady propeller and a rudder that takes one of three angles at random for so long."""
    hold = round(hold_s / vessel.sample_time_s)
    rudder = np.repeat(rng.choice([-0.4, 0.0, 0.4], samples // hold + 1), hold)[:samples]
    return Commands(
        sample_time_s=vessel.sample_time_s,
        names=vessel.model.inputs,
        values=np.column_stack([rudder * 0 + 2.8, rudder]),
    )


def trial(vessel: Vessel, load: Load, seed: int, samples: int = 6000) -> dict[str, Array]:
    """Measured columns of a run at a load."""
    rng, ship = np.random.default_rng(seed), loaded(vessel, load)
    commands = orders(ship, samples, rng)
    sailed = simulate(ship, commands, velocity=(6.0, 0.0, 0.0))
    return measure(ship, commands, sailed, environment=CALM, rng=rng)


def write_csv(path: Path, columns: dict[str, Array]) -> Path:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    return path
