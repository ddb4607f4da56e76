"""Files may say which samples were steered and what was planned; estimates say which samples they used."""

import json
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.errors import FileError
from expdesign.export.files import record_csv
from expdesign.records import load_records
from measured_trials import EULER, MODEL_SHIP, MODEL_SHIP_TRUE, model_ship_commands, write_run
from record_files import motion, write_trial

STEERED = np.arange(80) >= 40


def marked(path: Path, **more: np.ndarray) -> Path:
    return write_trial(path, {**motion(), "steered": STEERED.astype(float), **more})


def planned() -> dict[str, np.ndarray]:
    return {"planned_n1_rps": np.full(80, 5.0), "planned_rudder1_deg": np.full(80, 9.0)}


def test_marks_and_planned_inputs_are_read_and_cut_with_their_samples(tmp_path: Path) -> None:
    (batch,) = load_records(marked(tmp_path / "one.csv", **planned())).batches
    np.testing.assert_array_equal(batch.steered, STEERED)
    np.testing.assert_allclose(batch.planned, [[5.0, np.radians(9.0)]] * 80)
    part = batch.cut(slice(30, 50))
    np.testing.assert_array_equal(part.steered, STEERED[30:50])
    assert part.planned.shape == (20, 2)


def test_files_without_marks_say_nothing(tmp_path: Path) -> None:
    (batch,) = load_records(write_trial(tmp_path / "one.csv", motion())).batches
    assert batch.steered is None
    assert batch.planned is None


def test_batches_say_whether_their_velocities_are_smoothed(tmp_path: Path) -> None:
    path = write_trial(tmp_path / "one.csv", motion())
    assert [load_records(path, velocity=how).batches[0].smoothed for how in ("difference", "smoothed")] == [False, True]


def test_records_are_written_with_their_marks(tmp_path: Path) -> None:
    record = load_records(marked(tmp_path / "one.csv", **planned()))
    again = tmp_path / "again.csv"
    again.write_text(record_csv(record.batches), encoding="utf-8")
    (batch,) = load_records(again).batches
    np.testing.assert_array_equal(batch.steered, STEERED)
    np.testing.assert_allclose(batch.planned, record.batches[0].planned, rtol=1e-9)


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ({"steered": STEERED * 0.5}, "steered: is 0.5 in row 42 .*expected 0 or 1"),
        ({"steered": STEERED * 2.0}, "steered: is 2 in row 42 .*expected 0 or 1"),
        ({"planned_n1_rps": np.full(80, 5.0)}, "names planned_n1_rps but no planned_rudder1_rad"),
    ],
)
def test_wrong_marks_are_refused(tmp_path: Path, more: dict[str, np.ndarray], problem: str) -> None:
    with pytest.raises(FileError, match=problem):
        load_records(marked(tmp_path / "one.csv", **more))


@pytest.mark.thorough
def test_estimates_say_which_samples_they_used(tmp_path: Path) -> None:
    path, commands = tmp_path / "one.csv", model_ship_commands(2000)
    write_run(path, MODEL_SHIP_TRUE, commands, **EULER)
    lines = path.read_text(encoding="utf-8").splitlines()
    marks = ["steered", *(str(int(row < 500)) for row in range(len(lines) - 1))]
    path.write_text("\n".join(f"{line},{mark}" for line, mark in zip(lines, marks, strict=True)) + "\n")
    outcome = workflows.estimate([path], tmp_path / "out", vessel=MODEL_SHIP, motion="euler")
    found = json.loads((tmp_path / "out" / "estimate.json").read_text(encoding="utf-8"))
    assert found["iv"]["steered"] == {"samples": 500, "of": 2000, "treatment": "leave-out"}
    assert found["iv"]["residuals"]["rows"] == 2000 - 500 - 2
    assert found["ls"]["steered"]["treatment"] == "use"
    assert found["ls"]["residuals"]["rows"] == 2000 - 1
    assert 0.0 <= found["iv"]["feedback_test"]["p_value"] <= 1.0
    assert "500 of 2000 samples are marked as steered" in (tmp_path / "out" / "estimate.html").read_text(
        encoding="utf-8"
    )
    (table,) = (item for item in outcome.document.tables if item.title == "Samples used")
    by_equation = "du/dt 1498, dv/dt 1498, dr/dt 1498"
    assert ("iv", "1498", by_equation, "500", "left out") in table.rows
