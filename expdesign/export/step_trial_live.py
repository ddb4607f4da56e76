"""A step trial while it is sailed: sentences for the crew, and what is left to sail as a file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from expdesign import __version__
from expdesign.export.files.text import csv_text, strict_json
from expdesign.export.step_trial_content import unit_of
from expdesign.step_trials.live import Event, Inputs, Listed, State, StepList, in_sequence
from expdesign.vessel import column_name

TO_DO_HEADER = ("step", "set", "why")


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveContent:
    """The values that the files show."""

    steps: StepList  # the list
    state: State  # after the last row
    constants_s: tuple[float, float]  # expected time constants of U and r [s]
    notes: tuple[str, ...]  # on the data
    command: str  # to reproduce it


def event_line(event: Event, steps: StepList) -> str:
    """One line about an event."""
    return f"{event.time_s:8.1f} s  {_event_words(event, steps)}{_following(event, steps)}"


def _event_words(event: Event, steps: StepList) -> str:
    step = f"step {event.step.number}" if event.step is not None else "this hold"
    commands = inputs_text(event.inputs, steps) if event.inputs else ""
    at = "" if event.state is None else f"U {event.state[0]:.2f} m/s over ground, r {event.state[1]:.3f} rad/s"
    texts = {
        "learnt": f"the noise is learnt at {1 / event.seconds if event.seconds else 0:.3g} samples a second",
        "begun": f"{step} begins: {commands}" if event.step is not None else f"on the way to a step: {commands}",
        "steady": f"{step} is steady at {at}: hold it for {event.seconds:.0f} s more"
        + (", a whole turn" if event.whole_turn else ""),
        "over": f"{step} is over, steady at {at}" if event.step is not None else f"steady at {at}",
        "bad": f"{step} is bad: {event.why}" + ("; it will be repeated at the end" if event.step is not None else ""),
        "left out": f"{step} is bad again and left out: {event.why}",
        "gap": f"a gap of {event.seconds:.1f} s in the data" + (f" spoils {step}" if event.step is not None else ""),
        "unlisted": f"the commands are no step of the list: {commands}",
        "done": "all steps are done",
    }
    return texts[event.kind]


def _following(event: Event, steps: StepList) -> str:
    if event.following is None:
        return ""
    inputs, step = event.following
    what = f"next step: {step.number}, " if step is not None else "next, on the way to a step: "
    return f"; {what}set {inputs_text(inputs, steps)}"


def inputs_text(inputs: Inputs, steps: StepList) -> str:
    """`n1 = 12 rps, rudder1 = 0.1 rad (5.7 deg)`."""
    return ", ".join(_input_text(name, value) for name, value in zip(steps.names, inputs, strict=True))


def _input_text(name: str, value: float) -> str:
    unit = unit_of(name)
    degrees = f" ({math.degrees(value):.1f} deg)" if unit == "rad" else ""
    return f"{name} = {round(value, 9) + 0.0:.4g} {unit}".rstrip() + degrees


def to_do_rows(content: LiveContent) -> Iterator[tuple[Inputs, Listed | None]]:
    """Commands still to be set one after the other, from a steady start at the first."""
    yield from in_sequence(content.state.left, None, content.steps)


def to_do_table(content: LiveContent) -> list[tuple[str, ...]]:
    """Under `TO_DO_HEADER`."""
    return [
        ("" if step is None else str(step.number), inputs_text(inputs, content.steps), _why(step))
        for inputs, step in to_do_rows(content)
    ]


def _why(step: Listed | None) -> str:
    if step is None:
        return "on the way to a step"
    return f"to repeat: {step.why}" if step.why else "not sailed yet"


def to_do_csv(content: LiveContent) -> str:
    """A list of steps again: commands in their order, the number of the step that each is, and why it is to do."""
    columns = [column_name(name) for name in content.steps.names]
    rows = (
        ("" if step is None else str(step.number), *(repr(value) for value in inputs), _why(step).replace(",", ";"))
        for inputs, step in to_do_rows(content)
    )
    return csv_text(("step", *columns, "why"), rows)


def live_json(content: LiveContent) -> str:
    """Steps that count, those to sail and those left out, with units in the names."""
    state = content.state
    return strict_json(
        {
            "finished": [
                {
                    "step": one.number, "begins_s": one.begins_s, "steady_after_s": one.steady_s,
                    "U_mps": one.state[0], "U_std_mps": one.state_std[0], "r_radps": one.state[1],
                    "r_std_radps": one.state_std[1],
                }
                for one in state.finished
            ],
            "U_is": "over ground",
            "to_do": _steps_json(state.left, content.steps),
            "left_out": _steps_json(state.left_out, content.steps),
            "expected_time_constants_s": dict(zip("Ur", content.constants_s, strict=True)),
            "sample_time_s": state.sample_time_s or None,
            "notes": list(content.notes),
            "command": content.command,
            "version": __version__,
        }
    )  # fmt: skip


def _steps_json(listed: Sequence[Listed], steps: StepList) -> list[dict[str, object]]:
    columns = [column_name(name) for name in steps.names]
    return [
        {
            "step": one.number,
            "before": dict(zip(columns, one.before, strict=True)),
            "after": dict(zip(columns, one.after, strict=True)),
            "attempts": one.attempts,
            "why": one.why,
        }
        for one in listed
    ]


def live_sentences(content: LiveContent) -> list[str]:
    """The findings."""
    state, count = content.state, len(content.steps.steps)
    found = [f"Steps that count: {len(state.finished)} of {count}."]
    if state.finished:
        found.append("Speeds U of steps are over ground: a current is in them, which identify-steps finds from turns.")
    if state.left:
        unsailed = sum(not step.attempts for step in state.left)
        found.append(f"{len(state.left)} to be sailed: {unsailed} not begun, {len(state.left) - unsailed} to repeat.")
    if state.left_out:
        found.append(
            "Left out after repeated failures: " + ", ".join(str(step.number) for step in state.left_out) + "."
        )
    return found
