"""The tuning constants of pages, figures, cards and files, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        agreeing_std: largest relative difference of standard deviations that counts as agreement, apart from sampling
            error.
        biased: bias over standard deviation beyond which an estimator does not count as consistent.
        wide_axis: ratio of the ends of an axis above which it has fewer ticks.
        changed_inputs: change of inputs, summed in units of their standard deviations, that counts as one.
        drawn_stretches: stretches of data drawn in a diagnosis.
        smallest_p_value: p-values below are printed as this bound in tables.
        most_spreads: errors beyond so many standard deviations of the measurements are not drawn: the simulation has
            diverged.
        coloured_by_chance: probability that any panel is coloured if nothing depends on anything.
        fast_decay: growth of an initial error below which the table says that it decays.
        drawn_methods: largest number of methods in the figures of runs.
        line_points: points per line: more cannot be told apart at this size.
        shown_beyond: share of the measured range that is shown beyond it; simulations that leave it are cut off.
        least_fraction: time fractions below this count as none.
        uncharted_share: share of the allowed water that may be outside the charted depths that bound it.
        hulls: hulls drawn along the path of a primitive.
        footprint_seed: random seed of the footprint figure; the planner uses other random numbers.
        footprint_pieces: places of the hull along a run that its drawn footprint is made of.
        number_gap: least distance of the numbers of runs, as a share of the figure's width.
        order_tolerance: largest error of the condensed orders, as a share of the range of each signal; larger where
            `most_order_rows` is reached.
        most_order_rows: rows of orders on one sheet.
        called_order_s: mean time between orders below which they are too fast to be called out [s].
        runs_per_sheet: runs on one sheet.
        named_parameters: parameters named in the purpose of a run.
        farthest_danger_m: distance up to which the nearest danger is stated [m].
        compared_points: points on each leg where a route is compared with the track.
        waypoint_spacing: least distance between waypoints of the route for the bridge, in ship lengths.
        stop_radius: farthest that the ship goes from a waypoint it stays at, in ship lengths.
        corridor: cross-track distance where the water has room for it, in ship lengths.
        corridor_halvings: of the step from the corridor that is needed to the one that is wanted.
        named_letters: of a manoeuvre's name in the name of a waypoint.
        most_mixed_runs: runs in one leg.
        stop_cost: of each ship length that the ship goes from a waypoint it stays at, in legs.
        mixed_cost: of each run in a leg beyond the first, in legs.
        divided_cost: of a waypoint inside a run, in legs.
        wide_way_cost, wide_run_cost: of each ship length of cross-track distance, in legs.
        way_in_run_cost: of each ship length between runs that is sailed in the leg of a run, in legs.
        near_cost: of two waypoints that are too near to each other, in legs.
        dry_cost: of a corridor that leaves the water, in legs.
        fence_margin: room around the track, as a share of its extent, that the fence may cover.
        fence_halvings: of the slack by which the fence is simplified, until it keeps to the water.
        draft_poses: of the track of a refused plan at most.
        noticed: relative differences below this are not reported.
        drawing_loads: how many figures could be drawn while the library for them loads, for the progress told.
    """

    agreeing_std: float = 0.10
    biased: float = 0.5
    wide_axis: float = 10.0
    changed_inputs: float = 0.2
    drawn_stretches: int = 4
    smallest_p_value: float = 1e-12
    most_spreads: float = 3.0
    coloured_by_chance: float = 0.01
    fast_decay: float = 1e-3
    drawn_methods: int = 3
    line_points: int = 500
    shown_beyond: float = 0.6
    least_fraction: float = 1e-6
    uncharted_share: float = 1e-6
    hulls: int = 5
    footprint_seed: int = 0
    footprint_pieces: int = 40
    number_gap: float = 0.022
    order_tolerance: float = 0.02
    most_order_rows: int = 48
    called_order_s: float = 10.0
    runs_per_sheet: int = 3
    named_parameters: int = 4
    farthest_danger_m: float = 5000.0
    compared_points: int = 17
    waypoint_spacing: float = 2.0
    stop_radius: float = 2.5
    corridor: float = 1.0
    corridor_halvings: int = 6
    named_letters: int = 24
    most_mixed_runs: int = 2
    stop_cost: float = 1.5
    mixed_cost: float = 10.0
    divided_cost: float = 5.0
    wide_way_cost: float = 1.0
    wide_run_cost: float = 0.3
    way_in_run_cost: float = 0.4
    near_cost: float = 50.0
    dry_cost: float = 1000.0
    fence_margin: float = 0.1
    fence_halvings: int = 12
    draft_poses: int = 2000
    noticed: float = 0.02
    drawing_loads: float = 3.0


TUNING = Tuning()
