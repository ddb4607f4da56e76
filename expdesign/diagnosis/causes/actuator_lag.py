"""Actuators that follow their commands with a first-order lag."""

from __future__ import annotations

from expdesign.diagnosis.candidate import Candidate, Cause, Situation, Values
from expdesign.diagnosis.causes.words import first, rounded
from expdesign.diagnosis.extended import Extended

SAMPLES = (0.5, 2.0, 6.0)


def input_groups(situation: Situation) -> list[str]:
    """All inputs, those of one stem, single ones."""
    inputs = situation.ship.model.inputs
    stems = sorted({name.rstrip("0123456789") for name in inputs})
    groups = ["all", *(stems if len(stems) > 1 else []), *inputs]
    taken: dict[frozenset[str], str] = {}
    for group in groups:
        which = frozenset(n for n in inputs if group in ("all", n) or n.rstrip("0123456789") == group)
        taken.setdefault(which, group)
    return list(taken.values())


def followers(situation: Situation, kind: str, cause: str) -> tuple[Candidate, ...]:
    """A time of every group of inputs, tried at a few values."""
    if any(key.startswith(f"{kind}:") for key in situation.ship.effects):
        return ()
    sample = situation.windows.sample_s
    return tuple(
        Candidate(cause=cause, free={f"{kind}:{group}": samples * sample}, finite=True)
        for group in input_groups(situation)
        for samples in SAMPLES
    )


def _candidates(situation: Situation) -> tuple[Candidate, ...]:
    return followers(situation, "lag", "actuator_lag")


def _explain(values: Values, _ship: Extended) -> str:
    key, value, std = first(values)
    return (
        f"The error follows every change of command and dies out: {key.split(':')[1]} inputs lag behind their commands "
        f"with a time constant of {rounded(value, std)} s."
    )


ACTUATOR_LAG = Cause(name="actuator_lag", candidates=_candidates, explain=_explain, suspect="input change")
