"""Limits that cannot be satisfied end `expdesign durations` with one line and its status, never with a traceback."""

from pathlib import Path

import pytest

from expdesign.cli import main
from scenario_files import spoil, write_scenario

TINY = 'most_s = {acceleration = 1e-9, "zz-speed-0.5" = 600.0, "zz-speed-0.4" = 1e-9}'
ALL_TIME = 'least_s = {acceleration = 360.0, "zz-speed-0.5" = 240.0}'
CASES = [
    (TINY, 3, "X_u, X_abs_u_u, X_mu"),
    ('excluded = ["acceleration", "zz-speed-0.5"]\nprior = "parameter_std"', 3, "X_abs_u_u, X_mu"),
    ('criterion = "D_s"\ninterest = ["X_u"]\nmost_s = {acceleration = 0.0, "zz-speed-0.5" = 1e-14}', 3, "X_u"),
    ('mean_subtraction = "batch"\nmost_s = {acceleration = 0.0}', 3, "X_u"),
    (ALL_TIME, 0, ""),
    (ALL_TIME + '\nbudgets = [{name = "e", limit = 1e9, cost_per_s = {acceleration = 1.0}}]', 0, ""),
    ('least_s = {acceleration = 360.0, "zz-speed-0.5" = 239.9999999999}', 0, ""),
    ('least_s = {acceleration = 300.0, "zz-speed-0.5" = 300.0}', 3, "whole runs that inform about every parameter"),
    ('budgets = [{name = "e", limit = 0.0, use = "cubed_propeller_speed"}]', 3, "budgets allow only 0 s"),
    ('budgets = [{name = "e", limit = 0.0, cost_per_s = {"zz-speed-0.5" = 1.0}}]', 0, ""),
    ('budgets = [{name = "e", limit = 1e-300, cost_per_s = {acceleration = 1.0}}]', 3, "X_u, X_abs_u_u, X_mu"),
    ('robust = "worst"\nprior_samples = 3\nmost_s = {acceleration = 1e-13}', 3, "X_u"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("design", "status", "words"), CASES)
def test_limits_end_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], design: str, status: int, words: str
) -> None:
    path = write_scenario(tmp_path)
    spoil(tmp_path / "dictionary.toml", "[0.5, 1.1]", "[0.5, 0.4]")
    spoil(path, "fixed_parameters = []", 'fixed_parameters = ["W_abs_u_u"]')
    spoil(path, 'criterion = "D"', design if "criterion" in design else f'criterion = "D"\n{design}')
    assert main(["durations", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == status
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == (status != 0)
    assert all(words in line for line in lines)
