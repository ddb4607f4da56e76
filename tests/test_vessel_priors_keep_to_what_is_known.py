"""Vessels drawn from a prior keep to the least and most values that are known to hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

from design_case import spec
from expdesign.dictionary import build_primitive
from expdesign.errors import InputError
from expdesign.plan.runs import dispersion_m
from expdesign.scenario import load_vessel
from expdesign.simulation import CALM
from expdesign.vessel import VesselModel
from step_case import GUESS


def one_uncertain(std: float, **ends: tuple[float, float]) -> VesselModel:
    """The fast craft's model with the surge damping alone uncertain."""
    model = load_vessel(GUESS).model
    stds = np.array([std if name == "X_u" else 0.0 for name in model.names])
    return replace(model, parameter_std=stds, parameter_range=ends)


def test_draws_are_of_the_truncated_normal_distribution() -> None:
    model, count = one_uncertain(0.06, X_u=(-np.inf, 0.0)), 20_000
    drawn = model.drawn_parameters(count, np.random.default_rng(1))[:, model.names.index("X_u")]
    mean = model.parameters[model.names.index("X_u")]
    truncated = scipy.stats.truncnorm(-np.inf, -mean / 0.06, loc=mean, scale=0.06)
    assert len(drawn) == count
    assert scipy.stats.kstest(drawn, truncated.cdf).pvalue > 0.001
    share = scipy.stats.norm.cdf(-mean / 0.06)
    assert model.share_in_range() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 2500))


def test_a_prior_without_range_is_drawn_as_before() -> None:
    model = replace(load_vessel(GUESS).model, parameter_range={})
    normal = np.random.default_rng(2).standard_normal((5, len(model.names)))
    drawn = model.drawn_parameters(5, np.random.default_rng(2))
    assert drawn == pytest.approx(model.parameters + model.parameter_std * normal)
    assert model.share_in_range() == 1.0


def test_a_range_that_contradicts_the_prior_is_refused() -> None:
    with pytest.raises(InputError, match="state less uncertainty, or values inside"):
        one_uncertain(0.01, X_u=(0.0, 1.0)).drawn_parameters(10, np.random.default_rng(0))


def test_no_fast_craft_of_its_prior_runs_away() -> None:
    vessel = load_vessel(GUESS)
    run = build_primitive(vessel, spec("rudder_steps", duration_s=60.0, speed_mps=5.0, steps=1.0, helm_rad=0.35))
    room_m = dispersion_m(
        vessel, run, CALM, centres_m=np.zeros(1), confidence=0.999, rng=np.random.default_rng(3), draws=2000
    )
    assert np.isfinite(room_m).all()


def test_a_covariance_given_to_a_model_is_its_prior_and_others_are_known() -> None:
    model = replace(load_vessel(GUESS).model, parameter_range={})
    rng = np.random.default_rng(44)
    names = [model.names[place] for place in (3, 0, 2, 1)]
    factor = rng.standard_normal((4, 4))
    factor[2] = 0.0  # one of them is known
    covariance = factor @ factor.T
    prior = model.with_covariance(names, covariance)
    places = [model.names.index(name) for name in names]
    expected = np.zeros((len(model.names),) * 2)
    expected[np.ix_(places, places)] = covariance
    assert prior.parameter_covariance == pytest.approx(expected, abs=1e-12)
    assert all(one != other and value for (one, other), value in prior.parameter_correlation.items())
    assert len(prior.parameter_correlation) == 3  # each pair of the three uncertain ones once
    drawn = prior.drawn_parameters(20_000, rng)
    spread = np.cov(drawn.T)
    errors = np.sqrt((np.outer(expected.diagonal(), expected.diagonal()) + expected**2) / len(drawn))
    assert (np.abs(spread - expected) <= 4.5 * errors + 1e-20).all()


@pytest.mark.parametrize("std", [0.06, 2.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_range_is_contradicted_three_standard_deviations_outside_of_it(std: float, side: int) -> None:
    model = one_uncertain(std)
    value, other = float(model.parameters[model.names.index("X_u")]), model.names[-1]
    for deviations, contradicted in ((-10.0, False), (0.0, False), (2.99, False), (3.01, True)):
        end = value + side * deviations * std
        own = (end, end + 100.0) if side > 0 else (end - 100.0, end)
        ranged = replace(model, parameter_range={"X_u": own, other: (-1e9, 1e9)})
        assert ranged.contradicted_ranges == (("X_u",) if contradicted else ())
        assert list(ranged.with_kept_ranges().parameter_range) == ([] if contradicted else ["X_u"]) + [other]
