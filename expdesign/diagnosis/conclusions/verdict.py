"""The verdict of a diagnosis: a sentence of what is missing, one of how sure that is, and one of what to do.

A fault of the record itself comes first, and then is what to do; so does a model that is unfit for the data.

What else is known goes into remarks.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import numpy as np

from expdesign.conventions import AXES, listed, plus_minus
from expdesign.diagnosis.accuracy import Accuracy
from expdesign.diagnosis.causes import CAUSES, SENSOR_CAUSES
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import AHEAD_S, validation_units
from expdesign.diagnosis.judgement import LITTLE_FIT
from expdesign.diagnosis.select import SELECTION_TUNING
from expdesign.diagnosis.values import ErrorReduction, Finding, Lead, Unexplained
from expdesign.values import Array

DIVERGED_FIT = -300.0  # fit [%] below which the simulation has diverged from the ship; the number then has no meaning
MISSING_EFFECTS = {cause.name: cause.missing for cause in CAUSES if cause.missing}
"""Cause -> missing effect of the simulation."""
MANOEUVRES = {
    "zigzag": "a zig-zag",
    "zigzag_long": "a long zig-zag",
    "turning_circle": "a turning circle",
    "turning_circle_port": "a turning circle to port",
    "acceleration": "an acceleration",
    "deceleration": "a deceleration",
    "inward_spiral": "an inward spiral",
    "straight": "a straight run",
    "telegraph": "a run of random orders",
}
"""Standard proposals in words; those of a scenario's dictionary keep their names."""

MOST_SIZES = 2  # numbers of a cause in a sentence; the table has all
MOST_NAMED = 3  # parameters, or equivalent causes, in a sentence
SENSORS = tuple(cause.name for cause in SENSOR_CAUSES)
WEATHER = ("current", "wind")


def _missing_effect(cause: str, parameters: Sequence[str] = ()) -> str:
    """Missing effect of a cause, e.g. of "missing_term:Y_r"; wrong values of parameters by their names."""
    kind, _, term = cause.partition(":")
    if kind == "unlisted_term":
        return term
    if kind == "parameters" and parameters:
        named = [*parameters[:MOST_NAMED], *["others"] * (len(parameters) > MOST_NAMED)]
        return f"the correct value{'s' if len(parameters) > 1 else ''} of {listed(named)}"
    return f"the term {term}" if kind == "missing_term" else MISSING_EFFECTS[kind]


def effect_in_words(cause: str, keys: Sequence[str]) -> str:
    """Missing effect of a cause with these effects; an offset is named after its actuators."""
    kind, _, group = (keys or ("",))[0].partition(":")
    parameters = [key.split(":", 1)[1] for key in keys if key.startswith("theta:")]
    return f"the offset of the {group} angle" if kind == "offset" else _missing_effect(cause, parameters)


def sign_of(cause: str, parameters: Sequence[str] = ()) -> str:
    """Missing effect of a cause where nothing says that it is certain."""
    return as_sign(_missing_effect(cause, parameters))


def as_sign(effect: str) -> str:
    """What may not be certain is not called correct: of the correct inertia, "an inertia unlike the file's"."""
    noun = effect.removeprefix("the correct ")
    article = "" if noun.startswith("values") else "an " if noun[0] in "aeiou" else "a "
    return effect if noun == effect else f"{article}{noun} unlike the file's"


class Claim(Enum):
    """What is said of a finding, the surest first."""

    LACKED = "the simulation lacks {what}"
    BETTER = "simulations get better with {what}, but chance may explain that"
    SHOWN = "the record shows {what}, but whether simulations get better with {them} is not certain"
    LIKELY = "the likeliest cause is {what}, but nothing is certain of {them}"

    @staticmethod
    def of(item: Finding) -> Claim:
        """What may be said: by its p-value, and by whether held-out data are simulated better with it for certain.

        Predictions from sample to sample alone make nothing more certain than its p-value does.
        """
        if item.p_value <= SELECTION_TUNING.level:
            return Claim.LACKED if simulates_better(item) else Claim.SHOWN
        return Claim.BETTER if simulates_better(item) else Claim.LIKELY


def doubt(item: Finding) -> str:
    """A sentence of what is not certain of a finding; empty where all is."""
    but = Claim.of(item).value.partition(", but ")[2]
    return f"{_capital(but.format(them='it'))}." if but else ""


def simulates_better(item: Finding) -> bool:
    """Whether the simulated error of some output, or the mean fit, of held-out data gets visibly better for certain."""
    by_mean_fit = item.gain >= SELECTION_TUNING.least_gain_points and item.gain_interval[0] > 0.0
    return by_mean_fit or any(reduction.is_certain for reduction in item.error_reductions)


def _of(item: Finding, effect: str) -> str:
    """An effect as the simulation lacks it, or as it is told while that is not certain."""
    return effect if Claim.of(item) is Claim.LACKED else as_sign(effect)


def lacking(item: Finding) -> str:
    """Missing effect of a finding."""
    return _of(item, effect_in_words(item.cause, item.keys))


def alternatives(item: Finding) -> list[str]:
    """What the data cannot tell from a finding, in words."""
    words = item.alternatives or [_missing_effect(name) for name in item.not_distinguishable_from]
    words = [word for word in dict.fromkeys(_of(item, word) for word in words) if word != lacking(item)]
    return [*words[:MOST_NAMED], *["others"] * (len(words) > MOST_NAMED)]


def manoeuvre(name: str) -> str:
    """A proposal in words."""
    return MANOEUVRES.get(name, f"the manoeuvre {name}")


def benefit(item: Finding) -> str:
    """Effect of adding it, told by the output whose error falls most, of those of which that is certain.

    E.g. "cuts the sway error by 52 % (45 to 60 %)". Where there is none, by the mean fit, then by predictions.
    """
    certain = [reduction for reduction in item.error_reductions if reduction.is_certain]
    if certain:
        return _reduction(max(certain, key=lambda reduction: reduction.share))
    if simulates_better(item):
        low, high = item.gain_interval
        return f"raises the mean fit by {item.gain:.1f} points ({low:.1f} to {high:.1f})"
    return "reduces no error for certain" if item.predicted is None else _prediction(item.predicted)


def _prediction(item: ErrorReduction) -> str:
    interval = f"({_percent(item.low)} to {_percent(item.high)} %)"
    return f"takes {_percent(item.share)} % {interval} off the squared error of predictions from sample to sample"


def _reduction(best: ErrorReduction, verbs: tuple[str, str] = ("halves", "cuts")) -> str:
    halves, cuts = verbs
    interval = f"({_percent(best.low)} to {_percent(best.high)} %)"
    if abs(best.share - 0.5) < 0.025:
        return f"{halves} the {AXES[best.output]} error {interval}"
    return f"{cuts} the {AXES[best.output]} error by {_percent(best.share)} % {interval}"


def unit_name(windows: Windows, *, in_stretches: bool = False) -> str:
    """Unit of held-out data: runs, stretches where there are too few runs, or short stretches of either."""
    if in_stretches:
        return f"{AHEAD_S:g} s stretches of runs"
    return "runs" if np.array_equal(validation_units(windows), windows.batch) else "stretches"


def verdict(
    findings: Sequence[Finding],
    before: Accuracy,
    unit: str = "runs",
    unexplained: Unexplained | None = None,
    within_std: Sequence[ErrorReduction] = (),
    signs: Sequence[Lead] = (),
    kinds: Sequence[str] = (),
    faults: Sequence[str] = (),
    confirmed: Sequence[str] = (),
) -> str:
    """What the simulation lacks, how sure that is, and what to do: three sentences, a fault of the record first.

    What was named before and is shown stands in front of them, unless a finding is the same.

    Args:
        findings: by what the model loses without each.
        before: accuracy of the model in use.
        unit: what gains are measured on.
        unexplained: what remains, if that is much.
        within_std: what uncertain parameters gain within their standard deviations, if that is clear.
        signs: causes that are no findings, where the error is more than noise.
        kinds: what the error looks like, which no cause of the catalogue is and no model can get.
        faults: of the record itself, which are to be looked at before any cause is believed.
        confirmed: tests of what was named before and is shown.
    """
    if findings and _is_unfit(before, findings, unexplained):
        unfit = f"The model is unfit for these runs, {accuracy_in_words(before)}"
        sentences = [
            f"{unfit}: estimate it anew before a cause is believed",
            *_of_findings(findings, unit, unexplained)[:-1],
        ]
    elif findings:
        sentences = _of_findings(findings, unit, unexplained)
    elif kinds:
        what = f"No cause of the catalogue matches the error: it looks like {listed(kinds)}"
        sentences = [what, _accuracy(before), "Look for that in the ship and her instruments, and keep the vessel file"]
    elif within_std:
        certain = [item for item in within_std if item.is_certain] or list(within_std)
        best = _reduction(max(certain, key=lambda item: item.share), verbs=("halve", "cut"))
        what = f"{NO_ERROR} beyond the stated standard deviations of its parameters"
        sure = f"Re-estimated within these, the parameters {best} on {unit} held out"
        sentences = [what, sure, "Use the extended vessel file, which has them"]
    elif unexplained is not None:
        what = "The simulation explains little of these data and no cause is certain"
        leads = _with_units(unexplained, signs, unit)
        named = [f"; the best candidate is {_lead(one)} on {of} held out" for one, of in leads]
        sentences = [what, "".join([_capital(_fits(unexplained)), *named[:1]]), MORE_DATA]
    elif signs:
        better = [f"; {_lead(lead)} improves nothing for certain on {unit} held out" for lead in signs if lead.gain > 0]
        sure = "".join([_accuracy(before), *better[:1]])
        sentences = ["No cause of the remaining error is certain", sure, f"Keep the vessel file; {MORE_RUNS}"]
    elif (before.fit < LITTLE_FIT).any():
        what = "The simulation explains little of these data, and no cause of the catalogue explains more"
        noise = "what remains is like the noise of the sensors, which may hide the motion or an error of it"
        sentences = [what, f"{_accuracy(before)}; {noise}", MORE_DATA]
    else:
        sentences = [NO_ERROR, _accuracy(before), "Keep the vessel file"]
    if faults:  # what is to be done, and a record that is in doubt clears no model
        known = [_accuracy(before)] if sentences[0].startswith(NO_ERROR) else sentences[:-1]
        sentences = [f"Look at the record first: {faults[0].rstrip('.')}", *known]
    if confirmed:
        sentences = [*confirmed, *(text.replace(NO_ERROR, NO_ERROR.replace("no", "no other")) for text in sentences)]
    return " ".join(text if text.endswith("?") else f"{text}." for text in sentences)


NO_ERROR = "These data show no error of the model"
MORE_RUNS = "more runs would tell"
MORE_DATA = "Keep the vessel file; sail more runs, and measure wind and current, before it is changed"


def _is_unfit(before: Accuracy, findings: Sequence[Finding], unexplained: Unexplained | None) -> bool:
    """Whether the model in use simulates some output worse than a constant, and what is found is no single cause of it.

    With what is found it does so still, or that is that several parameters are wrong.
    """
    several = any(item.cause == "parameters" and len(item.keys) > 1 for item in findings)
    still = unexplained is not None and bool((unexplained.fit < 0.0).any())
    return bool((before.fit < 0.0).any()) and (several or still)


def _of_findings(findings: Sequence[Finding], unit: str, unexplained: Unexplained | None) -> list[str]:
    """Three sentences: what is missing, the surest first, how much better data are explained, and what to do."""
    what = []
    for claim in Claim:
        if some := [item for item in findings if Claim.of(item) is claim]:
            what.append(claim.value.format(what=listed(_named(some)), them="them" if len(some) > 1 else "it"))
    sure = _benefits(findings, unit)
    if unexplained is not None:
        sure += f"; much remains unexplained, {_fits(unexplained)}"
    return [_capital("; ".join(what)), sure, _advice(findings)]


def _named(findings: Sequence[Finding]) -> list[str]:
    """Each with its sizes and its alternatives."""
    found = []
    for item in findings:
        others = alternatives(item)
        alike = " (these data cannot tell which)" if others else ""
        found.append(listed([_with_sizes(item), *others], "or") + alike)
    return found


TOWARDS = {"north_mps": "north", "east_mps": "east"}


def _with_sizes(item: Finding) -> str:
    """A missing effect and its few numbers: the correct value of X_u (-0.050 ± 0.001, the file says 0)."""
    what, sizes = lacking(item), []
    for one in item.estimates:
        says = "" if one.stated is None else f", the file says {plus_minus(one.stated, 0.0)}"
        size = plus_minus(one.value, one.std)
        if one.name in TOWARDS:
            size = f"{size} {one.unit} to {TOWARDS[one.name]}"
        elif len(item.estimates) > 1 or one.name not in what.split():
            size = f"{one.name} {size}"
        sizes.append(f"{size}{says}")
    between = ", " if all(one.stated is None for one in item.estimates) else "; "
    told = 0 < len(sizes) <= MOST_SIZES and all(np.isfinite(one.value) for one in item.estimates)
    return f"{what} ({between.join(sizes)})" if told else what


def _advice(findings: Sequence[Finding]) -> str:
    """What to do about findings: first what would tell them from others, else by the kind of the first."""
    for item in findings:
        others = alternatives(item)
        if others and item.would_tell_apart is not None:
            return f"Sail {manoeuvre(item.would_tell_apart)} to tell {lacking(item)} from {listed(others, 'or')}"
    if any(alternatives(item) for item in findings):
        return "Sail other manoeuvres to tell these apart, before the vessel file is changed"
    if all(Claim.of(item) is Claim.LIKELY for item in findings):
        return f"Keep the vessel file; {MORE_RUNS}"
    causes = [item.cause for item in findings]
    if causes[0] in SENSORS:
        return "Correct the instruments; the extended vessel file describes them as they were"
    if causes[0] in WEATHER and (findings[0].keys or causes)[0].startswith(WEATHER):  # and not what measured wind does
        return "Use the extended vessel file for data in the same weather"
    if causes[0] == "late_orders":
        return "Set the clock of the orders, which no vessel file can, and diagnose again"
    if causes[0] == "change_point":
        return "Diagnose the data before and after the change separately"
    return "Use the extended vessel file, after a look at runs that it has not seen"


def remarks(
    unit: str,
    unexplained: Unexplained | None,
    signs: Sequence[Lead],
    refused: Sequence[str],
    instead: Sequence[str],
    beside: Sequence[str] = (),
) -> tuple[str, ...]:
    """What a verdict has no room for.

    Args:
        unit: what gains are measured on.
        unexplained: what remains, if that is much.
        signs: causes that are no findings.
        refused: causes with which the data would be simulated worse than without, and which are no findings so.
        instead: what no cause of the catalogue is, and explains about as much as the findings do.
        beside: what no cause of the catalogue is, and is left beside the findings.
    """
    found = []
    if refused:
        names, verb = (
            listed([sign_of(cause) for cause in refused]),
            "it is" if len(refused) == 1 else "they are",
        )
        found.append(f"With {names} the simulation of these data would diverge or be worse, so {verb} not written.")
    if instead:
        found.append(f"A cause outside the catalogue explains these data about as well: {listed(instead, 'or')}.")
    if beside:
        what = "which no cause of the catalogue is: look for that in the ship and her instruments"
        found.append(f"The error that is left beside the findings looks like {listed(beside)}, {what}.")
    if unexplained is not None:
        shares = [
            f"{_percent(share)} % off the {AXES[name]} error"
            for name, share in zip(unexplained.outputs, unexplained.force_share.tolist(), strict=True)
            if np.isfinite(share)
        ]
        found.append(f"A slowly varying force that nobody measured would take {listed(shares)}." if shares else "")
    leads = {lead.cause: f"{_lead(lead)} on {of}" for lead, of in _with_units(unexplained, signs, unit)}
    if leads:
        found.append(f"Not certain, by their gains on data held out: {listed([*leads.values()])}.")
    return tuple(text for text in found if text)


def _with_units(unexplained: Unexplained | None, signs: Sequence[Lead], unit: str) -> list[tuple[Lead, str]]:
    """Uncertain candidates that gain, the one that gains most first, each with what its gain is measured on."""
    of_remainder = [] if unexplained is None else [(lead, unexplained.unit) for lead in unexplained.leads]
    both = sorted([*((sign, unit) for sign in signs), *of_remainder], key=lambda pair: pair[0].gain)
    return [*{lead.cause: (lead, of) for lead, of in both if lead.gain > 0.0}.values()][::-1]


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _accuracy(found: Accuracy) -> str:
    return _capital(accuracy_in_words(found))


def _fits(unexplained: Unexplained) -> str:
    """How little is explained."""
    return _fits_in_words(unexplained.outputs, unexplained.fit)


def _fits_in_words(outputs: Sequence[str], fits: Array) -> str:
    rows = [(AXES[name], fit) for name, fit in zip(outputs, fits.tolist(), strict=True) if np.isfinite(fit)]
    diverged = [word for word, fit in rows if fit < DIVERGED_FIT]
    known = [f"{fit:.0f} % in {word}" for word, fit in rows if fit >= DIVERGED_FIT]
    parts = [f"the fit is {listed(known)}"] if known else []
    parts += [f"the simulation diverges in {listed(diverged)}"] if diverged else []
    return listed(parts) if parts else "the fit is not known, as nothing varies"


def _lead(lead: Lead) -> str:
    """An uncertain candidate with its gain."""
    low, high = lead.gain_interval
    but = "; but whole runs are simulated worse with it, or too few show it" if low > 0.0 else ""
    gain = f"{lead.gain:+.1f} points of fit, {low:.1f} to {high:.1f}{but}"
    return f"{sign_of(lead.cause, lead.parameters)} ({gain})"


def _benefits(findings: Sequence[Finding], unit: str) -> str:
    if len(findings) == 1:
        it = "them" if lacking(findings[0]).removeprefix("the correct ").startswith("values") else "it"
        return f"Adding {it} {benefit(findings[0])} on {unit} held out of the fit"
    return f"On {unit} held out of the fit, {listed([f'adding {lacking(item)} {benefit(item)}' for item in findings])}"


def accuracy_in_words(found: Accuracy) -> str:
    """How well a model simulates the data."""
    if has_diverged(found):
        return "simulated over whole runs, the model diverges from the ship"
    return _fits_in_words(found.outputs, found.fit)


def has_diverged(found: Accuracy) -> bool:
    """Whether the simulation of some output has diverged from the ship."""
    return bool((found.fit < DIVERGED_FIT).any())


def _percent(share: float) -> str:
    """Whole, but what is no zero is not called one."""
    whole = f"{100 * share:.0f}"
    return whole if whole not in ("0", "-0") else f"{100 * share:.1g}"
