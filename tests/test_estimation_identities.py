"""Identities of the estimators: both lemmas, LS as a special IV, scale does not matter, names of what is unseen."""

import numpy as np
import pytest

from expdesign.errors import NotInformative
from expdesign.estimation.regression.regression import Regression
from expdesign.estimation.solve.solution import Weighting, solve_iv, solve_ls

NAMES = ("a", "b", "c", "d")


def random_case(seed: int, lengths: tuple[int, ...] = (37, 113, 60), outputs: int = 3):
    rng = np.random.default_rng(seed)
    k, p = sum(lengths), len(NAMES)
    Phi = rng.normal(size=(k, outputs, p)) + 2 * rng.normal(size=(outputs, p))
    Z = Phi + rng.normal(size=Phi.shape)
    y = Phi @ rng.normal(size=p) + rng.normal(size=(k, outputs)) + 3
    batch = np.repeat(np.arange(len(lengths)), lengths)
    return Regression(parameters=NAMES, Phi=Phi, y=y, batch=batch), Z


def with_constants(case: Regression, Z: np.ndarray, groups: np.ndarray) -> tuple[Regression, np.ndarray]:
    """One constant nuisance parameter per output and group of rows, with themselves as instruments."""
    k, n, _ = case.Phi.shape
    member = (groups[:, None] == np.unique(groups)).astype(float)
    extra = np.einsum("kb,nm->knbm", member, np.eye(n)).reshape(k, n, -1)
    names = (*NAMES, *(f"rho{i}" for i in range(extra.shape[2])))
    Phi = np.concatenate([case.Phi, extra], axis=2)
    return Regression(parameters=names, Phi=Phi, y=case.y, batch=case.batch), np.concatenate([Z, extra], axis=2)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("mean", ["complete", "batch"])
def test_zero_mean_instruments_equal_constant_nuisance_parameters(seed: int, mean: str) -> None:
    """Lemmas 7.1 and 7.2 of F. Ljungberg's doctoral thesis, for the estimate and for its covariance."""
    case, Z = random_case(seed)
    groups = case.batch_of if mean == "batch" else np.zeros(len(case))
    zero_mean = solve_iv(case, Z, Weighting(mean=mean, covariance="hac", lags=7))
    augmented = solve_iv(*with_constants(case, Z, groups), Weighting(covariance="hac", lags=7))
    p = len(NAMES)
    np.testing.assert_allclose(zero_mean.values, augmented.values[:p], rtol=1e-9)
    rows = case.y.size
    factor = (rows - p) / (rows - len(augmented.values))
    np.testing.assert_allclose(factor * zero_mean.covariance, augmented.covariance[:p, :p], rtol=1e-7)


def test_iv_with_the_regressors_as_instruments_is_least_squares() -> None:
    case, _ = random_case(1)
    flat = case.Phi.reshape(-1, len(NAMES))
    expected = np.linalg.lstsq(flat, case.y.ravel(), rcond=None)[0]
    np.testing.assert_allclose(solve_iv(case, case.Phi.copy()).values, expected, rtol=1e-10)
    np.testing.assert_allclose(solve_ls(case).values, expected, rtol=1e-10)


@pytest.mark.parametrize("weighting", [Weighting(mean="complete"), Weighting(mean="batch", blocks="batch")])
def test_estimates_do_not_depend_on_the_units_of_parameters(weighting: Weighting) -> None:
    case, Z = random_case(2)
    scale = np.array([1e-4, 1.0, 1e3, 1e-8])
    scaled = Regression(parameters=NAMES, Phi=case.Phi * scale, y=case.y, batch=case.batch)
    one, other = solve_iv(case, Z, weighting), solve_iv(scaled, Z * scale[::-1], weighting)
    np.testing.assert_allclose(other.values * scale, one.values, rtol=1e-8)
    np.testing.assert_allclose(other.covariance * np.outer(scale, scale), one.covariance, rtol=1e-6)


def test_blocks_per_batch_with_one_batch_are_one_block() -> None:
    case, Z = random_case(3, lengths=(200,))
    one = solve_iv(case, Z, Weighting(mean="batch", lags=5))
    per_batch = solve_iv(case, Z, Weighting(mean="batch", blocks="batch", lags=5))
    np.testing.assert_allclose(per_batch.values, one.values, rtol=1e-9)
    np.testing.assert_allclose(per_batch.covariance, one.covariance, rtol=1e-9)


def test_blocks_per_batch_fuse_the_batches() -> None:
    """A batch of overwhelming weight decides alone; equations of all batches hold where the data are exact."""
    case, Z = random_case(4)
    heavy = solve_iv(case, Z, Weighting(blocks="batch", batch_weights=(1e-9, 1.0, 1e-9))).values
    rows = case.batch_of == 1
    alone = Regression(parameters=NAMES, Phi=case.Phi[rows], y=case.y[rows])
    np.testing.assert_allclose(heavy, solve_iv(alone, Z[rows]).values, rtol=1e-5)
    truth = np.array([1.0, -2.0, 3.0, 0.5])
    exact = Regression(parameters=NAMES, Phi=case.Phi, y=case.Phi @ truth, batch=case.batch)
    np.testing.assert_allclose(solve_iv(exact, Z, Weighting(blocks="batch")).values, truth, rtol=1e-9)


def test_what_is_unseen_is_named_with_its_combination() -> None:
    case, Z = random_case(5)
    Phi, steered = case.Phi.copy(), Z.copy()
    Phi[..., 1], steered[..., 1] = 1e3 * Phi[..., 0], 1e3 * Z[..., 0]
    twin = Regression(parameters=NAMES, Phi=Phi, y=case.y, batch=case.batch)
    with pytest.raises(NotInformative, match=r"0\.71 [ab] - 0\.71 [ab]") as caught:
        solve_iv(twin, steered)
    assert set(caught.value.parameters) == {"a", "b"}
    assert str(caught.value).endswith("excite them, or fix b")  # one of each combination is enough
    Phi[..., 1], Phi[..., 3] = 5.0, 0.0
    silent = Regression(parameters=NAMES, Phi=Phi, y=case.y, batch=case.batch)
    with pytest.raises(NotInformative) as caught:
        solve_iv(silent, Phi.copy(), Weighting(mean="complete"))
    assert set(caught.value.parameters) == {"b", "d"}
    assert str(caught.value).endswith("or fix b d")


def test_lags_do_not_cross_batches_or_see_gaps_as_neighbours() -> None:
    """Joining batches far apart in time changes nothing; the same rows as one batch without a gap do."""
    case, Z = random_case(6)
    step = np.concatenate([np.arange(37), 1000 + np.arange(113), 3000 + np.arange(60)])
    apart = Regression(parameters=NAMES, Phi=case.Phi, y=case.y, step=step)
    joined = Regression(parameters=NAMES, Phi=case.Phi, y=case.y)
    weighting = Weighting(lags=10)
    per_batch = solve_iv(case, Z, weighting).covariance
    np.testing.assert_allclose(solve_iv(apart, Z, weighting).covariance, per_batch, rtol=1e-9)
    assert not np.allclose(solve_iv(joined, Z, weighting).covariance, per_batch, rtol=1e-3)
