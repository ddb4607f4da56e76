"""Instruments: what the ship would have done by the rudder alone, without noise and waves.

The rudder moves sway, yaw and roll in ways that nobody models. Black boxes from rudder to each signal begin; from then
on roll rate and accelerometer come from the closed loop of the current parameters, driven by the rudder, the black
box's yaw rate and a side acceleration that is fitted through that loop. Errors of these models cost accuracy, not
consistency.

Source: doctoral thesis on grey-box identification of roll with few sensors, algorithms 2.1 and 5.1; the fitted side
acceleration takes the place of U r, which leaves v' out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from expdesign.roll.closed_loop import ClosedLoop, filtered, simulated
from expdesign.roll.regression import delayed, inside
from expdesign.roll.runs import Run
from expdesign.roll.tuning import TUNING
from expdesign.values import Array

BlackBox = tuple[Array, Array]
"""Numerator and denominator in powers of the delay."""


def black_box(inputs: Sequence[Array], outputs: Sequence[Array], orders: tuple[int, int]) -> BlackBox:
    """Least-squares ARX model from inputs (k,) to outputs (k,) of several runs, with its poles inside."""
    past, width = orders
    skip = max(past, width)
    tables = [
        np.column_stack([-delayed(y, range(1, past + 1)), delayed(u, range(width))])[skip:]
        for u, y in zip(inputs, outputs, strict=True)
    ]
    found = np.linalg.lstsq(np.concatenate(tables), np.concatenate([y[skip:] for y in outputs]), rcond=None)[0]
    return found[past:], inside(np.concatenate([[1.0], found[:past]]))


def black_box_signals(runs: Sequence[Run]) -> list[Array]:
    """(k, 4) signals of each run by black boxes from its rudder, which is the last column."""
    rudders = [run.signals[:, 3] for run in runs]
    boxes = [black_box(rudders, [run.signals[:, place] for run in runs], TUNING.black_box) for place in range(3)]
    return [np.column_stack([*(scipy.signal.lfilter(*box, rudder) for box in boxes), rudder]) for rudder in rudders]


def loop_signals(runs: Sequence[Run], loop: ClosedLoop, begun: Sequence[Array]) -> list[Array]:
    """(k, 4) signals of each run by the closed loop of a stable model.

    Args:
        runs: of one case.
        loop: stable.
        begun: (k, 4) of `black_box_signals`, whose yaw rate is kept.
    """
    sides = _side_accelerations(runs, loop, begun)
    result = []
    for run, first, side in zip(runs, begun, sides, strict=True):
        driven = np.column_stack([side, first[:, 2:]])
        result.append(np.column_stack([*simulated(loop, driven, run.step_s), first[:, 2:]]))
    return result


def _side_accelerations(runs: Sequence[Run], loop: ClosedLoop, begun: Sequence[Array]) -> list[Array]:
    """(k,) of each run, by the black box whose output makes the loop roll as measured."""
    seen, wanted = [], []
    for run, first in zip(runs, begun, strict=True):
        driven = filtered(loop.roll, loop.below, first[:, 2:] @ loop.gains, run.step_s)
        wanted.append(driven - run.signals[:, 0])
        seen.append(filtered(loop.roll, loop.below, run.signals[:, 3], run.step_s))
    box = black_box(seen, wanted, TUNING.side_black_box)
    return [scipy.signal.lfilter(*box, run.signals[:, 3]) for run in runs]
