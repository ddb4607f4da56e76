"""Parameters that the vessel file states wrongly: another answer than a cause, or a finding beside causes.

Parameters far beyond their stated standard deviations are no model that the file allows. So what a cause gains is
measured on the file as it is, and part of that is the gain of the parameters, which are fitted with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import (
    CrossValidation,
    Fit,
    FitOptions,
    HeldOut,
    beyond_stated_std,
    fit,
    gains_for_certain,
    log_likelihood_gain,
    within_stated_std,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.prediction_comparison import RE_ESTIMATED
from expdesign.diagnosis.select import (
    SELECTION_TUNING,
    FittedCandidate,
    Rival,
    Selection,
    Step,
    certain_in_predictions,
    only_nuisance,
    open_candidates,
    shows_for_certain,
    wald_p_value,
)

AS_IT_IS = FitOptions(steps=0)


def parameters_alone(kept: Selection, held: Sequence[HeldOut], validation: CrossValidation) -> HeldOut | None:
    """Errors of all parameters re-estimated without any cause, where they have a part in the gain of the first one.

    A fit without any cause that needs parameters far beyond their standard deviations is no model that the file allows,
    so gains are measured on the file as it is. Part of such a gain is then that of the parameters, which are fitted
    beside the cause. None elsewhere.

    Args:
        held: errors on held-out units of the model before any cause, then after every one.
    """
    exceeded = kept.steps and kept.first.keys and not kept.beside_stated and not within_stated_std(kept.first)
    if not exceeded or only_nuisance(kept.steps[0], kept):
        return None
    return validation.of(kept.first).like(held[1])


def with_parameters_as_rival(
    kept: Selection, held: Sequence[HeldOut], validation: CrossValidation, windows: Windows, seed: int
) -> Selection:
    """The causes, the first with all parameters as an alternative unless it gains for certain on them re-estimated.

    It may gain in simulations, or in predictions from one sample to the next. Arguments as of `parameters_alone`.
    """
    alone = parameters_alone(kept, held, validation)
    if alone is None or gains_for_certain([alone, held[1]], seed):
        return kept
    share = certain_in_predictions(kept.steps[0], (alone, held[1]), windows, seed)
    return kept if share >= SELECTION_TUNING.least_predicted else or_parameters(kept, kept.first, windows)


def or_parameters(kept: Selection, first: Fit, windows: Windows) -> Selection:
    """The causes, all parameters as fitted before any of them an alternative to the first."""
    step, *others = kept.steps
    candidates = [item for item in open_candidates(first, windows) if item.cause == RE_ESTIMATED]
    if not candidates or any(item.candidate.cause == RE_ESTIMATED for item in step.alternatives):
        return kept
    rival = Rival(candidate=max(candidates, key=lambda item: item.size), ship=first.ship, trails_by=0.0)
    return replace(kept, steps=(replace(step, alternatives=(*step.alternatives, rival)), *others))


@dataclass(frozen=True, kw_only=True, eq=False)
class WrongParameters:
    """Parameters of the file that are wrong beside the causes that were found."""

    step: Step  # as that of a cause, beside all others
    alone: HeldOut  # errors on held-out units of the model re-estimated without any cause


def wrong_parameters(
    kept: Selection,
    held: Sequence[HeldOut],
    validation: CrossValidation,
    windows: Windows,
    seed: int,
    *,
    ship: ExtendedModel,
) -> WrongParameters | None:
    """Parameters that stay beyond their standard deviations beside the causes, and gain for certain without them.

    None where they return to within them: then they made up for a cause. None, too, where they are another answer than
    the first cause, or where those of the file run away, in windows that re-estimated ones allow. Arguments as of
    `parameters_alone`, and the model in use.
    """
    alone = parameters_alone(kept, held, validation)
    if alone is None or any(item.candidate.cause == RE_ESTIMATED for item in kept.steps[0].alternatives):
        return None
    named = {key for step in kept.steps for key in step.chosen.keys}
    keys = tuple(key for key in beyond_stated_std(kept.last) if key.startswith("theta:") and key not in named)
    if not keys or not shows_for_certain(held[0], alone, seed):
        return None
    try:
        stated = fit(ship.with_known_parameters(), windows, (), starts=kept.first.starts, options=AS_IT_IS)
    except FloatingPointError:
        return None
    gain = log_likelihood_gain(stated, kept.first)
    chosen = FittedCandidate(
        candidate=Candidate(cause=RE_ESTIMATED, free=dict.fromkeys(keys, 0.0)),
        fit=kept.first,
        likelihood_gain=gain,
        penalised_gain=gain - SELECTION_TUNING.price * len(keys),
        keys=keys,
    )
    p_value = wald_p_value(chosen, kept.last)
    step = Step(chosen=chosen, p_value=p_value, alternatives=(), before=stated, tests=())
    return WrongParameters(step=step, alone=alone) if p_value <= SELECTION_TUNING.level else None
