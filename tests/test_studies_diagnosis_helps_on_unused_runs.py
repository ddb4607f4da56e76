"""On real trials the diagnosis names what is known to act, and mending it helps on runs that nobody used."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from diagnosis_real import fault, tried
from diagnosis_real_faults import FAULTS, of_instruments, of_model, of_term
from diagnosis_real_hulls import averaged_over
from expdesign.signals import Batch
from real_data_cases import POND
from sample_files import outside


def test_averages_keep_means_and_are_cut_to_whole_samples() -> None:
    """What is measured is averaged around an instant, inputs from there to the next one."""
    rows = np.arange(23.0)[:, None] * [1.0, 2.0, 3.0]
    batch = Batch(name="run", sample_time_s=0.1, input_names=("n1",), inputs=rows[:, :1], velocity=rows, pose=rows)
    found = averaged_over(batch, 5, 2.1)
    assert len(found) == 3
    assert found.sample_time_s == pytest.approx(0.5)
    np.testing.assert_allclose(found.velocity.mean(axis=0), rows[2:17].mean(axis=0))
    np.testing.assert_allclose(found.inputs[0], rows[5:10, :1].mean(axis=0))


@pytest.mark.parametrize("late", [0, 1, 2])
def test_the_truth_of_a_dead_time_may_be_below_zero(late: int) -> None:
    """Orders recorded some samples after they act: the model responds later than the ship, which no bound hides."""
    record = hidden_record("barge", seed=5, batches=3, samples=200, step_s=0.5)
    batches = [
        replace(batch, inputs=np.concatenate([np.repeat(batch.inputs[:1], late, axis=0), batch.inputs])[: len(batch)])
        for batch in record.batches
    ]
    found = of_model(vessel_of("barge"), replace(record, batches=tuple(batches)), ["delay:all"], beside={})
    assert found["delay:all"] == pytest.approx(-0.5 * late, abs=0.02)


def test_the_truth_of_a_term_is_that_of_the_runs_that_are_judged() -> None:
    """A model was fitted to other runs, in which a term was another."""
    record = hidden_record("barge", seed=6, batches=3, samples=200, factors={"X_abs_u_u": 1.3})
    vessel = vessel_of("barge")
    other = dict(zip(vessel.model.names, vessel.model.parameters, strict=True))["X_abs_u_u"]
    assert of_term(vessel, record, "X_abs_u_u") == pytest.approx(1.3 * other, rel=0.02)


def test_the_truth_of_a_gyro_is_told_beside_its_zero() -> None:
    """In turns to one side a zero looks like a scale."""
    (run,) = hidden_record("barge", seed=7, batches=1, samples=400).batches
    assert run.pose is not None
    heading = np.cumsum(0.01 + 0.005 * np.sin(np.arange(400) / 30.0))
    rate = np.column_stack([run.velocity[:, :2], 0.97 * np.gradient(heading) + 0.002])
    turned = replace(run, velocity=rate, pose=np.column_stack([run.pose[:, :2], heading]))
    record = replace(hidden_record("barge", seed=7, batches=1, samples=400), batches=(turned,))
    assert of_instruments(record)["gyro"] == pytest.approx(-0.03, abs=1e-3)


@pytest.mark.outside
@pytest.mark.slow
def test_wind_is_named_first_on_the_pond_and_sway_is_predicted_better() -> None:
    """The pond's wind of 1-2 m/s acts on a model that makes 0.05-0.4 m/s: Wakita et al. (2022) measured it for that."""
    result = tried(POND, outside(POND.folder).parent)
    assert result.found.findings[0].cause == "wind"
    sway = [np.mean([rows[name][1] for name in rows]) for rows in (result.before, result.after)]
    assert sway[1] < sway[0]
    for name in ("zig-zags", "random"):
        assert result.after[name][1] < result.before[name][1], name


@pytest.mark.outside
@pytest.mark.slow
def test_what_zigzags_show_of_a_rudder_does_not_spoil_turns() -> None:
    """The rudder of the pond's model is quicker than her file says, which three zig-zags show and other runs do not.

    Parameters re-estimated from these zig-zags would predict turns and random runs 14 to 49 % worse.
    """
    data = outside(POND.folder).parent
    untouched = [item.name for item in FAULTS].index("untouched")
    row = fault(data, "pond", untouched, 0, 1011)
    assert [cause for cause, *_ in row["findings"]] == ["actuator_slew"]
    assert (np.array(row["unseen"]) > -0.02).all()


@pytest.mark.outside
@pytest.mark.slow
def test_a_current_is_named_that_parameters_would_take_the_place_of() -> None:
    """Two numbers beside the file, or 26 that parts of the same three runs flatter, and other runs do not."""
    data = outside(POND.folder).parent
    place = [item.name for item in FAULTS].index("current 0.07 m/s")
    row = fault(data, "pond", place, 0, 1011)
    assert row["named"] == "first"
    assert row["off"] < 2.5
