"""The tuning constants of the durations, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived. Gaps and eigenvalues are relative: to the degree, to the largest.

    Attributes:
        largest_gap: designs with a wider gap are not returned.
        wide_gap: gap from which a design that no Newton step can sharpen is sought by other means, too.
        target_gap: gap at which Newton's method ends.
        rounding_gap: below this gap, a Newton step that does not halve it is the last: the rest is rounding.
        least_gap_of_step: gap to which the objective of a Newton step is scaled at least.
        newton_steps: most Newton steps; six to ten are usual, two or three from a conic optimum.
        margin: a fraction at its least value may change in a Newton step where its net sensitivity falls short of the
            others' by less, per degree.
        curvature_rounding: added to the diagonal of a curvature, as a share of its trace, to make it positive definite.
        floor_rounding: shortfall of a floor, as a logarithm, that counts as rounding.
        conic_candidates: most candidates of a problem that cvxpy solves as stated, and without a working set. With 18
            parameters and 3 means it takes 0.3 s of 14 candidates, 0.9 s of 300, 12 s of 10,000.
        conic_inequalities: most models and floors of such a problem; each costs as much again.
        solver_tolerance: gap and feasibility tolerance of the conic solver.
        lp_tolerance: feasibility and optimality tolerance of linear programmes.
        singular: eigenvalues below this are rounding.
        nearly_singular: below this, elimination loses digits that matter.
        outside_range: share of an estimated combination that may lie outside the range of a singular matrix.
        least_fraction: fractions less than this above their bound are set to it.
        loosening: share by which limits are loosened where they leave no interior.
        smallest_set: least size of a working set, and about as many as may join it at a time.
        set_per_dimension: the same per dimension of the information matrix.
        first_gap: to which the first working set is solved.
        sharper: ratio of the gaps of successive working sets.
        centring_steps: most Newton steps for one barrier weight.
        most_sets: working sets.
        barrier_fraction: fractions below this are removed from the solution of the barrier method.
        one_thread: multiplications in a matrix product up to which OpenBLAS uses one thread.
        indefinite: eigenvalues below minus this are not rounding.
        regular_set: least eigenvalue of a first working set.
        starts: random starts of a local search.
        definite: least eigenvalue, in scaled parameters, of a positive definite matrix.
        coincide: regressors coincide whose correlation, means included, falls short of 1 by less.
        negligible: eigenvalues of scaled information below this are rounding.
        small_weight: least weight in a null vector of a parameter that a message names.
        added_share: share of the optimal design added to every set of runs, so that singular ones compare.
        least_gain: gains of an exchange below this are rounding.
        equal_share: share of equal times added where the optimal design itself is nearly singular.
        least_gain_nearly_singular: `least_gain` there.
        named_pairs: pairs of merged regressors that a note names.
        insertions: primitives, best gain per second first, tried in an exchange of one run for several.
        tightened: factors on least information with which shares are sought whose whole runs keep it.
        all_subsets: up to this number, every subset of batches is evaluated.
    """

    largest_gap: float = 1e-6
    wide_gap: float = 1e-7
    target_gap: float = 1e-10
    rounding_gap: float = 1e-9
    least_gap_of_step: float = 1e-6
    newton_steps: int = 30
    margin: float = 0.01
    curvature_rounding: float = 1e-14
    floor_rounding: float = 1e-6
    conic_candidates: int = 300
    conic_inequalities: int = 5
    solver_tolerance: float = 1e-11
    lp_tolerance: float = 1e-10
    singular: float = 1e-13
    nearly_singular: float = 1e-10
    outside_range: float = 1e-6
    least_fraction: float = 1e-9
    loosening: float = 1e-9
    smallest_set: int = 50
    set_per_dimension: int = 4
    first_gap: float = 1e-2
    sharper: float = 1e-2
    centring_steps: int = 60
    most_sets: int = 60
    barrier_fraction: float = 1e-7
    one_thread: int = 260_000
    indefinite: float = 1e-9
    regular_set: float = 1e-8
    starts: int = 20
    definite: float = 1e-10
    coincide: float = 1e-9
    negligible: float = 1e-12
    small_weight: float = 0.05
    added_share: float = 1e-6
    least_gain: float = 1e-9
    equal_share: float = 1e-9
    least_gain_nearly_singular: float = 1e-6
    named_pairs: int = 3
    insertions: int = 200
    tightened: tuple[float, ...] = (1.05, 1.15, 1.3, 1.6)
    all_subsets: int = 20_000


TUNING = Tuning()
