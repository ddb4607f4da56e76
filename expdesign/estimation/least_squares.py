"""Least squares, which subtracts no mean and uses one block of weights."""

from __future__ import annotations

from dataclasses import replace

from expdesign.estimation.regression import Rows
from expdesign.estimation.solve import Refined, Solution, Weighting, solve_ls


def least_squares(rows: Rows, weighting: Weighting) -> Refined:
    """The estimate of least squares.

    Args:
        rows: of the regression.
        weighting: whose covariance is wanted; its mean and blocks are those of instruments.
    """
    return Refined(solve_ls(rows.regression, replace(weighting, mean="none", blocks="one")), 0, ())


def quick_least_squares(rows: Rows, weighting: Weighting) -> Solution:
    """Least squares for another method to start from, with a covariance that takes no time."""
    return least_squares(rows, replace(weighting, covariance="hc0")).solution
