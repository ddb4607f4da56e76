"""The numbers of the shortest day that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Rounds and tolerances.

    Attributes:
        rounds: most days that are planned in search of the shortest.
        first_share: information from runs in the first day, as a share of what is needed; legs tell the rest.
        first_leg_s: time of repositioning for each run, before a day has been planned [s].
        level_step, level_steps: margin that is asked for besides where the cheapest runs were tried already, at most so
            many times.
        least_price: least cost of a run, as a share of its duration.
        cuts: most linear bounds on the accuracy in the choice of runs.
        blend: share of one run of everything that is added to singular information where a bound is made; grows
            tenfold until it is regular.
        reached: shortfall of the accuracy's margin that counts as reached.
        choice_gap: relative gap at which the choice of whole runs ends.
        choice_nodes: most nodes of its tree.
        most_runs: of one primitive.
    """

    rounds: int = 6
    first_share: float = 0.6
    first_leg_s: float = 60.0
    level_step: float = 0.05
    level_steps: int = 10
    least_price: float = 0.25
    cuts: int = 200
    blend: float = 1e-6
    reached: float = 1e-9
    choice_gap: float = 1e-3
    choice_nodes: int = 2000
    most_runs: int = 200


TUNING = Tuning()
