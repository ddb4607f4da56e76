"""Cluster-robust standard errors: the scatter of scores from run to run.

A fit's covariance assumes noise of one spectrum and size. Real runs also differ in weather, loading and model error.
The scatter of the runs' scores measures these differences, but it is a poor estimate with few runs. So each standard
error is the larger of the two, where there are enough runs.

Source: K.-Y. Liang and S. L. Zeger, Biometrika 73 (1986), 13-22; A. C. Cameron and D. L. Miller, Journal of Human
Resources 50 (2015), 317-372, for the number of clusters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.gram_matrices import marginalised
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.values import Array


def cluster_robust(found: Fit, run: Array) -> Fit:
    """The same fit with standard errors no smaller than the cluster-robust ones.

    Args:
        found: of all windows.
        run: (w,) number of the run of each window.
    """
    if not found.keys or len(np.unique(run)) < TUNING.fewest_runs:
        return found
    own = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    robust = np.sqrt(np.maximum(np.diag(cluster_covariance(found, run)), 0.0))
    ratio = np.where(own > 0, np.maximum(robust / np.where(own > 0, own, 1.0), 1.0), 1.0)
    return replace(found, covariance=found.covariance * np.outer(ratio, ratio))


def cluster_covariance(found: Fit, run: Array) -> Array:
    """(c, c) sandwich covariance from the scatter of the runs' scores; priors keep their own variance."""
    m = marginalised(found.grams, found.sensitivities, found.noise)
    names = np.unique(run)
    scores = np.stack([m.each[run == name].sum(axis=0) for name in names])
    scores = scores - scores.mean(axis=0)
    meat = len(names) / (len(names) - 1) * scores.T @ scores + found.precision
    bread = np.linalg.pinv(m.A + found.precision, rcond=1e-14, hermitian=True)
    return np.asarray(bread @ meat @ bread, dtype=float)
