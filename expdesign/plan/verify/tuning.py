"""Tuning constants of the verification of plans that several modules read."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.simulation.run import SUBSTEPS


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    # integrator steps per sample of the re-simulation: ten times as many as in planning
    fine_substeps: int = 10 * SUBSTEPS


TUNING = Tuning()
