"""The chart for the planner: clearance grid, visibility graph, distance to the goal."""

from expdesign.plan.chart.clearance_grid import (
    ClearanceField,
    clearance_field,
    connects,
    narrowest_passage,
    reachable,
    resolved,
)
from expdesign.plan.chart.goal_distance import (
    GoalDistance,
    build_goal_distance,
    first_bends,
    path_over,
    shortest_path_tree,
    taut_bends,
)
from expdesign.plan.chart.visibility_graph import (
    CORNERS,
    KEPT_GRAPHS,
    Corners,
    Roadmap,
    VisibilityGraph,
    build_visibility_graph,
    opened,
    polyline_length,
    shore_corners,
    sight_lines,
    simplified,
    visibility_graph_of,
)
