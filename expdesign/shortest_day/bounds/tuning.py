"""The numbers of the bound on the day that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Work limits and tolerances. All but `rounding` decide only how near to the truth the bound comes.

    Attributes:
        fewest_sides, most_sides: of the polygon that holds the force of an azimuth; several azimuths share the most.
        first_boxes: about as many to begin with, at most.
        boxes: most that a class of motions is parted into, where the bound is proved; fewer above four dimensions.
        few_boxes: the same while the measure is searched.
        boxes_at_once: that are halved together.
        box_gap: relative gap at which halving ends.
        kept_points: best samples found, which the next measure may use.
        rounding: share by which the largest value is raised for the rounding of numbers.
        samples: drawn from a class of motions for the first measure.
        rounds: of adding samples to a measure.
        steps: of its weights in a round.
        gap: relative gap at which the measure is good enough.
        added: most samples added in a round.
        added_weight: of all of them.
        least_weight: of a sample, as a share of an equal one; others are left out.
        speeds: ranges of speed whose gain and loss are bounded.
        speed_rounds, speed_boxes: of halving boxes of such a range, and most halved at once.
        slow_start: share of the way's time that gaining speed must take for these boxes to be halved.
        searches: for the sample that tells most, each with a better measure.
    """

    fewest_sides: int = 4
    most_sides: int = 24
    first_boxes: int = 4096
    boxes: int = 200_000
    few_boxes: int = 20_000
    boxes_at_once: int = 2000
    box_gap: float = 0.02
    kept_points: int = 100
    rounding: float = 1e-9
    samples: int = 1500
    rounds: int = 40
    steps: int = 15
    gap: float = 0.01
    added: int = 40
    added_weight: float = 0.1
    least_weight: float = 1e-4
    speeds: int = 24
    speed_rounds: int = 20
    speed_boxes: int = 300
    slow_start: float = 0.01
    searches: int = 5


TUNING = Tuning()
