"""Fits of factors beside the uncertain parameters that they multiply end at the best of their narrow, bent valley."""

import numpy as np
import pytest

from diagnosis_case import Told, drawn_parameters, hidden_record, vessel_of
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import gauss_newton, with_longer_windows
from expdesign.diagnosis.fit.fit import FitOptions, after_step
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.model.terms import term_factors
from expdesign.diagnosis.motion import fitted_start, stable_windows
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select import forward_selection
from expdesign.diagnosis.select.forward_selection import fit_nuisance
from expdesign.diagnosis.vessel_file.reading import extended_model


@pytest.mark.parametrize("ship", ["tug", "barge", "coaster"])
def test_a_step_takes_products_straight_on(ship):
    """Every parameter times its factors changes by exactly what is linear in the step, however large that is."""
    extended = extended_model(vessel_of(ship, relative_std=0.1), hidden_record(ship, seed=1, batches=1, samples=60))
    names = extended.model.names
    rng = np.random.default_rng(0)
    size = np.abs(extended.model.parameters)
    keys = ("gain", "inertia:v", *(f"theta:{name}" for name in names))
    extended = extended.with_effects(
        dict(zip(keys, [0.2, -0.1, *(0.1 * size * rng.standard_normal(len(size)))], strict=True))
    )
    step = np.array([-0.4, 0.3, *(0.1 * size * rng.standard_normal(len(size)))])

    def products(effects):
        whole = [value + effects[f"theta:{name}"] for name, value in zip(names, extended.model.parameters, strict=True)]
        factors = term_factors(extended.model, effects)
        return np.array(whole) * np.array([factors[name] for name in names])

    before = {key: extended.get(key) for key in keys}
    along = {key: before[key] + 1e-7 * value for key, value in zip(keys, step, strict=True)}
    slope = (products(along) - products(before)) / 1e-7
    after = after_step(extended, keys, step)
    assert after["gain"] == pytest.approx(-0.2)
    assert products(after) - products(before) == pytest.approx(slope, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize(("key", "hidden", "truth"), [("gain", "gain", -0.2), ("inertia:v", "load_v", 0.4)])
def test_factors_beside_uncertain_parameters_end_where_they_end_from_elsewhere(key, hidden, truth):
    record = hidden_record("barge", seed=3, batches=3, samples=150, effects={hidden: truth}, relative_std=0.05)
    extended = extended_model(vessel_of("barge", relative_std=0.05), record)
    windows = cut_windows(extended.model, record)
    base = fit_nuisance(extended, windows, initial_states(windows))
    found = fit(base.ship, windows, (key,), starts=base.starts, options=FitOptions(noise=base.noise))
    other = fit(
        extended.with_effects({key: truth}),
        windows,
        (key,),
        starts=initial_states(windows),
        options=FitOptions(noise=base.noise, steps=20),
    )
    assert found.converged
    assert abs(found.value(key) - other.value(key)) < 0.3 * found.std(key)
    assert abs(found.value(key) - truth) < 3 * found.std(key)


def test_a_share_of_a_step_is_taken_only_where_it_lowers_the_cost(monkeypatch):
    """Weights depend on the effects, so that near the end whole steps and all shares of them may raise the cost."""
    searched, steps = gauss_newton._line_search, []

    def noted(problem, best):
        ahead, tries = searched(problem, best)
        steps.append((best.cost, None if ahead is None else ahead.cost, tries))
        return ahead, tries

    monkeypatch.setattr(gauss_newton, "_line_search", noted)
    record = hidden_record("tug", seed=3, batches=3, samples=150, relative_std=0.1)
    extended = extended_model(vessel_of("tug", relative_std=0.1), record)
    windows = cut_windows(extended.model, record)
    fit(extended, windows, (), starts=initial_states(windows))
    assert steps[-1][1] is None  # no share of the last one lowers it
    assert all(after <= before for before, after, tries in steps if after is not None and tries > 1)


FAR = [
    ("coaster", {"N_r": 0.6}, 3), ("coaster", {"N_r": 0.7, "Y_v": 0.8}, 3),
    *(pytest.param(ship, {"N_r": 0.6}, seed, marks=pytest.mark.thorough)
      for ship, seed in (("coaster", 1), ("coaster", 2), ("barge", 1), ("barge", 3), ("tug", 1))),
]  # fmt: skip
"""Ship, factors of parameters, seed."""


def test_where_another_beginning_runs_away_the_first_answer_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before any cause is tested; one such beginning ended a diagnosis of measured runs that had an answer."""
    record = hidden_record("barge", seed=3, batches=2, samples=150, relative_std=0.1)
    ship = extended_model(vessel_of("barge", relative_std=0.1), record)
    windows = stable_windows(ship, record)
    away = ship.with_effects({"theta:X_u": 5.0})
    with pytest.raises(FloatingPointError):
        fit(away, windows, (), starts=fitted_start(away, windows))
    best = fit_nuisance(ship, windows, fitted_start(ship, windows))
    monkeypatch.setattr(forward_selection, "nearer_in_short_windows", lambda *_: away)
    found = fit_nuisance(ship, windows, fitted_start(ship, windows))
    assert found.deviance < best.deviance + 2.0


@pytest.mark.parametrize(("ship", "factors", "seed"), FAR)
def test_a_model_that_is_far_from_the_ship_is_fitted_as_well_as_one_that_begins_at_the_truth(
    ship: str, factors: dict[str, float], seed: int
) -> None:
    """Before any cause is tested: else causes have to explain what is left. Deviances are twice a log likelihood."""
    record = hidden_record(
        ship, seed=seed, factors=factors, relative_std=0.1, batches=4, samples=300, manoeuvre="zigzag"
    )
    vessel = vessel_of(ship, relative_std=0.1)
    begun = extended_model(vessel, record)
    begun, windows = with_longer_windows(begun, record, stable_windows(begun, record))
    found = fit_nuisance(begun, windows, fitted_start(begun, windows))
    told = drawn_parameters(ship, Told(factors=factors, relative_std=0.1), np.random.default_rng(seed))
    rows = zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True)
    true = begun.with_effects({f"theta:{name}": told[name] - value for name, value in rows})
    best = fit(true, windows, (), starts=fitted_start(true, windows), options=FitOptions(steps=12))
    assert found.deviance < best.deviance + 2.0
