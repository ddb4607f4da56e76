"""Roll in a diagnosis: sentences, JSON, and the vessel with the changes found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from expdesign.export import words
from expdesign.export.files import plus_minus
from expdesign.export.roll_words import change_words, stability_words
from expdesign.roll import UNITS
from expdesign.roll.record import RollChange, RollJudgement
from expdesign.vessel import RollPendulum, Vessel

UNCHANGED = "She rolls as her file says"


@dataclass(frozen=True, kw_only=True, eq=False)
class RollVerdict:
    """The judgement of the roll of a vessel file.

    Attributes:
        judgement: None where roll was not judged.
        reason: why not.
    """

    judgement: RollJudgement | None = None
    reason: str = ""


def roll_sentences(roll: RollVerdict | None) -> tuple[str, ...]:
    """The verdict; nothing for a vessel file without [roll]."""
    if roll is None:
        return ()
    if roll.judgement is None:
        return (f"Roll, [roll] of the vessel file, was not judged: {roll.reason}.",)
    return tuple(_sentences(roll.judgement))


def _sentences(found: RollJudgement) -> Iterator[str]:
    pendulum, estimate = found.pendulum, found.estimate
    if not found.changed:
        near = ", ".join(
            f"{name} {plus_minus(estimate.values[name], estimate.std[name])} {UNITS[name]}" for name in ("k", "d")
        )
        yield (
            f"{UNCHANGED}, within the standard deviations that the file states: a ship that rolls so differs at least "
            f"as much in {words.percent(found.p_value)} of records. The file has {_stated(pendulum, 'k', 'd')}. This "
            f"record alone gives {near}, if K_vd and z_f are exactly those of the file, which has "
            f"{_stated(pendulum, 'K_vd', 'z_f')}."
        )
        return
    if not found.changes:
        yield (
            "She does not roll as her file says, by more than two causes: expdesign roll estimates all parameters. "
            "No cause is named."
        )
        return
    best, *others = found.changes
    yield f"She does not roll as her file says. What explains it: {_words(found, best)}."
    yield _stability(found, best)
    if others:
        yield f"Explained about as well by: {'; or '.join(_words(found, one) for one in others)}."


def _stated(pendulum: RollPendulum, *names: str) -> str:
    """Parameters as the file has them."""
    stds = pendulum.parameter_std
    return ", ".join(f"{name} {plus_minus(pendulum.parameters[name], stds.get(name, 0.0))}" for name in names)


def _words(found: RollJudgement, change: RollChange) -> str:
    values = found.pendulum.parameters
    return change_words(change.causes, change.sizes, change.stds, load=change.load, values=values)


def _stability(found: RollJudgement, change: RollChange) -> str:
    before = found.pendulum
    mass_kg = before.body.mass_kg + before.load.mass_kg
    return stability_words(before.righting_nm, change.righting_nm, mass_kg=mass_kg, load=change.load)


def roll_entry(roll: RollVerdict | None) -> dict[str, Any]:
    """The entry of roll in diagnosis.json; nothing for a vessel file without [roll]."""
    if roll is None:
        return {}
    entry: dict[str, Any] = {"verdict": list(roll_sentences(roll))}
    found = roll.judgement
    if found is not None:
        entry |= {
            "p_value": found.p_value,
            "changed": found.changed,
            "alarm_below": found.alarm_p,
            "explanations": [_change(one) for one in found.changes],
            "estimate": {
                name: {"value": found.estimate.values[name], "std": std} for name, std in found.estimate.std.items()
            },
        }
    return {"roll": entry}


def _change(one: RollChange) -> dict[str, Any]:
    load = None if one.load is None else {"mass_kg": one.load[0], "height_m": one.load[1]}
    sizes = zip(one.causes, one.sizes, one.stds, strict=True)
    return {
        "causes": {cause: {"size": size, "std": std} for cause, size, std in sizes},
        "p_value": one.p_value,
        "righting_nm": one.righting_nm,
        "load": load,
    }


def with_roll(ship: Vessel, roll: RollVerdict | None) -> Vessel:
    """The vessel with the change of roll, where a single explanation is left and a file can hold it."""
    changes = () if roll is None or roll.judgement is None else roll.judgement.changes
    if len(changes) != 1 or changes[0].pendulum is None:
        return ship
    return replace(ship, pendulum=changes[0].pendulum)
