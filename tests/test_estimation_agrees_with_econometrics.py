"""An independent oracle: single-output IV, LS and their robust covariances as econometric packages compute them."""

from functools import cache

import numpy as np
import pytest

from expdesign.estimation.regression.regression import single_output
from expdesign.estimation.solve.solution import Weighting, solve_iv, solve_ls


@cache
def linearmodels():
    return pytest.importorskip("linearmodels.iv")  # takes a second, not of every worker


@cache
def statsmodels():
    return pytest.importorskip("statsmodels.api")


NAMES = ("a", "b", "c")


def errors_in_variables_case():
    """Noisy regressors, correlated instruments, coloured and heteroscedastic residuals."""
    rng = np.random.default_rng(11)
    k = 700
    Z = np.cumsum(rng.normal(size=(k, 3)), axis=0) * 0.1 + rng.normal(size=(k, 3))
    e = rng.normal(size=k) * (1 + 0.5 * np.abs(Z[:, 0]))
    e = e - 0.6 * np.r_[0, e[:-1]]
    Phi = Z @ rng.normal(size=(3, 3)) + rng.normal(size=(k, 3)) + 0.5 * e[:, None]
    return Z, Phi, Phi @ np.array([1.0, -0.5, 2.0]) + e


@pytest.mark.parametrize(("ours", "debiased"), [("hc0", False), ("hc1", True)])
def test_iv_and_its_heteroscedasticity_robust_covariance(ours: str, debiased: bool) -> None:
    Z, Phi, y = errors_in_variables_case()
    theirs = linearmodels().IV2SLS(y, None, Phi, Z).fit(cov_type="robust", debiased=debiased)
    mine = solve_iv(single_output(Phi, y, parameters=NAMES), Z[:, None, :], Weighting(covariance=ours))
    np.testing.assert_allclose(mine.values, theirs.params, rtol=1e-6)
    np.testing.assert_allclose(mine.covariance, theirs.cov, rtol=1e-6)


@pytest.mark.parametrize("kernel", ["bartlett", "parzen"])
@pytest.mark.parametrize("lags", [1, 6, 40])
def test_iv_and_its_autocorrelation_robust_covariance(kernel: str, lags: int) -> None:
    Z, Phi, y = errors_in_variables_case()
    theirs = linearmodels().IV2SLS(y, None, Phi, Z).fit(cov_type="kernel", kernel=kernel, bandwidth=lags, debiased=True)
    weighting = Weighting(covariance="kernel", kernel=kernel, lags=lags)
    mine = solve_iv(single_output(Phi, y, parameters=NAMES), Z[:, None, :], weighting)
    np.testing.assert_allclose(mine.covariance, theirs.cov, rtol=1e-6, atol=1e-12)


def test_zero_mean_instruments_are_a_constant_regressor() -> None:
    """Lemma 7.1 against somebody else's code."""
    Z, Phi, y = errors_in_variables_case()
    theirs = linearmodels().IV2SLS(y + 3, np.ones((len(y), 1)), Phi + 1, Z).fit(cov_type="robust")
    regression = single_output(Phi + 1, y + 3, parameters=NAMES)
    mine = solve_iv(regression, Z[:, None, :], Weighting(mean="complete", covariance="hc0"))
    np.testing.assert_allclose(mine.values, theirs.params.to_numpy()[1:], rtol=1e-6)
    np.testing.assert_allclose(mine.covariance, theirs.cov.to_numpy()[1:, 1:], rtol=1e-6)


def test_instrument_blocks_per_batch_are_two_stage_least_squares() -> None:
    Z, Phi, y = errors_in_variables_case()
    batch = np.repeat([0, 1], [300, 400])
    blocks = np.concatenate([Z * (batch == number)[:, None] for number in (0, 1)], axis=1)
    theirs = linearmodels().IV2SLS(y, None, Phi, blocks).fit(cov_type="robust")
    mine = solve_iv(
        single_output(Phi, y, parameters=NAMES, batch=batch), Z[:, None, :], Weighting(blocks="batch", covariance="hc0")
    )
    np.testing.assert_allclose(mine.values, theirs.params, rtol=1e-6)
    np.testing.assert_allclose(mine.covariance, theirs.cov, rtol=1e-6)


@pytest.mark.parametrize("lags", [0, 8])
def test_least_squares_and_newey_west(lags: int) -> None:
    _, Phi, y = errors_in_variables_case()
    options = {"maxlags": lags, "use_correction": True}
    theirs = statsmodels().OLS(y, Phi).fit(cov_type="HAC", cov_kwds=options)
    mine = solve_ls(
        single_output(Phi, y, parameters=NAMES), Weighting(covariance="kernel", kernel="bartlett", lags=lags)
    )
    np.testing.assert_allclose(mine.values, theirs.params, rtol=1e-6)
    np.testing.assert_allclose(mine.covariance, theirs.cov_params(), rtol=1e-6)
