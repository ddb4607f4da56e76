"""Diagnosis as diagnosis.json, as tables for a terminal, and as a vessel file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from expdesign.conventions import plus_minus
from expdesign.diagnosis import Accuracy, Diagnosis, Estimate, Finding, Unexplained
from expdesign.diagnosis.accuracy import Residuals, dependence
from expdesign.export.files import entry, finite, strict_json, vessel_toml
from expdesign.export.files.text import named_finite
from expdesign.export.roll_changes import RollVerdict, roll_entry, roll_sentences, with_roll

SMALL = 1e-99  # p-values below are printed as this bound: they are beyond floating-point accuracy


def diagnosis_json(found: Diagnosis, roll: RollVerdict | None = None) -> str:
    """The whole diagnosis, with that of roll; numbers that are not finite are null."""
    return strict_json(
        {
            "baseline": accuracy_entry(found.before),
            "extended": accuracy_entry(found.after),
            "findings": [finding_entry(item, found.before.outputs) for item in found.findings],
            "verdict": found.verdict,
            "unexplained": None if found.unexplained is None else _unexplained(found.unexplained),
            "tested": [{"cause": cause, "p_value": finite(p_value)} for cause, p_value in found.screened],
            "notes": [*found.notes, *found.record.notes],
            "residuals": _residuals(found.residuals),
            **roll_entry(roll),
        }
    )


def _unexplained(found: Unexplained) -> dict[str, Any]:
    """What remains, and candidates that are not certain."""
    return {
        "fit": named_finite(found.outputs, found.fit),
        "force_share": named_finite(found.outputs, found.force_share),
        "candidates": [entry(lead, "cause", "gain", "gain_interval") for lead in found.leads],
    }


def _residuals(found: Residuals) -> dict[str, Any]:
    """Per output and variable: p-value of the test that the missing acceleration does not depend on the variable."""
    return {
        "stretch_s": found.stretch_s,
        "p_values": {
            output: {name: finite(dependence(found, output, name).p_value) for name in found.variables}
            for output in found.outputs
        },
    }


def accuracy_entry(item: Accuracy) -> dict[str, Any]:
    """Fit, rmse, bias and growth of a model."""
    return {
        "fit": named_finite(item.outputs, item.fit),
        "rmse": named_finite(item.outputs, item.rmse),
        "bias": named_finite(item.outputs, item.bias),
        "growth": [
            {"horizon_s": horizon, "rmse": named_finite(item.outputs, row)}
            for horizon, row in zip(item.horizons_s.tolist(), item.growth, strict=True)
        ],
        "fit_per_batch": [named_finite(item.outputs, row) for row in item.per_batch],
    }


def finding_entry(item: Finding, outputs: Sequence[str]) -> dict[str, Any]:
    """One finding."""
    return {
        "cause": item.cause,
        "estimate": {
            one.name: {"value": finite(one.value), "std": finite(one.std)}
            | ({} if one.stated is None else {"in_vessel_file": one.stated})
            for one in item.estimates
        },
        "p_value": finite(item.p_value),
        "fit_before": named_finite(outputs, item.fit_before),
        "fit_after": named_finite(outputs, item.fit_after),
        "error_falls_by": {
            reduction.output: {
                "share": finite(reduction.share),
                "interval": [finite(reduction.low), finite(reduction.high)],
            }
            for reduction in item.error_reductions
        },
        **entry(item, "gain", "gain_interval", "not_distinguishable_from", "would_tell_apart", "explanation"),
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
    begin = "Kept as it was" if not found.is_extended and roll is None else "Extended"
    comments = [f"{begin} by a diagnosis: {found.verdict}", *(item.explanation for item in found.findings)]
    comments += roll_sentences(roll)
    return vessel_toml(with_roll(found.extended, roll), comments=[*comments, *found.notes, f"Made by: {command}"])
