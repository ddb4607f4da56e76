"""Actuators that follow their commands with a first-order lag, or at another slew rate than stated."""

from __future__ import annotations

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.model import ExtendedModel, group_columns, input_groups

SAMPLES = (0.5, 2.0, 6.0)
SHARES = (0.5, 1.5)


def open_groups(situation: Situation, kind: str) -> list[str]:
    """Groups of inputs without a stated effect of a kind, and those with one stated value.

    None once an effect of the kind was found.
    """
    ship = situation.ship
    if ship.has_found(f"{kind}:"):
        return []
    inputs = ship.model.inputs
    stated = {key.split(":", 1)[1] for key in ship.stated if key.startswith(f"{kind}:")}
    taken = {column for group in stated for column in group_columns(group, inputs)}
    return [group for group in input_groups(inputs) if group in stated or not taken & {*group_columns(group, inputs)}]


def followers(situation: Situation, kind: str, cause: str) -> tuple[Candidate, ...]:
    """Candidate times of every group of inputs, smaller and larger than the stated one."""
    sample, found = situation.windows.sample_s, []
    for group in open_groups(situation, kind):
        key = f"{kind}:{group}"
        stated = situation.ship.stated.get(key)
        times = [sample * number for number in SAMPLES] if stated is None else [stated * share for share in SHARES]
        found += [Candidate(cause=cause, free={key: time}, finite=True, positive=stated is None) for time in times]
    return tuple(found)


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    return followers(situation, "lag", "actuator_lag")


def _explain(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    return (
        f"The error occurs after each change of command and decays. {key.split(':')[1].capitalize()} inputs lag behind "
        f"their commands with a time constant of {rounded(value, std)} s."
    )


ACTUATOR_LAG = Cause(
    name="actuator_lag",
    summary="actuators that follow their commands with a first-order lag",
    candidates=_candidates,
    explain=_explain,
)


def _slewing(situation: Situation) -> tuple[Candidate, ...]:
    return tuple(item for item in followers(situation, "slew", "actuator_slew") if not item.positive)


def _explain_slew(values: Values, _ship: ExtendedModel) -> str:
    key, value, std = first(values)
    if value <= 0:
        return (
            f"The error occurs during changes of command. {key.split(':')[1].capitalize()} inputs follow them at once."
        )
    return (
        f"The error occurs during changes of command. {key.split(':')[1].capitalize()} inputs move at "
        f"{rounded(1.0 / value, std / value**2)} per second, another slew rate than stated."
    )


ACTUATOR_SLEW = Cause(
    name="actuator_slew",
    summary="actuators that move at another rate than stated",
    candidates=_slewing,
    explain=_explain_slew,
)
