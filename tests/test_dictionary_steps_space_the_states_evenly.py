"""Throttle and rudder steps: equally spaced steady states by the nominal model, and a trial that can be identified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from design_case import SCENARIOS, spec
from expdesign.dictionary import Primitive, build_dictionary, build_primitive
from expdesign.errors import InputError, Unreachable
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.signals import Batch, Record
from expdesign.simulation import measure, simulate
from expdesign.step_trials import controls_of, identify_steps
from step_case import GUESS, INPUTS, TRUTH


def steady_ends(run: Primitive, holds: int, column: int) -> np.ndarray:
    """A velocity at the end of each hold."""
    last = np.linspace(0, len(run.commands), holds + 1).round().astype(int)[1:]
    return np.asarray(run.trajectory.velocity[last, column])


def test_throttle_steps_are_even_in_speed_and_the_orders_are_not() -> None:
    ship = load_vessel(GUESS)
    request = spec("throttle_steps", duration_s=700.0, speed_mps=2.0, rise=4.0, steps=3.0, helm_rad=0.0)
    run = build_primitive(ship, request)
    speeds = steady_ends(run, 7, 0)
    assert speeds == pytest.approx([2, 4, 6, 8, 6, 4, 2], rel=0.02)
    orders = run.commands.column("n1")[np.arange(0, len(run.commands), len(run.commands) // 7)[:4]]
    assert np.ptp(np.diff(orders)) > 0.05 * np.diff(orders).mean()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_rudder_steps_are_even_in_yaw_rate(side: float) -> None:
    ship = load_vessel(GUESS)
    request = spec("rudder_steps", duration_s=560.0, speed_mps=6.0, steps=3.0, helm_rad=0.4 * side)
    run = build_primitive(ship, request)
    rates = side * steady_ends(run, 7, 2)
    assert rates[:4] == pytest.approx(np.linspace(0.0, rates[3], 4), abs=0.02 * rates[3])
    assert rates[4:] == pytest.approx(rates[2::-1], abs=0.02 * rates[3])


def test_a_rise_out_of_reach_and_too_much_helm_are_refused() -> None:
    ship = load_vessel(GUESS)
    with pytest.raises(Unreachable, match="cannot hold"):
        build_primitive(ship, spec("throttle_steps", duration_s=100.0, speed_mps=5.0, rise=10.0))
    with pytest.raises(InputError, match="a helm of"):
        build_primitive(ship, spec("rudder_steps", duration_s=100.0, speed_mps=5.0, helm_rad=1.0))


@pytest.mark.thorough
def test_the_step_trial_of_the_dictionary_identifies_a_craft_that_differs_from_the_guess() -> None:
    truth, rng = load_vessel(TRUTH), np.random.default_rng(1)
    runs = build_dictionary(load_vessel(GUESS), load_dictionary(SCENARIOS / "dictionaries" / "step-trial.toml"))
    batches = []
    for run in runs:
        begin = simulate(truth, replace(run.commands, values=np.tile(run.entry_inputs, (300, 1))))
        sailed = simulate(truth, run.commands, velocity=begin.velocity[-1])
        columns = measure(truth, run.commands, sailed, environment=truth.environment, rng=rng)
        velocity = np.stack([columns["u_mps"], np.full(len(run.commands), np.nan), columns["r_radps"]], axis=1)
        batches.append(
            Batch(name=run.name, sample_time_s=0.2, input_names=INPUTS, inputs=run.commands.values, velocity=velocity)
        )
    trial = identify_steps(Record(batches=tuple(batches)), controls_of(INPUTS))
    asked = [one for one in trial.samples if one.hold.channel is not None]
    assert len(trial.counted) > 0.8 * len(asked)
    assert trial.delays[0][0] == pytest.approx(0.55, abs=0.15)
    rudder, std = trial.delays[1]
    assert rudder == pytest.approx(0.56, abs=3 * std)
    assert std < 0.1
