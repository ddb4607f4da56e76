"""What no day can fall below: the time of any motion of a class to tell enough, and to get to the goal."""

from expdesign.shortest_day.bounds.day import day_bound, fastest_mps, speed_changes, way_bound_s
from expdesign.shortest_day.bounds.fewest_samples import fewest_samples, richest_sample
from expdesign.shortest_day.bounds.motions import Motions
