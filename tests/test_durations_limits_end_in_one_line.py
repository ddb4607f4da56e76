"""Limits that cannot be satisfied end `expdesign durations` with one line and its status, never with a traceback."""

import re
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.durations import Budget, Constraints
from expdesign.durations.limits import feasible_set
from expdesign.errors import NoAnswer
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


@pytest.mark.parametrize(
    "limits",
    [
        Constraints(least_s={"a": 412.3456789, "b": 300.0}),
        Constraints(least_s={"a": 580.0}, required=("b",)),
        Constraints(most_s={"a": 123.456789, "b": 34.56, "c": 1.0}),
        Constraints(most_s={"a": 300.0}, excluded=("b", "c")),
    ],
)
def test_the_total_named_for_limits_that_leave_no_durations_leaves_some(limits: Constraints) -> None:
    run_s = np.array([60.0, 90.0, 30.0])
    with pytest.raises(NoAnswer) as caught:
        feasible_set(limits, "abc", run_s=run_s, total_s=600.0)
    total_s = float(re.search(r"with design\.total_s = ([\d.]+) they", str(caught.value))[1])
    assert feasible_set(limits, "abc", run_s=run_s, total_s=total_s).feasible()


def test_the_limit_named_for_a_budget_that_leaves_no_durations_leaves_some() -> None:
    def limits(limit: float) -> Constraints:
        budget = Budget(name="fuel", cost_per_s={"a": 0.7, "b": 0.31, "c": 1.0}, limit=limit)
        return Constraints(budgets=(budget,), least_s={"c": 100.0})

    run_s = np.array([60.0, 90.0, 30.0])
    with pytest.raises(NoAnswer) as caught:
        feasible_set(limits(17.0), "abc", run_s=run_s, total_s=600.0)
    limit = float(re.search(r"with the limit ([\d.]+) there", str(caught.value))[1])
    assert feasible_set(limits(limit), "abc", run_s=run_s, total_s=600.0).feasible()
