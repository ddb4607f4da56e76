"""The verdict of a diagnosis: missing effects, their gains and open questions in one sentence, then what remains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.diagnosis.accuracy import Accuracy
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import AHEAD_S, validation_units
from expdesign.diagnosis.values import VISIBLE, ErrorReduction, Finding, Lead, Unexplained

DIVERGED_FIT = -300.0
"""Fit [%] below which the simulation has diverged from the ship; the number then has no meaning."""
MISSING_EFFECTS = {
    "parameters": "the correct values of some parameters",
    "current": "a current",
    "wind": "wind",
    "thrust_gain": "the correct thrust gain",
    "thrust_advance_loss": "the loss of thrust with speed",
    "thruster_asymmetry": "an asymmetry of thrust",
    "actuator_lag": "the lag of the actuators",
    "actuator_delay": "the dead time of the actuators",
    "actuator_slew": "the slew rate of the actuators",
    "actuator_deadband": "the dead band of the actuators",
    "actuator_scale": "the scale of the rudder angle",
    "load_change": "the correct inertia",
    "heading_bias": "the misalignment of a sensor",
    "lever_arm": "the distance of a sensor from amidships",
    "sensor_delay": "the delay of a sensor",
    "log_scale": "the scale of the log",
    "gyro_scale": "the scale of the rate gyro",
    "shallow_water": "shallow water",
    "roll_coupling": "an oscillation like roll",
    "change_point": "a change of the ship during the trial",
}
"""Cause -> missing effect of the simulation."""
WORDS = {"u": "surge", "v": "sway", "r": "yaw"}
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


LITTLE_FIT = 50.0
"""Fit [%] of an output below which data are not called free of error, whatever noise there is."""
MOST_NAMED = 3
"""Parameters in a sentence."""


def missing_effect(cause: str, parameters: Sequence[str] = ()) -> str:
    """Missing effect of a cause, e.g. of "missing_term:Y_r"; wrong values of parameters by their names."""
    kind, _, term = cause.partition(":")
    if kind == "unlisted_term":
        return term
    if kind == "parameters" and parameters:
        named = [*parameters[:MOST_NAMED], *["others"] * (len(parameters) > MOST_NAMED)]
        return f"the correct value{'s' if len(parameters) > 1 else ''} of {listed(named)}"
    return f"the term {term}" if kind == "missing_term" else MISSING_EFFECTS[kind]


def lacking(item: Finding) -> str:
    """Missing effect of a finding: as of its cause, but an offset is named after its actuators."""
    kind, _, group = (item.keys or ("",))[0].partition(":")
    parameters = [key.split(":", 1)[1] for key in item.keys if key.startswith("theta:")]
    return f"the offset of the {group} angle" if kind == "offset" else missing_effect(item.cause, parameters)


def manoeuvre(name: str) -> str:
    """A proposal in words."""
    return MANOEUVRES.get(name, f"the manoeuvre {name}")


def benefit(item: Finding) -> str:
    """Effect of adding it on the output with the most certain gain, e.g. "cuts the sway error by 52 % (45 to 60 %)"."""
    known = [reduction for reduction in item.error_reductions if np.isfinite(reduction.share)]
    if not known:
        return f"gains {item.gain:.1f} points of fit"
    best = max(known, key=lambda reduction: reduction.low)
    if best.share >= VISIBLE:
        return _reduction(best)
    return "reduces no error by 1 % or more" if item.predicted is None else _prediction(item.predicted)


def _prediction(item: ErrorReduction) -> str:
    interval = f"({_percent(item.low)} to {_percent(item.high)} %)"
    return f"takes {_percent(item.share)} % {interval} off the squared error of predictions from sample to sample"


def _reduction(best: ErrorReduction, verbs: tuple[str, str] = ("halves", "cuts")) -> str:
    halves, cuts = verbs
    interval = f"({_percent(best.low)} to {_percent(best.high)} %)"
    if abs(best.share - 0.5) < 0.025:
        return f"{halves} the {WORDS[best.output]} error {interval}"
    return f"{cuts} the {WORDS[best.output]} error by {_percent(best.share)} % {interval}"


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
    refused: Sequence[str] = (),
    kinds: Sequence[str] = (),
    instead: Sequence[str] = (),
) -> str:
    """What the simulation lacks, in one sentence; then one sentence for each thing that remains.

    Args:
        findings: by what the model loses without each.
        before: accuracy of the model in use.
        unit: what gains are measured on.
        unexplained: what remains, if that is much.
        within_std: what uncertain parameters gain within their standard deviations, if that is clear.
        signs: causes that are significant in a test and no findings, where the error is more than noise.
        refused: causes with which the data would be simulated worse than without, and which are no findings so.
        kinds: what else the error looks like, which no cause of the catalogue is and no model can get.
        instead: the same of what explains about as much as the findings do.
    """
    beyond = [f"No known cause matches what remains: it looks like {listed(kinds)}"] if kinds else []
    remains = [] if unexplained is None else _remainder(unexplained, unit, "Much remains unexplained")
    harmful = _refused(refused)
    if not findings and kinds:
        return _sentences([*beyond, _capital(accuracy_in_words(before))])
    if not findings and within_std:
        best = _reduction(max(within_std, key=lambda item: item.low), verbs=("halve", "cut"))
        within = f"Parameters re-estimated within their stated standard deviations {best} on {unit} held out"
        return _sentences([within, *(remains or ["No other cause is certain"])])
    if not findings and unexplained is not None:
        little = "The simulation explains little of these data and no cause is certain"
        return _sentences([*_remainder(unexplained, unit, little), *harmful])
    if not findings and (signs or refused):
        named = [_lead(item) for item in signs]
        open_signs = [f"Signs of {listed(named)} improve nothing for certain on {unit} held out"] if named else []
        certain = f"No cause of the remaining error is certain: {accuracy_in_words(before)}"
        return _sentences([certain, *open_signs, *harmful])
    if not findings and (before.fit < LITTLE_FIT).any():
        little = "The simulation explains little of these data, and no cause of the catalogue explains more"
        noise = "What remains is like the noise of the sensors, which may hide the motion or an error of it"
        return _sentences([f"{little}: {accuracy_in_words(before)}", noise])
    if not findings:
        return _sentences([f"These data show no error of the model: {accuracy_in_words(before)}"])
    lacks = [f"The simulation lacks {listed([lacking(item) for item in findings])}"]
    lacks += [_benefits(findings, unit), *_invisible(findings)]
    lacks += [_open_question(item) for item in findings if item.not_distinguishable_from]
    others = listed(instead, "or") if instead else ""
    also = [f"A cause outside the catalogue explains these data about as well: {others}"] if others else []
    return _sentences(["; ".join(lacks), *harmful, *remains, *also, *beyond])


def doubted(faults: Sequence[str]) -> str:
    """What is to be looked at before any cause is believed: the first fault of the record itself; "" without any."""
    return "".join(f"Look at the record first: {fault.rstrip('.')}. " for fault in faults[:1])


def _sentences(texts: Sequence[str]) -> str:
    return " ".join(f"{text}." for text in texts)


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _remainder(unexplained: Unexplained, unit: str, opening: str) -> list[str]:
    """How little is explained, what an unmeasured force would account for, and the best candidates."""
    rows = list(zip([WORDS[name] for name in unexplained.outputs], unexplained.fit.tolist(), strict=True))
    diverged = [word for word, fit in rows if fit < DIVERGED_FIT]
    fits = [f"{fit:.0f} % in {word}" for word, fit in rows if fit >= DIVERGED_FIT]
    parts = [f"the fit is {listed(fits)}"] if fits else []
    parts += [f"the simulation diverges in {listed(diverged)}"] if diverged else []
    shares = [
        f"{_percent(share)} % off the {word} error"
        for (word, _), share in zip(rows, unexplained.force_share.tolist(), strict=True)
    ]
    sentences = [
        f"{opening}: {listed(parts)}",
        f"A slowly varying force that nobody measured would take {listed(shares)}",
    ]
    if unexplained.leads:
        verb = "candidate is" if len(unexplained.leads) == 1 else "candidates are"
        named = listed([_lead(lead) for lead in unexplained.leads])
        sentences += [f"The best uncertain {verb} {named} on {unit} held out"]
    return sentences


def _lead(lead: Lead) -> str:
    """An uncertain candidate with its gain."""
    low, high = lead.gain_interval
    return f"{missing_effect(lead.cause, lead.parameters)} ({lead.gain:+.1f} points of fit, {low:.1f} to {high:.1f})"


def _benefits(findings: Sequence[Finding], unit: str) -> str:
    if len(findings) == 1:
        return f"adding it {benefit(findings[0])} on {unit} held out of the fit"
    first, *others = [f"{lacking(item)} {benefit(item)}" for item in findings]
    return f"on {unit} held out of the fit, {listed([f'adding {first}', *others])}"


def _invisible(findings: Sequence[Finding]) -> list[str]:
    """Findings that are significant and yet do not improve the simulation visibly."""
    small = [
        item
        for item in findings
        if item.error_reductions and item.predicted is None and not any(map(_is_visible, item.error_reductions))
    ]
    if not small:
        return []
    names = "it" if len(findings) == 1 else listed([lacking(item) for item in small])
    verb = "is" if len(small) == 1 else "are"
    return [f"{names} {verb} significant in a test, but too small to show in velocities as noisy as these"]


def _refused(causes: Sequence[str]) -> list[str]:
    """Causes that would harm the simulation."""
    if not causes:
        return []
    names = listed([missing_effect(cause) for cause in causes])
    verb = "it is" if len(causes) == 1 else "they are"
    return [f"With {names} the simulation of these data would diverge or be worse, so {verb} not written"]


def _is_visible(reduction: ErrorReduction) -> bool:
    return reduction.share >= VISIBLE


def _open_question(item: Finding) -> str:
    """Alternatives of a finding, and the manoeuvre that distinguishes them."""
    alternatives = listed([missing_effect(name) for name in item.not_distinguishable_from], "or")
    if item.would_tell_apart is None:
        return f"these data cannot distinguish {lacking(item)} from {alternatives}"
    verb = "explains" if len(item.not_distinguishable_from) == 1 else "explain"
    return (
        f"{manoeuvre(item.would_tell_apart)} would distinguish {lacking(item)} from {alternatives}, which "
        f"{verb} these data as well"
    )


def accuracy_in_words(found: Accuracy) -> str:
    """How well a model simulates the data."""
    if has_diverged(found):
        return "simulated over whole runs, the model diverges from the ship"
    rows = zip(found.outputs, found.fit.tolist(), strict=True)
    return f"the fit is {listed([f'{value:.0f} % in {WORDS[name]}' for name, value in rows])}"


def has_diverged(found: Accuracy) -> bool:
    """Whether the simulation of some output has diverged from the ship."""
    return bool((found.fit < DIVERGED_FIT).any())


def listed(words: Sequence[str], last: str = "and") -> str:
    """A, B and C."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f}".replace("-0", "0")
