"""Output error in short windows: least squares of simulations, for models whose longer simulation leads away.

The noise is white, and there is no random current: in a short window it would take the place of any slow effect.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit.cluster_robust import cluster_robust
from expdesign.diagnosis.fit.fit import Fit, FitOptions, continuing, uncertain_keys
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import initial_states, stable_windows
from expdesign.signals import Record


def fit_output_error(ship: ExtendedModel, windows: Windows, free: tuple[str, ...]) -> Fit:
    """Effects `free`, and parameters within their standard deviations, fitted to windows that begin as measured.

    Raises:
        FloatingPointError: the simulation diverges at the start of the fit.
    """
    options = FitOptions(steps=TUNING.fold_steps, ar_order=0)
    part = replace(windows, has_heading=False)
    return fit(ship, part, free, starts=initial_states(windows, ship.states), options=options)


def fit_beside_stated_parameters(found: Fit, windows: Windows, short: Windows) -> Fit:
    """The free effects of a fit beside the parameters of the vessel file, as these stand in it.

    Effects are fitted by output error in short windows: beside parameters that are not the likeliest ones, likelihoods
    of long windows say little about anything slow. Standard errors are no smaller than those beside parameters that may
    differ, and than the scatter from stretch to stretch tells.

    Args:
        found: the fit, of all windows.
        windows: that it is of.
        short: the same data in short windows.

    Raises:
        FloatingPointError: the simulation diverges at the start of the fit.
    """
    free = found.free_keys
    parameters = {key for key in found.keys if key.startswith("theta:") and key not in free}
    model = replace(found.ship.model, parameter_std=np.zeros(len(found.ship.model.parameters)))
    ship = replace(found.ship.without_effects(parameters), model=model)
    ahead = cluster_robust(fit_output_error(ship, short, free), np.arange(float(len(short.batch))))
    at_these = replace(continuing(found), steps=0, warm_start=None)
    again = fit(ahead.ship, windows, free, starts=found.starts, options=at_these)
    rows = [found.keys.index(key) for key in again.keys]
    covariance = found.covariance[np.ix_(rows, rows)]
    own = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    ratio = np.maximum(np.sqrt(np.maximum(np.diag(ahead.covariance), 0.0)) / own, 1.0)
    return replace(again, covariance=covariance * np.outer(ratio, ratio))


def with_longer_windows(ship: ExtendedModel, record: Record, windows: Windows) -> tuple[ExtendedModel, Windows]:
    """A model that leads away within `Tuning.ahead_s`, re-estimated, and windows as long as it then allows.

    It is re-estimated within the standard deviations of the vessel file, first in windows short enough for the model
    in use, then in longer ones. Where that does not succeed, both are as given.

    Args:
        ship: the model in use.
        record: data.
        windows: of the data, short enough for the model in use.
    """
    length_s = windows.steps * windows.step_s
    if length_s >= TUNING.ahead_s or not uncertain_keys(ship):
        return ship, windows
    found = ship
    try:
        while length_s < TUNING.ahead_s:
            found = fit_output_error(found, cut_windows(ship.model, record, longest_s=length_s), ()).ship
            length_s *= TUNING.longer_by
        found = fit_output_error(found, cut_windows(ship.model, record, longest_s=TUNING.ahead_s), ()).ship
    except (FloatingPointError, np.linalg.LinAlgError):
        return ship, windows
    longer = stable_windows(found, record)
    return found, longer if longer.steps > windows.steps else windows
