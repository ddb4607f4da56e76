"""Dead times and lags that the vessel file is not certain of: derivatives, estimates, and covariances with them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.assessment import EstimateOptions, assess, settled
from expdesign.assessment.actuator_times import with_held_noted
from expdesign.cli import main
from expdesign.estimation.methods import estimate
from expdesign.estimation.regression import drive_of
from expdesign.estimation.replay import Stretches, compiled
from expdesign.export.files import vessel_toml
from expdesign.reduction import TIMES, reduced
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import Environment, Variation, draw_weather, measure, simulate
from expdesign.simulation.run import SUBSTEPS
from expdesign.vessel import Sensors, Vessel, response_values, std_keys, with_response_values
from step_case import GUESS, INPUTS, TRUTH, write_csv

pytestmark = pytest.mark.usefixtures("undrawn")

NAMES = ("n1_delay_s", "rudder1_delay_s")
CRAFT = load_vessel(TRUTH)
OUTPUT_ERROR = EstimateOptions(methods=("oe",), mean="none")
STATED_S, STD_S = (0.49, 0.66), 0.15


def with_times(vessel: Vessel, std_s: float = 0.0, **times: float) -> Vessel:
    """The vessel with these times and, where it is not zero, their standard deviation."""
    actuators = with_response_values(vessel.actuators, times)
    std = dict.fromkeys(times, std_s) if std_s else {}
    return replace(vessel, model=replace(vessel.model, actuators=actuators), std=std)


def stated(std_s: float = STD_S, times_s: tuple[float, float] = STATED_S) -> Vessel:
    """The builder's guess with dead times as a step trial may find them; the true ones are 0.5 s."""
    return with_times(load_vessel(GUESS), std_s, **dict(zip(NAMES, times_s, strict=True)))


def jumps(seed: int, holds: int, hold: int = 10) -> Commands:
    """Commands that jump every so many samples, throttle and rudder at different samples."""
    rng = np.random.default_rng(seed)
    throttle = np.repeat(rng.uniform(6.0, 16.0, holds), hold)
    rudder = np.roll(np.repeat(rng.uniform(-0.35, 0.35, holds), hold), hold // 3)
    return Commands(sample_time_s=0.2, names=INPUTS, values=np.stack([throttle, rudder], axis=1))


def measured_run(seed: int, *, holds: int, quiet: bool) -> Record:
    """The true craft's answer, exact or with noise in waves."""
    commands, rng = jumps(seed, holds), np.random.default_rng([seed, 1])
    sea = Environment() if quiet else Environment(current_variation=Variation(std_mps=0.1, correlation_s=1.0))
    craft = replace(CRAFT, sensors=Sensors()) if quiet else CRAFT
    met = draw_weather(sea, len(commands), sample_time_s=0.2, rng=rng)
    motion = simulate(craft, commands, velocity=(3.0, 0.0, 0.0), environment=met)
    seen = measure(craft, commands, motion, environment=met, rng=rng)
    velocity = np.stack([seen["u_mps"], seen["v_mps"], seen["r_radps"]], axis=1)
    pose = np.stack([seen["north_m"], seen["east_m"], np.unwrap(seen["heading_rad"])], axis=1)
    batch = Batch(
        name=f"run-{seed}", sample_time_s=0.2, input_names=INPUTS, inputs=commands.values, velocity=velocity, pose=pose
    )
    return Record(batches=(batch,))


@pytest.mark.parametrize(
    "times",
    [
        {"n1_delay_s": 0.49, "rudder1_delay_s": 0.66},
        {"n1_delay_s": 0.47, "rudder1_delay_s": 0.13, "n1_lag_s": 0.3, "rudder1_lag_s": 0.2},
    ],
    ids=["dead times", "dead times and lags"],
)
def test_derivatives_by_times_are_those_of_the_ship_s_simulation(times: dict[str, float]) -> None:
    """Central differences of `simulate`, which delivers commands by another way."""
    commands, start, step_s = jumps(0, holds=12), np.array([[3.0, 0.0, 0.0]]), 1e-4

    def velocities(values: dict[str, float]) -> np.ndarray:
        return simulate(with_times(CRAFT, **values), commands, velocity=tuple(start[0])).velocity[:-1]

    batch = Batch(
        name="x", sample_time_s=0.2, input_names=INPUTS, inputs=commands.values, velocity=np.tile(start, (120, 1))
    )
    ship = with_times(CRAFT, 0.1, **times)
    steps = reduced(Record(batches=(batch,)), ship).batches[0]
    assert steps.delivered is not None
    names = steps.delivered.times
    assert set(names) == set(times)
    ready = compiled(
        Stretches(
            model=ship.model,
            sought=(),
            states=(0, 1, 2),
            drive=drive_of(ship.model, steps, substeps=SUBSTEPS, times=names)[:, None],
            windy=False,
            sample_time_s=0.2,
            integrator="rk4",
            substeps=SUBSTEPS,
            parts=len(steps.delivered.shares),
            times=names,
        )
    )
    values = np.zeros((1, len(names) + 3))
    states = ready.states(values, start)
    np.testing.assert_allclose(states[:, 0], velocities(times), atol=1e-12)
    slopes, _ = ready.sensitivities(values, states)
    for index, name in enumerate(names):
        later, sooner = (velocities({**times, name: times[name] + sign * step_s}) for sign in (1, -1))
        numeric = (later - sooner) / (2 * step_s)
        np.testing.assert_allclose(slopes[:, 0, :, index], numeric, atol=1e-4 * np.abs(numeric).max())


@pytest.mark.thorough
def test_without_noise_dead_times_and_parameters_are_found_exactly() -> None:
    """From dead times 0.01 and 0.16 s off, across a sample; what is stated of them then weighs nothing."""
    ship = stated()
    now, record = settled(ship, measured_run(1, holds=10, quiet=True), OUTPUT_ERROR)
    found = assess(now, record, OUTPUT_ERROR, stated=ship).best
    times = response_values(found.model.actuators)
    np.testing.assert_allclose([times[name] for name in NAMES], 0.5, atol=1e-4)
    np.testing.assert_allclose(found.model.parameters, CRAFT.model.parameters, rtol=2e-3)


@pytest.mark.thorough
def test_least_squares_counts_what_stated_errors_do() -> None:
    """Where dead times move little, the covariance grows by G S G^T with G from estimates at other dead times."""
    raw, std_s, methods = measured_run(2, holds=24, quiet=False), 0.01, EstimateOptions(methods=("ls",), mean="none")

    def estimate(ship: Vessel) -> tuple[np.ndarray, np.ndarray]:
        found = assess(ship, reduced(raw, ship), methods).best.estimate
        return found.values, found.covariance

    _, known = estimate(stated(0.0))
    _, counted = estimate(stated(std_s))
    columns = []
    for place in range(2):
        ends = [tuple(np.add(STATED_S, sign * std_s * np.eye(2)[place])) for sign in (1, -1)]
        later, sooner = (estimate(stated(0.0, end))[0] for end in ends)
        columns.append((later - sooner) / 2)
    moved = np.array(columns).T
    grown, size = moved @ moved.T, np.sqrt(np.diag(known))
    assert np.diag(grown / np.outer(size, size)).max() > 0.01
    np.testing.assert_allclose((counted - known) / np.outer(size, size), grown / np.outer(size, size), atol=1e-4)


@pytest.mark.thorough
def test_times_are_written_with_their_standard_deviation_and_named(tmp_path: Path) -> None:
    batch = measured_run(3, holds=14, quiet=False).batches[0]
    columns = dict(zip(("u_mps", "v_mps", "r_radps"), batch.velocity.T, strict=True))
    columns |= {"time_s": batch.time_s, "n1_rps": batch.inputs[:, 0], "rudder1_rad": batch.inputs[:, 1]}
    data = write_csv(tmp_path / "run.csv", columns, tuple(columns))
    file = tmp_path / "vessel-steps.toml"
    file.write_text(vessel_toml(stated()), encoding="utf-8")
    words = [
        "estimate",
        data,
        "--vessel",
        file,
        "--method",
        "oe",
        "--mean",
        "none",
        "--out",
        tmp_path / "out",
        "--quiet",
    ]
    assert main(list(map(str, words))) == 0
    found = load_vessel(tmp_path / "out" / "vessel-estimated.toml")
    report = json.loads((tmp_path / "out" / "estimate.json").read_text())["oe"]
    for name in NAMES:
        assert 0 < found.std[name] < STD_S
        assert report["nuisance"][name]["value"] == pytest.approx(response_values(found.actuators)[name])
        assert report["nuisance"][name]["std"] == pytest.approx(found.std[name])
        assert any(name in line for line in report["warnings"])


UNSURE = replace(CRAFT, std=dict.fromkeys([name for name in std_keys(CRAFT.actuators) if "_rate" not in name], 0.01))


def test_stated_errors_that_no_standard_deviation_counts_are_named() -> None:
    """Every quantity that may have a standard deviation, of sensors that the data come from, but for times."""
    run = measured_run(1, holds=8, quiet=False)
    found = estimate(run, CRAFT.model, method="ls")
    told = with_held_noted(found, run, UNSURE).warnings[-1]
    for name in UNSURE.std:
        unseen = name == "heading_bias_rad" or name.startswith("position_")
        counted = name.startswith(INPUTS) and name.endswith(TIMES)
        assert (f" {name}" in told.replace(":", ",")) == (not unseen and not counted), name
    assert with_held_noted(found, run, CRAFT).warnings == found.warnings


@pytest.mark.thorough
def test_an_assessment_names_stated_errors_that_it_holds() -> None:
    run = measured_run(1, holds=8, quiet=False)
    done = assess(UNSURE, run, EstimateOptions(methods=("ls",), mean="none"))
    assert sum("are held" in note for note in done.methods[0].estimate.warnings) == 1


@pytest.mark.slow
def test_intervals_hold_the_truth_where_dead_times_are_drawn_around_it() -> None:
    """20 trials: 220 intervals of parameters, some alike, so the share's error is taken from that between trials."""
    shares = []
    for seed in range(1000, 1020):
        rng = np.random.default_rng(seed)
        drawn = np.maximum(0.5 + STD_S * rng.standard_normal(2), 0.0)
        ship = stated(times_s=(float(drawn[0]), float(drawn[1])))
        now, record = settled(ship, measured_run(seed, holds=60, quiet=False), OUTPUT_ERROR)
        model = assess(now, record, OUTPUT_ERROR, stated=ship).best.model
        shares.append(np.mean(np.abs(model.parameters - CRAFT.model.parameters) < 1.96 * model.parameter_std))
    error = np.std(shares, ddof=1) / np.sqrt(len(shares))
    assert np.mean(shares) > 0.95 - 2.5 * max(error, 0.01)
