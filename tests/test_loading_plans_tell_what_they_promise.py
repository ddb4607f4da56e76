"""Load plans: information is the weighted least-squares one, open directions are refused, files are taken on."""

import json
import types
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS
from expdesign.dictionary import build_dictionary
from expdesign.durations import Aim
from expdesign.errors import InputError, NoAnswer, NotInformative
from expdesign.loading import LoadPlan, Question, build_question, choose_loads, run_information
from expdesign.roll import coefficients
from expdesign.scenario import load_cases, load_dictionary, load_repeats
from expdesign.signals import AUXILIARY
from expdesign.simulation import rudder_angle, simulate
from expdesign.vessel import NOMINAL, Load, Sensors, Vessel
from expdesign.workflows import roll_plan
from rolling_ship import GUESS, HIGH, ROLL_MODEL, UNDER_WAY, error_and_bound, roll_model, steps

SHIP = roll_model()
LOW = Load(mass_kg=2.0, z_m=0.1)
SCENARIO = SCENARIOS / "roll-trial.toml"
CANDIDATES = SCENARIOS / "loads" / "roll-trial.toml"


def asked(*loads: Load | None, ship: Vessel = SHIP) -> Question:
    return build_question(ship, loads, known={}, guess=GUESS)


def test_information_under_white_equation_noise_is_that_of_least_squares() -> None:
    """With noise of the accelerometer alone the equation's noise is white: x^T x over its variance."""
    ship = replace(SHIP, sensors=Sensors(roll_rate_radps=1e-12, acceleration_mps2=0.01))
    question, run = asked(NOMINAL, ship=ship), steps(SHIP)
    sailed = simulate(ship, run.commands, velocity=UNDER_WAY)
    assert sailed.auxiliary is not None
    rate, angle, reading = (
        sailed.auxiliary[:-1, AUXILIARY.index(name)] for name in ("roll_rate_radps", "roll_rad", "imu_lateral_mps2")
    )
    x = np.column_stack([rate, angle, reading, -sailed.velocity[:-1, 2], -rudder_angle(ship, run.commands)])
    x = x - x.mean(axis=0)
    assert ship.pendulum is not None
    found = coefficients(question.theta, ship.pendulum.body, NOMINAL)
    exact = found.jacobian.T @ (x.T @ x) @ found.jacobian / (found.values[2] * 0.01) ** 2
    got = run_information(ship, question.theta, question.options[0], [run])[0]
    np.testing.assert_allclose(got, exact, rtol=1e-6, atol=1e-9 * np.abs(exact).max())


def test_noise_that_is_twice_as_large_leaves_a_quarter_of_the_information() -> None:
    noisy = replace(SHIP.sensors, roll_rate_radps=0.004, acceleration_mps2=0.02, yaw_rate_radps=0.004)
    question, run = asked(NOMINAL), steps(SHIP)
    one, other = (
        run_information(ship, question.theta, question.options[0], [run])[0]
        for ship in (SHIP, replace(SHIP, sensors=noisy))
    )
    np.testing.assert_allclose(other, one / 4, rtol=1e-9, atol=1e-12 * np.abs(one).max())


@pytest.mark.parametrize("second", [None, Load(mass_kg=0.8, z_m=HIGH.z_m)])
def test_one_height_leaves_a_combination_open_and_it_is_named(second: Load | None) -> None:
    """Rank 8 of 9 with one known load, and with two at the same height; a weight low down is the cure."""
    loads = [load for load in (NOMINAL, HIGH, second) if load is not None]
    with pytest.raises(NotInformative, match=r"load determines 1 combination .* together: .*k .*; what would"):
        choose_loads(asked(*loads, None), [steps(SHIP)], total_s=100.0)
    plan = choose_loads(asked(*loads, LOW, None), [steps(SHIP)], total_s=100.0)
    assert plan.chosen.smallest > 1e-3


@pytest.fixture(scope="module")
def plan() -> LoadPlan:
    runs = build_dictionary(SHIP, load_dictionary(SCENARIOS / "dictionaries" / "roll-model.toml"))
    return choose_loads(asked(NOMINAL, HIGH, Load(mass_kg=0.4, z_m=-0.05), LOW, None), runs, total_s=240.0)


@pytest.mark.thorough
def test_the_certificate_bounds_every_other_share_of_time(plan: LoadPlan) -> None:
    """No share of random designs is better by more than the gap, and equal shares are worse."""
    problem, rng = plan.design.problem, np.random.default_rng(1)
    shares = rng.dirichlet(np.full(len(problem.names), 0.1), size=50)
    values = [np.linalg.slogdet(problem.prior + np.einsum("q,qij->ij", w, problem.matrices))[1] for w in shares]
    assert max(values) < plan.design.log_det + plan.design.gap
    assert 0 <= plan.design.gap < 1e-6


def test_fewer_loads_never_tell_more(plan: LoadPlan) -> None:
    found = [step.efficiency for step in plan.steps]
    assert found[0] == 1.0
    assert all(later <= earlier + 1e-6 for earlier, later in pairwise(found))
    counts = [len(step.options) for step in plan.steps]
    assert counts == list(range(counts[0], counts[0] - len(counts), -1))
    assert plan.chosen is [step for step in plan.steps if step.efficiency >= 0.9][-1]


def test_a_trial_that_is_planned_leaves_less_uncertainty_than_the_prior(plan: LoadPlan) -> None:
    assert (plan.std_after < plan.std_before).all()


def test_interest_in_the_load_tells_the_load_better() -> None:
    runs, question = [steps(SHIP, seed=1), steps(SHIP, seed=2)], asked(NOMINAL, HIGH, LOW, None)
    aim = Aim(criterion="D_s", interest=("m", "z_m"))
    volume, load = (choose_loads(question, runs, total_s=2000.0, aim=one) for one in (Aim(), aim))

    def of_load(found: LoadPlan) -> float:
        """Log volume of m and z_m by the shares, before whole runs."""
        problem = found.design.problem
        told = problem.prior + np.einsum("q,qij->ij", found.design.fractions, problem.matrices)
        return float(np.linalg.slogdet(np.linalg.inv(told)[-2:, -2:])[1])

    assert of_load(load) < of_load(volume)


def test_what_cannot_be_asked_is_one_line() -> None:
    with pytest.raises(InputError, match=r"start\.m is missing, expected a rough m of the unknown load"):
        build_question(SHIP, [None], known={}, guess={})
    with pytest.raises(InputError, match=r"start\.m is -0\.4, expected more than 0"):
        build_question(SHIP, [None], known={}, guess={"m": -0.4, "z_m": -0.2})
    with pytest.raises(InputError, match=r"a load has 30 kg, expected less than the ship's own 22\.04 kg"):
        asked(NOMINAL, Load(mass_kg=30.0, z_m=0.05))
    with pytest.raises(
        InputError, match=r"a load of 0\.4 kg is at height -3 m, expected within the length of the ship"
    ):
        asked(NOMINAL, Load(mass_kg=0.4, z_m=3.0))
    with pytest.raises(InputError, match=r"two candidate loads are the same, the ship alone"):
        asked(NOMINAL, NOMINAL)
    with pytest.raises(InputError, match=r"has no table \[roll\]"):
        asked(NOMINAL, ship=replace(SHIP, pendulum=None))
    quiet, heavy = replace(SHIP, sensors=Sensors()), asked(Load(mass_kg=4.0, z_m=-0.3))
    with pytest.raises(InputError, match=r"sensors without noise"):
        run_information(quiet, heavy.theta, heavy.options[0], [])
    with pytest.raises(NotInformative, match=r"does not stay upright: her metacentric height is -"):
        run_information(SHIP, heavy.theta, heavy.options[0], [])


def small(folder: Path) -> tuple[Path, Path]:
    """The scenario with two manoeuvres, and four candidate loads."""
    head, first, second = (SCENARIOS / "dictionaries" / "roll-model.toml").read_text().split("[[primitives]]")[:3]
    (folder / "turns.toml").write_text("[[primitives]]".join([head, first, second]))
    text = SCENARIO.read_text().replace("dictionaries/roll-model.toml", "turns.toml")
    (folder / "trial.toml").write_text(
        text.replace('"vessels/', f'"{SCENARIOS}/vessels/').replace('"areas/', f'"{SCENARIOS}/areas/')
    )
    parts = CANDIDATES.read_text().split("[[load]]")
    (folder / "candidates.toml").write_text("[[load]]".join(parts[place] for place in (0, 1, 3, 5, 6)))
    return folder / "trial.toml", folder / "candidates.toml"


@pytest.mark.thorough
def test_the_command_writes_what_plan_and_roll_read(tmp_path: Path) -> None:
    scenario, candidates = small(tmp_path)
    outcome = roll_plan(scenario, tmp_path / "out", loads=candidates)
    found = json.loads((tmp_path / "out" / "roll-plan.json").read_text())["load_cases"]
    runs = {f"durations-{number}.json" for number in range(1, len(found) + 1)}
    assert {path.name for path in outcome.files} == {"roll-plan.json", "roll-plan.html", "loads.toml", *runs}
    cases = load_cases(tmp_path / "out" / "loads.toml", SHIP)
    assert [load is None for load in cases.loads] == [case["unknown"] for case in found]
    known = [case["mass_kg"] for case in found if not case["unknown"]]
    assert [load.mass_kg for load in cases.loads if load is not None] == known
    names = [item.name for item in build_dictionary(SHIP, load_dictionary(tmp_path / "turns.toml"))]
    for number, case in enumerate(found, start=1):
        repeats = load_repeats(tmp_path / "out" / f"durations-{number}.json", names=names)
        assert dict(zip(names, repeats, strict=True)) == {**dict.fromkeys(names, 0), **case["runs"]}


@pytest.mark.thorough
def test_work_that_takes_too_long_is_given_up_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clock that jumps where the runs of the first load case are placed; with no time at all nothing is begun."""
    scenario, candidates = small(tmp_path)
    said: list[str] = []
    clock = types.SimpleNamespace(monotonic=lambda: 3600.0 * any("measuring the water" in one for one in said))
    monkeypatch.setattr("expdesign.progress.time", clock)
    with pytest.raises(
        NoAnswer, match=r"^--minutes 20 are over, and placing runs, load case 1: .* is still to be done; expected more"
    ):
        roll_plan(
            scenario, tmp_path / "out", loads=candidates, place=True, minutes=20.0,
            progress=lambda what, _: said.append(what),
        )  # fmt: skip
    with pytest.raises(InputError, match=r"--minutes is 0, expected more than 0"):
        roll_plan(scenario, tmp_path / "out", loads=candidates, minutes=0.0)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_every_load_case_has_cards_that_name_its_load_and_the_same_runs_are_planned_once(tmp_path: Path) -> None:
    """A ship with samples of 0.1 s and five load cases of one run each."""
    scenario, candidates = small(tmp_path)
    (tmp_path / "ship.toml").write_text(ROLL_MODEL.read_text().replace("sample_time_s = 0.02", "sample_time_s = 0.1"))
    text = scenario.read_text().replace(str(SCENARIOS / "vessels" / "roll-model.toml"), "ship.toml")
    scenario.write_text(text.replace("total_s = 240.0", "total_s = 80.0"))
    said: list[str] = []
    outcome = roll_plan(
        scenario, tmp_path / "out", loads=candidates, place=True, progress=lambda what, _: said.append(what)
    )
    cases = json.loads((tmp_path / "out" / "roll-plan.json").read_text())["load_cases"]
    for number, case in enumerate(cases, start=1):
        folder = tmp_path / "out" / f"case-{number}"
        assert f"load case {number}: {case['name']}" in (folder / "cards.html").read_text()
        assert f"--durations {tmp_path / 'out' / f'durations-{number}.json'}" in (folder / "report.html").read_text()
        assert folder / "commands.csv" in outcome.files
    runs = {json.dumps(case["runs"], sort_keys=True) for case in cases}
    assert len(runs) < len(cases)
    assert sum(what.startswith("sailing to the goal, load case") for what in said) == len(runs)


@pytest.mark.thorough
@pytest.mark.parametrize("seeds", [range(101, 103), pytest.param(range(201, 221), marks=pytest.mark.slow)])
def test_estimates_scatter_no_less_than_the_bound(seeds: range) -> None:
    """Mean squares of p errors over n seeds are 1 or more, but for three standard errors sqrt(2 / (n p))."""
    found = np.array([np.divide(*error_and_bound(SHIP, seed)) for seed in seeds])
    assert np.mean(found**2) > 1 - 3 * np.sqrt(2 / found.size)
    assert np.sqrt(np.mean(found**2)) < 5  # the estimate by instruments reaches a good part of the bound


def test_ship_file_is_the_one_of_the_scenario() -> None:
    assert f'vessel = "vessels/{ROLL_MODEL.name}"' in SCENARIO.read_text()
