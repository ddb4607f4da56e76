"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Legs: optimisation, paths and recovery.

    Attributes:
        search_boxes: margins of the boxes searched for Dubins paths round a leg's ends, in turning radii plus hull
            lengths.
        search_iterations, search_slices: iterations of the path planner between looks for a solution, and how often
            at most.
        search_batches: batches of samples after which it gives up.
        improving_slices: spent on a shorter path after the first solution.
        roadmap_places: drawn for a roadmap besides the shores' corners, in `roadmap_tries` tries at most.
        shortcuts: shares of a path that shortcuts span, tried one after the other, `shortcut_tries` of each at
            most, and no more after `shortcut_misses` without a gain.
        corridor_hulls: width of corridors to either side at most, in hull lengths.
        memory_time_constants: after which a lagging actuator has forgotten: two parts in a thousand million are left.
        arrival: largest miss of a leg's end state, in hull lengths, and in transit speeds.
        beyond_ends: largest speed and yaw rate of legs whose ends are faster than legs need be, in those of their ends.
        smoothness: weight of squared command steps against time in units of `LegProblem.time_scale_s`.
        smallness: weight of squared commands: decides between commands that give the same force.
        nodes: numbers of nodes tried while the time is free.
        free_samples: least and largest time between samples while it is free, in sample times.
        unlimited: share of the largest from which on a transition would last for ever.
        settled: miss of what lagging actuators deliver at the end, relative to the largest.
        iterations: of IPOPT at most.
        programs: nonlinear programs kept built.
        guess_nodes: of first guesses of agile legs.
        transition_nodes: of optimised transitions at most.
        whole_samples: up to which straight agile legs are optimised as a whole.
        remembered_commands: that are looked back at while steering.
        bend_radii: lengths over which bends of agile legs' paths are rounded, in turning radii.
        slow_share: transit speeds below which a helm-steered ship is about to accelerate from rest or to stop.
        straights: shares tried of `straight_off_hulls`, of the hull lengths to settle before a run-up, and of the
            stopping distance before a goal.
        helm_node: time between nodes of helm-steered legs, in that of a hull length at transit speed.
        eased_hulls: hull lengths over which their first guess eases into turns.
        straight_off_hulls: straight before the first turn, as the helm takes that long to act.
        transit_hulls: shortest straight that is sailed with constant commands, in hull lengths.
        transit_ends_hulls: of straights before and after it that are optimised with the rest of the leg.
        straight_rad: change of course from point to point of a path from which on it bends.
        heading_rounds: of the search for the heading that makes good a course in a current.
        counter_helm: helm against a residual turn, per yaw rate, in times of a hull length at transit speed.
        recovered_share: yaw rate at which the ship has recovered, in that of a leg's turns.
        recovery_hulls: time after which a recovery ends in any case, in that of a hull length at transit speed.
        escaped_radii: turning radii from a place at which a ship has escaped from it.
        escape_arc_rad: turn of one arc of the escape check; straights are as long.
        escape_cell, escape_courses: cells of its search: their size in turning radii, and courses to half a circle.
        escape_arcs: checked at most.
    """

    search_boxes: tuple[float, ...] = (4.0, 40.0)
    search_iterations: int = 1500
    search_slices: int = 4
    search_batches: int = 100
    improving_slices: int = 1
    roadmap_places: int = 500
    roadmap_tries: int = 50_000
    shortcuts: tuple[float, ...] = (1.0, 0.3, 0.1, 0.03)
    shortcut_tries: int = 200
    shortcut_misses: int = 60
    corridor_hulls: float = 3.0
    memory_time_constants: float = 20.0
    arrival: float = 1e-3
    beyond_ends: float = 1.02
    smoothness: float = 0.02
    smallness: float = 1e-4
    nodes: tuple[int, ...] = (12, 18, 24, 32, 44, 60, 80, 110, 160)
    free_samples: tuple[float, float] = (0.2, 3.0)
    unlimited: float = 0.999
    settled: float = 1e-4
    iterations: int = 100
    programs: int = 24
    guess_nodes: int = 40
    transition_nodes: int = 24
    whole_samples: float = 100.0
    remembered_commands: int = 5000
    bend_radii: tuple[float, ...] = (1.5, 0.8, 0.4)
    slow_share: float = 0.3
    straights: tuple[tuple[float, float, float], ...] = (
        (1.0, 2.0, 1.0),
        (1.0, 1.0, 0.7),
        (0.5, 0.5, 0.4),
        (0.0, 0.0, 0.1),
    )
    helm_node: float = 0.25
    eased_hulls: float = 1.0
    straight_off_hulls: float = 1.0
    transit_hulls: float = 20.0
    transit_ends_hulls: float = 6.0
    straight_rad: float = 1e-6
    heading_rounds: int = 8
    counter_helm: float = 3.0
    recovered_share: float = 0.05
    recovery_hulls: float = 8.0
    escaped_radii: float = 2.5
    escape_arc_rad: float = 0.35
    escape_cell: float = 0.25
    escape_courses: int = 12
    escape_arcs: int = 6000


LEGS = Tuning()
