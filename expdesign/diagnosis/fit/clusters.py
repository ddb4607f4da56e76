"""Standard errors that hold when runs differ: by how much the runs' own scores scatter.

A fit's covariance takes the remainder for noise of one colour and size. Runs differ by more than that: other weather,
other loading, a model that is a little wrong in other ways in each. The scatter of the scores from run to run tells how
much, whatever the reason; with few runs it tells that badly. So each standard error is the larger of the two, where
there are runs enough.

Source: K.-Y. Liang and S. L. Zeger, Biometrika 73 (1986), 13-22; A. C. Cameron and D. L. Miller, Journal of Human
Resources 50 (2015), 317-372, for the number of clusters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.fit.gauss_newton import Fit
from expdesign.diagnosis.fit.linear_model import grams, marginal
from expdesign.values import Array

FEWEST_RUNS = 10


def widened(found: Fit, run: Array) -> Fit:
    """The same fit with standard errors no smaller than the runs' scatter makes them.

    Args:
        found: of all windows.
        run: (w,) number of the run that each window is of.
    """
    if not found.keys or len(np.unique(run)) < FEWEST_RUNS:
        return found
    own = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    scatter = np.sqrt(np.maximum(np.diag(clustered(found, run)), 0.0))
    wider = np.where(own > 0, np.maximum(scatter / np.where(own > 0, own, 1.0), 1.0), 1.0)
    return replace(found, covariance=found.covariance * np.outer(wider, wider))


def clustered(found: Fit, run: Array) -> Array:
    """(c, c) covariance from the scatter of the runs' scores; what is known beforehand keeps its own variance."""
    m = marginal(grams(found.columns, found.noise), found.columns, found.noise)
    names = np.unique(run)
    scores = np.stack([m.each[run == name].sum(axis=0) for name in names])
    scores = scores - scores.mean(axis=0)
    meat = len(names) / (len(names) - 1) * scores.T @ scores + np.diag(found.precision)
    bread = np.linalg.pinv(m.A + np.diag(found.precision), rcond=1e-14, hermitian=True)
    return np.asarray(bread @ meat @ bread, dtype=float)
