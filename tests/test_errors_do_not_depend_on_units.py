"""What is told of a coefficient does not depend on its unit: a tanker's of r^3 is 1e9 times one of u."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import expdesign
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import counting_runs, runs_of
from expdesign.diagnosis.fit.between_runs import _spread_of_estimates
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select.kinks import _Profile
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.foresight.reveal import likeness_of
from expdesign.importing.responses import _by_moves
from expdesign.own_units import covariance_of, pseudo_inverse_of, solution_of
from expdesign.vessel import Term

UNIT = 1e-9
NAMES = ("X_u", "Y_v", "N_r")  # a coefficient of every equation


def fitted(name: str, unit: float) -> Fit:
    """The coaster's coefficients estimated without a prior, one of them in another unit, from a wrong value on."""
    record = hidden_record("coaster", seed=3, batches=3, samples=120)
    vessel = vessel_of("coaster")
    model = vessel.model
    terms = tuple(
        Term(term.equation, term.name, f"{unit!r}*{term.expression}") if term.name == name else term
        for term in model.terms
    )
    factors = np.where(np.array(model.names) == name, 1.0 / unit, 1.0)
    model = replace(model, terms=terms, parameters=factors * model.parameters, parameter_std=factors * 0.0)
    ship = extended_model(replace(vessel, model=model), record)
    windows = cut_windows(ship.model, record)
    return fit(ship, windows, tuple(f"theta:{key}" for key in model.names), starts=initial_states(windows))


@pytest.mark.parametrize("name", NAMES)
def test_standard_errors_follow_the_unit(name):
    plain, other = fitted(name, 1.0), fitted(name, UNIT)
    for one, same in (
        (plain, other),
        (
            counting_runs(plain, runs_of(plain.linear.motion.windows)),
            counting_runs(other, runs_of(other.linear.motion.windows)),
        ),
    ):
        ratio = np.array([same.std(key) / one.std(key) for key in one.keys])
        expected = np.array([1.0 / UNIT if key == f"theta:{name}" else 1.0 for key in one.keys])
        np.testing.assert_allclose(ratio, expected, rtol=0.02)  # the noise is estimated by each
    of_plain, of_other = (_spread_of_estimates(one, runs_of(one.linear.motion.windows))[1] for one in (plain, other))
    place = plain.keys.index(f"theta:{name}")
    assert np.sqrt(of_other[place, place] / of_plain[place, place]) * UNIT == pytest.approx(1.0, rel=0.02)
    assert _Profile(other, f"theta:{name}").is_parabola() == _Profile(plain, f"theta:{name}").is_parabola()


@pytest.fixture
def information():
    rng = np.random.default_rng(5)
    rows = rng.standard_normal((40, 5))
    return rows.T @ rows, 10.0 ** np.array([-9.0, -4.0, 0.0, 4.0, 9.0])


def test_inverses_are_the_same_in_any_unit(information):
    A, size = information
    b = np.arange(1.0, 6.0)
    scaled, exact = A * np.outer(size, size), np.linalg.inv(A)
    for inverse in (covariance_of, pseudo_inverse_of):
        np.testing.assert_allclose(inverse(scaled) * np.outer(size, size), exact, rtol=1e-9)
    np.testing.assert_allclose(solution_of(scaled, size * b) * size, exact @ b, rtol=1e-9)


def test_what_data_do_not_tell_is_unsure_and_imitates_nothing(information):
    A, size = information
    A[:, 4], A[4] = 0.0, 0.0  # nothing at all
    A[:, 3], A[3] = A[:, 2], A[2]
    A[3, 3] = A[2, 3] = A[3, 2] = A[2, 2]  # the same as another
    scaled = A * np.outer(size, size)
    std = np.sqrt(np.diag(covariance_of(scaled)))
    alone = 1.0 / np.sqrt(np.diag(scaled)[:4])
    assert (std[2:4] > 1e5 * alone[2:4]).all()
    assert std[4] > 1e5
    assert (std[:2] < 10 * alone[:2]).all()
    told = scaled @ pseudo_inverse_of(scaled) @ scaled
    np.testing.assert_allclose(told / np.outer(size, size), A, atol=1e-8)
    assert pseudo_inverse_of(scaled)[4, 4] == 0.0
    assert covariance_of(np.zeros((0, 0))).shape == (0, 0)


@pytest.mark.parametrize("parameter", range(3))
def test_errors_of_a_response_are_the_same_in_any_unit(parameter):
    rng = np.random.default_rng(7)
    jacobian, left, move = rng.standard_normal((60, 3)), rng.standard_normal(60), np.repeat(np.arange(12), 5)
    size = np.ones(3)
    size[parameter] = UNIT
    plain, other = (_by_moves(one, left, move) for one in (jacobian, jacobian * size))
    np.testing.assert_allclose(other * size, plain, rtol=1e-9)
    assert _by_moves(jacobian * (size == 1.0), left, move)[parameter] > 1e5  # what nothing tells is unsure


def test_effects_are_alike_in_any_unit(information):
    A, size = information
    own, others = np.array([0, 4]), np.array([1, 3])
    like = likeness_of(A, own, others)
    assert 0.0 < like < 2.0
    assert likeness_of(A * np.outer(size, size), own, others) == pytest.approx(like, rel=1e-9)
    A[:, 0], A[0] = A[:, 1], A[1]
    A[0, 0] = A[0, 1] = A[1, 0] = A[1, 1]
    assert likeness_of(A, own[:1], others) == pytest.approx(1.0)


def test_no_matrix_of_effects_is_inverted_in_the_units_that_it_comes_in():
    root = Path(expdesign.__file__).parent
    rooms = [root / "diagnosis" / part for part in ("fit", "select", "remainder")]
    files = [path for room in rooms for path in sorted(room.glob("*.py"))]
    files += [root / name for name in ("assessment/prior.py", "importing/responses.py", "foresight/reveal.py")]
    assert len(files) > 18
    found = [path.name for path in files if re.search(r"linalg\.(pinv|lstsq|inv)\(", path.read_text("utf-8"))]
    assert found == []
