"""Data faster than the ship moves are averaged before they are compared: a model that is right must then look right."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import hidden_effects as sea
from clean_trials import SHIP_50M, at_rate, clean_trial
from diagnosis_case import from_pose, hidden_record, vessel_of
from expdesign.diagnosis.data.windows import cut_windows, fastest_rate
from expdesign.diagnosis.motion.inputs import _averaged, delivered_inputs
from expdesign.diagnosis.motion.simulation import simulate_from_measured
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.signals import Record
from expdesign.vessel import Limit, Sensors

CALM = sea.Weather(current_std=0.0, wind_std=0.0)
IDEAL = sea.Sensors(position=0.0, heading=0.0, velocity=0.0, yaw_rate=0.0, wind=0.0)
LIMITS = Limit(low=-12.0, high=12.0), Limit(low=-1.0, high=1.0)
START = 60  # compared samples that it takes to forget a first state read from a straight line


@cache
def quiet(step_s: float) -> Record:
    """Two minutes of zig-zags twice, without any noise, from an integrator of its own."""
    return hidden_record(
        "barge", seed=4, batches=2, samples=round(120 / step_s), step_s=step_s, weather=CALM, sensors=IDEAL,
        manoeuvre="zigzag",
    )  # fmt: skip


@pytest.mark.parametrize("pose", [False, True])
@pytest.mark.parametrize("step_s", [0.5, 0.2, 0.05])
def test_nothing_is_left_over_where_the_model_is_right(step_s, pose):
    """A quarter of a per cent of what is measured: what the curvature of drag makes of a mean over a second."""
    record = quiet(step_s)
    if pose:
        record = Record(batches=tuple(from_pose(batch) for batch in record.batches))
    ship = extended_model(vessel_of("barge", sample_time_s=step_s), record)
    windows = cut_windows(ship.model, record)
    assert windows.rows_per_step == round(1.0 / step_s)
    motion = simulate_from_measured(ship, windows)
    known = np.isfinite(windows.measured[:, START:]).any(axis=(0, 1))
    left = np.sqrt(np.nanmean(motion.error[:, START:, known] ** 2, axis=(0, 1)))
    assert (left < 0.0025 * np.nanstd(windows.measured[:, START:, known], axis=(0, 1))).all()


@pytest.mark.parametrize("vessel", [vessel_of("tug"), SHIP_50M, at_rate(SHIP_50M, 0.1)], ids=["tug", "1 Hz", "10 Hz"])
def test_nothing_is_left_over_from_the_first_sample_on_or_where_orders_change(vessel):
    """From rest, without noise: 0.1 mm/s and as much of yaw at the bow, where a straight line missed 50 mm/s."""
    if vessel.name == "tug":
        actuators = tuple(replace(one, limits=LIMITS) for one in vessel.model.actuators)
        vessel = replace(vessel, model=replace(vessel.model, actuators=actuators))
    record = clean_trial(replace(vessel, sensors=Sensors()), np.random.default_rng(1), runs=2, run_s=150.0)
    ship = extended_model(vessel, record)
    left = np.sqrt(np.nanmean(simulate_from_measured(ship, cut_windows(ship.model, record)).error ** 2, axis=(0, 1)))
    assert (left[:3] * [1.0, 1.0, vessel.length_m / 2] < 1e-4).all()


def test_commands_are_followed_as_recorded_not_as_averaged():
    """Means over a second of a command that changes its sign pass through a dead band that no command was in."""
    step_s = 0.05
    record = quiet(step_s)
    ship = extended_model(vessel_of("barge", sample_time_s=step_s), record)
    windows = cut_windows(ship.model, record)
    place = ship.model.inputs.index("tau_psi")
    orders = np.concatenate([batch.inputs[:, place] for batch in record.batches])
    width = 0.99 * np.abs(orders).min()
    rows = windows.batch_inputs[0][..., None]
    acting = delivered_inputs(ship.with_effects({"deadband:tau_psi": width}), rows, windows)[0][..., 0]
    assert np.abs(acting[:, place]).min() > width


def test_inputs_of_a_step_are_the_mean_of_its_samples():
    record = quiet(0.2)
    record = Record(batches=(replace(record.batches[0], name="one"),))
    ship = extended_model(vessel_of("barge", sample_time_s=0.2), record)
    windows = cut_windows(ship.model, record)
    rows = record.batches[0].inputs
    expected = rows[: len(rows) // 5 * 5].reshape(-1, 5, rows.shape[1]).mean(axis=1)
    first = int(windows.first[1]) if len(windows.first) > 1 else len(expected)
    np.testing.assert_allclose(windows.step_inputs[0, :first], expected[:first], rtol=1e-12)


def test_noise_of_differences_is_no_speed():
    """Positions good to 0.4 m, twenty times a second, differ by 5 m/s from one to the next: drag is not that quick."""
    state_rates = []
    for position in (0.0, 0.4):
        record = hidden_record(
            "tug", seed=4, batches=2, samples=600, step_s=0.05, sensors=sea.Sensors(position=position)
        )
        data = Record(batches=tuple(from_pose(batch) for batch in record.batches))
        state_rates.append(fastest_rate(extended_model(vessel_of("tug", sample_time_s=0.05), data).model, data))
    assert state_rates[1] < 1.5 * state_rates[0]


@pytest.mark.parametrize("step_s", [0.2, 1.0])
@pytest.mark.parametrize("factors", [(1.0, 100.0), (100.0, 1.0)])
def test_another_record_is_cut_like_the_first_whatever_step_its_own_speeds_ask_for(step_s, factors):
    """The damping of a faster ship is faster, which shortens averages and integrator steps."""
    one, other = (
        Record(batches=tuple(replace(batch, velocity=factor * batch.velocity) for batch in quiet(step_s).batches))
        for factor in factors
    )
    model = extended_model(vessel_of("barge", sample_time_s=step_s), one).model
    windows, own = cut_windows(model, one), cut_windows(model, other)
    assert own.step_s != windows.step_s
    like = cut_windows(model, other, longest_s=windows.steps * windows.step_s, step_s=windows.step_s)
    assert like.step_s == pytest.approx(windows.step_s)
    assert (like.rows_per_step, like.steps_per_sample) == (windows.rows_per_step, windows.steps_per_sample)
    assert like.measured.shape == windows.measured.shape
    assert like.heading.shape == windows.heading.shape


@pytest.mark.parametrize(("rows_per_step", "parts"), [(1, 4), (2, 2), (5, 1), (37, 1), (50, 2)])
def test_means_of_inputs_are_those_of_the_samples_around_every_instant(rows_per_step, parts):
    """The last and the first input hold beyond the data; samples around an instant are whole samples away from it."""
    rows = np.random.default_rng(0).normal(size=(4 * rows_per_step * parts, 2, 3)).cumsum(axis=0)
    half = rows_per_step // 2
    around = np.arange(len(rows))[:, None] + parts * np.arange(-half, half + 1)
    means = rows[np.clip(around, 0, len(rows) - 1)].mean(axis=1)
    np.testing.assert_allclose(_averaged(rows, rows_per_step * parts, rows_per_step), means, atol=1e-10)
