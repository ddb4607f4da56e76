"""Every key of [design] changes the problem as it says, or is refused with its place."""

from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.durations import DurationProblem
from expdesign.errors import FileError
from expdesign.scenario import load_scenario
from scenario_files import spoil, write_scenario

NAMES = ("acceleration", "zz-speed-0.5", "zz-speed-0.4")


def problem(folder: Path, *lines: str) -> DurationProblem:
    path = write_scenario(folder)
    spoil(path, 'criterion = "D"', "\n".join(lines) or 'criterion = "D"')
    spoil(path, "fixed_parameters = []", 'fixed_parameters = ["W_abs_u_u"]')
    spoil(folder / "dictionary.toml", "[0.5, 1.1]", "[0.5, 0.4]")
    case = load_scenario(path)
    return workflows.duration_problem(case, workflows.scored(case))


def test_limits_reach_the_problem(tmp_path: Path):
    limits = problem(
        tmp_path, "least_s = {acceleration = 60.0}", "most_s = {acceleration = 90.0}",
        'required = ["acceleration"]', 'excluded = ["zz-speed-0.4"]',
        'budgets = [{name = "energy", limit = 1e6, use = "cubed_propeller_speed"}]',
    ).constraints  # fmt: skip
    assert (dict(limits.least_s), dict(limits.most_s)) == ({"acceleration": 60.0}, {"acceleration": 90.0})
    assert (limits.required, limits.excluded) == (("acceleration",), ("zz-speed-0.4",))
    assert limits.budgets[0].limit == 1e6
    assert set(limits.budgets[0].cost_per_s) == set(NAMES)
    assert min(limits.budgets[0].cost_per_s.values()) > 0


def test_aims_and_priors_reach_the_problem(tmp_path: Path):
    found = problem(
        tmp_path, 'criterion = "A"', 'relative_to = "nominal"', "parameter_units = {X_u = 0.5}", 'interest = ["X_u"]',
        'robust = "worst"', "prior_samples = 3", 'prior = "parameter_std"',
    )  # fmt: skip
    assert found.aim.criterion == "A"
    assert found.aim.interest == ("X_u",)
    assert found.aim.unit.tolist() == [0.5, 0.05, 0.01]  # X_u as given, X_abs_u_u and X_mu as nominal
    # Differences of samples 1 s apart, each with 0.01 m/s of noise.
    np.testing.assert_allclose(found.aim.noise, 0.01 * np.sqrt(2))
    assert len(found.sampled) == 3
    # 600 samples with that noise, and a prior of 0.06 on X_u alone.
    np.testing.assert_allclose(found.prior[0, 0], (0.01 * np.sqrt(2) / 0.06) ** 2 / 600)
    assert not found.prior[1:].any()


WRONG = [
    ('criterion = "D_s"', "design.interest", "is missing"),
    ('criterion = "V"', "design.outcomes", "is missing"),
    ('outcomes = ["advance"]', "design.outcomes[1]", "did you mean 'advance_m'"),
    ('interest = ["X_v"]', "design.interest[1]", "is 'X_v'"),
    ('excluded = ["acc"]', "design.excluded[1]", "is 'acc'"),
    ("least_s = {zz = 1.0}", "design.least_s", "is 'zz'"),
    ("prior_samples = 3", "design.prior_samples", "has no effect"),
    ("balance = 1.0", "design.balance", "is 1"),
    ('budgets = [{name = "wear", limit = 1.0}]', "design.budgets[1]", "needs either"),
    ('required = ["acceleration"]\nexcluded = ["acceleration"]', "design.excluded", "design.required names too"),
    ('predictor = "wind"\nrobust = "average"', "design.predictor", "excludes design.robust"),
    ('prior_data = ["gone.csv"]', "design.prior_data[1]", "does not exist"),
]


@pytest.mark.parametrize(("line", "key", "words"), WRONG)
def test_wrong_settings_are_refused_with_their_place(tmp_path: Path, line: str, key: str, words: str):
    path = write_scenario(tmp_path)
    spoil(path, 'criterion = "D"', line)
    with pytest.raises(FileError) as caught:
        load_scenario(path)
    assert caught.value.key == key
    assert words in str(caught.value)
