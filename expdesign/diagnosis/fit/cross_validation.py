"""Cross-validation: how well a model simulates data that it was not fitted to.

Data are held out in units: batches, or windows where there are fewer than three batches. Effects are fitted without the
units that they are evaluated on. Where such a fit does not improve on the fit to all units, the effects of the latter
are kept; `unconverged` counts these folds. The selection of causes and the grid searches (width of a dead band, time of
a change, direction of the wind) used all units.

Every unit is simulated as a whole. A fit of many parameters to few units may lead away from the ship in a whole unit,
most of all where that moves otherwise than the others. Then models are judged by what they predict a short time ahead:
in stretches, each simulated from its first measured state, one part of every run held out at a time (as the h-block
cross-validation of P. Burman, E. Chow and D. Nolan, Biometrika 81 (1994), 351-358). What is judged so is also fitted
so, by output error in the other stretches. The likelihood whitens slow errors away, and these are most of the error of
such a prediction. Where a stretch is predicted worse than by the mean of its run, it is lost, and by how much tells
nothing: its error counts as that of such a constant. The few stretches in which a model runs away would decide else
(errors relative to a simple prediction, winsorised: J. S. Armstrong and F. Collopy, International Journal of
Forecasting 8 (1992), 69-80).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy import squared_sums
from expdesign.diagnosis.data import Windows, cut_windows
from expdesign.diagnosis.fit.fit import Fit, FitOptions
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.fit.held_out import FEWEST_RUNS, HeldOut
from expdesign.diagnosis.fit.output_error import AHEAD_S, FOLD_STEPS, fit_output_error
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import LinearisedMotion, simulate_from_measured
from expdesign.processes import in_order
from expdesign.progress import Progress, silent
from expdesign.signals import Record
from expdesign.values import Array

FOLDS = 3  # of the cross-validation

PARTS = 5  # of every run, in the cross-validation of short stretches

_Fitted = Callable[[Windows, NDArray[np.bool_]], ExtendedModel | None]
"""A model fitted to some of the windows, by a mask (w,)."""


def validation_units(windows: Windows) -> Array:
    """(w,) number of the unit that every window belongs to."""
    return windows.batch if len(np.unique(windows.batch)) >= FEWEST_RUNS else np.arange(len(windows.batch), dtype=float)


class CrossValidation:
    """Errors of fits on held-out units, each measured once; those of fits that nobody else holds are forgotten."""

    def __init__(self, windows: Windows, record: Record | None = None) -> None:
        """Of all data; without a record, stretches are no longer than windows."""
        self._windows, self._record = windows, record
        self._known = WeakKeyDictionary[Fit, HeldOut]()

    def short_windows(self, ship: ExtendedModel) -> Windows:
        """The data in stretches of `AHEAD_S`."""
        return _stretches(self._windows, validation_units(self._windows), ship, self._record)

    def of(self, found: Fit, progress: Progress = silent) -> HeldOut:
        """Of a model whose effects are fitted."""
        if found not in self._known:
            self._known[found] = self.without(found, found.ship, progress)
        return self._known[found]

    def without(self, found: Fit | None, ship: ExtendedModel, progress: Progress = silent) -> HeldOut:
        """The same, not kept; None for a model that is not fitted."""
        return cross_validate(found, ship, self._windows, progress, self._record)

    def measured_like(self, other: HeldOut, found: Fit) -> HeldOut:
        """The same, measured only as those of another are: of whole units or of short stretches."""
        if not other.in_stretches:
            return self.without(found, found.ship)
        return _in_stretches(found.ship, found.free_keys, self._windows, self._record)


def cross_validate(
    found: Fit | None, ship: ExtendedModel, windows: Windows, progress: Progress, record: Record | None = None
) -> HeldOut:
    """Errors of a model whose effects are fitted to the other units.

    Args:
        found: its fit to all units; None for a model that is not fitted.
        record: the same data, which stretches are cut from where units are batches; else they are parts of windows.
    """
    unit = validation_units(windows)
    whole = _of_folds(
        _Folds(
            ship=ship,
            windows=windows,
            unit=unit,
            part=unit,
            fitted=None if found is None else partial(_fitted, found),
            near=None if found is None else found.linear,
        ),
        progress,
    )
    free = None if found is None else found.free_keys

    def ahead() -> HeldOut:
        return replace(_in_stretches(ship, free, windows, record), models=whole.models)

    def on_other_runs() -> HeldOut:
        return _on_other_runs(whole, windows.batch, _stretches(windows, unit, ship, record), ship.model.outputs)

    known = cache(ahead)
    return replace(whole, ahead=known, on_other_runs=cache(on_other_runs) if unit is windows.batch else known)


def _in_stretches(
    ship: ExtendedModel, free: tuple[str, ...] | None, windows: Windows, record: Record | None
) -> HeldOut:
    """Errors in short stretches, one part of every run held out at a time.

    Args:
        free: effects without a prior that are fitted; None for a model that is not fitted.
    """
    short = _stretches(windows, validation_units(windows), ship, record)
    try:
        found = None if free is None else fit_output_error(ship, short, free)
    except (FloatingPointError, np.linalg.LinAlgError):
        return _of_stretches(ship, short, _not_fitted)
    return _of_stretches(ship, short) if found is None else cross_validate_ahead(found)


def _on_other_runs(whole: HeldOut, batch: Array, short: Windows, outputs: Sequence[str]) -> HeldOut:
    """Errors in short stretches of every run, by models that were fitted to other runs.

    Args:
        whole: errors in whole runs, with the models.
        batch: (w,) run of every window that they were fitted to.
        short: the data in short stretches.
        outputs: that are compared.
    """
    columns = [OUTPUTS.index(name) for name in outputs]
    measured = short.measured[..., columns]
    lost, varied = np.full((2, len(measured), len(columns)), np.nan)
    most = error_of_constants(measured, short.batch)
    for held_out, model in whole.models:
        rows = np.isin(short.batch, batch[held_out])
        if model is not None:
            error = simulate_from_measured(model, short.selected(rows)).error[..., columns]
            lost[rows], varied[rows] = squared_sums(error, measured[rows])
    order = np.lexsort((short.first, short.batch))
    return HeldOut(
        squared_error=np.minimum(lost, most)[order],
        squared_deviation=varied[order],
        in_stretches=True,
        run=short.batch[order],
    )


def cross_validate_ahead(found: Fit) -> HeldOut:
    """Errors of a model fitted by output error in short stretches, without one part of every run at a time."""
    return _of_stretches(found.ship, found.linear.motion.windows, partial(_fitted, found), found.linear)


def _of_stretches(
    ship: ExtendedModel, short: Windows, fitted: _Fitted | None = None, near: LinearisedMotion | None = None
) -> HeldOut:
    folds = _Folds(
        ship=ship,
        windows=short,
        unit=_parts_of_runs(short),
        part=_in_time(short),
        fitted=fitted,
        near=near,
        in_stretches=True,
    )
    return replace(_of_folds(folds), in_stretches=True, models=())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Folds:
    """What is cross-validated."""

    ship: ExtendedModel  # the model, fitted to all units
    windows: Windows  # that it is simulated in
    unit: Array  # (w,) of each of them
    part: Array  # (w,) what errors are summed over: units, or stretches of them
    fitted: _Fitted | None  # None for a model that is not fitted
    near: LinearisedMotion | None = None  # motion of the fit in these windows, which speeds up the simulation
    in_stretches: bool = False  # windows are stretches of units


def _of_folds(given: _Folds, progress: Progress = silent) -> HeldOut:
    windows = given.windows
    names, parts = np.unique(given.unit), np.unique(given.part)
    most = PARTS if given.in_stretches else FOLDS
    folds = [names[index::most] for index in range(min(most, len(names)))]
    columns = [OUTPUTS.index(name) for name in given.ship.model.outputs]
    error = np.zeros((len(parts), len(columns)))
    lost_at = None if not given.in_stretches else error_of_constants(windows.measured[..., columns], windows.batch)
    deviation, unconverged = np.zeros_like(error), 0
    tested: list[tuple[NDArray[np.bool_], ExtendedModel | None]] = []
    kept_out = [np.isin(given.unit, fold) for fold in folds]
    refitted = [(~test,) for test in kept_out if not test.all()]
    models = None if given.fitted is None else in_order(given.fitted, (windows,), refitted)
    for number, test in enumerate(kept_out):
        progress("measuring the gain on held-out runs", number / len(folds))
        model = given.ship if models is None or test.all() else next(models)
        tested.append((test, model))
        if model is None:
            for total in (error, deviation):
                total[np.isin(parts, given.part[test])] = np.nan
            continue
        unconverged += models is not None and model.effects == given.ship.effects
        part = windows.selected(test)
        near = None if given.near is None else given.near.selected(test)
        lost, varied = squared_sums(
            simulate_from_measured(model, part, near).error[..., columns], part.measured[..., columns]
        )
        lost = lost if lost_at is None else np.minimum(lost, lost_at[test])
        for total, more in ((error, lost), (deviation, varied)):
            np.add.at(total, np.searchsorted(parts, given.part[test]), more)
    return HeldOut(
        squared_error=error,
        squared_deviation=deviation,
        unconverged=unconverged,
        run=windows.batch[np.argsort(given.part, kind="stable")] if given.in_stretches else None,
        models=tuple(tested),
    )


def error_of_constants(measured: Array, batch: Array) -> Array:
    """(w, n) squared error of each window where every batch is predicted by its mean, averaged over all data.

    Args:
        measured: (w, s, n), nan where not measured.
        batch: (w,) that each window is of.
    """
    total, seen = np.zeros(measured.shape[-1]), np.isfinite(measured)
    for number in np.unique(batch):
        rows = measured[batch == number].reshape(-1, measured.shape[-1])
        total += np.nansum((rows - np.nanmean(rows, axis=0)) ** 2, axis=0)
    return np.asarray(seen.sum(axis=1) * total / np.maximum(seen.sum(axis=(0, 1)), 1))


def _stretches(windows: Windows, unit: Array, ship: ExtendedModel, record: Record | None) -> Windows:
    """The data in short stretches."""
    if record is not None and unit is windows.batch:
        return cut_windows(ship.model, record, longest_s=AHEAD_S)
    return windows.cut_shorter(max(2, round(AHEAD_S / windows.sample_s)))


def _in_time(short: Windows) -> Array:
    """(w,) number of every stretch, one run after another in the order of time."""
    return np.argsort(np.lexsort((short.first, short.batch))).astype(float)


def _parts_of_runs(short: Windows) -> Array:
    """(w,) fold of every stretch: each fold is one part of every run, another in each."""
    part = np.zeros(len(short.batch))
    for batch in np.unique(short.batch):
        mine = np.flatnonzero(short.batch == batch)
        place = np.argsort(np.argsort(short.first[mine]))
        part[mine] = (place * PARTS // len(mine) + batch) % PARTS
    return part


def _fitted(found: Fit, windows: Windows, train: NDArray[np.bool_]) -> ExtendedModel | None:
    """The model with its effects fitted to some windows, or None where that is impossible.

    The effects stay if no step from the fit to all windows reduces the cost on these.
    """
    ship, free = _seen(found, train)
    options = FitOptions(
        noise=found.noise,
        ar_order=found.noise.order,
        steps=FOLD_STEPS,
        warm_start=found.selected(train),
        fixed_weights=True,
    )
    try:
        return fit(ship, windows.selected(train), free, starts=found.starts[train], options=options).ship
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def _seen(found: Fit, train: NDArray[np.bool_]) -> tuple[ExtendedModel, tuple[str, ...]]:
    """The model without effects that do nothing in some windows, and the free ones that are left.

    Nothing is known there of a change of the ship that comes later, for example. What does nothing more anywhere, as
    the slew time of an actuator that is as quick as its signal, stays as it was found: the file may say otherwise.
    """
    values = np.abs(found.sensitivities.values[: found.free_count])
    size, elsewhere = (values[:, part].max(axis=(1, 2, 3), initial=0.0).tolist() for part in (train, ~train))
    unseen = {key for key, own, other in zip(found.free_keys, size, elsewhere, strict=True) if own == 0.0 < other}
    free = tuple(key for key, own in zip(found.free_keys, size, strict=True) if own > 0.0)
    return found.ship.without_effects(unseen), free


def _not_fitted(windows: Windows, train: NDArray[np.bool_]) -> ExtendedModel | None:
    """No model where none can be fitted."""
    return None
