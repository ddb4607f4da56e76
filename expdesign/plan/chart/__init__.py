"""The chart for the planner: clearance grid, visibility graph, distance to the goal."""

from expdesign.plan.chart.clearance_grid import ClearanceField, clearance_field, narrowest_passage
from expdesign.plan.chart.goal_distance import GoalWays, build_goal_ways, first_bends, ways_to
from expdesign.plan.chart.visibility_graph import Ways, build_ways, polyline_length, sight_lines, simplified

__all__ = [
    "ClearanceField",
    "GoalWays",
    "Ways",
    "build_goal_ways",
    "build_ways",
    "clearance_field",
    "first_bends",
    "narrowest_passage",
    "polyline_length",
    "sight_lines",
    "simplified",
    "ways_to",
]
