"""What no day can fall below: the time of any motion of a class to tell enough, and to get to the goal."""

from expdesign.shortest_day.bounds.day import day_bound, fastest_mps, way_bound_s
from expdesign.shortest_day.bounds.fewest_samples import SampleBound, fewest_samples
from expdesign.shortest_day.bounds.motions import Motions
from expdesign.shortest_day.bounds.richest import Richest, richest_sample
from expdesign.shortest_day.bounds.under_way import SpeedChanges, speed_changes

__all__ = [
    "Motions",
    "Richest",
    "SampleBound",
    "SpeedChanges",
    "day_bound",
    "fastest_mps",
    "fewest_samples",
    "richest_sample",
    "speed_changes",
    "way_bound_s",
]
