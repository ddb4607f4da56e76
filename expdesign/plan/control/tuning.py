"""Numbers of this package that are chosen, not derived, and that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Capability, controllers and tracking."""

    approach_hulls: float = 1.0  # hull lengths that a helm-steered ship goes straight and steady before each run
    settling_hulls: float = 2.0  # hull lengths before that in which what is left of a turn dies out
    catch_up: float = 0.3  # largest speed towards the reference, in transit speeds
    track_lead: float = 4.0  # time constant of the return to the reference, in those of the velocities
    run_up_time_constants: float = 3.0  # of the return to the track, that the run-up of a force-steered ship lasts


CONTROL = Tuning()
