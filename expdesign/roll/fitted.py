"""An estimate as the roll pendulum of a vessel."""

from __future__ import annotations

from expdesign.roll.estimate import RollEstimate
from expdesign.vessel import ROLL_PARAMETERS, RollPendulum


def fitted_pendulum(estimate: RollEstimate) -> RollPendulum:
    """The ship without load, with the estimate's uncertainty; parameters that were held or given count as known.

    Raises:
        InputError: the estimate is no pendulum, as its inertia is not positive.
    """
    stds = {name: std for name, std in estimate.std.items() if name in ROLL_PARAMETERS and std > 0}
    place = estimate.problem.free.index
    return RollPendulum(
        body=estimate.problem.body,
        parameters={name: estimate.values[name] for name in ROLL_PARAMETERS},
        parameter_std=stds,
        parameter_correlation={
            (one, other): float(estimate.covariance[place(one), place(other)] / (stds[one] * stds[other]))
            for one in stds
            for other in stds
            if place(other) < place(one)
        },
    )
