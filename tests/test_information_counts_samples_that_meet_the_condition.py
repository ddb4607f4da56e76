"""Designs with `excitation`: only samples count that meet the excitation condition, equation by equation."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.dictionary import build_dictionary
from expdesign.durations import bordered, build_durations, solve_durations
from expdesign.durations.criteria import Aim
from expdesign.errors import NotInformative
from expdesign.information import estimated_parameters, score_primitives
from expdesign.information.excitation import FREE, REQUIRED, REWARDED, kept_runs, strata_of_run, whole_runs
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.information.moments import regressor_rows
from expdesign.scenario import load_scenario, load_vessel
from expdesign.scenario.dictionaries import load_dictionary
from expdesign.simulation import CALM, Environment, delivered, simulate
from expdesign.workflows.steps.design_problem import duration_problem
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

SHIP = load_vessel(SCENARIOS / "vessels/azimuth-30m.toml")
SEA = Environment(current_std_mps=0.05)
NAMES = estimated_parameters(SHIP.model, [name for name in SHIP.model.names if name.startswith("W_")])
FIXED = tuple(name for name in SHIP.model.names if name not in NAMES)


def offset_runs():
    return build_dictionary(SHIP, load_dictionary(SCENARIOS / "dictionaries/offset-azimuth-30m.toml"))[:6]


def scores(excitation: str, mean: str = "complete"):
    return score_primitives(
        SHIP, offset_runs(), environment=SEA, fixed_parameters=FIXED, mean_subtraction=mean, excitation=excitation
    )


@pytest.mark.parametrize("mean", ["none", "batch", "complete"])
def test_information_is_that_of_the_clear_samples_of_each_equation(mean: str) -> None:
    """By hand: regressors of the samples of an equation without their mean on either side of zero."""
    found = scores(REWARDED, mean)
    shares = np.full(len(found), 1 / len(found))
    B = np.tensordot(shares, np.array([bordered(item, mean) for item in found]), axes=1)
    p = len(NAMES)
    information = B[:p, :p] - B[:p, p:] @ np.linalg.pinv(B[p:, p:]) @ B[p:, :p]
    equation = {term.name: term.equation for term in SHIP.model.terms}
    for number, output in enumerate(SHIP.model.outputs):
        chosen = [index for index, name in enumerate(NAMES) if equation[name] == output]
        places = [SHIP.model.names.index(NAMES[index]) for index in chosen]
        expected, groups = np.zeros((len(chosen),) * 2), {}
        for run, item in enumerate(found):
            primitive = item.primitive
            given = delivered(SHIP, primitive.commands, standing=primitive.entry_inputs)
            start, before = primitive.entry_velocity, primitive.entry_inputs
            motion = simulate(SHIP, primitive.commands, velocity=start, standing=before)
            rows = regressor_rows(SHIP.model, motion, given, CALM)[:, places]
            labels = strata_of_run(SHIP, motion, given, SEA, air_measured=True)[number]
            for label in set(labels.tolist()) - {0}:
                key = (label, run if mean == "batch" else 0)
                groups.setdefault(key, []).append(rows[labels == label] / np.sqrt(len(rows) * len(found)))
            expected += rows[labels > 0].T @ rows[labels > 0] / len(rows) / len(found)
        if mean != "none":
            for parts in groups.values():
                whole = np.concatenate(parts)
                weights = np.concatenate([np.full(len(part), 1 / np.sqrt(240 * len(found))) for part in parts])
                assert all(item.primitive.duration_s == 240 for item in found)
                total = weights @ whole
                expected -= np.outer(total, total) / (weights @ weights)
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(
            information[np.ix_(chosen, chosen)] / np.outer(size, size), expected / np.outer(size, size), atol=1e-6
        )


def test_runs_without_a_breach_count_as_they_did() -> None:
    """Without moduli every sample is clear, and all three ways are one."""
    terms = [index for index, item in enumerate(SHIP.model.expressions) if not item.moduli]
    smooth = replace(
        SHIP,
        model=replace(
            SHIP.model,
            terms=tuple(SHIP.model.terms[index] for index in terms),
            parameters=SHIP.model.parameters[terms],
            parameter_std=SHIP.model.parameter_std[terms],
        ),
    )
    ways = [score_primitives(smooth, offset_runs()[:2], excitation=way) for way in (FREE, REWARDED, REQUIRED)]
    for other in ways[1:]:
        for first, second in zip(ways[0], other, strict=True):
            np.testing.assert_allclose(first.X, second.X, rtol=1e-12)
            np.testing.assert_allclose(first.Y, second.Y, rtol=1e-12)
            assert first.log_det_alone == pytest.approx(second.log_det_alone)


def test_a_run_is_kept_where_it_stays_clear_once_it_is() -> None:
    building_up = [0, 0, 2, 2, 2, 2, 0]
    crossing = [2, 2, 2, 0, 1, 1, 1]
    brief = [0, 0, 0, 0, 2, 2, 0]
    throughout = [1] * 7
    found = np.array([building_up, crossing, brief, throughout], dtype=np.int8)
    assert kept_runs(found).tolist() == [True, False, False, True]
    assert whole_runs(found).tolist() == [False, False, False, True]


def test_the_optimum_is_that_of_the_information_and_certified() -> None:
    """No mixture of shares collects more about the parameters than the design, up to its gap."""
    found = scores(REWARDED)
    problem = build_durations(
        found, NAMES, total_s=3600.0, aim=Aim(criterion="D_s", interest=NAMES), excitation=REWARDED
    )
    design = solve_durations(problem)
    p = len(NAMES)

    def value(shares: np.ndarray) -> float:
        B = np.tensordot(shares, problem.matrices, axes=1)
        return float(np.linalg.slogdet(B)[1] - np.linalg.slogdet(B[p:, p:])[1])

    best, rng = value(design.fractions), np.random.default_rng(1)
    assert design.gap < 1e-3
    assert max(value(shares) for shares in rng.dirichlet(np.ones(len(found)), 300)) <= best + design.gap + 1e-9


def test_predicted_covariance_follows_the_samples() -> None:
    """Surge is clear in all samples of the first run, which predicts the same; nothing is predicted from none."""
    run = offset_runs()[0]
    parts = [TrialPart(commands=run.commands, velocity=run.entry_velocity, standing=run.entry_inputs)]
    surge = [name for name in NAMES if name.startswith("X_")]
    free, clear = (expected_covariance(SHIP, parts, surge, environment=SEA, excitation=way) for way in (FREE, REWARDED))
    np.testing.assert_allclose(clear, free, rtol=1e-9)
    sway = [name for name in NAMES if name.startswith("Y_")]
    all_of_them, fewer = (
        expected_covariance(SHIP, parts, sway, environment=SEA, excitation=way) for way in (FREE, REWARDED)
    )
    assert not np.allclose(all_of_them, fewer, rtol=1e-3)
    fast = Environment(current_std_mps=1.0)
    with pytest.raises(NotInformative):
        expected_covariance(SHIP, parts, sway, environment=fast, excitation=REQUIRED)


@pytest.mark.thorough
def test_a_dictionary_without_offset_is_refused_by_name(tmp_path: Path) -> None:
    text = (
        (SCENARIOS / "helsinki-hour.toml")
        .read_text(encoding="utf-8")
        .replace("[design]\n", '[design]\nexcitation = "required"\n')
    )
    text = text.replace('"vessels/', f'"{SCENARIOS}/vessels/').replace('"dictionaries/', f'"{SCENARIOS}/dictionaries/')
    path = tmp_path / "standard.toml"
    path.write_text(text.replace('"areas/', f'"{SCENARIOS}/areas/'), encoding="utf-8")
    case = load_scenario(path)
    with pytest.raises(NotInformative, match=r"dv/dt needs v and v_q, which all lack \(acceleration") as caught:
        duration_problem(case, scored(case))
    assert "Y_abs_v_v" in caught.value.parameters
    path.write_text(text.replace("standard.toml", "offset-azimuth-30m.toml").replace('"areas/', f'"{SCENARIOS}/areas/'))
    case = load_scenario(path)
    problem = duration_problem(case, scored(case))
    assert solve_durations(problem).gap < 1e-3
    assert not any(held["v"] for held in problem.excites)  # runs begin straight; their shares count
