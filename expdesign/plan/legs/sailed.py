"""Whether a helmsman who follows a leg's first guess comes to its end at the speed with which the next run begins.

A ship that has lost way in turns needs room to gather it again. Where the guess leaves her too little, there is hardly
ever a leg, and IPOPT goes to and fro at length before it gives up: simulating the leg once takes a hundredth of that.
"""

from __future__ import annotations

import numpy as np

from expdesign.plan.control import HelmShip, Helmsman, Reference, lengths
from expdesign.plan.legs.water import LegTask, LegWater
from expdesign.values import Array

SLOW_SHARE = 0.05  # of the speed at its end, by which a ship may be slower there
LONGER = 1.6  # times as long as guessed that she may take
LEAST_STEP = 0.2  # movement of a slow guess per sample, in that at transit speed


def gathers_speed(states: Array, duration_s: float, task: LegTask, water: LegWater, ship: HelmShip) -> bool:
    """Whether the ship is fast enough at the end of a guess (j + 1, 6) at even times, steered along it."""
    vessel, helm = water.vessel, Helmsman(vessel=water.vessel, environment=water.environment, ship=ship)
    count = max(2, round(duration_s / vessel.sample_time_s))
    shares = np.linspace(0.0, len(states) - 1.0, count + 1)
    guess = Reference(states=np.stack([np.interp(shares, np.arange(len(states)), x) for x in states.T], axis=1))
    least_m = LEAST_STEP * ship.transit_speed_mps * vessel.sample_time_s
    ahead = helm.answer_s / vessel.sample_time_s
    state, given, at = task.start[None], task.past, np.zeros(1)
    for _ in range(round(LONGER * count)):
        at = np.minimum(at + guess.abreast(at, state, step_m=least_m), count)
        desired = guess.at(at)
        desired[:, 3:] = guess.velocity_at(np.minimum(at + ahead, count))  # velocities respond with a lag
        row = helm.commands(desired, state, given[-1:])
        state = water.states(state[0], row, given)[-1:]
        given = water.remembered(np.concatenate([given, row]))
        if at[0] >= count:
            break
    return bool(lengths(state[:, 3:5])[0] >= (1.0 - SLOW_SHARE) * lengths(task.end[None, 3:5])[0])
