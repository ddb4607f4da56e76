"""The chart for the planner: clearance grid, visibility graph, distance to the goal."""

from expdesign.plan.chart.goal_distance import (
    ClearanceField,
    GoalDistance,
    build_goal_distance,
    clearance_field,
    connects,
    first_bends,
    narrowest_passage,
    path_over,
    reachable,
    resolved,
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
