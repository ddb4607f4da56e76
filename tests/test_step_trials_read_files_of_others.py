"""Step trials from files as others write them: read as what they are, or refused in one line that tells how to mend."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.records import load_records
from step_case import craft_columns, write_csv

STEPS = ((8.0, 0.1), (12.0, 0.1), (12.0, 0.3), (8.0, 0.3))


def renamed(columns: dict[str, np.ndarray], **names: tuple[str, float]) -> dict[str, np.ndarray]:
    """Columns under other names, each times a factor."""
    return {new: columns[old] * factor for old, (new, factor) in names.items()}


@pytest.fixture
def columns() -> dict[str, np.ndarray]:
    return craft_columns(1, steps=STEPS, hold_s=20.0)


def test_units_in_brackets_and_degrees_are_the_same_trial(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    degrees = 180.0 / np.pi
    plain = renamed(
        columns, time_s=("time_s", 1), u_mps=("u_mps", 1), r_radps=("r_radps", 1), n1_rps=("n1_rps", 1),
        rudder1_rad=("rudder1_rad", 1),
    )  # fmt: skip
    other = renamed(
        columns, time_s=("time [ms]", 1e3), u_mps=("u (m/s)", 1), r_radps=("r [deg/s]", degrees), n1_rps=("n1_rpm", 60),
        rudder1_rad=("rudder_deg", degrees),
    )  # fmt: skip
    one, two = (
        load_records([write_csv(tmp_path / f"{k}.csv", part, list(part))], outputs=("u", "r")).batches[0]
        for k, part in enumerate((plain, other))
    )
    assert one.input_names == two.input_names
    assert two.inputs == pytest.approx(one.inputs, rel=1e-6)
    assert two.velocity[:, [0, 2]] == pytest.approx(one.velocity[:, [0, 2]], abs=1e-6)


def refused(folder: Path, columns: dict[str, np.ndarray], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    data = write_csv(folder / "data.csv", columns, list(columns))
    status = main(["identify-steps", str(data), "--out", str(folder / "out"), "-q"])
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert not (folder / "out").exists()
    return status, told


def test_commands_without_a_unit_are_told_where_they_belong(
    tmp_path: Path, columns: dict[str, np.ndarray], capsys: pytest.CaptureFixture[str]
) -> None:
    common = {"time_s": ("time_s", 1.0), "u_mps": ("u_mps", 1.0), "r_radps": ("r_radps", 1.0)}
    pwm = renamed(columns, **common, n1_rps=("thruster_left_pwm", 20.0), rudder1_rad=("thruster_right_pwm", 20.0))
    status, told = refused(tmp_path, pwm, capsys)
    assert status == 2
    assert "tau_x" in told
    assert "thruster_left_pwm" in told
    share = renamed(columns, **common, n1_rps=("tau_x", 0.05), rudder1_rad=("tau_psi", 2.0))
    read = load_records([write_csv(tmp_path / "share.csv", share, list(share))], outputs=("u", "r"))
    assert read.batches[0].input_names == ("tau_x", "tau_psi")


def test_uneven_sampling_and_commands_that_never_stand_still_are_refused(
    tmp_path: Path, columns: dict[str, np.ndarray], capsys: pytest.CaptureFixture[str]
) -> None:
    kept = ("time_s", "u_mps", "r_radps", "n1_rps", "rudder1_rad")
    rng, count = np.random.default_rng(1), len(columns["time_s"])
    uneven = {name: columns[name] for name in kept} | {"time_s": columns["time_s"] + 0.12 * rng.random(count)}
    status, told = refused(tmp_path, uneven, capsys)
    assert (status, "even steps" in told) == (2, True)
    held_by_autopilot = {name: columns[name] for name in kept}
    held_by_autopilot["n1_rps"] = columns["n1_rps"] + rng.standard_normal(count)
    status, told = refused(tmp_path, held_by_autopilot, capsys)
    assert (status, "stand still" in told) == (3, True)


def test_a_craft_that_never_moves_has_no_steps_to_see(
    tmp_path: Path, columns: dict[str, np.ndarray], capsys: pytest.CaptureFixture[str]
) -> None:
    rng, count = np.random.default_rng(2), len(columns["time_s"])
    kept = {name: columns[name] for name in ("time_s", "n1_rps", "rudder1_rad")}
    moored = kept | {"u_mps": 0.02 * rng.standard_normal(count), "r_radps": 0.002 * rng.standard_normal(count)}
    status, told = refused(tmp_path, moored, capsys)
    assert (status, "no step of the throttle" in told) == (3, True)
