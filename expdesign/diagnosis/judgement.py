"""How causes are judged: in whole held-out runs or short stretches of them, beside which parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import CrossValidation, HeldOut, held_out_gain, judged, leads_away, within_stated_std
from expdesign.diagnosis.select import Selection, beside_stated_parameters, improves_held_out, only_nuisance
from expdesign.progress import Progress, within

LITTLE_FIT = 50.0
"""Fit of an output [%] below which a simulation explains little."""


def errors_as_judged(
    found: Selection, as_stated: HeldOut, validation: CrossValidation, windows: Windows, progress: Progress, seed: int
) -> tuple[Selection, list[HeldOut]]:
    """Causes beside uncertain parameters fitted with them, or beside those of the file where these simulate better.

    Errors are those of the model before any cause, then after every step. Parameters re-estimated within their standard
    deviations may simulate held-out units worse than those of the file, which many other data may have gone into. Then
    a cause has to improve on the file's parameters, and is fitted beside them: else it would have to make up for the
    loss. A file with which the simulation leads away is no such file. Nor is one that simulates neither whole units nor
    stretches of them better for certain once the causes are in the model: parameters that were fitted without a cause
    imitate some of it.
    """
    short = validation.short_windows(found.first.ship)
    if found.beside_stated:
        again = beside_stated_parameters(found, windows, short) or found
        return again, _ahead([as_stated, *(validation.of(step.chosen.fit) for step in again.steps)])
    held = _cross_validated(found, as_stated, validation, progress)
    if found.steps and not improves_held_out(found, held, seed)[0]:
        held = _where_certain(held, seed)
    uncertain = found.steps and found.first.keys and not leads_away(as_stated)
    if not uncertain or not as_stated.mean_fit > validation.of(found.first).mean_fit:
        return found, held
    known = beside_stated_parameters(found, windows, short)
    if known is None:
        return found, held
    whole = [validation.of(one.last) for one in (found, known)]
    if not _gains_for_certain(whole, seed) and not _gains_for_certain(_ahead(whole), seed):
        return found, held
    return known, _ahead([as_stated, *(validation.of(step.chosen.fit) for step in known.steps)])


def _where_certain(held: list[HeldOut], seed: int) -> list[HeldOut]:
    """Errors in short stretches, if a first cause gains there for certain; else as given.

    Whole runs are few, and an error early in a run stays in its simulation.
    """
    if held[0].in_stretches or any(item.ahead is None for item in held):
        return held
    return _ahead(held) if _gains_for_certain(_ahead(held[:2]), seed) else held


def _gains_for_certain(held: Sequence[HeldOut], seed: int) -> bool:
    """Whether the second of two models gains, by an interval that excludes zero."""
    _, (low, _) = held_out_gain(held[0], held[1], seed)
    return low > 0.0


def _ahead(held: Sequence[HeldOut]) -> list[HeldOut]:
    """Errors in short stretches."""
    return [item.ahead() for item in held if item.ahead is not None]


def _cross_validated(
    found: Selection, as_stated: HeldOut, validation: CrossValidation, progress: Progress
) -> list[HeldOut]:
    """Of the model before any cause, then after every step.

    The gain of uncertain parameters within their standard deviations is not attributed to a cause. So the model in use
    has them fitted, unless it simulates held-out units well as it is, and better: what a cause repairs of a worse fit
    is no gain. If the first cause is that they exceed their standard deviations, it gets their gain, and the model is
    not fitted. Neither is it where a fit without any cause needs parameters far beyond them: that fit is no model that
    the vessel file allows.
    """
    fitted = bool(found.first.keys) and not any(only_nuisance(step, found) for step in found.steps[:1])
    fitted = fitted and (within_stated_std(found.first) or not found.steps)
    fits = [*[found.first] * fitted, *(step.chosen.fit for step in found.steps)]
    results = [as_stated]
    for number, item in enumerate(fits):
        part = within(progress, number / len(fits), (number + 1) / len(fits))
        results.append(validation.of(item, part))
    if fitted:
        results[:2] = [results[0] if _simulates_better(*results[:2]) else results[1]]
    return judged(results)


def _simulates_better(as_stated: HeldOut, fitted: HeldOut) -> bool:
    one, other = (np.nan_to_num(held.fit, nan=-np.inf) for held in (as_stated, fitted))
    return bool(one.min() >= LITTLE_FIT and one.mean() > other.mean())
