"""Where simulated trials differ from predictions, the page says which assumption does not hold."""

import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from design_case import example_dictionary, vessel
from expdesign.estimation.methods import METHODS
from expdesign.export import estimate_page
from expdesign.export.document import Table
from expdesign.export.validation_page import DRAWS, biased, informative_s, judgements, off_theory, surely_biased
from expdesign.rehearsal.validation import Rehearsal, Validated, random_runs, validate
from expdesign.simulation import CALM, Environment
from expdesign.vessel import Sensors, Vessel

CURRENT = Environment(current_to=np.array([0.2, 0.0]))
WIND = Environment(wind_to=np.array([3.0, 2.0]))


def rehearsal(**changes: object) -> Rehearsal:
    """The model ship, whose true and nominal models have the same terms."""
    first = Rehearsal(
        truth=vessel("model-ship-true"),
        nominal=vessel("model-ship"),
        primitives=example_dictionary("model-ship"),
        designs={"optimised": (1,) * 11},
        total_s=412.5,
        environment=CALM,
        parameters=vessel("model-ship").model.names,
        integrator="euler",
        trials=400,
    )
    return replace(first, **changes)


def without_cross_force() -> Vessel:
    """The true model ship without the force of sway times yaw rate."""
    ship = vessel("model-ship-true")
    kept = [index for index, name in enumerate(ship.model.names) if name != "X_vr"]
    model = replace(
        ship.model,
        terms=tuple(ship.model.terms[index] for index in kept),
        parameters=ship.model.parameters[kept],
        parameter_std=ship.model.parameter_std[kept],
    )
    return replace(ship, model=model)


def told(plan: Rehearsal, *, spread: float, noisy: tuple[str, ...] = ()) -> str:
    """Judgements on trials whose spread is so many times the predicted one."""
    truth, p = vessel("model-ship-true").model.parameters, len(plan.parameters)
    draws = np.random.default_rng(0).standard_normal((400, p))
    draws = (draws - draws.mean(axis=0)) / draws.std(axis=0, ddof=1)
    result = Validated(
        design="optimised",
        parameters=plan.parameters,
        truth=truth,
        estimates=truth + spread * draws,
        stated=np.full((400, p), spread),
        forecast=np.ones(p),
        theory=np.ones(p),
        failed=0,
    )
    return " ".join(judgements(plan, (result,), noisy_moduli=noisy))


def test_where_predictions_hold_no_assumption_is_blamed():
    said = told(rehearsal(environment=CURRENT, integrator="rk4"), spread=1.0, noisy=("tau01",))
    assert "every observed standard deviation is within 10 % of the predicted one" in said
    assert "ssumption" not in said


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"environment": CURRENT}, "no current and wind. Method iv removes only a constant"),
        ({"environment": WIND}, "--method iv-air, iv-wind or iv-augmented accounts for weather"),
        ({"environment": CURRENT, "method": "iv-air"}, "no current. Method iv-air accounts for measured wind only"),
        ({"environment": WIND, "method": "iv-current"}, "iv-air-current also for measured wind"),
        (
            {"environment": CURRENT, "method": "oe"},
            "--method oe-air accounts for weather, oe-current for a steady current",
        ),
        ({"method": "iv-wind"}, "the current known. Method iv-wind estimates additional parameters"),
        ({"method": "iv-augmented"}, "current and wind known. Method iv-augmented estimates additional parameters"),
        ({"method": "ls"}, "the regressors have no noise"),
        ({"integrator": "rk4"}, "--integrator euler removes this difference"),
        (
            {"environment": Environment(wind_std_mps=1.0), "method": "iv-air"},
            "Here the weather of each trial is random",
        ),
        ({"truth": without_cross_force()}, "the model has the terms of the true ship"),
    ],
)
def test_each_assumption_that_fails_is_named(changes: dict[str, object], words: str):
    said = told(rehearsal(**changes), spread=1.5)
    assert "predicted and observed standard deviations differ for X_u" in said
    assert words in said


@pytest.mark.parametrize("method", [method.name for method in METHODS])
@pytest.mark.parametrize("environment", [CURRENT, WIND, Environment(current_std_mps=0.1, wind_std_mps=1.0)])
def test_methods_that_are_advised_are_methods(method: str, environment: Environment):
    said = told(rehearsal(environment=environment, method=method), spread=1.5)
    advised = re.findall(r"\b(?:ls|iv|oe)(?:-[a-z]+)*\b", said)
    assert set(advised) <= {item.name for item in METHODS}
    assert "; --method  " not in said
    assert ";  also" not in said


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_runs_are_said_to_be_simulated_in_the_measured_wind_where_a_method_uses_it(method, monkeypatch):
    monkeypatch.setattr(estimate_page, "fit_table", lambda found: Table(header=("Run",), rows=[]))
    found = SimpleNamespace(methods=(SimpleNamespace(method=method),))
    assert ("in the measured wind" in estimate_page._fit(found).blocks[0]) is method.weather.wind


def test_moduli_are_named_with_their_primitives():
    assert "The sign may change in tau01, tau09" in told(rehearsal(), spread=1.5, noisy=("tau01", "tau09"))


def test_when_nothing_that_can_be_checked_fails_noise_is_left():
    said = told(rehearsal(), spread=1.5)
    assert "No assumption that can be checked from the files fails" in said
    assert "Assumption that fails" not in said


@pytest.mark.thorough
def test_wind_that_the_method_does_not_know_is_found_and_named():
    """The whole way: trials of the 30 m ship in wind, estimated as if there were none."""
    ship = vessel("azimuth-30m-true")
    names = ("zigzag-steep-speed-1", "turning-circle-starboard", "inward-spiral-speed-0.9", "telegraph-draw-1")
    primitives = tuple(item for item in example_dictionary("standard") if item.name in names)
    plan = Rehearsal(
        truth=replace(ship, sensors=Sensors(velocity_mps=0.002, yaw_rate_radps=0.0005, wind_mps=0.005)),
        nominal=ship,
        primitives=primitives,
        designs={"optimised": (1,) * len(primitives)},
        total_s=900.0,
        environment=WIND,
        parameters=tuple(name for name in ship.model.names if not name.startswith("W_")),
        integrator="euler",
        trials=12,
    )
    said = " ".join(judgements(plan, validate(plan), noisy_moduli=()))
    assert "the bias exceeds half a standard deviation" in said
    assert "no current and wind. Method iv removes only a constant" in said


def drawn(trials: int, seed: int, *, bias: float = 0.0, spread: float = 1.0) -> Validated:
    """Estimates of ten parameters around the truth, in units of their predicted standard deviations."""
    estimates = bias + spread * np.random.default_rng(seed).standard_normal((trials, 10))
    return Validated(
        design="optimised", parameters=tuple(f"p{number}" for number in range(10)), truth=np.zeros(10),
        estimates=estimates, stated=np.ones((trials, 10)), forecast=np.ones(10), theory=np.ones(10), failed=0,
    )  # fmt: skip


@pytest.mark.parametrize("trials", [2, 3, 5, 10, 100])
def test_few_trials_of_a_right_prediction_are_seldom_called_off_or_biased(trials: int):
    seeds, allowed = 1000, 0.02  # 1 % each of wrong standard deviations and of biases
    found = map(partial(drawn, trials), range(seeds))
    called = [bool(surely_biased(item) or off_theory(item) or biased(item)) for item in found]
    assert np.mean(called) < allowed + 3.0 * np.sqrt(allowed * (1.0 - allowed) / seeds)


def test_a_wrong_prediction_is_noticed_by_enough_trials():
    assert len(off_theory(drawn(400, 1, spread=1.5))) == 10
    assert len(off_theory(drawn(400, 1, spread=0.6))) == 10
    assert len(biased(drawn(400, 1, bias=1.0))) == 10
    assert len(surely_biased(drawn(400, 1, bias=0.5))) == 10


@pytest.mark.parametrize("longer", [1, 2, 3])
def test_designs_of_other_lengths_are_compared_in_equal_time(longer: int):
    """Equal shares have at least one run of each manoeuvre, up to half as long again; variances fall as time grows."""
    plan = rehearsal(designs={"optimised": (1,) * 11, "equal shares": (longer,) * 11})
    best, other = (
        replace(one, design=name, truth=np.ones(10), estimates=1.0 + one.estimates)
        for one, name in ((drawn(400, 1), "optimised"), (drawn(400, 2, spread=longer**-0.5), "equal shares"))
    )
    said, *_ = judgements(plan, (best, other), noisy_moduli=())
    found = re.search(r"in ([0-9.]+) times its time, so about ([0-9.]+) times in equal time", said)
    assert (found is None) == (longer == 1)
    if found:
        assert float(found[1]) == longer
        assert float(found[2]) == pytest.approx(1.0, abs=0.05)  # 4.5 standard errors of ten parameters in 400 trials


def test_random_designs_last_as_long_as_is_told():
    plan = rehearsal(designs={"random": None}, total_s=400.0, primitives=example_dictionary("standard"))
    durations_s = np.array([one.duration_s for one in plan.primitives])
    rng = np.random.default_rng(0)
    spent = np.array([np.dot(random_runs(plan, rng), durations_s) for _ in range(2000)])
    told_s = informative_s(plan, replace(drawn(2, 0), design="random"))
    assert abs(spent.mean() - told_s) <= 4 * spent.std() * np.sqrt(1 / len(spent) + 1 / DRAWS)


@pytest.mark.parametrize(("times", "kind"), [(0.6, "narrow"), (1.0, ""), (2.3, "wide")])
def test_an_estimator_whose_own_errors_are_not_those_observed_is_told(times: float, kind: str):
    result = replace(drawn(100, 3), stated=np.full((100, 10), times))
    said = [text for text in judgements(rehearsal(), (result,), noisy_moduli=()) if "that the estimator states" in text]
    assert len(said) == bool(kind)
    assert all(f"intervals are too {kind}" in text for text in said)
