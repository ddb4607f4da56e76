"""Diagnosis as diagnosis.json, as tables for a terminal, and as a vessel file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from expdesign.conventions import plus_minus
from expdesign.diagnosis import Accuracy, Diagnosis, Estimate, Finding, Unexplained
from expdesign.diagnosis.accuracy import Residuals, dependence
from expdesign.export import words
from expdesign.export.files import strict_json, vessel_toml
from expdesign.export.roll_words import change_words, stability_words
from expdesign.roll import UNITS
from expdesign.roll.record import RollChange, RollJudgement
from expdesign.values import Array
from expdesign.vessel import RollPendulum, Vessel

# Roll in a diagnosis: sentences, JSON, and the vessel with the changes found.

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


SMALL = 1e-99
"""p-values below are printed as this bound: they are beyond floating-point accuracy."""


def diagnosis_json(found: Diagnosis, roll: RollVerdict | None = None) -> str:
    """The whole diagnosis, with that of roll; numbers that are not finite are null."""
    return strict_json(
        {
            "baseline": accuracy_entry(found.before),
            "extended": accuracy_entry(found.after),
            "findings": [finding_entry(item, found.before.outputs) for item in found.findings],
            "verdict": found.verdict,
            "unexplained": None if found.unexplained is None else _unexplained(found.unexplained),
            "tested": [{"cause": cause, "p_value": _finite(p_value)} for cause, p_value in found.screened],
            "notes": [*found.notes, *found.record.notes],
            "residuals": _residuals(found.residuals),
            **roll_entry(roll),
        }
    )


def _unexplained(found: Unexplained) -> dict[str, Any]:
    """What remains, and candidates that are not certain."""
    return {
        "fit": _named(found.outputs, found.fit),
        "force_share": _named(found.outputs, found.force_share),
        "candidates": [
            {"cause": lead.cause, "gain": _finite(lead.gain), "gain_interval": [_finite(x) for x in lead.gain_interval]}
            for lead in found.leads
        ],
    }


def _residuals(found: Residuals) -> dict[str, Any]:
    """Per output and variable: p-value of the test that the missing acceleration does not depend on the variable."""
    return {
        "stretch_s": found.stretch_s,
        "p_values": {
            output: {name: _finite(dependence(found, output, name).p_value) for name in found.variables}
            for output in found.outputs
        },
    }


def accuracy_entry(item: Accuracy) -> dict[str, Any]:
    """Fit, rmse, bias and growth of a model."""
    return {
        "fit": _named(item.outputs, item.fit),
        "rmse": _named(item.outputs, item.rmse),
        "bias": _named(item.outputs, item.bias),
        "growth": [
            {"horizon_s": horizon, "rmse": _named(item.outputs, row)}
            for horizon, row in zip(item.horizons_s.tolist(), item.growth, strict=True)
        ],
        "fit_per_batch": [_named(item.outputs, row) for row in item.per_batch],
    }


def finding_entry(item: Finding, outputs: Sequence[str]) -> dict[str, Any]:
    """One finding."""
    return {
        "cause": item.cause,
        "estimate": {
            one.name: {"value": _finite(one.value), "std": _finite(one.std)}
            | ({} if one.stated is None else {"in_vessel_file": one.stated})
            for one in item.estimates
        },
        "p_value": _finite(item.p_value),
        "fit_before": _named(outputs, item.fit_before),
        "fit_after": _named(outputs, item.fit_after),
        "error_falls_by": {
            reduction.output: {
                "share": _finite(reduction.share),
                "interval": [_finite(reduction.low), _finite(reduction.high)],
            }
            for reduction in item.error_reductions
        },
        "gain": _finite(item.gain),
        "gain_interval": [_finite(value) for value in item.gain_interval],
        "not_distinguishable_from": list(item.not_distinguishable_from),
        "would_tell_apart": item.would_tell_apart,
        "explanation": item.explanation,
    }


def _in_file(item: Estimate) -> str:
    return "" if item.stated is None else f" (file: {plus_minus(item.stated, 0.0)})"


CAUSE_HEADER = ("cause", "estimate", "p", "gain of fit [points]", "not distinguishable from")


def cause_rows(found: Diagnosis) -> list[tuple[str, ...]]:
    """One row per finding, below `CAUSE_HEADER`."""
    return [
        (
            item.cause,
            ", ".join(f"{one.name} {plus_minus(one.value, one.std)}{_in_file(one)}" for one in item.estimates),
            f"{item.p_value:.1e}" if item.p_value > SMALL else f"< {SMALL:.0e}",
            f"{item.gain:.1f} ({item.gain_interval[0]:.1f} to {item.gain_interval[1]:.1f})",
            ", ".join(item.not_distinguishable_from) or "-",
        )
        for item in found.findings
    ]


def extended_vessel(found: Diagnosis, *, command: str, roll: RollVerdict | None = None) -> str:
    """The vessel file with all findings."""
    comments = [f"Extended by a diagnosis: {found.verdict}", *(item.explanation for item in found.findings)]
    comments += roll_sentences(roll)
    return vessel_toml(with_roll(found.extended, roll), comments=[*comments, *found.notes, f"Made by: {command}"])


def _named(outputs: Sequence[str], values: Array) -> dict[str, float | None]:
    return {name: _finite(value) for name, value in zip(outputs, values.tolist(), strict=True)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
