"""The tuning constants of the verification of plans, in one place."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.simulation.run import SUBSTEPS


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        fine_substeps: integrator steps per sample of the re-simulation: ten times as many as in planning.
        entry_tolerance: largest deviation of a run's entry velocity, relative to the vessel's speed in the plan.
        speed_tolerance: share by which legs may exceed their stated speed, or that of their faster end: plans limit it
            at some samples.
    """

    fine_substeps: int = 10 * SUBSTEPS
    entry_tolerance: float = 0.02
    speed_tolerance: float = 0.03


TUNING = Tuning()
