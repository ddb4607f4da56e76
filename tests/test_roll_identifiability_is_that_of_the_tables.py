"""Which parameters of roll one data set tells at once: the thesis's tables 4.1 and 5.1, counted by rank."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest

from expdesign.roll import G_MPS2, Body, Load, axis_inertia, first_moment, parameters
from expdesign.values import Array
from roll_closed_forms import pendulum_system

PENDULUM = {"M": 22.0, "z_g": -0.02, "k": 10.4, "I_x": 0.14, "d": 0.11, "I_xm": 0.003, "m": 0.7, "z_m": -0.27}
SHIP = {
    "M": 22.0, "z_g": -0.013, "k": 9.0, "A_x": 0.16, "d": 0.27, "K_ur": -1.55, "K_vd": 0.95, "K_delta": -0.45,
    "z_f": -0.03, "m": 0.4, "z_m": -0.27,
}  # fmt: skip
SHIP_NAMES = [*SHIP]
SPEED = 0.8


def pendulum(values: Array) -> Array:
    """Coefficients of roll rate by side acceleration: stiffness and damping over inertia, and the gain."""
    M, z_g, k, I_x, d, I_xm, m, z_m = values.tolist()
    A, B, _, _ = pendulum_system(
        parameters(k=k, A_x=I_x, d=d), Body(mass_kg=M, z_g=z_g, z_s=-0.2), Load(mass_kg=m, z_m=z_m, inertia_kgm2=I_xm)
    )
    return np.array([A[1, 0], A[1, 1], B[1, 0]])


def ship(values: Array) -> Array:
    """Of roll rate by sway acceleration, yaw rate and rudder: five over the inertia."""
    M, z_g, k, A_x, d, K_ur, K_vd, K_delta, z_f, m, z_m = values.tolist()
    body, load = Body(mass_kg=M, z_g=z_g, z_s=-0.2), Load(mass_kg=m, z_m=z_m)
    S1 = first_moment(body, load, z_f)
    tops = [k + G_MPS2 * S1, d, K_vd + S1, (K_ur + S1) * SPEED, K_delta]
    return np.array(tops) / axis_inertia(A_x, body, load, z_f)


def lumped(values: Array) -> Array:
    """The ship with K_r = (K_ur - K_vd) U in the place of K_ur, as estimates have it."""
    ur, vd = SHIP_NAMES.index("K_ur"), SHIP_NAMES.index("K_vd")
    changed = np.array(values)
    changed[ur] = values[ur] / SPEED + values[vd]
    return ship(changed)


def three_loads(values: Array) -> Array:
    """Of the ship alone, with a known load and with the unknown one."""
    alone, known = np.array(values), np.array(values)
    alone[-2:], known[-2:] = (0.0, 0.0), (0.2, -0.256)
    return np.concatenate([ship(alone), ship(known), ship(values)])


def slopes(of: Callable[[Array], Array], at: dict[str, float]) -> Array:
    """(c, p) relative derivatives, by central differences."""
    values = np.array(list(at.values()))
    steps = 1e-6 * np.diag(values)
    return np.array([(of(values + step) - of(values - step)) / (2e-6 * of(values)) for step in steps]).T


def bad_sets(matrix: Array, size: int) -> int:
    """Sets of so many columns that are not independent."""
    sets = combinations(range(matrix.shape[1]), size)
    ranks = [np.linalg.matrix_rank(matrix[:, list(one)], tol=1e-6) for one in sets]
    return sum(rank < size for rank in ranks)


def test_a_pendulum_has_rank_five_with_input_and_four_without() -> None:
    """With the two states of roll; 22 of the 56 triples are not identifiable, and one pair without an input."""
    matrix = slopes(pendulum, PENDULUM)
    assert 2 + np.linalg.matrix_rank(matrix, tol=1e-6) == 5
    assert 2 + np.linalg.matrix_rank(matrix[:2], tol=1e-6) == 4
    assert [bad_sets(matrix, size) for size in (1, 3)] == [0, 22]


@pytest.mark.parametrize(("size", "bad"), [(1, 0), (2, 0), (3, 20), (4, 115), (5, 296)])
def test_sets_of_ship_parameters_that_one_data_set_does_not_tell(size: int, bad: int) -> None:
    assert bad_sets(slopes(ship, SHIP), size) == bad


@pytest.mark.parametrize(("size", "bad"), [(4, 130), (5, 326)])
def test_with_the_lumped_coefficient_of_yaw_more_sets_are_not_told(size: int, bad: int) -> None:
    at = {**SHIP, "K_ur": (SHIP["K_ur"] - SHIP["K_vd"]) * SPEED}
    assert bad_sets(slopes(lumped, at), size) == bad


def test_three_loads_tell_nine_parameters_of_a_ship_whose_side_acceleration_is_known() -> None:
    """43 of the 55 sets of nine are not told; that of the thesis, without M and z_g, is."""
    matrix = slopes(three_loads, SHIP)
    assert np.linalg.matrix_rank(matrix, tol=1e-6) == 9
    assert bad_sets(matrix, 9) == 43
    assert np.linalg.matrix_rank(np.delete(matrix, [0, 1], axis=1), tol=1e-6) == 9


def test_a_ship_that_rolls_freely_tells_stiffness_and_damping_over_inertia_alone() -> None:
    """Rank 7 with her two states, 6 without sway, and 4 without sway, yaw and rudder, as a pendulum has."""
    matrix = slopes(ship, SHIP)
    ranks = [2 + np.linalg.matrix_rank(matrix[rows], tol=1e-6) for rows in ([0, 1, 2, 3, 4], [0, 1, 3, 4], [0, 1])]
    assert ranks == [7, 6, 4]
