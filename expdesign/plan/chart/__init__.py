"""The chart for the planner: clearance grid, visibility graph, distance to the goal."""

from expdesign.plan.chart.clearance_grid import ClearanceField, clearance_field, narrowest_passage
from expdesign.plan.chart.goal_distance import (
    GoalDistance,
    build_goal_distance,
    first_bends,
    path_over,
    shortest_path_tree,
    taut_bends,
)
from expdesign.plan.chart.reachable import connects, reachable, resolved
from expdesign.plan.chart.tuning import CHART
from expdesign.plan.chart.visibility_graph import (
    Corners,
    VisibilityGraph,
    build_visibility_graph,
    polyline_length,
    sight_lines,
    simplified,
    visibility_graph_of,
)

__all__ = [
    "CHART",
    "ClearanceField",
    "Corners",
    "GoalDistance",
    "VisibilityGraph",
    "build_goal_distance",
    "build_visibility_graph",
    "clearance_field",
    "connects",
    "first_bends",
    "narrowest_passage",
    "path_over",
    "polyline_length",
    "reachable",
    "resolved",
    "shortest_path_tree",
    "sight_lines",
    "simplified",
    "taut_bends",
    "visibility_graph_of",
]
