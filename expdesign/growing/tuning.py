"""The tuning constants of the dictionary growth, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        draws: random draws of a family among which the search chooses.
        heading_rad: range of searched heading changes.
        helm_deg: largest searched helm angle.
        limit_rounding: excess over a limit that counts as rounding, as a share of its range.
        fewest_closed_loop: least number of candidates of a closed-loop family.
        closed_loop_share: closed-loop families, simulated one by one, get this many times fewer candidates and no
            local steps.
        batch: runs simulated together.
        leaders: best candidates of each family from which local steps start.
        offspring: local steps from each leader in one generation.
        strides: size of the local steps of each generation, as a share of each setting's range.
        redrawn: share of local steps that take another random draw, where the family has one.
        least_cost: least cost of a second of a run that makes way good, in seconds.
        free_form_excess: share of a range by which optimised commands may exceed a limit.
        iterations: most iterations of the optimal control solver.
        margin: share of each range kept from the limits, for the solver's integration error.
        modulus_rounding: moduli are smoothed within this share of a signal's size.
        end_motion: share of their ranges that sway and yaw rate may have at the end.
        calmness: weight of the squared changes of commands, relative to the initial sensitivity.
    """

    draws: int = 100_000
    heading_rad: tuple[float, float] = (0.05, 1.0)
    helm_deg: float = 35.0
    limit_rounding: float = 1e-9
    fewest_closed_loop: int = 8
    closed_loop_share: int = 32
    batch: int = 512
    leaders: int = 4
    offspring: int = 6
    strides: tuple[float, ...] = (0.25, 0.15, 0.1, 0.06, 0.04, 0.025, 0.015, 0.01)
    redrawn: float = 0.3
    least_cost: float = 0.02
    free_form_excess: float = 1e-6
    iterations: int = 300
    margin: float = 0.005
    modulus_rounding: float = 1e-3
    end_motion: float = 1e-3
    calmness: float = 1e-4


TUNING = Tuning()
