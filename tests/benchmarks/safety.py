"""Whole trials of drawn ships in drawn weather, sailed without a break: how many leave allowed water?

Run with the package installed: ``python tests/benchmarks/safety.py SCENARIO.toml [DRAWS]``, 500 draws by default. The
helmsman of `expdesign.plan.steering` follows each leg by the true state, from wherever the run before has left the
ship, and waits for a ship that lags; a run begins when its leg's reference has ended, from the state the ship really
has, and is sailed open loop. The nominal model and the forecast's mean current are all the helmsman knows. This asks
more than `leave_water_probability` does, which lets every run begin where it is planned to: here nobody goes back for
that. Slow actuators are not covered: the helmsman does not know them.
"""

from __future__ import annotations

import sys

import numpy as np
import shapely

from expdesign import workflows
from expdesign.plan.capability import capability
from expdesign.plan.safety import _leaves
from expdesign.plan.steering import Helmsman, Reference
from expdesign.plan.uncertainty import draw_truths
from expdesign.scenario import load_scenario
from expdesign.simulation import simulate_many


def steered(vessel, helm, reference, states, before, truth):
    """States (k, n, 6) of a leg until every ship has come to its reference's end, and the commands standing then."""
    n = len(states)
    sample, rows, last = np.zeros(n), [states], before
    for _ in range(2 * len(reference.states)):
        going = sample < len(reference.states) - 1
        if not going.any():
            break
        sample = np.minimum(
            sample + reference.pace(sample, states, vessel.length_m / 2) * going, len(reference.states) - 1
        )
        last = helm.commands(reference.at(sample), states, last)
        moved = simulate_many(vessel, last[:, None], pose=states[:, :3], velocity=states[:, 3:], **truth)[-1]
        states = np.where(going[:, None], moved, states)
        rows.append(states)
    return np.array(rows), last


def main(path: str, draws: int) -> None:
    """Print the share of trials that leave, by leg and in all."""
    case = load_scenario(path)
    information = workflows.scored(case)
    plan = workflows.planned(case, information, workflows.designed(case, information))
    vessel, area = case.vessel, case.area
    parameters, current, wind = draw_truths(vessel, case.environment, draws, np.random.default_rng(7))
    truth = {"parameters": parameters, "current_to": current, "wind_to": wind}
    helm = Helmsman(vessel=vessel, environment=case.environment, ship=capability(vessel, case.plan))
    track = np.hstack([plan.trajectory.pose, plan.trajectory.velocity])
    states, before = np.tile(track[0], (draws, 1)), np.zeros((draws, len(vessel.limits)))
    shapely.prepare(area.water)
    left = np.zeros(draws, dtype=bool)
    for index, leg in enumerate(plan.legs):
        if leg.kind == "reposition":
            reference = Reference(states=track[leg.first : leg.last + 1])
            rows, before = steered(vessel, helm, reference, states, before, truth)
        else:
            values = np.tile(plan.commands.values[leg.first : leg.last], (draws, 1, 1))
            rows = simulate_many(vessel, values, pose=states[:, :3], velocity=states[:, 3:], standing=before, **truth)
            before = values[:, -1]
        states = rows[-1]
        leaves = _leaves(area, vessel, rows)
        left |= leaves
        off_m = np.hypot(*(states[:, :2] - track[leg.last, :2]).T)
        print(
            f"{index:3d} {leg.kind:10s} {leg.name:28s} {leaves.mean():6.1%} leave, off at its end "
            f"{np.median(off_m):6.2f} m in the middle, {off_m.max():6.2f} m at most"
        )
    share, allowed = left.mean(), 1.0 - case.plan.confidence
    error = np.sqrt(max(share * (1 - share), 1 / draws) / draws)
    print(
        f"{draws} trials: {share:.2%} leave allowed water, standard error {error:.2%}, promised at most {allowed:.2%}"
    )


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 500)
