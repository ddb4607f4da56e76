"""Information that an unknown steady current, two parameters more, leaves about the ship."""

from dataclasses import replace

import numpy as np
import pytest

from expdesign.durations import bordered_moments
from expdesign.information import moments, regressor_rows
from expdesign.information.disturbed import beside_current, bordered_by_current, current_rows
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import CALM, Environment, delivered, simulate
from expdesign.vessel import Sensors
from scenario_files import SCENARIOS

TENDER = load_vessel(SCENARIOS / "vessels" / "tender-20m.toml")
EVEN = replace(TENDER, sensors=Sensors(velocity_mps=0.01, yaw_rate_radps=0.01))
"""As accurate in yaw as in surge and sway."""
NAMES = TENDER.model.names
P = len(NAMES)


def orders(seed: int) -> Commands:
    rng = np.random.default_rng(seed)
    speeds, angles = (rng.uniform(low, high, (6, 2)).repeat(30, axis=0) for low, high in ((2.0, 10.0), (-0.4, 0.4)))
    values = np.column_stack([speeds[:, 0], angles[:, 0], speeds[:, 1], angles[:, 1]])
    return Commands(sample_time_s=TENDER.sample_time_s, names=TENDER.model.inputs, values=values)


def sailed(seed: int, heading_rad: float = 0.0):
    """Values of terms (k, p), and J (k, n, 2), of orders at random."""
    commands = orders(seed)
    motion = simulate(EVEN, commands, pose=(0.0, 0.0, heading_rad), velocity=np.array([1.5, 0.0, 0.0]))
    given = delivered(EVEN, commands)
    return regressor_rows(EVEN.model, motion, given, CALM), current_rows(EVEN, motion, given, CALM)


def known(rows, mean="complete"):
    X, Y = moments(EVEN.model, rows, NAMES)
    return len(rows) * bordered_moments(X, Y, Y, Y @ Y.T, mean)


def whole(rows, J, mean="complete"):
    return bordered_by_current(EVEN, known(rows, mean), rows, J, NAMES, mean)


def about_parameters(information):
    """(p, p), means eliminated."""
    M, S = information[:P, :P], information[:P, P:]
    return M - S @ np.linalg.pinv(information[P:, P:]) @ S.T if S.size else M


@pytest.mark.parametrize("mean", ["none", "batch", "complete"])
def test_it_is_the_inverse_of_the_block_of_a_regression_with_the_current(mean):
    rows, J = sailed(1)
    outputs = [EVEN.model.outputs.index(term.equation) for term in EVEN.model.terms]
    table = np.zeros((len(rows), 3, P + 2))
    table[:, outputs, np.arange(P)] = rows
    table[:, :, P:] = J
    if mean != "none":
        table -= table.mean(axis=0)
    full = np.einsum("kna,knb->ab", table, table)
    direct = np.linalg.inv(np.linalg.inv(full)[:P, :P])
    np.testing.assert_allclose(about_parameters(beside_current(whole(rows, J, mean), P)), direct, rtol=1e-6, atol=1e-6)


def test_a_day_on_one_heading_cannot_tell_the_current_from_means_and_loses_nothing():
    rows, J = sailed(2)
    steady = np.broadcast_to(J[:1], J.shape)
    left = about_parameters(beside_current(whole(rows, steady), P))
    np.testing.assert_allclose(left, about_parameters(known(rows)), rtol=1e-6, atol=1e-6)


def test_it_is_less_than_with_the_current_known_and_concave_in_the_runs():
    first, second = (whole(*sailed(seed, heading)) for seed, heading in ((3, 0.0), (4, 2.0)))
    apart = sum(about_parameters(beside_current(matrix, P)) for matrix in (first, second))
    together = about_parameters(beside_current(first + second, P))
    above = about_parameters((first + second)[:-2, :-2])
    for less, more in ((apart, together), (together, above)):
        assert np.linalg.eigvalsh(more - less).min() > -1e-9 * np.trace(more)


def test_runs_of_evenly_spread_headings_tell_the_same_with_and_without_it():
    headings = 2 * np.pi * np.arange(4) / 4
    matrices = [whole(*sailed(5, heading)) for heading in headings]
    left = about_parameters(beside_current(sum(matrices), P))
    np.testing.assert_allclose(left, about_parameters(sum(matrices)[:-2, :-2]), rtol=1e-6, atol=1e-6)


def test_the_predicted_covariance_grows_and_is_that_without_it_where_headings_are_spread():
    def covariance(headings, *, unknown: bool):
        parts = [
            TrialPart(commands=orders(6), velocity=np.array([1.5, 0.0, 0.0]), heading_rad=heading)
            for heading in headings
        ]
        return expected_covariance(EVEN, parts, NAMES, environment=Environment(), unknown_current=unknown)

    alone = [covariance([0.3], unknown=unknown) for unknown in (False, True)]
    assert (np.diag(alone[1]) > 1.01 * np.diag(alone[0])).any()
    spread = [covariance(2 * np.pi * np.arange(4) / 4, unknown=unknown) for unknown in (False, True)]
    np.testing.assert_allclose(spread[1], spread[0], rtol=1e-5, atol=1e-9 * np.abs(spread[0]).max())
