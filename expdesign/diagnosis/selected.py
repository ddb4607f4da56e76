"""Causes selected for a model: searched for by likelihood, judged on held-out data, or compared by predictions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.accuracy import Accuracy, accuracy, white_noise_std
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import CrossValidation, HeldOut, within_stated_std
from expdesign.diagnosis.judgement import (
    LITTLE_FIT,
    errors_as_judged,
    found_by_predictions,
    with_alternatives,
    without_harm,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import fitted_start
from expdesign.diagnosis.prediction_comparison import Compared, compare_predictions
from expdesign.diagnosis.remainder import Remainder, with_unlisted_terms
from expdesign.diagnosis.select import Selection, Step, compared_with, eliminate_backward, select_forward
from expdesign.progress import Estimated
from expdesign.signals import Record

MORE_THAN_NOISE = 2.0
"""The simulation explains little of an output below `LITTLE_FIT`, if its error is so many times the noise."""
VALIDATED, COMPARED, CONCLUDED = 4.0, 80.0, 25.0
"""Work of the cross-validation of a model, of the comparison of causes by predictions, and of conclusions, in
simulations of all data."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Selected:
    """Causes by forward selection, those that backward elimination kept, and their errors on held-out units.

    Attributes:
        as_stated: errors of the model in use as its file states it.
        held: of the model before any cause, then after every one that was kept.
        re_estimated: of the model before any cause with its uncertain parameters fitted; None where it has none.
        validation: of other fits.
        rest: what is missing beside all causes, or instead of them.
        replaced: causes that the search found, in whose place one stands that predicts better.
        compared: causes by their predictions; None where the search found what predicts as well, or explains much.
    """

    found: Selection
    kept: Selection
    as_stated: HeldOut
    held: list[HeldOut]
    re_estimated: HeldOut | None
    validation: CrossValidation
    rest: Remainder
    compared: Compared | None
    replaced: tuple[Step, ...]

    @property
    def refused(self) -> tuple[Step, ...]:
        """Causes that improve simulations of held-out units and harm those of the data as they are."""
        return self.rest.kept.steps[len(self.kept.steps) :]

    @property
    def before(self) -> HeldOut:
        """`as_stated` as `held` was measured: of whole units or of short stretches."""
        return self.as_stated.like(self.held[0])

    def compared_with(self, seed: int) -> tuple[HeldOut, bool]:
        """Errors that the first cause is compared with, and whether they are of the same fit without it."""
        return compared_with(self.kept, self.held, self.re_estimated, seed)


def select_causes(
    in_use: tuple[ExtendedModel, Accuracy],
    begun: ExtendedModel,
    data: tuple[Windows, Record],
    seed: int,
    reported: Estimated,
) -> Selected:
    """Causes beside the model in use; the search begins at `begun`, the same re-estimated where it diverges."""
    rng, (windows, _), (ship, before) = np.random.default_rng(seed), data, in_use
    validation = CrossValidation(*data)
    found = select_forward(begun, windows, fitted_start(begun, windows), rng, reported, validation)
    as_stated = validation.without(None, ship)

    def cross_validated(found: Selection) -> tuple[Selection, list[HeldOut]]:
        progress = reported.part(VALIDATED * (1 + len(found.steps)), CONCLUDED)
        return errors_as_judged(found, as_stated, validation, windows, progress, seed)

    comparable = found.steps and found.first.keys and within_stated_std(found.first)
    re_estimated = validation.of(found.first) if comparable else None
    kept, held = eliminate_backward(found, windows, cross_validated, seed, re_estimated)
    rejected = [step.chosen.fit for step in found.steps[len(kept.steps) :]]
    searched, compared = kept, None
    reached = accuracy(kept.last.ship, data[1]) if kept.steps else before
    if explains_little(reached, windows) or _imitates(kept):
        short, progress = validation.short_windows(ship), reported.part(COMPARED, CONCLUDED)
        compared = compare_predictions(begun, short, seed, progress)
        by_predictions = compared and found_by_predictions(kept, compared, data, ship, seed)
        if compared and kept.steps and not by_predictions:
            kept, compared = with_alternatives(kept, compared, seed), None
        kept, held = by_predictions or (kept, held)
    rest = with_unlisted_terms(kept, held, windows, validation, seed, rejected)
    kept, held = without_harm(rest.kept, rest.held, ship, data[1])
    return Selected(
        found=found,
        kept=kept,
        as_stated=as_stated,
        held=held,
        re_estimated=re_estimated,
        validation=validation,
        rest=rest,
        compared=compared,
        replaced=() if compared is None else searched.steps,
    )


def _imitates(kept: Selection) -> bool:
    """Whether a cause may imitate others."""
    return any(step.chosen.candidate.imitates for step in kept.steps)


def explains_little(after: Accuracy, windows: Windows) -> bool:
    """Whether a simulation explains little of some output whose error is much more than noise."""
    return bool(((after.fit < LITTLE_FIT) & more_than_noise(after, windows)).any())


def more_than_noise(after: Accuracy, windows: Windows) -> NDArray[np.bool_]:
    """(n,) whether the error of an output is much more than its noise."""
    columns = [OUTPUTS.index(name) for name in after.outputs]
    return np.asarray(after.rmse > MORE_THAN_NOISE * white_noise_std(windows.measured[..., columns]))
