"""Roll that changed, in words and JSON: as a diagnosis judges it, and as a watch does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from expdesign.conventions import plus_minus
from expdesign.export import words
from expdesign.export.files import entry
from expdesign.roll import G_MPS2, UNITS
from expdesign.roll.record import CAUSES, LOAD, RollChange, RollJudgement
from expdesign.vessel import RollPendulum, Vessel

if TYPE_CHECKING:
    from expdesign.monitoring import RollEvent, RollWatch


def change_words(
    causes: Sequence[str],
    sizes: Sequence[float],
    stds: Sequence[float],
    *,
    load: tuple[float, float] | None,
    values: Mapping[str, float],
) -> str:
    """Causes with their sizes, as in `RollChange`; `values` are the parameters before."""
    return ", and ".join(
        _load(size, std, load) if cause == LOAD else _parameter(cause, size, std, values[cause])
        for cause, size, std in zip(causes, sizes, stds, strict=True)
    )


def _parameter(cause: str, size: float, std: float, value: float) -> str:
    share = f" ({100 * size / abs(value):+.3g} %)" if value else ""
    return f"{CAUSES[cause]}, {cause} by {plus_minus(size, std)} {UNITS[cause]}{share}"


def _load(size: float, std: float, load: tuple[float, float] | None) -> str:
    assert load is not None
    mass, height = load
    on = "on board" if mass > 0 else "taken off"
    return (
        f"{CAUSES[LOAD]}, a moment about the rotation axis of {plus_minus(-size, std)} kg m upwards, as of "
        f"{abs(mass):.3g} kg {on} at a height of {height:.3g} m"
    )


def stability_words(before: float, after: float, *, mass_kg: float, load: tuple[float, float] | None) -> str:
    """Righting moments [N m/rad] and metacentric heights, of a mass before and what was added."""
    total = mass_kg + (load[0] if load is not None else 0.0)
    heights = f"{before / (G_MPS2 * mass_kg):.3g} to {after / (G_MPS2 * total):.3g} m"
    return (
        f"Her righting moment goes from {before:.4g} to {after:.4g} N m/rad ({100 * (after / before - 1):+.3g} %), her "
        f"metacentric height from {heights}."
    )


UNCHANGED = "She rolls as her file says"


@dataclass(frozen=True, kw_only=True, eq=False)
class RollVerdict:
    """The judgement of the roll of a vessel file."""

    judgement: RollJudgement | None = None  # None where roll was not judged
    reason: str = ""  # why not


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
    told: dict[str, Any] = {"verdict": list(roll_sentences(roll))}
    found = roll.judgement
    if found is not None:
        told |= {
            "p_value": found.p_value,
            "changed": found.changed,
            "alarm_below": found.alarm_p,
            "explanations": [
                {"causes": _causes(one), **entry(one, "p_value", "righting_nm"), "load": _loaded(one.load)}
                for one in found.changes
            ],
            "estimate": {
                name: {"value": found.estimate.values[name], "std": std} for name, std in found.estimate.std.items()
            },
        }
    return {"roll": told}


def _causes(one: RollChange | RollEvent) -> dict[str, dict[str, float]]:
    sizes = zip(one.causes, one.sizes, one.stds, strict=True)
    return {cause: {"size": size, "std": std} for cause, size, std in sizes}


def _loaded(load: tuple[float, float] | None) -> dict[str, float] | None:
    return None if load is None else {"mass_kg": load[0], "height_m": load[1]}


def with_roll(ship: Vessel, roll: RollVerdict | None) -> Vessel:
    """The vessel with the change of roll, where a single explanation is left and a file can hold it."""
    changes = () if roll is None or roll.judgement is None else roll.judgement.changes
    if len(changes) != 1 or changes[0].pendulum is None:
        return ship
    return replace(ship, pendulum=changes[0].pendulum)


SHOWN = 5


def watch_sentences(watch: RollWatch | None, *, false_alarm_days: float) -> tuple[str, ...]:
    """The verdict on roll; nothing for a vessel file without [roll]."""
    return () if watch is None else tuple(_watched(watch, false_alarm_days))


def _watched(watch: RollWatch, days: float) -> Iterator[str]:
    if not watch.judged_s:
        why = f": {watch.reason}" if watch.reason else ""
        yield f"Roll, [roll] of the vessel file, was not judged{why}."
        return
    if not watch.alarms:
        same = "No alarm of roll" if watch.events else "She rolls as in the reference,"
        yield (
            f"{same} in {words.hours(watch.judged_s)} that were judged, with at most one false alarm of any kind in "
            f"{words.counted(days, 'day')} on average."
        )
    yield from (_event(event) for event in watch.events[-SHOWN:])
    if watch.left_out_s > watch.judged_s:
        yield f"{words.hours(watch.left_out_s)} give no information about roll; the last reason: {watch.reason}."


def _event(event: RollEvent) -> str:
    call = ", after a port call, which raises no alarm" if event.after_call else ""
    text = (
        f"She rolls otherwise since a time between {words.when(event.since_s)} and {words.when(event.time_s)}{call}: "
    )
    if not event.causes:
        return text + "no cause that is watched for explains it; expdesign roll estimates all."
    text += change_words(event.causes, event.sizes, event.stds, load=event.load, values=event.values) + ". "
    text += stability_words(*event.righting_nm, mass_kg=event.mass_kg, load=event.load)
    if event.others:
        text += f" Explained about as well by: {'; '.join(' and '.join(one) for one in event.others)}."
    return text if event.settled else text + " The size is not yet settled."


def watch_entry(watch: RollWatch | None, *, false_alarm_days: float) -> dict[str, Any]:
    """The entry of roll in monitor.json; nothing for a vessel file without [roll]."""
    if watch is None:
        return {}
    told = {
        "verdict": list(watch_sentences(watch, false_alarm_days=false_alarm_days)),
        "judged_h": watch.judged_s / words.HOUR,
        "not_judged_h": watch.left_out_s / words.HOUR,
        "changes": [_event_entry(event) for event in watch.events],
    }
    return {"roll": told}


def _event_entry(event: RollEvent) -> dict[str, Any]:
    return {
        **entry(event, "since_s", "time_s", "settled", "p_value", "righting_nm"),
        "alarm": not event.after_call,
        "causes": _causes(event),
        "load": _loaded(event.load),
        "as_likely": [list(causes) for causes in event.others],
    }
