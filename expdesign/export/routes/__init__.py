"""The plan as a route: chords of the track, few legs for the bridge, corridor, fence."""

from expdesign.export.routes.build import build_bridge_route, build_route
from expdesign.export.routes.read_plan import PlannedTrack, planned_track, read_plan, require_verified
from expdesign.export.routes.route import DEGREE_DECIMALS, ROUTE_NAME, Route, Waypoint, build_fence
