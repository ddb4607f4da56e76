"""Durations for people: key numbers and tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.durations import (
    DurationDesign,
    Efficiencies,
    limits_kept,
)
from expdesign.workflows.outcome import TextTable


def design_summary(design: DurationDesign) -> dict[str, object]:
    """Key numbers."""
    chosen = {name: count for name, count in zip(design.problem.names, design.repeats, strict=True) if count}
    certified = design.gap_relative if np.isfinite(design.gap_relative) else None
    guaranteed = design.certificate.guaranteed
    return {
        "criterion": design.problem.aim.criterion,
        "runs": chosen,
        "certificate_gap": certified,
        **({} if np.isnan(guaranteed) else {"log_det": design.log_det, "log_det_guaranteed": guaranteed}),
        "efficiency_of_whole_runs": design.efficiency_repeats,
        "efficiency_of_equal_shares": design.efficiency_uniform,
        **({"note_on_whole_runs": design.note} if design.note else {}),
        **{f"price_of_{kept.name}": kept.price for kept in limits_kept(design)},
    }


def design_tables(design: DurationDesign, compared: Sequence[Efficiencies]) -> tuple[TextTable, ...]:
    """How long to run each primitive, every design under every criterion, and how limits are kept."""
    return (_shares_table(design), *_efficiency_tables(compared), *_limits_tables(design))


def _shares_table(design: DurationDesign) -> TextTable:
    proof = design.certificate
    net = design.sensitivities - proof.prices
    told = [f"{value:.4f}" if kept else "excluded" for value, kept in zip(net, design.problem.included, strict=True)]
    columns = zip(design.problem.names, design.fractions, design.durations_s, design.repeats, told, strict=True)
    return TextTable(
        title=f"How long to run each primitive; at the optimum those used have sensitivity {proof.level:.6g}",
        header=("primitive", "share", "seconds", "whole runs", "sensitivity"),
        rows=tuple(
            (name, f"{share:.4f}", f"{seconds:.1f}", str(runs), sensitivity)
            for name, share, seconds, runs, sensitivity in columns
        ),
    )


def _efficiency_tables(compared: Sequence[Efficiencies]) -> tuple[TextTable, ...]:
    known = [item for item in compared if item.of]
    columns = list(known[0].of) if known else []
    tables = [
        TextTable(
            title="Efficiency of designs by every criterion, 1 for its own optimum",
            header=("criterion", "makes least", *columns),
            rows=tuple((item.criterion, item.title, *(f"{item.of[name]:.3f}" for name in columns)) for item in known),
        )
    ]
    missing = tuple((item.criterion, item.missing) for item in compared if item.missing)
    if missing:
        tables.append(TextTable(title="Criteria not compared", header=("criterion", "because"), rows=missing))
    return tuple(tables)


def _limits_tables(design: DurationDesign) -> tuple[TextTable, ...]:
    rows = tuple(
        (item.name, f"{item.limit:.5g}", f"{item.continuous:.5g}", f"{item.repeats:.5g}", f"{item.price:.3g}")
        for item in limits_kept(design)
    )
    header = ("limit", "asked", "optimal shares", "whole runs", "price")
    return (TextTable(title="Limits on the durations", header=header, rows=rows),) if rows else ()
