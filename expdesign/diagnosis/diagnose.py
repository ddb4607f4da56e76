"""The diagnosis: from data and vessel to findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from expdesign.diagnosis.accuracy import Accuracy, accuracy, check_excitation, constant_inputs, one_step_residuals
from expdesign.diagnosis.causes import rounded
from expdesign.diagnosis.conclusions import (
    error_reductions_of,
    finding_of,
    note_beside_the_same_fit,
    note_on_divergence,
    note_on_nuisance,
    note_on_parameters_alone,
    note_on_predictions,
    note_on_random_current,
    note_on_stretches,
    note_on_unconverged,
    note_on_work,
    notes_on_data,
    notes_on_found_again,
    notes_on_rejected,
    remarks,
    sign_of,
    unit_name,
    verdict,
)
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.discriminating_manoeuvre import Proposal, most_discriminating, standard_proposals
from expdesign.diagnosis.fit import (
    CrossValidation,
    Fit,
    HeldOut,
    held_out_gain,
    judged,
    uncertain_keys,
    unmeasured_force_share,
    with_longer_windows,
    within_stated_std,
)
from expdesign.diagnosis.judgement import (
    errors_as_judged,
    explains_little,
    found_by_predictions,
    gains_on_other_runs,
    harmless_beside_the_file,
    harms,
    held_without,
    losses_without,
    more_than_noise,
    with_alternatives,
    without_harm,
    worth_writing,
)
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import fitted_start, simulate_from_measured, stable_windows
from expdesign.diagnosis.prediction_comparison import RE_ESTIMATED, Compared, compare_predictions
from expdesign.diagnosis.remainder import Missing, Remainder, with_unlisted_terms
from expdesign.diagnosis.select import (
    SELECTION_TUNING,
    Selection,
    Step,
    Suspected,
    compared_with,
    eliminate_backward,
    leading_candidates,
    select_forward,
    suspected_tests,
    two_runs_by_predictions,
    with_honest_errors,
    with_p_values_beside_all,
)
from expdesign.diagnosis.stated_parameters import (
    WrongParameters,
    parameters_alone,
    with_parameters_as_rival,
    wrong_parameters,
)
from expdesign.diagnosis.values import Diagnosis, ErrorReduction, Finding, Lead, Unexplained
from expdesign.diagnosis.vessel_file import extend, extended_model
from expdesign.errors import Diverged, InputError
from expdesign.processes import local_processes
from expdesign.progress import Estimated, silent
from expdesign.reduction import with_reduced_wind
from expdesign.signals import Record
from expdesign.vessel import Vessel

VALIDATED, COMPARED, CONCLUDED = 4.0, 80.0, 25.0
"""Work of the cross-validation of a model, of the comparison of causes by predictions, and of conclusions, in
simulations of all data."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Selected:
    """Causes by forward selection, those that backward elimination kept, and their errors on held-out units."""

    found: Selection
    kept: Selection
    as_stated: HeldOut  # errors of the model in use as its file states it
    held: list[HeldOut]  # of the model before any cause, then after every one that was kept
    # of the model before any cause with its uncertain parameters fitted; None where it has none
    re_estimated: HeldOut | None
    validation: CrossValidation  # of other fits
    rest: Remainder  # what is missing beside all causes, or instead of them
    # causes by their predictions; None where the search found what predicts as well, or explains much
    compared: Compared | None
    replaced: tuple[Step, ...]  # causes that the search found, in whose place one stands that predicts better
    suspected: tuple[Suspected, ...]  # tests of what was named before
    wrong: WrongParameters | None  # parameters of the file that are wrong beside the causes

    @property
    def refused(self) -> tuple[Step, ...]:
        """Causes that improve simulations of held-out units and harm those of the data as they are."""
        return self.rest.kept.steps[len(self.kept.steps) :]

    def is_named(self, step: Step) -> bool:
        """Whether parameters that are told as wrong are all that a cause changes, or it is another choice of them."""
        if self.wrong is None:
            return False
        told = self.wrong.step.chosen
        return step.chosen.candidate.cause == told.candidate.cause or {*step.chosen.keys} <= {*told.keys}

    @property
    def before(self) -> HeldOut:
        """`as_stated` as `held` was measured: of whole units or of short stretches."""
        return self.as_stated.like(self.held[0])

    def compared_with(self, seed: int) -> tuple[HeldOut, bool]:
        """Errors that the first cause is compared with, and whether they are of the same fit without it."""
        if self.wrong is not None:
            return self.wrong.alone, False
        return compared_with(self.kept, self.held, self.re_estimated, seed)


def select_causes(
    in_use: tuple[ExtendedModel, Accuracy],
    begun: ExtendedModel,
    data: tuple[Windows, Record],
    seed: int,
    reported: Estimated,
    suspected: Sequence[str] = (),
) -> Selected:
    """Causes beside the model in use; the search begins at `begun`, the same re-estimated where it diverges."""
    rng, (windows, _), (ship, before) = np.random.default_rng(seed), data, in_use
    validation = CrossValidation(*data)
    first = suspected_tests(begun, windows, suspected)
    found = select_forward(begun, windows, fitted_start(begun, windows), rng, reported, validation, suspected)
    as_stated = validation.without(None, ship)

    def cross_validated(found: Selection) -> tuple[Selection, list[HeldOut]]:
        progress = reported.part(VALIDATED * (1 + len(found.steps)), CONCLUDED)
        return errors_as_judged(found, as_stated, validation, windows, progress, seed)

    re_estimated = validation.of(found.first) if found.steps and found.first.keys else None
    kept, held = eliminate_backward(found, windows, cross_validated, seed, re_estimated)
    kept = with_parameters_as_rival(kept, held, validation, windows, seed)
    kept, held = harmless_beside_the_file(kept, ship, as_stated, validation, data, seed) or (kept, held)
    rejected = [step.chosen.fit for step in found.steps[len(kept.steps) :]]
    searched, compared = kept, None
    reached = accuracy(kept.last.ship, data[1]) if kept.steps else before
    dropped = {step.chosen.candidate.cause for step in found.steps} if not kept.steps else set()
    little = explains_little(reached, windows) or any(step.chosen.candidate.imitates for step in kept.steps)
    # other values of many parameters imitate any cause: where these are no finding, any may be, beside the file's
    imitated = not little and RE_ESTIMATED in dropped
    if dropped or little:
        short, progress = validation.short_windows(ship), reported.part(COMPARED, CONCLUDED)
        by_predictions = None
        if not imitated:
            compared = compare_predictions(begun, short, seed, progress, () if little else dropped)
            by_predictions = compared and found_by_predictions(kept, compared, data, ship, seed)
        if by_predictions and not little and by_predictions[0].steps[0].chosen.candidate.cause not in dropped:
            by_predictions = None  # where much is explained, predictions confirm what likelihoods found, and no more
        if (imitated or (compared and little)) and not by_predictions and not kept.steps and found.first.keys:
            stated = compare_predictions(ship.with_known_parameters(), short, seed, progress)
            rival = validation.of(found.first).apart()  # by parts of runs they flatter themselves
            by_predictions = stated and found_by_predictions(kept, stated, data, ship, seed, rival)
            compared = compared or stated
        if compared and kept.steps and not by_predictions:
            kept, compared = with_alternatives(kept, compared, seed), None
        kept, held = by_predictions or (kept, held)
    kept, held = worth_writing(kept, held, ship, as_stated, validation, data, seed)
    rest = with_unlisted_terms(kept, held, windows, validation, seed, rejected)
    counted, (kept, held) = kept.steps, without_harm(rest.kept, rest.held, ship, data[1])
    if len(kept.steps) > 1 and kept.steps != counted:
        without = partial(held_without, kept, held, validation, windows)
        kept = two_runs_by_predictions(with_p_values_beside_all(kept), held, without, windows)
    return Selected(
        found=found,
        kept=with_honest_errors(kept),
        as_stated=as_stated,
        held=held,
        re_estimated=re_estimated,
        validation=validation,
        rest=rest,
        compared=compared,
        replaced=() if compared is None else searched.steps,
        suspected=first,
        wrong=None if compared else wrong_parameters(kept, held, validation, windows, seed, ship=ship),
    )


# gain of fit [points] from which parameters re-estimated within their standard deviations are the verdict
LEAST_GAIN_WITHIN_STD = 1.0
MOST_SAMPLES = 400_000  # eleven hours at 10 Hz; 36,000 of 1 s take about 840 MiB of memory, the program's own included
# compared samples up to which other processes save no time, because they are started and fits are sent to them: of an
# hour at 1 Hz, a fifth of the work can be shared, and takes twice as long elsewhere
FEW_SAMPLES = 10_000
SIMULATED = 18.0  # work before the selection, in simulations of all data


def diagnose(
    vessel: Vessel,
    record: Record,
    *,
    seed: int = 0,
    proposals: Sequence[Proposal] = (),
    suspected: Mapping[str, str] | None = None,
    progress: Estimated | None = None,
) -> Diagnosis:
    """Find the causes of the simulation error, extend the model by them, and measure the gain.

    Args:
        vessel: the model in use; parameters with a standard deviation are re-estimated within it, others are known.
        record: measured data; velocities over ground, inputs, perhaps pose, wind and depth.
        seed: of the draws behind adjusted p-values and gain intervals.
        proposals: manoeuvres that may distinguish causes; standard ones when empty.
        suspected: effects that were named before, and by whom, in words; they are tested first.
        progress: of the diagnosis and of what follows it, in simulations of all data.

    Raises:
        InputError: more than `MOST_SAMPLES` samples.
        NotInformative: the data cannot support a diagnosis; the message says what is missing.
        Diverged: the model in use cannot be simulated over the data.
    """
    samples = sum(map(len, record.batches))
    if samples > MOST_SAMPLES:
        raise InputError(f"the data have {samples} samples, expected at most {MOST_SAMPLES}: give fewer runs at a time")
    reported = Estimated(silent) if progress is None else progress
    reported.tell(
        "simulating the model in use", SIMULATED + SELECTION_TUNING.first_rounds * SELECTION_TUNING.round_work
    )
    record = with_reduced_wind(record, vessel.sensors)
    ship = extended_model(vessel, record)
    windows = stable_windows(ship, record)
    check_excitation(ship, windows)
    unstable = Diverged(
        f"vessel {vessel.name!r}: its simulation of the data diverges; the model is unstable. Estimate its parameters "
        f"from these runs and others first (`expdesign estimate --method oe`), then diagnose what that writes"
    )
    if simulate_from_measured(ship, windows).diverged:
        raise unstable
    begun, windows = with_longer_windows(ship, record, windows)
    motion = simulate_from_measured(ship, windows)
    reported.done = SIMULATED
    before = accuracy(ship, record)
    few = windows.measured[..., 0].size <= FEW_SAMPLES
    try:
        with local_processes(1) if few else nullcontext():
            chosen = select_causes((ship, before), begun, (windows, record), seed, reported, [*(suspected or {})])
    except FloatingPointError:  # what the model's parameters do to its motion diverges
        raise unstable from None
    concluding = reported.part(CONCLUDED, 0.0)
    concluding("looking for manoeuvres that distinguish causes", 0.0)
    proposals = proposals or standard_proposals(windows, ship.model.inputs, windows.sample_s)
    findings = _findings(chosen, windows, proposals, seed)
    shown = {one.effect: one for one in chosen.suspected if one.confirmed}
    losses = losses_without(chosen.kept, chosen.held, chosen.validation, windows)
    own = [bool(shown.keys() & {*step.chosen.keys}) for step in chosen.kept.steps]
    order = np.lexsort([-losses, ~np.array(own, dtype=bool)]).tolist()  # what was named before and is shown comes first
    beside = () if chosen.wrong is None else (chosen.wrong.step,)
    steps = [*(chosen.kept.steps[index] for index in order), *beside]
    found = {key for step in steps for key in step.chosen.keys}
    first = [f"{(suspected or {})[key]}; {one.in_words}" for key, one in shown.items() if key not in found]
    ranked = (*(findings[index] for index in order), *findings[len(order) :])
    harmless = bool(findings) or not harms(ship, chosen.kept.last.ship, record)
    within = _gains_within_std(chosen, ship, seed) if harmless and not findings else ()
    refined = harmless and (steps or ship.stated_std or within)
    final = chosen.kept.last.ship if refined else ship
    last = chosen.kept.last
    estimated = ((), np.zeros((0, 0))) if chosen.kept.beside_stated else (last.keys, last.covariance)
    extended, not_written = (
        extend(vessel, final, _standard_errors(chosen.kept), estimated) if refined else extend(vessel, final, {})
    )
    after = before if final is ship else accuracy(final, record)
    unexplained = _unexplained(chosen, after, windows, seed)
    unit = unit_name(windows, in_stretches=chosen.held[0].in_stretches)
    signs = _signs(chosen, after, windows, seed)
    refused = [step.chosen.candidate.cause for step in chosen.refused]
    kinds = _in_words(chosen.rest.kinds)
    instead = [words for words in _in_words(chosen.rest.instead) if words not in kinds]
    concluding("measuring the gain on held-out runs", 1.0)
    return Diagnosis(
        vessel=vessel,
        extended=extended,
        record=record,
        windows=windows,
        unit=unit,
        before=before,
        after=after,
        findings=ranked,
        verdict=verdict(ranked, before, unit, unexplained, within, signs, kinds, record.faults, first),
        unexplained=unexplained,
        simulated_before=motion.predicted,
        simulated_after=simulate_from_measured(final, windows).predicted,
        errors=tuple(step.before.linear.motion.error for step in steps),
        residuals=one_step_residuals(ship, windows),
        step_residuals=tuple(one_step_residuals(step.before.ship, windows) for step in steps),
        notes=(
            *(
                f"{(suspected or {})[test.effect]}; {test.in_words}"
                for test in chosen.suspected
                if test.effect in found or not test.confirmed
            ),
            *notes_on_data(vessel, record, windows, constant_inputs(ship, windows)),
            *note_on_divergence(before, windows, re_estimated=begun is not ship, uncertain=bool(uncertain_keys(ship))),
            *remarks(unit, unexplained, signs, refused, instead, kinds if ranked else ()),
            *_notes_on_selection(chosen, unit, seed),
            *not_written,
        ),
        screened=_smallest_p_values(chosen.kept),
    )


def _gains_within_std(chosen: Selected, ship: ExtendedModel, seed: int) -> tuple[ErrorReduction, ...]:
    """What uncertain parameters gain within their standard deviations on held-out units; none where that is unclear.

    It has to show in runs that none of them was fitted to, too: parts of the same runs share weather and manoeuvres.
    """
    gain, (low, _) = held_out_gain(chosen.before, chosen.held[0], seed)
    if not within_stated_std(chosen.kept.first) or not (gain > LEAST_GAIN_WITHIN_STD and low > 0):
        return ()
    if not gains_on_other_runs([chosen.as_stated, chosen.validation.of(chosen.kept.first)], seed):
        return ()
    reductions = error_reductions_of(ship.model.outputs, chosen.before, chosen.held[0], seed)
    return reductions if any(item.is_certain for item in reductions) else ()


def _unexplained(chosen: Selected, after: Accuracy, windows: Windows, seed: int) -> Unexplained | None:
    """What the simulation does not explain, where that is much more than noise; None elsewhere."""
    if not explains_little(after, windows):
        return None
    if chosen.compared is not None:  # each was compared alone, which tells nothing of it beside one that was found
        causes = () if chosen.kept.steps else chosen.compared.causes[: SELECTION_TUNING.leads]
        leads = [Lead(item.cause, item.gain, item.gain_interval) for item in causes]
    else:
        base = chosen.held[len(chosen.kept.steps)]
        fitted = leading_candidates(chosen.kept.last, windows, chosen.kept.last_tests)
        held = [chosen.validation.measured_like(base, item.fit) for item in fitted]
        gains = [held_out_gain(base, one, seed) for one in held]
        leads = [Lead(item.candidate.cause, *gain, item.parameters) for item, gain in zip(fitted, gains, strict=True)]
    return Unexplained(
        outputs=after.outputs,
        fit=after.fit,
        force_share=unmeasured_force_share(chosen.kept.last.linear, after.outputs),
        leads=tuple(sorted((lead for lead in leads if lead.gain > 0), key=lambda lead: -lead.gain)),
        unit=unit_name(windows, in_stretches=chosen.compared is not None or chosen.held[0].in_stretches),
    )


def _signs(chosen: Selected, after: Accuracy, windows: Windows, seed: int) -> tuple[Lead, ...]:
    """Causes that are significant in a test and no findings, surest first; none where little but noise is left.

    Their gain is against the same model without them, fitted as they are.
    """
    kept = {id(step.chosen.candidate) for step in chosen.rest.kept.steps}
    rejected = [one for one in chosen.found.steps if id(one.chosen.candidate) not in kept and not chosen.is_named(one)]
    if not more_than_noise(after, windows).any():
        return ()
    found: dict[str, Lead] = {}
    for step in rejected:
        pair = judged([chosen.validation.of(one) for one in (step.before, step.chosen.fit)])
        cause = step.chosen.candidate.cause
        gain = held_out_gain(pair[0], pair[1], seed)
        found.setdefault(cause, Lead(cause, *gain, step.chosen.parameters))
    return tuple(found.values())


def _in_words(found: Sequence[Missing]) -> tuple[str, ...]:
    """What no cause is and no model can get, with its size."""
    return tuple(f"{item.words} ({rounded(item.value, item.std)} {item.unit}".rstrip() + ")" for item in found)


def _findings(chosen: Selected, windows: Windows, proposals: Sequence[Proposal], seed: int) -> tuple[Finding, ...]:
    """Findings in the order of the selection, wrong parameters of the file last."""
    kept, wrong = chosen.kept, chosen.wrong
    before = [chosen.compared_with(seed)[0], *chosen.held[1:]] if kept.steps else []
    found = [(step, (before[index], chosen.held[index + 1])) for index, step in enumerate(kept.steps)]
    found += [] if wrong is None else [(wrong.step, (chosen.before, wrong.alone))]
    tells = [_discriminating(step, kept.last, proposals, windows) for step, _ in found]
    return tuple(
        finding_of(step, kept.last, pair, seed, windows, would_tell_apart=manoeuvre)
        for (step, pair), manoeuvre in zip(found, tells, strict=True)
    )


def _discriminating(step: Step, found: Fit, proposals: Sequence[Proposal], windows: Windows) -> str | None:
    """The manoeuvre that distinguishes a cause from its alternatives best; None where there are none."""
    if not step.alternatives:
        return None
    std = np.where(np.isfinite(found.noise.std), found.noise.std, np.inf)
    return most_discriminating(found.ship, [other.ship for other in step.alternatives], proposals, std, windows)


def _notes_on_selection(chosen: Selected, unit: str, seed: int) -> tuple[str, ...]:
    replaced = {id(step.chosen.candidate) for step in chosen.replaced}
    left = (step for step in chosen.found.steps if not chosen.is_named(step))
    others = tuple(step for step in left if id(step.chosen.candidate) not in replaced)
    rejected = notes_on_rejected(replace(chosen.found, steps=others), chosen.rest.kept, unit)
    if chosen.compared is not None and chosen.kept.steps:
        how = note_on_predictions(chosen.before, chosen.held[1], chosen.kept, chosen.replaced, seed)
        notes = [*how, *rejected]
    else:
        notes = [
            *note_on_stretches(chosen.held, beside_stated=chosen.kept.beside_stated),
            *(note_beside_the_same_fit(chosen.kept) if chosen.kept.steps and chosen.compared_with(seed)[1] else ()),
            *rejected,
        ]
        alone = parameters_alone(chosen.kept, chosen.held, chosen.validation)
        if alone is not None and chosen.wrong is None:
            first = chosen.kept.steps[0].chosen
            cause = sign_of(first.candidate.cause, first.parameters)
            notes.append(note_on_parameters_alone(chosen.before, alone, chosen.held[1], cause, seed))
        elif alone is None and chosen.kept.first.keys:
            notes += note_on_nuisance(chosen.before, chosen.held[0], seed)
    notes += (*notes_on_found_again(chosen.kept), *note_on_work(chosen.found))
    return (*notes, *note_on_unconverged(chosen.held), *note_on_random_current(chosen.kept.last.noise))


def _standard_errors(found: Selection) -> dict[str, float]:
    profiled = [step.chosen.profiled for step in found.steps if step.chosen.profiled is not None]
    return {key: found.last.std(key) for key in found.last.keys} | dict(profiled)


def _smallest_p_values(found: Selection) -> tuple[tuple[str, float], ...]:
    """(cause, smallest adjusted p-value) of the round that found nothing more, smallest first."""
    best: dict[str, float] = {}
    for item in found.last_tests:
        best[item.candidate.cause] = min(item.adjusted, best.get(item.candidate.cause, 1.0))
    return tuple(sorted(best.items(), key=lambda pair: pair[1]))
