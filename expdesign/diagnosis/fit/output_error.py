"""Output error in short windows: least squares of simulations, for models whose longer simulation leads away.

The noise is white, and there is no random current: in a short window it would take the place of any slow effect.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit.between_runs import counting_stretches
from expdesign.diagnosis.fit.fit import Fit, FitOptions, continuing, nearest_possible, uncertain_keys
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import initial_states, longest_windows, simulate_from_measured, stable_windows
from expdesign.signals import Record
from expdesign.values import Array

AHEAD_S = 30.0  # length of the stretches that held-out data are also simulated in [s]

FOLD_STEPS = 6  # Gauss-Newton steps from the fit to all units to the fit without a fold
LONGER_BY = 1.4  # factor of the length of windows from one fit of a diverging model to the next


def fit_output_error(ship: ExtendedModel, windows: Windows, free: tuple[str, ...]) -> Fit:
    """Effects `free`, and parameters within their standard deviations, fitted to windows that begin as measured.

    Raises:
        FloatingPointError: the simulation diverges at the start of the fit.
    """
    options, part = FitOptions(steps=FOLD_STEPS), replace(windows, white_noise=True)
    return fit(ship, part, free, starts=initial_states(windows, ship.states), options=options)


def fit_ahead(found: Fit, windows: Windows, short: Windows, *, beside_stated: bool = False) -> Fit:
    """A fit made anew as models are judged in short windows: by output error in these.

    Likelihoods of long windows whiten slow errors away, so that a model that is likely there may predict worse.
    Standard errors are no smaller than those of the fit, and than the scatter from stretch to stretch tells.

    Args:
        beside_stated: beside the parameters of the vessel file, as these stand in it.

    Raises:
        FloatingPointError: the simulation diverges, at the start of the fit or in the windows after it.
    """
    free, ship = found.free_keys, found.ship
    if beside_stated:
        parameters = {key for key in found.keys if key.startswith("theta:") and key not in free}
        ship = ship.without_effects(parameters).with_known_parameters()
    ahead = counting_stretches(fit_output_error(ship, short, free))
    at_these = replace(continuing(found), steps=0, warm_start=None)
    again = fit(ahead.ship, windows, free, starts=found.starts, options=at_these)
    rows = [found.keys.index(key) for key in again.keys]
    return replace(again, covariance=no_smaller(found.covariance[np.ix_(rows, rows)], ahead.covariance))


def no_smaller(covariance: Array, other: Array) -> Array:
    """A covariance (c, c) with its correlations, and standard errors no smaller than those of another."""
    own = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    ratio = np.maximum(np.sqrt(np.maximum(np.diag(other), 0.0)) / own, 1.0)
    return np.asarray(covariance * np.outer(ratio, ratio))


def with_longer_windows(ship: ExtendedModel, record: Record, windows: Windows) -> tuple[ExtendedModel, Windows]:
    """A model that leads away within `AHEAD_S`, re-estimated, and windows as long as it then allows.

    It is re-estimated within the standard deviations of the vessel file: first what is impossible in it becomes
    possible (`nearest_possible`), then it is fitted in windows short enough for it, then in longer ones. Where that
    does not succeed, it is as given. Windows that stay as short are those of output error, as models are judged in.

    Args:
        windows: of the data, short enough for the model in use.
    """
    if _length_s(windows) > AHEAD_S or windows.steps >= longest_windows(ship, record).steps:
        return ship, windows
    as_given = ship, replace(windows, white_noise=True)
    if not uncertain_keys(ship):
        return as_given
    found = nearest_possible(ship)
    length_s = _length_s(stable_windows(found, record))
    try:
        while length_s < AHEAD_S:
            found = fit_output_error(found, cut_windows(ship.model, record, longest_s=length_s), ()).ship
            length_s *= LONGER_BY
        found = fit_output_error(found, cut_windows(ship.model, record, longest_s=AHEAD_S), ()).ship
    except (FloatingPointError, np.linalg.LinAlgError):
        return as_given
    longer = max(windows, stable_windows(found, record), key=lambda item: item.steps)
    if simulate_from_measured(found, longer).diverged:
        return as_given
    return found, replace(longer, white_noise=_length_s(longer) <= AHEAD_S)


def _length_s(windows: Windows) -> float:
    return windows.steps * windows.step_s
